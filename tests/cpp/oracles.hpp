#pragma once
// Eigen's decompositions as oracles. They are compiled once, in oracles.cpp: each of them takes a compiler seconds.

#include <Eigen/Core>

namespace test {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using LongVector = Eigen::Matrix<long double, Eigen::Dynamic, 1>;

/// a = u diag(sigma) vᵀ, with square u and v.
struct Svd {
  MatrixXd u;
  VectorXd sigma;
  MatrixXd v;
};
Svd svd(const MatrixXd& a);

/// The singular values, from large to small.
VectorXd singular_values(const MatrixXd& a);
LongVector singular_values(const LongMatrix& a);

/// The shortest x among those with the least |a x − b|.
VectorXd least_squares(const MatrixXd& a, const VectorXd& b);
MatrixXd pseudo_inverse(const MatrixXd& a);
int rank(const MatrixXd& a);
/// Orthonormal columns that span the null space of a.
MatrixXd null_space(const MatrixXd& a);

/// x with a x = b, for a square regular a.
MatrixXd solve(const MatrixXd& a, const MatrixXd& b);
/// L with L Lᵀ = a.
MatrixXd cholesky(const MatrixXd& a);

/// The eigenvalues of a symmetric a, from small to large.
VectorXd eigenvalues(const MatrixXd& a);
/// λ with a x = λ b x, for symmetric a and positive definite b.
VectorXd generalised_eigenvalues(const MatrixXd& a, const MatrixXd& b);

}  // namespace test
