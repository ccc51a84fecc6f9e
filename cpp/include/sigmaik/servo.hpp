#pragma once
/// \file servo.hpp
/// Pose or twist in, joint command out, each cycle: a rule on the singular directions, inside the arm's limits.

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>

#include <sigmaik/avoidance.hpp>
#include <sigmaik/chain.hpp>
#include <sigmaik/collisions.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/least_squares.hpp>
#include <sigmaik/limits.hpp>
#include <sigmaik/status.hpp>
#include <sigmaik/velocity_solver.hpp>

namespace sigmaik::detail {

class Guide;
class CollisionGuard;
struct Elbow;
// Owns a part of a servo, which is copied with its servo.
template <typename T>
class Owner {
 public:
  Owner() noexcept;
  explicit Owner(std::unique_ptr<T> owned) noexcept;
  Owner(const Owner& other);
  Owner(Owner&& other) noexcept;
  Owner& operator=(Owner other) noexcept;
  ~Owner();
  T* operator->() const noexcept { return owned_.get(); }
  explicit operator bool() const noexcept { return owned_ != nullptr; }

 private:
  std::unique_ptr<T> owned_;
};
extern template class Owner<Guide>;  // each is instantiated where its type is known
extern template class Owner<CollisionGuard>;
extern template class Owner<Elbow>;

}  // namespace sigmaik::detail

