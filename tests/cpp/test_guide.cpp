// A guided servo: it reaches what PositionIk can reach, inside all limits, and says what it does.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <sigmaik/pose.hpp>
#include <sigmaik/position_ik.hpp>
#include <sigmaik/servo.hpp>

#include "arms.hpp"
#include "heap.hpp"
#include "limit_watch.hpp"
#include "numbers.hpp"
#include "random.hpp"
#include "settling.hpp"

namespace {

using namespace sigmaik;
using test::arms;
using test::Random;

constexpr double kDt = 2e-3;
constexpr double kHalfDegree = 0.5 * M_PI / 180.0;

Servo guided(const Chain& chain, const Method& method = JParse{}) {
  ServoOptions options;
  options.dt = kDt;
  options.guided = true;
  return Servo(chain, method, options);
}

bool there(const Servo& servo, const Pose& target) {
  const Twist error = pose_error(servo.tip(), target);
  return error.head<3>().norm() < 1e-3 && error.tail<3>().norm() < kHalfDegree;
}

struct Way {
  double arrived = 1e9;  // [s] from which on the tip stays at the target
  long broken = 0;       // limits
  bool left = false;     // the joints went their own way
  GuideState last = GuideState::Off;
};

// Drives until the tip has been at the target for half a second, or for `time`.
Way drive(Servo& servo, const Pose& target, double time) {
  Way way;
  test::LimitWatch watch(servo.chain().limits(), kDt, servo.qdot());
  for (int cycle = 0; cycle < static_cast<int>(time / kDt); ++cycle) {
    const ServoStep step = servo.update(target);
    watch.step(step);
    way.last = step.guide;
    way.left = way.left || step.guide == GuideState::ChangingBranch;
    if (!there(servo, target)) {
      way.arrived = 1e9;
    } else if (way.arrived > 1e8) {
      way.arrived = kDt * (cycle + 1);
    } else if (kDt * cycle - way.arrived > 0.5) {
      break;
    }
  }
  way.broken = watch.broken;
  return way;
}

// [s] of the fastest motion of the joints from rest to rest.
double joint_time(const Chain& chain, const JointVector& from, const JointVector& to) {
  double longest = 0.0;
  for (int i = 0; i < chain.dof(); ++i) {
    const double way = std::abs(to[i] - from[i]), v = chain.limits().velocity[i];
    const double a = std::min(10.0, chain.limits().acceleration[i]);
    longest = std::max(longest, way > v * v / a ? way / v + v / a : 2.0 * std::sqrt(way / a));
  }
  return longest;
}

JointVector zeros(const Chain& chain) {
  return JointVector::Zero(chain.dof()).cwiseMax(chain.limits().lower).cwiseMin(chain.limits().upper);
}

}  // namespace

TEST_CASE("any pose that the arm can take is reached from any start, in 5 s or 1.5 times the joints' least time") {
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    Random random(21);
    const PositionIk ik(chain);
    Servo servo = guided(chain);
    for (int trial = 0; trial < 12; ++trial) {
      CAPTURE(name);
      CAPTURE(trial);
      const JointVector q = test::start_of(random, chain, 0.98);
      const Pose target = pose(chain, test::start_of(random, chain, 0.98));
      const PositionIkResult nearest = ik.solve(target, q);
      REQUIRE(nearest.status == PositionIkStatus::Ok);
      servo.reset(q);
      const double time = std::max(5.0, 1.5 * joint_time(chain, q, nearest.q));
      const Way way = drive(servo, target, time + 0.6);
      CHECK(way.arrived <= time);
      CHECK(way.broken == 0);
    }
  }
}

TEST_CASE("the tool leaves its way only where the servo's own way does not arrive") {
  for (const char* name : {"ufactory_xarm7", "ur10", "kinova_gen3_7dof"}) {
    const Chain& chain = arms().at(name);
    Random random(5);
    Servo servo = guided(chain);
    ServoOptions options;
    options.dt = kDt;
    Servo own(chain, JParse{}, options);
    int left = 0;
    for (int trial = 0; trial < 20; ++trial) {
      CAPTURE(name);
      CAPTURE(trial);
      const JointVector q = test::start_of(random, chain, 0.98);
      const Pose target = pose(chain, test::start_of(random, chain, 0.98));
      servo.reset(q);
      own.reset(q);
      const Way with = drive(servo, target, 7.0), without = drive(own, target, 3.5);
      // A prediction in coarser cycles may differ from the servo's own way where that way hardly arrives.
      if (without.arrived < 3.0) left += with.left ? 1 : 0;
    }
    CHECK(left <= 1);
  }
}

