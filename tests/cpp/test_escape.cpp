// Out of exact singularities, where no motion moves the tool to first order and the second order does.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include <sigmaik/kinematics.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/servo.hpp>

#include "arms.hpp"
#include "configurations.hpp"
#include "heap.hpp"
#include "limit_watch.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::arms;
using test::Random;

constexpr double kDt = 2e-3;

ServoOptions options() {
  ServoOptions out;
  out.dt = kDt;
  out.guided = true;
  return out;
}

Twist unit_twist(int axis, double sign) {
  Twist out = Twist::Zero();
  out[axis] = sign * (axis < 3 ? 0.1 : 0.3);
  return out;
}

// The part of the way that was asked in these seconds, along the twist.
double part_done(const Servo& servo, const Pose& start, const Twist& twist, double seconds) {
  return pose_error(start, servo.tip()).dot(twist) / twist.squaredNorm() / seconds;
}

// Lost at zero to first order, open to second order: y, −z and rx of the straight arms.
struct Case {
  const char* arm;
  int axis;
  double sign;
};
constexpr Case kOpen[] = {
    {"kuka_lbr_iiwa_14_r820", 1, 1.0}, {"kuka_lbr_iiwa_14_r820", 1, -1.0}, {"kuka_lbr_iiwa_14_r820", 2, -1.0},
    {"kuka_lbr_iiwa_14_r820", 3, 1.0}, {"kuka_lbr_iiwa_14_r820", 3, -1.0}, {"kinova_gen3_7dof", 1, 1.0},
    {"kinova_gen3_7dof", 1, -1.0},     {"kinova_gen3_7dof", 2, -1.0},      {"kinova_gen3_7dof", 3, 1.0},
    {"kinova_gen3_7dof", 3, -1.0},
};

}  // namespace

TEST_CASE("a twist that no motion makes to first order is followed, inside all limits, with rounding in the start") {
  Random random(1);
  for (const Case& one : kOpen) {
    const Chain& nominal = arms().at(one.arm);
    for (const double noise : {0.0, 1e-12, 1e-8, 1e-5, 1e-3}) {
      for (const double jerk : {std::numeric_limits<double>::infinity(), 1000.0}) {
        CAPTURE(std::string(one.arm));
        CAPTURE(one.axis);
        CAPTURE(one.sign);
        CAPTURE(noise);
        CAPTURE(jerk);
        JointLimits limits = nominal.limits();
        limits.jerk.setConstant(jerk);
        const Chain chain = nominal.with_limits(limits);
        Servo servo(chain, JParse{}, options());
        const JointVector q = noise * random.vector(chain.dof());
        servo.reset(q.cwiseMax(limits.lower).cwiseMin(limits.upper));
        const Pose start = servo.tip();
        const Twist twist = unit_twist(one.axis, one.sign);
        test::LimitWatch watch(limits, kDt, servo.qdot());
        for (int k = 0; k < 1000; ++k) watch.step(servo.update_twist(twist));
        CHECK(part_done(servo, start, twist, 2.0) > 0.5);
        CHECK(watch.broken == 0);
        for (int k = 0; k < 1000; ++k) watch.step(servo.update_twist(Twist::Zero()));
        CHECK(servo.qdot().isZero(0.0));
      }
    }
  }
}

TEST_CASE("poses in the directions that the second order opens are reached on the tool's own way") {
  for (const Case& one : kOpen) {
    CAPTURE(std::string(one.arm));
    CAPTURE(one.axis);
    CAPTURE(one.sign);
    const Chain& chain = arms().at(one.arm);
    Servo servo(chain, JParse{}, options());
    servo.reset(JointVector::Zero(chain.dof()));
    const Twist way = unit_twist(one.axis, one.sign);
    Pose target = servo.tip();
    target.translation() += way.head<3>();
    target.translation().z() -= 0.02;  // sideways at the height of the stretched arm would be out of reach
    target.linear() = rotation_exp(way.tail<3>()) * target.linear();
    for (int k = 0; k < 3000; ++k) CHECK(servo.update(target).guide != GuideState::ChangingBranch);
    CHECK(pose_error(servo.tip(), target).norm() < 1e-4);
    CHECK(servo.qdot().cwiseAbs().maxCoeff() < 1e-4);
  }
}

