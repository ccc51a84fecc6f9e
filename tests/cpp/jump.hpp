#pragma once
// How a test tells a jump from a slope.

#include <functional>

#include "random.hpp"

namespace test {

/// Halves [a, b] again and again, and keeps the half in which f changes more. The change that is left: a jump stays, a
/// slope vanishes.
inline double jump_within(const std::function<VectorXd(double)>& f, double a, double b, int halvings) {
  VectorXd fa = f(a), fb = f(b);
  for (int k = 0; k < halvings; ++k) {
    const double middle = 0.5 * (a + b);
    const VectorXd fm = f(middle);
    if ((fm - fa).norm() > (fb - fm).norm()) {
      b = middle;
      fb = fm;
    } else {
      a = middle;
      fa = fm;
    }
  }
  return (fb - fa).norm();
}

}  // namespace test
