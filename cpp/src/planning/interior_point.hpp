#pragma once
// The interior-point method behind TimeOptimal, for joints padded to W.
//
// Every iterate satisfies the dynamics, and the limits too where the first guess did: then the merit function is the
// barrier function alone. Where it did not, as it may between moving ends, the miss of each broken constraint shrinks
// with every step, and the merit function pays for it.
//
// This is the class and its data. What its functions do stands beside it, in interior_point_*.hpp, by topic; who makes
// an InteriorPoint includes them all.

#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <vector>

#include <sigmaik/planning/time_optimal.hpp>

#include "stages.hpp"

namespace sigmaik::planning::detail {

// Constraints come in eight families, one number a joint and node each:
// q − lower, upper − q, hV + p, hV − p, h²A + a, h²A − a ≥ 0; and, where the positions between the nodes are to keep
// their limits too, q + p/2 − lower, upper − q − p/2 ≥ 0: a step's parabola stays in the hull of its ends and that
// point.
enum Family { kLower, kUpper, kBackward, kForward, kBrake, kPush, kLowerBetween, kUpperBetween, kFamilies };

// What a node holds besides its stage's model.
template <int W>
struct Node {
  Row<W> q, p, a;            // the iterate
  Row<W> slack[kFamilies];   // > 0
  Row<W> miss[kFamilies];    // constraint − slack: not 0 only where the guess broke the constraint
  Row<W> dual[kFamilies];    // > 0
  Row<W> weight[kFamilies];  // dual/slack
  Row<W> force[kFamilies];   // what the barrier pushes with
  Row<W> dslack[kFamilies], ddual[kFamilies];
  Row<W> dq, dp, da;
  double cost = 0.0;
  Row<W> gradient;    // of the cost
  Square<W> hessian;  // of the cost
  Square<W> convex;   // its positive part
  bool is_convex = true;
};

// Recursion<lanes, W> for the widest vectors that the processor has.
template <int W>
struct Kernels {
  bool (*factorise)(std::vector<Stage<W>>& stages, int nodes);
  void (*solve)(std::vector<Stage<W>>& stages, int nodes, const Row<W>& start, const Row<W>& end);
};
template <int W>
const Kernels<W>& kernels() noexcept;

template <int W>
class InteriorPoint final : public TimeOptimal::Engine {
 public:
  InteriorPoint(const Chain& chain, const JointCostPtr& cost, const TimeOptimalOptions& options);
  TimeOptimalResult solve(const TimeOptimalProblem& problem) override;

 private:
  static constexpr double kLeastStep = 1e-9;     // [s]
  static constexpr double kLeastTime = 1e-3;     // [s] times shorter than this need not be more accurate
  static constexpr double kLeastSlack = 1e-4;    // of a constraint that the first guess breaks, as a part of its limit
  static constexpr double kToBoundary = 0.995;   // the part of a slack or multiplier that a step may use up
  static constexpr double kBentCurvature = 0.1;  // least curvature in the step, as a part of the effort's
  static constexpr double kRounding = 100.0;     // how far above the tolerance rounding may end the search
  static constexpr double kKick = 0.02;          // [rad or m]
  static constexpr int kKicks = 3;

  // 1 for each joint with a constraint of that family at node k, else 0. Ends cannot move, and the last acceleration is
  // none. The points between of the first and last step are q_0 + h q̇_0/2 and q_{N−1} − h q̇_{N−1}/2.
  const Row<W>& active(int family, int k) const noexcept {
    if (k == 0 && family < kBrake) return none_;
    if (family >= kLowerBetween && k == 0) return leaves_[family - kLowerBetween];
    if (family >= kLowerBetween && k == count_ - 2) return arrives_[family - kLowerBetween];
    return active_[family];
  }

  // ½ dh² curvature + dh along: the model in the step's change dh, once all else has done its best for it.
  struct StepModel {
    double along, curvature;
    double effort_curvature;  // the effort's own share
  };

