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
  Twist error = Twist::Zero();          ///< [m, rad] tip minus target, after the step
  Twist path_error = Twist::Zero();     ///< the same, of the target slowed down by ϑ; equal where ϑ = 0
  double time_scale = 0.0;              ///< ϑ in [0, 1]: 0 as asked, 1 a complete stop; shows how hard the step is
  std::uint16_t active = 0;             ///< bit i: a limit of joint i is active
  bool torque_active = false;           ///< a torque limit is active, or cannot be met
  bool error_active = false;            ///< max_error is active, or has been given up
  bool exact_met = true;                ///< the exact part's linearised equations hold
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

  /// One cycle towards a pose of the tip in base. Real time. If the target is not a pose, the status is BadInput and
  /// the arm stops.
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

 private:
  struct Linearisation;

  bool try_analytic(const Pose& target, ConstrainedIkStep& step) noexcept;
  void optimise(const Pose& target, const Twist& motion, ConstrainedIkStep& step) noexcept;
  void prepare() noexcept;
  void prepare_torques() noexcept;
  void set_approximate_rows(const Linearisation& at, const Twist& motion) noexcept;
  void set_exact_rows(const Linearisation& at) noexcept;
  void report(const LeastSquaresSolution& solution, bool error_lost, ConstrainedIkStep& step) const noexcept;

  Chain chain_;
  ConstrainedIkOptions options_;
  Task approximate_, exact_;
  std::optional<AnalyticIk> analytic_;
  std::optional<Dynamics> dynamics_;
  LimitTracker tracker_;
  LeastSquares least_squares_;
  LeastSquaresProblem problem_;
  DynamicsTerms terms_;
  int torque_rows_ = 0, error_rows_ = 0;
  ChainState state_;
  Pose reference_ = Pose::Identity();
  bool last_free_ = true;  // the last step was closed form, or met no limit and agreed with it
};

SIGMAIK_SAME_LAYOUT(ConstrainedIk, ConstrainedIkOptions, ConstrainedIkStep);

}  // namespace sigmaik
