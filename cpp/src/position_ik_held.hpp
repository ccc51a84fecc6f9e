#pragma once
// The nearest pose to one that is out of reach, where some rows are held before the others.

#include <array>

#include "position_ik_model.hpp"

namespace sigmaik::detail {

// Starts from the points with the smallest E of those that were added. No heap.
class HeldSearch {
 public:
  void add(const DescentPoint& point) noexcept;

  // The point that meets the rows that are held, or else comes nearest to these, and then is nearest in the others. If
  // no start leads to a point that meets them, these rows are searched alone. Bounded; at least one point was added.
  DescentPoint nearest(const PositionIk::Model& model, const Descent& descent) const noexcept;

 private:
  static void settle(const PositionIk::Model& model, const Descent& descent, DescentPoint& point) noexcept;

  static constexpr std::size_t kMost = 6;
  std::array<JointVector, kMost> q_;
  std::array<double, kMost> costs_{};
  std::size_t count_ = 0;
};

}  // namespace sigmaik::detail
