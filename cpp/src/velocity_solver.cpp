#include <sigmaik/velocity_solver.hpp>

#include <algorithm>
#include <bit>
#include <cmath>

#include "finite.hpp"
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

using detail::finite;

bool finite(const TaskJacobianRef& x) noexcept {
  if (x.outerStride() != x.rows()) return x.allFinite();
  return finite(Eigen::Map<const Eigen::VectorXd>(x.data(), x.size()));
}

// J q̇, column by column.
TaskVector product(const TaskJacobianRef& jacobian, const JointVector& qdot) noexcept {
  if (jacobian.rows() != 6) return jacobian.lazyProduct(qdot);
  Twist sum = Twist::Zero();
  for (Eigen::Index j = 0; j < jacobian.cols(); ++j) {
    sum += qdot[j] * Eigen::Map<const Twist>(jacobian.data() + j * jacobian.outerStride());
  }
  return sum;
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

Solution VelocitySolver::solve(const TaskJacobianRef& jacobian, const TaskRef& twist, const JointRef& posture,
                               const Eigen::Matrix3d& rotation) noexcept {
  const auto m = jacobian.rows(), n = jacobian.cols();
  const int asked = task_.rows();
  const bool select = m == 6 && !(asked == 6 && task_.frame == Frame::Base);
  if (m < 1 || m > kMaxTask || n < 1 || n > kMaxJoints || twist.size() != m ||
      (posture.size() != 0 && posture.size() != n) || (m != 6 && asked != 6 && m != asked) || !finite(jacobian) ||
      !finite(twist) || !finite(posture) || (select && task_.frame == Frame::Tool && !rotation.allFinite())) {
    return refuse(jacobian);
  }

  std::uint8_t angular = 0;  // bit i: row i of the task is angular
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
  TaskVector command = twist;
  if (select || length_scale_ != 1.0) {
    TaskJacobian rows = jacobian;
    if (select) {
      rows = select_rows(task_, rotation, Jacobian(jacobian));
      command = select_rows(task_, rotation, Twist(twist));
    }
    for (int row = 0; row < rows.rows(); ++row) {
      if ((angular >> row & 1u) == 0) continue;
      rows.row(row) *= length_scale_;
      command[row] *= length_scale_;
    }
    if (!rows.allFinite() || !command.allFinite()) return refuse(jacobian);
    spectrum_.decompose(rows);
  } else {
    spectrum_.decompose(jacobian);
  }
  Resolution resolution = sigmaik::resolve(method_, spectrum_, command, angular);

  Solution s;
  bool exact = resolution.exact;
  double enough = command.cwiseAbs().maxCoeff();  // what the answer may miss of the command and be exact, times 1e9
  if (posture.size() != 0) {
    enough = std::max(enough, spectrum_.sigma(0) * posture.cwiseAbs().maxCoeff());
    const std::array<double, kMaxTask> along = spectrum_.along_v(posture);
    for (std::size_t i = 0; i < along.size(); ++i) resolution.speed[i] -= resolution.projector[i] * along[i];
    s.qdot = posture + spectrum_.combine_v(resolution.speed);
  } else {
    s.qdot = spectrum_.combine_v(resolution.speed);
  }
  s.achieved_twist = product(jacobian, s.qdot);
  if (!finite(s.qdot) || !finite(s.achieved_twist) || !std::isfinite(spectrum_.sigma(0))) {
    return refuse(jacobian);  // too large for numbers
  }

  if (exact) {
    // The rule is; but a posture that its projector lets through moves the tip, and so does rounding of large speeds.
    TaskVector missed = s.achieved_twist - twist;
    if (select) missed = select_rows(task_, rotation, Twist(missed));
    double most = 0.0;
    for (int row = 0; row < missed.size(); ++row) {
      most = std::max(most, std::abs((angular >> row & 1u) != 0 ? missed[row] * length_scale_ : missed[row]));
    }
    exact = most <= 1e-9 * enough;
  }
  s.status = exact ? Status::Ok : Status::Damped;
  s.singular = resolution.singular;
  s.singular_values.resize(spectrum_.size());
  for (int i = 0; i < spectrum_.size(); ++i) s.singular_values[i] = spectrum_.sigma(i);
  if (m == 6 && !select) {
    s.directions = spectrum_.basis<6>();
  } else {
    s.directions.resize(spectrum_.rows(), spectrum_.rows());
    for (int i = 0; i < spectrum_.rows(); ++i) s.directions.col(i) = spectrum_.u(i);
  }
  return s;
}

}  // namespace sigmaik
