#pragma once
/// \file limits.hpp
/// Bounds on the coming cycle's joint velocity, so that position, velocity, acceleration and jerk limits hold now and
/// can be held for ever, whichever velocity is chosen inside the bounds.
///
/// Limits are meant in discrete time, as a robot's controller checks them: with q_k = q_{k−1} + v_k dt they hold for
/// q_k, v_k, a_k = (v_k − v_{k−1}) / dt and (a_k − a_{k−1}) / dt. Each joint is treated separately.
///
/// *Without a jerk limit.* A velocity v may be chosen if the fastest stop after it, v, v − A dt, v − 2 A dt, …, ends
/// inside:
///
///     D(v) = Σ_{j≥0} max(v − j A dt, 0) dt ≤ upper − q.
///
/// D is convex and piecewise linear, so D⁻¹ is the minimum of its lines: D⁻¹(d) = min_N d/((N+1) dt) + N A dt/2. Since
/// D(v) = v dt + D(v − A dt), an allowed v leaves v − A dt allowed in the next cycle; inside the limits 0 is allowed,
/// from either side. So the intervals of position, velocity and acceleration intersect pairwise, and three intervals
/// that intersect pairwise have a common point: there are bounds for ever.
///
/// *Braking with another limit than speeding up.* A joint brakes, towards a standstill, with the deceleration limit B,
/// and speeds up with the acceleration limit A. D above is the sum with B dt. A cycle that crosses zero keeps to the
/// smaller limit, so that the change of velocity is within the limit of the sign before and of the sign after: from
/// v ≥ 0 the lowest next velocity is
///
///     max(v − B dt, min(0, v − min(A, B) dt)),
///
/// and the highest v + A dt, where B < A v + min(A dt, B dt + v): so the bounds are continuous in v, and both limits
/// hold whether the sign before or after the cycle says what braking is. v − B dt stays allowed where v ≥ B dt, else 0,
/// so D works as before. With a jerk limit a joint that
/// brakes changes its velocity by at most c a cycle, c² + c J dt² = m² + m J dt² + 2 J dt² (|v| − m) with the smaller
/// limit m (and c = m where |v| ≤ m): these are the changes that can fall to m by J dt² a cycle before the joint turns
/// round, by the sum D of changes in place of velocities. A joint that speeds up has √(m² + 2 J dt² |v|). Stops use B.
///
/// *With a jerk limit.* The tracker keeps a stop: the continuous velocity that starts with the present v and a slope s
/// and comes to rest in the least time under |v'| ≤ A, |v''| ≤ J.
///   - Samples of this stop hold the limits: their differences are means of v' over a cycle, and these means change by
///     ≤ J dt a cycle. The first difference does too, if |s − a_k| ≤ J dt/2.
///   - The later part of the stop is the fastest stop from there. So the next sample of the stop may always be chosen,
///     with its slope.
///   - Fastest stops are ordered: of two stops, the one that starts with no less v and no less s has no less v(t) at
///     every later time. (Where both met, the lower stop would have the larger slope, and could stop only beyond the
///     other.)
/// Consider a line of choices (v, s), both growing, through the next sample of the stop that is kept. Choices whose own
/// stop stays inside the upper limits reach up to a largest v, and all choices between have stops inside the lower
/// limits too. Bracketing finds this v, exactly on the samples, because their sums have closed forms. As J → ∞ this is
/// the case without a jerk limit.
///
/// *The way to a velocity.* From velocity v and the change a of the last cycle to a wanted velocity, c = wanted − v
/// away, the same D⁻¹ serves one derivative higher: the largest change from which changes can fall to zero by J dt² a
/// cycle before the sum reaches c is D⁻¹(c) with J dt² in place of A dt. Each cycle takes the largest change that this,
/// A dt and a + J dt² allow. All joints are in proportion to c, with the limits of the joint that needs the most time;
/// a joint that would pass its wanted velocity brakes as hard as its own limits allow.
///
/// *A clock that is not even* (set_cycle()). With h_k for the time of cycle k, q_k = q_{k−1} + v_k h_k, and the limits
/// hold for q_k, v_k, a_k = (v_k − v_{k−1})/h_k and the jerk (a_k − a_{k−1})/m_k, where m_k = (h_k + h_{k−1})/2 is the
/// time between the middles of two cycles. Without a jerk limit (v_k − v_{k−1})/m_k is within the acceleration limit,
/// too:
/// |v_k − v_{k−1}| ≤ A e with e = min(h_k, m_k) ≥ h_k/2. From the first cycle whose time is not dt, until reset(), the
/// bounds are made for any times of the cycles to come.
///   - Without a jerk limit: v h + Φ(v) ≤ room with Φ(v) = v²/A, the way of half the acceleration. This can be held for
///     ever: v' = max(v − A e, 0) has v' h + Φ(v') ≤ Φ(v), because v² − v'² = A e (2v' + A e) and 2e ≥ h.
///   - With a jerk limit the way of the stop is ∫ v dt + H max(s, 0)²/2J, with the longest cycle H, in place of the sum
///     of its samples. A sum of samples at the ends of cycles is less than the integral while v falls, and more by at
///     most the longest cycle times the rise s²/2J.
/// Without a jerk limit a joint that brakes with another limit has B in place of A in Φ. With a jerk limit such a joint
/// changes its velocity by min(A, B) h at most where it chooses; its stop has B.
/// At the change from even cycles, a joint may just be braking towards a position limit by the sum of samples, for
/// which shorter cycles come too late. Such a joint keeps its position limit: until the joint is inside the new bounds,
/// it brakes by up to A max(h_k, h_{k−1}), with a jerk limit by what a cycle of dt takes.
///
/// Where a limit is broken already (reset() outside it, or too fast to stop before it), acceleration and jerk are held
/// first, because the motors can do no more, then velocity, then position: each of these comes back as fast as the
/// limits before it allow, and then stays inside. A motion that leaves a limit is never held back. The bounds are
/// continuous functions of the state; only where a joint with a jerk limit can stop neither below its upper nor above
/// its lower limit, both bounds are at the stop.

