#pragma once
// The least time in which one joint comes to rest, in closed form.

#include <cmath>

namespace test {

/// From velocity v and acceleration a, under |v'| ≤ most and |v''| ≤ jerk, to neither.
inline double stopping_time(double v, double a, double most, double jerk) {
  if (v < 0.0 || (v == 0.0 && a < 0.0)) return stopping_time(-v, -a, most, jerk);
  const auto from_constant_speed = [&](double speed) {
    return speed <= most * most / jerk ? 2.0 * std::sqrt(speed / jerk) : speed / most + most / jerk;
  };
  const double w = v + a * std::abs(a) / (2.0 * jerk);  // velocity where the acceleration is gone
  if (a >= 0.0) return a / jerk + from_constant_speed(w);
  if (w < 0.0) return -a / jerk + from_constant_speed(-w);          // brakes too hard to stop at once
  return from_constant_speed(v + a * a / (2.0 * jerk)) + a / jerk;  // a braking that has begun
}

}  // namespace test
