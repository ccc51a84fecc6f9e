// The elbow of a guided servo keeps the side from which the arm can come back.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include <sigmaik/pose.hpp>
#include <sigmaik/servo.hpp>

#include "arms.hpp"
#include "limit_watch.hpp"
#include "random.hpp"
#include "settling.hpp"

namespace {

using namespace sigmaik;
using test::arms;
using test::Random;

constexpr double kDt = 2e-3;

// [rad] the straight angle of joint 4 by the makers' drawings: the elbow's offsets, the lengths of upper arm and
// forearm. The long side is below it.
const std::map<std::string, double> kStraight{
    {"franka_panda", -(std::atan(82.5 / 316.0) + std::atan(82.5 / 384.0))},
    {"ufactory_xarm7", M_PI - (std::atan(52.5 / 293.0) + std::atan(77.5 / 342.5))},
};

Servo servo_of(const Chain& chain, bool guided) {
  ServoOptions options;
  options.dt = kDt;
  options.guided = guided;
  return Servo(chain, JParse{}, options);
}

struct Trip {
  bool back = false;
  long broken = 0;       // limits
  double fourth = -1e9;  // [rad] the largest angle of joint 4
};

// Pulls the tip by a twist for three seconds, and then back to where it was.
Trip pull(Servo& servo, const Eigen::Vector3d& direction) {
  constexpr double kSpeed = 0.3;
  const Eigen::Vector3d home = servo.tip().translation();
  Trip trip;
  test::LimitWatch watch(servo.chain().limits(), kDt, servo.qdot());
  Twist twist = Twist::Zero();
  for (int cycle = 0; cycle < static_cast<int>(8.0 / kDt) && !trip.back; ++cycle) {
    const Eigen::Vector3d way = home - servo.tip().translation();
    if (cycle * kDt < 3.0) {
      twist.head<3>() = kSpeed * direction;
    } else {
      trip.back = way.norm() < 2e-3;
      twist.head<3>() = way * std::min(5.0, kSpeed / std::max(way.norm(), 1e-9));
    }
    watch.step(servo.update_twist(twist));
    trip.fourth = std::max(trip.fourth, servo.q()[3]);
  }
  trip.broken = watch.broken;
  return trip;
}

// A start on the long side, away from the limits.
JointVector long_side(Random& random, const Chain& chain, double straight) {
  JointVector q = test::start_of(random, chain, 0.6);
  q[3] = random.uniform(straight - 1.8, straight - 0.4);
  return q;
}

}  // namespace

TEST_CASE("pulled beyond its reach by twists, the elbow stays on its long side, and more ways lead back") {
  int with = 0, without = 0;
  for (const auto& [key, straight] : kStraight) {
    const Chain& chain = arms().at(key);
    Servo guided = servo_of(chain, true), own = servo_of(chain, false);
    Random random(8);
    for (int trial = 0; trial < 25; ++trial) {
      const std::string& name = key;
      CAPTURE(name);
      CAPTURE(trial);
      const JointVector q = long_side(random, chain, straight);
      const Eigen::Vector3d direction = random.unit(3);
      guided.reset(q);
      own.reset(q);
      const Trip trip = pull(guided, direction);
      CHECK(trip.fourth < straight - 0.02);
      CHECK(trip.broken == 0);
      with += trip.back;
      without += pull(own, direction).back;
    }
  }
  MESSAGE(with, " of 50 come back, ", without, " without the guide");
  CHECK(with > without);
}

TEST_CASE("with jerk limits the elbow stays on its long side, too") {
  Random random(4);
  for (const auto& [key, straight] : kStraight) {
    for (int trial = 0; trial < 8; ++trial) {
      const std::string& name = key;
      CAPTURE(name);
      CAPTURE(trial);
      JointLimits limits = arms().at(key).limits();
      limits.jerk.setConstant(std::pow(10.0, random.uniform(1.5, 4.0)));
      const Chain chain = arms().at(key).with_limits(limits);
      Servo servo = servo_of(chain, true);
      servo.reset(long_side(random, chain, straight));
      const Trip trip = pull(servo, random.unit(3));
      CHECK(trip.fourth < straight - 0.02);
      CHECK(trip.broken == 0);
    }
  }
}

namespace {

// Joint 3 of arms with two long sides, and its straight angle: where the wrist is farthest from the shoulder's axis.
const std::map<std::string, double> kTwoLongSides{
    {"ur10", 0.0}, {"puma560", -M_PI / 2 + std::atan(0.0203 / 0.4318)}, {"kuka_kr6_r900", std::atan(25.0 / 420.0)}};

}  // namespace

TEST_CASE("an elbow with two long sides keeps its side, and the arm comes back to the joint positions where it was") {
  int with = 0, without = 0;
  for (const auto& [key, straight] : kTwoLongSides) {
    const std::string& name = key;
    CAPTURE(name);
    const Chain& chain = arms().at(key);
    Servo guided = servo_of(chain, true), own = servo_of(chain, false);
    Random random(3);
    for (int trial = 0; trial < 25; ++trial) {
      CAPTURE(trial);
      const JointVector q = test::start_of(random, chain, 0.6);
      const Eigen::Vector3d direction = random.unit(3);
      const auto returns = [&](Servo& servo) {
        servo.reset(q);
        const Pose home = servo.tip();
        Twist out = Twist::Zero();
        out.head<3>() = 0.3 * direction;
        for (int k = 0; k < 1500; ++k) servo.update_twist(out);
        for (int k = 0; k < 3500; ++k) {
          Twist error = pose_error(servo.tip(), home);
          error.head<3>() *= std::min(5.0, 0.3 / std::max(error.head<3>().norm(), 1e-9));
          error.tail<3>() *= std::min(5.0, 0.8 / std::max(error.tail<3>().norm(), 1e-9));
          servo.update_twist(error);
        }
        return (servo.q() - q).cwiseAbs().maxCoeff() < 0.05;
      };
      with += returns(guided);
      without += returns(own);
      const double before = q[2] - straight, after = guided.q()[2] - straight;
      CHECK(before * after > 0.0);
      CHECK(std::abs(after) > std::min(std::abs(before), 0.03));
    }
  }
  MESSAGE(with, " of 75 come back to their joint positions, ", without, " without the guide");
  CHECK(with > without + 10);
}

