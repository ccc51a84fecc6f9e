#pragma once
// Distinct solutions of position_ik.hpp, and the way along a self-motion from a solution to a better one.

#include <array>
#include <cmath>

#include "position_ik_descent.hpp"

namespace sigmaik::detail {

// Solutions that differ by more than a distance in a joint, whole turns aside. Bounded, no heap.
class Branches {
 public:
  static constexpr int kMost = 64;

  Branches(const DescentProblem& problem, double apart) noexcept : problem_(problem), apart_(apart) {}

  // Takes a solution that is not there yet, while there is room. `better`: it replaces one that is there.
  void add(const JointVector& q, bool better = false) noexcept {
    for (JointVector& other : *this) {
      const JointVector d = problem_.difference(q, other);
      if ((d.array().square() <= apart_ * apart_ * problem_.reach.array()).all()) {
        if (better) other = q;
        return;
      }
    }
    if (count_ == kMost) return;
    solutions_[static_cast<std::size_t>(count_++)] = q;
  }

  int count() const noexcept { return count_; }
  JointVector* begin() noexcept { return solutions_.data(); }
  JointVector* end() noexcept { return solutions_.data() + count_; }

 private:
  const DescentProblem& problem_;
  double apart_;
  int count_ = 0;
  std::array<JointVector, kMost> solutions_;
};

// Where a self-motion goes: to the least distance from `to`, with `unit` of each joint as the measure.
struct Pull {
  const JointVector& to;
  const JointVector& unit;
  bool largest;     // the distance is the largest joint's, as a travel time; otherwise the root of the sum of squares
  double progress;  // a step that takes less than this part of the distance away is none
  int steps;        // at most

  double distance(const JointVector& d) const noexcept {
    const auto parts = d.cwiseQuotient(unit).cwiseAbs();
    return largest ? parts.maxCoeff() : parts.norm();
  }
};

// Moves a solution along the self-motion to a local minimum of the distance. Every point on the way is a solution.
void pull(const Descent& search, const Pull& aim, DescentPoint& point) noexcept;

}  // namespace sigmaik::detail
