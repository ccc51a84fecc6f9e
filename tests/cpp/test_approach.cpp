// One joint on the way to a velocity and to a place: arrival() and approach() against closed forms and simulations.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include <sigmaik/limits.hpp>

#include "limit_watch.hpp"
#include "numbers.hpp"
#include "random.hpp"
#include "stopping_time.hpp"

namespace {

using namespace sigmaik;
using test::kInfinity;
using test::Random;

constexpr double kDt = 1e-3;

JointLimits limits_of(const JointVector& acceleration, const JointVector& jerk) {
  const JointVector infinite = JointVector::Constant(acceleration.size(), kInfinity);
  JointLimits limits;
  limits.lower = -infinite;
  limits.upper = limits.velocity = limits.effort = infinite;
  limits.acceleration = acceleration;
  limits.jerk = jerk;
  return limits;
}

JointVector one(double x) { return JointVector::Constant(1, x); }

// The distance of the fastest stop from v.
double stopping_distance(double v, double a, double j) {
  if (std::isinf(j)) return 0.5 * v * v / a;
  return v <= a * a / j ? v * std::sqrt(v / j) : 0.5 * v * (v / a + a / j);
}

}  // namespace

TEST_CASE("an arrival may be as fast as half of the acceleration and an eighth of the jerk stop at the target") {
  Random random(1);
  int slowed = 0;
  for (int run = 0; run < 5000; ++run) {
    const int n = random.integer(1, 7);
    JointVector a(n), j(n), qdot(n);
    for (int i = 0; i < n; ++i) {
      a[i] = random.decades(-0.3, 3.0);
      j[i] = random.chance(0.3) ? kInfinity : random.decades(1.3, 5.0);
      qdot[i] = random.chance(0.1) ? 0.0 : random.normal() * random.decades(-6.0, 2.0);
    }
    const double gain = random.decades(-1.0, 2.0);
    LimitTracker tracker(limits_of(a, j), kDt);
    tracker.reset(JointVector::Zero(n));
    const double part = tracker.arrival(qdot, gain);
    const auto fits = [&](double s) {
      for (int i = 0; i < n; ++i) {
        const double v = std::abs(qdot[i]);
        if (stopping_distance(s * v, 0.5 * a[i], 0.125 * j[i]) > v / gain) return false;
      }
      return true;
    };
    CHECK(part <= 1.0);
    CHECK(part > 0.0);
    CHECK(fits(part * (1.0 - 1e-9)));
    if (part < 1.0) {
      ++slowed;
      CHECK(!fits(part * (1.0 + 1e-9)));
    }
  }
  CHECK(slowed > 1000);
  CHECK(slowed < 4900);
}

TEST_CASE("one joint that follows arrival() and approach() never overshoots its target, and arrives") {
  Random random(2);
  for (int run = 0; run < 200; ++run) {
    const double a = random.decades(std::log10(0.5), 3.0);
    const double j = run % 5 == 0 ? kInfinity : random.decades(std::log10(20.0), 5.0);
    const double goal = random.decades(-4.0, 0.5), gain = 10.0;
    LimitTracker tracker(limits_of(one(a), one(j)), kDt);
    tracker.reset(one(0.0));
    test::LimitWatch watch(limits_of(one(a), one(j)), kDt, one(0.0));
    double beyond = 0.0;
    // The stops of the plan, once to speed up and once to brake, and the decay by the gain.
    const double way = std::sqrt(goal / (0.5 * a)) + (std::isinf(j) ? 0.0 : std::cbrt(goal / (0.125 * j)));
    const int cycles = static_cast<int>((4.0 * way + 2.5) / kDt);
    for (int cycle = 0; cycle < cycles; ++cycle) {
      JointVector qdot = one(gain * (goal - tracker.q()[0]));
      qdot *= tracker.arrival(qdot, gain);
      if (tracker.has_jerk()) qdot = tracker.approach(qdot);
      tracker.advance(qdot);
      watch.step(tracker.q(), tracker.qdot());
      beyond = std::max(beyond, tracker.q()[0] - goal);
    }
    CAPTURE(a);
    CAPTURE(j);
    CAPTURE(goal);
    CHECK(beyond <= 1e-9);
    CHECK(std::abs(tracker.q()[0] - goal) < 1e-6);
    CHECK(std::abs(tracker.qdot()[0]) < 1e-5);
    CHECK(watch.broken == 0);
  }
}