namespace sigmaik {

/// How the command gives way where a joint limit would be broken. While no limit would be broken, the command is the
/// rule's answer, to the last digit.
///
/// Velocity limits slow the motion down along its direction; joints that are free to move without moving the tool help
/// first. Position limits that block the direction bend it. Acceleration and jerk limits decide how fast the arm gets
/// there: all joints change in proportion, from the last command towards the new one, so that the tool keeps its
/// direction while it speeds up. Where this proportion would break a limit, for example where one joint brakes as hard
/// as it can, the other joints do as much of the twist as possible.
enum class OnLimit {
  /// At a position limit the free joints take over. Of all velocities that the limits allow, the answer has the twist
  /// nearest to the rule's twist, and of these velocities the answer is the nearest to the rule's. A singular direction
  /// has the weight of a direction at the rule's threshold, and twist that the limits leave undone adds weight to joint
  /// motion, so that the joints do not move much to make up for little twist. J-PARSE's answer, limited in this way,
  /// still does not move the tool away from its target where the limits allow rest.
  Redistribute,
  Scale,  ///< the direction is kept, speed is given up: all joints slow down together
};

/// [m] Points in the tip's frame, up to 8 columns.
using ToolPoints = Eigen::Matrix<double, 3, Eigen::Dynamic, kLayout, 3, 8>;

/// Settings of a Servo.
struct ServoOptions {
  double dt = 1e-3;  ///< [s] > 0, the time from one update to the next, where update() is told no other time
  /// [1/s] ≥ 0, position error to velocity. (JParse's gain_linear is the paper's K, on singular directions alone.) The
  /// gain decides the last part of the way: before it the arm goes as fast as its limits let it stop at the target.
  double gain_linear = 10.0;
  double gain_angular = 10.0;  ///< [1/s] ≥ 0, orientation error to angular velocity
  /// [m] > 0: longer position errors are shortened to it. None: half of length_scale, a distance over which the
  /// Jacobian of an arm stays the same in the main.
  std::optional<double> max_linear_error{};
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
  /// [m/s] > 0: no checked point of the arm moves faster; infinite: no such limit. The checked points are the tip's
  /// origin, the origin of each movable joint's link (so the elbow, too), and speed_points. 0.25 is the reduced speed
  /// of ISO 10218-1. See Servo, tool speed.
  double max_tool_speed = std::numeric_limits<double>::infinity();
  ToolPoints speed_points{};  ///< (3, k) [m] further checked points in the tip's frame, such as the end of a tool
  /// Rows (vx, vy, vz, ωx, ωy, ωz), in the task's axes, that come before the others in every cycle: the other rows have
  /// the motion that leaves these rows as they are. As far as a singularity keeps these rows from being done, as beyond
  /// the reach, all rows are done together: a strict priority would shake the arm there.
  std::array<bool, 6> exact{};
  std::optional<double> length_scale{};  ///< [m], see VelocitySolver; none: Chain::characteristic_length()
  Task task{};                           ///< which rows of the twist matter, and in which axes
  /// (n,) > 0, how much the motion of each joint counts where the arm has more joints than the task has rows: a rail or
  /// a base under the arm with the weight 1e4 moves only where the other joints cannot do the motion, because of a
  /// limit or at a singularity. Only ratios matter. Empty: all 1. See VelocitySolver::set_joint_weights().
  JointVector joint_weights{};
  /// Whether the servo takes another way to a pose target that rests where its own way does not arrive; see Servo.
  bool guided = false;
  /// What the arm must not touch: no command brings a pair of bodies nearer than the margin; see collisions.hpp. None:
  /// nothing is checked.
  std::optional<Collisions> collisions{};
  /// In Python: whether update() raises an Error for a target that is no pose, in place of BadInput and a stop. C++
  /// never throws in the loop.
  bool strict = false;
};

/// What the guide of a servo does (ServoOptions::guided), for the pose target at hand.
enum class GuideState : std::int8_t {
  Off = 0,        ///< there is no guide, or no pose target
  Direct = 1,     ///< the servo goes its own way
  Searching = 2,  ///< the servo's own way does not arrive; the guide looks for another, meanwhile the servo goes on
  Posture = 3,    ///< the tool goes its own way, and the arm's self-motion leads to another configuration
  ChangingBranch =
      4,            ///< the joints go straight to positions at which the tool is at the target: the tool leaves its way
  Unreachable = 5,  ///< no joint positions were found; the servo goes as near as its own way leads
};

/// "off", "direct", "searching", "posture", "changing branch", "unreachable".
const char* to_string(GuideState state) noexcept;

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
  bool tool_speed_limits = false;     ///< max_tool_speed has slowed the motion down
  double tool_speed = 0.0;            ///< [m/s] of the fastest checked point over the cycle; 0 without a max_tool_speed
  TaskVector singular_values;         ///< of the weighted task Jacobian, from large to small; empty while holding
  std::uint8_t singular = 0;          ///< bit i: direction i is singular to the rule, i from 0 to task_rows − 1
  int task_rows = 0;                  ///< m', the number of directions
  /// (6, k) a column for each bit of `singular`, in order: the twist [v; ω], base axes, at the tip's origin, whose rows
  /// in the task are u_i and whose other rows are zero, so |v|² + (length_scale |ω|)² = 1. Of the Jacobian before the
  /// step. The sign of u_i means nothing, but does not change from cycle to cycle. Empty while holding.
  TwistColumns singular_directions;
  /// The target has rested for longer than any motion of the arm takes (Servo::settling_time()), and the arm still
  /// moves, by more than 1e-3 of a velocity limit: the motion is being faded out.
  bool not_settling = false;
  GuideState guide = GuideState::Off;  ///< what the guide does
  /// Bit i: by the way that the guide has taken, joint i ends more than 0.5 rad (prismatic: half of the characteristic
  /// length) from where the servo's own way leads.
  std::uint16_t guide_joints = 0;
  /// [m] the least distance of all pairs of bodies after the step, below 0 in contact; infinite where nothing is
  /// checked.
  double clearance = std::numeric_limits<double>::infinity();
  /// The pair of this distance, by the numbers of Collisions::body_names(); −1: none.
  std::array<std::int16_t, 2> nearest{-1, -1};
  /// Whether the step keeps clear of a body that the rule's answer would come too near to, or leads away from one.
  bool limited_by_collisions = false;
};

