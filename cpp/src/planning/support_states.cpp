#include <sigmaik/planning/support_states.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <utility>

#include <Eigen/Cholesky>

#include "../message.hpp"
#include "lbfgs.hpp"
#include "natural_spline.hpp"
#include "samples.hpp"

namespace sigmaik::planning {
namespace {

using sigmaik::detail::require;
using Matrix = Eigen::MatrixXd;  // interior states by joints

void require_number(const char* name, double value, double least, bool open) {
  require(std::isfinite(value) && (open ? value > least : value >= least), name, " = ", value, " must be finite and ",
          open ? "greater than " : "at least ", least);
}

// K̄ over the interior states.
Matrix covariance(int states) {
  const int m = states - 2;
  Matrix k(m, m);
  for (int i = 0; i < m; ++i) {
    for (int j = 0; j <= i; ++j) {
      const double s = (j + 1.0) / (states - 1.0), u = (i + 1.0) / (states - 1.0);
      k(i, j) = k(j, i) = s * (1.0 - u) * (2.0 * u - s * s - u * u) / 6.0;
    }
  }
  return k / k.diagonal().maxCoeff();
}

// Standard normal numbers by Box and Muller: the same everywhere.
class Normal {
 public:
  explicit Normal(std::uint64_t seed) : engine_(seed) {}

  double operator()() {
    if (spare_) {
      spare_ = false;
      return second_;
    }
    const double radius = std::sqrt(-2.0 * std::log(uniform())), angle = 2.0 * M_PI * uniform();
    second_ = radius * std::sin(angle);
    spare_ = true;
    return radius * std::cos(angle);
  }

 private:
  double uniform() { return (static_cast<double>(engine_() >> 11) + 0.5) * 0x1p-53; }

  std::mt19937_64 engine_;
  bool spare_ = false;
  double second_ = 0.0;
};

void check(const std::optional<double>& duration) {
  require(!duration || (std::isfinite(*duration) && *duration > 0.0), "duration = ", duration.value_or(0.0),
          " must be finite and greater than 0");
}

void check(const StochasticOptions& options) {
  require(options.samples >= 2, "samples = ", options.samples, " must be at least 2");
  require(options.max_iterations >= 1, "max_iterations = ", options.max_iterations, " must be at least 1");
  require_number("deviation", options.deviation, 0.0, true);
  require(options.decay > 0.0 && options.decay <= 1.0, "decay = ", options.decay, " must be in (0, 1]");
  require_number("temperature", options.temperature, 0.0, true);
  require_number("prior_weight", options.prior_weight, 0.0, false);
  require_number("tolerance", options.tolerance, 0.0, false);
}

// [s] since it was made.
class Stopwatch {
 public:
  double operator()() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count(); }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

}  // namespace

struct SupportPlanner::Work {
  class StochasticSearch;

  Chain chain;
  BatchCostPtr cost;
  std::optional<CollisionCheck> obstacles;
  std::optional<SingularSets> sets;
  int states, n, m;
  Matrix factor;     // C, lower
  Matrix smoothing;  // K̄ with each column's largest entry 1/N (16)
  Matrix line;       // μ
  Matrix noise;
  JointVector lower, upper;
  // What the cost is asked, and says, in C order.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows, gradients;
  Eigen::VectorXd values;

  Work(Chain c, BatchCostPtr l, int count, std::optional<CollisionCheck> o)
      : chain(detail::with_even_acceleration(c)),
        cost(std::move(l)),
        obstacles(std::move(o)),
        sets(SingularSets::of(chain)),
        states(count),
        n(chain.dof()),
        m(count - 2) {
    require(states >= 3 && states <= 1000, "states = ", states, " must be in [3, 1000]");
    require(cost != nullptr, "there is no cost");
    require(cost->dof() == n, "the cost is for ", cost->dof(), " joints, the chain has ", n);
    require(!obstacles || obstacles->spheres().chain().dof() == n, "the spheres are of an arm of ",
            obstacles ? obstacles->spheres().chain().dof() : 0, " joints, the chain has ", n);
    const Matrix k = covariance(states);
    factor = k.llt().matrixL();
    smoothing = k * (k.colwise().maxCoeff() * (states - 1.0)).cwiseInverse().asDiagonal();
    lower = chain.limits().lower;
    upper = chain.limits().upper;
    noise.resize(m, n);
    rows.resize(m, n);
    gradients.resize(m, n);
    values.resize(m);
  }

