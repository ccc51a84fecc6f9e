#include <sigmaik/limits.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "finite.hpp"
#include "jerk_bound.hpp"
#include "jerk_stop.hpp"
#include "limits_window.hpp"
#include "message.hpp"
#include "numbers.hpp"
#include "stopping.hpp"

namespace sigmaik {
namespace {

using detail::braking;
using detail::fastest_after;
using detail::kArrivalAcceleration;
using detail::kArrivalJerk;
using detail::kInfinity;
using detail::kLimitTolerance;
using detail::require;
using detail::slowest_after;
using detail::speed_before;
constexpr double kSnap = 1e-12;  // [1 + rad or m] rounding of positions as they add up

// D⁻¹(d) of limits.hpp, d [velocities × cycles] ≥ 0, a = A dt.
double fastest_before(double d, double a) noexcept {
  if (!(a < kInfinity)) return d;
  const double steps = detail::floor_of(0.5 * (std::sqrt(1.0 + 8.0 * d / a) - 1.0));
  // At the corners of D⁻¹ its two lines agree, so a wrongly rounded N does no harm.
  return d / (steps + 1.0) + 0.5 * a * steps;
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
    : options_(options), dt_(dt), cycle_(dt), per_dt_(1.0 / dt), n_(static_cast<int>(limits.lower.size())) {
  require(dt > 0.0 && std::isfinite(dt), "dt = ", dt, " s must be above 0 and finite");
  require(options.recovery_speed > 0.0 && options.recovery_speed <= 1.0, "recovery_speed = ", options.recovery_speed,
          " must be above 0 and at most 1");
  require(options.assumed_acceleration > 0.0, "assumed_acceleration = ", options.assumed_acceleration,
          " must be above 0");
  require(n_ > 0, "there are no joints");
  const JointVector deceleration = limits.deceleration.size() != 0 ? limits.deceleration
                                                                   : JointVector::Constant(n_, kInfinity);
  const std::pair<const char*, const JointVector*> positive[] = {{"velocity", &limits.velocity},
                                                                 {"acceleration", &limits.acceleration},
                                                                 {"deceleration", &deceleration},
                                                                 {"jerk", &limits.jerk}};
  require(limits.upper.size() == n_, "upper has ", limits.upper.size(), " entries, lower ", n_);
  for (const auto& [what, values] : positive) {
    require(values->size() == n_, what, " has ", values->size(), " entries, lower ", n_);
  }
  // Beyond n_ are numbers that are harmless in every operation, because blocks of a fixed size are read and written.
  lower_.fill(-1.0);
  for (Numbers* x : {&upper_, &velocity_, &recovery_, &most_acceleration_, &most_braking_, &most_jerk_}) x->fill(1.0);
  for (int i = 0; i < n_; ++i) {
    require(limits.lower[i] <= limits.upper[i], "joint ", i, ": lower = ", limits.lower[i],
            " is not below upper = ", limits.upper[i]);
    for (const auto& [what, values] : positive) {
      require((*values)[i] > 0.0, "joint ", i, ": ", what, " limit must be above 0, got ", (*values)[i]);
    }
    const auto at = static_cast<std::size_t>(i);
    lower_[at] = options.position ? limits.lower[i] : -kInfinity;
    upper_[at] = options.position ? limits.upper[i] : kInfinity;
    velocity_[at] = options.velocity ? limits.velocity[i] : kInfinity;
    const double acceleration = limits.acceleration[i] < kInfinity ? limits.acceleration[i]
                                                                   : options.assumed_acceleration;
    most_acceleration_[at] = options.acceleration ? acceleration : kInfinity;
    most_braking_[at] = options.acceleration && deceleration[i] < kInfinity ? deceleration[i] : most_acceleration_[at];
    most_jerk_[at] = options.jerk ? limits.jerk[i] : kInfinity;
    recovery_[at] = options.recovery_speed * limits.velocity[i];
    if (most_jerk_[at] < kInfinity) with_jerk_ |= 1u << i;
    if (most_braking_[at] != most_acceleration_[at]) unequal_ |= 1u << i;
  }
  scale_to(dt);
  settling_time_ = longest_settling();
}

void LimitTracker::reset(const JointRef& q, const JointRef& qdot, const JointRef& qddot) {
  require(q.size() == n_, "q has ", q.size(), " entries, the limits ", n_, " joints");
  require(q.allFinite(), "q has an entry that is not finite");
  require(qdot.size() == 0 || qdot.size() == n_, "qdot has ", qdot.size(), " entries, the limits ", n_, " joints");
  require(qdot.allFinite(), "qdot has an entry that is not finite");
  require(qddot.size() == 0 || qddot.size() == n_, "qddot has ", qddot.size(), " entries, the limits ", n_, " joints");
  require(qddot.allFinite(), "qddot has an entry that is not finite");
  scale_to(dt_);
  last_ = 1.0;
  uneven_ = false;
  changing_ = 0;
  std::array<JerkMemory, kMaxJoints> states{};
  for (int i = 0; i < n_; ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (qddot.size() != 0) {
      const double most = std::max(acceleration_[at], braking_[at]);
      const double change = std::clamp(qddot[i] * dt_, -most, most);
      states[at].change = states[at].slope = change;
    } else if (continues(i, q[i], qdot.size() != 0 ? qdot[i] : 0.0)) {
      states[at] = jerk_states_[at];
    }
  }
  const JointVector start = q, velocity = qdot;  // the arguments may be this tracker's own
  clear();
  q_ = start;
  if (velocity.size() != 0) v_ = velocity;
  jerk_states_ = states;
  update();
}

bool LimitTracker::continues(int i, double q, double qdot) const noexcept {
  if (q_.size() == 0) return false;
  constexpr double kSame = 1e-9;
  return std::abs(q - q_[i]) <= kSame * (1.0 + std::abs(q_[i])) &&
         std::abs(qdot - v_[i]) <= kSame * (1.0 + std::abs(v_[i]));
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
  scale_to(other.cycle_);
  last_ = other.last_;
  uneven_ = other.uneven_;
  changing_ = other.changing_;
  q_ = other.q_;
  v_ = other.v_;
  jerk_states_ = other.jerk_states_;
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
  last_ = 1.0;
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
  for (unsigned left = with_jerk_; left != 0; left &= left - 1) {
    const int i = std::countr_zero(left);
    const auto at = static_cast<std::size_t>(i);
    JerkMemory& state = jerk_states_[at];
    state.change = v[i] - last[i];
    state.slope = detail::slope_of(v[i], last[i], state.next, state.next_slope, jerk_[at]);
  }
  const Block from = q;
  q += cycle_ * v;
  last = v;
  if ((q > Eigen::Map<const Block>(upper_.data())).any() || (q < Eigen::Map<const Block>(lower_.data())).any()) {
    for (int i = 0; i < n_; ++i) {
      const double lower = lower_[static_cast<std::size_t>(i)], upper = upper_[static_cast<std::size_t>(i)];
      const double rounding = kSnap * (1.0 + std::abs(from[i]));
      if (q[i] > upper && q[i] <= upper + rounding) q[i] = upper;
      if (q[i] < lower && q[i] >= lower - rounding) q[i] = lower;
    }
  }
  return changed;
}

// Bounds by velocity and acceleration for all joints at once; most joints are far from all other limits most of the
// time. Bit i of the answer: joint i needs window() or jerk_window().
template <int kPadded>
unsigned LimitTracker::survey() noexcept {
  using Block = Eigen::Array<double, kPadded, 1>;
  using Column = Eigen::Map<const Block>;
  const Column q(q_.data()), v(v_.data()), a(acceleration_.data()), limit(velocity_.data());
  const Block most = v + a;
  const Block upper = most.min(limit), lower = (v - a).max(-limit);
  const Block up = upper.max(0.0), down = (-lower).max(0.0);
  // A position limit matters where the bound D(v) ≤ v²/2A + v/2 + A/8 exceeds the room to the limit; NaN where A is
  // infinite.
  const Block room = 2.0 * per_dt_ * a * (Column(upper_.data()) - q).min(q - Column(lower_.data()));
  const Block spare = room - up.max(down) * (up.max(down) + a) - 0.25 * a * a;
  const Block slow = limit - v.abs();
  Eigen::Map<Block>(bounds_.lower.data()) = lower;
  Eigen::Map<Block>(bounds_.upper.data()) = upper;
  Eigen::Map<Block>(stop_.data()) = lower.max(0.0).min(upper);
  unsigned more = with_jerk_ | unequal_;
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
  unsigned more = uneven_ ? (1u << n_) - 1u : n_ <= 8 ? survey<8>() : survey<kMaxJoints>();
  for (; more != 0; more &= more - 1) {
    const int i = std::countr_zero(more);
    const auto at = static_cast<std::size_t>(i);
    const bool has_jerk = (with_jerk_ >> i & 1u) != 0;
    if (q_[i] < lower_[at] || q_[i] > upper_[at]) outside_ |= static_cast<std::uint16_t>(1u << i);
    bool broken = false;
    put(i, has_jerk ? jerk_window(i, broken) : uneven_ ? uneven_window(i, broken) : window(i, broken), bounds_);
    stop_[i] = std::clamp(has_jerk ? jerk_states_[at].next : 0.0, bounds_.lower[i], bounds_.upper[i]);
    if (broken) recovering_ |= static_cast<std::uint16_t>(1u << i);
  }
  recovering_ |= outside_;
}

void LimitTracker::put(int i, const Window& window, VelocityBounds& to) noexcept {
  const auto at = static_cast<std::size_t>(i);
  to.lower[i] = window.lower;
  to.upper[i] = window.upper;
  to.lower_kind[at] = window.lower_kind;
  to.upper_kind[at] = window.upper_kind;
}

double LimitTracker::recovery(int i, double outside) const noexcept {
  const double speed = recovery_[static_cast<std::size_t>(i)];
  return speed < kInfinity ? speed : std::max(outside, 1e-3) / 0.1;
}

double LimitTracker::towards(int i, double room) const noexcept {
  const double a = braking(braking_[static_cast<std::size_t>(i)]);
  const double fastest = uneven_ ? towards_unevenly(std::abs(room), a) : fastest_before(std::abs(room), a);
  return room >= 0.0 ? fastest : -std::min(fastest, recovery(i, -room * cycle_));
}

double LimitTracker::heading_before(int i, double room) const noexcept {
  const auto at = static_cast<std::size_t>(i);
  if (!(room < kInfinity)) return kInfinity;
  const double most = towards(i, room);
  if ((with_jerk_ >> i & 1u) == 0 || room < 0.0) return most;
  return std::min(most, speed_before(room, kArrivalAcceleration * braking_[at], kArrivalJerk * jerk_[at]));
}

VelocityBounds LimitTracker::heading() const noexcept {
  VelocityBounds out;
  out.lower.resize(n_);
  out.upper.resize(n_);
  for (int i = 0; i < n_; ++i) {
    Window window{-kInfinity, kInfinity, LimitKind::None, LimitKind::None};
    window.narrow(-heading_before(i, room_below(i)), heading_before(i, room_above(i)), LimitKind::Position);
    put(i, window, out);
  }
  return out;
}

double LimitTracker::arrival(const JointVector& qdot, double gain) const noexcept {
  double part = 1.0;
  for (int i = 0; i < n_; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double size = std::abs(qdot[i]);
    if (!(size > 0.0)) continue;
    const double cap = speed_before(size / gain * per_dt_, kArrivalAcceleration * braking_[at],
                                    kArrivalJerk * jerk_[at]);
    if (size * part > cap) part = cap / size;
  }
  return part;
}

JointVector LimitTracker::approach(const JointVector& wanted) const noexcept {
  // For a change of one, of the joint that needs the most time: the largest change of velocity in a cycle, and the
  // largest change of this change.
  double most = 1.0, more = kInfinity;
  for (int i = 0; i < n_; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double size = std::abs(wanted[i] - v_[i]);
    const double change = change_limit(i, wanted[i]);
    if (most * size > change) most = change / size;
    if (more * size > jerk_[at]) more = jerk_[at] / size;
  }
  JointVector out = v_;
  double part = most;
  for (unsigned left = with_jerk_; left != 0; left &= left - 1) {
    const int i = std::countr_zero(left);
    const auto at = static_cast<std::size_t>(i);
    const double way = wanted[i] - v_[i], size = std::abs(way), sign = way < 0.0 ? -1.0 : 1.0;
    const double last = sign * jerk_states_[at].change, jerk = jerk_[at];
    double next = 0.0;
    if (size > std::numeric_limits<double>::min()) {
      next = std::min(most * size, fastest_before(size, std::min(more * size, jerk)));
      next = std::min(next, last < 0.0 ? std::min(0.0, last + jerk) : last + more * size);
    }
    next = std::clamp(next, last - jerk, last + jerk);
    if (next < part * size) part = next > 0.0 ? next / size : 0.0;
    out[i] += sign * next;
  }
  for (int i = 0; i < n_; ++i) {
    if ((with_jerk_ >> i & 1u) == 0) out[i] += part * (wanted[i] - v_[i]);
  }
  return out;
}

double LimitTracker::slope_limit(int i, bool upwards) const noexcept {
  const auto at = static_cast<std::size_t>(i);
  const double a = acceleration_[at], b = braking_[at];
  if ((unequal_ >> i & 1u) == 0) return a;
  const double least = std::min(a, b);
  if (uneven_) return least;  // the changes below can fall in time only where cycles are even
  const double speed = std::abs(v_[i]), j = jerk_[at];
  const bool brakes = upwards ? v_[i] < 0.0 : v_[i] > 0.0;
  if (!brakes) return std::min(a, std::sqrt(least * least + 2.0 * j * speed));
  const double slope = std::sqrt(least * (least + j) + 0.25 * j * j + 2.0 * j * std::max(0.0, speed - least)) - 0.5 * j;
  return std::min({b, std::max(least, slope), std::max(least, speed)});
}

// Time of braking and time of speeding up add up; the cycle at hand has the limit of what it does.
double LimitTracker::change_limit(int i, double wanted) const noexcept {
  const auto at = static_cast<std::size_t>(i);
  const double v = v_[i], a = acceleration_[at], b = braking_[at];
  if ((unequal_ >> i & 1u) == 0) return a;
  const double from = std::abs(v), to = std::abs(wanted), size = std::abs(wanted - v);
  double mean = to >= from ? a : b;
  if (v * wanted < 0.0) mean = size / (from / b + to / a);
  return (with_jerk_ >> i & 1u) != 0 ? std::min(mean, slope_limit(i, wanted > v)) : mean;
}

double LimitTracker::least_jerk() const noexcept {
  double least = kInfinity;
  for (int i = 0; i < n_; ++i) least = std::min(least, jerk_[static_cast<std::size_t>(i)] * per_dt_ * per_dt_);
  return least;
}

double LimitTracker::least_acceleration() const noexcept {
  double least = kInfinity;
  for (int i = 0; i < n_; ++i) least = std::min(least, least_acceleration(i));
  return least;
}

VelocityScale LimitTracker::velocity_scale(const JointVector& qdot) const noexcept {
  VelocityScale out;
  for (int i = 0; i < n_; ++i) {
    const double size = std::abs(qdot[i]), limit = velocity_limit(i);
    if (size * out.part > limit) out = {limit / size, i};
  }
  return out;
}

double LimitTracker::part_of_limit(int i, double velocity) const noexcept {
  const double limit = velocity_limit(i);
  return limit < kInfinity ? velocity / limit : velocity;
}

bool LimitTracker::resting() const noexcept {
  constexpr double kRest = 1e-3;
  for (int i = 0; i < n_; ++i) {
    if (std::abs(part_of_limit(i, v_[i])) > kRest) return false;
  }
  return true;
}

double LimitTracker::longest_settling() const noexcept {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  double longest = 0.0;
  for (int i = 0; i < n_; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double range = upper_[at] - lower_[at], way = range < kInfinity ? range : kTurn;
    // The time of a motion with each limit alone adds up to more than that of a motion with all limits.
    longest = std::max(longest, way / velocity_[at] + 2.0 * std::sqrt(way / least_acceleration(i)) +
                                    4.0 * std::cbrt(way / (jerk_[at] * per_dt_ * per_dt_)));
  }
  return 3.0 + 3.0 * longest;
}

LimitTracker::Window LimitTracker::window(int i, bool& broken) const noexcept {
  const auto at = static_cast<std::size_t>(i);
  const double v = v_[i], a = acceleration_[at], b = braking_[at], limit = velocity_[at];
  const LimitKind kind = a < kInfinity ? LimitKind::Acceleration : LimitKind::None;
  const Window motor{v >= 0.0 ? slowest_after(v, a, b) : -fastest_after(-v, a, b),
                     v > 0.0 ? fastest_after(v, a, b) : -slowest_after(-v, a, b), kind, kind};
  Window window = motor;
  window.narrow(-limit, limit, LimitKind::Velocity);

  // D(v) ≤ v²/2B + v/2 + B/8: usually the limits are farther away than this bound.
  const double above = room_above(i), below = room_below(i);
  const auto matters = [&](double fast, double room) {
    if (fast <= 0.0) return room < 0.0;
    return b < kInfinity ? fast * (fast + b) + 0.25 * b * b > 2.0 * b * room : fast > room;
  };
  const double highest = above < kInfinity && matters(window.upper, above) ? towards(i, above) : kInfinity;
  const double lowest = below < kInfinity && matters(-window.lower, below) ? -towards(i, below) : -kInfinity;
  const double slack = kLimitTolerance * (a + (1.0 + std::abs(q_[i])) * per_dt_);
  broken = std::abs(v) > limit || highest < motor.lower - slack || lowest > motor.upper + slack;
  window.narrow(lowest, highest, LimitKind::Position);
  return window;
}

LimitTracker::Window LimitTracker::jerk_window(int i, bool& broken) noexcept {
  const auto at = static_cast<std::size_t>(i);
  JerkMemory& s = jerk_states_[at];
  const double v = v_[i], above = room_above(i), below = room_below(i);
  const double brake = braking(braking_[at]), settling = std::min(acceleration_[at], braking_[at]);
  const detail::JerkStop stop(v, s.slope, jerk_[at], brake);
  stop.sample(1.0, s.next, s.next_slope);
  const double longest = uneven_ ? kLongestCycle * dt_ * per_dt_ : 0.0;
  if ((changing_ >> i & 1u) != 0) keep_even_stop(i);
  const double slack = kLimitTolerance * (1.0 + std::abs(q_[i])) * per_dt_;
  const double back = recovery(i, std::max({0.0, -above, -below}) * cycle_);
  const detail::JerkBound up = detail::upper_bound({v, s.change, s.next, s.next_slope, above, slack, velocity_[at],
                                                    slope_limit(i, true), brake, jerk_[at], back, settling, last_,
                                                    longest});
  const detail::JerkBound down = detail::upper_bound({-v, -s.change, -s.next, -s.next_slope, below, slack,
                                                      velocity_[at], slope_limit(i, false), brake, jerk_[at], back,
                                                      settling, last_, longest});
  // The way back from one limit does not break another.
  Window window{std::min(-down.bound, up.safe), std::max(up.bound, -down.safe), down.kind, up.kind};
  if (window.lower > window.upper) {
    window.lower = window.upper = above < 0.0 ? window.upper : below < 0.0 ? window.lower : s.next;
  }
  broken = up.broken || down.broken;
  return window;
}

}  // namespace sigmaik
