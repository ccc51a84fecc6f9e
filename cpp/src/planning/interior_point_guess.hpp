#pragma once
// Where the interior-point method begins, and how it leaves a saddle.

#include <algorithm>
#include <cmath>

#include "interior_point.hpp"

namespace sigmaik::planning::detail {

// a_k of a motion that leaves for 1 and comes back: of 16 s² (1 − s)² in time, less what would move the end.
template <int W>
double InteriorPoint<W>::bend_acceleration(int k) const noexcept {
  const double m = count_ - 1.0, u = (2.0 * k - (m - 1.0)) / m;  // u in (−1, 1); the mean of u² is (m² − 1)/3m²
  return 48.0 / (m * m) * (u * u - (m * m - 1.0) / (3.0 * m * m));
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

}  // namespace sigmaik::planning::detail