/// Drives a chain's own reference configuration towards poses, or along twists. A servo integrates the command that it
/// gives (q ← q + q̇ dt), so without measure() no sensor noise enters.
///
/// Every command holds the chain's position, velocity, acceleration and jerk limits, and leaves room to go on holding
/// them (limits.hpp). An arm that starts outside its limits comes back by itself. Bad input stops the arm as fast as
/// the limits allow.
///
/// *Rest.* Towards a pose target that rests the arm comes to rest, and after a zero twist too.
///   - Without limits, and with JParse of equal gains, V = ½|e|² does not grow: along each direction the answer has the
///     sign of the command, q̇ = Σ σ_i c_i/w_i² v_i with w_i = max(σ_i, ε_i), so V̇ = −ẋᵀJ q̇/gain = −Σ (σ_i
///     c_i/w_i)²/gain ≤ 0, for any thresholds ε_i > 0; and q̇ = 0 where this is zero. (With unequal gains K of the paper
///     this does not hold: with K = (8, 0.1) the error grew in 5 of 20 000 cases.) The error that is shortened is a
///     gradient as well, of a function that grows as |e|² first and as |e| then.
///   - The answer is continuous in c and σ: g_i = c_i/σ_i where σ_i > ε_i, else σ_i c_i/ε_i², and both are the same at
///     σ_i = ε_i. ε_i grows with √|c_i|, so the answer is bounded by |c_i|/(2ε_i), and vanishes with c_i.
///   - A factor in [0, 1] on q̇ (arrival, velocity limits) keeps V̇ ≤ 0. At position limits the answer is the minimum of
///     ½|S(q̇ − q̇_rule)|² in a box that contains 0, but for a small weight of joint motion; as SᵀS q̇_rule = Jᵀẋ, again
///     ẋᵀJ q̇ ≥ ½|S q̇|².
///   - Acceleration and jerk limits delay q̇. The velocity stays below the velocity from which the joints can stop in
///     time (LimitTracker::arrival), with a reserve of 2 in acceleration and of 8 in jerk; on one joint this excludes
///     overshoot for any limits. Near a singularity, and where a position limit blocks, the loop's gain can be larger
///     than q̇/error says, and the arm could swing: from the third reversal of the motion on, each reversal takes 30 %
///     of the gain away, until the target changes. The gain of a swing falls geometrically, and below the gain that the
///     limits' delay allows the swing dies out.
///   - A motion that creeps along a valley of |e|², for example of a redundant arm beyond its reach, has no bound in
///     time. After settling_time() such a motion is faded out with a time constant of 1 s, and not_settling says so.
///     A target that rests therefore always brings the arm to rest. Another target, another rule, a twist command, or a
///     measured arm that was moved while it rested starts both counts anew.
///
/// *Guide* (ServoOptions::guided). A servo lets the error of the pose fall, and may end at a position limit or at a
/// singularity although another configuration has the tool at the target. A guided servo predicts its own motion
/// towards a target that has rested for 0.1 s. Where this motion does not arrive within 4.5 s (or 1.4 times the travel
/// time of the joints, or of the gains), the guide searches the nearest configuration of the target (PositionIk). An
/// arm with more joints than the task has rows first tries this configuration as a posture, and keeps the tool on its
/// way. Otherwise the joints go straight to the configuration, inside all limits, and the tool leaves its way:
/// GuideState::ChangingBranch. Where no configuration is found, the state is Unreachable, and the servo goes its own
/// way. Prediction and search are cut into slices, so that a cycle stays bounded (some 50 µs more while the guide
/// works, for a tenth to a third of a second), and they are deterministic. Where the servo's own way arrives, the
/// commands are those of a servo without a guide, but for the elbow's side and singularities (below). Targets that
/// move, and twists, are never led elsewhere. The constructor takes about 2 ms.
///
/// *The elbow's side.* The straight elbow is a singularity with the same reaches on either side. An arm that folds to
/// the other side, on its way back from the edge of its reach, may end at a position limit, and another time has other
/// joint positions for the same pose. A guided servo keeps the elbow on its side: 0.05 rad before the straight angle is
/// a heading bound, like a position limit, for pose targets and for twists; a reach of 1 m becomes 0.3 mm shorter. An
/// elbow that starts within 0.025 rad of the straight angle may bend to either side. On some arms (Panda, xArm7, Comau
/// Racer) a position limit leaves less than half as much on one side as on the other. An elbow on this short side,
/// where it has started or where the guide has led it, is free until it leaves this side. With more than six joints and
/// two long sides (iiwa, Gen3) a self-motion leads from one side to the other, and the elbow is free. Where the guide
/// leads the joints, it may change the side.
///
/// *Out of a singularity.* To first order no motion of the joints moves the tool along a direction u that is lost, with
/// uᵀJ = 0. To second order a motion δ in the null space does, by ½ δᵀH δ with H_kj = uᵀ∂J_j/∂q_k, symmetrised. So a
/// guided servo with the adaptive JParse leaves an exactly singular configuration where the second order leads the
/// right way: a straight-up iiwa or Gen3 follows a twist along y, down, and about x. With the part
/// w_i = max(0, 1 − (σ_i/0.1ε)²) of a direction that is lost below a tenth of the rule's threshold ε, c = Σ w_i u_i
/// u_iᵀẋ, u = c/|c| and the projector P = 1 − Σ (1 − √w_i) v_i v_iᵀ (w_i = 0 for regular directions), the servo adds
///
///     q̇ = s (|c|/ε) P y,     P H P y = λ y,   λ the largest eigenvalue,
///
/// where s goes from 0 at λ = 0.02 σ_max/rad to 1 at twice this. At σ_i = 0 the speed is the one that the threshold
/// allows the direction. At 0.1 ε it is zero, and the rule alone, whose q̇ = (σ_i/ε)(|c|/ε) grows with σ_i, moves on
/// along the direction that has opened. The sign of y is the one for which cᵀJ P y ≥ 0, so what is added never lets the
/// error grow (with equal gains V̇ ≤ 0 stays); where the first order does not decide, y follows that of the last cycle,
/// and in the first cycle the side with more room to the position limits. Nothing is added where λ ≤ 0, because beyond
/// the reach no motion gains, nor as far as a joint's velocity limit would slow down what the rule does. Other rules,
/// `exact` and joint_weights have no such way. Where a singularity opens only by a detour (a wrist), the guide leads to
/// a pose.
///
/// *Time of a cycle.* update(), update_twist() and hold() take the time since the last call on the robot's clock, in
/// [kShortestCycle, kLongestCycle] times options().dt; options().dt where no time is given. A program that loses a
/// packet, or whose loop is not even, tells the time that has passed, and all limits hold against the clock: the
/// position command advances by q̇ dt, and q̇ changes by no more than the acceleration limit times dt. limits.hpp says
/// how accelerations are counted on a clock that is not even, and what is promised at the change. A time outside the
/// range is bad input: the arm brakes in a cycle of the nearest time in the range. With options().dt in each call the
/// commands are the same, to the last digit, as without a time. From another time on, until reset(), joints brake
/// earlier before their position limits, because the times of the cycles to come are unknown.
///
/// *Tool speed* (ServoOptions::max_tool_speed). In each cycle the distance that every checked point moves is at most
/// max_tool_speed times the time of the cycle. The motion slows down along its direction in joint space. To go on, the
/// servo keeps a stop in proportion, q̇(t) = σ(t) q̇ with σ falling from 1 to 0 in T = max |q̇_i|/A_i: while a point with
/// the speed g and the curvature c = |q̇ᵀ(∂J/∂q)q̇| brakes, its speed is at most σ (g + c ∫σ) ≤ M, where
///
///     M = g  where c T ≤ g,  else  (g + c T)²/(4 c T),
///
/// and commands keep M ≤ max_tool_speed at the end of the cycle. Where acceleration or position limits keep the arm
/// from that (a start that is faster, joints that brake one by one at their position limits, jerk limits while the
/// acceleration has to fall first), these limits come first, and the arm takes the slowest motion that they leave.
///
/// A servo remembers the motion that it commanded (LimitTracker), the posture, the fading after reset(), and
/// guesses that make the next cycle cheap and continuous: decompositions and an active set.
class Servo {
 public:
  /// \throws Error where an option is out of its range
  explicit Servo(Chain chain, const Method& method = JParse{}, const ServoOptions& options = {});