TEST_CASE("an elbow that is exactly straight, but for rounding, bends where a servo without a guide bends it") {
  for (const std::string name : {"ur10", "kuka_kr6_r900"}) {
    const Chain& chain = arms().at(name);
    const double straight = kTwoLongSides.at(name);
    Servo guided = servo_of(chain, true), own = servo_of(chain, false);
    Random random(3);
    int bent = 0, with = 0;
    for (int trial = 0; trial < 20; ++trial) {
      CAPTURE(name);
      JointVector q = test::start_of(random, chain, 0.6);
      q[2] = straight + random.uniform(-1e-9, 1e-9);
      guided.reset(q);
      own.reset(q);
      const Twist twist = 0.2 * random.unit(6);
      const auto open = [&](const Servo& servo) { return std::abs(servo.q()[2] - straight); };
      int cycle = 0;
      for (; cycle < 500 && open(own) < 0.05; ++cycle) own.update_twist(twist);
      if (open(own) < 0.05) continue;
      ++bent;
      for (int k = 0; k < cycle + 100; ++k) guided.update_twist(twist);
      with += open(guided) > 0.04;
    }
    CHECK(bent > 3);
    CHECK(with >= bent - 1);  // one comes back
  }
}

TEST_CASE("seven joints with two long sides follow twists as without the guide, to the last digit") {
  for (const char* name : {"kuka_lbr_iiwa_14_r820", "kinova_gen3_7dof"}) {
    const Chain& chain = arms().at(name);
    Servo guided = servo_of(chain, true), own = servo_of(chain, false);
    Random random(3);
    for (int trial = 0; trial < 4; ++trial) {
      CAPTURE(std::string(name));
      const JointVector q = test::start_of(random, chain, 0.6);
      guided.reset(q);
      own.reset(q);
      const Twist twist = 0.4 * random.unit(6);
      for (int cycle = 0; cycle < 1500; ++cycle) {
        REQUIRE((guided.update_twist(twist).qdot.array() == own.update_twist(twist).qdot.array()).all());
      }
    }
  }
}

TEST_CASE("an elbow that starts on its short side is free until it leaves this side") {
  for (const auto& [key, straight] : kStraight) {
    const Chain& chain = arms().at(key);
    Servo guided = servo_of(chain, true), own = servo_of(chain, false);
    Random random(6);
    int out = 0;
    for (int trial = 0; trial < 10; ++trial) {
      JointVector q = long_side(random, chain, straight);
      q[3] = straight + 0.15;
      guided.reset(q);
      own.reset(q);
      const Twist twist = 0.3 * random.unit(6);
      bool short_side = true;
      for (int cycle = 0; cycle < 1500 && short_side; ++cycle) {
        REQUIRE((guided.update_twist(twist).qdot.array() == own.update_twist(twist).qdot.array()).all());
        short_side = own.q()[3] > straight;
      }
      out += !short_side;
    }
    CHECK(out > 0);
    CHECK(out < 10);
  }
}

TEST_CASE("a stretched arm follows a twist inwards, in both modes, and a zero twist moves nothing") {
  for (const OnLimit mode : {OnLimit::Redistribute, OnLimit::Scale}) {
    for (const auto& [key, straight] : kStraight) {
      const std::string& name = key;
      CAPTURE(name);
      const Chain& chain = arms().at(key);
      ServoOptions options;
      options.dt = kDt;
      options.guided = true;
      options.on_limit = mode;
      Servo servo(chain, JParse{}, options);
      Random random(12);
      int back = 0;
      for (int trial = 0; trial < 10; ++trial) {
        servo.reset(long_side(random, chain, straight));
        const Pose home = servo.tip();
        const Eigen::Vector3d shoulder(0.0, 0.0, key == "franka_panda" ? 0.333 : 0.267);
        Twist out = Twist::Zero();
        out.head<3>() = 0.1 * (home.translation() - shoulder).normalized();
        for (int k = 0; k < 2000; ++k) servo.update_twist(out);
        for (int k = 0; k < 500; ++k) servo.hold();
        const JointVector still = servo.q();
        for (int k = 0; k < 200; ++k) servo.update_twist(Twist::Zero());
        CHECK((servo.q() - still).cwiseAbs().maxCoeff() == 0.0);
        for (int k = 0; k < 10000; ++k) {
          Twist error = pose_error(servo.tip(), home);
          const double far = error.head<3>().norm();
          error *= 3.0 * std::min(1.0, 0.03 / std::max(far, 1e-9));
          servo.update_twist(error);
        }
        back += pose_error(servo.tip(), home).norm() < 2e-3;
      }
      MESSAGE(back, " of 10 ", name, std::string(mode == OnLimit::Scale ? " (scale)" : ""), " are back");
      CHECK(back >= 8);
    }
  }
}