#include <array>
#include <cstdint>
#include <limits>

#include <sigmaik/chain.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik::detail {
class StopPath;
}  // namespace sigmaik::detail

namespace sigmaik {

/// Selects the limits of a chain that a LimitTracker holds, and the least speed of a recovery.
struct LimitOptions {
  bool position = true;      ///< whether the chain's position limits are held
  bool velocity = true;      ///< whether the chain's velocity limits are held
  bool acceleration = true;  ///< whether the chain's acceleration limits are held
  bool jerk = true;          ///< whether the chain's jerk limits are held
  /// [rad/s² or m/s²] > 0, the acceleration limit of a joint whose model has none: no motor changes its velocity at
  /// once. 10 is what light arms do; their makers publish 5 to 20. Infinite: such a joint has no limit.
  double assumed_acceleration = 10.0;
  /// In (0, 1], part of the velocity limit: the least speed at which a joint outside its position limits comes back. A
  /// joint without a velocity limit covers its way back, or 1 mm or 1 mrad if this is more, in 0.1 s.
  double recovery_speed = 0.1;
};

/// The time of a cycle may be these parts of dt; see LimitTracker::set_cycle(). A clock that reads two packets at once
/// makes cycles of nearly no time, in which no controller acts. After 20 cycles without a command the controllers of
/// arms stop by themselves (libfranka: 20 packets), and the gains of a servo are for cycles that are not longer by
/// orders.
inline constexpr double kShortestCycle = 0.1, kLongestCycle = 20.0;  ///< see kShortestCycle

/// Kind of limit that forms a bound.
enum class LimitKind : std::int8_t { None, Position, Velocity, Acceleration, Jerk };

/// "none", "position", "velocity", "acceleration", "jerk".
const char* to_string(LimitKind kind) noexcept;

/// Interval of each joint's velocity. lower ≤ upper; infinite where nothing limits.
struct VelocityBounds {
  JointVector lower;                               ///< (n,) [rad/s or m/s]
  JointVector upper;                               ///< (n,) [rad/s or m/s]
  std::array<LimitKind, kMaxJoints> lower_kind{};  ///< which limit makes each lower bound
  std::array<LimitKind, kMaxJoints> upper_kind{};  ///< which limit makes each upper bound

