// A servo brings the tool to its target and comes to rest there, under every acceleration and jerk limit.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <sigmaik/pose.hpp>
#include <sigmaik/servo.hpp>

#include "arms.hpp"
#include "limit_watch.hpp"
#include "numbers.hpp"
#include "random.hpp"
#include "settling.hpp"
#include "stopping_time.hpp"

namespace {

using namespace sigmaik;
using test::arms;
using test::kInfinity;
using test::Random;

constexpr double kHalfDegree = 0.5 * std::numbers::pi / 180.0;
constexpr std::array<bool, 6> kPosition{true, true, true, false, false, false};

JointVector joints(std::initializer_list<double> values) {
  JointVector q(static_cast<Eigen::Index>(values.size()));
  std::copy(values.begin(), values.end(), q.begin());
  return q;
}

double distance(const Servo& servo, const Pose& target) {
  return (servo.tip().translation() - target.translation()).norm();
}
double angle(const Servo& servo, const Pose& target) { return pose_error(servo.tip(), target).tail<3>().norm(); }

// Goes on until the arm has been at rest for half a second, and at the target too where `there` is asked, or until
// `time` is over. Returns whether this happened, with every limit held.
bool rests(Servo& servo, const Pose& target, double time, bool there) {
  const double dt = servo.options().dt;
  test::LimitWatch watch(servo.chain().limits(), dt, servo.qdot(), {}, servo.options().limits.assumed_acceleration);
  double still = 0.0;
  for (double t = 0.0; t < time; t += dt) {
    watch.step(servo.update(target));
    const bool good = test::at_rest(servo.chain(), servo.qdot()) &&
                      (!there || (distance(servo, target) < 1e-3 && angle(servo, target) < kHalfDegree));
    still = good ? still + dt : 0.0;
    if (still > 0.5) break;
  }
  return still > 0.0 && watch.broken == 0;
}

// Ordinary postures of four arms.
std::map<std::string, JointVector> four_postures() {
  return {{"ur10", joints({0.0, -1.2, 1.5, -1.87, -1.57, 0.0})},
          {"ufactory_xarm7", joints({0.0, -0.5, 0.0, 1.0, 0.0, 1.2, 0.0})},
          {"franka_panda", joints({0.0, -0.4, 0.0, -2.0, 0.0, 1.6, 0.7})},
          {"kuka_lbr_iiwa_14_r820", joints({0.0, 0.5, 0.0, -1.5, 0.0, 1.1, 0.0})}};
}

Chain with_dynamics(const Chain& chain, double acceleration, double jerk) {
  JointLimits limits = chain.limits();
  if (std::isfinite(acceleration)) limits.acceleration.setConstant(acceleration);
  limits.jerk.setConstant(jerk);
  return chain.with_limits(limits);
}

}  // namespace

TEST_CASE("a near target is reached within four seconds, to 1 mm and half a degree, with the defaults") {
  REQUIRE(arms().size() == 9);
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    Random random(1);
    for (int trial = 0; trial < 12; ++trial) {
      CAPTURE(name);
      CAPTURE(trial);
      const JointVector q = test::start_of(random, chain, 0.98);
      const Pose target = pose(chain, test::near(random, chain, q, 0.25));
      Servo servo(chain);
      servo.reset(q);
      test::LimitWatch watch(chain.limits(), servo.options().dt, JointVector::Zero(chain.dof()));
      for (int cycle = 0; cycle < 4000; ++cycle) watch.step(servo.update(target));
      CHECK(distance(servo, target) <= 1e-3);
      CHECK(angle(servo, target) <= kHalfDegree);
      CHECK(watch.broken == 0);
    }
  }
}

