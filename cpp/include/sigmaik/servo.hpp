#pragma once
/// \file servo.hpp
/// Pose or twist in, joint command out, each cycle: a rule on the singular directions, inside the arm's limits.

#include <array>
#include <cstdint>
#include <limits>

#include <sigmaik/avoidance.hpp>
#include <sigmaik/chain.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/least_squares.hpp>
#include <sigmaik/limits.hpp>
#include <sigmaik/status.hpp>
#include <sigmaik/velocity_solver.hpp>

namespace sigmaik {

/// How the command gives way where a joint limit would be broken. While no limit would be broken, the command is the
/// rule's answer, to the last digit.
///
/// Position and velocity limits decide where the arm is heading. Acceleration and jerk limits decide how fast the arm
/// gets there: all joints change in proportion, from the last command towards the new one, so that the tool keeps its
/// direction while it speeds up. Where this proportion would break a limit, for example where one joint brakes as hard
/// as it can, the other joints do as much of the twist as possible.
enum class OnLimit {
  /// The free joints take over. Of all velocities that the limits allow, the answer has the twist nearest to the rule's
  /// twist, and of these velocities the answer is the nearest to the rule's, to about 1e-5 of the twist away from
  /// singularities. A singular direction has the weight of a direction at the rule's threshold, so that the joints do
  /// not move much to make up for little twist. J-PARSE's answer, limited in this way, still never moves the tool away
  /// from its target where the limits allow rest.
  Redistribute,
  Scale,  ///< the direction is kept, speed is given up: all joints slow down together
};

/// Settings of a Servo.
struct ServoOptions {
  double dt = 1e-3;  ///< [s] > 0, the time from one update to the next
  /// [1/s] ≥ 0, position error to velocity. (JParse's gain_linear is the paper's K, on singular directions alone.)
  double gain_linear = 5.0;
  double gain_angular = 5.0;       ///< [1/s] ≥ 0, orientation error to angular velocity
  double max_linear_error = 0.25;  ///< [m] > 0: longer position errors are shortened to it
  double max_angular_error = 1.0;  ///< [rad] > 0: longer orientation errors are shortened to it
  /// [s] ≥ 0: over this time after reset() the command of a pose target is faded in. Twist commands are faded in only
  /// where reset() was told that the arm moves.
  double soft_start = 0.1;
  JointVector posture{};      ///< (n,) nominal positions; empty: the positions given to reset()
  double posture_gain = 0.0;  ///< [1/s] ≥ 0
  double posture_max_speed = std::numeric_limits<double>::infinity();  ///< [rad/s or m/s] > 0, a joint
  AvoidanceOptions avoid{};  ///< adds a velocity away from singularities to the posture's, for redundant arms
  LimitOptions limits{};     ///< which of the chain's limits are held; see limits.hpp
  OnLimit on_limit = OnLimit::Redistribute;  ///< what gives way where a joint limit would be broken
  /// Rows (vx, vy, vz, ωx, ωy, ωz), in the task's axes, that come before the others where Redistribute cannot achieve
  /// all of them.
  std::array<bool, 6> exact{};
  double length_scale = 1.0;  ///< [m], see VelocitySolver
  Task task{};                ///< which rows of the twist matter, and in which axes
};

/// Answer of a cycle. By value, no heap.
struct ServoStep {
  JointVector q;                         ///< (n,) position command
  JointVector qdot;                      ///< (n,) velocity command over the last dt
  Status status = Status::BadInput;      ///< what the cycle did
  Twist pose_error = Twist::Zero();      ///< target minus tip before the step, unshortened; zero for twist commands
  Twist asked_twist = Twist::Zero();     ///< input of the rule: the twist command, or the twist from the pose error
  Twist achieved_twist = Twist::Zero();  ///< J q̇
  /// In [0, 1], the part that limits left of the rule's speed (Scale), or of its twist along itself (Redistribute).
  double scale = 1.0;
  std::uint16_t limiting_joints = 0;  ///< bit i: joint i is held at a limit that the rule's answer would break
  TaskVector singular_values;         ///< of the weighted task Jacobian, from large to small; empty while holding
  std::uint8_t singular = 0;          ///< bit i: direction i is singular to the rule, i from 0 to task_rows − 1
  int task_rows = 0;                  ///< m', the number of directions
  /// (6, k) a column for each bit of `singular`, in order: the twist [v; ω], base axes, at the tip's origin, whose rows
  /// in the task are u_i and whose other rows are zero, so |v|² + (length_scale |ω|)² = 1. Of the Jacobian before the
  /// step. The sign of u_i means nothing, but does not change from cycle to cycle. Empty while holding.
  TwistColumns singular_directions;
};

/// Drives a chain's own reference configuration towards poses, or along twists. A servo integrates the command that it
/// gives (q ← q + q̇ dt) and never reads measured positions, so sensor noise cannot enter.
///
/// Every command holds the chain's position, velocity, acceleration and jerk limits, and leaves room to go on holding
/// them (limits.hpp). An arm that starts outside its limits comes back by itself. Bad input stops the arm as fast as
/// the limits allow.
///
/// A servo remembers the motion that it commanded (LimitTracker), the posture, the fading after reset(), and three
/// guesses that make the next cycle cheap and continuous: two decompositions and an active set.
class Servo {
 public:
  /// \throws Error where an option is out of its range
  Servo(Chain chain, const Method& method, const ServoOptions& options = {});

