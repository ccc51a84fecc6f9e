#include <sigmaik/target_stream.hpp>

#include <algorithm>
#include <cmath>

#include "asked_pose.hpp"
#include "length.hpp"
#include "message.hpp"
#include "pose_motion.hpp"

namespace sigmaik {
namespace {

using detail::require;

constexpr double kFarthest = 1e9;  // [m]: differences of positions and their squares stay finite
constexpr double kSigmas = 4.0;    // standard deviations of the noise of two samples that do not count as motion

void check(const char* what, double value, bool zero_allowed) {
  require(std::isfinite(value) && (value > 0.0 || (zero_allowed && value == 0.0)), what, " = ", value,
          " must be finite and ", zero_allowed ? "at least" : "above", " 0");
}

void bound(Twist& twist, const TargetStreamOptions& options) noexcept {
  detail::shorten(twist.head<3>(), options.max_speed);
  detail::shorten(twist.tail<3>(), options.max_angular_speed);
}

}  // namespace

const char* to_string(StreamStatus status) noexcept {
  switch (status) {
    case StreamStatus::Tracking: return "tracking";
    case StreamStatus::Coasting: return "coasting";
    case StreamStatus::Stale: return "stale";
    case StreamStatus::Waiting: return "waiting";
  }
  return "?";
}

const char* to_string(SampleStatus status) noexcept {
  switch (status) {
    case SampleStatus::Accepted: return "accepted";
    case SampleStatus::Relocated: return "relocated";
    case SampleStatus::Outlier: return "outlier";
    case SampleStatus::OutOfOrder: return "out of order";
    case SampleStatus::Invalid: return "invalid";
    case SampleStatus::Ahead: return "ahead";
  }
  return "?";
}

TargetStream::TargetStream(const TargetStreamOptions& options) : options_(options) {
  check("max_speed", options.max_speed, false);
  check("max_angular_speed", options.max_angular_speed, false);
  check("smoothing", options.smoothing, true);
  check("latency", options.latency, true);
  check("horizon", options.horizon, true);
  check("timeout", options.timeout, false);
  require(options.timeout >= options.horizon, "timeout = ", options.timeout, " s must be at least the horizon, ",
          options.horizon, " s");
  check("noise_linear", options.noise_linear, false);
  check("noise_angular", options.noise_angular, false);
  check("acceleration_linear", options.acceleration_linear, false);
  check("acceleration_angular", options.acceleration_angular, false);
  require(options.relocate >= 1, "relocate = ", options.relocate, " must be at least 1");
}

void TargetStream::reset() noexcept {
  counts_ = {};
  count_ = candidates_ = 0;
  shift_ = period_ = 0.0;
  stepped_ = other_clock_ = called_ = false;
  last_ = {};
  placed_ = timed_ = false;
}

void TargetStream::reset(const Pose& start) {
  require(is_pose(start.matrix()), "start is not a pose");
  reset();
  last_.pose = nearest_pose(start);
  placed_ = true;
}

// Samples ------------------------------------------------------------------------------------------------------------

bool TargetStream::reachable(const Sample& from, const Sample& to) const noexcept {
  const Twist way = pose_error(from.pose, to.pose);
  const double seconds = to.time - from.time, noise = kSigmas * std::sqrt(2.0);
  return detail::length(way.head<3>()) <= options_.max_speed * seconds + noise * options_.noise_linear &&
         detail::length(way.tail<3>()) <= options_.max_angular_speed * seconds + noise * options_.noise_angular;
}

SampleStatus TargetStream::push(double time, const Pose& pose) noexcept {
  const detail::AskedPose read(pose);
  if (!std::isfinite(time) || !read.valid || pose.translation().cwiseAbs().maxCoeff() > kFarthest) {
    ++counts_.invalid;
    return SampleStatus::Invalid;
  }
  Sample next;
  next.time = time - shift_;
  next.pose = read.pose;
  if (read.rough) ++counts_.rough;

  if (of_another_clock(next.time)) {
    const bool ahead = next.time > time_;
    ++(ahead ? counts_.ahead : counts_.out_of_order);
    return refuse(next, ahead ? SampleStatus::Ahead : SampleStatus::OutOfOrder, time);
  }
  if (count_ == 0) {
    candidates_ = 0;
    stepped_ = false;
    start(next);
    ++counts_.accepted;
    return SampleStatus::Accepted;
  }
  const Sample& newest = sample(count_ - 1);
  if (next.time > newest.time && reachable(newest, next)) {
    candidates_ = 0;
    stepped_ = false;
    ++counts_.accepted;
    if (next.time - newest.time > options_.timeout) {  // samples before a gap do not predict the motion after the gap
      start(next);
    } else {
      if (options_.mode == StreamMode::Predict) correct(next);
      extend(next);
    }
    return SampleStatus::Accepted;
  }
  const SampleStatus refused = next.time > newest.time ? SampleStatus::Outlier : SampleStatus::OutOfOrder;
  ++(refused == SampleStatus::Outlier ? counts_.outliers : counts_.out_of_order);
  if (next.time == newest.time) return refused;  // a repeated sample is no evidence of a new place
  return refuse(next, refused, time);
}

void TargetStream::start(const Sample& next) noexcept {
  called_ = false;
  first_ = 0;
  count_ = 1;
  history_[0] = next;
  estimate_ = {next.pose, Twist::Zero(), Twist::Zero()};
  const auto unknown = [](double noise, double speed) { return Covariance{noise * noise, 0.0, 0.25 * speed * speed}; };
  linear_ = unknown(options_.noise_linear, options_.max_speed);
  angular_ = unknown(options_.noise_angular, options_.max_angular_speed);
}

void TargetStream::extend(const Sample& next) noexcept {
  called_ = false;
  int at = 0;
  if (options_.mode == StreamMode::Interpolate) {
    // Decimate a fast sensor so that the ring still covers `latency`; always keep the newest sample.
    const double least = std::max(options_.latency / (0.75 * kHistory), detail::kShortest);
    at = count_ >= 2 && sample(count_ - 1).time - sample(count_ - 2).time < least ? count_ - 1 : count_;
    if (at == kHistory) {
      first_ = (first_ + 1) % kHistory;
      --at;
    }
  }
  history_[static_cast<std::size_t>((first_ + at) % kHistory)] = next;
  count_ = at + 1;
}

void TargetStream::correct(const Sample& next) noexcept {
  const double dt = next.time - sample(count_ - 1).time;
  Twist& twist = estimate_.twist;
  Pose ahead;
  ahead.translation() = estimate_.pose.translation() + dt * twist.head<3>();
  ahead.linear() = rotation_exp(dt * twist.tail<3>()) * estimate_.pose.linear();
  const Twist innovation = pose_error(ahead, next.pose);

  // Prediction with the process noise Q = a² [dt⁴/4 dt³/2; dt³/2 dt²] of an acceleration that is constant in dt, then
  // the Kalman gains of place and velocity.
  const auto gains = [dt](Covariance& p, double noise, double acceleration) {
    const double a = acceleration * dt;
    p.place += dt * (2.0 * p.cross + dt * p.velocity) + 0.25 * a * a * dt * dt;
    p.cross += dt * p.velocity + 0.5 * a * a * dt;
    p.velocity += a * a;
    const double s = p.place + noise * noise;
    const Eigen::Vector2d k(p.place / s, p.cross / s);
    p.velocity -= k[1] * p.cross;
    p.cross *= noise * noise / s;
    p.place *= noise * noise / s;
    return k;
  };
  const Eigen::Vector2d k = gains(linear_, options_.noise_linear, options_.acceleration_linear);
  const Eigen::Vector2d h = gains(angular_, options_.noise_angular, options_.acceleration_angular);
  estimate_.pose.translation() = ahead.translation() + k[0] * innovation.head<3>();
  estimate_.pose.linear() = nearest_rotation(rotation_exp(h[0] * innovation.tail<3>()) * ahead.linear());
  twist.head<3>() += k[1] * innovation.head<3>();
  twist.tail<3>() += h[1] * innovation.tail<3>();
  bound(twist, options_);
}

// Motion -------------------------------------------------------------------------------------------------------------

// The motion at sample i: that of the parabola through sample i and its two neighbours. The motion leaves the first
// sample from rest, and goes on from the newest one with the mean twist of the last two.
TargetStream::Motion TargetStream::knot(int i) const noexcept {
  Motion out;
  out.pose = sample(i).pose;
  if (i == 0) return out;
  const auto mean = [this](int from) {
    const Sample &a = sample(from), &b = sample(from + 1);
    const double dt = b.time - a.time;
    Twist way = pose_error(a.pose, b.pose);
    detail::shorten(way.head<3>(), options_.max_speed * dt);
    detail::shorten(way.tail<3>(), options_.max_angular_speed * dt);
    return Twist(way / dt);
  };
  out.twist = mean(i - 1);
  if (i + 1 < count_) {
    const double before = sample(i).time - sample(i - 1).time, after = sample(i + 1).time - sample(i).time;
    const Twist ahead = mean(i);
    out.acceleration = 2.0 / (before + after) * (ahead - out.twist);
    out.twist = (after * out.twist + before * ahead) / (before + after);
  }
  return out;
}

// Extrapolates a motion: with its twist up to `horizon`, then slower, to rest at `timeout`.
TargetStream::Motion TargetStream::coast(const Motion& from, double seconds) const noexcept {
  const double fade = options_.timeout - options_.horizon;
  double moved = seconds, rate = 1.0, slope = 0.0;
  if (moved < -options_.timeout) {
    moved = -options_.timeout;
    rate = 0.0;
  } else if (moved > options_.horizon) {
    // The speed fades as 1 − 3u² + 2u³.
    const double u = fade > 0.0 ? std::min(1.0, (moved - options_.horizon) / fade) : 1.0;
    moved = options_.horizon + fade * u * (1.0 + u * u * (0.5 * u - 1.0));
    rate = 1.0 + u * u * (2.0 * u - 3.0);
    slope = fade > 0.0 ? 6.0 * u * (u - 1.0) / fade : 0.0;
  }
  Motion out;
  out.pose.translation() = from.pose.translation() + moved * from.twist.head<3>();
  out.pose.linear() = rotation_exp(moved * from.twist.tail<3>()) * from.pose.linear();
  out.twist = rate * from.twist;
  out.acceleration = slope * from.twist;
  return out;
}

TargetStream::Motion TargetStream::motion(double time) const noexcept {
  const Sample& newest = sample(count_ - 1);
  if (options_.mode == StreamMode::Hold) return {newest.pose, Twist::Zero(), Twist::Zero()};
  if (options_.mode == StreamMode::Predict) return coast(estimate_, time - newest.time);

  const double play = time - options_.latency;
  if (play >= newest.time) return coast(knot(count_ - 1), play - newest.time);
  int i = count_ - 2;
  while (i >= 0 && sample(i).time > play) --i;
  if (i < 0) return {sample(0).pose, Twist::Zero(), Twist::Zero()};
  const double dt = sample(i + 1).time - sample(i).time, u = (play - sample(i).time) / dt;
  if (dt < detail::kShortest) return knot(i);
  return detail::between(knot(i), knot(i + 1), dt, u);
}

StreamStatus TargetStream::status(double time) const noexcept {
  const bool late = options_.mode == StreamMode::Interpolate;
  const double without = time - sample(count_ - 1).time - (late ? options_.latency : 0.0);
  if (without >= options_.timeout) return StreamStatus::Stale;
  return without > options_.horizon ? StreamStatus::Coasting : StreamStatus::Tracking;
}

// Output -------------------------------------------------------------------------------------------------------------

Target TargetStream::at(double time) noexcept {
  constexpr double kReading = 5e-3;  // [s] two threads may read the clock in turn
  constexpr double kSlowest = 1.0;   // [s] a loop may be as slow, and a second step is seen
  if (!std::isfinite(time)) {
    Target held = last_;
    held.twist.setZero();
    if (held.status != StreamStatus::Waiting) held.status = StreamStatus::Stale;
    return held;
  }
  if (timed_ && time < time_ && time >= time_ - kReading) return last_;
  if (step_of_clock(time)) {
    if (count_ > 0 && !placed_) place(motion(time));
    if (count_ > 0) last_.status = StreamStatus::Stale;
    hold_still();
    if (count_ > 0) last_.age = std::max(0.0, time - sample(count_ - 1).time);
    period_ = timed_ ? std::clamp(time - time_, 0.0, kSlowest) : 0.0;
    time_ = time;
    timed_ = true;
    return last_;
  }
  const double dt = timed_ ? time - time_ : 0.0;
  called_ = true;
  period_ = dt;
  if (count_ == 0 && placed_ && last_.status == StreamStatus::Stale) last_.age += dt;
  if (count_ > 0) {
    last_.status = status(time);
    last_.age = std::max(0.0, time - sample(count_ - 1).time);
    if (!placed_) {
      place(motion(time));
    } else if (dt > 0.0) {
      approach(motion(time_), motion(time), dt);
    }
  }
  time_ = time;
  timed_ = true;
  return last_;
}

void TargetStream::place(const Motion& now) noexcept {
  last_.pose = now.pose;
  last_.twist = now.twist;
  bound(last_.twist, options_);
  acceleration_.setZero();
  placed_ = true;
}

void TargetStream::approach(const Motion& then, const Motion& now, double dt) noexcept {
  Motion target{last_.pose, last_.twist, acceleration_};
  detail::follow(then, now, dt, {options_.max_speed, options_.max_angular_speed, options_.smoothing}, target);
  last_.pose = target.pose;
  last_.twist = target.twist;
  acceleration_ = target.acceleration;
}

}  // namespace sigmaik
