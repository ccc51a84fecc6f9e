#pragma once
// The interior-point method behind TimeOptimal, for joints padded to W.
//
// Every iterate satisfies the dynamics, and the limits too where the first guess did: then the merit function is the
// barrier function alone. Where it did not, as it may between moving ends, the miss of each broken constraint shrinks
// with every step, and the merit function pays for it.

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>

#include <sigmaik/planning/time_optimal.hpp>

#include "../aligned.hpp"
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

  void guess(const TimeOptimalProblem& problem);
  double bend_acceleration(int k) const noexcept;
  bool kick(double mu) noexcept;
  double constraint(const Node<W>& node, int family, int i) const noexcept;
  void evaluate() noexcept;
  void convexify() noexcept;
  void assemble(double mu, bool convex) noexcept;
  void slack_changes(int k, const Row<W>& dq, const Row<W>& dp, const Row<W>& da, double dh,
                     Row<W> (&out)[kFamilies]) const noexcept;
  bool find_direction(double mu, bool convex) noexcept;
  double slope(double mu, double penalty) const noexcept;
  void step_lengths(double mu, double& primal, double& dual) noexcept;
  double merit(double alpha, double mu, double penalty) const noexcept;
  bool search_line(double mu, double penalty, double gain, double& alpha) const noexcept;
  void advance(double primal, double dual, double mu) noexcept;
  void count_constraints() noexcept;
  void start_barrier(double mu) noexcept;
  double penalty() const noexcept;
  double motion_cost() const noexcept;
  double objective() const noexcept;
  TimeOptimalResult result(int iterations, double gap, bool optimal) const;

  Node<W>& node(int k) noexcept { return nodes_[static_cast<std::size_t>(k)]; }
  const Node<W>& node(int k) const noexcept { return nodes_[static_cast<std::size_t>(k)]; }
  Stage<W>& stage(int k) noexcept { return stages_[static_cast<std::size_t>(k)]; }

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

template <int W>
double InteriorPoint<W>::constraint(const Node<W>& x, int family, int i) const noexcept {
  switch (family) {
    case kLower: return x.q[i] - lower_[i];
    case kUpper: return upper_[i] - x.q[i];
    case kBackward: return h_ * velocity_[i] + x.p[i];
    case kForward: return h_ * velocity_[i] - x.p[i];
    case kBrake: return h_ * h_ * acceleration_[i] + x.a[i];
    case kPush: return h_ * h_ * acceleration_[i] - x.a[i];
    case kLowerBetween: return x.q[i] + 0.5 * x.p[i] - lower_[i];
    default: return upper_[i] - x.q[i] - 0.5 * x.p[i];
  }
}

// a_k of a motion that leaves for 1 and comes back: of 16 s² (1 − s)² in time, less what would move the end.
template <int W>
double InteriorPoint<W>::bend_acceleration(int k) const noexcept {
  const double m = count_ - 1.0, u = (2.0 * k - (m - 1.0)) / m;  // u in (−1, 1); the mean of u² is (m² − 1)/3m²
  return 48.0 / (m * m) * (u * u - (m * m - 1.0) / (3.0 * m * m));
}

// Off a saddle: a small bend, of which every joint has another share.
template <int W>
bool InteriorPoint<W>::kick(double mu) noexcept {
  dh_ = 0.0;
  Row<W> bend{}, q{}, p{};
  for (int i = 0; i < n_; ++i) bend[i] = kKick * (std::fmod(0.6180339887 * (i + 1), 1.0) - 0.5);
  for (int k = 0; k < count_ - 1; ++k) {
    Node<W>& x = node(k);
    for (int i = 0; i < W; ++i) {
      x.dq[i] = q[i];
      x.dp[i] = p[i];
      x.da[i] = bend[i] * bend_acceleration(k);
      q[i] += p[i] + 0.5 * x.da[i];
      p[i] += x.da[i];
    }
    slack_changes(k, x.dq, x.dp, x.da, 0.0, x.dslack);
  }
  double alpha = 1.0;
  for (int trial = 0; trial < 25; ++trial, alpha *= 0.5) {
    if (!std::isfinite(merit(alpha, mu, 0.0))) continue;
    advance(alpha, 0.0, mu);
    return true;
  }
  return false;
}

