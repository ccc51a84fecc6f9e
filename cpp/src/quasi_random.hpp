#pragma once
// Configurations spread evenly over an arm's joint ranges, the same on every machine.

#include <cmath>

#include <sigmaik/chain.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik::detail {

// Points of the additive recurrence with the generalised golden ratio φ, φ^{n+1} = φ + 1, within the joint limits, or
// within ±π where there are none.
class QuasiRandom {
 public:
  explicit QuasiRandom(const Chain& chain)
      : lower(chain.limits().lower.unaryExpr([](double x) { return std::isfinite(x) ? x : -M_PI; })),
        upper(chain.limits().upper.unaryExpr([](double x) { return std::isfinite(x) ? x : M_PI; })) {
    for (int i = 0; i < 60; ++i) phi_ = std::pow(1.0 + phi_, 1.0 / (chain.dof() + 1.0));
  }

  JointVector operator()(int sample) const {
    JointVector q(lower.size());
    for (int i = 0; i < q.size(); ++i) {
      q[i] = lower[i] + (upper[i] - lower[i]) * std::fmod(sample * std::pow(phi_, -(i + 1.0)), 1.0);
    }
    return q;
  }

  const JointVector lower, upper;

 private:
  double phi_ = 1.5;
};

}  // namespace sigmaik::detail
