// URDF 1.1 and 1.2: quaternions, acceleration, deceleration, jerk, infinite limits; and mimic joints.

#include <doctest/doctest.h>

#include <cmath>
#include <string>

#include <sigmaik/chain.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/limits.hpp>

#include "numbers.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::kInfinity;

// base --(a revolute)-- 1 --(b `type`)-- 2 --(c revolute)-- tip, and a joint `side` beside the arm.
std::string robot(const std::string& version, const std::string& inside, const std::string& of_c = "",
                  const std::string& type = "revolute") {
  const std::string limit = "<limit lower='-1' upper='2' velocity='3' effort='4'/>";
  const auto joint = [](const std::string& name, const std::string& kind, const std::string& parent,
                        const std::string& child, const std::string& more) {
    return "<joint name='" + name + "' type='" + kind + "'><parent link='" + parent + "'/><child link='" + child +
           "'/><axis xyz='0 0 1'/>" + more + "</joint>";
  };
  return "<robot name='r'" + (version.empty() ? "" : " version='" + version + "'") +
         "><link name='base'/><link name='1'/><link name='2'/><link name='tip'/><link name='s'/>" +
         joint("a", "revolute", "base", "1", limit) + joint("side", "revolute", "base", "s", limit) +
         joint("b", type, "1", "2", "<origin xyz='1 0 0'/>" + inside) +
         joint("c", "revolute", "2", "tip", "<origin xyz='1 0 0'/>" + (of_c.empty() ? limit : of_c)) + "</robot>";
}

Chain read(const std::string& text) { return Chain::from_urdf(text, "base", "tip"); }

std::string refusal(const std::string& text) {
  try {
    read(text);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

const std::string kLimit = "<limit lower='-1' upper='2' velocity='3' effort='4'/>";

}  // namespace

TEST_CASE("versions 1.0, 1.1 and 1.2 are read; others are refused") {
  for (const std::string version : {"", "1.0", "1.1", "1.2"}) {
    CAPTURE(version);
    CHECK(read(robot(version, kLimit)).dof() == 3);
  }
  for (const std::string version : {"1.3", "2.0", "0.9", "one"}) {
    CAPTURE(version);
    CHECK(refusal(robot(version, kLimit)).find("ersion") != std::string::npos);
  }
}

TEST_CASE("a quaternion is the rotation of the same roll, pitch and yaw") {
  test::Random random(11);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Quaterniond q(random.rotation());
    const double rounded = trial % 2 == 0 ? 1.0 : 1.0 + 1e-4;  // as printed with four digits
    char xyzw[200];
    std::snprintf(xyzw, sizeof xyzw, "<origin xyz='1 2 3' quat_xyzw='%.17g %.17g %.17g %.17g'/>", rounded * q.x(),
                  rounded * q.y(), rounded * q.z(), rounded * q.w());
    const std::string urdf = robot("1.1", kLimit);
    std::string given = urdf;
    given.replace(given.find("<origin xyz='1 0 0'/>"), std::string("<origin xyz='1 0 0'/>").size(), xyzw);
    const Segment segment = read(given).segments()[1];
    CHECK((segment.origin.linear() - q.toRotationMatrix()).cwiseAbs().maxCoeff() < 1e-12);
    CHECK(segment.origin.translation() == Eigen::Vector3d(1.0, 2.0, 3.0));
  }
}

TEST_CASE("acceleration, deceleration and jerk are read, and braking uses the deceleration") {
  const Chain arm = read(robot(
      "1.2", "<limit lower='-1' upper='2' velocity='3' effort='4' acceleration='5' deceleration='3' jerk='50'/>"));
  CHECK(arm.limits().acceleration[1] == 5.0);
  CHECK(arm.limits().deceleration[1] == 3.0);
  CHECK(arm.limits().jerk[1] == 50.0);
  CHECK(arm.limits().braking()[1] == 3.0);
  CHECK(arm.limits().deceleration[0] == kInfinity);
  CHECK(arm.limits().braking() == JointVector(Eigen::Vector3d(kInfinity, 3.0, kInfinity)));
  CHECK(arm.with_limits(arm.limits()).limits().deceleration == arm.limits().deceleration);
  const LimitTracker tracker(arm.limits());
  CHECK(tracker.acceleration_limit(1) == doctest::Approx(5.0));
  CHECK(tracker.deceleration_limit(1) == doctest::Approx(3.0));
  CHECK(refusal(robot("1.2", "<limit lower='-1' upper='2' deceleration='-3'/>")).find("deceleration") !=
        std::string::npos);
}