// The least-effort motion: accelerations a line in time, a_k = c_0 + c_1 k, bent half-way where that is asked for.
template <int W>
void InteriorPoint<W>::guess(const TimeOptimalProblem& problem) {
  const int controls = count_ - 1;
  const double m = controls;
  double effort = 0.0, h = 1e-6;
  for (int i = 0; i < n_; ++i) {
    start_[i] = problem.start_velocity.size() ? problem.start_velocity[i] : 0.0;
    end_[i] = problem.goal_velocity.size() ? problem.goal_velocity[i] : 0.0;
    const double distance = problem.goal[i] - problem.start[i];
    effort += distance * distance;
    // Peak of the velocity's parabola, and of the acceleration's line.
    if (active_[kForward][i] > 0.0) h = std::max(h, 1.5 * std::abs(distance) / (m * velocity_[i]) * 1.3);
    if (active_[kPush][i] > 0.0) {
      h = std::max(h, std::sqrt(6.0 * std::abs(distance) / (m * m * acceleration_[i])) * 1.3);
      h = std::max(h, std::abs(end_[i] - start_[i]) / (m * acceleration_[i]) * 2.0);
    }
  }
  // Without limits the least of w_t N h + w_e c/h⁴ is where w_t N h = 4 w_e c/h⁴.
  const double s = m * (m * m - 1.0) / 12.0;
  h = std::max(h, std::pow(4.0 * options_.effort_weight * effort / (s * options_.time_weight * count_), 0.2));
  h_ = h;
  for (int i = 0; i < W; ++i) {
    const double q0 = i < n_ ? problem.start[i] : 0.0, q1 = i < n_ ? problem.goal[i] : 0.0;
    const double p0 = h * start_[i], p1 = h * end_[i];
    // Σ a = p1 − p0;  Σ (m − k − ½) a = q1 − q0 − m p0.
    const double s0 = m, s1 = 0.5 * m * (m - 1.0);
    const double t0 = 0.5 * m * m;                                             // Σ (m − k − ½)
    const double t1 = (m - 0.5) * s1 - (m - 1.0) * m * (2.0 * m - 1.0) / 6.0;  // Σ (m − k − ½) k
    const double r0 = p1 - p0, r1 = q1 - q0 - m * p0, det = s0 * t1 - s1 * t0;
    const double c0 = (r0 * t1 - s1 * r1) / det, c1 = (s0 * r1 - t0 * r0) / det;
    const double bend = i < n_ && problem.bend.size() ? problem.bend[i] : 0.0;
    double q = q0, p = p0;
    for (int k = 0; k < count_; ++k) {
      Node<W>& x = node(k);
      x.q[i] = q;
      x.p[i] = p;
      x.a[i] = k < controls ? c0 + c1 * k + bend * bend_acceleration(k) : 0.0;
      q += p + 0.5 * x.a[i];
      p += x.a[i];
    }
    node(count_ - 1).q[i] = q1;
    node(count_ - 1).p[i] = p1;
  }
}

// What time and effort cost.
template <int W>
double InteriorPoint<W>::motion_cost() const noexcept {
  double effort = 0.0;
  for (int k = 0; k < count_ - 1; ++k) effort += dot_rows(node(k).a, node(k).a);
  return options_.time_weight * count_ * h_ + options_.effort_weight * effort / (h_ * h_ * h_ * h_);
}

// The objective, but for what the ends cost, which nothing can change.
template <int W>
double InteriorPoint<W>::objective() const noexcept {
  double cost = motion_cost();
  for (int k = 1; k < count_ - 1; ++k) cost += node(k).cost;
  return cost;
}

template <int W>
void InteriorPoint<W>::evaluate() noexcept {
  for (int k = 1; k < count_ - 1; ++k) {
    Node<W>& x = node(k);
    x.gradient = {};
    x.hessian = {};
    x.cost = 0.0;
    x.is_convex = true;
    if (!cost_) continue;
    std::copy_n(x.q.at, n_, joints_.data());
    x.cost = cost_->model(joints_, joint_gradient_, joint_hessian_);
    for (int j = 0; j < n_; ++j) {
      x.gradient[j] = joint_gradient_[j];
      for (int i = 0; i < n_; ++i) x.hessian.at[j][i] = joint_hessian_(i, j);
    }
    x.is_convex = false;
  }
}