TEST_CASE("a near target is reached, and the arm rests there, under jerk limits of 20 to 1e4 rad/s³") {
  for (const auto& [key, shipped] : arms()) {
    const std::string& name = key;
    for (const OnLimit on_limit : {OnLimit::Redistribute, OnLimit::Scale}) {
      Random random(2);
      for (int trial = 0; trial < 12; ++trial) {
        CAPTURE(name);
        CAPTURE(trial);
        CAPTURE(static_cast<int>(on_limit));
        const Chain chain = with_dynamics(shipped, random.decades(std::log10(0.5), 3.0),
                                          random.decades(std::log10(20.0), 4.0));
        ServoOptions options;
        options.dt = 0.004;
        options.on_limit = on_limit;
        Servo servo(chain, JParse{}, options);
        // A direction that a position limit blocks is given up by Scale, so there the way is clear of these limits.
        const JointVector q = test::start_of(random, chain, on_limit == OnLimit::Scale ? 0.6 : 0.98);
        const Pose target = pose(chain, test::near(random, chain, q, 0.25));
        servo.reset(q);
        CHECK(rests(servo, target, servo.settling_time(), true));
      }
    }
  }
}

TEST_CASE("an xArm7 goes 0.1 m forward and down, and rests there, under jerk limits of 500 to 20 rad/s³") {
  for (const double jerk : {500.0, 300.0, 200.0, 100.0, 50.0, 20.0}) {
    for (const Eigen::Vector3d& way : {Eigen::Vector3d(0.1, 0.0, 0.0), Eigen::Vector3d(0.0, 0.0, -0.1)}) {
      CAPTURE(jerk);
      CAPTURE(way[0]);
      const Chain chain = with_dynamics(arms().at("ufactory_xarm7"), kInfinity, jerk);
      Servo servo(chain);
      servo.reset(joints({0.0, -0.5, 0.0, 1.0, 0.0, 1.2, 0.0}));
      Pose target = servo.tip();
      target.translation() += way;
      CHECK(rests(servo, target, servo.settling_time(), true));
    }
  }
}

TEST_CASE("after a twist command ends, the arm rests within 1.5 times the stopping time") {
  const Chain chain = with_dynamics(arms().at("ufactory_xarm7"), kInfinity, 200.0);
  Servo servo(chain);
  servo.reset(joints({0.0, -0.5, 0.0, 1.0, 0.0, 1.2, 0.0}));
  const double dt = servo.options().dt;
  test::LimitWatch watch(chain.limits(), dt, JointVector::Zero(7));
  Twist twist;
  twist << 0.1, 0.0, 0.1, 0.0, 0.3, 0.0;
  for (int cycle = 0; cycle < 300; ++cycle) watch.step(servo.update_twist(twist));
  double least = 0.0;
  for (int i = 0; i < 7; ++i) {
    least = std::max(least,
                     test::stopping_time(servo.qdot()[i], watch.qddot()[i], chain.limits().acceleration[i], 200.0));
  }
  REQUIRE(least > 0.02);
  const int cycles = static_cast<int>(1.5 * least / dt) + 1;
  for (int cycle = 0; cycle < cycles; ++cycle) watch.step(servo.update_twist(Twist::Zero()));
  for (int cycle = 0; cycle < 500; ++cycle) {
    CHECK(test::at_rest(chain, servo.qdot()));
    watch.step(servo.update_twist(Twist::Zero()));
  }
  CHECK(watch.broken == 0);
}

TEST_CASE("a turn about the tool's own axis leaves the tool's point where it is, within 1 mm") {
  const Chain& chain = arms().at("ur10");
  for (const double degrees : {180.0, 90.0, 60.0}) {
    CAPTURE(degrees);
    Servo servo(chain);
    servo.reset(joints({0.0, -1.2, 1.5, -1.87, -1.57, 0.0}));
    const Eigen::Vector3d place = servo.tip().translation();
    Pose target = servo.tip();
    target.linear() *= rotation_exp(Eigen::Vector3d(0.0, 0.0, degrees * std::numbers::pi / 180.0));
    double most = 0.0;
    for (int cycle = 0; cycle < 4000; ++cycle) {
      servo.update(target);
      most = std::max(most, (servo.tip().translation() - place).norm());
    }
    CHECK(most < 1e-3);
    CHECK(angle(servo, target) < kHalfDegree);
    CHECK(test::at_rest(chain, servo.qdot()));
  }
}

