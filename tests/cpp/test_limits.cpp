// Bounds on the joint velocity hold the limits for ever, give up no more than necessary, and lead back into the limits.

#include <doctest/doctest.h>

#include <vector>

#include <sigmaik/error.hpp>
#include <sigmaik/limits.hpp>

#include "heap.hpp"
#include "numbers.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::kInfinity;
using test::kNan;
using test::Random;

constexpr double kTolerance = 1e-9;

// The limits as they are given: without an assumption about joints that have no acceleration limit.
constexpr LimitOptions kAsGiven{.assumed_acceleration = kInfinity};

double ulp(double x) { return std::nextafter(std::abs(x), kInfinity) - std::abs(x); }

JointLimits no_limits(int n) {
  const JointVector infinite = JointVector::Constant(n, kInfinity);
  JointLimits limits;
  limits.lower = -infinite;
  limits.upper = limits.velocity = limits.acceleration = limits.jerk = limits.effort = infinite;
  return limits;
}

JointVector one(double x) { return JointVector::Constant(1, x); }

// One joint's limits over many decades, ratios that make no sense included.
void draw_limits(Random& random, bool jerk, double dt, int i, JointLimits& limits) {
  const double middle = random.uniform(-3.0, 3.0), half = random.decades(-4.0, 1.5);
  if (random.chance(0.85)) limits.lower[i] = middle - half;
  if (random.chance(0.85)) limits.upper[i] = middle + half;
  if (random.chance(0.8)) limits.velocity[i] = random.decades(-3.0, 2.0);
  if (random.chance(0.8)) limits.acceleration[i] = random.decades(-2.0, 4.0);
  if (!jerk) return;
  const double a = std::min(limits.acceleration[i], 10.0);
  limits.jerk[i] = random.chance(0.5) ? random.decades(-2.0, 9.0) : a / dt * random.decades(-3.0, 2.0);
}

double draw_position(Random& random, const JointLimits& limits, int i) {
  const double lower = std::isfinite(limits.lower[i]) ? limits.lower[i] : std::min(limits.upper[i], 3.0) - 1.0;
  const double upper = std::isfinite(limits.upper[i]) ? limits.upper[i] : lower + 2.0;
  return random.chance(0.2) ? lower : random.chance(0.2) ? upper : random.uniform(lower, upper);
}

// Chooses velocities inside the bounds, at random or with the worst intentions.
class Chooser {
 public:
  Chooser(Random& random, double dt, double q)
      : random_(&random), dt_(dt), target_(q), policy_(random.integer(0, 6)), dwell_(random.decades(0.0, 3.0)) {}

  double choose(double lower, double upper, double q) {
    if (lower < -5.0) lower = std::min(-5.0, upper);  // instead of infinite speeds
    if (upper > 5.0) upper = std::max(5.0, lower);
    const bool change = random_->chance(1.0 / dwell_);
    switch (policy_) {
      case 0: return upper;
      case 1: return lower;
      case 2: return random_->chance(0.5) ? lower : upper;
      case 3: return random_->uniform(lower, upper);
      case 4:
        if (change) part_ = 1.0 - std::round(part_);
        return part_ > 0.5 ? upper : lower;
      case 5:
        if (change) target_ = q + random_->normal();
        return std::clamp((target_ - q) / (dt_ * dwell_), lower, upper);
      default:
        if (change) part_ = random_->uniform(0.0, 1.0);
        return std::clamp(lower + part_ * (upper - lower), lower, upper);
    }
  }

 private:
  Random* random_;
  double dt_, target_, part_ = 1.0;
  int policy_;
  double dwell_;
};

// The checks of a robot's controller, with the rounding of differences.
class Checker {
 public:
  Checker(const JointLimits& limits, double dt, const JointVector& q, const JointVector& v)
      : limits_(limits), dt_(dt), q_(q), v_(v), a_(JointVector::Zero(q.size())), fastest_(v.cwiseAbs()) {}