  void check_ends(const JointVector& start, const JointVector& goal) const {
    for (const auto& [name, q] : {std::pair<const char*, const JointVector*>{"start", &start}, {"goal", &goal}}) {
      require(q->size() == n, name, " has ", q->size(), " entries, the chain has ", n, " joints");
      for (int i = 0; i < n; ++i) {
        require((*q)[i] >= lower[i] && (*q)[i] <= upper[i], name, " of joint '",
                chain.joint_names()[static_cast<std::size_t>(i)], "' is ", (*q)[i], ", outside [", lower[i], ", ",
                upper[i], "] rad or m");
      }
    }
  }

  void begin(const JointVector& start, const JointVector& goal) {
    check_ends(start, goal);
    line.resize(m, n);
    for (int i = 0; i < m; ++i) {
      line.row(i) = (start + (i + 1.0) / (states - 1.0) * (goal - start)).transpose();
    }
  }

  void clip(Matrix& q) const {
    for (int j = 0; j < n; ++j) q.col(j) = q.col(j).cwiseMax(lower[j]).cwiseMin(upper[j]);
  }

  // From the prior about `mean`, of standard deviation `deviation` half-way, on limits where it is beyond them.
  void draw(Normal& normal, const Matrix& mean, double deviation, Matrix& out) {
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < m; ++i) noise(i, j) = normal();
    }
    out.noalias() = factor.triangularView<Eigen::Lower>() * noise;
    out = mean + deviation * out;
    clip(out);
  }

  double value(const Matrix& q) {
    rows = q;
    cost->evaluate(static_cast<std::size_t>(m), rows.data(), values.data(), nullptr);
    return std::accumulate(values.begin(), values.end(), 0.0);
  }

  double slopes(const Matrix& q, Matrix& out) {
    rows = q;
    cost->evaluate(static_cast<std::size_t>(m), rows.data(), values.data(), gradients.data());
    out = gradients;
    return std::accumulate(values.begin(), values.end(), 0.0);
  }

  // What plan() returns: the spline through the states, or a failed plan where it touches an obstacle.
  Trajectory motion(const SupportStates& found, double prior_weight, PlanStatus status, std::optional<double> duration,
                    double solve_time) const {
    const detail::NaturalSpline spline = detail::NaturalSpline::within(chain.limits(), found.q, states, n);
    Trajectory plan = spline.over(duration ? *duration : spline.shortest(chain.limits()));
    plan.status = status;
    plan.cost = found.cost + prior_weight * found.distance;
    if (obstacles && !obstacles->free(plan)) {
      plan = Trajectory();
      plan.dof = n;
      plan.cubic = true;
    } else {
      std::vector<double> dense = detail::evenly(0.0, plan.duration, detail::kDense * (plan.size() - 1) + 1);
      const JointSamples samples = plan.sample(dense);
      plan.clearance = clearance(chain, sets, std::move(dense), samples.q);
    }
    plan.solve_time = solve_time;
    plan.iterations = found.iterations;
    return plan;
  }

  void require_free(const JointVector& start, const JointVector& goal) const {
    if (!obstacles) return;
    check_ends(start, goal);
    obstacles->require_free("start", start);
    obstacles->require_free("goal", goal);
  }

  Matrix whiten(const Matrix& q) const { return factor.triangularView<Eigen::Lower>().solve(q - line); }

  SupportStates result(const JointVector& start, const JointVector& goal, const Matrix& q, double value, int iterations,
                       bool converged) const {
    SupportStates out;
    out.cost = value;
    out.distance = whiten(q).squaredNorm();
    out.iterations = iterations;
    out.converged = converged;
    out.q.insert(out.q.end(), start.data(), start.data() + n);
    for (int i = 0; i < m; ++i) {
      for (int j = 0; j < n; ++j) out.q.push_back(q(i, j));
    }
    out.q.insert(out.q.end(), goal.data(), goal.data() + n);
    return out;
  }
};

