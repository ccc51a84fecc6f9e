// The same arm with a tool, with locked joints, with bounds of continuous joints: poses, limits, dynamics, names.

#include <doctest/doctest.h>

#include <string>

#include <sigmaik/dynamics.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/limits.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/servo.hpp>

#include "arms.hpp"
#include "numbers.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::kInfinity;
using test::Random;

double largest(const Eigen::MatrixXd& difference) { return difference.cwiseAbs().maxCoeff(); }

}  // namespace

TEST_CASE("a tool moves the tip, and adds its inertia to the last link") {
  Random random(1);
  for (const char* name : {"franka_panda", "ur10", "ufactory_xarm7"}) {
    CAPTURE(name);
    const Chain& arm = test::arms().at(name);
    const Pose tool = random.pose(0.3);
    Inertia inertia;
    inertia.mass = 1.5;
    inertia.center_of_mass = Eigen::Vector3d(0.01, -0.02, 0.05);
    inertia.tensor = 0.01 * Eigen::Matrix3d::Identity();
    const Chain held = arm.with_tool(tool, inertia);
    CHECK(held.dof() == arm.dof());
    CHECK(held.tip() == "tool");
    CHECK(held.joint_names() == arm.joint_names());
    CHECK(held.limits().velocity == arm.limits().velocity);
    CHECK(held.segments().back().inertia->mass == 1.5);
    const JointVector q = random.configuration(arm.dof());
    CHECK(largest(pose(held, q).matrix() - (pose(arm, q) * tool).matrix()) < 1e-14);
    // Two tools add up, and their names differ.
    const Chain longer = held.with_tool(tool);
    CHECK(longer.tip() == "tool_");
    CHECK(largest(pose(longer, q).matrix() - (pose(arm, q) * tool * tool).matrix()) < 1e-14);

    // The tool as a payload at the flange.
    bool known = true;
    for (const Segment& s : arm.segments()) known = known && (s.type == JointType::Fixed || s.inertia);
    if (!known) continue;
    Inertia at_flange = inertia;
    at_flange.center_of_mass = tool * inertia.center_of_mass;
    at_flange.tensor = tool.linear() * inertia.tensor * tool.linear().transpose();
    Dynamics with_tool(held), with_payload(arm, Eigen::Vector3d(0.0, 0.0, -9.80665), at_flange);
    CHECK(largest(with_tool.mass_matrix(q) - with_payload.mass_matrix(q)) < 1e-12);
    CHECK(largest(with_tool.gravity(q) - with_payload.gravity(q)) < 1e-11);
  }
  const Chain& arm = test::arms().at("ur10");
  Pose bad = Pose::Identity();
  bad.linear() *= 2.0;
  CHECK_THROWS_AS((void)arm.with_tool(bad), Error);
  Inertia heavy;
  heavy.mass = -1.0;
  CHECK_THROWS_AS((void)arm.with_tool(Pose::Identity(), heavy), Error);
}

TEST_CASE("a locked joint is a fixed segment: kinematics and dynamics are those of the arm that keeps it there") {
  Random random(2);
  for (int trial = 0; trial < 60; ++trial) {
    const int n = random.integer(2, 8), locked = random.integer(0, n - 1);
    std::vector<Segment> segments = random.chain(n, 0.3).segments();
    for (Segment& s : segments) {
      Inertia inertia;
      inertia.mass = 1.0;
      inertia.tensor = 0.02 * Eigen::Matrix3d::Identity();
      s.inertia = inertia;
    }
    const Chain arm("base", segments);
    const JointVector q = random.configuration(n);
    const Chain shorter = arm.lock({{arm.joint_names()[static_cast<std::size_t>(locked)], q[locked]}});
    REQUIRE(shorter.dof() == n - 1);
    CHECK(shorter.segments().size() == arm.segments().size());
    CHECK(shorter.tip() == arm.tip());
    JointVector rest(n - 1);
    std::vector<std::string> names;
    for (int i = 0, k = 0; i < n; ++i) {
      if (i == locked) continue;
      rest[k++] = q[i];
      names.push_back(arm.joint_names()[static_cast<std::size_t>(i)]);
    }
    CHECK(shorter.joint_names() == names);
    ChainState whole, part;
    REQUIRE(update(arm, q, whole));
    REQUIRE(update(shorter, rest, part));
    CHECK(largest(part.tip.matrix() - whole.tip.matrix()) < 1e-12);
    Dynamics of_arm(arm), of_part(shorter);
    const JointMatrix mass = of_arm.mass_matrix(q), mass_part = of_part.mass_matrix(rest);
    const JointVector weight = of_arm.gravity(q), weight_part = of_part.gravity(rest);
    for (int i = 0, k = 0; i < n; ++i) {
      if (i == locked) continue;
      CHECK(largest(part.jacobian.col(k) - whole.jacobian.col(i)) < 1e-12);
      CHECK(mass_part(k, k) == doctest::Approx(mass(i, i)).epsilon(1e-9));
      CHECK(weight_part[k] == doctest::Approx(weight[i]).epsilon(1e-9).scale(10.0));
      ++k;
    }
  }
}

