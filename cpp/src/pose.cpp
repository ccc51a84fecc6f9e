#include <sigmaik/pose.hpp>

#include <cmath>

#include "asked_pose.hpp"
#include "finite.hpp"
#include "length.hpp"

namespace sigmaik {

Eigen::Vector3d rotation_log(const Eigen::Matrix3d& rotation) noexcept {
  // Through the unit quaternion (w, x), which is well conditioned at every angle: angle = 2 atan2(|x|, w).
  Eigen::Quaterniond quaternion(rotation);
  double w = quaternion.w();
  Eigen::Vector3d x = quaternion.vec();
  if (w < 0.0) {
    w = -w;
    x = -x;
  }
  const double sine = detail::length(x);
  if (sine == 0.0) return Eigen::Vector3d::Zero();
  if (w < 1e-15) {  // a half turn: both signs of the axis are right
    for (int i = 0; i < 3; ++i) {
      if (std::abs(x[i]) < 1e-9) continue;
      if (x[i] < 0.0) x = -x;
      break;
    }
  }
  return (2.0 * std::atan2(sine, w) / sine) * x;
}

Eigen::Matrix3d rotation_exp(const Eigen::Vector3d& vector) noexcept {
  const double angle = detail::length(vector);
  if (angle == 0.0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix();
}

Eigen::Vector3d rotation_exp_rate(const Eigen::Vector3d& vector, const Eigen::Vector3d& rate) noexcept {
  const double square = vector.squaredNorm(), angle = std::sqrt(square);
  // Below this angle, the next term of each series is less than rounding, and the quotients begin to lose digits.
  const bool small = angle < 1e-2;
  const double sine = std::sin(0.5 * angle);
  const double a = small ? 0.5 - square / 24.0 + square * square / 720.0 : 2.0 * sine * sine / square;
  const double b = small ? 1.0 / 6.0 - square / 120.0 + square * square / 5040.0
                         : (angle - std::sin(angle)) / (square * angle);
  const Eigen::Vector3d once = vector.cross(rate);
  return rate + a * once + b * vector.cross(once);
}

Eigen::Vector3d rotation_log_rate(const Eigen::Vector3d& vector, const Eigen::Vector3d& omega) noexcept {
  // J⁻¹ = I − ½ [φ]× + (1 − (θ/2) cot(θ/2))/θ² [φ]×²
  const double square = vector.squaredNorm(), half = 0.5 * std::sqrt(square);
  const double b = half < 1e-2 ? 1.0 / 12.0 + square / 720.0 + square * square / 30240.0
                               : (1.0 - half / std::tan(half)) / square;
  const Eigen::Vector3d once = vector.cross(omega);
  return omega - 0.5 * once + b * vector.cross(once);
}

Twist pose_error(const Pose& current, const Pose& target) noexcept {
  Twist error;
  error.head<3>() = target.translation() - current.translation();
  error.tail<3>() = rotation_log(target.linear() * current.linear().transpose());
  return error;
}

namespace {

constexpr double kRough = 2e-9;  // a change of R by δ is a defect of 2 δ

Eigen::Matrix3d defect_of(const Eigen::Matrix3d& r) noexcept {
  return r.transpose().lazyProduct(r) - Eigen::Matrix3d::Identity();
}

double size_of(const Eigen::Matrix3d& defect) noexcept { return defect.cwiseAbs().maxCoeff(); }

// What is_pose() asks for beside RᵀR = I.
bool is_right_handed(const PoseMatrix& matrix) noexcept {
  return matrix.row(3) == Eigen::RowVector4d(0.0, 0.0, 0.0, 1.0) && matrix.topLeftCorner<3, 3>().determinant() > 0.0;
}

Eigen::Matrix3d nearest_rotation(Eigen::Matrix3d matrix, Eigen::Matrix3d defect) noexcept {
  // Each step squares the defect: 9e-4, 6e-7, 3e-13, rounding.
  for (int i = 0; i < 4 && size_of(defect) >= 1e-14; ++i) {
    const Eigen::Matrix3d change = 0.5 * matrix.lazyProduct(defect);  // the product reads what the difference writes
    matrix -= change;
    defect = defect_of(matrix);
  }
  return matrix;
}

}  // namespace

bool is_pose(const PoseMatrix& matrix) noexcept {
  const Eigen::Matrix3d r = matrix.topLeftCorner<3, 3>();
  return detail::finite(matrix) && is_right_handed(matrix) && size_of(defect_of(r)) <= kRotationTolerance;
}

Eigen::Matrix3d nearest_rotation(Eigen::Matrix3d matrix) noexcept {
  return nearest_rotation(matrix, defect_of(matrix));
}

Pose nearest_pose(const Pose& pose) noexcept {
  Pose out = pose;
  out.linear() = nearest_rotation(pose.linear());
  return out;
}

bool is_rough(const Pose& pose) noexcept { return size_of(defect_of(pose.linear())) > kRough; }

detail::AskedPose::AskedPose(const Pose& asked) noexcept : pose(asked) {
  if (!finite(asked.matrix()) || !is_right_handed(asked.matrix())) return;
  const Eigen::Matrix3d defect = defect_of(asked.linear());
  valid = size_of(defect) <= kRotationTolerance;
  if (!valid) return;
  rough = size_of(defect) > kRough;
  pose.linear() = nearest_rotation(asked.linear(), defect);
}

}  // namespace sigmaik