TEST_CASE("a translation without position limits is straight within 1 mm") {
  for (const auto& [key, start] : four_postures()) {
    const std::string& name = key;
    const Chain& chain = arms().at(name);
    for (int direction = 0; direction < 6; ++direction) {
      CAPTURE(name);
      CAPTURE(direction);
      ServoOptions options;
      options.limits.position = false;
      Servo servo(chain, JParse{}, options);
      servo.reset(start);
      const Eigen::Vector3d from = servo.tip().translation();
      const Eigen::Vector3d way = Eigen::Vector3d::Unit(direction % 3) * (direction < 3 ? 1.0 : -1.0);
      Pose target = servo.tip();
      target.translation() += 0.1 * way;
      double most = 0.0;
      for (int cycle = 0; cycle < 3000; ++cycle) {
        servo.update(target);
        const Eigen::Vector3d gone = servo.tip().translation() - from;
        most = std::max(most, (gone - gone.dot(way) * way).norm());
      }
      CHECK(most < 1e-3);
      CHECK(distance(servo, target) < 1e-3);
    }
  }
}

TEST_CASE("arms of a tenth, twice, a thousand times and a thousandth of the size move their joints alike") {
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    Random random(3);
    const JointVector q = test::start_of(random, chain, 0.9), goal = test::near(random, chain, q, 0.25);
    for (const double size : {0.1, 2.0, 1000.0, 0.001}) {
      CAPTURE(name);
      CAPTURE(size);
      std::vector<Segment> segments = chain.segments();
      for (Segment& segment : segments) segment.origin.translation() *= size;
      const Chain other(chain.base(), segments);
      Servo a(chain), b(other);
      a.reset(q);
      b.reset(q);
      const Pose target = pose(chain, goal), there = pose(other, goal);
      double most = 0.0;
      for (int cycle = 0; cycle < 1500; ++cycle) {
        most = std::max(most, (a.update(target).q - b.update(there).q).cwiseAbs().maxCoeff());
      }
      CHECK(most < 1e-9);
    }
  }
}

TEST_CASE("towards a target beyond reach an industrial arm of six joints comes to rest") {
  for (const char* key : {"comau_racer_7_1_4", "kuka_kr6_r900", "ur10"}) {
    const std::string name = key;
    const Chain& chain = arms().at(name);
    Random random(4);
    for (int trial = 0; trial < 10; ++trial) {
      CAPTURE(name);
      CAPTURE(trial);
      Servo servo(chain);
      servo.reset(test::start_of(random, chain, 0.9));
      Pose target = servo.tip();
      target.translation() += 4.0 * random.unit(3);
      CHECK(rests(servo, target, servo.settling_time(), false));
    }
  }
}

TEST_CASE("10 to 100 mm inside the edge of reach, where the arm is straight, the target is reached to 0.1 mm") {
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    if (name == "franka_panda") continue;  // its elbow cannot be straight
    for (const double depth : {0.01, 0.03, 0.1}) {
      CAPTURE(name);
      CAPTURE(depth);
      // The elbow is straight where the arm cannot move farther out.
      const int elbow = chain.dof() == 7 ? 3 : 2;
      JointVector straight = JointVector::Constant(chain.dof(), 0.3), bent;
      for (int i = 0; i < chain.dof(); ++i) {
        const double lower = chain.limits().lower[i], upper = chain.limits().upper[i];
        if (straight[i] < lower || straight[i] > upper) straight[i] += 0.5 * (lower + upper);
      }
      double least = kInfinity;
      for (double x = -3.5; x <= 3.5; x += 1e-3) {
        JointVector q = straight;
        q[elbow] = x;
        if (q[elbow] < chain.limits().lower[elbow] || q[elbow] > chain.limits().upper[elbow]) continue;
        ChainState state;
        update(chain, q, state);
        Spectrum spectrum;
        spectrum.decompose(state.jacobian);
        if (spectrum.sigma(5) < least) {
          least = spectrum.sigma(5);
          bent = q;
        }
      }
      straight = bent;
      ChainState state;
      update(chain, straight, state);
      Spectrum spectrum;
      spectrum.decompose(state.jacobian);
      Eigen::Vector3d outward = spectrum.u(5).head<3>();
      Pose target = state.tip;
      if (outward.dot(target.translation()) < 0.0) outward = -outward;
      target.translation() -= depth * outward.normalized();
      JointVector start = straight;
      start[elbow] += straight[elbow] + 1.0 < chain.limits().upper[elbow] ? 1.0 : -1.0;
      ServoOptions options;
      options.dt = 0.004;
      Servo servo(chain, JParse{}, options);
      servo.reset(start);
      for (int cycle = 0; cycle < 5000; ++cycle) servo.update(target);
      CHECK(distance(servo, target) <= 1e-4);
      CHECK(test::at_rest(chain, servo.qdot()));
    }
  }
}