TEST_CASE("locks that cannot be are refused; several joints are locked at once; mimics are locked with their joint") {
  const Chain& arm = test::arms().at("franka_panda");
  const std::vector<std::string>& names = arm.joint_names();
  CHECK(arm.lock({{names[0], 0.1}, {names[4], -0.2}}).dof() == 5);
  CHECK(arm.lock({}).dof() == 7);
  CHECK_THROWS_AS((void)arm.lock({{"nobody", 0.0}}), Error);
  CHECK_THROWS_AS((void)arm.lock({{names[0], 3.5}}), Error);
  CHECK_THROWS_AS((void)arm.lock({{names[0], test::kNan}}), Error);
  std::map<std::string, double> all;
  for (int i = 0; i < 7; ++i)
    all[names[static_cast<std::size_t>(i)]] = 0.5 * (arm.limits().lower[i] + arm.limits().upper[i]);
  CHECK_THROWS_AS((void)arm.lock(all), Error);

  std::vector<Segment> segments = arm.segments();
  for (Segment& s : segments) {
    if (s.joint_name == names[6]) s.mimic = Mimic{names[0], -1.0, 0.3};
  }
  const Chain coupled(arm.base(), segments), locked = coupled.lock({{names[0], 0.2}});
  REQUIRE(coupled.dof() == 6);
  REQUIRE(locked.dof() == 5);
  CHECK(!locked.has_mimics());
  JointVector q = coupled.limits().lower + 0.4 * (coupled.limits().upper - coupled.limits().lower);
  q[0] = 0.2;
  CHECK(largest(pose(coupled, q).matrix() - pose(locked, q.tail(5)).matrix()) < 1e-13);
  CHECK_THROWS_AS((void)coupled.lock({{names[6], 0.0}}), Error);
}

TEST_CASE("a continuous joint with a bound is a revolute joint, and the servo holds the bound") {
  Random random(3);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<Segment> segments = random.chain(4).segments();
    for (std::size_t i = 0; i < 4; ++i) {
      segments[i].type = JointType::Continuous;
      segments[i].velocity = 2.0;
      segments[i].acceleration = 10.0;
    }
    const Chain endless("base", segments);
    JointLimits limits = endless.limits();
    limits.lower[1] = -2.0;
    limits.upper[1] = 2.0;
    if (trial % 2 == 0) limits.upper[2] = 1.0;  // one side alone
    const Chain arm = endless.with_limits(limits);
    CHECK(arm.joint_types()[0] == JointType::Continuous);
    CHECK(arm.joint_types()[1] == JointType::Revolute);
    CHECK(arm.limits().lower[1] == -2.0);
    Servo servo(arm, JParse{}, {.dt = 5e-3});
    servo.reset(JointVector::Zero(4));
    for (int i = 0; i < 800; ++i) {
      const Twist twist = (i / 400 == 0 ? 1.0 : -1.0) * Twist::Constant(1.0);
      const ServoStep step = servo.update_twist(twist);
      REQUIRE(std::abs(step.q[1]) <= 2.0);
      REQUIRE(step.q[2] <= limits.upper[2]);
    }
  }
}
