// Bounds for cycles of any time; limits.hpp has the derivation.

#include <algorithm>
#include <cmath>

#include <sigmaik/limits.hpp>

#include "jerk_bound.hpp"
#include "jerk_stop.hpp"
#include "limits_window.hpp"
#include "numbers.hpp"

namespace sigmaik {

using detail::kInfinity;

bool LimitTracker::set_cycle(double h) noexcept {
  if (h == cycle_) return true;
  constexpr double kRounding = 1e-9;
  const double part = h / dt_;
  if (!(part >= kShortestCycle * (1.0 - kRounding) && part <= kLongestCycle * (1.0 + kRounding))) return false;
  scale_to(h);
  if (!uneven_ && h != dt_) {
    uneven_ = true;
    changing_ = ((1u << n_) - 1u) & ~static_cast<unsigned>(recovering_);
  }
  if (q_.size() != 0) update();
  return true;
}

void LimitTracker::scale_to(double h) noexcept {
  const double ratio = h / cycle_;
  cycle_ = h;
  per_dt_ = 1.0 / h;
  last_ /= ratio;
  for (std::size_t i = 0; i < kMaxJoints; ++i) {
    acceleration_[i] = most_acceleration_[i] * h;
    braking_[i] = most_braking_[i] * h;
    jerk_[i] = most_jerk_[i] * h * h;
    jerk_states_[i].change *= ratio;
    jerk_states_[i].slope *= ratio;
  }
}

// The largest v with v + v²/a ≤ room, without a difference of large numbers.
double LimitTracker::towards_unevenly(double room, double acceleration) const noexcept {
  return 2.0 * room / (1.0 + std::sqrt(1.0 + 4.0 * room / acceleration));
}

// A joint with a jerk limit whose stop was made for even cycles takes this stop's sample after dt, where the coming
// cycle is shorter, or a later sample, until the samples of even cycles from there end inside.
void LimitTracker::keep_even_stop(int i) noexcept {
  const auto at = static_cast<std::size_t>(i);
  JerkMemory& s = jerk_states_[at];
  const double v = v_[i], j = jerk_[at], brake = detail::braking(braking_[at]);
  const double above = room_above(i), below = room_below(i), even = dt_ * per_dt_, longest = kLongestCycle * even;
  // The way of the stop alone, whatever the coming cycle's time.
  if (detail::highest_way(v, s.slope, j, brake, longest) - v <= above &&
      detail::highest_way(-v, -s.slope, j, brake, longest) + v <= below) {
    changing_ &= ~(1u << i);
    return;
  }
  const auto way = [&](double next, double slope) {
    return next + even * detail::highest_way(next, slope * even, j * even * even, brake * even, 0.0) - even * next;
  };
  const detail::JerkStop stop(v, s.slope, j, brake);
  for (const double later : {0.0, 0.25, 0.5, 1.0}) {
    stop.sample(std::max(1.0, even) + later * even, s.next, s.next_slope);
    if (way(s.next, s.next_slope) <= above && way(-s.next, -s.next_slope) <= below) return;
  }
}

LimitTracker::Window LimitTracker::uneven_window(int i, bool& broken) noexcept {
  const auto at = static_cast<std::size_t>(i);
  const double v = v_[i], a = acceleration_[at], b = braking_[at], limit = velocity_[at];
  const double part = 0.5 * (1.0 + std::min(1.0, last_));
  const LimitKind kind = a < kInfinity ? LimitKind::Acceleration : LimitKind::None;
  const double above = room_above(i), below = room_below(i);
  const double highest = above < kInfinity ? towards(i, above) : kInfinity;
  const double lowest = below < kInfinity ? -towards(i, below) : -kInfinity;
  Window window{
      v >= 0.0 ? detail::slowest_after(v, a * part, b * part) : -detail::fastest_after(-v, a * part, b * part),
      v > 0.0 ? detail::fastest_after(v, a * part, b * part) : -detail::slowest_after(-v, a * part, b * part), kind,
      kind};
  const double slack = detail::kLimitTolerance * (a + (1.0 + std::abs(q_[i])) * per_dt_);
  broken = std::abs(v) > limit || highest < window.lower - slack || lowest > window.upper + slack;
  if ((changing_ >> i & 1u) != 0) {
    const double more = b * std::max(1.0, dt_ * per_dt_);            // what a cycle of dt takes
    const double brake = detail::braking(b), way = v * std::abs(v);  // Φ(v) ≤ room, whatever the coming cycle's time
    if (way <= brake * above && -way <= brake * below) changing_ &= ~(1u << i);
    if (highest < window.lower) window.lower = std::max(highest, v - more);
    if (lowest > window.upper) window.upper = std::min(lowest, v + more);
  }
  window.narrow(-limit, limit, LimitKind::Velocity);
  window.narrow(lowest, highest, LimitKind::Position);
  return window;
}

}  // namespace sigmaik
