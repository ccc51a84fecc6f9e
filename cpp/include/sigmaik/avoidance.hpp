#pragma once
/// \file avoidance.hpp
/// A posture velocity that leads away from singularities: where an arm is redundant, the servo follows this velocity
/// without moving the tool.

#include <limits>
#include <optional>

#include <sigmaik/chain.hpp>
#include <sigmaik/indices.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/singularities.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik {

/// The function whose gradient leads away from singularities.
enum class Avoid {
  None,
  Manipulability,  ///< the gradient of √det(JJᵀ), everywhere (Yoshikawa 1985)
  Potential,       ///< minus the gradient of the potentials around the known singular sets, near them alone
};

/// Settings of Avoidance.
struct AvoidanceOptions {
  Avoid what = Avoid::None;  ///< the function whose gradient is followed
  double gain = 1.0;         ///< ≥ 0, q̇ = gain ∇m or −gain ∇Σφ
  double max_speed = 0.5;    ///< [rad/s or m/s] > 0, of the fastest joint: longer velocities are shortened to it
  /// η₁ and η₂ of the potentials. They are lower and wider than a planner's, because a velocity must act before the arm
  /// reaches the set: φ is 1 on the set, and e^{-1} at 1/√η₂ = 0.3 rad from the set.
  Potential potential{0.0, 10.0};
};

/// Computes the posture velocity away from singularities. Every call after construction is real time.
class Avoidance {
 public:
  /// \throws Error where an option is out of its range, or potentials are asked for of an arm whose sets are not known
  explicit Avoidance(const Chain& chain, const AvoidanceOptions& options = {});

  /// The settings, as given.
  const AvoidanceOptions& options() const noexcept { return options_; }
  /// Whether velocity() is ever anything but zero.
  bool active() const noexcept { return options_.what != Avoid::None && options_.gain > 0.0; }

  /// q̇ (n,) [rad/s or m/s] at q (n,).
  JointVector velocity(const JointRef& q) const noexcept;

 private:
  AvoidanceOptions options_;
  Chain chain_;
  std::optional<SingularSets> sets_;
  IndexFunction index_;
};

SIGMAIK_SAME_LAYOUT(Avoidance, AvoidanceOptions);

}  // namespace sigmaik
