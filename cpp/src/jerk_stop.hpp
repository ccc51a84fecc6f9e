#pragma once
// The fastest stop of a joint with a jerk limit, in closed form. Velocities are counted as they are, time in cycles.

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace sigmaik::detail {

// ⌊x⌋ for x ≥ 0. Above 1e15 the fractional part is irrelevant: the cast is skipped. (Without SSE4.1 std::floor is a
// call.)
inline double floor_of(double x) noexcept { return x < 1e15 ? static_cast<double>(static_cast<std::int64_t>(x)) : x; }

// The fastest stop from velocity v with slope a, |a| ≤ cap, under |v'| ≤ cap and |v''| ≤ j. The profile is mirrored so
// that it ends with a positive velocity that falls to 0, in three phases: v' falls to −p, stays there, rises to 0.
class JerkStop {
 public:
  JerkStop(double v, double a, double j, double cap) noexcept
      : sign_(j * v + 0.5 * a * std::abs(a) < 0.0 ? -1.0 : 1.0), v_(sign_ * v), a_(sign_ * a), j_(j) {
    p_ = std::max(-a_, std::min(cap, std::sqrt(std::max(0.0, j * v_ + 0.5 * a_ * a_))));
    const double per_j = 1.0 / j, ramp = p_ * per_j;
    falling_ = std::max(0.0, a_ * per_j + ramp);
    steady_ = falling_;
    if (p_ >= cap) steady_ += std::max(0.0, (v_ + (0.5 * a_ * a_ - p_ * p_) * per_j) / p_);
    end_ = steady_ + ramp;
  }

  // At rest.
  JerkStop() noexcept : JerkStop(0.0, 0.0, 1.0, 1.0) {}

  // Velocity and slope t cycles later. Each phase is evaluated from its nearer end, so that rounding stays small for
  // t ≤ 1.
  void sample(double t, double& v, double& a) const noexcept {
    if (t >= end_) {
      v = a = 0.0;
    } else if (t <= falling_) {
      v = sign_ * (v_ + t * (a_ - 0.5 * j_ * t));
      a = sign_ * (a_ - j_ * t);
    } else if (t <= steady_) {
      v = sign_ * (velocity_falling(falling_) - p_ * (t - falling_));
      a = sign_ * -p_;
    } else {
      const double left = end_ - t;
      v = sign_ * 0.5 * j_ * (left * left);
      a = sign_ * -j_ * left;
    }
  }

  // Σ_{i≥1} v(i): the stopping distance after the first sample [velocities × cycles].
  double distance() const noexcept { return travel(end_); }

  // The part of this sum of the samples i ≤ t.
  double travel(double t) const noexcept {
    const double n1 = floor_of(std::min(t, falling_)), n2 = floor_of(std::min(t, steady_));
    const double n3 = floor_of(std::min(t, end_));
    double sum = sum_falling(n1);
    if (n2 > n1) sum += (n2 - n1) * (velocity_falling(falling_) - p_ * (0.5 * (n1 + 1.0 + n2) - falling_));
    const double c = n3 - n2, f = end_ - n3;  // c samples, at f, f + 1, … before the end
    sum += 0.5 * j_ * c * (f * f + (c - 1.0) * (f + (2.0 * c - 1.0) * (1.0 / 6.0)));
    return sign_ * sum;
  }

  // [cycles] until rest.
  double end() const noexcept { return end_; }

  // Whether the motion turns round on the way.
  bool turns() const noexcept { return v_ < 0.0; }

  // The largest of 0 and the partial sums of v(i), i ≥ 1: the highest position on the way.
  double rise() const noexcept {
    if (sign_ > 0.0) return std::max(0.0, distance());
    if (v_ >= 0.0) return 0.0;
    return std::max(0.0, -sum_falling(floor_of(std::min(turn(), falling_))));
  }

  // ∫ v dt to the end of the stop, and the largest of 0 and ∫ v dt to any time.
  double integral() const noexcept {
    const double t = steady_ - falling_, left = end_ - steady_;
    const double steady = t * (velocity_falling(falling_) - 0.5 * p_ * t);
    return sign_ * (integral_falling(falling_) + steady + j_ * left * left * left * (1.0 / 6.0));
  }
  double highest_integral() const noexcept {
    if (sign_ > 0.0) return std::max(0.0, integral());
    return v_ >= 0.0 ? 0.0 : std::max(0.0, -integral_falling(std::min(turn(), falling_)));
  }

 private:
  // When a motion turns round that starts with v < 0: in the first phase.
  double turn() const noexcept { return -2.0 * v_ / (a_ + std::sqrt(std::max(0.0, a_ * a_ + 2.0 * j_ * v_))); }
  double integral_falling(double t) const noexcept { return t * (v_ + t * (0.5 * a_ - j_ * t * (1.0 / 6.0))); }
  double velocity_falling(double t) const noexcept { return v_ + t * (a_ - 0.5 * j_ * t); }
  double sum_falling(double n) const noexcept {
    return n * (v_ + 0.5 * (n + 1.0) * (a_ - j_ * (2.0 * n + 1.0) * (1.0 / 6.0)));
  }

  double sign_, v_, a_, j_, p_;
  double falling_, steady_, end_;  // when the phases end [cycles]
};

}  // namespace sigmaik::detail
