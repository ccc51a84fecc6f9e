#pragma once
/// \file constrained_ik.hpp
/// Inverse kinematics as constrained least squares, after G. Schreiber, M. Otter, G. Hirzinger, "Solving the
/// singularity problem of non-redundant manipulators by constraint optimization", IROS 1999. Equation numbers are
/// theirs.
///
/// In each cycle i the joints' step Δq from q_{i−1} minimises, over linearisations j = 1, 2, … at q_i^{(j−1)} (9)–(12),
///
///     |α e^ap|² + |β (J^ap Δq − Δx_d^ap)|² + |γ ϑ|²                        (24), (25), (34)
///
/// where e^ex = 0 (26), inside the joints' limits (13)–(16), (27), (28). e = x − x_d* is the pose's error, in an exact
/// part and an approximate part; x_d* = x_d − Δx_d ϑ is the target, slowed down by ϑ in [0, 1] (33). β keeps the joints
/// from oscillating: without active limits an error decays by the factor β²/(α²+β²) a cycle.
///
/// Rotations are linearised on their manifold: for φ = log(R R_dᵀ), φ̇ = J_l⁻¹(φ) ω, exactly, so that large errors
/// converge as fast as small ones.
///
/// *Coming to rest.* Equations (13)–(28) look at one cycle. With acceleration limits an arm that takes all of an error
/// away as fast as a cycle allows cannot stop at the target, and swings about it for ever. So an *arrival* begins in a
/// cycle whose limits leave the exact part undone, in which the target jumps (Δx_d/dt changes by more than Σ_j |J_j|
/// w_j, where 2 w_j is the width of joint j's bounds), or before which an approximate error is above 0.1 m or rad. It
/// ends when what is behind can be made up in one cycle, with a twentieth of the acceleration, and no limit is active.
/// All other cycles are the problem above, unchanged.
///
/// In an arrival a cycle tells two parts of what it is asked apart. The target's own motion Δx_d is followed as above.
/// The error e₀ that is behind when the cycle starts, the tip minus the last x_d*, is closed by
///
///     c = Δq₀/dt · LimitTracker::arrival(Δq₀/dt, κ/dt),     J^ex Δq₀ = −κ e₀^ex,  min |α(J^ap Δq₀ + e₀^ap)|² + |β J^ap
///     Δq₀|²
///
/// where κ is the part of an error that a cycle closes without limits: dt/25 ms for the exact rows, and α²/(α²+β²) for
/// the others, whichever is more. Δq₀/κ is the way that is left. The way ends inside the position limits; otherwise a
/// joint would stand at its limit while the others take the tip away from the target. The joints never close faster
/// than they can still brake on this way, with half of their acceleration. The optimisation then asks its rows to
/// change by J c dt instead of −e₀. As the way goes to zero, c does: a resting target is a fixed point. An exact error
/// that one cycle can make up, with a twentieth of the acceleration, is made up in one cycle.
///
/// Where the limits of a cycle leave the exact part undone, the direction of what can be done is not that of the way,
/// and joints that move nothing but the exact part would tilt the tool. There, and for every closing motion under a
/// jerk limit, the joints go in proportion: by LimitTracker::approach() from q̇ to the velocity that follows the target
/// plus c, slowed down to the velocity limits. Between this and the optimisation the answer is mixed by how much is
/// undone.
///
/// At the edge of the reach the way Δq₀/κ is longer than what a straight line finds, and c turns against the arm again
/// and again. From the second such turn at a resting target on, each turn leaves 0.7 of c. Each time that the error has
/// fallen by a fiftieth, one turn is forgiven: an arm that swings about a singularity on its way arrives. At the edge
/// of the reach the error falls no further, so c goes to zero there. A target that moves gets all of c back.
///
/// Along a valley of the error the arm may creep for as long as it likes. After settling_time() at a resting target q̇
/// is faded out with a time constant of 1 s, and not_settling says so: a target that rests always brings the arm to
/// rest.
///
/// *Looking ahead.* With all six rows of a six-axis arm exact, only ϑ can give way, and ϑ of one cycle comes too late
/// where the path bends the joints' motion soon. The step therefore previews the path, as if the target went on in the
/// direction of Δx_d: points (ℓ, q) at most 2 mm or 0.02 rad of a joint apart, each by a step of Newton's method from
/// the point before, 24 more a cycle. With q' = dq/dℓ, x = ℓ̇² and u = ℓ̈,
///
///     x q'_i² ≤ V_i²,     |q'_i u + q''_i x| ≤ 0.85 A_i
///
/// Backwards from the end of the preview, where the arm has to be able to stand, the largest x_k for which a u with
/// x_k + 2 Δℓ u ≤ x_{k+1} exists is the fastest speed from which all that follows can be passed; it is a lower bound of
/// ϑ. A target that turns sharply at speed starts a new preview, and may be too fast for it. Jerk limits are not
/// previewed.
///
/// In a singularity in which no joint motion makes any part of Δx_d, ϑ = 1. Where two axes are in line there, the
/// joints turn about them, with the tip at rest, to the nearest posture from which Δx_d can be made. The search takes
/// one cycle of about 0.1 ms.
///
/// Where the constraints exclude each other, limits come first, then torques, then the exact part, then the largest
/// errors allowed, then the rest: there is always an answer.

