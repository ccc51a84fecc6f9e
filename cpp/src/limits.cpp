#include <sigmaik/limits.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "finite.hpp"
#include "message.hpp"

namespace sigmaik {
namespace {

using detail::require;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Braking is planned this much weaker than it may be, so that it can make up for what rounding does on the way.
constexpr double kBrakingReserve = 1e-10;
constexpr double kTolerance = 1e-9;  // relative: what is beyond a limit by less is rounding
constexpr double kSnap = 1e-12;      // [1 + rad or m], and of positions as they add up
constexpr int kMostEvaluations = 16;

double square(double x) noexcept { return x * x; }

// Far beyond all the cycles there are it need not count them. (Without SSE4.1 std::floor is a call.)
double floor_of(double x) noexcept { return x < 1e15 ? static_cast<double>(static_cast<std::int64_t>(x)) : x; }

// D⁻¹(d) with d [velocities × cycles] ≥ 0 and a = A dt.
double fastest_before(double d, double a) noexcept {
  if (!(a < kInfinity)) return d;
  const double steps = floor_of(0.5 * (std::sqrt(1.0 + 8.0 * d / a) - 1.0));
  // At the corners of D⁻¹ its two lines agree, so a wrongly rounded N does no harm.
  return d / (steps + 1.0) + 0.5 * a * steps;
}

// The fastest stop from velocity v with slope a, |a| ≤ cap, second derivative ≤ j; time in cycles. Turned so that it
// ends with a positive velocity that falls to 0: down to a slope of −p, on with it, and back to 0.
class Stop {
 public:
  Stop(double v, double a, double j, double cap) noexcept
      : sign_(j * v + 0.5 * a * std::abs(a) < 0.0 ? -1.0 : 1.0), v_(sign_ * v), a_(sign_ * a), j_(j) {
    p_ = std::max(-a_, std::min(cap, std::sqrt(std::max(0.0, j * v_ + 0.5 * a_ * a_))));
    const double per_j = 1.0 / j, ramp = p_ * per_j;
    falling_ = std::max(0.0, a_ * per_j + ramp);
    steady_ = falling_;
    if (p_ >= cap) steady_ += std::max(0.0, (v_ + (0.5 * a_ * a_ - p_ * p_) * per_j) / p_);
    end_ = steady_ + ramp;
  }

  // Velocity and slope t cycles later, for t ≤ 1 from the nearer end.
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
      v = sign_ * 0.5 * j_ * square(end_ - t);
      a = sign_ * -j_ * (end_ - t);
    }
  }

  // Σ_{i≥1} v(i): how far it is from the first sample to the rest.
  double distance() const noexcept {
    const double n1 = floor_of(falling_), n2 = floor_of(steady_), n3 = floor_of(end_);
    double sum = sum_falling(n1);
    if (n2 > n1) sum += (n2 - n1) * (velocity_falling(falling_) - p_ * (0.5 * (n1 + 1.0 + n2) - falling_));
    const double c = n3 - n2, f = end_ - n3;  // samples at f, f + 1, … before the end
    sum += 0.5 * j_ * c * (f * f + (c - 1.0) * (f + (2.0 * c - 1.0) * (1.0 / 6.0)));
    return sign_ * sum;
  }

  // The largest of 0 and the partial sums of v(i), i ≥ 1.
  double rise() const noexcept {
    if (sign_ > 0.0) return std::max(0.0, distance());
    if (v_ >= 0.0) return 0.0;
    // It turns round while the slope changes for the first time.
    const double turn = -2.0 * v_ / (a_ + std::sqrt(std::max(0.0, a_ * a_ + 2.0 * j_ * v_)));
    return std::max(0.0, -sum_falling(floor_of(std::min(turn, falling_))));
  }

 private:
  double velocity_falling(double t) const noexcept { return v_ + t * (a_ - 0.5 * j_ * t); }
  double sum_falling(double n) const noexcept {
    return n * (v_ + 0.5 * (n + 1.0) * (a_ - j_ * (2.0 * n + 1.0) * (1.0 / 6.0)));
  }

