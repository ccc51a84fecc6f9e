#pragma once
/// \file computed_torque.hpp
/// Joint torques that make an arm follow planned joint positions.

#include <cstdint>
#include <optional>

#include <sigmaik/dynamics.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/status.hpp>

namespace sigmaik {

/// Settings of a ComputedTorque.
struct ComputedTorqueOptions {
  double frequency = 20.0;     ///< ω [rad/s] > 0 of the error's dynamics; the loop's rate should be 10 ω and more
  double damping_ratio = 1.0;  ///< ζ > 0; 1 is critical: the fastest without overshoot
  Eigen::Vector3d gravity{0.0, 0.0, -9.80665};  ///< [m/s²], in base axes
  std::optional<Inertia> payload{};             ///< the tip's load, as far as the controller knows it; see Dynamics
};

/// Answer of a cycle. By value, no heap.
struct ComputedTorqueStep {
  JointVector torque;                 ///< (n,) [N·m or N], within the chain's effort limits
  Status status = Status::BadInput;   ///< Ok; Limited, where an effort limit would be broken; BadInput
  double scale = 0.0;                 ///< in [0, 1], the part of v that effort limits leave
  std::uint16_t limiting_joints = 0;  ///< bit i: joint i's torque would break its limit
};

/// Computed torque (inverse dynamics) control:
///
///     τ = M(q) v + C(q, q̇) q̇ + g(q),   v = q̈_d + 2ζω (q̇_d − q̇) + ω² (q_d − q)
///
/// With the true M, C, g the arm does q̈ = v (Beck et al. 2022, eqs. 18 to 20), so the error e = q_d − q obeys
/// ë + 2ζω ė + ω² e = 0 in each joint separately. With another model the error obeys ë + 2ζω ė + ω² e = d, where d is
/// M⁻¹ times the missing torque: at rest a constant d leaves e = d/ω².
///
/// Where an effort limit would be broken, v is scaled down by one factor for all joints: if each torque were cut
/// separately, M would turn the error's acceleration away from v. Where C q̇ + g alone is beyond a limit, the torque of
/// this joint is cut.
///
/// Whole turns count: a continuous joint moves by q_d − q, even where the other way round is shorter.
class ComputedTorque {
 public:
  /// \throws Error where an option is out of its range, or where Dynamics throws
  explicit ComputedTorque(const Chain& chain, const ComputedTorqueOptions& options = {});

  /// One cycle: the arm is at q, q̇ (n,), and should be at q_d, q̇_d, accelerating by q̈_d. Real time. If q_d, q̇_d or q̈_d
  /// is not finite or has a wrong size, the torque brakes the arm to rest, v = −2ζω q̇; if q or q̇ is bad, the torque is
  /// zero. The status is BadInput in both cases.
  ComputedTorqueStep update(const JointRef& q, const JointRef& qdot, const JointRef& q_desired,
                            const JointRef& qdot_desired, const JointRef& qddot_desired) noexcept;

  /// Number n of movable joints.
  int dof() const noexcept { return dynamics_.dof(); }
  /// The arm.
  const Chain& chain() const noexcept { return dynamics_.chain(); }
  /// The settings, as given.
  const ComputedTorqueOptions& options() const noexcept { return options_; }

 private:
  ComputedTorqueOptions options_;
  Dynamics dynamics_;
  JointVector effort_;
};

SIGMAIK_SAME_LAYOUT(ComputedTorque, ComputedTorqueOptions, ComputedTorqueStep);

}  // namespace sigmaik
