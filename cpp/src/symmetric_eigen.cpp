#include "symmetric_eigen.hpp"

#include <Eigen/Eigenvalues>

namespace sigmaik::detail {

SymmetricEigen symmetric_eigen(const JointMatrix& a) noexcept {
  // Eigen 3.4's solver does not compile for an unaligned matrix of variable size, which a JointMatrix is.
  using Aligned = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMaxJoints, kMaxJoints>;
  const Eigen::SelfAdjointEigenSolver<Aligned> solver{Aligned(a)};
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace sigmaik::detail