  double sign_, v_, a_, j_, p_;
  double falling_, steady_, end_;  // when the phases end
};

double distance(double v, double a, double j, double cap) noexcept { return Stop(v, a, j, cap).distance(); }
double rise(double v, double a, double j, double cap) noexcept { return Stop(v, a, j, cap).rise(); }

double next_velocity(double v, double a, double j, double cap) noexcept {
  double next_v, next_a;
  Stop(v, a, j, cap).sample(1.0, next_v, next_a);
  return next_v;
}

// Nearly the largest x in [a, b] with f(x) ≤ 0, f growing, f(a) = fa ≤ 0 < fb = f(b); never more. Regula falsi
// (Illinois), kept away from the ends.
template <typename Function>
double largest_below_zero(double a, double fa, double b, double fb, Function f) noexcept {
  const double tolerance = kTolerance * (b - a);
  if (fb <= 0.0) return b;
  int side = 0;
  for (int k = 0; k < kMostEvaluations && b - a > tolerance; ++k) {
    const double margin = 0.01 * (b - a);
    const double x = std::clamp(a + (b - a) * (fa / (fa - fb)), a + margin, b - margin);
    const double fx = f(x);
    if (fx <= 0.0) {
      a = x;
      fa = fx;
      if (side == -1) fb *= 0.5;
      side = -1;
    } else {
      b = x;
      fb = fx;
      if (side == 1) fa *= 0.5;
      side = 1;
    }
  }
  return a;
}

// The line of choices: the slope with which v is chosen after v_k. It goes through the next sample of the stop that is
// kept, else as near to it as |slope − (v − v_k)| ≤ j/2 lets it, so that stopping is as easy as can be. Written as a
// difference to that sample, as v − v_k is rounded.
double slope_of(double v, double v_k, double next, double next_slope, double j) noexcept {
  const double change = next - v_k - next_slope;
  return v >= next ? next_slope + std::max(0.0, v - next + std::min(0.0, change - 0.5 * j))
                   : next_slope + std::min(0.0, v - next + std::max(0.0, change + 0.5 * j));
}

// A joint with a jerk limit, or its mirror image.
struct State {
  double v, change, next, next_slope;
  double room;   // to the upper position limit [velocities × cycles]
  double slack;  // of it: what is beyond by less is rounding
  double velocity, acceleration, braking, jerk, recovery;
};

struct Upper {
  double safe;   // no higher than this, or a limit is broken, or broken worse
  double bound;  // lower than that where the joint must come back
  LimitKind kind;
  bool broken;
};

