#pragma once
// Limited-memory BFGS with backtracking (Nocedal and Wright, Numerical Optimization, algorithms 7.4, 7.5 and 3.1), over
// matrices.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <deque>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace sigmaik::planning::detail {

struct LbfgsOptions {
  int max_iterations;
  double tolerance;   // the search stops where an iteration gains less than this part of the objective
  double first_step;  // length of the first step, where no curvature is known
};

class Lbfgs {
 public:
  using Matrix = Eigen::MatrixXd;

  explicit Lbfgs(const LbfgsOptions& options) : options_(options) {}

  int iterations() const noexcept { return iterations_; }
  /// The search stopped by its own rule.
  bool converged() const noexcept { return converged_; }

  /// Moves x to a local minimum of `evaluate(x, slope)`, which returns the objective and writes its slope. `accept()`
  /// is called where the last point that was evaluated is the best so far.
  template <typename Evaluate, typename Accept>
  void minimise(Matrix& x, Evaluate evaluate, Accept accept) {
    Matrix slope(x.rows(), x.cols()), x_new, slope_new(x.rows(), x.cols());
    double f = evaluate(x, slope);
    accept();
    while (iterations_ < options_.max_iterations && !converged_) {
      const Matrix direction = step(slope);
      const double along = -slope.cwiseProduct(direction).sum();
      double f_new = 0.0;
      const auto shorter = [&](double part) {
        x_new = x - part * direction;
        f_new = evaluate(x_new, slope_new);
        return f_new <= f + 1e-4 * part * along;  // Armijo's rule
      };
      if (!(along < 0.0) || !backtrack(shorter)) {
        if (memory_.empty()) {  // not even steepest descent gains
          converged_ = true;
          return;
        }
        memory_.clear();
        ++iterations_;
        continue;
      }
      remember(x_new - x, slope_new - slope);
      converged_ = f - f_new <= options_.tolerance * std::abs(f_new);
      x.swap(x_new);
      slope.swap(slope_new);
      f = f_new;
      accept();
      ++iterations_;
    }
  }

 private:
  struct Pair {
    Matrix s, y;  // steps of x and of its slope
    double rho;   // 1/(sᵀy)
  };

  // The two loops of algorithm 7.4: the inverse Hessian's estimate times the slope.
  Matrix step(const Matrix& slope) const {
    Matrix direction = slope;
    std::vector<double> alpha(memory_.size());
    for (std::size_t i = memory_.size(); i-- > 0;) {
      alpha[i] = memory_[i].rho * memory_[i].s.cwiseProduct(direction).sum();
      direction -= alpha[i] * memory_[i].y;
    }
    direction *= memory_.empty() ? options_.first_step / std::max(direction.norm(), 1e-300)
                                 : 1.0 / (memory_.back().rho * memory_.back().y.squaredNorm());
    for (std::size_t i = 0; i < memory_.size(); ++i) {
      direction += (alpha[i] - memory_[i].rho * memory_[i].y.cwiseProduct(direction).sum()) * memory_[i].s;
    }
    return direction;
  }

  template <typename Sufficient>
  static bool backtrack(Sufficient sufficient) {
    double part = 1.0;
    for (int trial = 0; trial < 30; ++trial, part *= 0.5) {
      if (sufficient(part)) return true;
    }
    return false;
  }

  // Pairs without positive curvature are left out: the estimate stays positive definite.
  void remember(Matrix s, Matrix y) {
    constexpr std::size_t kPairs = 8;
    const double curvature = s.cwiseProduct(y).sum();
    if (!(curvature > 1e-12 * s.norm() * y.norm())) return;
    memory_.push_back({std::move(s), std::move(y), 1.0 / curvature});
    if (memory_.size() > kPairs) memory_.pop_front();
  }

  LbfgsOptions options_;
  std::deque<Pair> memory_;
  int iterations_ = 0;
  bool converged_ = false;
};

}  // namespace sigmaik::planning::detail
