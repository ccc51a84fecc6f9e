// A tool put on at run time: targets and twists are the tool's, and no joint velocity jumps.

#include <doctest/doctest.h>

#include <cmath>

#include <sigmaik/kinematics.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/servo.hpp>
#include <sigmaik/servo_loop.hpp>

#include "arms.hpp"
#include "heap.hpp"
#include "loop_rig.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::Random;

Pose tool_of(double x, double y, double z) {
  Pose tool = Pose::Identity();
  tool.translation() = Eigen::Vector3d(x, y, z);
  return tool;
}

Servo panda(const ServoOptions& options = {}, double acceleration = 10.0) {
  const Chain& arm = test::arms().at("franka_panda");
  JointLimits limits = arm.limits();
  limits.acceleration = JointVector::Constant(7, acceleration);
  Servo servo(arm.with_limits(limits), JParse{}, options);
  JointVector q(7);
  q << 0.0, -0.4, 0.0, -2.0, 0.0, 1.6, 0.7;
  servo.reset(q);
  return servo;
}

}  // namespace

TEST_CASE("a servo with a tool is the servo of the chain with the tool") {
  Random random(1);
  for (int trial = 0; trial < 20; ++trial) {
    const Pose tool = random.pose(0.2);
    ServoOptions options;
    options.length_scale = 0.4;
    options.max_linear_error = 0.2;
    Servo with = panda(options);
    REQUIRE(with.set_tool(tool));
    Servo of_chain(with.chain().with_tool(tool), JParse{}, options);
    of_chain.reset(with.q());
    with.reset(with.q());
    CHECK((with.tip().matrix() - of_chain.tip().matrix()).cwiseAbs().maxCoeff() < 1e-14);
    Pose target = with.tip();
    target.translation() += 0.1 * random.vector(3);
    for (int i = 0; i < 200; ++i) {
      const ServoStep a = trial % 2 == 0 ? with.update(target) : with.update_twist(Twist::Constant(0.1));
      const ServoStep b = trial % 2 == 0 ? of_chain.update(target) : of_chain.update_twist(Twist::Constant(0.1));
      REQUIRE((a.qdot - b.qdot).cwiseAbs().maxCoeff() < 1e-9);
      REQUIRE((a.pose_error - b.pose_error).cwiseAbs().maxCoeff() < 1e-9);
    }
  }
}

TEST_CASE("put on and taken off in the midst of a motion: no jump, and the tool arrives where the tip was sent") {
  for (const bool by_limits : {true, false}) {
    for (const double length : {0.15, 0.05, 0.1}) {
      if (!by_limits && length > 0.07) continue;  // the arm meets a position limit, where only braking is smooth
      ServoOptions options;
      options.limits.acceleration = by_limits;
      Servo servo = panda(options);
      Pose target = servo.tip();
      target.translation() += Eigen::Vector3d(0.05, 0.1, 0.05);
      JointVector last = JointVector::Zero(7);
      double jump = 0.0, fastest = 0.0;
      const auto run = [&](int cycles) {
        ServoStep step;
        for (int i = 0; i < cycles; ++i) {
          step = servo.update(target);
          jump = std::max(jump, (step.qdot - last).cwiseAbs().maxCoeff());
          fastest = std::max(fastest, step.qdot.cwiseAbs().maxCoeff());
          last = step.qdot;
        }
        return step;
      };
      run(150);
      REQUIRE(last.cwiseAbs().maxCoeff() > 0.05);
      REQUIRE(servo.set_tool(tool_of(0.0, 0.0, length)));
      CHECK((servo.tip().matrix() - (pose(servo.chain(), servo.q()) * servo.tool()).matrix()).norm() < 1e-13);
      CHECK(run(4000).pose_error.norm() < 1e-4);
      REQUIRE(servo.set_tool(Pose::Identity()));
      CHECK(run(4000).pose_error.norm() < 1e-4);
      CHECK((servo.tip().matrix() - pose(servo.chain(), servo.q()).matrix()).norm() == 0.0);
      if (by_limits) {
        CHECK(jump <= 10.0 * 1e-3 * (1.0 + 1e-9));
      } else {
        CHECK(jump < 0.03 * (fastest + 0.1));  // faded in over 100 cycles
      }
    }
  }
}

