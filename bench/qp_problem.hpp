#pragma once
// The velocity problem as a QP solver sees it: min ½|J q̇ − ẋ|² + ½ε|q̇|², |q̇_i| ≤ limit.

#include "scene.hpp"

namespace bench {

struct QpProblem {
  Eigen::Matrix<double, 7, 7> hessian;
  Eigen::Matrix<double, 7, 1> gradient;
  static constexpr double kLimit = 3.14;  // rad/s

  void set(const sigmaik::Jacobian& jacobian, const sigmaik::Twist& twist) {
    hessian = jacobian.transpose() * jacobian + 1e-6 * Eigen::Matrix<double, 7, 7>::Identity();
    gradient = -jacobian.transpose() * twist;
  }
};

}  // namespace bench