TEST_CASE("exact position rows: an arm of five joints reaches the position of a tilted target") {
  for (const auto& [key, start] :
       std::map<std::string, JointVector>{{"ur10", joints({0.0, -1.2, 1.5, -1.87, -1.57, 0.0})},
                                          {"kuka_kr6_r900", joints({0.0, -1.3, 1.5, 0.3, 1.0, 0.0})},
                                          {"puma560", joints({0.0, 0.8, -3.0, 0.3, 0.8, 0.0})}}) {
    const std::string& name = key;
    for (const std::size_t fixed : {std::size_t{3}, std::size_t{5}}) {
      std::vector<Segment> segments = arms().at(name).segments();
      std::size_t joint = 0;
      for (Segment& segment : segments) {
        if (segment.type != JointType::Fixed && joint++ == fixed) segment.type = JointType::Fixed;
      }
      const Chain chain(arms().at(name).base(), segments);
      REQUIRE(chain.dof() == 5);
      JointVector q(5);
      for (std::size_t i = 0, k = 0; i < 6; ++i) {
        if (i != fixed) q[static_cast<Eigen::Index>(k++)] = start[static_cast<Eigen::Index>(i)];
      }
      for (int axis = 0; axis < 3; ++axis) {
        CAPTURE(name);
        CAPTURE(fixed);
        CAPTURE(axis);
        ServoOptions options;
        options.dt = 0.004;
        options.exact = kPosition;
        Servo servo(chain, JParse{}, options);
        servo.reset(q);
        Pose target = servo.tip();
        target.translation() += Eigen::Vector3d(0.05, 0.03, -0.05);
        target.linear() = rotation_exp(0.4 * Eigen::Vector3d::Unit(axis)) * target.linear();
        CHECK(rests(servo, target, servo.settling_time(), false));
        CHECK(distance(servo, target) <= 1e-4);
      }
    }
  }
}

TEST_CASE("exact position rows: towards targets 0.3 rad beyond each joint's limit the arm comes to rest") {
  for (const auto& [key, start] : four_postures()) {
    const std::string& name = key;
    const Chain& chain = arms().at(name);
    for (int joint = 0; joint < chain.dof(); ++joint) {
      for (const bool up : {false, true}) {
        CAPTURE(name);
        CAPTURE(joint);
        CAPTURE(up);
        ServoOptions options;
        options.dt = 0.004;
        options.exact = kPosition;
        Servo servo(chain, JParse{}, options);
        servo.reset(start);
        JointVector beyond = start;
        beyond[joint] = up ? chain.limits().upper[joint] + 0.3 : chain.limits().lower[joint] - 0.3;
        // The fade after the settling time takes 7 s from a velocity limit to a thousandth.
        CHECK(rests(servo, pose(chain, beyond), servo.settling_time() + 8.0, false));
      }
    }
  }
}