TEST_CASE("a twist is the tool's from then on, without a jump") {
  Servo servo = panda();
  const Twist turn = (Twist() << 0.0, 0.0, 0.0, 0.0, 0.2, 0.0).finished();
  JointVector last = JointVector::Zero(7);
  for (int i = 0; i < 1000; ++i) {
    if (i == 400) REQUIRE(servo.set_tool(tool_of(0.15, 0.0, 0.1)));
    const ServoStep step = servo.update_twist(turn);
    REQUIRE((step.qdot - last).cwiseAbs().maxCoeff() <= 10.0 * 1e-3 * (1.0 + 1e-9));
    last = step.qdot;
    if (i > 300 && (i < 400 || i > 700)) REQUIRE((step.achieved_twist - turn).norm() < 1e-6);
  }
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("another tool takes no heap") {
  Servo servo = panda();
  const test::HeapWatch watch;
  CHECK(servo.set_tool(tool_of(0.0, 0.05, 0.15)));
  CHECK(watch.calls() == 0);
}
#endif

TEST_CASE("a measured arm, another servo and a guide keep the tool; what is no pose is refused") {
  Servo servo = panda();
  const Pose tool = tool_of(0.0, 0.05, 0.15);
  CHECK(servo.set_tool(tool));
  JointVector measured = servo.q();
  measured[0] += 1e-3;
  CHECK(servo.measure(measured));
  const Pose expected = pose(servo.chain(), measured) * tool;
  const ServoStep step = servo.update(expected);
  CHECK(step.pose_error.norm() < 1e-12);

  Servo next = panda();
  next.continue_from(servo);
  CHECK(next.tool().matrix() == tool.matrix());
  CHECK((next.tip().matrix() - servo.tip().matrix()).norm() == 0.0);

  Pose bad = Pose::Identity();
  bad.linear() *= 1.1;
  CHECK_FALSE(servo.set_tool(bad));
  CHECK(servo.tool().matrix() == tool.matrix());
}

TEST_CASE("a guided servo changes its branch to where the tool is at the target") {
  const Chain& arm = test::arms().at("ur10");
  ServoOptions options;
  options.guided = true;
  options.dt = 4e-3;
  Servo servo(arm, JParse{}, options);
  JointVector q(6), other(6);
  q << 0.0, -1.2, 1.5, -1.87, -1.57, 0.0;
  other << 2.5, -1.9, -1.4, 0.4, 1.2, 0.5;
  const Pose tool = tool_of(0.02, 0.0, 0.1);
  REQUIRE(servo.set_tool(tool));
  servo.reset(q);
  const Pose target = pose(arm, other) * tool;
  ServoStep step;
  for (int i = 0; i < 4000; ++i) step = servo.update(target);
  CHECK(step.pose_error.norm() < 1e-3);
}

TEST_CASE("a loop takes the tool with the next cycle; the command at hand is then the tool's") {
  constexpr double kDt = 5e-3;
  Servo start = test::started(10.0, {}, kDt);
  const Pose tip = start.tip();
  ServoLoop loop(std::move(start), {}, {.max_missed = 1000000});  // busy machines leave cycles out
  std::vector<LoopSample> samples;
  const auto arrives = [&](const Pose& target) {
    return test::until([&] {
      const std::vector<LoopSample> more = test::read_all(loop);
      samples.insert(samples.end(), more.begin(), more.end());
      return !samples.empty() && (samples.back().tip.translation() - target.translation()).norm() < 1e-3 &&
             samples.back().step.qdot.cwiseAbs().maxCoeff() < 1e-2;
    });
  };
  loop.start();
  loop.follow(tip, 50.0);
  const Pose tool = tool_of(0.0, 0.0, 0.15);
  REQUIRE(arrives(tip));
  const std::size_t before = samples.size();
  loop.set_tool(tool);
  REQUIRE(test::until([&] {
    const std::vector<LoopSample> more = test::read_all(loop);
    samples.insert(samples.end(), more.begin(), more.end());
    return samples.size() > before && (samples.back().tip.translation() - tip.translation()).norm() > 0.05;
  }));
  REQUIRE(arrives(tip));
  CHECK(test::hardest(samples) <= 10.0 * kDt * (1.0 + 1e-9));
  // Another servo keeps the loop's tool.
  const int number = loop.configure(test::started(10.0, {}, kDt));
  loop.follow(tip, 50.0);
  REQUIRE(test::until([&] {
    const std::vector<LoopSample> more = test::read_all(loop);
    samples.insert(samples.end(), more.begin(), more.end());
    return samples.back().configuration == number;
  }));
  CHECK((samples.back().tip.translation() - tip.translation()).norm() < 2e-3);
  Pose bad = Pose::Identity();
  bad.linear() *= 2.0;
  CHECK(test::refused([&] { loop.set_tool(bad); }));
  const LoopToken token = loop.take("somebody");
  CHECK(test::refused([&] { loop.set_tool(tool); }));
  loop.set_tool(tool, token);
  CHECK(loop.stop());
}