#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include <sigmaik/analytic_ik.hpp>
#include <sigmaik/chain.hpp>
#include <sigmaik/dynamics.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/least_squares.hpp>
#include <sigmaik/limits.hpp>
#include <sigmaik/spectrum.hpp>
#include <sigmaik/status.hpp>
#include <sigmaik/task.hpp>

namespace sigmaik {

/// Settings of ConstrainedIk. Six numbers are one for each row (vx, vy, vz, ωx, ωy, ωz), in the task's axes.
struct ConstrainedIkOptions {
  double dt = 1e-3;                                                  ///< [s] > 0, from one update to the next
  Task task{};                                                       ///< rows that matter at all, and their axes
  std::array<bool, 6> exact{true, true, true, false, false, false};  ///< of these, the rows to be met exactly
  Twist alpha = Twist::Ones();                                       ///< ≥ 0, weights of the error [1/m, 1/rad]
  /// ≥ 0, weights of the error's change in a cycle [1/m, 1/rad]. Errors decay in about dt (α²+β²)/α²: 5 √(1 ms/dt)
  /// gives 25 ms at any dt.
  Twist beta = Twist::Constant(5.0);
  std::optional<double> gamma{};  ///< > 0, weight of the time scaling ϑ; none: ϑ = 0
  /// > 0, largest error of the approximate rows [m, rad], for each row separately; infinite for none. Where max_error
  /// and the exact part exclude each other, max_error is given up, and error_active says so.
  Twist max_error = Twist::Constant(std::numeric_limits<double>::infinity());
  int iterations = 2;          ///< ≥ 1, linearisations a step
  bool torque_limits = false;  ///< hold the chain's effort limits: M q̈ + C q̇ + g, with the inertias of the chain
  Eigen::Vector3d gravity{0.0, 0.0, -9.80665};  ///< [m/s²], in base axes
  /// Use the closed form where the chain has one and its answer is inside the limits (35).
  bool analytic = true;
  LimitOptions limits{};  ///< which of the chain's limits are held; see limits.hpp
  bool strict = false;    ///< see ServoOptions::strict
};

/// How a step was computed.
enum class IkSource : std::int8_t { Analytic, Optimised };

/// "analytic", "optimised".
const char* to_string(IkSource source) noexcept;

/// Answer of a step. By value, no heap.
struct ConstrainedIkStep {
  JointVector q;     ///< (n,) position command
  JointVector qdot;  ///< (n,) velocity command over the last dt
  /// Ok: the target is met. Damped: the target is not met, and no limit is the cause. Limited: a limit holds the step
  /// back. BadInput.
  Status status = Status::BadInput;
  Twist error = Twist::Zero();       ///< [m, rad] tip minus target, after the step
  Twist path_error = Twist::Zero();  ///< the same, of the target slowed down by ϑ; equal where ϑ = 0
  double time_scale = 0.0;           ///< ϑ in [0, 1]: 0 as asked, 1 a complete stop; shows how hard the step is
  std::uint16_t active = 0;          ///< bit i: a limit of joint i is active
  bool torque_active = false;        ///< a torque limit is active, or cannot be met
  bool error_active = false;         ///< max_error is active, or has been given up
  /// The exact part's linearised equations hold, and no exact error is left for the coming cycles.
  bool exact_met = true;
  /// The target has rested for longer than any motion of the arm takes (settling_time()), and the arm still moves.
  bool not_settling = false;
  IkSource used = IkSource::Optimised;  ///< where the step comes from
};

/// Follows a target pose, one step a cycle. The object keeps its own reference configuration and reads no measured
/// positions.
class ConstrainedIk {
 public:
  /// \throws Error where an option is out of its range, or torque limits are asked for without inertias or efforts
  explicit ConstrainedIk(Chain chain, const ConstrainedIkOptions& options = {});

  /// Starts, or starts again, at q (n,), moving with qdot (n,); empty: at rest.
  /// \throws Error where a size is wrong or an entry is not finite
  void reset(const JointRef& q, const JointRef& qdot = JointVector());

  /// One cycle towards a pose of the tip in base. Real time: each iteration of the options solves one problem
  /// (LeastSquares::solve), an arrival a few more, and a preview makes at most 24 points. If the target is not a pose,
  /// the status is BadInput and the arm stops.
  ConstrainedIkStep update(const Pose& target) noexcept;
  /// The older name of update().
  ConstrainedIkStep step(const Pose& target) noexcept { return update(target); }

