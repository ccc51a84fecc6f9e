#pragma once
// The side of the elbow that a guided servo keeps.

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
// leaves less than half as much on one side, an arm that folds to this short side stops at the limit, still stretched.
struct Elbow {
  // [rad] to `straight`: a servo keeps this far off, where the sign of the elbow's part of the Jacobian is certain. A
  // reach of 1 m with equal links becomes 0.3 mm shorter.
  static constexpr double kMargin = 0.05;

  int joint;        // 0 to n − 1
  double straight;  // [rad]
  int longer;       // 1: angles above `straight`, −1: below; 0: the two sides are alike

  // The side that is kept, 1 or −1; 0: none. An elbow whose sides are alike and that is straight, but for rounding,
  // has none.
  int side(double q) const noexcept {
    const double open = q - straight;
    if (longer != 0) return longer * open >= 0.0 ? longer : 0;
    return open >= 0.5 * kMargin ? 1 : open <= -0.5 * kMargin ? -1 : 0;
  }

  // None where the arm has no such joint, where its elbow can turn round, and where the sides are alike and a
  // self-motion leads from one to the other: to keep a side, such an arm would turn its upper arm fast near the
  // straight elbow.
  static std::unique_ptr<Elbow> of(const Chain& chain);
};

}  // namespace sigmaik::detail
