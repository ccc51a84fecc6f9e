// Braking has a limit of its own: no cycle speeds up faster than A, no cycle brakes faster than B, positions hold.

#include <doctest/doctest.h>

#include <cmath>

#include <sigmaik/error.hpp>
#include <sigmaik/limits.hpp>
#include <sigmaik/servo.hpp>

#include "arms.hpp"
#include "numbers.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::kInfinity;
using test::Random;

JointLimits one_joint(double a, double b, double jerk, double velocity, double range) {
  const auto one = [](double x) { return JointVector(JointVector::Constant(1, x)); };
  JointLimits limits;
  limits.lower = one(-range);
  limits.upper = one(range);
  limits.velocity = one(velocity);
  limits.acceleration = one(a);
  limits.deceleration = one(b);
  limits.jerk = one(jerk);
  limits.effort = one(kInfinity);
  return limits;
}

// The largest parts of A and of B that cycles have used, by the sign before the cycle and by the sign after it.
class Watch {
 public:
  Watch(double a, double b, double dt) : a_(a), b_(b), dt_(dt) {}
  void step(double v) {
    const double change = (v - v_) / dt_;
    const auto judge = [&](double sign) {
      if (sign * change > 0.0) speeding = std::max(speeding, std::abs(change) / a_);
      if (sign * change < 0.0) braking = std::max(braking, std::abs(change) / b_);
    };
    judge(v_ != 0.0 ? v_ : v);
    judge(v != 0.0 ? v : v_);
    v_ = v;
  }
  double speeding = 0.0, braking = 0.0;

 private:
  double a_, b_, dt_, v_ = 0.0;
};

}  // namespace

TEST_CASE("a stop takes v²/2B, in both directions, and not v²/2A") {
  for (const double jerk : {kInfinity, 1000.0}) {
    for (const auto& [a, b] : {std::pair{5.0, 3.0}, std::pair{2.0, 8.0}, std::pair{10.0, 1.0}}) {
      for (const double sign : {1.0, -1.0}) {
        const double dt = 1e-3;
        LimitTracker tracker(one_joint(a, b, jerk, 1.0, 100.0), dt);
        tracker.reset(JointVector::Zero(1));
        JointVector qdot(1);
        for (int i = 0; i < 4000; ++i) {
          qdot[0] = sign * 10.0;
          tracker.advance(qdot);
        }
        CHECK(tracker.qdot()[0] == doctest::Approx(sign));
        const double from = tracker.q()[0];
        int cycles = 0;
        while (tracker.qdot()[0] != 0.0 && cycles < 4000) {
          qdot = tracker.stop();
          tracker.advance(qdot);
          ++cycles;
        }
        const double ramp = jerk < kInfinity ? 0.5 * b / jerk : 0.0;  // of the two ends
        CHECK(std::abs(tracker.q()[0] - from) == doctest::Approx(0.5 / b + ramp).epsilon(0.01));
        CHECK(cycles * dt == doctest::Approx(1.0 / b + 2.0 * ramp).epsilon(0.02));
      }
    }
  }
}

TEST_CASE("whatever is asked, speeding up keeps to A, braking to B, and the positions to their limits") {
  Random random(7);
  double speeding = 0.0, braking = 0.0;
  for (int trial = 0; trial < 400; ++trial) {
    const bool with_jerk = trial % 2 == 1;
    const double a = random.decades(-1.0, 1.5), b = a * random.decades(-1.0, 1.0), dt = 1e-3;
    // Jerk limits from which an acceleration takes from 2 to 300 cycles.
    const double jerk = with_jerk ? std::min(a, b) / dt * random.decades(-2.5, -0.3) : kInfinity;
    const double velocity = random.decades(-1.0, 0.5), range = random.decades(-2.0, 0.5);
    LimitTracker tracker(one_joint(a, b, jerk, velocity, range), dt);
    tracker.reset(JointVector::Zero(1));
    Watch watch(a, b, dt);
    JointVector qdot(1);
    double asked = 0.0;
    for (int i = 0; i < 1500; ++i) {
      if (i % 60 == 0) asked = random.chance(0.2) ? 0.0 : random.uniform(-2.0, 2.0) * velocity;
      qdot[0] = asked;
      if (random.chance(0.3)) qdot = tracker.approach(qdot);
      if (random.chance(0.02)) qdot[0] = random.chance(0.5) ? -1e3 : 1e3;
      const VelocityBounds bounds = tracker.bounds();
      REQUIRE(bounds.lower[0] <= bounds.upper[0]);
      tracker.advance(qdot);
      watch.step(tracker.qdot()[0]);
      REQUIRE(std::abs(tracker.q()[0]) <= range);
      REQUIRE(std::abs(tracker.qdot()[0]) <= velocity * (1.0 + 1e-9));
    }
    REQUIRE(tracker.recovering() == 0);
    CAPTURE(trial);
    CHECK(watch.speeding <= 1.0 + 1e-6);
    CHECK(watch.braking <= 1.0 + 1e-6);
    speeding = std::max(speeding, watch.speeding);
    braking = std::max(braking, watch.braking);
  }
  CHECK(speeding > 0.99);  // the limits are used
  CHECK(braking > 0.99);
}