  /// Starts, or starts again, at q (n,): forgets all history, and takes q as the posture unless the options have one.
  /// Continuous joints take the turn of the given posture that is nearest to q.
  /// \param qdot (n,) how the arm moves now, from which the command is faded; empty: the arm is at rest
  /// \throws Error where a size is wrong or an entry is not finite
  void reset(const JointRef& q, const JointRef& qdot = JointVector());

  /// One cycle towards a pose of the tip in base. Real time. A target that is not a pose is refused: BadInput, and the
  /// arm stops.
  /// \param feedforward twist [v; ω] of a target that moves, base axes, at the target's origin; added to gain × error,
  ///     after the error's caps. Behind a target of constant twist the tip lags by speed/gain without the feedforward,
  ///     and not at all with it.
  ServoStep update(const Pose& target, const Twist& feedforward = Twist::Zero()) noexcept;

  /// One cycle along a twist [v; ω], base axes, at the tip's origin. Real time.
  ServoStep update_twist(const Twist& twist) noexcept;

  /// One cycle of the fastest stop that the limits allow, or of rest: Holding. Real time.
  ServoStep hold() noexcept { return stop(Status::Holding); }

  /// Takes over from another servo of the same arm and dt, while the arm moves: rule and options are this servo's, and
  /// its command is faded in from the other servo's last velocity over soft_start. The posture is the other servo's
  /// unless the options have one. If the other servo has not started, nothing happens. Real time.
  /// \throws Error where the number of joints or dt differ
  void continue_from(const Servo& other);

  /// Changes the rule from the next cycle on; the rest of the history stays.
  /// \throws Error where a parameter is out of its range
  void set_method(const Method& method);

  /// The arm.
  const Chain& chain() const noexcept { return chain_; }
  /// The settings, as given.
  const ServoOptions& options() const noexcept { return options_; }
  /// The rule.
  const Method& method() const noexcept { return solver_.method(); }
  /// (n,) the reference configuration; empty before reset().
  const JointVector& q() const noexcept { return tracker_.q(); }
  /// (n,) velocity of the last cycle.
  const JointVector& qdot() const noexcept { return tracker_.qdot(); }
  /// Pose of the tip at q().
  const Pose& tip() const noexcept { return state_.tip; }

 private:
  void begin(const JointRef& posture) noexcept;
  ServoStep stop(Status status) noexcept;
  ServoStep resolve(const Twist& twist, bool fade) noexcept;
  JointVector posture_velocity() const noexcept;
  bool fade_in(JointVector& qdot, bool fade) noexcept;
  void take(ServoStep& step, bool achieved) noexcept;

  // servo_limits.cpp
  void limit(ServoStep& step) noexcept;
  void head(ServoStep& step) noexcept;
  void approach(ServoStep& step) noexcept;
  void judge(const JointVector& asked, ServoStep& step) const noexcept;

  // servo_redistribution.cpp
  JointVector redistribute(const JointVector& qdot, const VelocityBounds& bounds, ServoStep& step) noexcept;
  TaskJacobian exact_rows(double regular) noexcept;
  JointVector nearest(const JointVector& begin, const TaskJacobian& rows, const TaskVector& goal, double largest,
                      const JointVector& asked, const VelocityBounds& bounds, ServoStep& step) noexcept;

  Chain chain_;
  ServoOptions options_;
  Task exact_;
  VelocitySolver solver_;
  Avoidance avoidance_;
  LimitTracker tracker_;
  LeastSquares least_squares_;
  LeastSquaresProblem problem_;
  TaskJacobian rows_;
  Spectrum exact_spectrum_;
  ChainState state_;
  JointVector nominal_, qdot_start_;
  double fade_ = 1.0;
};

SIGMAIK_SAME_LAYOUT(Servo, ServoOptions, ServoStep);

}  // namespace sigmaik
