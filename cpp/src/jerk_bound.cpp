#include "jerk_bound.hpp"

#include <cmath>

#include "bracket.hpp"
#include "jerk_stop.hpp"
#include "numbers.hpp"
#include "work.hpp"

namespace sigmaik::detail {
namespace {

constexpr int kMostEvaluations = 16;

double square(double x) noexcept { return x * x; }

// Almost the largest x in [a, b] with f(x) ≤ 0, and never a larger one, for an increasing f with f(a) = fa ≤ 0 and fb =
// f(b).
template <typename Function>
double largest_below_zero(double a, double fa, double b, double fb, Function f) noexcept {
  const double tolerance = kLimitTolerance * (b - a);
  if (fb <= 0.0) return b;
  Bracket bracket{a, fa, b, fb};
  for (int k = 0; k < kMostEvaluations && bracket.width() > tolerance; ++k) {
    const double x = bracket.inside(bracket.root());
    bracket.take(x, f(x));
    count_work(&Work::evaluations, 1);
  }
  return bracket.a;
}

// Acceleration and jerk first, then velocity, then position: each limit lowers the bound that the limits before it
// leave.
class Upper {
 public:
  explicit Upper(const JerkState& state) noexcept : s_(state) {}

  JerkBound find() noexcept {
    reach_of_the_motor();
    if (peak(out_.bound, slope_at(out_.bound)) > s_.velocity) hold_velocity();
    if (s_.room < kInfinity && !far_from_position_limit()) hold_position();
    return out_;
  }

 private:
  double slope_at(double v) const noexcept { return slope_of(v, s_.v, s_.next, s_.next_slope, s_.jerk); }

  // The highest velocity of a stop that starts with velocity v and this slope.
  double peak(double v, double slope) const noexcept { return v + square(std::max(0.0, slope)) / (2.0 * s_.jerk); }

  // How far a stop after velocity v overshoots the position limit on the way (overshoot), and at its end (end).
  double overshoot(double v) const noexcept {
    return highest_way(v, slope_at(v), s_.jerk, s_.braking, s_.longest) - s_.room;
  }
  double end(double v) const noexcept {
    const JerkStop stop(v, slope_at(v), s_.jerk, s_.braking);
    return v + (s_.longest > 0.0 ? stop.integral() : stop.distance()) - s_.room;
  }

  // The next sample of the fastest way to the steady velocity v, with the best slope that the jerk limit allows.
  double settling(double v) const noexcept {
    const double j = s_.jerk, cap = s_.settling;
    const double excess = s_.v - v, slope = std::copysign(std::sqrt(2.0 * j * std::abs(excess)), -excess);
    const double half = 0.5 * j * s_.last;  // the slope is of the time between the last cycle and the coming one
    const double steepest = std::max(-cap, s_.change - half), flattest = std::min(cap, s_.change + half);
    double next, next_slope;
    JerkStop(excess, std::max(steepest, std::min(flattest, slope)), j, cap).sample(1.0, next, next_slope);
    return v + next;
  }

  void reach_of_the_motor() noexcept {
    const double by_change = s_.change + s_.jerk * (0.5 + 0.5 * s_.last);
    const bool by_jerk = by_change < s_.acceleration;
    const double bound = std::max(s_.next, s_.v + (by_jerk ? by_change : s_.acceleration));
    out_ = {bound, bound, by_jerk ? LimitKind::Jerk : LimitKind::Acceleration, false};
  }

  void hold_velocity() noexcept {
    const double j = s_.jerk, next_peak = peak(s_.next, s_.next_slope);
    double v;
    if (next_peak <= s_.velocity) {
      v = s_.velocity - square(std::max(0.0, s_.next_slope)) / (2.0 * j);
      if (slope_at(v) > s_.next_slope) {
        // peak(v, slope) = V with v = v_k + slope + j/2
        const double slope = std::sqrt(2.0 * j * std::max(0.0, s_.velocity - s_.v)) - j;
        v = slope > 0.0 ? std::min(s_.velocity, s_.v + slope + 0.5 * j) : s_.velocity;
      }
    } else {
      v = settling(s_.velocity);
      out_.broken = next_peak > s_.velocity * (1.0 + kLimitTolerance);
    }
    out_.safe = out_.bound = std::clamp(v, s_.next, out_.bound);
    out_.kind = LimitKind::Velocity;
  }

  // A cheap test that usually suffices: from its peak v a stop takes no longer than v / A + A / j, at a mean velocity
  // of v/2.
  bool far_from_position_limit() const noexcept {
    const double j = s_.jerk, braking = s_.braking;
    const double slope = std::max(0.0, slope_at(out_.bound)), fast = out_.bound + 0.5 * slope * slope / j;
    if (fast <= 0.0) return s_.room >= 0.0;
    const double rising = s_.longest * 0.5 * slope * slope / j;
    return out_.bound + rising + fast * (1.0 + slope / j + 0.5 * (fast / braking + braking / j)) <= s_.room;
  }

  void hold_position() noexcept {
    const double beyond = overshoot(out_.bound);
    if (beyond <= 0.0) return;
    out_.kind = LimitKind::Position;
    const double next_beyond = highest_way(s_.next, s_.next_slope, s_.jerk, s_.braking, s_.longest) - s_.room;
    if (next_beyond <= 0.0) {
      stop_inside(beyond, next_beyond);
    } else {
      come_back(next_beyond);
    }
  }

  // The fastest velocity between the next sample of the stop and the bound from which a stop stays inside.
  void stop_inside(double beyond, double next_beyond) noexcept {
    const auto f = [this](double v) { return overshoot(v); };
    const double most = s_.room;  // the first sample alone would reach the limit
    out_.safe = out_.bound = most < out_.bound ? largest_below_zero(s_.next, next_beyond, most, overshoot(most), f)
                                               : largest_below_zero(s_.next, next_beyond, out_.bound, beyond, f);
  }

  // The joint will be outside: it comes back with the recovery speed until a stop ends on the limit or inside.
  void come_back(double next_beyond) noexcept {
    out_.safe = out_.bound = s_.next;
    out_.broken = out_.broken || next_beyond > s_.slack;
    const double next_end = end(s_.next);
    if (next_end <= 0.0) return;
    const double back = std::min(s_.next, settling(-s_.recovery));
    const double back_end = end(back);
    out_.bound = back_end < 0.0 ? largest_below_zero(
                                      back, back_end, s_.next, next_end, [this](double v) { return end(v); })
                                : back;
  }

  const JerkState& s_;
  JerkBound out_{};
};

}  // namespace

double highest_way(double v, double slope, double jerk, double braking, double longest) noexcept {
  const JerkStop stop(v, slope, jerk, braking);
  if (!(longest > 0.0)) return v + stop.rise();
  return v + stop.highest_integral() + longest * square(std::max(0.0, slope)) / (2.0 * jerk);
}

JerkBound upper_bound(const JerkState& state) noexcept { return Upper(state).find(); }

}  // namespace sigmaik::detail
