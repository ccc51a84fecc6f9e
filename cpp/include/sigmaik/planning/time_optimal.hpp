#pragma once
/// \file time_optimal.hpp
/// Motions from one configuration to another in the least time, at little effort, within limits, away from
/// configurations of high cost: direct transcription with free end time of a double integrator per joint (Beck et al.
/// 2022, eqs. 21 to 27).
///
/// With N nodes, step h = t_F/N and q̈ constant over a step,
///
///     min  w_t t_F + w_e Σ_k q̈_kᵀ q̈_k + Σ_k L(q_k)      over t_F, q_k, q̇_k, q̈_k
///     q_{k+1} = q_k + h q̇_k + h²/2 q̈_k,   q̇_{k+1} = q̇_k + h q̈_k,   k = 0 … N−2
///     (q_0, q̇_0) and (q_{N−1}, q̇_{N−1}) given,   lower ≤ q_k ≤ upper,   |q̇_k| ≤ velocity,   |q̈_k| ≤ acceleration
///
/// As in the paper, h is t_F/N although the motion takes N − 1 steps: the last step, of length h, is spent at the goal.
/// Velocities that hold their limits at the nodes also hold them between the nodes, but positions do not: where a
/// velocity changes its sign within a step, q overshoots by up to h²/8 times the acceleration. So, beyond the paper,
/// q_k + h q̇_k/2 is kept within the position limits too: the parabola of a step stays in the hull of its ends and this
/// point.
///
/// The solver is a primal-dual interior-point method whose every iterate satisfies the dynamics: in p = h q̇ and a = h²
/// q̈ the dynamics do not depend on h, so that a Newton step is one Riccati recursion with one more column for h.
/// Answers are local minima.

#include <memory>
#include <optional>
#include <vector>

#include <sigmaik/chain.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/planning/collision_check.hpp>
#include <sigmaik/planning/joint_cost.hpp>
#include <sigmaik/planning/trajectory.hpp>
#include <sigmaik/singularities.hpp>

namespace sigmaik::planning {

/// Settings of a TimeOptimal.
struct TimeOptimalOptions {
  int nodes = 30;              ///< N, 5 to 10 000
  double time_weight = 1.0;    ///< [1/s] > 0, w_t
  double effort_weight = 1.0;  ///< [s⁴/rad²] ≥ 0, w_e; > 0 where a joint has no acceleration limit
  double tolerance = 1e-9;     ///< in [1e-12, 1e-2]: what is left to gain, as a part of the objective between the ends
  int max_iterations = 500;    ///< ≥ 1, Newton steps of a start
  bool between_nodes = true;   ///< positions keep their limits between the nodes too; false: as in the paper
  /// Where the motion found still leads through configurations of high cost, the planner also tries the other sides
  /// of these configurations, and keeps the best motion.
  bool restarts = true;
  /// [1/rad²] > 0, η₂ of plan()'s clearance: see clearance()
  double clearance_width = 400.0;
  /// Whether plan() counts whole turns. If not, joints without position limits (JointType::Continuous) take the shorter
  /// way: see nearest_turn().
  bool whole_turns = false;
};

/// Ends of a motion, and where to look for it.
struct TimeOptimalProblem {
  JointVector start;           ///< (n,) [rad or m] within the limits; whole turns count
  JointVector goal;            ///< (n,) [rad or m] within the limits; solve() counts whole turns
  JointVector start_velocity;  ///< (n,) [rad/s or m/s] within the limits; empty: at rest
  JointVector goal_velocity;   ///< (n,) [rad/s or m/s] within the limits; empty: at rest
  /// (n,) [rad or m] by how much the first guess, the straight line, is bent half-way; empty: not at all.
  JointVector bend;
};

/// A motion on nodes t_k = k h, without what lies between them.
struct TimeOptimalResult {
  PlanStatus status = PlanStatus::Failed;  ///< what solve() did
  double duration = 0.0;                   ///< [s] t_F = N h
  double cost = 0.0;                       ///< the objective
  double gap = 0.0;                        ///< estimate of what is left to gain
  int iterations = 0;                      ///< Newton steps, of all starts
  int starts = 0;                          ///< first guesses tried
  std::vector<double> q;                   ///< (N, n) in C order: positions [rad or m]; empty where failed
  std::vector<double> qdot;                ///< (N, n) in C order: velocities [rad/s or m/s]; empty where failed
  std::vector<double> qddot;               ///< (N, n) in C order: accelerations [rad/s² or m/s²], zero at the last node
};

/// Plans for one arm and one cost, and keeps its memory from one plan to the next. One object serves one thread.
class TimeOptimal {
 public:
  /// \param cost L, or null for none
  /// \throws Error where an option is out of its range, the cost is for another number of joints, or nothing bounds a
  ///     joint's acceleration
  TimeOptimal(Chain chain, JointCostPtr cost, const TimeOptimalOptions& options = {});
  /// The same with the arm's singular sets, for plan(); the other constructor takes SingularSets::of(chain).
  /// \param obstacles must not be touched by plan()'s motions; their cost is part of `cost` (collision_cost())
  /// \throws Error also where the sets or the obstacles' spheres are for another number of joints
  TimeOptimal(Chain chain, JointCostPtr cost, const TimeOptimalOptions& options, std::optional<SingularSets> sets,
              std::optional<CollisionCheck> obstacles = std::nullopt);
  ~TimeOptimal();
  /// Takes over the memory of another; the other may only be destroyed or assigned to.
  TimeOptimal(TimeOptimal&&) noexcept;
  /// Takes over the memory of another; the other may only be destroyed or assigned to.
  TimeOptimal& operator=(TimeOptimal&&) noexcept;