  /// Whether every joint's velocity is inside.
  bool contain(const JointVector& qdot) const noexcept {
    for (Eigen::Index i = 0; i < qdot.size(); ++i) {
      if (!(qdot[i] >= lower[i] && qdot[i] <= upper[i])) return false;
    }
    return true;
  }
};

/// How much of a joint velocity the velocity limits leave.
struct VelocityScale {
  double part = 1.0;  ///< in [0, 1]
  int joint = -1;     ///< whose limit decides; −1: none, the velocity is within all limits
};

/// Follows the command of an arm, q ← q + q̇ dt, and says before each cycle how fast each joint may go.
///
///     LimitTracker tracker(chain.limits(), 1e-3);
///     tracker.reset(q);
///     each cycle:  qdot = …;  tracker.advance(qdot);  // moves qdot into tracker.bounds()
class LimitTracker {
 public:
  /// \param dt [s] > 0, from one cycle to the next
  /// \throws Error where dt, an option or a limit is out of its range
  explicit LimitTracker(const JointLimits& limits, double dt = 1e-3, const LimitOptions& options = {});

  /// Starts, or starts again, at q (n,) with q̇ = qdot (n,) and q̈ = qddot (n,).
  /// \param qdot empty: at rest
  /// \param qddot empty: a joint whose q and q̇ are those of the last cycle keeps the acceleration that the tracker
  ///     knows; another joint has none
  /// \throws Error where a size is wrong or an entry is not finite
  void reset(const JointRef& q, const JointRef& qdot = JointVector(), const JointRef& qddot = JointVector());

  /// Takes over the motion of another tracker with as many joints: its positions, its velocities and, of joints that
  /// have a jerk limit there, its accelerations. Limits that the other tracker did not hold are treated as after a
  /// reset(). If the other tracker has not started, nothing happens. Real time.
  /// \throws Error where the number of joints or dt differ
  void continue_from(const LimitTracker& other);

  /// Sets the time h of the coming cycle and of those after it; dt() before the first call and after reset(). See
  /// limits.hpp, a clock that is not even. Real time.
  /// \return false, with nothing changed, where h is not in [kShortestCycle, kLongestCycle] dt()
  bool set_cycle(double h) noexcept;

  /// Whether a cycle since reset() had another time than dt().
  bool uneven() const noexcept { return uneven_; }
  /// [s], the time of the coming cycle.
  double cycle() const noexcept { return cycle_; }

  /// Bounds of the coming cycle; empty before reset().
  const VelocityBounds& bounds() const noexcept { return bounds_; }

  /// The heading bounds: velocities that the position limits alone allow, with room to stop. A joint needs
  /// acceleration, and time, to reach such a velocity. lower ≤ upper; infinite where there is no position limit. A
  /// joint with a jerk limit has the room of arrival(). Real time.
  VelocityBounds heading() const noexcept;
  /// [rad/s or m/s], the heading bound that a position limit at the distance `way` [rad or m] would make for joint i.
  /// Where the joint is beyond, `way` < 0, the bound is the velocity that leads back, with a minus sign. Real time.
  double heading_speed(int i, double way) const noexcept { return heading_before(i, way * per_dt_); }

  /// How much of q̇ (n,) a motion may have that is to come to rest after q̇/gain: the largest s in [0, 1] with
  /// s |q̇_i| ≤ D⁻¹(|q̇_i|/gain) for each joint, where D(v) is the distance of the fastest stop from v under a half of
  /// the acceleration limit and an eighth of the jerk limit:
  ///
  ///     D(v) = v √(v/J)  where v ≤ A²/J,  else  v/2 (v/A + A/J).
  ///
  /// The motion q̇ = gain · d towards a target at the distance d then never exceeds the velocity from which it can still
  /// stop before the target. The reserve is for the lag of approach(), which follows this velocity by a profile of its
  /// own: on one joint no motion overshoots, for any A and J, up to 0.9 A and J/4. Real time.
  /// \param gain [1/s] > 0
  double arrival(const JointVector& qdot, double gain) const noexcept;

