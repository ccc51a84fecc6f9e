#pragma once
// Regula falsi (Illinois) for the root of an increasing function.

#include <algorithm>

namespace sigmaik::detail {

// An interval [a, b] with f(a) ≤ 0 < f(b). Of an end that stays twice the value is halved, so that both ends move.
struct Bracket {
  double a, fa, b, fb;
  int side = 0;  // −1: a moved last; 1: b

  double width() const noexcept { return b - a; }
  // Where the line through both ends is zero.
  double root() const noexcept { return a + (b - a) * (fa / (fa - fb)); }
  // The nearest point to x that is not at an end.
  double inside(double x) const noexcept {
    const double margin = 0.01 * (b - a);
    return std::clamp(x, a + margin, b - margin);
  }

  // fx = f(x). Returns whether f(x) ≤ 0.
  bool take(double x, double fx) noexcept {
    if (fx <= 0.0) {
      a = x;
      fa = fx;
      if (side == -1) fb *= 0.5;
      side = -1;
      return true;
    }
    b = x;
    fb = fx;
    if (side == 1) fa *= 0.5;
    side = 1;
    return false;
  }
};

}  // namespace sigmaik::detail
