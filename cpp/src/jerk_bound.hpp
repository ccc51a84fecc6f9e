#pragma once
// The bound on the next velocity of a joint with a jerk limit: after this velocity the joint can still stop inside all
// limits. limits.hpp says why such a bound always exists.

#include <algorithm>

#include <sigmaik/limits.hpp>

namespace sigmaik::detail {

inline constexpr double kLimitTolerance = 1e-9;  // relative: a smaller excess over a limit is rounding

// A joint with a jerk limit. Its mirror image (all signs turned) gives the lower bound.
struct JerkState {
  double v, change;         // velocity, and its change in the last cycle
  double next, next_slope;  // next sample of the stop that is kept, and its slope there
  double room;              // to the upper position limit [velocities × cycles]
  double slack;             // of the room: a smaller excess is rounding
  double velocity, acceleration, braking, jerk, recovery;
  double settling;       // the slope limit of a way to a steady velocity
  double last = 1.0;     // the time of the last cycle [cycles]
  double longest = 0.0;  // that of the longest cycle to come, where cycles are not even; 0: all cycles are even
};

struct JerkBound {
  double safe;   // a higher velocity breaks a limit, or breaks it more
  double bound;  // lower than `safe` where the joint must come back
  LimitKind kind;
  bool broken;
};

JerkBound upper_bound(const JerkState& state) noexcept;

// The highest position, from now on, of a cycle with the velocity v and the stop after it, whose slope is given. Where
// cycles are not even: for any times of the cycles after it up to `longest`, see limits.hpp.
double highest_way(double v, double slope, double jerk, double braking, double longest) noexcept;

// The line of choices (limits.hpp): the slope with which v is chosen after v_k. The line goes through the next sample
// of the stop that is kept, else as near to this sample as |slope − (v − v_k)| ≤ j/2 allows, which makes stopping as
// easy as possible. The slope is computed from the difference to this sample, because v − v_k is rounded.
inline double slope_of(double v, double v_k, double next, double next_slope, double j) noexcept {
  const double change = next - v_k - next_slope;
  return v >= next ? next_slope + std::max(0.0, v - next + std::min(0.0, change - 0.5 * j))
                   : next_slope + std::min(0.0, v - next + std::max(0.0, change + 0.5 * j));
}

}  // namespace sigmaik::detail
