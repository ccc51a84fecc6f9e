#pragma once
// What the files of ConstrainedIk share.

#include <cmath>

#include <sigmaik/constrained_ik.hpp>
#include <sigmaik/pose.hpp>

#include "length.hpp"

namespace sigmaik {
namespace detail::constrained {

// [m, rad] A smaller error counts as none.
inline constexpr double kMet = 1e-9;
// [s] Errors of the exact part decay to 1/e in this time after limits held the arm back.
inline constexpr double kSettling = 0.025;
// Part of a joint's bounds: a closing velocity inside can also end in one cycle.
inline constexpr double kAtOnce = 0.05;

// J_l⁻¹(φ), which takes ω to φ̇ for φ = log(R): I − ½[φ]× + c [φ]×².
inline Eigen::Matrix3d inverse_left_jacobian(const Eigen::Vector3d& phi) noexcept {
  const double angle = detail::length(phi);
  Eigen::Matrix3d cross;
  cross << 0.0, -phi.z(), phi.y(), phi.z(), 0.0, -phi.x(), -phi.y(), phi.x(), 0.0;
  const double half = 0.5 * angle;
  const double c = angle < 1e-4 ? 1.0 / 12.0 : (1.0 - half / std::tan(half)) / (angle * angle);
  return Eigen::Matrix3d::Identity() - 0.5 * cross + c * cross * cross;
}

}  // namespace detail::constrained

// (11), (12): e ≈ slope Δq + offset, the tip minus the target; and e* = e + turned ϑ.
struct ConstrainedIk::Linearisation {
  Jacobian slope;
  Twist offset, turned;

  // `state` belongs to the joint positions of this linearisation; `back` is the step from there to the start of the
  // cycle.
  Linearisation(const ChainState& state, const Pose& target, const Twist& motion, const JointVector& back) noexcept
      : slope(state.jacobian), offset(-pose_error(state.tip, target)), turned(motion) {
    const Eigen::Matrix3d turn = detail::constrained::inverse_left_jacobian(offset.tail<3>());
    slope.bottomRows<3>() = turn.lazyProduct(state.jacobian.bottomRows<3>());
    turned.tail<3>() = turn * motion.tail<3>();
    for (Eigen::Index j = 0; j < back.size(); ++j) offset += back[j] * slope.col(j);
  }
};

// What is behind when the cycle starts, the tip minus the pose that the last cycle aimed at, and how much of this the
// cycle closes.
struct ConstrainedIk::Closing {
  bool active = false;                // something is behind
  bool small = false;                 // what is behind can be made up in a cycle, without a lasting change of velocity
  Twist behind = Twist::Zero();       // [m, rad]
  Twist exact = Twist::Zero();        // asked change of the exact rows' error in the cycle
  Twist approximate = Twist::Zero();  // expected change of the approximate rows' error
  JointVector qdot;                   // the closing velocity, from which the joints can still brake
  double size = 0.0;                  // of qdot: above 1 the closing velocity cannot end in one cycle
};

}  // namespace sigmaik