TEST_CASE("exact position rows: the arm follows a target beyond its reach without shaking") {
  for (const auto& [key, start] : four_postures()) {
    const std::string& name = key;
    const Chain& chain = arms().at(name);
    CAPTURE(name);
    ServoOptions options;
    options.exact = kPosition;
    Servo servo(chain, JParse{}, options);
    servo.reset(start);
    const Pose from = servo.tip();
    const double far = 1.3 * from.translation().norm() + 0.4;
    JointVector last = JointVector::Zero(chain.dof()), change = last;
    int turns = 0;
    double moved = 0.0;
    for (int cycle = 0; cycle < 8000; ++cycle) {
      const double t = 1e-3 * cycle, part = std::min(1.0, 0.5 * t);
      const Eigen::Vector3d way(1.0, 0.3 * std::sin(t), 0.2 * std::sin(0.7 * t));
      Pose target = from;
      target.translation() = part * far * way.normalized() + (1.0 - part) * from.translation();
      const ServoStep step = servo.update(target);
      const JointVector now = (step.qdot - last) / 1e-3;
      if (t > 4.0) {  // the arm is stretched out
        for (int i = 0; i < chain.dof(); ++i) {
          if (now[i] * change[i] < 0.0 && std::abs(now[i]) > 1.0) ++turns;  // of the acceleration, and not of rounding
        }
        moved += 1e-3 * step.qdot.norm();
      }
      last = step.qdot;
      change = now;
    }
    CHECK(turns == 0);
    CHECK(moved > 0.3);
  }
}

TEST_CASE("another rule goes on towards a target that has rested for longer than the settling time") {
  const Chain& chain = arms().at("ur10");
  ServoOptions options;
  options.dt = 0.004;
  Servo servo(chain, JacobianProjection{1.0}, options);  // does one direction of six
  servo.reset(joints({0.0, -1.2, 1.5, -1.87, -1.57, 0.0}));
  Pose target = servo.tip();
  target.translation() += Eigen::Vector3d(-0.1, 0.05, 0.1);
  for (double t = 0.0; t < servo.settling_time() + 12.0; t += options.dt) servo.update(target);
  CHECK(test::at_rest(chain, servo.qdot()));
  REQUIRE(distance(servo, target) > 0.01);
  servo.set_method(JParse{});
  CHECK(rests(servo, target, 4.0, true));
}

TEST_CASE("a motion that settles is not reported, and one that moves after the settling time is") {
  const Chain& chain = arms().at("ur10");
  ServoOptions options;
  options.dt = 0.004;
  Servo servo(chain, JParse{}, options);
  const JointVector q = joints({0.0, -1.2, 1.5, -1.87, -1.57, 0.0});
  servo.reset(q);
  // Three times the longest way of a joint, by each limit alone, and 3 s more.
  double longest = 0.0;
  for (int i = 0; i < 6; ++i) {
    const double way = chain.limits().upper[i] - chain.limits().lower[i];
    longest = std::max(longest, way / chain.limits().velocity[i] + 2.0 * std::sqrt(way / 10.0));
  }
  CHECK(servo.settling_time() == doctest::Approx(3.0 + 3.0 * longest).epsilon(1e-12));
  Pose target = servo.tip();
  target.translation()[0] -= 0.2;
  for (double t = 0.0; t < servo.settling_time() + 1.0; t += options.dt) CHECK(!servo.update(target).not_settling);
  // A posture far away, with a twist left over by its pull, moves the arm of a position task for ever.
  options.task.mask = kPosition;
  options.posture_gain = 1e-3;
  options.posture = (JointVector(6) << 6.0, -1.2, 1.5, 6.0, -1.57, 6.0).finished();
  options.posture_max_speed = 4e-3;
  Servo restless(chain, JParse{}, options);
  restless.reset(q);
  bool reported = false;
  for (double t = 0.0; t < restless.settling_time() + 1.0; t += options.dt) {
    const ServoStep step = restless.update(restless.tip());
    reported = reported || step.not_settling;
  }
  CHECK(!reported);  // the target moves
  target = restless.tip();
  for (double t = 0.0; t < restless.settling_time() + 1.0; t += options.dt) {
    const ServoStep step = restless.update(target);
    CHECK((!step.not_settling || t >= restless.settling_time() - 2.0 * options.dt));
    if (step.not_settling) CHECK(!test::at_rest(chain, step.qdot));
    if (t > restless.settling_time() + options.dt) CHECK(step.not_settling == !test::at_rest(chain, step.qdot));
    reported = reported || step.not_settling;
  }
  CHECK(reported);
}