// Positive parts of the Hessians, where they are not known yet.
template <int W>
void InteriorPoint<W>::convexify() noexcept {
  for (int k = 1; k < count_ - 1; ++k) {
    Node<W>& x = node(k);
    if (x.is_convex) {
      x.convex = x.hessian;
      continue;
    }
    for (int j = 0; j < n_; ++j) {
      for (int i = 0; i < n_; ++i) joint_hessian_(i, j) = x.hessian.at[j][i];
    }
    x.convex = x.hessian;
    const double size = joint_hessian_.cwiseAbs().maxCoeff();
    if (size > 1e-9 * options_.time_weight) {
      Eigen::SelfAdjointEigenSolver<sigmaik::detail::Aligned<JointMatrix>> eigen(joint_hessian_);
      if (eigen.eigenvalues()[0] < 0.0) {
        joint_hessian_ = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() *
                         eigen.eigenvectors().transpose();
        for (int j = 0; j < n_; ++j) {
          for (int i = 0; i < n_; ++i) x.convex.at[j][i] = joint_hessian_(i, j);
        }
      }
    }
    x.is_convex = true;
  }
}

// The model of the Lagrangian's barrier problem at the iterate. For each constraint c with slack s, multiplier z and
// miss r = c − s it has z/s ∇c∇cᵀ and −(μ/s − z/s r) ∇c.
template <int W>
void InteriorPoint<W>::assemble(double mu, bool convex) noexcept {
  const double effort = 2.0 * options_.effort_weight / (h_ * h_ * h_ * h_);
  for (int k = 0; k < count_ - 1; ++k) {
    Node<W>& x = node(k);
    Stage<W>& s = stage(k);
    for (int f = 0; f < kFamilies; ++f) {
      const Row<W>& on = active(f, k);
      for (int i = 0; i < W; ++i) {
        const double inverse = 1.0 / x.slack[f][i];
        x.weight[f][i] = x.dual[f][i] * inverse;
        x.force[f][i] = on[i] * (mu * inverse) - x.weight[f][i] * x.miss[f][i];
      }
    }
    s.qq = convex ? x.convex : x.hessian;
    for (int i = 0; i < W; ++i) {
      const double a = 2.0 * h_ * acceleration_[i];
      const double between = x.weight[kLowerBetween][i] + x.weight[kUpperBetween][i];
      const double inward = x.force[kUpperBetween][i] - x.force[kLowerBetween][i];
      s.qq.at[i][i] += x.weight[kLower][i] + x.weight[kUpper][i] + between;
      s.gq[i] = x.gradient[i] + x.force[kUpper][i] - x.force[kLower][i] + inward;
      s.qp[i] = 0.5 * between;
      s.pp[i] = x.weight[kBackward][i] + x.weight[kForward][i] + 0.25 * between;
      s.ph[i] = velocity_[i] * (x.weight[kBackward][i] - x.weight[kForward][i]);
      s.gp[i] = x.force[kForward][i] - x.force[kBackward][i] + 0.5 * inward;
      s.aa[i] = effort + x.weight[kBrake][i] + x.weight[kPush][i];
      s.ah[i] = -4.0 * effort / h_ * x.a[i] + a * (x.weight[kBrake][i] - x.weight[kPush][i]);
      s.ga[i] = effort * x.a[i] + x.force[kPush][i] - x.force[kBrake][i];
    }
    for (int i = n_; i < W; ++i) s.qq.at[i][i] = s.pp[i] = s.aa[i] = 1.0;
  }
}