  void step(int i, double q, double v) {
    fastest_[i] = std::max(fastest_[i], std::abs(v));
    const double rounding = ulp(fastest_[i]) / dt_, a = (v - v_[i]) / dt_;
    finite += !std::isfinite(q) || !std::isfinite(v);
    sum += !(std::abs(q - (q_[i] + v * dt_)) <= 2e-12 * (1.0 + std::abs(q)));
    position += q > limits_.upper[i] || q < limits_.lower[i];
    velocity += !(std::abs(v) <= limits_.velocity[i] * (1.0 + kTolerance));
    acceleration += !(std::abs(a) <= limits_.acceleration[i] * (1.0 + kTolerance) + 2.0 * rounding);
    jerk += !(std::abs(a - a_[i]) / dt_ <= limits_.jerk[i] * (1.0 + kTolerance) + 4.0 * rounding / dt_);
    q_[i] = q;
    v_[i] = v;
    a_[i] = a;
  }
  const JointVector& q() const { return q_; }

  long finite = 0, sum = 0, position = 0, velocity = 0, acceleration = 0, jerk = 0;

 private:
  JointLimits limits_;
  double dt_;
  JointVector q_, v_, a_, fastest_;
};

// The least time from rest over a distance, in continuous time.
double least_time(double distance, double v, double a, double j) {
  const auto ramp = [&](double speed) {  // time to reach this speed
    return std::isinf(j) ? speed / a : speed >= a * a / j ? speed / a + a / j : 2.0 * std::sqrt(speed / j);
  };
  if (std::isfinite(v) && v * ramp(v) <= distance) return 2.0 * ramp(v) + (distance - v * ramp(v)) / v;
  double low = 0.0, high = std::min(v, 1e6);
  for (int k = 0; k < 200; ++k) {
    const double middle = 0.5 * (low + high);
    (middle * ramp(middle) <= distance ? low : high) = middle;
  }
  return 2.0 * ramp(low);
}

}  // namespace

TEST_CASE("from rest inside the limits nothing breaks them, whatever is chosen inside the bounds") {
  for (const bool with_jerk : {false, true}) {
    Random random(with_jerk ? 1 : 2);
    constexpr int n = 8, kCycles = 500;
    for (int run = 0; run < 450; ++run) {
      const double dt = random.decades(-4.0, -1.0);
      JointLimits limits = no_limits(n);
      JointVector start(n);
      std::vector<Chooser> choosers;
      for (int i = 0; i < n; ++i) {
        draw_limits(random, with_jerk, dt, i, limits);
        start[i] = draw_position(random, limits, i);
        choosers.emplace_back(random, dt, start[i]);
      }
      LimitTracker tracker(limits, dt, kAsGiven);
      tracker.reset(start);
      Checker check(limits, dt, start, JointVector::Zero(n));
      long order = 0, moved = 0, flagged = 0, stop = 0;
      for (int cycle = 0; cycle < kCycles; ++cycle) {
        const VelocityBounds& bounds = tracker.bounds();
        JointVector qdot(n);
        for (int i = 0; i < n; ++i) {
          order += !(bounds.lower[i] <= bounds.upper[i]);
          stop += !(bounds.lower[i] <= tracker.stop()[i] && tracker.stop()[i] <= bounds.upper[i]);
          qdot[i] = choosers[static_cast<std::size_t>(i)].choose(bounds.lower[i], bounds.upper[i], check.q()[i]);
        }
        const JointVector chosen = qdot;
        tracker.advance(qdot);
        moved += qdot != chosen || tracker.qdot() != qdot;
        flagged += tracker.recovering() != 0 || tracker.outside() != 0;
        for (int i = 0; i < n; ++i) check.step(i, tracker.q()[i], qdot[i]);
      }
      CAPTURE(run);
      CHECK(order == 0);
      CHECK(moved == 0);
      CHECK(flagged == 0);
      CHECK(stop == 0);
      CHECK(check.finite == 0);
      CHECK(check.sum == 0);
      CHECK(check.position == 0);
      CHECK(check.velocity == 0);
      CHECK(check.acceleration == 0);
      CHECK(check.jerk == 0);
    }
  }
}

