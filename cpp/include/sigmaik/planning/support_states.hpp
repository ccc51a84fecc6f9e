#pragma once
/// \file support_states.hpp
/// Motions as support states under a Gaussian-process prior, moved so that a cost of the states falls (Petrović et
/// al.): by the cost's gradient, or by samples.
///
/// A motion has N + 1 states, evenly in unit time; the first and the last are fixed. The prior of every joint is white
/// noise on acceleration (a constant velocity model, eqs. 7 to 9), conditioned on both end positions, about the
/// straight line μ. The prior's covariance, scaled to a largest variance of 1, is K̄ ∝ k(s, u) = s(1 − u)(2u − s² −
/// u²)/6 for s ≤ u. Between the states the prior's mean is the natural cubic spline through them.

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <sigmaik/chain.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/planning/batch_cost.hpp>
#include <sigmaik/planning/collision_check.hpp>
#include <sigmaik/planning/trajectory.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik::planning {

/// A motion: (states, n) in C order, ends included.
struct SupportStates {
  std::vector<double> q;   ///< (states, n) [rad or m]
  double cost = 0.0;       ///< of the states between the ends
  double distance = 0.0;   ///< ‖q − μ‖² in K̄⁻¹
  int iterations = 0;      ///< iterations taken
  bool converged = false;  ///< stopped by its own rule, not by the number of iterations
};

/// Settings of SupportPlanner::gradient().
struct GradientOptions {
  int states = 21;             ///< N + 1, 3 to 1000
  double prior_weight = 10.0;  ///< > 0: weight of ‖q − μ‖² in K̄⁻¹ against the cost
  int max_iterations = 100;    ///< ≥ 1
  double tolerance = 1e-4;     ///< ≥ 0: stops where an iteration gains less than this part of the objective
  /// ≥ 0: plan() tries this many first guesses drawn from the prior where the motion found from the straight line
  /// touches an obstacle
  int restarts = 8;
  /// [s] > 0 of plan()'s motion; none: the shortest that keeps the limits of velocity and acceleration, 1 s where there
  /// are none
  std::optional<double> duration = std::nullopt;
  bool whole_turns = false;  ///< of plan(), as in TimeOptimalOptions
};

/// Settings of SupportPlanner::stochastic().
struct StochasticOptions {
  int states = 21;             ///< N + 1, 3 to 1000
  int samples = 10;            ///< ≥ 2, of an iteration
  int max_iterations = 30;     ///< ≥ 1
  double deviation = 0.5;      ///< [rad or m] > 0, of the samples half-way
  double decay = 0.98;         ///< in (0, 1]: of the deviation, from one iteration to the next
  double temperature = 0.1;    ///< > 0: λ of the weights exp(−(G − G_min)/(λ (G_max − G_min))) (15), normalised
  double prior_weight = 10.0;  ///< ≥ 0: as for the gradient; keeps joints without influence on the cost from drifting
  double tolerance = 1e-3;     ///< ≥ 0: stops where eight iterations together gain less than this part of the objective
  std::uint64_t seed = 0;      ///< the same seed gives the same motion
  bool refine = false;         ///< plan() finishes with gradient() from the motion found
  std::optional<double> duration = std::nullopt;  ///< [s] as for the gradient
  bool whole_turns = false;                       ///< of plan(), as in TimeOptimalOptions
};

/// Plans for one arm and one cost, and keeps the covariance's factors. One object serves one thread.
class SupportPlanner {
 public:
  /// \param obstacles must not be touched by plan()'s motions; their cost is part of `cost` (collision_cost())
  /// \throws Error where the number of states is out of its range, or where the cost or the obstacles' spheres have
  ///     another number of joints
  SupportPlanner(Chain chain, BatchCostPtr cost, int states, std::optional<CollisionCheck> obstacles = std::nullopt);
  ~SupportPlanner();
  /// Takes over the memory of another; the other may only be destroyed or assigned to.
  SupportPlanner(SupportPlanner&&) noexcept;
  /// Takes over the memory of another; the other may only be destroyed or assigned to.
  SupportPlanner& operator=(SupportPlanner&&) noexcept;

  /// Minimises Σ cost(q_i) + w ‖q − μ‖² in K̄⁻¹ by L-BFGS in x, q = μ + C x, K̄ = C Cᵀ, from `guess` (states, n), or from
  /// the straight line where `guess` is empty. States are kept within the limits by projection.
  /// \throws Error where an option is out of its range, or an end outside the limits; what the cost throws
  SupportStates gradient(const JointVector& start, const JointVector& goal, const GradientOptions& options,
                         const std::vector<double>& guess = {});

  /// Moves the states by the mean of samples about them, weighted by their cost (14) to (16), and returns the best
  /// states of all iterations. The same seed gives the same answer.
  /// \throws Error as gradient()
  SupportStates stochastic(const JointVector& start, const JointVector& goal, const StochasticOptions& options);

  /// A motion drawn from the prior about the straight line, of standard deviation `deviation` [rad or m] ≥ 0 half-way,
  /// its states projected on the limits: a first guess. The same seed gives the same motion.
  /// \throws Error as gradient()
  SupportStates draw(const JointVector& start, const JointVector& goal, double deviation, std::uint64_t seed);

  /// The motion of gradient() from the straight line: the natural spline through its states, timed, within the position
  /// limits between the states too, with its clearance from singularities. If this motion touches an obstacle, first
  /// guesses are drawn from the prior, the same guesses each time, and the answer is the motion of least cost that
  /// touches no obstacle. The status is Failed if every motion touches an obstacle, Optimal if the search stopped by
  /// itself, else Feasible. The cost is the objective.
  /// \throws Error as gradient(), or where start or goal touches an obstacle
  Trajectory plan(const JointVector& start, const JointVector& asked, const GradientOptions& options);

  /// The same for stochastic(). The status is Feasible unless the motion was refined: no minimum is claimed. Where the
  /// refined motion touches an obstacle between its states, the answer is the motion before.
  /// \throws Error as stochastic(), or where start or goal touches an obstacle
  Trajectory plan(const JointVector& start, const JointVector& asked, const StochasticOptions& options);

  /// Number of support states.
  int states() const noexcept;
  /// The arm.
  const Chain& chain() const noexcept;

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

/// Velocities (states, n) of the natural cubic spline through (states, n), in unit time.
std::vector<double> spline_velocities(const std::vector<double>& q, int states, int dof);

SIGMAIK_SAME_LAYOUT(SupportPlanner, SupportStates, GradientOptions, StochasticOptions);

}  // namespace sigmaik::planning
