#pragma once
// How far an interior-point step goes along its direction: the merit function, and the search for a length that it is
// content with.

#include <algorithm>
#include <cmath>
#include <limits>

#include "interior_point.hpp"

namespace sigmaik::planning::detail {

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

}  // namespace sigmaik::planning::detail
