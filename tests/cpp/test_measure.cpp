// Servo::measure(): the measured tool arrives, the command stays as calm as without measurements.

#include <doctest/doctest.h>

#include <algorithm>
#include <deque>

#include <sigmaik/pose.hpp>
#include <sigmaik/servo.hpp>

#include "arms.hpp"
#include "heap.hpp"
#include "limit_watch.hpp"
#include "numbers.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::arms;
using test::kInfinity;
using test::kNan;
using test::Random;

ServoOptions slow_cycle() {
  ServoOptions options;
  options.dt = 2e-3;
  return options;
}

JointVector start() {
  JointVector q(6);
  q << 0.0, -1.2, 1.5, -1.2, -1.57, 0.0;
  return q;
}

Pose behind(const Servo& servo) {
  Pose target = servo.tip();
  target.translation()[0] -= 0.1;
  return target;
}

double off(const Chain& chain, const JointVector& q, const Pose& target) {
  return (pose(chain, q).translation() - target.translation()).norm();
}

}  // namespace

TEST_CASE("an arm that lags by 20 ms, measured with noise, arrives like the open loop, inside all limits") {
  const Chain& chain = arms().at("ur10");
  for (const bool with_speed : {false, true}) {
    CAPTURE(with_speed);
    Random random(1);
    Servo open(chain, JParse{}, slow_cycle()), closed(chain, JParse{}, slow_cycle());
    open.reset(start());
    closed.reset(start());
    const Pose target = behind(open);
    std::deque<JointVector> positions(11, start()), speeds(11, JointVector::Zero(6));
    test::LimitWatch watch(chain.limits(), 2e-3, JointVector::Zero(6));
    int open_at = 0, closed_at = 0;
    double beyond = 0.0, late = 0.0;
    for (int cycle = 0; cycle < 2000; ++cycle) {
      if (off(chain, open.q(), target) > 1e-3) open_at = cycle;
      if (off(chain, positions.front(), target) > 1e-3) closed_at = cycle;
      beyond = std::max(beyond, target.translation()[0] - pose(chain, positions.front()).translation()[0]);
      if (cycle > 1500) late = std::max(late, off(chain, positions.front(), target));
      const JointVector seen = positions.front() + 1e-4 * random.vector(6);
      CHECK((with_speed ? closed.measure(seen, JointVector(speeds.front())) : closed.measure(seen)));
      open.update(target);
      const ServoStep step = closed.update(target);
      watch.step(step);
      positions.push_back(step.q);
      speeds.push_back(step.qdot);
      positions.pop_front();
      speeds.pop_front();
    }
    CHECK(watch.broken == 0);
    CHECK(closed_at * 2e-3 <= open_at * 2e-3 + 0.2);
    CHECK(beyond < (with_speed ? 1e-3 : 2e-3));  // without velocities the filter lags
    CHECK(late < 1e-4);
    CHECK(closed.following_error().cwiseAbs().maxCoeff() < 1e-4);
  }
}

TEST_CASE(
    "where the joints' controllers leave an error, the measured tool arrives, and without measurements does not") {
  const Chain& chain = arms().at("ur10");
  const JointVector offset = JointVector::Constant(6, 0.01);
  Servo open(chain, JParse{}, slow_cycle()), closed(chain, JParse{}, slow_cycle());
  open.reset(start());
  closed.reset(start());
  CHECK(closed.following_error() == JointVector::Zero(6));
  const Pose target = behind(open);
  test::LimitWatch watch(chain.limits(), 2e-3, JointVector::Zero(6));
  ServoStep step;
  for (int cycle = 0; cycle < 2500; ++cycle) {
    CHECK(closed.measure(JointVector(closed.q() + offset)));
    open.update(target);
    step = closed.update(target);
    watch.step(step);
  }
  CHECK((closed.following_error() - offset).norm() < 1e-9);
  CHECK(off(chain, closed.q() + offset, target) < 1e-6);
  CHECK(step.pose_error.norm() < 1e-6);
  CHECK(off(chain, open.q() + offset, target) > 1e-3);
  CHECK(watch.broken == 0);
}

TEST_CASE("an arm that is moved while its target rests comes back, however long the target has rested") {
  const Chain& chain = arms().at("ur10");
  ServoOptions options;
  options.dt = 4e-3;
  Servo servo(chain, JParse{}, options);
  servo.reset(start());
  const Pose target = behind(servo);
  test::LimitWatch watch(chain.limits(), options.dt, JointVector::Zero(6));
  JointVector moved = JointVector::Zero(6);
  for (const double push : {0.0, 0.05, -0.03, 0.04, -0.05, 0.02}) {
    CAPTURE(push);
    moved.setConstant(push);
    // Longer than the settling time and its fade: a servo that has given up would stay where it is.
    for (double t = 0.0; t < servo.settling_time() + 12.0; t += options.dt) {
      CHECK(servo.measure(JointVector(servo.q() + moved)));
      watch.step(servo.update(target));
    }
    CHECK(off(chain, servo.q() + moved, target) < 1e-4);
  }
  CHECK(watch.broken == 0);
}

TEST_CASE("the filter of the measurements: a step of the error is followed with a time constant of 0.1 s") {
  const Chain& chain = arms().at("ur10");
  Servo servo(chain, JParse{}, slow_cycle());
  servo.reset(start());
  servo.measure(start());
  CHECK(servo.following_error() == JointVector::Zero(6));
  const JointVector there = start() + JointVector::Constant(6, 0.01);
  double expected = 0.0;
  for (int k = 0; k < 200; ++k) {
    servo.measure(there);
    expected += 2e-3 / 0.1 * (0.01 - expected);
    CHECK((servo.following_error().array() - expected).abs().maxCoeff() < 1e-12);
  }
}

TEST_CASE("measurements that make no sense are refused and leave no trace, and reset() forgets all of them") {
  const Chain& chain = arms().at("ur10");
  Servo servo(chain, JParse{}, slow_cycle()), untouched(chain, JParse{}, slow_cycle());
  CHECK(!servo.measure(start()));  // before reset()
  servo.reset(start());
  untouched.reset(start());
  const Pose target = behind(servo);
  for (int cycle = 0; cycle < 100; ++cycle) {
    for (const double bad : {kNan, kInfinity, -kInfinity}) {
      JointVector wrong = start();
      wrong[cycle % 6] = bad;
      CHECK(!servo.measure(wrong));
      CHECK(!servo.measure(start(), wrong));
    }
    CHECK(!servo.measure(JointVector::Zero(5)));
    CHECK(!servo.measure(JointVector()));
    CHECK(!servo.measure(start(), JointVector::Zero(7)));
    CHECK(servo.update(target).q == untouched.update(target).q);
  }
  CHECK(servo.measure(JointVector(start() + JointVector::Constant(6, 0.3))));
  CHECK(!servo.following_error().isZero(0.0));
  servo.reset(start());
  untouched.reset(start());
  CHECK(servo.following_error() == JointVector::Zero(6));
  for (int cycle = 0; cycle < 100; ++cycle) CHECK(servo.update(target).q == untouched.update(target).q);
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("measurements touch no heap") {
  Servo servo(arms().at("ur10"), JParse{}, slow_cycle());
  servo.reset(start());
  const Pose target = behind(servo);
  const JointVector rest = JointVector::Zero(6), wrong = JointVector::Constant(6, kNan);
  const test::HeapWatch watch;
  for (int cycle = 0; cycle < 100; ++cycle) {
    servo.measure(servo.q());
    servo.measure(servo.q(), rest);
    servo.measure(wrong);
    servo.update(target);
  }
  CHECK(watch.calls() == 0);
}
#endif
