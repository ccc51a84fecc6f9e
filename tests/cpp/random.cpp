#include "random.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include <Eigen/QR>

namespace test {

MatrixXd Random::matrix(int m, int n) {
  return MatrixXd::NullaryExpr(m, n, [this] { return normal(); });
}

VectorXd Random::vector(int n) { return matrix(n, 1); }

VectorXd Random::unit(int n) { return vector(n).normalized(); }

MatrixXd Random::orthonormal(int m, int k) {
  return Eigen::HouseholderQR<MatrixXd>(matrix(m, k)).householderQ() * MatrixXd::Identity(m, k);
}

MatrixXd Random::with_singular_values(int m, int n, const VectorXd& sigma) {
  const int k = static_cast<int>(sigma.size());
  const MatrixXd right = orthonormal(n, k), left = orthonormal(m, k);
  return left * sigma.asDiagonal() * right.transpose();
}

Eigen::Matrix3d Random::rotation() {
  Eigen::Matrix3d r = orthonormal(3, 3);
  if (r.determinant() < 0.0) r.col(0) = -r.col(0);
  return r;
}

sigmaik::Pose Random::pose(double size) {
  sigmaik::Pose p = sigmaik::Pose::Identity();
  p.linear() = rotation();
  for (int i = 2; i >= 0; --i) p.translation()[i] = size * uniform(-1, 1);
  return p;
}

sigmaik::Chain Random::chain(int n, double prismatic, double size) {
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

sigmaik::JointVector Random::configuration(int n) {
  return sigmaik::JointVector::NullaryExpr(n, [this] { return uniform(-3.0, 3.0); });
}

VectorXd random_singular_values(Random& random, int k, double scale) {
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
