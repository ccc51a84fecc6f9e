#pragma once
// The loop of the interior-point method: steps, and barriers that shrink.

#include <algorithm>
#include <cstddef>
#include <limits>

#include "interior_point.hpp"

namespace sigmaik::planning::detail {

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

// The next barrier, at least `least`: much smaller once Newton's method has this one, else carefully so.
template <int W>
double InteriorPoint<W>::shrink_barrier(double mu, double least, bool exact, double gain,
                                        double primal) const noexcept {
  if (exact && gain <= 2.0 * mu) return std::max(0.1 * mu, least);
  if (primal > 0.9 && gain < 0.3 * mu * constraints_) return std::max(0.3 * mu, least);
  return mu;
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
    bool exact;
    if (!find_descent(mu, exact)) return result(iteration, gap, false);
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
    mu = shrink_barrier(mu, 0.1 * goal / constraints_, exact, gain, primal);
  }
  evaluate();
  return result(options_.max_iterations, gap, false);
}

}  // namespace sigmaik::planning::detail