TEST_CASE("a near target gets the servo's own way, to the last digit") {
  const Chain& chain = arms().at("franka_panda");
  Random random(9);
  ServoOptions options;
  options.dt = kDt;
  Servo servo = guided(chain), own(chain, JParse{}, options);
  for (int trial = 0; trial < 5; ++trial) {
    const JointVector q = test::start_of(random, chain, 0.8);
    const Pose target = pose(chain, test::near(random, chain, q, 0.25));
    servo.reset(q);
    own.reset(q);
    for (int cycle = 0; cycle < 1500; ++cycle) {
      const ServoStep a = servo.update(target), b = own.update(target);
      REQUIRE((a.qdot.array() == b.qdot.array()).all());
      CHECK(a.guide == GuideState::Direct);
      CHECK(b.guide == GuideState::Off);
    }
    CHECK(there(servo, target));
  }
}

TEST_CASE("from exact zeros, each small motion along and about each axis is made where a configuration exists") {
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    const PositionIk ik(chain);
    Servo servo = guided(chain);
    const JointVector start = zeros(chain);
    for (int axis = 0; axis < 6; ++axis) {
      for (const double way : {-0.2, 0.2}) {
        CAPTURE(name);
        CAPTURE(axis);
        CAPTURE(way);
        Twist by = Twist::Zero();
        by[axis] = axis < 3 ? way * chain.characteristic_length() : way;
        Pose target = pose(chain, start);
        target.translation() += by.head<3>();
        target.linear() = (rotation_exp(by.tail<3>()) * target.linear()).eval();
        const bool reachable = ik.solve(target, start).status == PositionIkStatus::Ok;
        servo.reset(start);
        const Way done = drive(servo, target, 5.5);
        CHECK(done.broken == 0);
        if (reachable) CHECK(done.arrived < 5.0);
        // Less than a millimetre out of reach, the tip is at the target, too.
        if (done.arrived > 5.0) CHECK(done.last == GuideState::Unreachable);
      }
    }
  }
}

TEST_CASE("out of reach the guide says so, and the arm comes home from there in any direction") {
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    Random random(33);
    Servo servo = guided(chain);
    for (int trial = 0; trial < 6; ++trial) {
      CAPTURE(name);
      CAPTURE(trial);
      const JointVector q = test::start_of(random, chain, 0.6);
      const Pose home = pose(chain, q);
      Pose away = home;
      away.translation() += 20.0 * chain.characteristic_length() * random.unit(3);
      servo.reset(q);
      const Way out = drive(servo, away, 3.0), back = drive(servo, home, 6.0);
      CHECK(out.last == GuideState::Unreachable);
      CHECK(back.arrived < 6.0);
      CHECK(out.broken + back.broken == 0);
    }
  }
}

TEST_CASE("the guide is deterministic, and copies go on as the original does") {
  const Chain& chain = arms().at("ufactory_xarm7");
  Random random(2);
  for (int trial = 0; trial < 6; ++trial) {
    const JointVector q = test::start_of(random, chain, 0.98);
    const Pose target = pose(chain, test::start_of(random, chain, 0.98));
    Servo servo = guided(chain), again = guided(chain);
    servo.reset(q);
    again.reset(q);
    for (int cycle = 0; cycle < 60; ++cycle) {
      REQUIRE((servo.update(target).qdot.array() == again.update(target).qdot.array()).all());
    }
    Servo copy = servo;
    for (int cycle = 0; cycle < 1000; ++cycle) {
      const ServoStep a = servo.update(target), b = again.update(target), c = copy.update(target);
      REQUIRE((a.qdot.array() == b.qdot.array()).all());
      REQUIRE((a.qdot.array() == c.qdot.array()).all());
    }
  }
}

