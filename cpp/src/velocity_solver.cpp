#include <sigmaik/velocity_solver.hpp>

#include <algorithm>
#include <bit>
#include <cmath>

#include "angular_rows.hpp"
#include "finite.hpp"
#include "joint_weights.hpp"
#include "message.hpp"

namespace sigmaik {
namespace {

// Part of the command that the answer may miss and still be exact.
constexpr double kExact = 1e-9;

// The answer where the question cannot be solved: no motion, BadInput.
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

using detail::angular_rows;
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

void VelocitySolver::set_pace(const Pace& pace) {
  detail::require(std::isfinite(pace.lag) && pace.lag >= 0.0, "pace.lag = ", pace.lag,
                  " must be finite and at least 0");
  detail::require(pace.slowness.allFinite() && (pace.slowness.array() >= 0.0).all(),
                  "an entry of pace.slowness is negative or not finite");
  pace_ = pace;
}

void VelocitySolver::set_joint_weights(const JointRef& weights) {
  constexpr double kMost = 1e6;
  for (Eigen::Index i = 0; i < weights.size(); ++i) {
    detail::require(std::isfinite(weights[i]) && weights[i] > 0.0, "joint_weights[", i, "] = ", weights[i],
                    " must be finite and above 0");
  }
  lightness_.resize(0);
  if (weights.size() == 0 || (weights.array() == weights[0]).all()) return;
  const double least = weights.minCoeff(), most = weights.maxCoeff();
  detail::require(most <= kMost * least, "joint_weights are from ", least, " to ", most, ", more than ", kMost,
                  " times: lock the heavy joint (Chain::lock)");
  lightness_ = least * weights.cwiseInverse();
}

void VelocitySolver::set_method(const Method& method) {
  validate(method);
  method_ = method;
}

Solution VelocitySolver::solve(const TaskJacobianRef& jacobian, const TaskRef& twist, const JointRef& posture,
                               const Eigen::Matrix3d& rotation) noexcept {
  if (!checked(jacobian, twist, posture, rotation)) return refuse(jacobian);
  const Question question{jacobian, twist, posture, rotation, angular_rows(task_), selects(jacobian)};
  TaskVector command = twist;
  if (!weighted(question, command)) return refuse(jacobian);
  // A Jacobian of another number of joints is not the pace's arm.
  const bool paced = pace_.slowness.size() == jacobian.cols();
  resolution_ = sigmaik::resolve(method_, spectrum_, command, question.angular, paced ? pace_ : Pace{});
  return answer(question, command);
}

bool VelocitySolver::selects(const TaskJacobianRef& jacobian) const noexcept {
  return jacobian.rows() == 6 && !(task_.rows() == 6 && task_.frame == Frame::Base);
}

bool VelocitySolver::checked(const TaskJacobianRef& jacobian, const TaskRef& twist, const JointRef& posture,
                             const Eigen::Matrix3d& rotation) const noexcept {
  const auto m = jacobian.rows(), n = jacobian.cols();
  const int asked = task_.rows();
  const bool sizes = m >= 1 && m <= kMaxTask && n >= 1 && n <= kMaxJoints && twist.size() == m &&
                     (posture.size() == 0 || posture.size() == n) && (m == 6 || asked == 6 || m == asked);
  const bool turned = task_.frame == Frame::Tool && selects(jacobian);
  return sizes && finite(jacobian) && finite(twist) && finite(posture) && (!turned || rotation.allFinite());
}

bool VelocitySolver::weighted(const Question& question, TaskVector& command) noexcept {
  if (!question.select && length_scale_ == 1.0) {
    spectrum_.decompose(question.jacobian);
    return true;
  }
  TaskJacobian rows = question.jacobian;
  if (question.select) {
    rows = select_rows(task_, question.rotation, Jacobian(question.jacobian));
    command = select_rows(task_, question.rotation, Twist(question.twist));
  }
  // Column by column, as the numbers lie in memory; a row that is linear has the factor 1.
  TaskVector factor = TaskVector::Ones(rows.rows());
  for (int row = 0; row < rows.rows(); ++row) {
    if ((question.angular >> row & 1u) != 0) factor[row] = length_scale_;
  }
  command = command.cwiseProduct(factor);
  for (Eigen::Index j = 0; j < rows.cols(); ++j) {
    for (Eigen::Index i = 0; i < rows.rows(); ++i) rows(i, j) *= factor[i];
  }
  if (!finite(TaskJacobianRef(rows)) || !finite(command)) return false;
  spectrum_.decompose(rows);
  return true;
}

Solution VelocitySolver::answer(const Question& question, const TaskVector& command) const noexcept {
  Solution s;
  double largest = command.cwiseAbs().maxCoeff();  // of the command and of what the posture asks for
  if (question.posture.size() != 0) {
    largest = std::max(largest, spectrum_.sigma(0) * question.posture.cwiseAbs().maxCoeff());
    const std::array<double, kMaxTask> along = spectrum_.along_v(question.posture);
    std::array<double, kMaxTask> speed = resolution_.speed;
    for (std::size_t i = 0; i < along.size(); ++i) speed[i] -= resolution_.projector[i] * along[i];
    s.qdot = question.posture + spectrum_.combine_v(speed);
  } else {
    s.qdot = spectrum_.combine_v(resolution_.speed);
  }
  if (lightness_.size() == s.qdot.size() && lightness_.size() != 0) {
    detail::WeightedDirections directions;
    directions.add(spectrum_, resolution_);
    s.qdot = directions.prefer(s.qdot, question.posture, lightness_);
  }
  s.achieved_twist = product(question.jacobian, s.qdot);
  if (!finite(s.qdot) || !finite(s.achieved_twist) || !std::isfinite(spectrum_.sigma(0))) {
    return refuse(question.jacobian);  // the answer overflows
  }

  s.status = resolution_.exact && exact(question, s.achieved_twist, kExact * largest) ? Status::Ok : Status::Damped;
  s.singular = resolution_.singular;
  s.singular_values.resize(spectrum_.size());
  for (int i = 0; i < spectrum_.size(); ++i) s.singular_values[i] = spectrum_.sigma(i);
  if (question.jacobian.rows() == 6 && !question.select) {
    s.directions = spectrum_.basis<6>();
  } else {
    s.directions.resize(spectrum_.rows(), spectrum_.rows());
    for (int i = 0; i < spectrum_.rows(); ++i) s.directions.col(i) = spectrum_.u(i);
  }
  return s;
}

// An exact rule is not enough: a posture that passes the rule's projector moves the tip, and large speeds are rounded.
bool VelocitySolver::exact(const Question& question, const TaskVector& achieved, double tolerance) const noexcept {
  TaskVector missed = achieved - question.twist;
  if (question.select) missed = select_rows(task_, question.rotation, Twist(missed));
  double most = 0.0;
  for (int row = 0; row < missed.size(); ++row) {
    most = std::max(most, std::abs((question.angular >> row & 1u) != 0 ? missed[row] * length_scale_ : missed[row]));
  }
  return most <= tolerance;
}

}  // namespace sigmaik
