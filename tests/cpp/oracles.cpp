#include "oracles.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>

namespace test {

Svd svd(const MatrixXd& a) {
  const Eigen::JacobiSVD<MatrixXd> oracle(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return {oracle.matrixU(), oracle.singularValues(), oracle.matrixV()};
}

VectorXd singular_values(const MatrixXd& a) { return Eigen::JacobiSVD<MatrixXd>(a).singularValues(); }

LongVector singular_values(const LongMatrix& a) { return Eigen::JacobiSVD<LongMatrix>(a).singularValues(); }

VectorXd least_squares(const MatrixXd& a, const VectorXd& b) { return a.completeOrthogonalDecomposition().solve(b); }

MatrixXd pseudo_inverse(const MatrixXd& a) { return a.completeOrthogonalDecomposition().pseudoInverse(); }

int rank(const MatrixXd& a) { return static_cast<int>(a.completeOrthogonalDecomposition().rank()); }

MatrixXd null_space(const MatrixXd& a) {
  const Eigen::FullPivHouseholderQR<MatrixXd> qr(a.transpose());
  return MatrixXd(qr.matrixQ()).rightCols(a.cols() - qr.rank());
}

MatrixXd solve(const MatrixXd& a, const MatrixXd& b) { return Eigen::HouseholderQR<MatrixXd>(a).solve(b); }

MatrixXd cholesky(const MatrixXd& a) { return a.llt().matrixL(); }

VectorXd eigenvalues(const MatrixXd& a) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(a, Eigen::EigenvaluesOnly).eigenvalues();
}

VectorXd generalised_eigenvalues(const MatrixXd& a, const MatrixXd& b) {
  return Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd>(a, b, Eigen::EigenvaluesOnly).eigenvalues();
}

}  // namespace test