  /// The coming cycle of the way from the present velocity and acceleration to the velocity `wanted` (n,) with no
  /// acceleration left, in the least time under the acceleration and jerk limits, all joints in proportion; see
  /// limits.hpp. The answer may be outside bounds(), where a position limit is near. Real time.
  JointVector approach(const JointVector& wanted) const noexcept;

  /// [rad/s or m/s], the velocity limit of joint i that is held; infinite where there is none.
  double velocity_limit(int i) const noexcept { return velocity_[static_cast<std::size_t>(i)]; }
  /// The largest s in [0, 1] with s |q̇_i| ≤ velocity_limit(i) for each joint, and the joint that decides s.
  VelocityScale velocity_scale(const JointVector& qdot) const noexcept;
  /// The velocity as a part of joint i's velocity limit; as it is where there is none.
  double part_of_limit(int i, double velocity) const noexcept;
  /// [rad/s² or m/s²], the acceleration limit of joint i that is held, the assumed one where the model has none;
  /// infinite where there is none.
  double acceleration_limit(int i) const noexcept { return acceleration_[static_cast<std::size_t>(i)] * per_dt_; }
  /// [rad/s² or m/s²], the deceleration limit of joint i that is held, where it brakes; the acceleration limit where
  /// the model has none.
  double deceleration_limit(int i) const noexcept { return braking_[static_cast<std::size_t>(i)] * per_dt_; }
  /// [rad/s³ or m/s³], the jerk limit of joint i that is held; infinite where there is none.
  double jerk_limit(int i) const noexcept { return most_jerk_[static_cast<std::size_t>(i)]; }
  /// Whether acceleration or jerk limits are held: a command then takes time.
  bool delays() const noexcept { return has_jerk() || least_acceleration() < std::numeric_limits<double>::infinity(); }
  /// Whether a joint has a jerk limit that is held.
  bool has_jerk() const noexcept { return with_jerk_ != 0; }
  /// [rad/s² or m/s²], the smaller of joint i's acceleration and deceleration limits: the joint can do as much
  /// whichever way it changes its speed.
  double least_acceleration(int i) const noexcept { return std::min(acceleration_limit(i), deceleration_limit(i)); }
  /// [rad/s² or m/s²], the least of all joints; infinite where no limit is held.
  double least_acceleration() const noexcept;
  /// [rad/s³ or m/s³], the least of the jerk limits that are held; infinite where there is none.
  double least_jerk() const noexcept;
  /// [s], longer than any motion to a target that rests: three times the longest time that a joint takes through its
  /// range, or through a turn where it has no range, and 3 s more.
  double settling_time() const noexcept { return settling_time_; }

  /// (n,) [rad/s or m/s], inside the bounds: the coming cycle of the fastest stop.
  const JointVector& stop() const noexcept { return stop_; }

  /// One cycle with q̇ (n,). Entries outside the bounds are moved to the nearest; NaN, or a wrong size, becomes stop().
  /// Real time: for each bound of a joint with a jerk limit at most 24 stopping distances; all else is closed form.
  /// \return whether an entry was moved
  bool advance(JointVector& qdot) noexcept;

  /// (n,) [rad or m]: the sum of all cycles. A position within rounding of a limit is set to the limit, and is never
  /// beyond.
  const JointVector& q() const noexcept { return q_; }
  /// (n,) [rad/s or m/s], of the last cycle.
  const JointVector& qdot() const noexcept { return v_; }

  /// Whether each joint is slower than a thousandth of its velocity limit, or than 0.001 rad/s or m/s where it has
  /// none.
  bool resting() const noexcept;

  /// Bit i: joint i is outside its position limits.
  std::uint16_t outside() const noexcept { return outside_; }
  /// Bit i: joint i is outside its position or velocity limits, or too fast to stop inside them.
  std::uint16_t recovering() const noexcept { return recovering_; }

  /// Number n of movable joints.
  int dof() const noexcept { return n_; }
  double dt() const noexcept { return dt_; }  ///< [s]
  /// The settings, as given.
  const LimitOptions& options() const noexcept { return options_; }

