#pragma once
// Configurations of a chain: random ones, and whether one is inside the position limits.

#include <cmath>
#include <numbers>

#include <sigmaik/chain.hpp>

#include "random.hpp"

namespace test {

inline bool inside(const sigmaik::Chain& chain, const sigmaik::JointVector& q) {
  return (q.array() >= chain.limits().lower.array()).all() && (q.array() <= chain.limits().upper.array()).all();
}

/// Evenly inside the limits, within ±π where there is none.
inline sigmaik::JointVector sample(Random& random, const sigmaik::Chain& chain) {
  sigmaik::JointVector q(chain.dof());
  for (int i = 0; i < q.size(); ++i) {
    const double lower = chain.limits().lower[i], upper = chain.limits().upper[i];
    q[i] = random.uniform(std::isfinite(lower) ? lower : -std::numbers::pi,
                          std::isfinite(upper) ? upper : std::numbers::pi);
  }
  return q;
}

}  // namespace test