TEST_CASE("from outside: acceleration and jerk hold, speed falls, the joint comes back and stays") {
  for (const bool with_jerk : {false, true}) {
    Random random(with_jerk ? 3 : 4);
    for (int run = 0; run < 400; ++run) {
      const double dt = random.decades(-3.0, -1.5), half = random.decades(-2.0, 0.5);
      JointLimits limits = no_limits(1);
      limits.lower[0] = -half;
      limits.upper[0] = half;
      if (random.chance(0.8)) limits.velocity[0] = random.decades(-1.0, 1.0);
      if (random.chance(0.8)) limits.acceleration[0] = random.decades(0.0, 3.0);
      if (with_jerk) limits.jerk[0] = random.decades(0.0, 8.0);
      const double v = limits.velocity[0], a = limits.acceleration[0], j = limits.jerk[0];
      const int kind = random.integer(0, 2);
      double q = random.uniform(-half, half), qdot = 0.0;
      if (kind != 1) q = (random.chance(0.5) ? 1.0 : -1.0) * (half + random.decades(-6.0, 0.0));
      if (kind != 0) qdot = random.uniform(-3.0, 3.0) * std::min(v, 1.0);
      LimitTracker tracker(limits, dt, kAsGiven);
      tracker.reset(one(q), one(qdot));

      // Stop, turn round, travel and settle, a few times over.
      const double speed = std::abs(qdot), recovery = std::isinf(v) ? 0.01 : 0.1 * v;
      const double stopping = speed / a + 2.0 * std::sqrt(speed / j) + (std::isinf(j) || std::isinf(a) ? 0.0 : a / j);
      const double over = std::max(0.0, std::abs(q) - half) + speed * (stopping + dt);
      const double time = 4.0 * stopping + 3.0 * over / recovery + 8.0 * std::cbrt(over / j) +
                          8.0 * std::sqrt(recovery / j) + 6.0 * std::sqrt(over / a) + 4.0 * recovery / a +
                          (std::isinf(j) || std::isinf(a) ? 0.0 : 8.0 * a / j) + (std::isinf(v) ? 2.0 : 0.0) +
                          100.0 * dt;
      if (time / dt > 50000.0) continue;
      const int cycles = static_cast<int>(time / dt);
      Checker check(limits, dt, one(q), one(qdot));
      const int policy = random.integer(0, 3);
      long order = 0, faster = 0, left = 0;
      int back = -1;
      double last = speed;
      for (int cycle = 0; cycle < cycles + 300; ++cycle) {
        const double lower = tracker.bounds().lower[0], upper = tracker.bounds().upper[0];
        order += !(lower <= upper);
        const double low = std::clamp(-20.0, lower, upper), high = std::clamp(20.0, lower, upper);
        const bool above = tracker.q()[0] > 0.0;
        JointVector choice = one(policy == 0   ? (above ? high : low)  // as slow as allowed
                                 : policy == 1 ? high
                                 : policy == 2 ? low
                                               : random.uniform(low, high));
        tracker.advance(choice);
        check.step(0, tracker.q()[0], choice[0]);
        const double now = std::abs(choice[0]);
        faster += now > std::max(v, last) * (1.0 + kTolerance);
        last = now;
        if (tracker.recovering() == 0) {
          if (back < 0) back = cycle;
          left += std::abs(tracker.q()[0]) > half;
        } else if (back >= 0) {
          ++left;
        }
      }
      CAPTURE(run);
      CHECK(order == 0);
      CHECK(faster == 0);
      CHECK(left == 0);
      CHECK(back >= 0);
      CHECK(back <= cycles);
      CHECK(check.finite == 0);
      CHECK(check.sum == 0);
      CHECK(check.acceleration == 0);
      CHECK(check.jerk == 0);
    }
  }
}

