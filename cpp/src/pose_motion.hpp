#pragma once
// Motions of a pose, and a target that follows a motion smoothly: what TargetStream and ActionChunks have in common.

#include <sigmaik/target_stream.hpp>

namespace sigmaik::detail {

inline constexpr double kShortest = 1e-9;  // [s]: from here on squares and quotients of rates keep their digits

// At u in [0, 1] of the way from a to b, which takes dt > 0: a curve of fifth degree with the twists and accelerations
// of both ends, in R³ and in the chart φ = log(R R_aᵀ).
PoseMotion between(const PoseMotion& a, const PoseMotion& b, double dt, double u) noexcept;

// `seconds` later, before or after, along a parabola in R³ and in the chart of `from`.
PoseMotion extrapolated(const PoseMotion& from, double seconds) noexcept;

// Bounds of a target, as in TargetStreamOptions.
struct FollowLimits {
  double speed, angular_speed;  // [m/s], [rad/s] > 0
  double smoothing;             // [s] ≥ 0
};

// A cycle of the law of TargetStream: the target goes on from its pose, twist and acceleration towards a motion that is
// at `then` before the cycle and at `now` after it, dt > 0 later. Where the motion is another one than in the last
// cycle, the target does not jump.
void follow(const PoseMotion& then, const PoseMotion& now, double dt, const FollowLimits& limits,
            PoseMotion& target) noexcept;

}  // namespace sigmaik::detail