TEST_CASE("a target that keeps moving, and a twist, are never overruled") {
  const Chain& chain = arms().at("ufactory_xarm7");
  const JointVector q = zeros(chain) + JointVector::Constant(chain.dof(), 0.3);
  Servo servo = guided(chain);
  servo.reset(q);
  Pose target = servo.tip();
  for (int cycle = 0; cycle < 2000; ++cycle) {
    target.translation()[0] += 2e-3;  // 1 m/s, soon out of reach
    CHECK(servo.update(target).guide == GuideState::Direct);
  }
  for (int cycle = 0; cycle < 500; ++cycle) {
    CHECK(servo.update_twist((Twist() << 0.2, 0.0, 0.1, 0.0, 0.0, 0.0).finished()).guide == GuideState::Off);
  }
}

TEST_CASE("jerk limits, masks and other rules: guided targets are reached inside all limits") {
  Random random(14);
  for (const char* name : {"franka_panda", "ur10"}) {
    JointLimits limits = arms().at(name).limits();
    limits.jerk.setConstant(300.0);
    limits.acceleration.setConstant(8.0);
    const Chain chain = arms().at(name).with_limits(limits);
    for (const bool position_only : {false, true}) {
      for (const Method& method : {Method{JParse{}}, Method{DampedLeastSquares{0.05}}}) {
        ServoOptions options;
        options.dt = kDt;
        options.guided = true;
        if (position_only) options.task.mask = {true, true, true, false, false, false};
        Servo servo(chain, method, options);
        for (int trial = 0; trial < 4; ++trial) {
          CAPTURE(name);
          CAPTURE(position_only);
          CAPTURE(trial);
          servo.reset(test::start_of(random, chain, 0.9));
          const Pose target = pose(chain, test::start_of(random, chain, 0.9));
          test::LimitWatch watch(chain.limits(), kDt, JointVector::Zero(chain.dof()));
          for (int cycle = 0; cycle < 4000; ++cycle) watch.step(servo.update(target));
          const Twist error = pose_error(servo.tip(), target);
          CHECK(error.head<3>().norm() < 1e-3);
          if (!position_only) CHECK(error.tail<3>().norm() < kHalfDegree);
          CHECK(watch.broken == 0);
        }
      }
    }
  }
}