Upper upper_bound(const State& s) noexcept {
  const double j = s.jerk, cap = s.acceleration, braking = s.braking;
  const auto slope_at = [&](double v) { return slope_of(v, s.v, s.next, s.next_slope, j); };
  const auto peak = [&](double v, double slope) { return v + square(std::max(0.0, slope)) / (2.0 * j); };

  // The next sample of the fastest way to a steady velocity, with the slope that suits it best.
  const auto settling = [&](double v) {
    const double excess = s.v - v, slope = std::copysign(std::sqrt(2.0 * j * std::abs(excess)), -excess);
    const double steepest = std::max(-cap, s.change - 0.5 * j), flattest = std::min(cap, s.change + 0.5 * j);
    return v + next_velocity(excess, std::max(steepest, std::min(flattest, slope)), j, cap);
  };

  const bool by_jerk = s.change + j < cap;
  double bound = std::max(s.next, s.v + (by_jerk ? s.change + j : cap));
  Upper upper{bound, bound, by_jerk ? LimitKind::Jerk : LimitKind::Acceleration, false};

  if (peak(bound, slope_at(bound)) > s.velocity) {
    const double next_peak = peak(s.next, s.next_slope);
    double v;
    if (next_peak <= s.velocity) {
      v = s.velocity - square(std::max(0.0, s.next_slope)) / (2.0 * j);
      if (slope_at(v) > s.next_slope) {
        // peak(v, slope) = V with v = v_k + slope + j/2
        const double slope = std::sqrt(2.0 * j * std::max(0.0, s.velocity - s.v)) - j;
        v = slope > 0.0 ? std::min(s.velocity, s.v + slope + 0.5 * j) : s.velocity;
      }
    } else {
      v = settling(s.velocity);
      upper.broken = next_peak > s.velocity * (1.0 + kTolerance);
    }
    upper.safe = upper.bound = bound = std::clamp(v, s.next, bound);
    upper.kind = LimitKind::Velocity;
  }

  if (!(s.room < kInfinity)) return upper;
  // Mostly the limit is far away. From its peak v a stop takes no longer than v / A + A / j, at v/2 on average.
  const double slope = std::max(0.0, slope_at(bound)), fast = bound + 0.5 * slope * slope / j;
  if (fast <= 0.0 ? s.room >= 0.0 : bound + fast * (1.0 + slope / j + 0.5 * (fast / braking + braking / j)) <= s.room) {
    return upper;
  }
  const auto farthest = [&](double v) { return v + rise(v, slope_at(v), j, braking) - s.room; };
  const double beyond = farthest(bound);
  if (beyond <= 0.0) return upper;
  upper.kind = LimitKind::Position;
  const double next_beyond = s.next + rise(s.next, s.next_slope, j, braking) - s.room;
  if (next_beyond <= 0.0) {
    const double most = s.room;  // the first sample alone would reach the limit
    upper.safe = upper.bound = most < bound ? largest_below_zero(s.next, next_beyond, most, farthest(most), farthest)
                                            : largest_below_zero(s.next, next_beyond, bound, beyond, farthest);
    return upper;
  }
  // It will be outside. Back with the recovery speed, until a stop ends on the limit or before.
  upper.safe = upper.bound = s.next;
  upper.broken = upper.broken || next_beyond > s.slack;
  const auto end = [&](double v) { return v + distance(v, slope_at(v), j, braking) - s.room; };
  const double next_end = end(s.next);
  if (next_end <= 0.0) return upper;
  const double back = std::min(s.next, settling(-s.recovery));
  const double back_end = end(back);
  upper.bound = back_end < 0.0 ? largest_below_zero(back, back_end, s.next, next_end, end) : back;
  return upper;
}

}  // namespace

const char* to_string(LimitKind kind) noexcept {
  switch (kind) {
    case LimitKind::None: return "none";
    case LimitKind::Position: return "position";
    case LimitKind::Velocity: return "velocity";
    case LimitKind::Acceleration: return "acceleration";
    case LimitKind::Jerk: return "jerk";
  }
  return "unknown";
}

LimitTracker::LimitTracker(const JointLimits& limits, double dt, const LimitOptions& options)
    : options_(options), dt_(dt), per_dt_(1.0 / dt), n_(static_cast<int>(limits.lower.size())) {
  require(dt > 0.0 && std::isfinite(dt), "dt = ", dt, " s must be above 0 and finite");
  require(options.recovery_speed > 0.0 && options.recovery_speed <= 1.0, "recovery_speed = ", options.recovery_speed,
          " must be above 0 and at most 1");
  require(n_ > 0, "there are no joints");
  const std::pair<const char*, const JointVector*> positive[] = {
      {"velocity", &limits.velocity}, {"acceleration", &limits.acceleration}, {"jerk", &limits.jerk}};
  require(limits.upper.size() == n_, "upper has ", limits.upper.size(), " entries, lower ", n_);
  for (const auto& [what, values] : positive) {
    require(values->size() == n_, what, " has ", values->size(), " entries, lower ", n_);
  }
  for (int i = 0; i < n_; ++i) {
    require(limits.lower[i] <= limits.upper[i], "joint ", i, ": lower = ", limits.lower[i],
            " is not below upper = ", limits.upper[i]);
    for (const auto& [what, values] : positive) {
      require((*values)[i] > 0.0, "joint ", i, ": ", what, " limit must be above 0, got ", (*values)[i]);
    }
    Joint& joint = joints_[static_cast<std::size_t>(i)];
    joint.lower = options.position ? limits.lower[i] : -kInfinity;
    joint.upper = options.position ? limits.upper[i] : kInfinity;
    joint.velocity = options.velocity ? limits.velocity[i] : kInfinity;
    joint.acceleration = options.acceleration ? limits.acceleration[i] * dt : kInfinity;
    joint.braking = joint.acceleration * (1.0 - kBrakingReserve);
    joint.jerk = options.jerk ? limits.jerk[i] * dt * dt : kInfinity;
    joint.recovery = options.recovery_speed * limits.velocity[i];
    lower_[i] = joint.lower;
    upper_[i] = joint.upper;
    velocity_[i] = joint.velocity;
    acceleration_[i] = joint.jerk < kInfinity ? kInfinity : joint.acceleration;
    has_jerk_ = has_jerk_ || joint.jerk < kInfinity;
  }
  for (int i = n_; i < kMaxJoints; ++i) {
    lower_[i] = -1.0;
    upper_[i] = velocity_[i] = acceleration_[i] = 1.0;
  }
}