TEST_CASE("no more is given up than necessary: a limit is reached in the least time, exactly, and kept") {
  Random random(5);
  for (int run = 0; run < 250; ++run) {
    const double dt = random.decades(-4.0, -2.0), distance = random.decades(-2.0, 1.0);
    JointLimits limits = no_limits(1);
    limits.upper[0] = random.uniform(-1.0, 1.0);
    limits.lower[0] = limits.upper[0] - 2.0 * distance;
    if (random.chance(0.9)) limits.velocity[0] = random.decades(-1.0, 1.0);
    limits.acceleration[0] = random.decades(-1.0, 3.0);
    if (random.chance(0.8)) limits.jerk[0] = random.decades(0.0, 6.0);
    const double cycles = least_time(distance, limits.velocity[0], limits.acceleration[0], limits.jerk[0]) / dt;
    if (cycles < 3.0 || cycles > 20000.0) continue;
    const bool up = random.chance(0.5);
    const double goal = up ? limits.upper[0] : limits.lower[0];
    LimitTracker tracker(limits, dt, kAsGiven);
    tracker.reset(one(goal + (up ? -distance : distance)));
    int cycle = 0;
    for (; cycle < 2.0 * cycles && std::abs(tracker.q()[0] - goal) > 1e-9 * distance; ++cycle) {
      JointVector qdot = up ? tracker.bounds().upper : tracker.bounds().lower;
      tracker.advance(qdot);
    }
    CAPTURE(run);
    CHECK(cycle <= cycles + 1.0);
    CHECK(cycle >= (1.0 - 2e-2) * cycles - 3.0);  // the last nanometres take long with a jerk limit
    for (int k = 0; k < 100; ++k) {
      JointVector qdot = up ? tracker.bounds().upper : tracker.bounds().lower;
      tracker.advance(qdot);
    }
    CHECK(std::abs(tracker.q()[0] - goal) < 2e-12);
    CHECK(std::abs(tracker.qdot()[0]) < 1e-11 / dt);
    CHECK(tracker.outside() == 0);
  }
}

TEST_CASE("without a jerk limit: the largest velocity from which braking, cycle by cycle, ends on the limit") {
  Random random(6);
  for (int run = 0; run < 2000; ++run) {
    const double dt = random.decades(-4.0, -1.0), a = random.decades(-2.0, 4.0);
    const double steps = random.decades(-2.0, 3.0), room = a * dt * dt * steps * steps;
    if (room < 1e-7) continue;
    JointLimits limits = no_limits(1);
    limits.upper[0] = room;
    limits.acceleration[0] = a;
    LimitTracker tracker(limits, dt, kAsGiven);
    tracker.reset(one(0.0), one(a * dt * 2.0 * (steps + 1.0)));  // too fast …
    CHECK(tracker.recovering() == 1);
    // … so its velocity is bounded by acceleration; the position's bound is the velocity at which a slower start meets
    // it.
    double low = 0.0, high = a * dt * 2.0 * (steps + 1.0);
    const auto braking = [&](double v) {
      double sum = 0.0;
      for (; v > 0.0; v -= a * dt) sum += v * dt;
      return sum;
    };
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + high);
      (braking(middle) <= room ? low : high) = middle;
    }
    tracker.reset(one(0.0), one(std::max(0.0, low - 0.5 * a * dt)));
    CHECK(tracker.bounds().upper[0] == doctest::Approx(low).epsilon(1e-8));
    CHECK(tracker.bounds().upper_kind[0] == LimitKind::Position);
    CHECK(tracker.recovering() == 0);
  }
}

