#include <sigmaik/planning/time_optimal.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "../aligned.hpp"
#include "../message.hpp"
#include "interior_point.hpp"

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

using sigmaik::detail::require;

constexpr double kWorthALook = 1e-3;    // a node's cost, as a part of what time costs, that warrants other starts
constexpr double kStandingStep = 1e-6;  // [s] of a motion that goes nowhere
constexpr double kBend = 0.6;           // [rad or m] by which these are bent

std::unique_ptr<TimeOptimal::Engine> make_engine(const Chain& chain, const JointCostPtr& cost,
                                                 const TimeOptimalOptions& options) {
  if (chain.dof() <= 8) return std::make_unique<detail::InteriorPoint<8>>(chain, cost, options);
  return std::make_unique<detail::InteriorPoint<kMaxJoints>>(chain, cost, options);
}

}  // namespace

const char* to_string(PlanStatus status) noexcept {
  switch (status) {
    case PlanStatus::Optimal: return "optimal";
    case PlanStatus::Feasible: return "feasible";
    default: return "failed";
  }
}

TimeOptimal::TimeOptimal(Chain chain, JointCostPtr cost, const TimeOptimalOptions& options)
    : chain_(std::move(chain)), cost_(std::move(cost)), options_(options) {
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

// The direction, of length 1, in which the cost falls fastest where the motion found pays most; empty where it pays
// nothing worth a second look. On top of a hill nothing falls: there it is the way in which the hill bends down most.
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
  return Eigen::SelfAdjointEigenSolver<sigmaik::detail::Aligned<JointMatrix>>(hessian).eigenvectors().col(0);
}

// To stay where one is, which has no interior where that is on a limit.
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
  const JointLimits& limits = chain_.limits();
  const auto before = [](const TimeOptimalResult& a, const TimeOptimalResult& b) {
    return a.status != b.status ? a.status < b.status : a.cost < b.cost;
  };
  for (const double bend : {kBend, -kBend}) {
    TimeOptimalProblem bent = problem;
    bent.bend = bend * out;
    if (problem.bend.size() != 0) bent.bend += problem.bend;
    for (int i = 0; i < chain_.dof(); ++i) {  // so that the guess stays within its limits
      const double low = limits.lower[i] - std::min(problem.start[i], problem.goal[i]);
      const double high = limits.upper[i] - std::max(problem.start[i], problem.goal[i]);
      bent.bend[i] = std::clamp(bent.bend[i], 0.4 * low, 0.4 * high);
    }
    TimeOptimalResult other = engine_->solve(bent);
    iterations += other.iterations;
    other.starts = ++best.starts;
    if (before(other, best)) best = std::move(other);
  }
  best.iterations = iterations;
  return best;
}

}  // namespace sigmaik::planning
