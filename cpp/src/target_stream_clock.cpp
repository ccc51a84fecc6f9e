// Clocks that step, and samples that do not fit; target_stream.hpp has the rules.

#include <algorithm>
#include <cmath>

#include <sigmaik/target_stream.hpp>

namespace sigmaik {

// Refuses a sample, unless so many agree with it that the target is at another place, or the stamps of another clock.
SampleStatus TargetStream::refuse(const Sample& next, SampleStatus why, double stamp) noexcept {
  const bool clock = of_another_clock(next.time);
  bool agrees = candidates_ > 0 && next.time > candidate_.time && reachable(candidate_, next) && clock == other_clock_;
  if (clock && agrees) agrees = next.time - candidate_.time <= options_.timeout && keeps_pace(next.time);
  candidates_ = agrees ? candidates_ + 1 : 1;
  candidate_ = next;
  other_clock_ = clock;
  if (candidates_ == 1) {
    first_stamp_ = next.time;
    first_clock_ = time_;
  }
  const bool long_enough = candidates_ >= 3 || (candidates_ == 2 && next.time - first_stamp_ >= 0.5 * options_.timeout);
  if (clock ? !long_enough : candidates_ < options_.relocate) return why;
  candidates_ = 0;
  other_clock_ = false;
  Sample accepted = next;
  if (clock) {
    shift_ = std::abs(stamp - time_) <= options_.timeout ? 0.0 : stamp - time_;
    accepted.time = stamp - shift_;
    stepped_ = false;
    ++counts_.clock_steps;
  }
  start(accepted);
  ++counts_.accepted;
  ++counts_.relocated;
  return SampleStatus::Relocated;
}

// Whether a stamp is so far from the clock of at() that this clock or that of the stamps has stepped. A stamp that is
// late without a step is that of a late sample.
bool TargetStream::of_another_clock(double time) const noexcept {
  if (!timed_) return false;
  const double newest = count_ > 0 ? sample(count_ - 1).time : 0.0, far = options_.timeout;
  // at() may have paused while samples came.
  if (time > time_ + far) return called_ || count_ == 0 || time > newest + far || (other_clock_ && candidates_ > 0);
  if (time >= time_ - far) return false;
  const bool set_right = shift_ != 0.0 && std::abs(time + shift_ - time_) <= far;
  return stepped_ || set_right || (count_ > 0 && time < newest - far) || (other_clock_ && candidates_ > 0);
}

// Whether the candidates are as far apart as the calls of at(): a burst of old samples is not.
bool TargetStream::keeps_pace(double time) const noexcept {
  constexpr double kReading = 5e-3;  // [s] from the last call of at() to a sample
  const double stamps = time - first_stamp_, clock = time_ - first_clock_;
  return std::abs(stamps - clock) <= 0.5 * stamps + kReading + period_;
}

// Whether a clock has stepped, see the header. What belongs to the old clock is forgotten.
bool TargetStream::step_of_clock(double time) noexcept {
  const double newest = count_ > 0 ? sample(count_ - 1).time : time;
  const bool back = timed_ && time < time_;
  const bool forth = timed_ && time - time_ > std::max(options_.timeout, 4.0 * period_);
  const bool future = newest > time + options_.timeout;
  if (!back && !forth && !future) return false;
  if (future || (back && newest > time)) count_ = candidates_ = 0;
  if (back) candidates_ = 0;
  stepped_ = forth;
  ++counts_.clock_steps;
  return true;
}

// The target stops where it is.
void TargetStream::hold_still() noexcept {
  last_.twist.setZero();
  acceleration_.setZero();
  if (last_.status != StreamStatus::Waiting) last_.status = StreamStatus::Stale;
}

}  // namespace sigmaik
