#pragma once
// The limits that a servo's or a constrained IK's options ask for.

#include <sigmaik/limits.hpp>

namespace sigmaik::detail {

template <typename Options>
LimitOptions limit_options(const Options& options) {
  LimitOptions out;
  out.dt = options.dt;
  out.position = options.position_limits;
  out.velocity = options.velocity_limits;
  out.acceleration = options.acceleration_limits;
  out.jerk = options.jerk_limits;
  out.recovery_speed = options.recovery_speed;
  return out;
}

}  // namespace sigmaik::detail
