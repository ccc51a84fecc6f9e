#include <sigmaik/planning/support_states.hpp>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <numeric>
#include <random>
#include <utility>

#include <Eigen/Cholesky>

#include "../message.hpp"

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

}  // namespace

struct SupportPlanner::Work {
  Chain chain;
  BatchCostPtr cost;
  int states, n, m;
  Matrix factor;     // C, lower
  Matrix smoothing;  // K̄ with each column's largest entry 1/N (16)
  Matrix line;       // μ
  Matrix noise;
  JointVector lower, upper;
  // What the cost is asked, and says, in C order.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows, gradients;
  Eigen::VectorXd values;

  Work(Chain c, BatchCostPtr l, int count)
      : chain(std::move(c)), cost(std::move(l)), states(count), n(chain.dof()), m(count - 2) {
    require(states >= 3 && states <= 1000, "states = ", states, " must be in [3, 1000]");
    require(cost != nullptr, "there is no cost");
    require(cost->dof() == n, "the cost is for ", cost->dof(), " joints, the chain has ", n);
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

  void begin(const JointVector& start, const JointVector& goal) {
    for (const auto& [name, q] : {std::pair<const char*, const JointVector*>{"start", &start}, {"goal", &goal}}) {
      require(q->size() == n, name, " has ", q->size(), " entries, the chain has ", n, " joints");
      for (int i = 0; i < n; ++i) {
        require((*q)[i] >= lower[i] && (*q)[i] <= upper[i], name, " of joint '",
                chain.joint_names()[static_cast<std::size_t>(i)], "' is ", (*q)[i], ", outside [", lower[i], ", ",
                upper[i], "] rad or m");
      }
    }
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

SupportPlanner::SupportPlanner(Chain chain, BatchCostPtr cost, int states)
    : work_(std::make_unique<Work>(std::move(chain), std::move(cost), states)) {}
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
  // States beyond a limit cost what those on it do, and as much as it takes to bring them back.
  double states_cost = 0.0;
  const auto evaluate = [&](const Matrix& at, Matrix& states, Matrix& slope) {
    states.noalias() = w.factor.triangularView<Eigen::Lower>() * at;
    states += w.line;
    Matrix inside = states;
    w.clip(inside);
    states_cost = w.slopes(inside, dq);
    const Matrix beyond = states - inside;
    dq = (beyond.array() != 0.0).select(2e4 * beyond, dq);
    slope.noalias() = w.factor.transpose().triangularView<Eigen::Upper>() * dq;
    slope += 2.0 * options.prior_weight * at;
    return states_cost + 1e4 * beyond.squaredNorm() + options.prior_weight * at.squaredNorm();
  };

  struct Pair {
    Matrix s, y;
    double rho;
  };
  std::deque<Pair> memory;
  Matrix slope(w.m, w.n), direction, x_new, slope_new(w.m, w.n), q_new(w.m, w.n);
  double f = evaluate(x, q, slope), cost = states_cost;
  bool converged = false;
  int iteration = 0;
  for (; iteration < options.max_iterations && !converged; ++iteration) {
    direction = slope;
    std::vector<double> alpha(memory.size());
    for (std::size_t i = memory.size(); i-- > 0;) {
      alpha[i] = memory[i].rho * memory[i].s.cwiseProduct(direction).sum();
      direction -= alpha[i] * memory[i].y;
    }
    // The first step moves half-way states by a tenth of a radian at most.
    direction *= memory.empty() ? 0.1 / std::max(direction.norm(), 1e-300)
                                : 1.0 / (memory.back().rho * memory.back().y.squaredNorm());
    for (std::size_t i = 0; i < memory.size(); ++i) {
      direction += (alpha[i] - memory[i].rho * memory[i].y.cwiseProduct(direction).sum()) * memory[i].s;
    }
    const double along = -slope.cwiseProduct(direction).sum();
    if (!(along < 0.0)) {
      if (memory.empty()) {
        converged = true;
        break;
      }
      memory.clear();
      continue;
    }
    double step = 1.0, f_new = 0.0;
    bool found = false;
    for (int trial = 0; trial < 30; ++trial, step *= 0.5) {
      x_new = x - step * direction;
      f_new = evaluate(x_new, q_new, slope_new);
      if (f_new <= f + 1e-4 * step * along) {
        found = true;
        break;
      }
    }
    if (!found) {
      if (memory.empty()) {
        converged = true;
        break;
      }
      memory.clear();
      continue;
    }
    Pair pair{x_new - x, slope_new - slope, 0.0};
    const double curvature = pair.s.cwiseProduct(pair.y).sum();
    if (curvature > 1e-12 * pair.s.norm() * pair.y.norm()) {
      pair.rho = 1.0 / curvature;
      memory.push_back(std::move(pair));
      if (memory.size() > 8) memory.pop_front();
    }
    converged = f - f_new <= options.tolerance * std::abs(f_new);
    x.swap(x_new);
    q.swap(q_new);
    slope.swap(slope_new);
    f = f_new;
    cost = states_cost;
  }
  w.clip(q);
  return w.result(start, goal, q, cost, iteration, converged);
}

SupportStates SupportPlanner::stochastic(const JointVector& start, const JointVector& goal,
                                         const StochasticOptions& options) {
  Work& w = *work_;
  require(options.samples >= 2, "samples = ", options.samples, " must be at least 2");
  require(options.max_iterations >= 1, "max_iterations = ", options.max_iterations, " must be at least 1");
  require_number("deviation", options.deviation, 0.0, true);
  require(options.decay > 0.0 && options.decay <= 1.0, "decay = ", options.decay, " must be in (0, 1]");
  require_number("temperature", options.temperature, 0.0, true);
  require_number("prior_weight", options.prior_weight, 0.0, false);
  require_number("tolerance", options.tolerance, 0.0, false);
  w.begin(start, goal);

  Normal normal(options.seed);
  const auto objective = [&](const Matrix& q, double& states_cost) {
    states_cost = w.value(q);
    return states_cost + (options.prior_weight > 0.0 ? options.prior_weight * w.whiten(q).squaredNorm() : 0.0);
  };

  Matrix q = w.line, best = q, sample(w.m, w.n), move(w.m, w.n);
  double best_cost = 0.0, least = objective(q, best_cost), deviation = options.deviation;
  std::vector<Matrix> moves(static_cast<std::size_t>(options.samples), Matrix(w.m, w.n));
  std::vector<double> values(static_cast<std::size_t>(options.samples));
  std::vector<double> history{least};
  bool converged = false;
  int iteration = 0;
  for (; iteration < options.max_iterations && !converged; ++iteration) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (std::size_t k = 0; k < values.size(); ++k) {
      w.draw(normal, q, deviation, sample);
      double states_cost;
      values[k] = objective(sample, states_cost);
      if (values[k] < least) {
        least = values[k];
        best = sample;
        best_cost = states_cost;
      }
      moves[k] = sample - q;
      low = std::min(low, values[k]);
      high = std::max(high, values[k]);
    }
    move.setZero();
    double total = 0.0;
    for (std::size_t k = 0; k < values.size(); ++k) {
      const double weight = high > low ? std::exp(-(values[k] - low) / (options.temperature * (high - low))) : 1.0;
      total += weight;
      move += weight * moves[k];
    }
    // (16): K̄ spreads what a state asks for; its columns' scale makes a common wish of all states go through whole.
    sample.noalias() = w.smoothing * move;
    q += sample / total;
    w.clip(q);
    double states_cost;
    const double value = objective(q, states_cost);
    if (value < least) {
      least = value;
      best = q;
      best_cost = states_cost;
    }
    deviation *= options.decay;
    history.push_back(least);
    const std::size_t window = 8;
    if (history.size() > window) {
      converged = history[history.size() - 1 - window] - least <= options.tolerance * std::abs(least);
    }
  }
  return w.result(start, goal, best, best_cost, iteration, converged);
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

// Tridiagonal: v_{i−1} + 4 v_i + v_{i+1} = 3 (q_{i+1} − q_{i−1})/h, and 2 v_0 + v_1 = 3 (q_1 − q_0)/h at the ends.
std::vector<double> spline_velocities(const std::vector<double>& q, int states, int dof) {
  require(states >= 2 && dof >= 1 && q.size() == static_cast<std::size_t>(states * dof), "the motion has ", q.size(),
          " numbers, needs ", states, " × ", dof);
  const double h = 1.0 / (states - 1.0);
  const auto at = [&](int i, int j) { return q[static_cast<std::size_t>(i * dof + j)]; };
  std::vector<double> v(q.size()), upper(static_cast<std::size_t>(states));
  for (int j = 0; j < dof; ++j) {
    for (int i = 0; i < states; ++i) {
      const bool first = i == 0, last = i == states - 1;
      const double diagonal = first || last ? 2.0 : 4.0;
      const double right = 3.0 / h * (at(last ? i : i + 1, j) - at(first ? i : i - 1, j));
      const double before = first ? 0.0 : upper[static_cast<std::size_t>(i - 1)];
      const double pivot = diagonal - before;
      upper[static_cast<std::size_t>(i)] = 1.0 / pivot;
      const double carried = first ? 0.0 : v[static_cast<std::size_t>((i - 1) * dof + j)];
      v[static_cast<std::size_t>(i * dof + j)] = (right - carried) / pivot;
    }
    for (int i = states - 2; i >= 0; --i) {
      v[static_cast<std::size_t>(i * dof + j)] -= upper[static_cast<std::size_t>(i)] *
                                                  v[static_cast<std::size_t>((i + 1) * dof + j)];
    }
  }
  return v;
}

}  // namespace sigmaik::planning