void LimitTracker::reset(const JointRef& q, const JointRef& qdot) {
  require(q.size() == n_, "q has ", q.size(), " entries, the limits ", n_, " joints");
  require(q.allFinite(), "q has an entry that is not finite");
  require(qdot.size() == 0 || qdot.size() == n_, "qdot has ", qdot.size(), " entries, the limits ", n_, " joints");
  require(qdot.allFinite(), "qdot has an entry that is not finite");
  clear();
  q_ = q;
  if (qdot.size() != 0) v_ = qdot;
  for (Joint& joint : joints_) joint.change = joint.slope = 0.0;
  update();
}

void LimitTracker::clear() noexcept {
  for (JointVector* x : {&q_, &v_, &stop_, &bounds_.lower, &bounds_.upper}) {
    x->setZero(kMaxJoints);  // beyond n_, too: blocks of a fixed size are read and written
    x->resize(n_);
  }
}

void LimitTracker::continue_from(const LimitTracker& other) {
  require(other.n_ == n_, "the other tracker has ", other.n_, " joints, this one ", n_);
  require(other.dt_ == dt_, "the other tracker has dt = ", other.dt_, " s, this one ", dt_);
  if (other.q_.size() == 0) return;
  clear();
  q_ = other.q_;
  v_ = other.v_;
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    joints_[i].change = other.joints_[i].change;
    joints_[i].slope = other.joints_[i].slope;
  }
  update();
}

bool LimitTracker::advance(JointVector& qdot) noexcept {
  if (q_.size() == 0) return false;
  bool changed = false;
  if (qdot.size() != n_) {
    qdot = stop_;
    changed = true;
  }
  if (!detail::finite(qdot)) {
    for (int i = 0; i < n_; ++i) {
      if (std::isnan(qdot[i])) qdot[i] = stop_[i];
    }
    changed = true;
  }
  changed = (n_ <= 8 ? move<8>(qdot) : move<kMaxJoints>(qdot)) || changed;
  update();
  return changed;
}

template <int kPadded>
bool LimitTracker::move(JointVector& qdot) noexcept {
  using Block = Eigen::Array<double, kPadded, 1>;
  Block asked = Block::Zero();
  for (int i = 0; i < n_; ++i) asked[i] = qdot[i];
  Eigen::Map<Block> q(q_.data()), last(v_.data());
  const Block v = asked.max(Eigen::Map<const Block>(bounds_.lower.data()))
                      .min(Eigen::Map<const Block>(bounds_.upper.data()));
  const bool changed = (v != asked).any();
  if (changed) {
    for (int i = 0; i < n_; ++i) qdot[i] = v[i];
  }
  if (has_jerk_) {
    for (int i = 0; i < n_; ++i) {
      Joint& joint = joints_[static_cast<std::size_t>(i)];
      if (!(joint.jerk < kInfinity)) continue;
      joint.change = v[i] - last[i];
      joint.slope = slope_of(v[i], last[i], joint.next, joint.next_slope, joint.jerk);
    }
  }
  const Block from = q;
  q += dt_ * v;
  last = v;
  if ((q > upper_.template head<kPadded>()).any() || (q < lower_.template head<kPadded>()).any()) {
    for (int i = 0; i < n_; ++i) {
      const Joint& joint = joints_[static_cast<std::size_t>(i)];
      const double rounding = kSnap * (1.0 + std::abs(from[i]));
      if (q[i] > joint.upper && q[i] <= joint.upper + rounding) q[i] = joint.upper;
      if (q[i] < joint.lower && q[i] >= joint.lower - rounding) q[i] = joint.lower;
    }
  }
  return changed;
}