// Changes of a node's constraints with δq, δp, δa and the step.
template <int W>
void InteriorPoint<W>::slack_changes(int k, const Row<W>& dq, const Row<W>& dp, const Row<W>& da, double dh,
                                     Row<W> (&out)[kFamilies]) const noexcept {
  for (int i = 0; i < W; ++i) {
    const double v = velocity_[i] * dh, a = 2.0 * h_ * acceleration_[i] * dh;
    out[kLower][i] = dq[i];
    out[kUpper][i] = -dq[i];
    out[kBackward][i] = v + dp[i];
    out[kForward][i] = v - dp[i];
    out[kBrake][i] = a + da[i];
    out[kPush][i] = a - da[i];
    out[kLowerBetween][i] = dq[i] + 0.5 * dp[i];
    out[kUpperBetween][i] = -dq[i] - 0.5 * dp[i];
  }
  for (int f = 0; f < kFamilies; ++f) {
    const Row<W>& on = active(f, k);
    for (int i = 0; i < W; ++i) out[f][i] *= on[i];
  }
}

// Solves the model. False where it has no minimum for a given step. Where it has none in the step, one is made up.
template <int W>
bool InteriorPoint<W>::find_direction(double mu, bool convex) noexcept {
  if (!kernels<W>().factorise(stages_, count_)) return false;
  kernels<W>().solve(stages_, count_, start_, end_);
  // ½ dh² curvature + dh along, once all else has done its best for a given dh. Constraint by constraint, as near the
  // solution large numbers cancel.
  const double effort = 2.0 * options_.effort_weight / (h_ * h_ * h_ * h_), h_slack = h_ - kLeastStep;
  double squares = 0.0, along = options_.time_weight * count_ - mu / h_slack, curvature = h_dual_ / h_slack;
  for (int k = 0; k < count_ - 1; ++k) {
    const Node<W>& x = node(k);
    const Stage<W>& s = stage(k);
    Row<W> ds0[kFamilies], ds1[kFamilies], sum_along{}, sum_curvature{};
    slack_changes(k, s.dq[0], s.dp[0], s.da[0], 0.0, ds0);
    slack_changes(k, s.dq[1], s.dp[1], s.da[1], 1.0, ds1);
    for (int f = 0; f < kFamilies; ++f) {
      for (int i = 0; i < W; ++i) {
        sum_along[i] += (x.weight[f][i] * ds0[f][i] - x.force[f][i]) * ds1[f][i];
        sum_curvature[i] += x.weight[f][i] * ds1[f][i] * ds1[f][i];
      }
    }
    const double bow = -4.0 * effort / h_;
    for (int i = 0; i < W; ++i) {
      sum_along[i] += x.gradient[i] * s.dq[1][i] + effort * (x.a[i] + s.da[0][i]) * s.da[1][i] +
                      bow * x.a[i] * s.da[0][i];
      sum_curvature[i] += effort * s.da[1][i] * s.da[1][i] + 2.0 * bow * x.a[i] * s.da[1][i] -
                          2.0 * acceleration_[i] * (x.dual[kBrake][i] + x.dual[kPush][i]);
    }
    squares += dot_rows(x.a, x.a);
    for (int i = 0; i < W; ++i) {
      along += sum_along[i];
      curvature += sum_curvature[i];
    }
    if (k == 0 || !cost_) continue;
    const Square<W>& hessian = convex ? x.convex : x.hessian;
    for (int j = 0; j < W; ++j) {
      double row = 0.0;
      for (int i = 0; i < W; ++i) row += hessian.at[j][i] * s.dq[1][i];
      along += row * s.dq[0][j];
      curvature += row * s.dq[1][j];
    }
  }
  along -= 2.0 * effort * squares / h_;
  const double effort_curvature = 10.0 * effort * squares / (h_ * h_);
  curvature += effort_curvature;
  bent_ = !(curvature > 0.0);
  if (bent_) curvature = std::max(-curvature, kBentCurvature * effort_curvature + h_dual_ / h_slack);
  dh_ = -along / curvature;
  for (int k = 0; k < count_ - 1; ++k) {
    const Stage<W>& s = stage(k);
    Node<W>& x = node(k);
    for (int i = 0; i < W; ++i) {
      x.dq[i] = s.dq[0][i] + dh_ * s.dq[1][i];
      x.dp[i] = s.dp[0][i] + dh_ * s.dp[1][i];
      x.da[i] = s.da[0][i] + dh_ * s.da[1][i];
    }
    slack_changes(k, x.dq, x.dp, x.da, dh_, x.dslack);
    if (feasible_) continue;
    for (int f = 0; f < kFamilies; ++f) {
      for (int i = 0; i < W; ++i) x.dslack[f][i] += x.miss[f][i];
    }
  }
  return std::isfinite(dh_);
}