 private:
  friend class detail::StopPath;  // follows the stop after a command
  friend struct detail::Members<LimitTracker>;
  struct Window;
  // One number for each joint. Velocities keep their unit; all other quantities are in velocities and cycles: positions
  // [1/h], changes of velocity in a cycle, and changes of these changes, where h is the time of the coming cycle.
  using Numbers = std::array<double, kMaxJoints>;
  // The acceleration of a joint with a jerk limit, and the stop that is kept.
  struct JerkMemory {
    double change = 0.0;      // v_k − v_{k−1}
    double slope = 0.0;       // of the stop that is kept, a cycle
    double next_slope = 0.0;  // the stop's slope a cycle later
    double next = 0.0;        // the stop's velocity a cycle later
  };

  // Whether joint i at q, qdot is where the last cycle left it.
  bool continues(int i, double q, double qdot) const noexcept;
  template <int kPadded>
  bool move(JointVector& qdot) noexcept;
  template <int kPadded>
  unsigned survey() noexcept;
  void clear() noexcept;
  void update() noexcept;
  double longest_settling() const noexcept;
  static void put(int i, const Window& window, VelocityBounds& to) noexcept;
  // Room to the position limits of joint i [velocities × cycles]; negative outside.
  double room_above(int i) const noexcept { return (upper_[static_cast<std::size_t>(i)] - q_[i]) * per_dt_; }
  double room_below(int i) const noexcept { return (q_[i] - lower_[static_cast<std::size_t>(i)]) * per_dt_; }
  // The heading bound of joint i before a position limit that is `room` away.
  double heading_before(int i, double room) const noexcept;
  // The recovery speed of joint i, `outside` [rad or m] beyond a position limit.
  double recovery(int i, double outside) const noexcept;
  // The velocity from which joint i, without a jerk limit, can just stop before a position limit that is `room` away;
  // the velocity that takes joint i back to the limit, where the limit is behind it.
  double towards(int i, double room) const noexcept;
  // With a jerk limit: the largest slope of joint i at its velocity, upwards or downwards.
  double slope_limit(int i, bool upwards) const noexcept;
  // The largest change of velocity in a cycle for the way of joint i to the velocity `wanted`.
  double change_limit(int i, double wanted) const noexcept;
  Window window(int i, bool& broken) const noexcept;
  Window jerk_window(int i, bool& broken) noexcept;
  // limits_uneven.cpp
  void scale_to(double h) noexcept;
  double towards_unevenly(double room, double acceleration) const noexcept;
  Window uneven_window(int i, bool& broken) noexcept;
  void keep_even_stop(int i) noexcept;

  LimitOptions options_;
  double dt_;                   // [s] as given
  double cycle_, per_dt_;       // [s] h, [1/s] 1/h
  double last_ = 1.0;           // [cycles], the time of the last cycle
  bool uneven_ = false;         // since reset() a cycle had another time than dt
  std::uint32_t changing_ = 0;  // bit i: joint i still follows bounds of even cycles, see limits.hpp
  int n_ = 0;
  Numbers lower_, upper_;                                 // [rad or m]
  Numbers velocity_;                                      // V
  Numbers acceleration_;                                  // A dt
  Numbers braking_;                                       // B dt
  Numbers jerk_;                                          // J dt²
  Numbers recovery_;                                      // [rad/s or m/s], infinite without a velocity limit
  Numbers most_acceleration_, most_braking_, most_jerk_;  // A, B and J, in s
  double settling_time_ = 0.0;
  std::uint32_t with_jerk_ = 0;  // bit i: joint i has a jerk limit
  std::uint32_t unequal_ = 0;    // bit i: joint i brakes with another limit than it speeds up
  std::array<JerkMemory, kMaxJoints> jerk_states_{};
  JointVector q_, v_, stop_;
  VelocityBounds bounds_;
  std::uint16_t outside_ = 0, recovering_ = 0;
};

SIGMAIK_SAME_LAYOUT(LimitTracker, LimitOptions, VelocityBounds);

}  // namespace sigmaik
