#include <sigmaik/servo.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include <sigmaik/pose.hpp>

#include "length.hpp"
#include "message.hpp"

namespace sigmaik {
namespace {

using detail::require;

void check(const char* what, double value, bool zero_allowed, const char* unit) {
  require(value > 0.0 || (zero_allowed && value == 0.0), what, " = ", value, " ", unit, " must be ",
          zero_allowed ? "at least" : "above", " 0");
}

void check_finite(const char* what, double value, bool zero_allowed, const char* unit) {
  check(what, value, zero_allowed, unit);
  require(std::isfinite(value), what, " must be finite");
}

void check_joints(const char* what, const JointRef& values, const Chain& chain) {
  require(values.size() == chain.dof(), what, " has ", values.size(), " entries, the chain ", chain.dof(), " joints");
  for (int i = 0; i < chain.dof(); ++i) {
    require(std::isfinite(values[i]), what, " of joint '", chain.joint_names()[static_cast<std::size_t>(i)],
            "' is not finite");
  }
}

void shorten(Eigen::Ref<Eigen::Vector3d> vector, double longest) noexcept {
  const double length = detail::length(vector);
  if (length > longest) vector *= longest / length;
}

}  // namespace

Servo::Servo(Chain chain, const Method& method, const ServoOptions& options)
    : chain_(std::move(chain)), options_(options), solver_(method, options.length_scale, options.task) {
  check_finite("dt", options.dt, false, "s");
  check_finite("gain_linear", options.gain_linear, true, "1/s");
  check_finite("gain_angular", options.gain_angular, true, "1/s");
  check("max_linear_error", options.max_linear_error, false, "m");
  check("max_angular_error", options.max_angular_error, false, "rad");
  check_finite("soft_start", options.soft_start, true, "s");
  check_finite("posture_gain", options.posture_gain, true, "1/s");
  check("posture_max_speed", options.posture_max_speed, false, "rad/s");
  if (options.posture.size() != 0) check_joints("posture", options.posture, chain_);
}

void Servo::reset(const JointRef& q, const JointRef& qdot) {
  check_joints("q", q, chain_);
  if (qdot.size() != 0) check_joints("qdot", qdot, chain_);
  q_ = q;
  qdot_start_ = qdot.size() != 0 ? JointVector(qdot) : JointVector(JointVector::Zero(chain_.dof()));
  nominal_ = options_.posture.size() != 0 ? options_.posture : q_;
  for (int i = 0; i < chain_.dof(); ++i) {
    if (chain_.joint_types()[static_cast<std::size_t>(i)] != JointType::Continuous) continue;
    constexpr double kTurn = 6.283185307179586;
    nominal_[i] += kTurn * std::round((q[i] - nominal_[i]) / kTurn);
  }
  solver_.reset();
  sigmaik::update(chain_, q_, state_);
  fade_ = 0.0;
}

void Servo::set_method(const Method& method) { solver_.set_method(method); }

JointVector Servo::posture_velocity() const noexcept {
  if (options_.posture_gain == 0.0) return {};
  const double cap = options_.posture_max_speed;
  return (options_.posture_gain * (nominal_ - q_)).cwiseMax(-cap).cwiseMin(cap);
}

ServoStep Servo::hold(Status status) const noexcept {
  ServoStep step;
  step.q = q_;
  step.qdot = JointVector::Zero(chain_.dof());
  step.status = status;
  return step;
}

ServoStep Servo::update(const Pose& target) noexcept {
  if (q_.size() == 0 || !is_pose(target.matrix())) return hold(Status::BadInput);
  const Twist error = pose_error(state_.tip, target);
  Twist twist = error;
  shorten(twist.head<3>(), options_.max_linear_error);
  shorten(twist.tail<3>(), options_.max_angular_error);
  twist.head<3>() *= options_.gain_linear;
  twist.tail<3>() *= options_.gain_angular;
  ServoStep step = resolve(twist, true);
  step.pose_error = error;
  return step;
}

ServoStep Servo::update_twist(const Twist& twist) noexcept {
  if (q_.size() == 0 || !twist.allFinite()) return hold(Status::BadInput);
  return resolve(twist, !qdot_start_.isZero(0.0));
}

ServoStep Servo::resolve(const Twist& twist, bool fade) noexcept {
  const Solution solution = solver_.solve(state_.jacobian, twist, posture_velocity(), state_.tip.linear());
  if (solution.status == Status::BadInput) return hold(Status::BadInput);

  ServoStep step;
  step.status = solution.status;
  step.singular_values = solution.singular_values;
  step.singular = solution.singular;
  step.task_rows = static_cast<int>(solution.directions.cols());
  step.qdot = solution.qdot;

  if (fade_ < 1.0) {
    fade_ = options_.soft_start > 0.0 ? std::min(1.0, fade_ + options_.dt / options_.soft_start) : 1.0;
    if (fade && fade_ < 1.0) step.qdot = fade_ * step.qdot + (1.0 - fade_) * qdot_start_;
  }

  if (options_.velocity_limits) {
    const JointVector& limit = chain_.limits().velocity;
    const double excess = (step.qdot.cwiseAbs().cwiseQuotient(limit)).maxCoeff();
    if (excess > 1.0) {
      step.scale = 1.0 / excess;
      for (int i = 0; i < chain_.dof(); ++i) {
        if (std::abs(step.qdot[i]) >= excess * (1.0 - 1e-12) * limit[i]) {
          step.limiting_joints |= static_cast<std::uint16_t>(1u << i);
        }
      }
      // Rounding of the product must not carry the limiting joint beyond its limit.
      step.qdot = (step.scale * step.qdot).cwiseMax(-limit).cwiseMin(limit);
      step.status = Status::Limited;
    }
  }

  step.q = q_ + options_.dt * step.qdot;
  step.achieved_twist = state_.jacobian.lazyProduct(step.qdot);
  if (!step.q.allFinite() || !step.achieved_twist.allFinite()) return hold(Status::BadInput);  // too large for numbers
  q_ = step.q;
  sigmaik::update(chain_, q_, state_);
  return step;
}

}  // namespace sigmaik