TEST_CASE("a jerk limit that is large enough is none") {
  Random random(7);
  for (int run = 0; run < 150; ++run) {
    const double dt = random.decades(-4.0, -2.0), half = random.decades(-3.0, 1.0);
    JointLimits limits = no_limits(1);
    limits.lower[0] = -half;
    limits.upper[0] = half;
    if (random.chance(0.9)) limits.velocity[0] = random.decades(-1.0, 1.0);
    if (random.chance(0.85)) limits.acceleration[0] = random.decades(-1.0, 3.0);
    JointLimits jerky = limits;
    jerky.jerk[0] = 1e9 * std::min(limits.acceleration[0], 1e3 / dt) / dt;
    LimitTracker free(limits, dt, kAsGiven), bound(jerky, dt, kAsGiven);
    const JointVector start = one(random.uniform(-half, half));
    free.reset(start);
    bound.reset(start);
    Chooser chooser(random, dt, start[0]);
    const double scale = std::min({limits.velocity[0], half / dt, std::sqrt(half * limits.acceleration[0])});
    double worst = 0.0;
    for (int cycle = 0; cycle < 500; ++cycle) {
      const VelocityBounds &a = free.bounds(), &b = bound.bounds();
      if (std::isfinite(a.upper[0])) worst = std::max(worst, std::abs(a.upper[0] - b.upper[0]));
      if (std::isfinite(a.lower[0])) worst = std::max(worst, std::abs(a.lower[0] - b.lower[0]));
      const double lower = std::max(a.lower[0], b.lower[0]), upper = std::min(a.upper[0], b.upper[0]);
      JointVector qdot = one(chooser.choose(std::min(lower, upper), std::max(lower, upper), free.q()[0])), same = qdot;
      free.advance(qdot);
      bound.advance(same);
    }
    CAPTURE(run);
    CHECK(worst < 1e-8 * scale);
  }
}

TEST_CASE("bounds are continuous in the state, out of the limits too") {
  for (const bool with_jerk : {false, true}) {
    Random random(with_jerk ? 8 : 9);
    for (int run = 0; run < 4000; ++run) {
      const double dt = random.decades(-3.0, -1.5);
      JointLimits limits = no_limits(1);
      limits.lower[0] = -1.0;
      limits.upper[0] = 1.0;
      limits.velocity[0] = random.decades(-1.0, 1.0);
      limits.acceleration[0] = random.decades(-1.0, 2.0);
      if (with_jerk) limits.jerk[0] = random.decades(-1.0, 4.0);
      const double q = random.chance(0.5) ? random.uniform(-1.5, 1.5) : random.chance(0.5) ? 1.0 : -1.0;
      const double v = random.chance(0.2) ? 0.0 : 1.5 * limits.velocity[0] * random.uniform(-1.0, 1.0);
      LimitTracker a(limits, dt, kAsGiven), b(limits, dt, kAsGiven);
      a.reset(one(q), one(v));
      b.reset(one(q + 1e-12 * random.normal()), one(v + 1e-12 * random.normal()));
      // Positions are divided by dt, and near limits the bounds are roots.
      const double near = 1e-11 / dt + (with_jerk ? 1e-5 * dt * std::sqrt(limits.jerk[0]) : 0.0);
      CAPTURE(run);
      CHECK(std::abs(a.bounds().upper[0] - b.bounds().upper[0]) < near);
      CHECK(std::abs(a.bounds().lower[0] - b.bounds().lower[0]) < near);
    }
  }
}

TEST_CASE("which limit forms a bound") {
  JointLimits limits = no_limits(1);
  const auto kind = [&](double q, double v) {
    LimitTracker tracker(limits, 0.01, kAsGiven);
    tracker.reset(one(q), one(v));
    return tracker.bounds().upper_kind[0];
  };
  CHECK(kind(0.0, 0.0) == LimitKind::None);
  limits.velocity[0] = 2.0;
  CHECK(kind(0.0, 0.0) == LimitKind::Velocity);
  limits.acceleration[0] = 10.0;
  CHECK(kind(0.0, 0.0) == LimitKind::Acceleration);
  CHECK(kind(0.0, 1.95) == LimitKind::Velocity);
  limits.upper[0] = 1.0;
  CHECK(kind(0.0, 0.0) == LimitKind::Acceleration);
  CHECK(kind(1.0, 0.0) == LimitKind::Position);
  limits.jerk[0] = 100.0;
  CHECK(kind(0.0, 0.0) == LimitKind::Jerk);
  CHECK(kind(1.0, 0.0) == LimitKind::Position);
  limits.jerk[0] = 1e5;
  CHECK(kind(0.0, 0.0) == LimitKind::Acceleration);
  CHECK(std::string(to_string(LimitKind::Jerk)) == "jerk");
}