// Derivative of the merit function along the direction.
template <int W>
double InteriorPoint<W>::slope(double mu, double penalty) const noexcept {
  const double h4 = 1.0 / (h_ * h_ * h_ * h_), we = options_.effort_weight;
  double sum = 0.0, effort = 0.0, missed = 0.0;
  for (int k = 0; k < count_ - 1; ++k) {
    const Node<W>& x = node(k);
    effort += dot_rows(x.a, x.a);
    sum += 2.0 * we * h4 * dot_rows(x.a, x.da);
    if (k >= 1) sum += dot_rows(x.gradient, x.dq);
    for (int f = 0; f < kFamilies; ++f) {
      double part = 0.0;
      for (int i = 0; i < W; ++i) part += x.dslack[f][i] / x.slack[f][i];
      sum -= mu * part;
      if (!feasible_) {
        for (int i = 0; i < W; ++i) missed += std::abs(x.miss[f][i]);
      }
    }
  }
  sum += dh_ * (options_.time_weight * count_ - 4.0 * we * effort * h4 / h_ - mu / (h_ - kLeastStep));
  return sum - penalty * missed;
}

template <int W>
void InteriorPoint<W>::step_lengths(double mu, double& primal, double& dual) noexcept {
  double most_p = std::max(-dh_ / (h_ - kLeastStep), 0.0);  // the largest of −ds/s
  const double ddual_h = mu / (h_ - kLeastStep) - h_dual_ - h_dual_ / (h_ - kLeastStep) * dh_;
  double most_d = std::max(-ddual_h / h_dual_, 0.0);
  for (int k = 0; k < count_ - 1; ++k) {
    Node<W>& x = node(k);
    for (int f = 0; f < kFamilies; ++f) {
      const Row<W>& on = active(f, k);
      Row<W> p, d;
      for (int i = 0; i < W; ++i) {
        const double inverse = 1.0 / x.slack[f][i];
        const double ratio = x.dslack[f][i] * inverse;
        x.ddual[f][i] = on[i] * (mu * inverse) - x.dual[f][i] - x.dual[f][i] * ratio;
        p[i] = -ratio;
        d[i] = -x.ddual[f][i] / (x.dual[f][i] + 1e-300);
      }
      for (int i = 0; i < W; ++i) {
        most_p = std::max(most_p, p[i]);
        most_d = std::max(most_d, d[i]);
      }
    }
  }
  primal = most_p > kToBoundary ? kToBoundary / most_p : 1.0;
  dual = most_d > kToBoundary ? kToBoundary / most_d : 1.0;
}

// The merit function a step along the direction; infinite where a constraint is lost.
template <int W>
double InteriorPoint<W>::merit(double alpha, double mu, double penalty) const noexcept {
  const double h = h_ + alpha * dh_;
  double effort = 0.0, cost = 0.0, logs = 0.0, missed = 0.0;
  if (!(h > kLeastStep)) return std::numeric_limits<double>::infinity();
  Row<W> product;
  for (int i = 0; i < W; ++i) product[i] = 1.0;
  double least = 1.0;
  for (int k = 0; k < count_ - 1; ++k) {
    const Node<W>& x = node(k);
    Row<W> q, p, a;
    for (int i = 0; i < W; ++i) {
      q[i] = x.q[i] + alpha * x.dq[i];
      p[i] = x.p[i] + alpha * x.dp[i];
      a[i] = x.a[i] + alpha * x.da[i];
    }
    effort += dot_rows(a, a);
    for (int f = 0; f < kFamilies; ++f) {
      const Row<W>& on = active(f, k);
      const bool curved = f == kBrake || f == kPush;
      for (int i = 0; i < W; ++i) {
        double slack = x.slack[f][i] + alpha * x.dslack[f][i];
        if (curved && x.miss[f][i] == 0.0) slack += acceleration_[i] * alpha * alpha * dh_ * dh_;
        slack = on[i] > 0.0 ? slack : 1.0;
        least = std::min(least, slack - (1.0 - kToBoundary) * x.slack[f][i]);
        product[i] *= slack;
        missed += (1.0 - alpha) * std::abs(x.miss[f][i]);
      }
    }
    if (!(least >= 0.0)) return std::numeric_limits<double>::infinity();
    for (int i = 0; i < W; ++i) {  // one logarithm for a node's constraints of a joint
      logs += std::log(product[i]);
      product[i] = 1.0;
    }
    if (k >= 1 && cost_) {
      std::copy_n(q.at, n_, joints_.data());
      cost += cost_->value(joints_);
    }
  }
  return options_.time_weight * count_ * h + options_.effort_weight * effort / (h * h * h * h) + cost -
         mu * (logs + std::log(h - kLeastStep)) + penalty * missed;
}