  /// Starts, or starts again, at q (n,): forgets all history, and takes q as the posture unless the options have one.
  /// Continuous joints take the turn of the given posture that is nearest to q. To tell a running servo where the arm
  /// is, call measure().
  /// \param qdot (n,) how the arm moves now, from which the command is faded; empty: the arm is at rest
  /// \param qddot (n,) its acceleration, which matters to jerk limits; empty: joints whose q and q̇ are those of the
  ///     last cycle keep the acceleration that the servo knows, and of other joints none is assumed
  /// \throws Error where a size is wrong or an entry is not finite
  void reset(const JointRef& q, const JointRef& qdot = JointVector(), const JointRef& qddot = JointVector());

  /// Tells the servo where the arm is, as often as the arm is measured, before update(). The following error, q minus
  /// the reference, passes a low-pass filter of 0.1 s, and the pose error of update() is that of the arm instead of
  /// that of the reference: the tool arrives although the joints' controllers leave an error, and little of the noise
  /// enters the command. The command stays continuous and inside all limits, which hold for the reference. reset()
  /// forgets the measurements. Real time.
  /// \param q (n,) measured positions
  /// \param qdot (n,) measured velocities, with which the filter does not lag; empty: unknown
  /// \return false where the measurement is refused: a size is wrong, an entry is not finite, or reset() was not called
  bool measure(const JointRef& q, const JointRef& qdot = JointVector()) noexcept;