TEST_CASE("an arm that is pushed away from a target where it had arrived comes back") {
  const Chain& chain = arms().at("ur10");
  Random random(8);
  Servo servo = guided(chain);
  servo.reset(test::start_of(random, chain, 0.9));
  const Pose target = pose(chain, test::start_of(random, chain, 0.9));
  JointVector moved = JointVector::Zero(6);
  for (const double push : {0.0, 0.2, -0.1}) {
    moved.setConstant(push);
    for (int cycle = 0; cycle < 5000; ++cycle) {
      servo.measure(JointVector(servo.q() + moved));
      servo.update(target);
    }
    const Twist error = pose_error(pose(chain, servo.q() + moved), target);
    CHECK(error.head<3>().norm() < 1e-3);
    CHECK(error.tail<3>().norm() < kHalfDegree);
  }
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("a guided cycle touches no heap") {
  Random random(4);
  for (const char* name : {"ufactory_xarm7", "kuka_kr6_r900"}) {
    const Chain& chain = arms().at(name);
    Servo servo = guided(chain);
    for (int trial = 0; trial < 3; ++trial) {
      servo.reset(test::start_of(random, chain, 0.98));
      const Pose target = pose(chain, test::start_of(random, chain, 0.98));
      const test::HeapWatch heap;
      for (int cycle = 0; cycle < 600; ++cycle) servo.update(target);
      CHECK(heap.calls() == 0);
    }
  }
}
#endif

namespace {

// How often the guide began to lead, and how often its state changed, in `time`.
struct Changes {
  int leads = 0, states = 0;
  double fastest = 0.0;  // [m/s] the tool
};

template <typename Target>
Changes count_changes(Servo& servo, double time, Target&& target, const JointVector* offset = nullptr) {
  Changes out;
  GuideState last = GuideState::Off;
  for (int cycle = 0; cycle < static_cast<int>(time / kDt); ++cycle) {
    if (offset != nullptr) servo.measure(JointVector(servo.q() + *offset));
    const ServoStep step = servo.update(target(cycle * kDt));
    out.fastest = std::max(out.fastest, step.achieved_twist.head<3>().norm());
    if (step.guide != last) ++out.states;
    if (step.guide != last && step.guide == GuideState::ChangingBranch) ++out.leads;
    last = step.guide;
  }
  return out;
}

}  // namespace

TEST_CASE("a lead is no faster than the gains and the largest errors let the tool be, and starts as softly") {
  Random random(101);
  for (const char* name : {"ur10", "puma560"}) {
    const Chain& chain = arms().at(name);
    ServoOptions options;
    options.dt = kDt;
    options.guided = true;
    options.max_linear_error = 0.05;
    options.max_angular_error = 0.2;
    options.soft_start = 0.5;
    Servo servo(chain, JParse{}, options);
    int leads = 0;
    for (int trial = 0; trial < 6; ++trial) {
      servo.reset(test::start_of(random, chain, 0.9));
      const Pose target = pose(chain, test::start_of(random, chain, 0.9));
      const Changes changes = count_changes(servo, 8.0, [&](double) { return target; });
      leads += changes.leads;
      CHECK(changes.fastest <= 0.05 * options.gain_linear * 1.1);
    }
    CHECK(leads > 0);
  }
}

TEST_CASE("where the measured arm cannot get to the target, the guide leads three times and no more") {
  const Chain& chain = arms().at("kuka_kr6_r900");
  const JointLimits& limits = chain.limits();
  JointVector q = (0.8 * limits.lower + 0.2 * limits.upper).array() + 0.3;
  q[1] = limits.lower[1];
  JointVector offset = JointVector::Zero(6);
  offset[1] = 5e-3;  // the reference would have to go beyond the limit
  Servo servo = guided(chain);
  servo.reset(JointVector(q.array() + 0.1));
  const Pose target = pose(chain, q);
  CHECK(count_changes(servo, 40.0, [&](double) { return target; }, &offset).leads <= 3);
  CHECK(test::at_rest(chain, servo.qdot()));
}

TEST_CASE("targets with noise, and targets that drift, do not make the guide go to and fro") {
  for (const char* name : {"ur10", "ufactory_xarm7"}) {
    const Chain& chain = arms().at(name);
    Random random(100);
    Servo servo = guided(chain);
    for (int trial = 0; trial < 4; ++trial) {
      CAPTURE(name);
      CAPTURE(trial);
      const JointVector q = test::start_of(random, chain, 0.9);
      const Pose target = pose(chain, test::start_of(random, chain, 0.9));
      servo.reset(q);
      const auto noisy = [&](double) {
        Pose out = target;
        out.translation() += 1e-4 * random.vector(3);
        return out;
      };
      CHECK(count_changes(servo, 8.0, noisy).states <= 12);
      servo.reset(q);
      const auto drifting = [&](double t) {
        Pose out = target;
        out.translation() += 0.01 * (t - 8.0) * Eigen::Vector3d(0.6, 0.64, 0.48);
        return out;
      };
      CHECK(count_changes(servo, 8.0, drifting).leads <= 3);
    }
  }
}

TEST_CASE("rows that the mask leaves out do not matter to the guide") {
  const Chain& chain = arms().at("ur10");
  ServoOptions options;
  options.dt = kDt;
  options.guided = true;
  options.task.mask = {true, true, true, false, false, false};
  Servo servo(chain, JParse{}, options);
  Random random(3);
  for (int trial = 0; trial < 10; ++trial) {
    const JointVector q = 2.0 * random.vector(6);
    Pose target = pose(chain, q + 0.3 * random.vector(6));
    JointVector ends[2];
    for (int turned = 0; turned < 2; ++turned) {
      if (turned == 1) target.linear() = (rotation_exp(Eigen::Vector3d(0.0, 0.0, 3.0)) * target.linear()).eval();
      servo.reset(q);
      for (int cycle = 0; cycle < 1500; ++cycle) servo.update(target);
      ends[turned] = servo.q();
    }
    CHECK((ends[0] - ends[1]).cwiseAbs().maxCoeff() < 1e-9);
  }
}
