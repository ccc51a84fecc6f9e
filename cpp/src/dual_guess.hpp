#pragma once
// The active set of a problem that has bounds and rows C alone, from its dual, as a first guess for active_set.hpp.
//
//     min ½|x|²,  C x = d,  lower ≤ x ≤ upper        has        x(y) = clamp(Cᵀy, lower, upper),  F(y) = C x(y) − d =
//     0.
//
// F is the gradient of the convex, piecewise quadratic φ(y) = Σ_i h_i((Cᵀy)_i) − dᵀy, h_i' = clamp. Newton's method
// with the matrix C D Cᵀ, D = 1 for the unknowns inside their bounds and 0 for the others, changes the whole set at
// once, and ends where the set stays the same. With m ≤ 8 rows a step costs a fraction of a factorisation of the active
// set's, whose number grows with the unknowns that change. C D Cᵀ squares the rows, so the set is a guess, and not the
// answer.

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "hierarchy.hpp"
#include "lanes.hpp"

namespace sigmaik::detail {

template <int lanes, int P>
class DualGuess {
 public:
  explicit SIGMAIK_INLINE DualGuess(const ActiveSetProblem<P>& problem) : p_(problem), m_(problem.equalities) {}

  /// At most 24 steps of Newton's method.
  SIGMAIK_INLINE void find(std::uint32_t& at_lower, std::uint32_t& at_upper) {
    set_zero<lanes>(t_);
    place(at_lower, at_upper);
    for (int step = 0; step < kSteps; ++step) {
      const std::uint32_t lower = at_lower, upper = at_upper;
      measure();
      if (!newton(~(lower | upper))) return;
      set_zero<lanes>(way_);
      for (int k = 0; k < m_; ++k) add_scaled<lanes>(way_, change_[k], p_.row[k]);
      const double part = line_search();
      for (int i = 0; i < P; ++i) t_[i] += part * way_[i];
      place(at_lower, at_upper);
      if (part == 1.0 && at_lower == lower && at_upper == upper) return;
    }
  }

 private:
  static constexpr int kSteps = 24, kMostRows = 8;
  static constexpr double kLeast = 1e-8;

  SIGMAIK_INLINE double clamped(int i, double t) const { return std::min(std::max(t, p_.lower[i]), p_.upper[i]); }

  SIGMAIK_INLINE void place(std::uint32_t& at_lower, std::uint32_t& at_upper) const {
    at_lower = at_upper = 0;
    for (int i = 0; i < p_.unknowns; ++i) {
      if (t_[i] <= p_.lower[i]) {
        at_lower |= 1u << i;
      } else if (t_[i] >= p_.upper[i]) {
        at_upper |= 1u << i;
      }
    }
  }

  // F at t.
  SIGMAIK_INLINE void measure() {
    alignas(32) double x[P];
    set_zero<lanes>(x);
    for (int i = 0; i < p_.unknowns; ++i) x[i] = clamped(i, t_[i]);
    for (int k = 0; k < m_; ++k) f_[k] = dot<lanes>(p_.row[k], x) - p_.rhs[k];
  }

  // change ← −(C D Cᵀ)⁻¹ F by Cholesky. Returns false where a row is zero.
  SIGMAIK_INLINE bool newton(std::uint32_t free) {
    double a[kMostRows][kMostRows];
    alignas(32) double row[P];
    for (int k = 0; k < m_; ++k) {
      for (int i = 0; i < P; ++i) row[i] = (free >> i & 1u) != 0 ? p_.row[k][i] : 0.0;
      for (int j = 0; j <= k; ++j) a[k][j] = dot<lanes>(row, p_.row[j]);
    }
    for (int k = 0; k < m_; ++k) {
      for (int j = 0; j < k; ++j) {
        for (int i = 0; i < j; ++i) a[k][j] -= a[k][i] * a[j][i];
        a[k][j] /= a[j][j];
      }
      // Where too few unknowns are free for the rows, the step is shorter in what they cannot change.
      const double least = kLeast * dot<lanes>(p_.row[k], p_.row[k]);
      for (int i = 0; i < k; ++i) a[k][k] -= a[k][i] * a[k][i];
      if (!(least > 0.0)) return false;
      a[k][k] = std::sqrt(std::max(a[k][k], least));
    }
    for (int k = 0; k < m_; ++k) {
      double sum = -f_[k];
      for (int i = 0; i < k; ++i) sum -= a[k][i] * change_[i];
      change_[k] = sum / a[k][k];
    }
    for (int k = m_ - 1; k >= 0; --k) {
      double sum = change_[k];
      for (int i = k + 1; i < m_; ++i) sum -= a[i][k] * change_[i];
      change_[k] = sum / a[k][k];
    }
    return true;
  }

  // The slope of φ after this part of the step; it does not fall with `part`.
  SIGMAIK_INLINE double slope(double part) const {
    double sum = 0.0;
    for (int i = 0; i < p_.unknowns; ++i) sum += way_[i] * clamped(i, t_[i] + part * way_[i]);
    for (int k = 0; k < m_; ++k) sum -= change_[k] * p_.rhs[k];
    return sum;
  }

  // 1, or near the part of the step at which φ is least.
  SIGMAIK_INLINE double line_search() const {
    const double start = slope(0.0);
    double high = slope(1.0);
    if (!(start < 0.0) || high <= 1e-9 * -start) return 1.0;
    double a = 0.0, b = 1.0, low = start;
    int side = 0;
    for (int k = 0; k < 10; ++k) {
      const double margin = 0.05 * (b - a);
      const double at = std::clamp(a + (b - a) * (low / (low - high)), a + margin, b - margin);
      const double value = slope(at);
      if (std::abs(value) <= 1e-3 * -start) return at;
      if (value < 0.0) {
        a = at;
        low = value;
        if (side == -1) high *= 0.5;
        side = -1;
      } else {
        b = at;
        high = value;
        if (side == 1) low *= 0.5;
        side = 1;
      }
    }
    return a > 0.0 ? a : b;
  }

  const ActiveSetProblem<P>& p_;
  const int m_;
  alignas(32) double t_[P];    // Cᵀy
  alignas(32) double way_[P];  // Cᵀ change
  double f_[kMostRows], change_[kMostRows];
};

}  // namespace sigmaik::detail
