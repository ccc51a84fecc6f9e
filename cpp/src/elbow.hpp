#pragma once
// The side of the elbow from which an arm can come back.

#include <memory>

#include <sigmaik/chain.hpp>

namespace sigmaik::detail {

// The elbow: the joint that changes the reach, the distance |SW| from the shoulder S to the wrist W. Each of S and W
// is a point where the two joint axes on its side of the elbow meet, or an axis parallel to the elbow's, so that |SW|
// depends on the elbow alone:
//
//     |SW|² = const + 2 ρ_S ρ_W cos(q − straight),
//
// with the distances ρ of S and W from the elbow's axis. The arm is straight, singular, at the angle `straight`. On
// either side the same reaches are taken, the elbow mirrored, as far as the joint's range goes. Where a position limit
// cuts the range shortly beyond `straight`, an arm that folds to the short side stops at this limit, still stretched.
struct Elbow {
  // [rad] to `straight`: a servo keeps this far off, where the sign of the elbow's part of the Jacobian is certain. A
  // reach of 1 m with equal links becomes 0.3 mm shorter.
  static constexpr double kMargin = 0.05;

  int joint;        // 0 to n − 1
  double straight;  // [rad]
  bool above;       // the long side: angles above `straight`

  // [rad] from `straight` to the joint's position, positive on the long side.
  double open(double q) const noexcept { return above ? q - straight : straight - q; }

  // [rad/s] the same of the joint's velocity.
  double open_rate(double qdot) const noexcept { return above ? qdot : -qdot; }

  // The elbow of an arm whose short side is less than half of the long one; none of another arm.
  static std::unique_ptr<Elbow> with_short_side(const Chain& chain);
};

}  // namespace sigmaik::detail