TEST_CASE("beyond the reach nothing is gained, and the arm rests") {
  for (const char* name : {"kuka_lbr_iiwa_14_r820", "kinova_gen3_7dof"}) {
    CAPTURE(std::string(name));
    const Chain& chain = arms().at(name);
    Servo servo(chain, JParse{}, options());
    servo.reset(JointVector::Zero(chain.dof()));
    const Pose start = servo.tip();
    for (int k = 0; k < 1000; ++k) servo.update_twist(unit_twist(2, 1.0));
    CHECK(servo.qdot().cwiseAbs().maxCoeff() < 1e-3);
    CHECK(pose_error(start, servo.tip()).norm() < 1e-2);
  }
}

TEST_CASE("the tool never moves away from where it is asked to go, to first order") {
  // Limits and the soft start off: the command is the rule's answer and what is added.
  ServoOptions free = options();
  free.limits.position = free.limits.velocity = free.limits.acceleration = free.limits.jerk = false;
  free.soft_start = 0.0;
  int singular = 0;
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    CAPTURE(name);
    Random random(5);
    const double length = chain.characteristic_length();
    Servo servo(chain, JParse{}, free);
    for (int trial = 0; trial < 300; ++trial) {
      // A few joints at zero make exact and near singularities.
      JointVector q = test::sample(random, chain);
      for (double& angle : q) {
        if (random.chance(0.6)) angle = random.chance(0.5) ? 0.0 : random.decades(-9.0, -2.0);
      }
      servo.reset(q);
      for (int k = 0; k < 3; ++k) {
        const Twist twist = 0.3 * random.unit(6);
        const ServoStep step = servo.update_twist(twist);
        Twist weighted = twist;
        weighted.tail<3>() *= length * length;
        singular += step.singular != 0;
        CHECK(weighted.dot(step.achieved_twist) >= -1e-9 * weighted.norm() * twist.norm());
      }
    }
  }
  CHECK(singular > 1000);
}

TEST_CASE("the published rule, the other rules, `exact` and a servo without a guide rest there") {
  const Chain& chain = arms().at("kuka_lbr_iiwa_14_r820");
  JParse published;
  published.adaptive = false;
  ServoOptions exact = options();
  exact.exact = {true, true, true, false, false, false};
  ServoOptions alone = options();
  alone.guided = false;
  Servo servos[] = {Servo(chain, published, options()), Servo(chain, PseudoInverse{}, options()),
                    Servo(chain, DampedLeastSquares{}, options()), Servo(chain, JParse{}, exact),
                    Servo(chain, JParse{}, alone)};
  for (Servo& servo : servos) {
    servo.reset(JointVector::Zero(7));
    for (int k = 0; k < 200; ++k) servo.update_twist(unit_twist(2, -1.0));
    CHECK(servo.q().isZero(1e-9));
  }
}

TEST_CASE("the same start gives the same way") {
  for (const Case& one : kOpen) {
    const Chain& chain = arms().at(one.arm);
    Servo first(chain, JParse{}, options()), second(chain, JParse{}, options());
    first.reset(JointVector::Zero(chain.dof()));
    second.reset(JointVector::Zero(chain.dof()));
    const Twist twist = unit_twist(one.axis, one.sign);
    for (int k = 0; k < 300; ++k) {
      REQUIRE((first.update_twist(twist).qdot.array() == second.update_twist(twist).qdot.array()).all());
    }
    CHECK(!first.q().isZero(1e-3));
  }
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("a cycle out of a singularity calls no heap") {
  for (const Case& one : kOpen) {
    const Chain& chain = arms().at(one.arm);
    Servo servo(chain, JParse{}, options());
    servo.reset(JointVector::Zero(chain.dof()));
    const Twist twist = unit_twist(one.axis, one.sign);
    const test::HeapWatch watch;
    for (int k = 0; k < 300; ++k) servo.update_twist(twist);
    CHECK(watch.calls() == 0);
    CHECK(!servo.q().isZero(1e-3));
  }
}
#endif