// Shortens the step until the merit function is content with it. False where that is never.
template <int W>
bool InteriorPoint<W>::search_line(double mu, double penalty, double gain, double& alpha) const noexcept {
  const double now = merit(0.0, mu, penalty), noise = 1e-12 * std::abs(now);
  for (int trial = 0; trial < 25; ++trial, alpha *= 0.5) {
    if (merit(alpha, mu, penalty) <= now - 1e-4 * alpha * gain + noise) return true;
  }
  return false;
}

template <int W>
void InteriorPoint<W>::advance(double primal, double dual, double mu) noexcept {
  const double ddual_h = mu / (h_ - kLeastStep) - h_dual_ - h_dual_ / (h_ - kLeastStep) * dh_;
  h_ += primal * dh_;
  h_dual_ += dual * ddual_h;
  bool feasible = true;
  for (int k = 0; k < count_ - 1; ++k) {
    Node<W>& x = node(k);
    for (int i = 0; i < W; ++i) {
      x.q[i] += primal * x.dq[i];
      x.p[i] += primal * x.dp[i];
      x.a[i] += primal * x.da[i];
    }
    for (int f = 0; f < kFamilies; ++f) {
      const Row<W>& on = active(f, k);
      for (int i = 0; i < W; ++i) {
        if (!(on[i] > 0.0)) continue;
        const double value = constraint(x, f, i);
        double& slack = x.slack[f][i];
        slack += primal * x.dslack[f][i];
        if (x.miss[f][i] == 0.0 || value >= slack) slack = value;
        x.miss[f][i] = value - slack;
        feasible = feasible && x.miss[f][i] == 0.0;
        double& z = x.dual[f][i];
        z += dual * x.ddual[f][i];
        z = std::clamp(z, mu / slack * 1e-8, mu / slack * 1e8);
      }
    }
  }
  feasible_ = feasible;
}

template <int W>
TimeOptimalResult InteriorPoint<W>::result(int iterations, double gap, bool optimal) const {
  TimeOptimalResult out;
  out.iterations = iterations;
  out.starts = 1;
  out.gap = gap;
  if (!feasible_) return out;
  out.status = optimal ? PlanStatus::Optimal : PlanStatus::Feasible;
  out.duration = count_ * h_;
  out.cost = objective() + end_cost_;
  const std::size_t size = static_cast<std::size_t>(count_ * n_);
  out.q.reserve(size);
  out.qdot.reserve(size);
  out.qddot.reserve(size);
  for (int k = 0; k < count_; ++k) {
    const Node<W>& x = node(k);
    for (int i = 0; i < n_; ++i) {
      out.q.push_back(x.q[i]);
      out.qdot.push_back(k == 0 ? start_[i] : k == count_ - 1 ? end_[i] : x.p[i] / h_);
      out.qddot.push_back(x.a[i] / (h_ * h_));
    }
  }
  return out;
}

// Which ends leave and arrive so that the step's point between could be outside, and how many constraints there are.
template <int W>
void InteriorPoint<W>::count_constraints() noexcept {
  for (int i = 0; i < W; ++i) {
    leaves_[0][i] = start_[i] < 0.0 ? active_[kLowerBetween][i] : 0.0;
    leaves_[1][i] = start_[i] > 0.0 ? active_[kUpperBetween][i] : 0.0;
    arrives_[0][i] = end_[i] > 0.0 ? active_[kLowerBetween][i] : 0.0;
    arrives_[1][i] = end_[i] < 0.0 ? active_[kUpperBetween][i] : 0.0;
  }
  constraints_ = 1.0;  // h > 0
  for (int k = 0; k < count_ - 1; ++k) {
    for (int f = 0; f < kFamilies; ++f) {
      for (int i = 0; i < W; ++i) constraints_ += active(f, k)[i];
    }
  }
}