  /// The arm.
  const Chain& chain() const noexcept { return chain_; }
  /// The settings, as given.
  const ConstrainedIkOptions& options() const noexcept { return options_; }
  /// Whether the closed form is available.
  bool has_analytic() const noexcept { return analytic_.has_value(); }
  /// (n,) the reference configuration; empty before reset().
  const JointVector& q() const noexcept { return tracker_.q(); }
  /// Pose of the tip at q().
  const Pose& tip() const noexcept { return state_.tip; }
  /// The pose that the last step aimed at: its target, slowed down by ϑ.
  const Pose& reference() const noexcept { return reference_; }
  /// [s], after which a motion towards a target that rests is faded out; see LimitTracker::settling_time().
  double settling_time() const noexcept { return tracker_.settling_time(); }

 private:
  friend struct detail::Members<ConstrainedIk>;
  struct Linearisation;
  struct Closing;
  // The path ahead of the target, if the target goes on as it does: how fast each point may be passed.
  struct Preview {
    static constexpr int kPoints = 512;
    struct Point {
      double at = 0.0;    // [m, rad] way along the path
      double most = 0.0;  // largest x = ℓ̇² that the limits of velocities and accelerations allow, by themselves
      // |a_i u + b_i x| ≤ A_i from here to the next point, with u = ℓ̈ and a_i ≥ 0: 1 − 2Δℓ b_i/a_i and 2Δℓ A_i/a_i
      std::array<double, 6> left{}, brake{};
    };
    std::array<Point, kPoints> points{};
    // From the first point on: x of the target as it is expected, and the largest x from which all can be passed.
    std::array<double, kPoints> asked{}, fastest{};
    int first = 0, count = 0;
    double way = 0.0;  // of the reference, since `start`
    Twist direction = Twist::Zero();
    Pose start = Pose::Identity();
    ChainState state;  // at the last point
    JointVector q, slope;
  };
  bool previews() const noexcept;
  void find_turn(const Twist& direction) noexcept;
  bool turn(const Twist& motion, ConstrainedIkStep& step) noexcept;
  double look_ahead(const Twist& motion) noexcept;
  void begin_preview(const Twist& direction) noexcept;
  bool extend_preview() noexcept;
  void set_limits(Preview::Point& point, double step, const Twist& slope, const Twist& bend) const noexcept;

  bool try_analytic(const Pose& target, ConstrainedIkStep& step) noexcept;
  double decay() const noexcept;
  Closing close(bool still) noexcept;
  bool jumps(const Twist& motion) const noexcept;
  void end_arrival() noexcept;
  bool optimise_once(const Pose& target, const Twist& motion, double least, ConstrainedIkStep& step) noexcept;
  void calm(const JointVector& wanted, double error, bool still) noexcept;
  JointVector follow(const Twist& motion) noexcept;
  LeastSquaresSolution solve_freely(double part) noexcept;
  JointVector head(const JointVector& wanted) const noexcept;
  double missed(const LeastSquaresSolution& solution) const noexcept;
  bool exceeds(const Eigen::Matrix3d& rotation, const Closing& closing) const noexcept;
  void head_for(const JointVector& velocity, double share, ConstrainedIkStep& step) noexcept;
  void fade(const Pose& target, ConstrainedIkStep& step) noexcept;
  void settle(const Closing& closing, const Twist& motion, double missed, ConstrainedIkStep& step) noexcept;
  void optimise(const Pose& target, const Twist& motion, double least, ConstrainedIkStep& step) noexcept;
  void prepare() noexcept;
  void prepare_torques() noexcept;
  void set_approximate_rows(const Linearisation& at, const Twist& motion, const Closing& closing) noexcept;
  void set_exact_rows(const Linearisation& at, const Closing& closing) noexcept;
  void report(const LeastSquaresSolution& solution, bool error_lost, ConstrainedIkStep& step) const noexcept;

  Chain chain_;
  ConstrainedIkOptions options_;
  Task approximate_, exact_;
  std::optional<AnalyticIk> analytic_;
  std::optional<Dynamics> dynamics_;
  LimitTracker tracker_;
  LeastSquares least_squares_, closing_;
  LeastSquaresProblem problem_;
  DynamicsTerms terms_;
  int torque_rows_ = 0, error_rows_ = 0;
  bool arriving_ = false;              // an arrival is going on, see above
  Twist last_motion_ = Twist::Zero();  // the target's motion in the last cycle
  double last_way_ = 0.0;              // [m, rad] of the reference in the last cycle
  double patience_ = 1.0;  // in [0, 1], part of the closing velocity; below 1 after the arm swung about the target
  int turns_ = 0;          // how often the closing motion turned against the arm since the target rests
  bool against_ = false;   // the closing motion was against the arm in the last cycle
  double least_error_ = std::numeric_limits<double>::infinity();  // of the arrival, when a turn was forgiven last
  ChainState state_;
  Preview preview_;
  JointVector turn_;    // where a motion of the joints that leaves the tip at rest ends; empty: there is none
  bool stuck_ = false;  // the last step stood still before its target
  Pose reference_ = Pose::Identity(), last_target_ = Pose::Identity();
  double rested_ = 0.0;    // [s] since the target changed last
  bool last_free_ = true;  // the last step was closed form, or met no limit and agreed with it
};

SIGMAIK_SAME_LAYOUT(ConstrainedIk, ConstrainedIkOptions, ConstrainedIkStep);

}  // namespace sigmaik
