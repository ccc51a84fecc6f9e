#pragma once
// Starts and targets of the tests of arrival, and what at rest means.

#include <algorithm>
#include <cmath>
#include <numbers>

#include <sigmaik/chain.hpp>

#include "random.hpp"

namespace test {

/// Uniform in `part` of the joints' ranges; continuous joints have a turn.
inline sigmaik::JointVector start_of(Random& random, const sigmaik::Chain& chain, double part) {
  sigmaik::JointVector q(chain.dof());
  for (int i = 0; i < chain.dof(); ++i) {
    const bool limited = std::isfinite(chain.limits().upper[i]);
    const double lower = limited ? chain.limits().lower[i] : -std::numbers::pi;
    const double upper = limited ? chain.limits().upper[i] : std::numbers::pi;
    q[i] = 0.5 * (lower + upper) + part * random.uniform(-0.5, 0.5) * (upper - lower);
  }
  return q;
}

/// A configuration inside the limits, each joint at most `size` from q.
inline sigmaik::JointVector near(Random& random, const sigmaik::Chain& chain, const sigmaik::JointVector& q,
                                 double size) {
  sigmaik::JointVector goal(chain.dof());
  for (int i = 0; i < chain.dof(); ++i) {
    goal[i] = random.uniform(std::max(chain.limits().lower[i], q[i] - size),
                             std::min(chain.limits().upper[i], q[i] + size));
  }
  return goal;
}

/// Whether each joint is slower than a thousandth of its velocity limit, or of 1 rad/s or m/s.
inline bool at_rest(const sigmaik::Chain& chain, const sigmaik::JointVector& qdot) {
  for (int i = 0; i < chain.dof(); ++i) {
    const double limit = chain.limits().velocity[i];
    if (!(std::abs(qdot[i]) < 1e-3 * (std::isfinite(limit) ? limit : 1.0))) return false;
  }
  return true;
}

}  // namespace test