  void guess(const TimeOptimalProblem& problem);
  double bend_acceleration(int k) const noexcept;
  bool kick(double mu) noexcept;
  double constraint(const Node<W>& node, int family, int i) const noexcept;
  void evaluate() noexcept;
  void convexify() noexcept;
  void assemble(double mu, bool convex) noexcept;
  void slack_changes(int k, const Row<W>& dq, const Row<W>& dp, const Row<W>& da, double dh,
                     Row<W> (&out)[kFamilies]) const noexcept;
  void add_motion(int k, double effort, StepModel& model) const noexcept;
  void add_cost(int k, bool convex, StepModel& model) const noexcept;
  StepModel model_of_step(double mu, bool convex) const noexcept;
  void combine_solutions() noexcept;
  bool find_direction(double mu, bool convex) noexcept;
  bool find_descent(double mu, bool& exact) noexcept;
  double slope(double mu, double penalty) const noexcept;
  void step_lengths(double mu, double& primal, double& dual) noexcept;
  double merit(double alpha, double mu, double penalty) const noexcept;
  bool search_line(double mu, double penalty, double gain, double& alpha) const noexcept;
  void advance(double primal, double dual, double mu) noexcept;
  void count_constraints() noexcept;
  void start_barrier(double mu) noexcept;
  double shrink_barrier(double mu, double least, bool exact, double gain, double primal) const noexcept;
  double penalty() const noexcept;
  double motion_cost() const noexcept;
  double objective() const noexcept;
  TimeOptimalResult result(int iterations, double gap, bool optimal) const;

  Node<W>& node(int k) noexcept { return nodes_[static_cast<std::size_t>(k)]; }
  const Node<W>& node(int k) const noexcept { return nodes_[static_cast<std::size_t>(k)]; }
  Stage<W>& stage(int k) noexcept { return stages_[static_cast<std::size_t>(k)]; }
  const Stage<W>& stage(int k) const noexcept { return stages_[static_cast<std::size_t>(k)]; }

  int n_, count_;
  JointCostPtr cost_;
  TimeOptimalOptions options_;
  Row<W> lower_{}, upper_{}, velocity_{}, acceleration_{};
  Row<W> active_[kFamilies]{};  // 1 where there is a limit, else 0
  Row<W> none_{}, leaves_[2]{}, arrives_[2]{};
  Row<W> start_{}, end_{};  // velocities at the ends
  std::vector<Stage<W>> stages_;
  std::vector<Node<W>> nodes_;
  double end_cost_ = 0.0;  // of the two nodes that cannot move
  double h_ = 1.0, dh_ = 0.0, h_dual_ = 0.0;
  double constraints_ = 1.0;  // how many
  bool feasible_ = true;
  bool bent_ = false;  // the model had no minimum in the step: one was made up
  mutable JointVector joints_, joint_gradient_;
  JointMatrix joint_hessian_;
};

template <int W>
InteriorPoint<W>::InteriorPoint(const Chain& chain, const JointCostPtr& cost, const TimeOptimalOptions& options)
    : n_(chain.dof()), count_(options.nodes), cost_(cost), options_(options) {
  stages_.resize(static_cast<std::size_t>(count_));
  nodes_.resize(static_cast<std::size_t>(count_));
  const JointLimits& limits = chain.limits();
  for (int i = 0; i < W; ++i) {
    const bool joint = i < n_;
    const auto take = [&](Row<W>& row, double value, double padding, std::initializer_list<int> families) {
      const bool finite = joint && std::isfinite(value);
      row[i] = finite ? value : padding;
      for (const int f : families) active_[f][i] = finite ? 1.0 : 0.0;
    };
    take(lower_, joint ? limits.lower[i] : 0.0, 0.0, {kLower, kLowerBetween});
    take(upper_, joint ? limits.upper[i] : 0.0, 0.0, {kUpper, kUpperBetween});
    take(velocity_, joint ? limits.velocity[i] : 0.0, 0.0, {kBackward, kForward});
    take(acceleration_, joint ? limits.acceleration[i] : 0.0, 0.0, {kBrake, kPush});
  }
  if (!options.between_nodes) active_[kLowerBetween] = active_[kUpperBetween] = none_;
  joints_.resize(n_);
  joint_gradient_.resize(n_);
  joint_hessian_.resize(n_, n_);
}

}  // namespace sigmaik::planning::detail