TEST_CASE("infinite limits are unlimited, as asked") {
  for (const std::string text : {"inf", "+inf", "INF", " Infinity "}) {
    CAPTURE(text);
    const Chain arm = read(robot("", "<limit lower='-1' upper='2' velocity='" + text + "' effort='" + text + "'/>"));
    CHECK(arm.limits().velocity[1] == kInfinity);
    CHECK(arm.warnings().empty());
  }
  CHECK(read(robot("", "<limit lower='-inf' upper='inf' velocity='1' effort='1'/>")).limits().upper[1] == kInfinity);
  CHECK(refusal(robot("", "<limit lower='-1' upper='2' velocity='-inf' effort='1'/>")).find("velocity") !=
        std::string::npos);
  CHECK(refusal(robot("", "<limit lower='inf' upper='inf' velocity='1' effort='1'/>")) != "");
  // Version 1.2 leaves velocity and effort out; older versions require both.
  CHECK(read(robot("1.2", "<limit lower='-1' upper='2'/>")).limits().velocity[1] == kInfinity);
  CHECK(refusal(robot("1.0", "<limit lower='-1' upper='2'/>")) != "");
}

TEST_CASE("a mimic joint of the arm moves with its joint, and its limits are its joint's") {
  const Chain arm = read(robot("",
                               "<limit lower='-1' upper='2' velocity='3' effort='4' acceleration='8'/>"
                               "<mimic joint='a' multiplier='-2' offset='0.5'/>"));
  REQUIRE(arm.dof() == 2);
  CHECK(arm.joint_names() == std::vector<std::string>{"a", "c"});
  CHECK(arm.moving() == 3);
  CHECK(arm.limits().lower[0] == doctest::Approx((2.0 - 0.5) / -2.0));
  CHECK(arm.limits().upper[0] == doctest::Approx((-1.0 - 0.5) / -2.0));
  CHECK(arm.limits().velocity[0] == 1.5);
  CHECK(arm.limits().acceleration[0] == 4.0);
  const Chain free = read(robot("", kLimit));
  const double q = 0.3;
  const Pose expected = pose(free, Eigen::Vector3d(q, -2.0 * q + 0.5, 0.7));
  CHECK((pose(arm, Eigen::Vector2d(q, 0.7)).matrix() - expected.matrix()).cwiseAbs().maxCoeff() < 1e-14);
}

TEST_CASE("a mimic of a joint beside the arm moves by itself, and says so; two of them move together") {
  const std::string side = "<mimic joint='side' multiplier='2' offset='0.1'/>";
  const Chain one = read(robot("", kLimit + side));
  CHECK(one.dof() == 3);
  REQUIRE(one.warnings().size() == 1);
  CHECK(one.warnings()[0].find("'b' mimics joint 'side', which is not between base and tip") != std::string::npos);
  const Chain two = read(robot("", kLimit + side, kLimit + "<mimic joint='side' multiplier='-1' offset='0'/>"));
  REQUIRE(two.dof() == 2);
  // With side = s: b = 2 s + 0.1 and c = −s.
  const double s = 0.2;
  const Pose expected = pose(read(robot("", kLimit)), Eigen::Vector3d(0.4, 2.0 * s + 0.1, -s));
  CHECK((pose(two, Eigen::Vector2d(0.4, 2.0 * s + 0.1)).matrix() - expected.matrix()).cwiseAbs().maxCoeff() < 1e-14);
}

TEST_CASE("mimics of mimics, and mimics that have no meaning") {
  const Chain arm = read(robot("", kLimit + "<mimic joint='a' multiplier='0.5'/>",
                               kLimit + "<mimic joint='b' multiplier='-2' offset='0.1'/>"));
  REQUIRE(arm.dof() == 1);
  const Pose expected = pose(read(robot("", kLimit)), Eigen::Vector3d(0.4, 0.2, -0.3));
  CHECK((pose(arm, JointVector::Constant(1, 0.4)).matrix() - expected.matrix()).cwiseAbs().maxCoeff() < 1e-14);

  CHECK(refusal(robot("", kLimit + "<mimic joint='c'/>", kLimit + "<mimic joint='b'/>")).find("itself") !=
        std::string::npos);
  CHECK(refusal(robot("", kLimit + "<mimic joint='b'/>")).find("itself") != std::string::npos);
  CHECK(refusal(robot("", kLimit + "<mimic joint='nobody'/>")).find("'nobody', which is not in the file") !=
        std::string::npos);
  CHECK(refusal(robot("", kLimit + "<mimic/>")).find("no joint") != std::string::npos);
  CHECK(refusal(robot("", kLimit + "<mimic joint='a' multiplier='0'/>")).find("multiplier") != std::string::npos);
  CHECK(refusal(robot("", kLimit + "<mimic joint='a' offset='9'/>")).find("leave no position") != std::string::npos);
}