// Slacks and multipliers of the first guess, on the central path of `mu` where the guess keeps the limits.
template <int W>
void InteriorPoint<W>::start_barrier(double mu) noexcept {
  feasible_ = true;
  for (int k = 0; k < count_ - 1; ++k) {
    Node<W>& x = node(k);
    for (int f = 0; f < kFamilies; ++f) {
      for (int i = 0; i < W; ++i) {
        x.slack[f][i] = 1.0;
        x.dual[f][i] = x.miss[f][i] = x.dslack[f][i] = x.ddual[f][i] = 0.0;
        if (!(active(f, k)[i] > 0.0)) continue;
        const double scale = f == kBackward || f == kForward ? h_ * velocity_[i]
                             : f == kBrake || f == kPush     ? h_ * h_ * acceleration_[i]
                                                             : 1.0;
        const double value = constraint(x, f, i);
        x.slack[f][i] = std::max(value, kLeastSlack * scale);
        x.miss[f][i] = value - x.slack[f][i];
        feasible_ = feasible_ && x.miss[f][i] == 0.0;
        x.dual[f][i] = mu / x.slack[f][i];
      }
    }
  }
  h_dual_ = mu / (h_ - kLeastStep);
}

// More than any multiplier: what a miss has to cost so that it does not pay.
template <int W>
double InteriorPoint<W>::penalty() const noexcept {
  double largest = 0.0;
  for (const Node<W>& x : nodes_) {
    for (const Row<W>& dual : x.dual) {
      for (int i = 0; i < W; ++i) largest = std::max(largest, dual[i]);
    }
  }
  return 2.0 * largest;
}

template <int W>
TimeOptimalResult InteriorPoint<W>::solve(const TimeOptimalProblem& problem) {
  guess(problem);
  end_cost_ = cost_ ? cost_->value(problem.start) + cost_->value(problem.goal) : 0.0;
  evaluate();
  count_constraints();
  double mu = motion_cost() / constraints_;
  start_barrier(mu);

  double gap = std::numeric_limits<double>::infinity(), penalty = 0.0;
  int kicks = 0;
  for (int iteration = 0; iteration < options_.max_iterations; ++iteration) {
    if (iteration > 0) evaluate();
    // A direction of descent: by the Hessian as it is, or by its positive part.
    assemble(mu, false);
    bool exact = find_direction(mu, false);
    if (!exact) {
      convexify();
      assemble(mu, true);
      if (!find_direction(mu, true)) return result(iteration, gap, false);
    }
    exact = exact && !bent_;
    if (!feasible_) penalty = std::max(penalty, this->penalty());
    const double gain = std::max(-slope(mu, penalty), 0.0);
    gap = gain + mu * constraints_;
    const double goal = options_.tolerance * std::max(objective(), kLeastTime * options_.time_weight);

    double primal, dual;
    step_lengths(mu, primal, dual);
    const bool stepped = search_line(mu, penalty, gain, primal);
    if (stepped) advance(primal, dual, mu);
    if (feasible_ && gap <= goal) {
      if (!exact && kicks++ < kKicks && kick(mu)) continue;
      if (stepped) evaluate();
      return result(iteration + 1, gap, exact);  // the step just taken squares what was left
    }
    // Nothing gained: rounding hides what is left, or the merit function leads nowhere.
    if (!stepped) return result(iteration + 1, gap, exact && gap <= kRounding * goal);
    // On to a smaller barrier: fast once Newton's method has this one, else carefully.
    const double least = 0.1 * goal / constraints_;
    if (exact && gain <= 2.0 * mu) {
      mu = std::max(0.1 * mu, least);
    } else if (primal > 0.9 && gain < 0.3 * mu * constraints_) {
      mu = std::max(0.3 * mu, least);
    }
  }
  evaluate();
  return result(options_.max_iterations, gap, false);
}

}  // namespace sigmaik::planning::detail
