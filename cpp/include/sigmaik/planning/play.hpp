#pragma once
/// \file play.hpp
/// A planned motion played through a servo.

#include <vector>

#include <sigmaik/layout.hpp>
#include <sigmaik/planning/trajectory.hpp>
#include <sigmaik/servo.hpp>
#include <sigmaik/status.hpp>

namespace sigmaik::planning {

/// A planned motion as a servo played it: M samples, one at the start of each cycle, and one at the last cycle's end.
struct Playback {
  int dof = 0;                  ///< n
  std::vector<double> t;        ///< (M,) [s] times of the trajectory, and those for which its end is held
  std::vector<double> planned;  ///< (M, n) in C order: the trajectory's positions [rad or m]
  std::vector<double> q;        ///< (M, n) the servo's positions [rad or m]
  /// (M, n) the command of the cycle that begins at the sample [rad/s or m/s]; the last row repeats the one before
  std::vector<double> qdot;
  /// (M, 6) in C order: planned pose minus the servo's, [position; rotation vector], base axes [m, rad]
  std::vector<double> pose_error;
  std::vector<Status> status;  ///< M − 1, one for each cycle

  /// Number of samples.
  std::size_t size() const noexcept { return t.size(); }
  /// [m] the tip's largest distance from its plan.
  double max_position_error() const noexcept;
  /// [rad] the largest angle between the tip and its plan.
  double max_orientation_error() const noexcept;
  /// [rad or m] the largest |planned − q| of all joints. Poses do not say where a redundant arm's elbow is.
  double max_joint_difference() const noexcept;
};

/// Plays a motion through a servo that stands at its start, as poses with feed-forward twists, one target each dt of
/// the servo.
///
/// In the cycle from t to t + dt the target is the pose planned for t, and the feed-forward twist is J(q) q̇ of the plan
/// in the middle of the cycle. A cycle of constant q̇ leaves the error ½ dt² J̇ q̇, and the gains keep the sum of these
/// errors to ½ dt |J̇ q̇| / gain: micrometres at 1 kHz. The soft start adds a larger error. The servo holds its limits
/// and treats singularities by its own rule, so the arm may leave the plan; the servo's gains bring it back. The servo
/// keeps its history: call Servo::reset() before.
/// \param settle [s] ≥ 0 for which the last pose is held
/// \throws Error where the trajectory is empty or has another number of joints, the servo stands elsewhere (1e-6 rad or
///     m), or settle is not finite or negative
Playback play(const Trajectory& trajectory, Servo& servo, double settle = 0.5);

SIGMAIK_SAME_LAYOUT(Playback);

}  // namespace sigmaik::planning