TEST_CASE("the bounds are continuous in the velocity, through zero") {
  for (const double jerk : {kInfinity, 400.0}) {
    for (const auto& [a, b] : {std::pair{5.0, 3.0}, std::pair{3.0, 5.0}}) {
      const double dt = 1e-3, step = 1e-7;
      double last_low = 0.0, last_high = 0.0;
      for (int i = -200000; i <= 200000; i += 997) {
        for (const int more : {0, 1}) {
          LimitTracker tracker(one_joint(a, b, jerk, 10.0, kInfinity), dt);
          tracker.reset(JointVector::Zero(1), JointVector::Constant(1, (i + more) * step));
          const double low = tracker.bounds().lower[0], high = tracker.bounds().upper[0];
          if (more == 1) {
            REQUIRE(std::abs(low - last_low) < 20.0 * step);
            REQUIRE(std::abs(high - last_high) < 20.0 * step);
          }
          last_low = low;
          last_high = high;
        }
      }
    }
  }
}

TEST_CASE("equal limits, and a deceleration that is not given, are the same to the last digit") {
  Random random(8);
  for (const double jerk : {kInfinity, 500.0}) {
    JointLimits given = one_joint(5.0, 5.0, jerk, 1.0, 0.5), none = given;
    none.deceleration = JointVector();
    LimitTracker first(given), second(none);
    first.reset(JointVector::Zero(1));
    second.reset(JointVector::Zero(1));
    for (int i = 0; i < 3000; ++i) {
      JointVector one = JointVector::Constant(1, random.uniform(-2.0, 2.0)), other = one;
      first.advance(one);
      second.advance(other);
      REQUIRE(one == other);
      REQUIRE(first.q() == second.q());
    }
  }
  JointLimits bad = one_joint(5.0, 0.0, kInfinity, 1.0, 0.5);
  CHECK_THROWS_AS(LimitTracker{bad}, Error);
}

TEST_CASE("a servo brakes before its target with B, and arrives") {
  for (const double jerk : {kInfinity, 300.0}) {
    const Chain& bare = test::arms().at("ufactory_xarm7");
    JointLimits limits = bare.limits();
    limits.acceleration = JointVector::Constant(7, 10.0);
    limits.deceleration = JointVector::Constant(7, 2.5);
    limits.jerk = JointVector::Constant(7, jerk);
    Servo servo(bare.with_limits(limits));
    JointVector q(7);
    q << 0.0, -0.5, 0.0, 1.0, 0.0, 1.2, 0.0;
    servo.reset(q);
    Pose target = servo.tip();
    target.translation() += Eigen::Vector3d(0.2, 0.1, -0.1);
    std::vector<Watch> watches(7, Watch(10.0, 2.5, 1e-3));
    ServoStep step;
    for (int i = 0; i < 4000; ++i) {
      step = servo.update(target);
      for (int k = 0; k < 7; ++k) watches[static_cast<std::size_t>(k)].step(step.qdot[k]);
    }
    CHECK(step.pose_error.norm() < 1e-4);
    CHECK(step.qdot.cwiseAbs().maxCoeff() < 1e-3);
    for (const Watch& watch : watches) {
      CHECK(watch.braking <= 1.0 + 1e-6);
      CHECK(watch.speeding <= 1.0 + 1e-6);
    }
  }
}