TEST_CASE("from a constant velocity all joints change in proportion, in the least time of the slowest of them") {
  Random random(3);
  for (int run = 0; run < 500; ++run) {
    const int n = random.integer(1, 7);
    JointVector a(n), j(n), from(n), wanted(n);
    double least = 0.0;
    for (int i = 0; i < n; ++i) {
      a[i] = random.decades(-0.3, 3.0);
      j[i] = random.decades(1.3, 5.0);
      from[i] = random.uniform(-1.0, 1.0);
      wanted[i] = from[i] + random.uniform(-1.0, 1.0);
    }
    for (int i = 0; i < n; ++i) {
      least = std::max(least, test::stopping_time(wanted[i] - from[i], 0.0, a[i], j[i]));
    }
    const JointLimits limits = limits_of(a, j);
    LimitTracker tracker(limits, kDt);
    tracker.reset(JointVector::Zero(n), from);
    test::LimitWatch watch(limits, kDt, from);
    const JointVector way = wanted - from;
    // The joints share the tightest acceleration and the tightest jerk limit, which can be those of two joints.
    const double most = (a.array() / way.array().abs()).minCoeff(), more = (j.array() / way.array().abs()).minCoeff();
    const double time = test::stopping_time(1.0, 0.0, most, more);
    int cycle = 0;
    double crooked = 0.0;
    for (; cycle < 200000 && (tracker.qdot() - wanted).cwiseAbs().maxCoeff() > 1e-12; ++cycle) {
      JointVector qdot = tracker.approach(wanted);
      tracker.advance(qdot);
      watch.step(tracker.q(), tracker.qdot());
      const JointVector gone = tracker.qdot() - from;
      crooked = std::max(crooked, (gone - gone.dot(way) / way.squaredNorm() * way).norm());
    }
    CAPTURE(run);
    CHECK(crooked < 1e-9);
    CHECK(cycle * kDt >= least - kDt);
    CHECK(cycle * kDt <= time + 4.0 * kDt);
    for (int k = 0; k < 20; ++k) {
      JointVector qdot = tracker.approach(wanted);
      CHECK((qdot - wanted).cwiseAbs().maxCoeff() < 1e-12);  // with no acceleration left
      tracker.advance(qdot);
      watch.step(tracker.q(), tracker.qdot());
    }
    CHECK(watch.broken == 0);
  }
}

TEST_CASE("with an acceleration at the start, a joint reaches the wanted velocity in about the least time") {
  Random random(4);
  for (int run = 0; run < 1000; ++run) {
    const double a = random.decades(-0.3, 3.0), j = random.decades(1.3, 5.0);
    const double from = random.uniform(-1.0, 1.0), wanted = from + random.normal() * random.decades(-3.0, 0.0);
    const double acceleration = random.uniform(-0.9, 0.9) * std::min(a, std::sqrt(j));
    const JointLimits limits = limits_of(one(a), one(j));
    LimitTracker tracker(limits, kDt);
    tracker.reset(one(0.0), one(from), one(acceleration));
    test::LimitWatch watch(limits, kDt, one(from), one(acceleration));
    const double least = test::stopping_time(from - wanted, acceleration, a, j);
    int cycle = 0, quiet = 0;
    for (; cycle < 400000 && quiet < 3; ++cycle) {
      JointVector qdot = tracker.approach(one(wanted));
      tracker.advance(qdot);
      watch.step(tracker.q(), tracker.qdot());
      quiet = std::abs(tracker.qdot()[0] - wanted) < 1e-12 ? quiet + 1 : 0;
    }
    CAPTURE(run);
    CAPTURE(a);
    CAPTURE(j);
    CAPTURE(from);
    CAPTURE(wanted);
    CAPTURE(acceleration);
    CHECK(quiet == 3);
    const double time = (cycle - 2) * kDt;
    CHECK(time >= least - 4.0 * kDt);
    CHECK(time <= 1.1 * least + 6.0 * kDt);
    CHECK(watch.broken == 0);
  }
}
