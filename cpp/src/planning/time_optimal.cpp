#include <sigmaik/planning/time_optimal.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

#include "../message.hpp"
#include "../symmetric_eigen.hpp"
#include "interior_point.hpp"
#include "interior_point_guess.hpp"
#include "interior_point_limits.hpp"
#include "interior_point_loop.hpp"
#include "interior_point_merit.hpp"
#include "interior_point_step.hpp"
#include "other_side.hpp"
#include "samples.hpp"

namespace sigmaik::planning {
namespace detail {
namespace {

template <int W>
bool factorise_baseline(std::vector<Stage<W>>& stages, int nodes) {
  return Recursion<2, W>::factorise(stages, nodes);
}
template <int W>
void solve_baseline(std::vector<Stage<W>>& stages, int nodes, const Row<W>& start, const Row<W>& end) {
  Recursion<2, W>::solve(stages, nodes, start, end);
}

#if defined(__x86_64__) && !defined(SIGMAIK_NO_DISPATCH)
template <int W>
__attribute__((target("avx2,fma"))) bool factorise_avx2(std::vector<Stage<W>>& stages, int nodes) {
  return Recursion<4, W>::factorise(stages, nodes);
}
template <int W>
__attribute__((target("avx2,fma"))) void solve_avx2(std::vector<Stage<W>>& stages, int nodes, const Row<W>& start,
                                                    const Row<W>& end) {
  Recursion<4, W>::solve(stages, nodes, start, end);
}
#endif

}  // namespace

template <int W>
const Kernels<W>& kernels() noexcept {
#if defined(__x86_64__) && !defined(SIGMAIK_NO_DISPATCH)
  static const Kernels<W> chosen = [] {
    __builtin_cpu_init();
    const bool wide = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    return wide ? Kernels<W>{factorise_avx2<W>, solve_avx2<W>} : Kernels<W>{factorise_baseline<W>, solve_baseline<W>};
  }();
  return chosen;
#else
  static const Kernels<W> only{factorise_baseline<W>, solve_baseline<W>};
  return only;
#endif
}

}  // namespace detail

namespace {

using detail::kDense;
using sigmaik::detail::require;

constexpr double kWorthALook = 1e-3;    // a node's cost, as a part of the time's cost, that warrants other starts
constexpr double kStandingStep = 1e-6;  // [s] of a motion that goes nowhere

std::unique_ptr<TimeOptimal::Engine> make_engine(const Chain& chain, const JointCostPtr& cost,
                                                 const TimeOptimalOptions& options) {
  if (chain.dof() <= 8) return std::make_unique<detail::InteriorPoint<8>>(chain, cost, options);
  return std::make_unique<detail::InteriorPoint<kMaxJoints>>(chain, cost, options);
}

}  // namespace

TimeOptimal::TimeOptimal(Chain chain, JointCostPtr cost, const TimeOptimalOptions& options)
    : TimeOptimal(chain, std::move(cost), options, SingularSets::of(chain)) {}

TimeOptimal::TimeOptimal(Chain chain, JointCostPtr cost, const TimeOptimalOptions& options,
                         std::optional<SingularSets> sets, std::optional<CollisionCheck> obstacles)
    : chain_(detail::with_even_acceleration(chain)),
      cost_(std::move(cost)),
      options_(options),
      sets_(std::move(sets)),
      obstacles_(std::move(obstacles)) {
  const auto number = [](const char* name, double value, double least, bool open) {
    require(std::isfinite(value) && (open ? value > least : value >= least), name, " = ", value, " must be finite and ",
            open ? "greater than " : "at least ", least);
  };
  require(options.nodes >= 5 && options.nodes <= 10000, "nodes = ", options.nodes, " must be in [5, 10000]");
  number("time_weight", options.time_weight, 0.0, true);
  number("effort_weight", options.effort_weight, 0.0, false);
  require(options.tolerance >= 1e-12 && options.tolerance <= 1e-2, "tolerance = ", options.tolerance,
          " must be in [1e-12, 1e-2]");
  require(options.max_iterations >= 1, "max_iterations = ", options.max_iterations, " must be at least 1");
  require(!cost_ || cost_->dof() == chain_.dof(), "the cost is for ", cost_ ? cost_->dof() : 0,
          " joints, the chain has ", chain_.dof());
  for (int i = 0; i < chain_.dof(); ++i) {
    require(options.effort_weight > 0.0 || std::isfinite(chain_.limits().acceleration[i]), "joint '",
            chain_.joint_names()[static_cast<std::size_t>(i)],
            "' has no acceleration limit: without effort to pay nothing bounds it");
  }
  require(!sets_ || sets_->dof() == chain_.dof(), "the singular sets are for ", sets_ ? sets_->dof() : 0,
          " joints, the chain has ", chain_.dof());
  require(!obstacles_ || obstacles_->spheres().chain().dof() == chain_.dof(), "the spheres are of an arm of ",
          obstacles_ ? obstacles_->spheres().chain().dof() : 0, " joints, the chain has ", chain_.dof());
  engine_ = make_engine(chain_, cost_, options_);
}
TimeOptimal::~TimeOptimal() = default;
TimeOptimal::TimeOptimal(TimeOptimal&&) noexcept = default;
TimeOptimal& TimeOptimal::operator=(TimeOptimal&&) noexcept = default;

void TimeOptimal::check(const TimeOptimalProblem& problem) const {
  const int n = chain_.dof();
  const JointLimits& limits = chain_.limits();
  const auto vector = [n](const char* name, const JointVector& x, bool optional) {
    if (optional && x.size() == 0) return;
    require(x.size() == n, name, " has ", x.size(), " entries, the chain has ", n, " joints");
    require(x.allFinite(), name, " has an entry that is not finite");
  };
  vector("start", problem.start, false);
  vector("goal", problem.goal, false);
  vector("start_velocity", problem.start_velocity, true);
  vector("goal_velocity", problem.goal_velocity, true);
  vector("bend", problem.bend, true);
  const auto within = [&](const char* name, const JointVector& x, const char* unit, auto lower, auto upper) {
    for (int i = 0; i < x.size(); ++i) {
      require(x[i] >= lower(i) && x[i] <= upper(i), name, " of joint '",
              chain_.joint_names()[static_cast<std::size_t>(i)], "' is ", x[i], ", outside [", lower(i), ", ", upper(i),
              "] ", unit);
    }
  };
  const auto lower = [&](int i) { return limits.lower[i]; };
  const auto upper = [&](int i) { return limits.upper[i]; };
  const auto slowest = [&](int i) { return -limits.velocity[i]; };
  const auto fastest = [&](int i) { return limits.velocity[i]; };
  within("start", problem.start, "rad or m", lower, upper);
  within("goal", problem.goal, "rad or m", lower, upper);
  within("start_velocity", problem.start_velocity, "rad/s or m/s", slowest, fastest);
  within("goal_velocity", problem.goal_velocity, "rad/s or m/s", slowest, fastest);
}

// The direction, of length 1, in which the cost falls fastest at the motion's most expensive node; empty where this
// node's cost is small. At a maximum of the cost the gradient is zero: there the direction is that of the Hessian's
// smallest eigenvalue.
JointVector TimeOptimal::way_out(const TimeOptimalResult& found) const {
  const int n = chain_.dof();
  const auto node = [&](int k) { return Eigen::Map<const Eigen::VectorXd>(found.q.data() + k * n, n); };
  double least = std::numeric_limits<double>::infinity(), most = 0.0;
  int at = 0;
  for (int k = 1; k < options_.nodes - 1; ++k) {
    const double cost = cost_->value(node(k));
    least = std::min(least, cost);
    if (cost > most) {
      most = cost;
      at = k;
    }
  }
  if (!(most > kWorthALook * options_.time_weight * found.duration && most > 10.0 * least)) return {};
  JointVector gradient(n);
  JointMatrix hessian(n, n);
  cost_->model(node(at), gradient, hessian);
  if (gradient.norm() > 1e-6 * most) return -gradient.normalized();
  return sigmaik::detail::symmetric_eigen(hessian).vectors.col(0);
}

// A standing motion, for start == goal. The interior-point method has no strictly feasible point where the start lies
// on a limit.
TimeOptimalResult TimeOptimal::stand(const TimeOptimalProblem& problem) const {
  const auto n = static_cast<std::size_t>(chain_.dof()), nodes = static_cast<std::size_t>(options_.nodes);
  TimeOptimalResult out;
  out.status = PlanStatus::Feasible;
  out.starts = 1;
  out.duration = kStandingStep * options_.nodes;
  out.cost = options_.time_weight * out.duration + (cost_ ? options_.nodes * cost_->value(problem.start) : 0.0);
  out.gap = out.cost;
  for (std::size_t k = 0; k < nodes; ++k) out.q.insert(out.q.end(), problem.start.data(), problem.start.data() + n);
  out.qdot.assign(n * nodes, 0.0);
  out.qddot.assign(n * nodes, 0.0);
  return out;
}

TimeOptimalResult TimeOptimal::solve(const TimeOptimalProblem& problem) {
  check(problem);
  TimeOptimalResult best = engine_->solve(problem);
  const auto rests = [](const JointVector& velocity) { return velocity.size() == 0 || velocity.isZero(0.0); };
  if (best.status == PlanStatus::Failed && problem.start == problem.goal && rests(problem.start_velocity) &&
      rests(problem.goal_velocity)) {
    best = stand(problem);
  }
  if (!options_.restarts || !cost_ || best.status == PlanStatus::Failed) return best;
  const JointVector out = way_out(best);
  if (out.size() == 0) return best;
  int iterations = best.iterations;
  const auto before = [](const TimeOptimalResult& a, const TimeOptimalResult& b) {
    return a.status != b.status ? a.status < b.status : a.cost < b.cost;
  };
  for (const double side : {1.0, -1.0}) {
    TimeOptimalResult other = engine_->solve(detail::bent(chain_, problem, side * out));
    iterations += other.iterations;
    other.starts = ++best.starts;
    if (before(other, best)) best = std::move(other);
  }
  best.iterations = iterations;
  return best;
}

Trajectory TimeOptimal::timed_plan(const TimeOptimalProblem& problem) {
  const auto begin = std::chrono::steady_clock::now();
  TimeOptimalResult found = solve(problem);
  Trajectory plan;
  plan.solve_time = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  plan.dof = chain_.dof();
  plan.status = found.status;
  plan.iterations = found.iterations;
  plan.starts = found.starts;
  if (found.status == PlanStatus::Failed) return plan;
  const auto nodes = static_cast<std::size_t>(options_.nodes);
  plan.duration = found.duration;
  plan.cost = found.cost;
  for (std::size_t k = 0; k < nodes; ++k) {
    plan.t.push_back(static_cast<double>(k) * (found.duration / static_cast<double>(nodes)));
  }
  plan.q = std::move(found.q);
  plan.qdot = std::move(found.qdot);
  plan.qddot = std::move(found.qddot);
  std::vector<double> dense = detail::evenly(0.0, plan.t.back(), kDense * (nodes - 1) + 1);
  const JointSamples samples = plan.sample(dense);
  plan.clearance = clearance(chain_, sets_, std::move(dense), samples.q, options_.clearance_width);
  return plan;
}

double TimeOptimal::along(const Trajectory& plan) const {
  if (!plan.clearance) return std::numeric_limits<double>::infinity();
  double marked = 0.0, effort = 0.0;
  if (cost_) {
    const std::size_t count = plan.clearance->t.size();
    std::vector<double> values(count);
    cost_->evaluate(count, plan.sample(plan.clearance->t).q.data(), values.data(), nullptr);
    marked = std::accumulate(values.begin(), values.end(), 0.0);
  }
  for (const double a : plan.qddot) effort += a * a;
  return options_.time_weight * plan.duration + options_.effort_weight * effort + marked / static_cast<double>(kDense);
}

Trajectory TimeOptimal::plan(const TimeOptimalProblem& asked) {
  TimeOptimalProblem problem = asked;
  if (!options_.whole_turns) {
    check(problem);
    problem.goal = nearest_turn(chain_, problem.start, problem.goal);
  }
  if (!obstacles_) return best_plan(problem);
  check(problem);
  obstacles_->require_free("start", problem.start);
  obstacles_->require_free("goal", problem.goal);
  Trajectory best = best_plan(problem);
  if (best.status == PlanStatus::Failed || obstacles_->free(best)) return best;
  Trajectory failed;
  failed.dof = best.dof;
  failed.solve_time = best.solve_time;
  failed.iterations = best.iterations;
  failed.starts = best.starts;
  return failed;
}

Trajectory TimeOptimal::best_plan(const TimeOptimalProblem& problem) {
  Trajectory best = timed_plan(problem);
  if (!options_.restarts || !cost_ || !sets_ || !best.clearance) return best;
  const std::vector<Crossing>& crossings = best.clearance->crossings;
  const auto avoidable = std::find_if(crossings.begin(), crossings.end(),
                                      [](const Crossing& c) { return c.avoidable; });
  if (avoidable == crossings.end()) return best;
  TimeOptimalProblem other_way = problem;
  other_way.bend = JointVector();
  Trajectory other = timed_plan(detail::bent(chain_, other_way, detail::other_side(*sets_, *avoidable, problem.start)));
  const double solve_time = best.solve_time + other.solve_time;
  const int iterations = best.iterations + other.iterations, starts = best.starts + other.starts;
  if (along(other) < along(best)) best = std::move(other);
  best.solve_time = solve_time;
  best.iterations = iterations;
  best.starts = starts;
  return best;
}

}  // namespace sigmaik::planning
