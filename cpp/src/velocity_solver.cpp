#include <sigmaik/velocity_solver.hpp>

#include <algorithm>
#include <bit>
#include <cmath>

#include "message.hpp"

namespace sigmaik {
namespace {

Solution refuse(const TaskJacobianRef& jacobian) noexcept {
  Solution s;
  const auto m = std::min<Eigen::Index>(jacobian.rows(), kMaxTask);
  const auto n = std::min<Eigen::Index>(jacobian.cols(), kMaxJoints);
  s.qdot = JointVector::Zero(n);
  s.singular_values = TaskVector::Zero(std::min(m, n));
  s.achieved_twist = TaskVector::Zero(m);
  s.directions = TaskMatrix::Identity(m, m);
  return s;
}

}  // namespace

int Solution::singular_count() const noexcept { return std::popcount(singular); }

VelocitySolver::VelocitySolver(const Method& method, double length_scale, const Task& task)
    : method_(method), length_scale_(length_scale), task_(task) {
  validate(method);
  detail::require(std::isfinite(length_scale) && length_scale > 0.0, "length_scale = ", length_scale,
                  " m must be finite and above 0");
  task.validate();
}

void VelocitySolver::set_method(const Method& method) {
  validate(method);
  method_ = method;
}

Solution VelocitySolver::solve(const TaskJacobianRef& jacobian, const TaskRef& twist, const JointVector& posture,
                               const Eigen::Matrix3d& rotation) noexcept {
  const auto m = jacobian.rows(), n = jacobian.cols();
  const int asked = task_.rows();
  const bool select = m == 6 && !(asked == 6 && task_.frame == Frame::Base);
  if (m < 1 || m > kMaxTask || n < 1 || n > kMaxJoints || twist.size() != m ||
      (posture.size() != 0 && posture.size() != n) || (m != 6 && asked != 6 && m != asked) ||
      !jacobian.allFinite() || !twist.allFinite() || !posture.allFinite() ||
      (select && task_.frame == Frame::Tool && !rotation.allFinite())) {
    return refuse(jacobian);
  }

  // The task's rows, and which of them are angular.
  TaskJacobian rows = jacobian;
  TaskVector command = twist;
  if (select) {
    rows = select_rows(task_, rotation, Jacobian(jacobian));
    command = select_rows(task_, rotation, Twist(twist));
  }
  std::uint8_t angular = 0;
  if (asked == 6) {
    angular = 0b111000;
  } else {
    int row = 0;
    for (unsigned i = 0; i < 6; ++i) {
      if (!task_.mask[i]) continue;
      if (i >= 3) angular |= static_cast<std::uint8_t>(1u << row);
      ++row;
    }
  }
  if (length_scale_ != 1.0) {
    for (int row = 0; row < rows.rows(); ++row) {
      if ((angular >> row & 1u) == 0) continue;
      rows.row(row) *= length_scale_;
      command[row] *= length_scale_;
    }
  }

  spectrum_.decompose(rows);
  const Resolution resolution = sigmaik::resolve(method_, spectrum_, command, angular);

  Solution s;
  s.qdot = resolution.qdot;
  bool exact = resolution.exact;
  if (posture.size() != 0) {
    const double enough = 1e-9 * spectrum_.sigma(0) * posture.norm();
    s.qdot += posture;
    for (int i = 0; i < spectrum_.size(); ++i) {
      const auto v = spectrum_.v(i);
      const double along = v.dot(posture), projector = resolution.projector[static_cast<std::size_t>(i)];
      s.qdot -= (projector * along) * v;
      // Where the projector lets some of the posture through, it moves the tip.
      if (std::abs(spectrum_.sigma(i) * (1.0 - projector) * along) > enough) exact = false;
    }
  }
  if (!s.qdot.allFinite()) return refuse(jacobian);  // the command is too large for numbers

  s.status = exact ? Status::Ok : Status::Damped;
  s.singular = resolution.singular;
  s.singular_values.resize(spectrum_.size());
  for (int i = 0; i < spectrum_.size(); ++i) s.singular_values[i] = spectrum_.sigma(i);
  s.directions.resize(rows.rows(), rows.rows());
  for (int i = 0; i < spectrum_.rows(); ++i) s.directions.col(i) = spectrum_.u(i);
  s.achieved_twist.noalias() = jacobian * s.qdot;
  return s;
}

}  // namespace sigmaik