  /// (n,) measured minus commanded position, filtered; zero before measure().
  const JointVector& following_error() const noexcept { return following_error_; }

  /// One cycle towards a pose of the tip in base. Real time: at most 3 decompositions (Spectrum::decompose) and 14
  /// problems (LeastSquares::solve), as all commands. A target that is not a pose is refused: BadInput, and the arm
  /// stops. A rotation within kRotationTolerance is made one (nearest_pose()), and counted where is_rough().
  /// \param feedforward twist [v; ω] of a target that moves, base axes, at the target's origin; added to gain × error,
  ///     after the error's caps. Behind a target of constant twist the tip lags by speed/gain without the feedforward,
  ///     and not at all with it.
  /// \param dt [s] the time since the last call; see Servo, time of a cycle
  ServoStep update(const Pose& target, const Twist& feedforward = Twist::Zero(),
                   std::optional<double> dt = std::nullopt) noexcept;

  /// One cycle along a twist [v; ω], base axes, at the tip's origin. Real time.
  ServoStep update_twist(const Twist& twist, std::optional<double> dt = std::nullopt) noexcept;
  /// One cycle along a twist [v; ω] of another point, or in the tool's axes, as jog devices send it. Real time.
  /// \param frame the axes of the twist and of `point`
  /// \param point [m] that moves at v: in base where the axes are the base's; from the tip's origin where they are the
  ///     tool's, so that zero is the tip's origin
  ServoStep update_twist(const Twist& twist, Frame frame, const Eigen::Vector3d& point,
                         std::optional<double> dt = std::nullopt) noexcept;
  /// Targets of update() since the servo was made whose rotation was off by more than rounding, and was made one.
  std::int64_t rough_targets() const noexcept { return rough_targets_; }

  /// One cycle of the fastest stop that the limits allow, or of rest: Holding; before reset() BadInput. Real time.
  ServoStep hold(std::optional<double> dt = std::nullopt) noexcept {
    return stop(begin_cycle(dt) ? Status::Holding : Status::BadInput);
  }

  /// Takes over from another servo of the same arm and dt, while the arm moves: rule and options are this servo's, and
  /// its command is faded in from the other servo's last velocity over soft_start. The posture is the other servo's
  /// unless the options have one, and the tool the other servo's unless this servo has one. If the other servo has not
  /// started, nothing happens. Real time.
  /// \throws Error where the number of joints or dt differ
  void continue_from(const Servo& other);

