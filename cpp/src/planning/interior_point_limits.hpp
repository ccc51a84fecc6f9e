#pragma once
// The limits as constraints of the interior-point method: their values, their changes along a direction, and the slacks
// and multipliers that they begin with.

#include <algorithm>

#include "interior_point.hpp"

namespace sigmaik::planning::detail {

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

}  // namespace sigmaik::planning::detail