TEST_CASE("limits can be left out, and a joint that is outside moves in faster if asked") {
  JointLimits limits = no_limits(1);
  limits.lower[0] = -1.0;
  limits.upper[0] = 1.0;
  limits.velocity[0] = 2.0;
  limits.acceleration[0] = 10.0;
  limits.jerk[0] = 100.0;
  LimitTracker none(limits, 0.01, {.position = false, .velocity = false, .acceleration = false, .jerk = false});
  none.reset(one(5.0), one(7.0));
  CHECK(none.bounds().lower[0] == -kInfinity);
  CHECK(none.bounds().upper[0] == kInfinity);
  CHECK(none.recovering() == 0);
  LimitTracker fast(limits, 0.01, {.acceleration = false, .jerk = false, .recovery_speed = 0.5});
  fast.reset(one(1.5));
  CHECK(fast.outside() == 1);
  CHECK(fast.recovering() == 1);
  CHECK(fast.bounds().upper[0] == -1.0);
  CHECK(fast.bounds().lower[0] == -2.0);
  CHECK(fast.stop()[0] == -1.0);
}

TEST_CASE("a velocity that is no number, or of a wrong size, stops the joint within the limits") {
  JointLimits limits = no_limits(2);
  limits.acceleration.setConstant(10.0);
  limits.jerk[1] = 100.0;
  LimitTracker a(limits, 0.01), b(limits, 0.01);
  a.reset(JointVector::Zero(2), JointVector::Ones(2));
  b.reset(JointVector::Zero(2), JointVector::Ones(2));
  for (int cycle = 0; cycle < 200; ++cycle) {
    JointVector bad = cycle % 2 == 0 ? JointVector(JointVector::Constant(2, kNan)) : JointVector(), stop = b.stop();
    a.advance(bad);
    b.advance(stop);
    CHECK(bad == stop);
    CHECK(a.q() == b.q());
  }
  CHECK(a.qdot() == JointVector::Zero(2));
  LimitTracker fresh(limits);
  JointVector qdot = JointVector::Ones(2);
  fresh.advance(qdot);  // before reset() nothing happens
  CHECK(fresh.q().size() == 0);
}

TEST_CASE("settings and starts that make no sense are refused") {
  const JointLimits limits = no_limits(2);
  for (const double bad : {0.0, -1.0, kNan, kInfinity}) {
    CHECK_THROWS_AS(LimitTracker(limits, bad), Error);
    CHECK_THROWS_AS(LimitTracker(limits, 1e-3, {.recovery_speed = bad}), Error);
    if (bad != kInfinity) CHECK_THROWS_AS(LimitTracker(limits, 1e-3, {.assumed_acceleration = bad}), Error);
  }
  CHECK_THROWS_AS(LimitTracker(JointLimits{}), Error);
  for (const double bad : {0.0, -1.0, kNan}) {
    for (JointVector JointLimits::* limit : {&JointLimits::velocity, &JointLimits::acceleration, &JointLimits::jerk}) {
      JointLimits wrong = limits;
      (wrong.*limit)[1] = bad;
      CHECK_THROWS_AS(LimitTracker{wrong}, Error);
      wrong.*limit = one(1.0);
      CHECK_THROWS_AS(LimitTracker{wrong}, Error);
    }
  }
  JointLimits crossed = limits;
  crossed.lower[1] = 1.0;
  crossed.upper[1] = 0.0;
  CHECK_THROWS_AS(LimitTracker{crossed}, Error);
  LimitTracker tracker(limits);
  CHECK_THROWS_AS(tracker.reset(one(0.0)), Error);
  CHECK_THROWS_AS(tracker.reset(JointVector::Zero(2), one(0.0)), Error);
  CHECK_THROWS_AS(tracker.reset(JointVector::Constant(2, kNan)), Error);
  CHECK_THROWS_AS(tracker.reset(JointVector::Zero(2), JointVector::Constant(2, kInfinity)), Error);
  CHECK_THROWS_AS(tracker.reset(JointVector::Zero(2), JointVector::Zero(2), one(0.0)), Error);
  CHECK_THROWS_AS(tracker.reset(JointVector::Zero(2), JointVector::Zero(2), JointVector::Constant(2, kNan)), Error);
}