// Bounds of velocity and acceleration for all joints at once. Bit i of the answer: there is more to joint i.
template <int kPadded>
unsigned LimitTracker::survey() noexcept {
  using Block = Eigen::Array<double, kPadded, 1>;
  const Eigen::Map<const Block> q(q_.data()), v(v_.data());
  const auto a = acceleration_.template head<kPadded>();
  const auto limit = velocity_.template head<kPadded>();
  const Block most = v + a;
  const Block upper = most.min(limit), lower = (v - a).max(-limit);
  const Block up = upper.max(0.0), down = (-lower).max(0.0);
  // A position limit matters where D(v) ≤ v²/2A + v/2 + A/8 does not fit before it; NaN where A is infinite.
  const Block room = 2.0 * per_dt_ * a * (upper_.template head<kPadded>() - q).min(q - lower_.template head<kPadded>());
  const Block spare = room - up.max(down) * (up.max(down) + a) - 0.25 * a * a;
  const Block slow = limit - v.abs();
  Eigen::Map<Block>(bounds_.lower.data()) = lower;
  Eigen::Map<Block>(bounds_.upper.data()) = upper;
  Eigen::Map<Block>(stop_.data()) = lower.max(0.0).min(upper);
  unsigned more = 0;
  for (int i = 0; i < n_; ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (!(spare[i] >= 0.0 && slow[i] >= 0.0)) more |= 1u << i;
    bounds_.upper_kind[at] = most[i] > limit[i] ? LimitKind::Velocity : LimitKind::Acceleration;
    bounds_.lower_kind[at] = v[i] - a[i] < -limit[i] ? LimitKind::Velocity : LimitKind::Acceleration;
  }
  return more;
}

void LimitTracker::update() noexcept {
  outside_ = recovering_ = 0;
  unsigned more = n_ <= 8 ? survey<8>() : survey<kMaxJoints>();
  for (; more != 0; more &= more - 1) {
    const int i = std::countr_zero(more);
    const Joint& joint = joints_[static_cast<std::size_t>(i)];
    if (q_[i] < joint.lower || q_[i] > joint.upper) outside_ |= static_cast<std::uint16_t>(1u << i);
    joint.jerk < kInfinity ? bound_with_jerk(i) : bound(i);
  }
  recovering_ |= outside_;
}

// The velocity from which a joint without a jerk limit can just stop before a position limit that is `room` away; the
// one that takes it back to the limit, where that is behind it.
double LimitTracker::towards(const Joint& joint, double room) const noexcept {
  if (room >= 0.0) return fastest_before(room, joint.braking);
  const double recovery = joint.recovery < kInfinity ? joint.recovery : std::max(-room * dt_, 1e-3) / 0.1;
  return -std::min(fastest_before(-room, joint.braking), recovery);
}

VelocityBounds LimitTracker::heading() const noexcept {
  VelocityBounds out;
  out.lower.resize(n_);
  out.upper.resize(n_);
  for (int i = 0; i < n_; ++i) {
    const Joint& joint = joints_[static_cast<std::size_t>(i)];
    const double above = (joint.upper - q_[i]) * per_dt_, below = (q_[i] - joint.lower) * per_dt_;
    const double highest = above < kInfinity ? towards(joint, above) : kInfinity;
    const double lowest = below < kInfinity ? -towards(joint, below) : -kInfinity;
    out.upper[i] = std::clamp(highest, -joint.velocity, joint.velocity);
    out.lower[i] = std::clamp(lowest, -joint.velocity, joint.velocity);
    out.upper_kind[static_cast<std::size_t>(i)] = highest < joint.velocity ? LimitKind::Position : LimitKind::Velocity;
    out.lower_kind[static_cast<std::size_t>(i)] = lowest > -joint.velocity ? LimitKind::Position : LimitKind::Velocity;
  }
  return out;
}

