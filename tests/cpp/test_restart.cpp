// reset() on the way: limits hold over the restart where the motion before it is known or given.

#include <doctest/doctest.h>

#include <sigmaik/servo.hpp>

#include "arms.hpp"
#include "limit_watch.hpp"
#include "numbers.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::arms;
using test::Random;

Chain panda_with_jerk() {
  const Chain& chain = arms().at("franka_panda");
  JointLimits limits = chain.limits();
  limits.jerk << 7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0;
  return chain.with_limits(limits);
}

JointVector start() {
  JointVector q(7);
  q << 0.0, -0.4, 0.0, -2.0, 0.0, 1.6, 0.7;
  return q;
}

}  // namespace

TEST_CASE("reset at the servo's own last command, in every cycle or in every 33rd, breaks no limit") {
  const Chain chain = panda_with_jerk();
  for (const int every : {1, 33}) {
    for (const bool as_pose : {false, true}) {
      CAPTURE(every);
      CAPTURE(as_pose);
      Servo servo(chain);
      servo.reset(start());
      Pose target = servo.tip();
      target.translation() += Eigen::Vector3d(-0.2, 0.3, 0.2);
      Twist twist = Twist::Zero();
      twist[5] = 3.0;
      test::LimitWatch watch(chain.limits(), servo.options().dt, JointVector::Zero(7));
      for (int cycle = 1; cycle <= 4000; ++cycle) {
        const ServoStep step = as_pose ? servo.update(target) : servo.update_twist(twist);
        watch.step(step);
        if (cycle % every == 0) servo.reset(step.q, step.qdot);
      }
      CHECK((servo.q() - start()).norm() > 0.05);
      CHECK(watch.broken == 0);
    }
  }
}

TEST_CASE("a servo that is told position, velocity and acceleration of a moving arm goes on inside all limits") {
  const Chain chain = panda_with_jerk();
  Random random(1);
  int needed = 0;
  for (int trial = 0; trial < 60; ++trial) {
    CAPTURE(trial);
    Servo before(chain);
    before.reset(start());
    const Twist twist = random.vector(6), other = random.vector(6);
    test::LimitWatch told(chain.limits(), 1e-3, JointVector::Zero(7)), untold = told;
    const int until = random.integer(5, 300);
    for (int cycle = 0; cycle < until; ++cycle) {
      const ServoStep step = before.update_twist(twist);
      told.step(step);
      untold.step(step);
    }
    Servo with(chain), without(chain);
    with.reset(before.q(), before.qdot(), told.qddot());
    without.reset(before.q(), before.qdot());
    for (int cycle = 0; cycle < 500; ++cycle) {
      told.step(with.update_twist(other));
      untold.step(without.update_twist(other));
    }
    CHECK(told.broken == 0);
    needed += untold.broken > 0;
  }
  CHECK(needed > 10);
}
