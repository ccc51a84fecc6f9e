#include "position_ik_rows.hpp"

#include <algorithm>
#include <cmath>

#include <sigmaik/pose.hpp>

namespace sigmaik::detail {
namespace {

constexpr double kBeyond = 1e-12;     // [m, rad] a row that is less outside is not
constexpr double kDifference = 1e-5;  // [rad, or L] of central differences: errors of about 1e-10

Eigen::Matrix3d skew(const Eigen::Vector3d& x) noexcept {
  Eigen::Matrix3d out;
  out << 0.0, -x[2], x[1], x[2], 0.0, -x[0], -x[1], x[0], 0.0;
  return out;
}

// The rotation that takes the direction `from` to `to` the short way, and −∂/∂ω of it where `from` turns at ω. With the
// angle θ, the unit axis u and w = u × from: ψ = θ u, and the matrix is u uᵀ + θ cot θ w wᵀ − θ from wᵀ.
Eigen::Vector3d between(const Eigen::Vector3d& from, const Eigen::Vector3d& to, Eigen::Matrix3d* rate) noexcept {
  constexpr double kLeast = -10.0;  // of θ cot θ, which goes to −∞ at a half turn, where the axis may be any
  const Eigen::Vector3d cross = from.cross(to);
  const double sine = cross.norm(), cosine = from.dot(to), angle = std::atan2(sine, cosine);
  if (sine < 1e-9 && cosine > 0.0) {
    if (rate != nullptr) *rate = Eigen::Matrix3d::Identity() - from * from.transpose();
    return cross;
  }
  const Eigen::Vector3d u = sine < 1e-9 ? from.unitOrthogonal() : Eigen::Vector3d(cross / sine), w = u.cross(from);
  if (rate != nullptr) {
    const double cotangent = std::max(angle * cosine / std::max(sine, 1e-9), kLeast);
    *rate = u * u.transpose() + (cotangent * w - angle * from) * w.transpose();
  }
  return angle * u;
}

}  // namespace

PoseRows::PoseRows(const PositionIkOptions& options, double length, double hold)
    : task_(options.task), cone_(options.cone.has_value()), length_(length) {
  int rows = 0, held = 0;
  bool ranges = false;
  for (int i = 0; i < 6; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const bool asked = task_.mask[k], exact = asked && options.exact[k];
    lower_[i] = options.ranges[k][0];
    upper_[i] = options.ranges[k][1];
    ranges = ranges || lower_[i] != 0.0 || upper_[i] != 0.0;
    equalities_ += asked && lower_[i] == upper_[i];
    rows += asked;
    held += exact;
    hold_[i] = exact ? 1.0 : 0.0;
    weight_[i] = asked ? (i < 3 ? 1.0 / length : 1.0) : 0.0;
  }
  if (cone_) {
    axis_ = options.cone->axis.normalized();
    angle_ = options.cone->angle;
    equalities_ -= angle_ > 0.0 ? 3 : 1;
  }
  some_held_ = held > 0 && held < rows;
  if (some_held_) weight_.array() *= 1.0 + (hold - 1.0) * hold_.array();
  plain_ = rows == 6 && !ranges && !cone_ && !some_held_;
}

Row6 PoseRows::errors(const Pose& tip, const Pose& target, const Twist& error) const noexcept {
  Row6 y = error;
  if (task_.frame == Frame::Tool) {
    y.head<3>() = tip.linear().transpose() * error.head<3>();
    y.tail<3>() = tip.linear().transpose() * error.tail<3>();
  }
  if (cone_) y.tail<3>() = between(tip.linear() * axis_, target.linear() * axis_, nullptr);
  for (int i = 0; i < 6; ++i) {
    if (!task_.mask[static_cast<std::size_t>(i)]) y[i] = 0.0;
  }
  return y;
}

// ė_o = −J_r⁻¹(φ) ω = −J_l⁻¹(−φ) ω; in the tool's axes, d(Rᵀe) = Rᵀ(ė − ω × e).
RowErrors PoseRows::rates(const Pose& tip, const Pose& target, const Twist& error) const noexcept {
  const Eigen::Vector3d position = error.head<3>(), angle = error.tail<3>();
  RowErrors out;
  out.y = errors(tip, target, error);
  out.rate.setZero();
  Eigen::Matrix3d turn;
  for (int i = 0; i < 3; ++i) turn.col(i) = rotation_log_rate(-angle, Eigen::Vector3d::Unit(i));
  if (task_.frame == Frame::Tool) {
    const Eigen::Matrix3d axes = tip.linear().transpose();
    out.rate.topLeftCorner<3, 3>() = axes;
    out.rate.topRightCorner<3, 3>() = -axes * skew(position);
    out.rate.bottomRightCorner<3, 3>() = axes * (turn - skew(angle));
  } else {
    out.rate.topLeftCorner<3, 3>().setIdentity();
    out.rate.bottomRightCorner<3, 3>() = turn;
  }
  if (cone_) {
    Eigen::Matrix3d rate;
    between(tip.linear() * axis_, target.linear() * axis_, &rate);
    out.rate.bottomRightCorner<3, 3>() = rate;
  }
  for (int i = 0; i < 6; ++i) {
    if (!task_.mask[static_cast<std::size_t>(i)]) out.rate.row(i).setZero();
  }
  return out;
}

Row6 PoseRows::outside(const Row6& y) const noexcept {
  Row6 out = y - y.cwiseMax(lower_).cwiseMin(upper_);
  if (cone_) {
    const double norm = y.tail<3>().norm();
    out.tail<3>() = norm > angle_ ? Eigen::Vector3d((1.0 - angle_ / norm) * y.tail<3>()) : Eigen::Vector3d::Zero();
  }
  for (int i = 0; i < 6; ++i) {
    if (!task_.mask[static_cast<std::size_t>(i)]) out[i] = 0.0;
  }
  return out;
}

Row6 PoseRows::force(const Pose& tip, const Pose& target, const Row6& shift) const noexcept {
  const RowErrors e = rates(tip, target, pose_error(tip, target));
  return e.rate.transpose() * weighted(weighted(outside(e.y + shift)));
}

// Of a whole pose in closed form: with φ = θ u, the second derivative of ½ θ² along ω is (ω·u)² + (θ/2) cot(θ/2) |ω −
// (ω·u) u|². Otherwise by differences.
Matrix6 PoseRows::stiffness(const Pose& tip, const Pose& target, const Row6& shift) const noexcept {
  Matrix6 out = Matrix6::Zero();
  if (plain_) {
    out.topLeftCorner<3, 3>().diagonal().setConstant(1.0 / (length_ * length_));
    const Eigen::Vector3d angle = rotation_log(target.linear() * tip.linear().transpose());
    const double square = angle.squaredNorm(), half = 0.5 * std::sqrt(square);
    const double across = half < 1e-3 ? 1.0 - square / 12.0 : half / std::tan(half);
    out.bottomRightCorner<3, 3>().diagonal().setConstant(across);
    if (square > 0.0) out.bottomRightCorner<3, 3>() += (1.0 - across) / square * angle * angle.transpose();
    return out;
  }
  for (int i = 0; i < 6; ++i) {
    const double step = kDifference * (i < 3 ? length_ : 1.0);
    const auto moved = [&](double by) {
      Pose p = tip;
      if (i < 3) {
        p.translation()[i] += by;
      } else {
        p.linear() = rotation_exp(by * Eigen::Vector3d::Unit(i - 3)) * tip.linear();
      }
      return force(p, target, shift);
    };
    out.col(i) = (moved(-step) - moved(step)) / (2.0 * step);
  }
  return 0.5 * (out + out.transpose());
}

TaskJacobian PoseRows::jacobian(const Pose& tip, const Jacobian& rows) const noexcept {
  Task task = task_;
  if (cone_) task.mask[3] = task.mask[4] = task.mask[5] = false;
  const int count = task.rows();
  int linear = 0;
  for (std::size_t i = 0; i < 3; ++i) linear += task.mask[i] ? 1 : 0;
  TaskJacobian out(count + (cone_ ? 2 : 0), rows.cols());
  if (count > 0) out.topRows(count) = select_rows(task, tip.linear(), rows);
  out.topRows(linear) /= length_;
  if (cone_) {
    const Eigen::Vector3d axis = tip.linear() * axis_, across = axis.unitOrthogonal();
    out.row(count) = across.transpose() * rows.bottomRows<3>();
    out.row(count + 1) = axis.cross(across).transpose() * rows.bottomRows<3>();
  }
  return out;
}

Twist PoseRows::counted(const Pose& tip, const Pose& target, const Twist& error) const noexcept {
  Twist out = errors(tip, target, error);
  if (task_.frame == Frame::Tool) {
    out.head<3>() = tip.linear() * out.head<3>();
    if (!cone_) out.tail<3>() = tip.linear() * out.tail<3>();
  }
  return out;
}

PoseRows::Ends PoseRows::beyond(const Row6& y) const noexcept {
  Ends ends;
  for (int i = 0; i < (cone_ ? 3 : 6); ++i) {
    const auto k = static_cast<std::size_t>(i);
    // A row without a range is always at its end.
    if (task_.mask[k] && (y[i] > upper_[i] || lower_[i] == upper_[i])) ends.box[k] = 1;
    if (task_.mask[k] && y[i] < lower_[i]) ends.box[k] = -1;
  }
  if (cone_) {
    const double norm = y.tail<3>().norm();
    if (norm > angle_) ends.ball = y.tail<3>() / norm;
  }
  return ends;
}

bool PoseRows::add_beyond(const Row6& next, Ends& ends) const noexcept {
  bool found = false;
  for (int i = 0; i < (cone_ ? 3 : 6); ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (!task_.mask[k] || ends.box[k] != 0) continue;
    if (next[i] > upper_[i] + kBeyond) ends.box[k] = 1;
    if (next[i] < lower_[i] - kBeyond) ends.box[k] = -1;
    found = found || ends.box[k] != 0;
  }
  if (cone_ && angle_ > 0.0 && ends.ball.isZero(0.0) && next.tail<3>().norm() > angle_ + kBeyond) {
    ends.ball = next.tail<3>().normalized();
    found = true;
  }
  return found;
}

void PoseRows::linear(const RowErrors& errors, const Ends& ends, Row6& residual, Matrix6& matrix) const noexcept {
  residual.setZero();
  matrix.setZero();
  for (int i = 0; i < (cone_ ? 3 : 6); ++i) {
    const int end = ends.box[static_cast<std::size_t>(i)];
    if (end == 0) continue;
    residual[i] = weight_[i] * (errors.y[i] - (end > 0 ? upper_[i] : lower_[i]));
    matrix.row(i) = weight_[i] * errors.rate.row(i);
  }
  if (!cone_) return;
  const Eigen::Vector3d y = errors.y.tail<3>();
  const double norm = y.norm();
  if (norm > angle_ || angle_ == 0.0) {  // ∂(y − P(y))/∂y; of the whole y where the ball is a point
    Eigen::Matrix3d part = Eigen::Matrix3d::Identity();
    if (angle_ > 0.0) {
      part *= 1.0 - angle_ / norm;
      part += angle_ / (norm * norm * norm) * y * y.transpose();
    }
    residual.tail<3>() = outside(errors.y).tail<3>().cwiseProduct(weight_.tail<3>());
    matrix.bottomRows<3>() = weight_[3] * part * errors.rate.bottomRows<3>();
  } else if (!ends.ball.isZero(0.0)) {
    residual.tail<3>() = weight_[3] * (ends.ball.dot(y) - angle_) * ends.ball;
    matrix.bottomRows<3>() = weight_[3] * ends.ball * (ends.ball.transpose() * errors.rate.bottomRows<3>());
  }
}

}  // namespace sigmaik::detail