// The stochastic search from the line, once Work has begun.
class SupportPlanner::Work::StochasticSearch {
 public:
  StochasticSearch(Work& work, const StochasticOptions& options)
      : w_(work),
        options_(options),
        normal_(options.seed),
        q_(w_.line),
        best_(q_),
        sample_(w_.m, w_.n),
        move_(w_.m, w_.n),
        least_(objective(q_, best_cost_)),
        deviation_(options.deviation),
        moves_(static_cast<std::size_t>(options.samples), Matrix(w_.m, w_.n)),
        values_(static_cast<std::size_t>(options.samples)),
        history_{least_} {}

  // Moves the mean once. True where the best states have settled.
  bool iterate() {
    draw();
    move();
    deviation_ *= options_.decay;
    history_.push_back(least_);
    constexpr std::size_t kWindow = 8;
    return history_.size() > kWindow &&
           history_[history_.size() - 1 - kWindow] - least_ <= options_.tolerance * std::abs(least_);
  }

  const Matrix& best() const { return best_; }
  double best_cost() const { return best_cost_; }  // of its states, without the prior

 private:
  double objective(const Matrix& q, double& states_cost) {
    states_cost = w_.value(q);
    return states_cost + (options_.prior_weight > 0.0 ? options_.prior_weight * w_.whiten(q).squaredNorm() : 0.0);
  }

  // The objective at q, which is remembered where it is the least yet.
  double visit(const Matrix& q) {
    double states_cost;
    const double value = objective(q, states_cost);
    if (value < least_) {
      least_ = value;
      best_ = q;
      best_cost_ = states_cost;
    }
    return value;
  }

  void draw() {
    low_ = std::numeric_limits<double>::infinity();
    high_ = -low_;
    for (std::size_t k = 0; k < values_.size(); ++k) {
      w_.draw(normal_, q_, deviation_, sample_);
      values_[k] = visit(sample_);
      moves_[k] = sample_ - q_;
      low_ = std::min(low_, values_[k]);
      high_ = std::max(high_, values_[k]);
    }
  }

  // Moves the mean to where the samples were good.
  void move() {
    move_.setZero();
    double total = 0.0;
    for (std::size_t k = 0; k < values_.size(); ++k) {
      const double weight = high_ > low_ ? std::exp(-(values_[k] - low_) / (options_.temperature * (high_ - low_)))
                                         : 1.0;
      total += weight;
      move_ += weight * moves_[k];
    }
    // (16): K̄ spreads what a state asks for; its columns' scale makes a common wish of all states go through whole.
    sample_.noalias() = w_.smoothing * move_;
    q_ += sample_ / total;
    w_.clip(q_);
    visit(q_);
  }

  Work& w_;
  const StochasticOptions& options_;
  Normal normal_;
  Matrix q_, best_, sample_, move_;
  double best_cost_ = 0.0, least_, deviation_;
  double low_ = 0.0, high_ = 0.0;  // of the samples' values
  std::vector<Matrix> moves_;
  std::vector<double> values_, history_;
};

SupportPlanner::SupportPlanner(Chain chain, BatchCostPtr cost, int states, std::optional<CollisionCheck> obstacles)
    : work_(std::make_unique<Work>(std::move(chain), std::move(cost), states, std::move(obstacles))) {}
SupportPlanner::~SupportPlanner() = default;
SupportPlanner::SupportPlanner(SupportPlanner&&) noexcept = default;
SupportPlanner& SupportPlanner::operator=(SupportPlanner&&) noexcept = default;
int SupportPlanner::states() const noexcept { return work_->states; }
const Chain& SupportPlanner::chain() const noexcept { return work_->chain; }