void LimitTracker::bound(int i) noexcept {
  const Joint& joint = joints_[static_cast<std::size_t>(i)];
  const double v = v_[i], a = joint.acceleration, limit = joint.velocity;
  const double least = v - a, most = v + a;
  bool broken = std::abs(v) > limit;
  double upper = most, lower = least;
  LimitKind upper_kind = a < kInfinity ? LimitKind::Acceleration : LimitKind::None, lower_kind = upper_kind;
  // Each window gives way to those before it.
  if (upper > limit) {
    upper = std::max(limit, lower);
    upper_kind = LimitKind::Velocity;
  }
  if (lower < -limit) {
    lower = std::min(-limit, upper);
    lower_kind = LimitKind::Velocity;
  }

  // D(v) ≤ v²/2A + v/2 + A/8: mostly the limits are farther away than that.
  const double above = (joint.upper - q_[i]) * per_dt_, below = (q_[i] - joint.lower) * per_dt_;
  const auto matters = [&](double fast, double room) {
    if (fast <= 0.0) return room < 0.0;
    return a < kInfinity ? fast * (fast + a) + 0.25 * a * a > 2.0 * a * room : fast > room;
  };
  double highest = kInfinity, lowest = -kInfinity;
  if (above < kInfinity && matters(upper, above)) highest = towards(joint, above);
  if (below < kInfinity && matters(-lower, below)) lowest = -towards(joint, below);
  const double slack = kTolerance * (a + (1.0 + std::abs(q_[i])) * per_dt_);
  broken = broken || highest < least - slack || lowest > most + slack;
  const double first_upper = upper, first_lower = lower;
  if (highest < upper) {
    upper = std::max(highest, first_lower);
    upper_kind = LimitKind::Position;
  }
  if (lowest > lower) {
    lower = std::min(lowest, first_upper);
    lower_kind = LimitKind::Position;
  }
  bounds_.lower[i] = lower;
  bounds_.upper[i] = upper;
  bounds_.lower_kind[static_cast<std::size_t>(i)] = lower_kind;
  bounds_.upper_kind[static_cast<std::size_t>(i)] = upper_kind;
  stop_[i] = std::clamp(0.0, lower, upper);
  if (broken) recovering_ |= static_cast<std::uint16_t>(1u << i);
}

void LimitTracker::bound_with_jerk(int i) noexcept {
  Joint& joint = joints_[static_cast<std::size_t>(i)];
  const double dt = dt_, above = (joint.upper - q_[i]) * per_dt_, below = (q_[i] - joint.lower) * per_dt_;
  Stop(v_[i], joint.slope, joint.jerk, joint.braking).sample(1.0, joint.next, joint.next_slope);
  const double slack = kTolerance * (1.0 + std::abs(q_[i])) * per_dt_;
  const double outside = std::max({0.0, -above, -below}) * dt;
  const double recovery = joint.recovery < kInfinity ? joint.recovery : std::max(outside, 1e-3) / 0.1;
  const Upper up = upper_bound({v_[i], joint.change, joint.next, joint.next_slope, above, slack, joint.velocity,
                                joint.acceleration, joint.braking, joint.jerk, recovery});
  const Upper down = upper_bound({-v_[i], -joint.change, -joint.next, -joint.next_slope, below, slack, joint.velocity,
                                  joint.acceleration, joint.braking, joint.jerk, recovery});
  // The way back from one limit does not break another.
  double upper = std::max(up.bound, -down.safe), lower = std::min(-down.bound, up.safe);
  if (lower > upper) lower = upper = above < 0.0 ? upper : below < 0.0 ? lower : joint.next;
  bounds_.lower[i] = lower;
  bounds_.upper[i] = upper;
  bounds_.lower_kind[static_cast<std::size_t>(i)] = down.kind;
  bounds_.upper_kind[static_cast<std::size_t>(i)] = up.kind;
  stop_[i] = std::clamp(joint.next, lower, upper);
  if (up.broken || down.broken) recovering_ |= static_cast<std::uint16_t>(1u << i);
}

}  // namespace sigmaik