  /// The motion's nodes. With `restarts`, a motion whose most expensive node still costs much is solved again from
  /// first guesses that are bent to either side of this node.
  /// \throws Error where an end is outside its limits, not finite or of a wrong size
  TimeOptimalResult solve(const TimeOptimalProblem& problem);

  /// The motion with its clearance from singularities between the nodes. With `restarts`, a motion that crosses a
  /// singular set where it need not is solved once more, from the other side of the first such crossing. The answer is
  /// the motion with the smaller along(), because nodes may lie on both sides of a wall that the motion between the
  /// nodes goes through. A motion that touches an obstacle between its nodes has failed.
  /// \throws Error as solve(), or where start or goal touches an obstacle
  Trajectory plan(const TimeOptimalProblem& asked);

  /// \throws Error where an end is outside its limits, not finite or of a wrong size
  void check(const TimeOptimalProblem& problem) const;

  /// The objective with the cost counted all along the motion, ten times a step, and not at the nodes alone; +inf where
  /// the plan failed.
  double along(const Trajectory& trajectory) const;

  /// The arm.
  const Chain& chain() const noexcept { return chain_; }
  /// L, or null for none.
  const JointCostPtr& cost() const noexcept { return cost_; }
  /// The settings, as given.
  const TimeOptimalOptions& options() const noexcept { return options_; }
  /// The known singular sets of the arm, where there are any.
  const std::optional<SingularSets>& sets() const noexcept { return sets_; }

  /// One start of the method, for one width of vectors.
  class Engine {
   public:
    virtual ~Engine() = default;
    /// A motion from one first guess.
    virtual TimeOptimalResult solve(const TimeOptimalProblem& problem) = 0;
  };

 private:
  JointVector way_out(const TimeOptimalResult& found) const;
  TimeOptimalResult stand(const TimeOptimalProblem& problem) const;
  Trajectory timed_plan(const TimeOptimalProblem& problem);
  Trajectory best_plan(const TimeOptimalProblem& problem);

  Chain chain_;
  JointCostPtr cost_;
  TimeOptimalOptions options_;
  std::optional<SingularSets> sets_;
  std::optional<CollisionCheck> obstacles_;
  std::unique_ptr<Engine> engine_;
};

SIGMAIK_SAME_LAYOUT(TimeOptimal, TimeOptimalOptions, TimeOptimalProblem, TimeOptimalResult);

}  // namespace sigmaik::planning