SupportStates SupportPlanner::gradient(const JointVector& start, const JointVector& goal,
                                       const GradientOptions& options, const std::vector<double>& guess) {
  Work& w = *work_;
  require_number("prior_weight", options.prior_weight, 0.0, true);
  require_number("tolerance", options.tolerance, 0.0, false);
  require(options.max_iterations >= 1, "max_iterations = ", options.max_iterations, " must be at least 1");
  require(guess.empty() || guess.size() == static_cast<std::size_t>(w.states * w.n), "the guess has ", guess.size(),
          " numbers, needs ", w.states * w.n);
  w.begin(start, goal);

  Matrix x = Matrix::Zero(w.m, w.n), q = w.line, dq(w.m, w.n);
  if (!guess.empty()) {
    for (int i = 0; i < w.m; ++i) {
      for (int j = 0; j < w.n; ++j) q(i, j) = guess[static_cast<std::size_t>((i + 1) * w.n + j)];
    }
    w.clip(q);
    x = w.whiten(q);
  }
  // States beyond a limit cost as much as those on it, and a penalty that brings them back.
  double states_cost = 0.0, cost = 0.0;
  Matrix q_new(w.m, w.n);
  const auto evaluate = [&](const Matrix& at, Matrix& slope) {
    q_new.noalias() = w.factor.triangularView<Eigen::Lower>() * at;
    q_new += w.line;
    Matrix inside = q_new;
    w.clip(inside);
    states_cost = w.slopes(inside, dq);
    const Matrix beyond = q_new - inside;
    dq = (beyond.array() != 0.0).select(2e4 * beyond, dq);
    slope.noalias() = w.factor.transpose().triangularView<Eigen::Upper>() * dq;
    slope += 2.0 * options.prior_weight * at;
    return states_cost + 1e4 * beyond.squaredNorm() + options.prior_weight * at.squaredNorm();
  };
  const auto accept = [&] {
    q.swap(q_new);
    cost = states_cost;
  };
  // The first step moves the states half-way by at most a tenth of a radian.
  detail::Lbfgs search({options.max_iterations, options.tolerance, 0.1});
  search.minimise(x, evaluate, accept);
  w.clip(q);
  return w.result(start, goal, q, cost, search.iterations(), search.converged());
}

SupportStates SupportPlanner::stochastic(const JointVector& start, const JointVector& goal,
                                         const StochasticOptions& options) {
  Work& w = *work_;
  check(options);
  w.begin(start, goal);
  Work::StochasticSearch search(w, options);
  bool converged = false;
  int iteration = 0;
  for (; iteration < options.max_iterations && !converged; ++iteration) converged = search.iterate();
  return w.result(start, goal, search.best(), search.best_cost(), iteration, converged);
}

SupportStates SupportPlanner::draw(const JointVector& start, const JointVector& goal, double deviation,
                                   std::uint64_t seed) {
  Work& w = *work_;
  require_number("deviation", deviation, 0.0, false);
  w.begin(start, goal);
  Normal normal(seed);
  Matrix q(w.m, w.n);
  w.draw(normal, w.line, deviation, q);
  return w.result(start, goal, q, w.value(q), 0, false);
}

Trajectory SupportPlanner::plan(const JointVector& start, const JointVector& asked, const GradientOptions& options) {
  constexpr double kDeviation = 0.5;  // [rad or m] of first guesses, half-way
  require(options.restarts >= 0, "restarts = ", options.restarts, " must be at least 0");
  check(options.duration);
  const JointVector goal = options.whole_turns ? asked : nearest_turn(work_->chain, start, asked);
  work_->require_free(start, goal);
  const Stopwatch time;
  const auto from = [&](const std::vector<double>& guess) {
    const SupportStates found = gradient(start, goal, options, guess);
    return work_->motion(found, options.prior_weight, found.converged ? PlanStatus::Optimal : PlanStatus::Feasible,
                         options.duration, time());
  };
  Trajectory best = from({});
  if (best.status != PlanStatus::Failed || options.restarts == 0) return best;
  for (int seed = 0; seed < options.restarts; ++seed) {
    Trajectory other = from(draw(start, goal, kDeviation, static_cast<std::uint64_t>(seed)).q);
    if (other.status != PlanStatus::Failed && !(best.cost <= other.cost)) best = std::move(other);
  }
  best.solve_time = time();
  return best;
}

Trajectory SupportPlanner::plan(const JointVector& start, const JointVector& asked, const StochasticOptions& options) {
  check(options.duration);
  const JointVector goal = options.whole_turns ? asked : nearest_turn(work_->chain, start, asked);
  work_->require_free(start, goal);
  const Stopwatch time;
  const SupportStates found = stochastic(start, goal, options);
  Trajectory rough = work_->motion(found, options.prior_weight, PlanStatus::Feasible, options.duration, time());
  if (!options.refine) return rough;
  GradientOptions finish;
  finish.prior_weight = std::max(options.prior_weight, 1e-6);
  const SupportStates fine = gradient(start, goal, finish, found.q);
  Trajectory refined = work_->motion(fine, options.prior_weight,
                                     fine.converged ? PlanStatus::Optimal : PlanStatus::Feasible, options.duration,
                                     time());
  return refined.status == PlanStatus::Failed ? rough : refined;
}

}  // namespace sigmaik::planning