TEST_CASE("a joint without an acceleration limit has the assumed one, and a joint with a limit keeps its own") {
  JointLimits limits = no_limits(2);
  limits.acceleration[1] = 40.0;
  for (const double assumed : {10.0, 3.0, kInfinity}) {
    LimitOptions options;
    if (assumed != 10.0) options.assumed_acceleration = assumed;
    LimitTracker tracker(limits, 0.01, options);
    tracker.reset(JointVector::Zero(2), JointVector::Ones(2));
    CHECK(tracker.bounds().upper[0] == 1.0 + assumed * 0.01);
    CHECK(tracker.bounds().lower[0] == 1.0 - assumed * 0.01);
    CHECK(tracker.bounds().upper[1] == doctest::Approx(1.4).epsilon(1e-14));
    CHECK(tracker.bounds().lower[1] == doctest::Approx(0.6).epsilon(1e-14));
    CHECK(tracker.least_acceleration() == doctest::Approx(std::min(assumed, 40.0)).epsilon(1e-14));
    CHECK(tracker.bounds().upper_kind[0] == (std::isinf(assumed) ? LimitKind::None : LimitKind::Acceleration));
  }
  LimitTracker off(limits, 0.01, {.acceleration = false});
  off.reset(JointVector::Zero(2));
  CHECK(off.bounds().upper[0] == kInfinity);
  CHECK(off.least_acceleration() == kInfinity);
}

TEST_CASE("heading bounds: position limits alone, with the room to stop, in front of the joint and behind it") {
  Random random(12);
  for (int run = 0; run < 2000; ++run) {
    const double dt = random.decades(-4.0, -1.5), a = random.decades(-1.0, 3.0), half = random.decades(-3.0, 1.0);
    JointLimits limits = no_limits(2);
    limits.lower[0] = -half;
    limits.upper[0] = half;
    limits.velocity.setConstant(random.decades(-3.0, 0.0));
    limits.acceleration.setConstant(a);
    const double j = random.decades(0.0, 6.0);
    for (const bool with_jerk : {false, true}) {
      if (with_jerk) limits.jerk.setConstant(j);
      LimitTracker tracker(limits, dt);
      tracker.reset((JointVector(2) << random.uniform(-half, half), 0.0).finished());
      const VelocityBounds heading = tracker.heading();
      CHECK(heading.upper[1] == kInfinity);
      CHECK(heading.lower[1] == -kInfinity);
      CHECK(heading.upper_kind[1] == LimitKind::None);
      CHECK(heading.upper_kind[0] == LimitKind::Position);
      // Braking cycle by cycle from the bound ends on the limit; with a jerk limit the room is that of an arrival.
      for (const bool up : {false, true}) {
        const double room = up ? half - tracker.q()[0] : tracker.q()[0] + half;
        const double v = up ? heading.upper[0] : -heading.lower[0];
        CHECK(tracker.heading_speed(0, room) == doctest::Approx(v).epsilon(1e-12));
        double sum = 0.0;
        if (room > 1e6 * a * dt * dt) {
          sum = 0.5 * v * v / a + 0.5 * v * dt;  // of so many cycles, but for a cycle's change
        } else {
          for (double x = v; x > 0.0; x -= a * dt) sum += x * dt;
        }
        if (!with_jerk) {
          CHECK(sum == doctest::Approx(room).epsilon(1e-6).scale(1e-12));
        } else {
          CHECK(sum <= room * (1.0 + 1e-6) + 1e-12);
          const double half_a = 0.5 * a, eighth = 0.125 * j;
          const double way = v <= half_a * half_a / eighth ? v * std::sqrt(v / eighth)
                                                           : 0.5 * v * (v / half_a + half_a / eighth);
          CHECK(way <= room * (1.0 + 1e-6) + 1e-12);
          CHECK((way >= room * (1.0 - 1e-6) || sum >= room * (1.0 - 1e-6)));
        }
      }
    }
  }
}

