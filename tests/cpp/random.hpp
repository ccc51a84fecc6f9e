#pragma once
// Seeded random matrices, poses and arms for the tests. Every test makes its own Random, so that each case can be run
// alone and gives the same numbers.

#include <cmath>
#include <random>

#include <sigmaik/chain.hpp>
#include <sigmaik/types.hpp>

namespace test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}

  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  double normal() { return std::normal_distribution<double>()(engine_); }
  int integer(int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine_); }
  bool chance(double p) { return uniform(0.0, 1.0) < p; }
  /// 10^low … 10^high, evenly in the exponent.
  double decades(double low, double high) { return std::pow(10.0, uniform(low, high)); }

  MatrixXd matrix(int m, int n);
  VectorXd vector(int n);
  VectorXd unit(int n);

  /// m×k with orthonormal columns.
  MatrixXd orthonormal(int m, int k);

  /// m×n with the given singular values, min(m, n) of them.
  MatrixXd with_singular_values(int m, int n, const VectorXd& sigma);

  Eigen::Matrix3d rotation();
  sigmaik::Pose pose(double size = 1.0);

  /// A chain of n movable joints. Lengths are about `size` metres.
  sigmaik::Chain chain(int n, double prismatic = 0.0, double size = 0.5);

  sigmaik::JointVector configuration(int n);

 private:
  std::mt19937_64 engine_;
};

/// Singular values from large to small, as random as a rule may meet them: well apart, repeated, near a threshold of
/// 0.1, tiny, and exactly zero. The largest is `scale`.
VectorXd random_singular_values(Random& random, int k, double scale);

}  // namespace test