  /// Puts a tool on the tip, from the next cycle on: targets, twists, tip() and all poses of the answers are then those
  /// of the tool's frame. q̇ does not jump: as after a reset() of a moving arm, the command is faded in from the last
  /// velocity over soft_start, inside all limits. A target that the tip has reached is another target for the tool.
  /// length_scale and max_linear_error stay. The inertia of a tool is for Chain::with_tool() and Dynamics. The guide of
  /// a servo whose task leaves rows out needs a chain with the tool, and is Off while there is one. Real time.
  /// \param tool frame of the tool in chain().tip(); the identity takes the tool off. A rotation within
  ///     kRotationTolerance is made one
  /// \return false where this is not a pose; then nothing changes
  bool set_tool(const Pose& tool) noexcept;
  /// As given to set_tool(); the identity at first.
  const Pose& tool() const noexcept { return tool_; }

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
  /// [s], the time of the last cycle, or of the one that has begun.
  double cycle() const noexcept { return tracker_.cycle(); }
  /// (n,) velocity of the last cycle.
  const JointVector& qdot() const noexcept { return tracker_.qdot(); }
  /// Pose of the tip at q(), of the tool where there is one.
  const Pose& tip() const noexcept { return state_.tip; }
  /// [m], the length that weighs as much as one radian.
  double length_scale() const noexcept { return solver_.length_scale(); }
  /// [m], the length that longer position errors are shortened to.
  double max_linear_error() const noexcept { return max_linear_error_; }
  /// How fast the arm can go by its limits, as the rule sees it.
  const Pace& pace() const noexcept { return solver_.pace(); }
  /// [s], after which a motion towards a target that rests is faded out; see LimitTracker::settling_time().
  double settling_time() const noexcept { return tracker_.settling_time(); }

 private:
  friend class detail::Guide;  // predicts with a servo of its own
  friend struct detail::Members<Servo>;
  void begin(const JointRef& posture) noexcept;
  // Pose and Jacobian of the tip, with the tool, at the reference.
  void locate() noexcept;
  void locate_measured() noexcept;
  bool begin_cycle(std::optional<double> dt) noexcept;
  ServoStep stop(Status status) noexcept;
  ServoStep resolve(const Twist& twist, const Twist* feedforward, bool fade, const JointVector* goal) noexcept;
  JointVector posture_velocity() const noexcept;
  const JointVector* ask_guide(const Pose& target, const Twist& error) noexcept;
  void forget_guide() noexcept;
  bool fade_in(JointVector& qdot, bool fade) noexcept;
  void take(ServoStep& step, bool achieved) noexcept;
  void watch(const Pose& target, ServoStep& step) noexcept;

  // The joints' weights in the least squares below: √(w_j / min w), all 1 without weights.
  bool weighs_joints() const noexcept { return solver_.lightness().size() != 0; }
  double heaviness(int i) const noexcept { return weighs_joints() ? 1.0 / std::sqrt(solver_.lightness()[i]) : 1.0; }

  // servo_priority.cpp
  bool has_exact() const noexcept { return options_.exact != std::array<bool, 6>{}; }
  void prioritize(const Twist& twist, const JointVector& posture, Solution& solution) noexcept;
  JointVector mixed(const JointVector& by_priority, const JointVector& together) const noexcept;
  TaskJacobian weighted_rows(const Task& task) const noexcept;

  // servo_escape.cpp
  bool escapes() const noexcept;
  bool escape(const Twist& twist, JointVector& qdot) noexcept;
  JointMatrix second_order(const Twist& along) const noexcept;

  // servo_arrival.cpp
  bool arrive(const Twist& feedforward, JointVector& qdot) noexcept;
  double calm() const noexcept;
  void expect_motion() noexcept;
  void count_reversals(const JointVector& qdot) noexcept;
  void slow_down(ServoStep& step) noexcept;
  bool slow_down_by_rows(const JointVector& asked, bool by_priority, JointVector& qdot, ServoStep& step) noexcept;

