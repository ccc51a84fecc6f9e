#pragma once
// Seeded random matrices, poses and arms for the tests. Every test makes its own Random, so that each case can be run
// alone and gives the same numbers.

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <Eigen/QR>

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

  MatrixXd matrix(int m, int n) {
    return MatrixXd::NullaryExpr(m, n, [this] { return normal(); });
  }
  VectorXd vector(int n) { return matrix(n, 1); }
  VectorXd unit(int n) { return vector(n).normalized(); }

  /// m×k with orthonormal columns.
  MatrixXd orthonormal(int m, int k) {
    return Eigen::HouseholderQR<MatrixXd>(matrix(m, k)).householderQ() * MatrixXd::Identity(m, k);
  }

  /// m×n with the given singular values, min(m, n) of them.
  MatrixXd with_singular_values(int m, int n, const VectorXd& sigma) {
    const int k = static_cast<int>(sigma.size());
    return orthonormal(m, k) * sigma.asDiagonal() * orthonormal(n, k).transpose();
  }

  Eigen::Matrix3d rotation() {
    Eigen::Matrix3d r = orthonormal(3, 3);
    if (r.determinant() < 0.0) r.col(0) = -r.col(0);
    return r;
  }

  sigmaik::Pose pose(double size = 1.0) {
    sigmaik::Pose p = sigmaik::Pose::Identity();
    p.linear() = rotation();
    p.translation() = size * Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    return p;
  }

  /// A chain of n movable joints. Lengths are about `size` metres.
  sigmaik::Chain chain(int n, double prismatic = 0.0, double size = 0.5) {
    std::vector<sigmaik::Segment> segments;
    for (int i = 0; i < n; ++i) {
      sigmaik::Segment s;
      s.joint_name = "j" + std::to_string(i);
      s.link_name = "l" + std::to_string(i);
      s.type = chance(prismatic) ? sigmaik::JointType::Prismatic
               : chance(0.3)     ? sigmaik::JointType::Continuous
                                 : sigmaik::JointType::Revolute;
      s.origin = pose(size);
      s.axis = unit(3);
      segments.push_back(s);
    }
    sigmaik::Segment tool;
    tool.joint_name = "tool_joint";
    tool.link_name = "tool";
    tool.origin = pose(size);
    segments.push_back(tool);
    return sigmaik::Chain("base", segments);
  }

  sigmaik::JointVector configuration(int n) {
    return sigmaik::JointVector::NullaryExpr(n, [this] { return uniform(-3.0, 3.0); });
  }

 private:
  std::mt19937_64 engine_;
};

/// Singular values from large to small, as random as a rule may meet them: well apart, repeated, near a threshold of
/// 0.1, tiny, and exactly zero. The largest is `scale`.
inline VectorXd random_singular_values(Random& random, int k, double scale) {
  VectorXd sigma(k);
  sigma[0] = 1.0;
  for (int i = 1; i < k; ++i) {
    switch (random.integer(0, 5)) {
      case 0: sigma[i] = sigma[i - 1]; break;
      case 1: sigma[i] = 0.0; break;
      case 2: sigma[i] = 0.1 * (1.0 + random.decades(-14.0, -1.0) * (random.chance(0.5) ? 1.0 : -1.0)); break;
      case 3: sigma[i] = random.decades(-14.0, -1.0); break;
      default: sigma[i] = random.uniform(0.02, 1.0);
    }
  }
  std::sort(sigma.data(), sigma.data() + k, [](double a, double b) { return a > b; });
  return scale * sigma;
}

}  // namespace test