TEST_CASE("reset at the place and the speed of the last cycle keeps the acceleration; elsewhere there is none") {
  JointLimits limits = no_limits(2);
  limits.acceleration.setConstant(5.0);
  limits.jerk.setConstant(50.0);
  Random random(13);
  for (int run = 0; run < 100; ++run) {
    LimitTracker going(limits), again(limits);
    for (LimitTracker* tracker : {&going, &again}) tracker->reset(JointVector::Zero(2));
    for (int cycle = 0; cycle < 300; ++cycle) {
      JointVector a = 3.0 * random.vector(2), b = a;
      again.reset(JointVector(again.q()), JointVector(again.qdot()));
      CHECK((going.bounds().lower - again.bounds().lower).isZero(0.0));
      CHECK((going.bounds().upper - again.bounds().upper).isZero(0.0));
      going.advance(a);
      again.advance(b);
    }
    LimitTracker still(limits);
    // Joint 0 goes on, joint 1 has another velocity and so no acceleration.
    JointVector moved = going.qdot();
    moved[1] += 0.1;
    again.reset(going.q(), moved);
    still.reset(going.q(), moved);
    CHECK(again.bounds().upper[0] == going.bounds().upper[0]);
    CHECK(again.bounds().upper[1] == still.bounds().upper[1]);
  }
}

TEST_CASE("reset with an acceleration: the next cycle's change differs from it by the jerk limit") {
  JointLimits limits = no_limits(1);
  limits.acceleration[0] = 5.0;
  limits.jerk[0] = 50.0;
  constexpr double dt = 1e-3;
  for (const double acceleration : {-5.0, -2.0, 0.0, 0.7, 5.0}) {
    LimitTracker tracker(limits, dt);
    tracker.reset(one(0.0), one(0.4), one(acceleration));
    const double up = std::min(5.0, acceleration + 50.0 * dt), down = std::max(-5.0, acceleration - 50.0 * dt);
    CHECK((tracker.bounds().upper[0] - 0.4) / dt == doctest::Approx(up).epsilon(1e-6));
    CHECK((tracker.bounds().lower[0] - 0.4) / dt == doctest::Approx(down).epsilon(1e-6));
  }
}

TEST_CASE("reset: everything before is forgotten") {
  Random random(10);
  JointLimits limits = no_limits(3);
  limits.acceleration.setConstant(5.0);
  limits.jerk.setConstant(50.0);
  LimitTracker used(limits), fresh(limits);
  used.reset(random.vector(3), random.vector(3));
  for (int cycle = 0; cycle < 50; ++cycle) {
    JointVector qdot = random.vector(3);
    used.advance(qdot);
  }
  const JointVector start = random.vector(3);
  used.reset(start);
  fresh.reset(start);
  for (int cycle = 0; cycle < 50; ++cycle) {
    JointVector a = random.vector(3), b = a;
    used.advance(a);
    fresh.advance(b);
    REQUIRE(a == b);
  }
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("no heap in the loop") {
  Random random(11);
  for (const int n : {1, 7, kMaxJoints}) {
    JointLimits limits = no_limits(n);
    for (int i = 0; i < n; ++i) draw_limits(random, i % 2 == 0, 1e-3, i, limits);
    LimitTracker tracker(limits, 1e-3, kAsGiven);
    tracker.reset(JointVector::Zero(n));
    JointVector qdot = 10.0 * random.vector(n);
    const test::HeapWatch watch;
    for (int cycle = 0; cycle < 1000; ++cycle) {
      JointVector asked = cycle % 100 < 50 ? qdot : JointVector(-qdot);
      tracker.advance(asked);
    }
    CHECK(watch.calls() == 0);
  }
}
#endif