  // servo_limits.cpp
  void limit(ServoStep& step) noexcept;
  bool folds(const JointVector& qdot) const noexcept;
  double folding_limit() const noexcept;
  void keep_side(VelocityBounds& heading) const noexcept;
  JointVector unfolded(const JointVector& asked, ServoStep& step) noexcept;
  void head(ServoStep& step) noexcept;
  void approach(ServoStep& step, bool redistributes) noexcept;
  void lead(const JointVector& goal, ServoStep& step) noexcept;
  void judge(const JointVector& asked, ServoStep& step) const noexcept;

  // servo_speed.cpp
  bool holds_tool_speed() const noexcept { return options_.max_tool_speed < std::numeric_limits<double>::infinity(); }
  double tool_speed(const JointVector& qdot) const noexcept;
  double tool_speed_part(const JointVector& qdot) const noexcept;
  JointVector nearest_slow(const JointVector& slow, const JointVector& fast) const noexcept;
  JointVector slowest(JointVector qdot, const VelocityBounds& bounds) const noexcept;
  void slow_tool(ServoStep& step) noexcept;
  void hold_tool_speed(ServoStep& step) noexcept;
  // servo_collisions.cpp
  void set_collisions();
  void look_around(ServoStep* step, double dt) noexcept;
  bool clears(const JointVector& qdot) noexcept;
  void head_clear(const JointVector& asked, const VelocityBounds& heading, ServoStep& step) noexcept;
  void add_clear_rows(const JointVector& begin) noexcept;
  bool shield(const JointVector& asked, ServoStep& step) noexcept;

  // servo_redistribution.cpp
  JointVector redistribute(const JointVector& qdot, const VelocityBounds& bounds, ServoStep& step) noexcept;
  JointVector redistribute_together(const JointVector& qdot, const VelocityBounds& bounds, ServoStep& step) noexcept;
  JointVector redistribute_by_priority(const JointVector& qdot, const VelocityBounds& bounds, ServoStep& step) noexcept;
  JointVector nearest(const JointVector& begin, const TaskJacobian& rows, const TaskVector& goal, double largest,
                      const JointVector& asked, const VelocityBounds& bounds, ServoStep& step) noexcept;

  Chain chain_;
  ServoOptions options_;
  Task exact_, rest_;  // the rows that come first, and the other rows of the task
  VelocitySolver solver_;
  Avoidance avoidance_;
  LimitTracker tracker_;
  LeastSquares least_squares_, slowing_;
  LeastSquaresProblem problem_;
  TaskJacobian rows_;
  Spectrum exact_spectrum_, rest_spectrum_;
  Resolution exact_resolution_, rest_resolution_;
  double lost_ = 0.0;  // how far the exact rows cannot be done, in [0, 1]
  ChainState state_;
  JointVector nominal_, qdot_start_, following_error_;
  JointVector expected_error_;  // the following error of a resting arm that nobody has moved since
  JointVector last_way_;        // the fastest q̇ since the motion turned round last
  int reversals_ = 0;
  std::int64_t rough_targets_ = 0;
  Pose tool_ = Pose::Identity();
  bool with_tool_ = false;  // tool_ is not the identity
  Pose measured_tip_ = Pose::Identity(), last_target_ = Pose::Identity();
  double max_linear_error_;
  double fade_ = 1.0, rested_ = 0.0;
  bool measured_ = false;
  bool escapes_ = false;                         // out of singularities by second order
  JointVector escape_;                           // y of the way out of a singularity, in the last cycle; empty: none
  JointVector guided_posture_;                   // the posture that the guide has given; empty: none
  detail::Owner<detail::Guide> guide_;           // null: not guided
  detail::Owner<detail::Elbow> elbow_;           // null: may fold to either side
  detail::Owner<detail::CollisionGuard> guard_;  // null: nothing is checked
};

SIGMAIK_SAME_LAYOUT(Servo, ServoOptions, ServoStep);

}  // namespace sigmaik
