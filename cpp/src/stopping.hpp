#pragma once
// The speed from which a motion can stop in time, with the reserve of LimitTracker::arrival().

#include <cmath>

#include "numbers.hpp"

namespace sigmaik::detail {

// The velocity from which a joint can stop within d, under |v'| ≤ a and |v''| ≤ j, from no acceleration to none: D⁻¹ of
// LimitTracker::arrival(). In velocities and cycles.
inline double speed_before(double d, double a, double j) noexcept {
  if (!(j < kInfinity)) return a < kInfinity ? std::sqrt(2.0 * a * d) : kInfinity;
  const double corner = a * a / j;
  if (d * d * j <= corner * corner * corner) return std::cbrt(d * d * j);
  return std::sqrt(0.25 * corner * corner + 2.0 * a * d) - 0.5 * corner;
}

// Parts of the acceleration and jerk limits that the plan of an arrival uses.
inline constexpr double kArrivalAcceleration = 0.5, kArrivalJerk = 0.125;

}  // namespace sigmaik::detail
