#include <sigmaik/computed_torque.hpp>

#include <algorithm>
#include <cmath>

#include "finite.hpp"
#include "message.hpp"

namespace sigmaik {

ComputedTorque::ComputedTorque(const Chain& chain, const ComputedTorqueOptions& options)
    : options_(options), dynamics_(chain, options.gravity, options.payload), effort_(chain.limits().effort) {
  const auto check = [](double value, const char* name) {
    detail::require(std::isfinite(value) && value > 0.0, name, " = ", value, " must be finite and greater than 0");
  };
  check(options.frequency, "frequency");
  check(options.damping_ratio, "damping_ratio");
}

ComputedTorqueStep ComputedTorque::update(const JointRef& q, const JointRef& qdot, const JointRef& q_desired,
                                          const JointRef& qdot_desired, const JointRef& qddot_desired) noexcept {
  const int n = dof();
  const auto good = [n](const JointRef& x) { return x.size() == n && detail::finite(x); };
  ComputedTorqueStep step;
  step.torque = JointVector::Zero(n);
  if (!good(q) || !good(qdot)) return step;

  const double damping = 2.0 * options_.damping_ratio * options_.frequency;
  const double stiffness = options_.frequency * options_.frequency;
  JointVector v = -damping * qdot;
  if (good(q_desired) && good(qdot_desired) && good(qddot_desired)) {
    v += qddot_desired + damping * qdot_desired + stiffness * (q_desired - q);
    step.status = Status::Ok;
  }
  // τ = (C q̇ + g) + s M v, with the largest s in [0, 1] that the effort limits allow: scaling keeps the direction of v.
  JointVector bias;
  dynamics_.inverse_dynamics(q, qdot, JointVector::Zero(n), bias);
  dynamics_.inverse_dynamics(q, qdot, v, step.torque);
  const JointVector asked = step.torque - bias;
  step.scale = 1.0;
  for (int i = 0; i < n; ++i) {
    if (!(std::abs(step.torque[i]) > effort_[i])) continue;
    step.limiting_joints = static_cast<std::uint16_t>(step.limiting_joints | (1u << i));
    const double room = std::copysign(effort_[i], step.torque[i]) - bias[i];
    step.scale = std::min(step.scale, std::max(0.0, room / asked[i]));
  }
  if (step.limiting_joints != 0) {
    if (step.status == Status::Ok) step.status = Status::Limited;
    step.torque = (bias + step.scale * asked).cwiseMax(-effort_).cwiseMin(effort_);
  }
  if (!detail::finite(step.torque)) {  // overflow, possible only without effort limits
    step.torque.setZero();
    step.scale = 0.0;
    step.status = Status::BadInput;
  }
  return step;
}

}  // namespace sigmaik
