#pragma once
// The problems of an arm's cycle as QP solvers see them. `Velocity`: min |J q̇ − ẋ|² + ε|q̇|², |q̇_i| ≤ limit.
// `Constrained`: the linear velocity exactly, the angular one as well as the box allows, which is tight enough to
// matter in most cycles.

#include "scene.hpp"

namespace bench {

inline constexpr double kDamping = 1e-6;  // makes the QP strictly convex, which most of the solvers need

struct VelocityProblem {
  Eigen::Matrix<double, 7, 7> hessian;
  Eigen::Matrix<double, 7, 1> gradient;
  static constexpr double kLimit = 3.14;  // rad/s

  void set(const sigmaik::Jacobian& jacobian, const sigmaik::Twist& twist) {
    hessian = jacobian.transpose() * jacobian + kDamping * Eigen::Matrix<double, 7, 7>::Identity();
    gradient = -jacobian.transpose() * twist;
  }
};

struct ConstrainedProblem {
  Eigen::Matrix<double, 3, 7> linear, angular;
  Eigen::Vector3d v, omega;
  static constexpr double kLimit = 1.0;  // rad/s

  void set(const sigmaik::Jacobian& jacobian, const sigmaik::Twist& twist) {
    linear = jacobian.topRows<3>();
    angular = jacobian.bottomRows<3>();
    v = twist.head<3>();
    omega = twist.tail<3>();
  }
  Eigen::Matrix<double, 7, 7> hessian() const {
    return angular.transpose() * angular + kDamping * Eigen::Matrix<double, 7, 7>::Identity();
  }
  Eigen::Matrix<double, 7, 1> gradient() const { return -angular.transpose() * omega; }
};

}  // namespace bench
