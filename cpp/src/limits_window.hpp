#pragma once
// The window of one joint: shared by the windows of even cycles and of cycles of any time.

#include <algorithm>

#include <sigmaik/limits.hpp>

namespace sigmaik {

// The velocities that one joint may choose, and the limits that form the ends.
struct LimitTracker::Window {
  double lower, upper;
  LimitKind lower_kind, upper_kind;

  // Narrows the window to [low, high], low ≤ high. Where the two do not intersect, the end nearest to [low, high] is
  // left: each limit gives way to the limits before it.
  void narrow(double low, double high, LimitKind kind) noexcept {
    if (high < upper) {
      upper = std::max(high, lower);
      upper_kind = kind;
    }
    if (low > lower) {
      lower = std::min(low, upper);
      lower_kind = kind;
    }
  }
};

namespace detail {

// Relative reserve of the planned deceleration: the plan can then make up for rounding on the way.
inline constexpr double kBrakingReserve = 1e-10;
inline double braking(double acceleration) noexcept { return acceleration * (1.0 - kBrakingReserve); }

// The lowest velocity after v ≥ 0 in a cycle; a = A dt, b = B dt. Across zero the smaller limit holds.
inline double slowest_after(double v, double a, double b) noexcept {
  return std::max(v - b, std::min(0.0, v - std::min(a, b)));
}

// The highest velocity after v ≥ 0 in a cycle: at zero the change is the same as that of slowest_after().
inline double fastest_after(double v, double a, double b) noexcept { return v + (b >= a ? a : std::min(a, b + v)); }

}  // namespace detail
}  // namespace sigmaik
