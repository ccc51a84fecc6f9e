// Reading URDF: the chain that results; every file that is not a usable serial arm is refused with the facts.

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <clocale>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <locale>
#include <random>
#include <thread>

#include <console_bridge/console.h>

#include <sigmaik/chain.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/kinematics.hpp>

#include "numbers.hpp"

namespace {

using sigmaik::Chain;
using sigmaik::JointType;
using test::kInfinity;

// ---- Writing URDF --------------------------------------------------------------------------------------------------

std::string link(const std::string& name, const std::string& inside = "") {
  return "<link name='" + name + "'>" + inside + "</link>\n";
}

std::string joint(const std::string& name, const std::string& type, const std::string& parent, const std::string& child,
                  const std::string& inside) {
  return "<joint name='" + name + "' type='" + type + "'><parent link='" + parent + "'/><child link='" + child + "'/>" +
         inside + "</joint>\n";
}

const std::string kLimit = "<limit lower='-1' upper='2' velocity='3' effort='4'/>";

std::string robot(const std::string& inside) { return "<robot name='r'>\n" + inside + "</robot>\n"; }

// base --(j1 revolute)-- a --(j2 `type`, `inside`)-- tip
std::string arm(const std::string& inside, const std::string& type = "revolute") {
  return robot(link("base") + link("a") + link("tip") + joint("j1", "revolute", "base", "a", kLimit) +
               joint("j2", type, "a", "tip", inside));
}

std::string sprout(const std::string& more) {
  std::string text = arm(kLimit);
  return text.insert(text.find("</robot>"), more);
}

class File {
 public:
  explicit File(const std::string& text, const std::string& name = "arm.urdf")
      : directory_(std::filesystem::temp_directory_path() /
                   ("sigmaik_test_urdf_" + std::to_string(std::random_device{}()))) {
    std::filesystem::create_directories(directory_);
    path = (directory_ / name).string();
    std::ofstream(path, std::ios::binary) << text;
  }
  ~File() { std::filesystem::remove_all(directory_); }
  std::string directory() const { return directory_.string(); }
  std::string path;

 private:
  std::filesystem::path directory_;
};

// ---- Refusals ------------------------------------------------------------------------------------------------------

// The text of the refusal; "" where there is none.
std::string refusal(const std::string& source, const std::string& base = "", const std::string& tip = "",
                    const std::vector<double>& acceleration = {}) {
  try {
    Chain::from_urdf(source, base, tip, acceleration);
  } catch (const sigmaik::Error& e) {
    return e.what();
  }
  return "";
}

void check_facts(const std::string& text, const std::vector<std::string>& facts) {
  INFO("the message: ", text);
  CHECK_FALSE(text.empty());
  for (const std::string& fact : facts) {
    INFO("the fact: ", fact);
    CHECK(text.find(fact) != std::string::npos);
  }
}

TEST_CASE("sources that are no file") {
  check_facts(refusal(""), {"neither a file's path nor XML"});
  check_facts(refusal(" \n\t"), {"neither a file's path nor XML"});
  check_facts(refusal("/no/such/arm.urdf"), {"'/no/such/arm.urdf'", "no such file"});
  check_facts(refusal(std::string("/etc/passwd\0.urdf", 17)), {"'/etc/passwd?.urdf'", "no such file"});
  check_facts(refusal(std::string(10000, 'x')), {"xxx…'", "File name too long"});
  const File file("");
  check_facts(refusal(file.path), {file.path, "the file is empty"});
  check_facts(refusal(file.directory()), {file.directory(), "directory"});
  check_facts(refusal("/dev/zero"), {"/dev/zero", "not a regular file"});
  if (std::ifstream("/proc/self/mem")) {  // opens, but cannot be read
    check_facts(refusal("/proc/self/mem"), {"/proc/self/mem", "cannot be read"});
  }
}

TEST_CASE("files that cannot be opened") {
  const File file(arm(kLimit));
  std::filesystem::permissions(file.path, std::filesystem::perms::none);
  if (std::ifstream(file.path)) return;  // root may read everything
  check_facts(refusal(file.path), {file.path, "cannot be opened", "Permission denied"});
}

TEST_CASE("texts that are not XML, or not URDF") {
  check_facts(refusal("<robot name='r'"), {"URDF text", "malformed XML", "line 1"});
  check_facts(refusal("<robot>\n<link>\n</robot>"), {"malformed XML", "line 2", "MISMATCHED_ELEMENT"});
  check_facts(refusal("<!-- nothing -->"), {"there is no element"});
  check_facts(refusal("<?xml version='1.0'?>"), {"malformed XML"});
  check_facts(refusal("<sdf version='1.7'/>"), {"not a URDF", "<sdf>", "<robot>"});
  check_facts(refusal(arm(kLimit) + arm(kLimit)), {"second root element <robot>"});
  check_facts(refusal("<robot name='a' name='b'/>"), {"malformed XML", "ATTRIBUTE"});
  check_facts(refusal(std::string("<robot name='r'>\0</robot>", 25)), {"NUL"});
  const File words("an arm, please"), bytes("\xFF\xFE<\0r\0o\0b\0o\0t\0");
  check_facts(refusal(words.path), {words.path, "malformed XML"});
  check_facts(refusal(bytes.path), {bytes.path, "malformed XML"});
  std::string deep;
  for (int i = 0; i < 100000; ++i) deep += "<a>";
  check_facts(refusal("<robot name='r'>" + deep), {"nested more than 90 levels deep"});
}

TEST_CASE("entities are refused, not expanded") {
  std::string bomb = "<!DOCTYPE r [<!ENTITY a0 'ha'>";
  for (int i = 1; i < 30; ++i) {
    const std::string last = "&a" + std::to_string(i - 1) + ";";
    bomb += "<!ENTITY a" + std::to_string(i) + " '" + last + last + last + last + "'>";
  }
  check_facts(refusal(bomb + "]><robot name='&a29;'/>"), {"line 1", "entities", "not supported"});
  CHECK(Chain::from_urdf("<!DOCTYPE robot>" + arm(kLimit)).dof() == 2);
  // The five that XML itself has, and characters by number.
  const Chain chain = Chain::from_urdf(robot(link("a&amp;b") + link("&lt;&#65;&gt;&quot;") +
                                             joint("j&apos;s", "revolute", "a&amp;b", "&lt;A&gt;&quot;", kLimit)));
  CHECK(chain.base() == "a&b");
  CHECK(chain.tip() == "<A>\"");
  CHECK(chain.joint_names().front() == "j's");
}

TEST_CASE("xacro") {
  check_facts(refusal("<robot name='r' xmlns:xacro='http://ros.org/wiki/xacro'>\n<xacro:macro name='m'/>\n</robot>"),
              {"line 2", "<xacro:macro>", "run it through xacro first"});
  check_facts(refusal(robot(link("base", "<xacro:box/>"))), {"<xacro:box>", "xacro first"});
  check_facts(refusal(arm("<origin xyz='0 0 ${length}'/>" + kLimit)), {"'j2'", "${length}", "xacro first"});
  // xacro leaves its namespace behind.
  std::string text = arm(kLimit);
  CHECK(Chain::from_urdf(text.insert(6, " xmlns:xacro='http://ros.org/wiki/xacro'")).dof() == 2);
}

TEST_CASE("names") {
  check_facts(refusal(robot("")), {"no <link>"});
  check_facts(refusal(robot(link("a") + "<link/>")), {"line 3", "<link> without a name"});
  check_facts(refusal(robot(link("a") + link(""))), {"<link> without a name"});
  check_facts(refusal(robot(link("a") + link("b") + link("a"))), {"link 'a' is defined twice", "lines 2 and 4"});
  check_facts(refusal(sprout(link("b") + joint("j1", "fixed", "a", "b", ""))),
              {"joint 'j1' is defined twice", "lines 5 and 8"});
  check_facts(refusal(sprout(link("b") + joint("", "fixed", "a", "b", ""))), {"<joint> without a name"});
  check_facts(refusal("<robot>" + link("a") + link("b") + joint("j", "continuous", "a", "b", "") + "</robot>"),
              {"urdfdom", "No name given for the robot"});
}

TEST_CASE("bytes that are not UTF-8") {
  // Comments may have such bytes; names may not, and a message that quotes them stays UTF-8, as Python needs it.
  CHECK(Chain::from_urdf("<!-- Andr\xE9 -->" + arm(kLimit)).dof() == 2);
  for (const std::string bad :
       {"\xE9", "\xC3", "\xC0\x80", "\xE0\x80\x80", "\xED\xA0\x80", "\xF4\x90\x80\x80", "\x80"}) {
    check_facts(refusal(robot(link("a" + bad))), {"line 2", "<link> is not UTF-8"});
    check_facts(refusal(arm("<origin xyz='" + bad + "'/>" + kLimit)), {"<origin xyz=\"?"});
  }
  for (const std::string good : {"é", "€", "😀", "\xED\x9F\xBF", "\xF4\x8F\xBF\xBF"}) {
    check_facts(refusal(robot(link("a" + good) + link("b"))), {"'a" + good + "', 'b'"});
  }
  std::string text;
  while (text.size() < 400) text += "€";
  check_facts(refusal(text), {"€€…'"});
}

TEST_CASE("links and joints that are not a tree") {
  check_facts(refusal(sprout(link("b"))), {"not one tree", "'base', 'b'"});
  check_facts(refusal(sprout(joint("j3", "fixed", "tip", "base", ""))), {"no root", "loop"});
  check_facts(refusal(sprout(joint("j3", "fixed", "base", "tip", ""))), {"'tip'", "two joints, 'j2' and 'j3'"});
  check_facts(
      refusal(sprout(link("x") + link("y") + joint("j3", "fixed", "x", "y", "") + joint("j4", "fixed", "y", "x", ""))),
      {"loop apart from the root 'base'", "'x', 'y'"});
  check_facts(refusal(sprout(link("x") + joint("j3", "fixed", "x", "x", ""))), {"loop", "'x'"});
  check_facts(refusal(sprout(joint("j3", "fixed", "ghost", "tip", ""))), {"'j3'", "parent 'ghost'"});
  check_facts(refusal(sprout(joint("j3", "fixed", "tip", "ghost", ""))), {"'j3'", "child 'ghost'"});
  check_facts(refusal(sprout("<joint name='j3' type='fixed'><parent link='a'/></joint>")), {"'j3'", "no <child"});
  check_facts(refusal(sprout("<joint name='j3' type='fixed'><parent/><child link='a'/></joint>")),
              {"'j3'", "no <parent"});
  check_facts(refusal(sprout("<joint name='j3' type='fixed'><parent link='a'/><parent link='b'/></joint>")),
              {"'j3'", "second <parent>"});
}

TEST_CASE("base and tip") {
  const std::string two = sprout(link("b") + joint("j3", "prismatic", "a", "b", kLimit));
  check_facts(refusal(arm(kLimit), "nowhere"), {"base 'nowhere'", "'base', 'a', 'tip'"});
  check_facts(refusal(arm(kLimit), "", "nowhere"), {"tip 'nowhere'", "'base', 'a', 'tip'"});
  check_facts(refusal(two), {"2 leaves below 'base'", "'tip', 'b'"});
  check_facts(refusal(two, "tip", "a"), {"tip 'a' is not below base 'tip'", "above it: 'base'"});
  check_facts(refusal(two, "b", "tip"), {"tip 'tip' is not below base 'b'", "'a', 'base'"});
  check_facts(refusal(two, "a", "a"), {"same link 'a'"});
  check_facts(refusal(two, "tip"), {"same link 'tip'"});
  check_facts(refusal(two, "", "base"), {"same link 'base'"});

  CHECK(Chain::from_urdf(two, "", "b").joint_names() == std::vector<std::string>{"j1", "j3"});
  CHECK(Chain::from_urdf(two, "a", "b").joint_names() == std::vector<std::string>{"j3"});
  const Chain chain = Chain::from_urdf(arm(kLimit), "a");
  CHECK(chain.base() == "a");
  CHECK(chain.tip() == "tip");
  CHECK(chain.dof() == 1);

  // A long list is cut off.
  std::string many;
  for (int i = 0; i < 200; ++i) {
    const std::string name = "leaf" + std::to_string(i);
    many += link(name) + joint("to_" + name, "fixed", "tip", name, "");
  }
  const std::string text = refusal(sprout(many));
  check_facts(text, {"200 leaves", "'leaf0'", "and 150 more"});
  CHECK(text.size() < 1000);
}

TEST_CASE("joints that an arm cannot have") {
  check_facts(refusal(arm("", "floating")), {"'j2'", "floating"});
  check_facts(refusal(arm("", "planar")), {"'j2'", "planar"});
  check_facts(refusal(arm(kLimit, "spherical")), {"urdfdom", "[j2]", "[spherical]"});
  check_facts(refusal(robot(link("a") + link("b") + "<joint name='j'><parent link='a'/><child link='b'/></joint>")),
              {"joint [j] has no type"});
  check_facts(refusal(robot(link("a") + link("b") + joint("j", "fixed", "a", "b", ""))),
              {"no movable joint between 'a' and 'b'"});
  std::string long_arm = link("l0");
  for (int i = 1; i <= 17; ++i) {
    const std::string n = std::to_string(i);
    long_arm += link("l" + n) + joint("j" + n, "revolute", "l" + std::to_string(i - 1), "l" + n, kLimit);
  }
  check_facts(refusal(robot(long_arm)), {"17 movable joints", "at most 16"});
  CHECK(Chain::from_urdf(robot(long_arm), "", "l16").dof() == 16);
}

TEST_CASE("elements beside the arm do not matter") {
  const std::string beside =
      link("x", "<visual><geometry><teapot/></geometry><material name='nowhere'/></visual><inertial/>") +
      joint("jx", "floating", "a", "x", "") + link("y") + joint("jy", "revolute", "a", "y", "<mimic joint='j1'/>") +
      link("z") + joint("jz", "wobbly", "a", "z", "<limit lower='nan'/>") +
      "<material name='m'/><transmission name='t'><joint name='j1'/></transmission><gazebo><link name='a'/></gazebo>";
  CHECK(Chain::from_urdf(sprout(beside), "", "tip").dof() == 2);
}

TEST_CASE("numbers") {
  for (const std::string bad : {"nan", "inf", "-inf", "1e999", "1,5", "0x10", "1.0f", "", "a", "1 2", "--1", "+-1"}) {
    CAPTURE(bad);
    const std::string shown = "\"" + bad + "\"";
    const bool infinite = bad == "inf" || bad == "-inf";  // a limit may be infinite (URDF 1.2)
    for (const std::string attribute : {"lower", "upper", "velocity", "effort", "acceleration", "jerk"}) {
      if (infinite) break;
      std::string limit = "<limit";
      for (const std::string a : {"lower", "upper", "velocity", "effort", "acceleration", "jerk"}) {
        limit += " " + a + "='" + (a == attribute ? bad : a == "lower" ? "-1" : "1") + "'";
      }
      check_facts(refusal(arm(limit + "/>")), {"'j2'", "<limit", attribute, shown, "one finite number"});
    }
    check_facts(refusal(arm("<origin xyz='0 0 " + bad + "'/>" + kLimit)), {"'j2'", "<origin xyz", "three finite"});
    check_facts(refusal(arm("<origin rpy='0 " + bad + " 0'/>" + kLimit)), {"'j2'", "<origin rpy", "three finite"});
    check_facts(refusal(arm("<axis xyz='" + bad + "'/>" + kLimit)), {"'j2'", "<axis xyz", "three finite"});
  }
  check_facts(refusal(arm("<axis xyz='0 0 0'/>" + kLimit)), {"'j2'", "axis"});
  check_facts(refusal(arm("<axis/>" + kLimit)), {"'j2'", "axis"});
  check_facts(refusal(arm("<origin xyz='0 2e6 0'/>" + kLimit)), {"'j2'", "2000000", "absurd"});
  check_facts(refusal(arm("<origin xyz='0 0 0'/><origin xyz='0 0 1'/>" + kLimit)), {"'j2'", "second <origin>"});
  check_facts(refusal(arm("<origin xyz='0 0 0' rpy='0 0 0' quat_xyzw='0 0 0 1'/>" + kLimit)),
              {"'j2'", "quat_xyzw", "rpy"});
  check_facts(refusal(arm("<origin quat_xyzw='0 0 0'/>" + kLimit)), {"'j2'", "quat_xyzw", "four finite"});
  check_facts(refusal(arm("<origin quat_xyzw='0 0 0 0'/>" + kLimit)), {"'j2'", "quat_xyzw", "length 0"});
  check_facts(refusal(arm("<origin quat_xyzw='0 0 1 1'/>" + kLimit)), {"'j2'", "quat_xyzw", "no rotation"});

  // Printf formats from the file: urdfdom crashes on them.
  check_facts(refusal(arm("<origin xyz='%s%s%s%s%n 0 0'/>" + kLimit)), {"'j2'", "%s%s%s%s%n"});
  check_facts(refusal(arm("<limit velocity='%s%n' effort='%s'/>")), {"'j2'", "%s%n"});
  CHECK(Chain::from_urdf(robot(link("%s%n") + link("%d") + joint("%s%s%s", "continuous", "%s%n", "%d", ""))).dof() ==
        1);
  check_facts(refusal(robot(link("%s%n") + link("%d") + joint("%s%s%s", "%n", "%s%n", "%d", ""))), {"[%n]"});

  const Chain chain = Chain::from_urdf(
      arm("<origin xyz=' 1e-3\n+2\t-.5 ' rpy='0 0 0'/><limit lower=' -1 ' upper='+1.5' velocity='1E2' effort='7.'/>"));
  CHECK(chain.segments()[1].origin.translation() == Eigen::Vector3d(1e-3, 2.0, -0.5));
  CHECK(chain.limits().lower[1] == -1.0);
  CHECK(chain.limits().upper[1] == 1.5);
  CHECK(chain.limits().velocity[1] == 100.0);
  CHECK(chain.limits().effort[1] == 7.0);
}

TEST_CASE("limits that contradict themselves or are not there") {
  const auto limit = [](const std::string& attributes) { return refusal(arm("<limit " + attributes + "/>")); };
  check_facts(refusal(arm("")), {"urdfdom", "[j2]", "limit"});
  check_facts(refusal(arm("", "prismatic")), {"urdfdom", "[j2]", "limit"});
  check_facts(limit("lower='2' upper='1' velocity='1' effort='1'"), {"'j2'", "lower = 2", "upper = 1"});
  check_facts(limit("lower='1' velocity='1' effort='1'"), {"'j2'", "lower = 1", "upper = 0"});
  check_facts(limit("velocity='1' effort='1'"), {"'j2'", "neither lower nor upper", "continuous"});
  check_facts(limit("lower='0' upper='0' velocity='1' effort='1'"), {"'j2'", "cannot move", "fixed"});
  check_facts(limit("lower='-1' upper='1' velocity='-1' effort='1'"), {"'j2'", "velocity", "-1"});
  check_facts(limit("lower='-1' upper='1' velocity='1' effort='-2'"), {"'j2'", "effort", "-2"});
  check_facts(limit("lower='-1' upper='1' velocity='1' effort='1' acceleration='0'"), {"'j2'", "acceleration", "0"});
  check_facts(limit("lower='-1' upper='1' velocity='1' effort='1' acceleration='-3'"), {"'j2'", "acceleration", "-3"});
  check_facts(limit("lower='-1' upper='1' velocity='1' effort='1' jerk='0'"), {"'j2'", "jerk", "0"});
  check_facts(limit("lower='-1' upper='1' velocity='1' effort='1' jerk='-3'"), {"'j2'", "jerk", "-3"});
  check_facts(limit("lower='-1' upper='1' effort='1'"), {"urdfdom", "no velocity", "[j2]"});
  check_facts(limit("lower='-1' upper='1' velocity='1'"), {"urdfdom", "no effort", "[j2]"});
  check_facts(refusal(arm(kLimit + kLimit)), {"'j2'", "second <limit>"});
}

TEST_CASE("a chain says what is wrong with its model, and which limits it lacks") {
  CHECK(Chain::from_urdf(arm(kLimit)).warnings().empty());
  const std::string zero = "<limit lower='-1' upper='2' velocity='0' effort='0'/>";
  const Chain still = Chain::from_urdf(arm(zero));
  REQUIRE(still.warnings().size() == 1);
  CHECK(still.warnings()[0] ==
        "joint 'j2': velocity = 0 counts as no limit; a joint that does not move is of type fixed");
  CHECK(still.limits().velocity[1] == kInfinity);

  REQUIRE(still.missing_limits().size() == 2);
  CHECK(still.missing_limits()[0].find("'j2' has no velocity limit") == 0);
  CHECK(still.missing_limits()[1].find("the joints have no acceleration limit") == 0);
  sigmaik::JointLimits limits = still.limits();
  limits.velocity.setConstant(1.0);
  limits.acceleration.setConstant(10.0);
  const Chain complete = still.with_limits(limits);
  CHECK(complete.missing_limits().empty());
  CHECK(complete.warnings().empty());

  const std::string impossible =
      "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='3' ixy='0' ixz='0' iyz='0'/></inertial>";
  const Chain heavy = Chain::from_urdf(robot(link("base") + link("a", impossible) + link("tip") +
                                             joint("j1", "revolute", "base", "a", kLimit) +
                                             joint("j2", "revolute", "a", "tip", kLimit)));
  REQUIRE(heavy.warnings().size() == 1);
  CHECK(heavy.warnings()[0].find("link 'a': its inertia is no rigid body's: principal moments 1, 1, 3") == 0);
}

TEST_CASE("a start far outside the limits is rather a mistake of units") {
  const Chain chain = Chain::from_urdf(arm(kLimit));  // [-1, 2] rad, both
  sigmaik::JointVector q(2);
  q << 2.9, -1.9;
  CHECK(chain.far_outside_limits(q).empty());
  q << 90.0, -2.5;
  const std::vector<std::string> sentences = chain.far_outside_limits(q);
  REQUIRE(sentences.size() == 2);
  CHECK(sentences[0] == "joint 'j1' starts at 90 rad, 88 outside its limits [-1, 2]; are these degrees?");
  CHECK(sentences[1].find("joint 'j2' starts at -2.5 rad, 1.5 outside") == 0);
  q << 0.0, std::nan("");
  CHECK(chain.far_outside_limits(q).empty());  // reset() refuses NaN
  CHECK_THROWS_AS(chain.far_outside_limits(q.head(1)), sigmaik::Error);
}

TEST_CASE("huge limits are none") {
  const Chain chain = Chain::from_urdf(
      arm("<limit lower='-1e16' upper='1.7976931348623157e308' velocity='1e9' effort='9.9e8' acceleration='1e16'"
          " jerk='1e9'/>"));
  CHECK(chain.limits().lower[1] == -kInfinity);
  CHECK(chain.limits().upper[1] == kInfinity);
  CHECK(chain.limits().velocity[1] == kInfinity);
  CHECK(chain.limits().effort[1] == 9.9e8);
  CHECK(chain.limits().acceleration[1] == kInfinity);
  CHECK(chain.limits().jerk[1] == kInfinity);
  check_facts(refusal(arm("<limit lower='1e16' upper='1e17' velocity='1' effort='1'/>")), {"'j2'", "lower"});
  check_facts(refusal(arm("<limit lower='-1' upper='1' velocity='-1e16' effort='1'/>")), {"'j2'", "velocity"});
}

TEST_CASE("the acceleration argument") {
  const std::string text = arm("<limit lower='-1' upper='1' velocity='1' effort='1' acceleration='9'/>");
  CHECK(Chain::from_urdf(text).limits().acceleration[0] == kInfinity);
  CHECK(Chain::from_urdf(text).limits().acceleration[1] == 9.0);
  const Chain chain = Chain::from_urdf(text, "", "", {2.0, kInfinity});
  CHECK(chain.limits().acceleration[0] == 2.0);
  CHECK(chain.limits().acceleration[1] == kInfinity);
  check_facts(refusal(text, "", "", {1.0}), {"acceleration has 1 entries", "2 joints", "'j1', 'j2'"});
  check_facts(refusal(text, "", "", {1.0, 1.0, 1.0}), {"acceleration has 3 entries", "2 joints"});
  check_facts(refusal(text, "", "", {1.0, 0.0}), {"'j2'", "acceleration", "0"});
  check_facts(refusal(text, "", "", {-1.0, 1.0}), {"'j1'", "acceleration", "-1"});
  check_facts(refusal(text, "", "", {std::nan(""), 1.0}), {"'j1'", "acceleration", "not a number"});
}

TEST_CASE("inertias") {
  const auto with = [](const std::string& inside) {
    return robot(link("base") + link("tip", inside) + joint("j", "revolute", "base", "tip", kLimit));
  };
  const std::string tensor = "<inertia ixx='1' ixy='0.1' ixz='0.2' iyy='2' iyz='0.3' izz='3'/>";
  check_facts(refusal(with("<inertial/>")), {"link 'tip'", "<mass> and <inertia>"});
  check_facts(refusal(with("<inertial><mass/>" + tensor + "</inertial>")), {"link 'tip'", "<mass> has no value"});
  check_facts(refusal(with("<inertial><mass value='-1'/>" + tensor + "</inertial>")), {"'tip'", "mass = -1"});
  check_facts(refusal(with("<inertial><mass value='nan'/>" + tensor + "</inertial>")), {"'tip'", "mass", "nan"});
  check_facts(refusal(with("<inertial><mass value='1'/><inertia ixx='1'/></inertial>")), {"'tip'", "has no ixy"});

  const Chain chain = Chain::from_urdf(with("<inertial><origin xyz='1 2 3' rpy='0 0 " +
                                            std::string("1.5707963267948966") + "'/><mass value='5'/>" + tensor +
                                            "</inertial>"));
  REQUIRE(chain.segments()[0].inertia.has_value());
  const sigmaik::Inertia& inertia = *chain.segments()[0].inertia;
  CHECK(inertia.mass == 5.0);
  CHECK(inertia.center_of_mass == Eigen::Vector3d(1.0, 2.0, 3.0));
  Eigen::Matrix3d turned;  // by a quarter about z: x → y, y → −x
  turned << 2.0, -0.1, -0.3, -0.1, 1.0, 0.2, -0.3, 0.2, 3.0;
  CHECK((inertia.tensor - turned).cwiseAbs().maxCoeff() < 1e-15);
}

// ---- Results -------------------------------------------------------------------------------------------------------

TEST_CASE("every kind of joint and limit") {
  const Chain chain = Chain::from_urdf(robot(
      link("b") + link("l1") + link("l2") + link("l3") + link("l4") +
      joint("turn", "continuous", "b", "l1", "<limit lower='-1' upper='1' velocity='0' effort='6'/>") +
      joint("stay", "fixed", "l1", "l2", "<axis xyz=''/><limit/><mimic joint='turn'/><origin xyz='0 0 1'/>") +
      joint("slide", "prismatic", "l2", "l3", "<axis xyz='0 3 -4'/><limit upper='0.5' velocity='2' effort='0'/>") +
      joint("bend", "revolute", "l3", "l4",
            "<limit lower='-2' velocity='2.5' effort='7' acceleration='8' jerk='90'/>")));
  CHECK(chain.base() == "b");
  CHECK(chain.tip() == "l4");
  CHECK(chain.joint_names() == std::vector<std::string>{"turn", "slide", "bend"});
  CHECK(chain.joint_types() ==
        std::vector<JointType>{JointType::Continuous, JointType::Prismatic, JointType::Revolute});
  const auto row = [](double a, double b, double c) { return Eigen::Vector3d(a, b, c); };
  CHECK(chain.limits().lower == row(-kInfinity, 0.0, -2.0));
  CHECK(chain.limits().upper == row(kInfinity, 0.5, 0.0));
  CHECK(chain.limits().velocity == row(kInfinity, 2.0, 2.5));
  CHECK(chain.limits().effort == row(6.0, kInfinity, 7.0));
  CHECK(chain.limits().acceleration == row(kInfinity, kInfinity, 8.0));
  CHECK(chain.limits().jerk == row(kInfinity, kInfinity, 90.0));
  REQUIRE(chain.segments().size() == 4);
  CHECK(chain.segments()[0].axis == Eigen::Vector3d::UnitX());  // URDF's default
  CHECK(chain.segments()[1].type == JointType::Fixed);
  CHECK((chain.segments()[2].axis - Eigen::Vector3d(0.0, 0.6, -0.8)).norm() < 1e-16);
  CHECK_FALSE(chain.segments()[0].inertia.has_value());

  sigmaik::JointVector q(3);
  q << 0.0, 0.25, 0.0;
  CHECK((sigmaik::pose(chain, q).translation() - Eigen::Vector3d(0.0, 0.15, 0.8)).norm() < 1e-15);
}

TEST_CASE("file and text are the same") {
  const std::string text = "\xEF\xBB\xBF\n  <?xml version='1.0'?>\n" + arm(kLimit);
  const File file(text, "my arm äé.urdf");
  for (const std::string& source : {text, file.path}) {
    const Chain chain = Chain::from_urdf(source);
    CHECK(chain.joint_names() == std::vector<std::string>{"j1", "j2"});
    CHECK(chain.limits().upper[0] == 2.0);
  }
  check_facts(refusal(file.path, "nowhere"), {file.path, "'nowhere'"});
}

// Rz(yaw) Ry(pitch) Rx(roll) in long double.
Eigen::Matrix<long double, 3, 3> exact_rotation(const std::array<double, 3>& rpy) {
  using Vector = Eigen::Matrix<long double, 3, 1>;
  using Turn = Eigen::AngleAxis<long double>;
  return (Turn(rpy[2], Vector::UnitZ()).toRotationMatrix() * Turn(rpy[1], Vector::UnitY()).toRotationMatrix() *
          Turn(rpy[0], Vector::UnitX()).toRotationMatrix());
}

TEST_CASE("origins are exact") {
  std::mt19937_64 random(20240511);
  std::uniform_real_distribution<double> angle(-6.3, 6.3), length(-2.0, 2.0);
  const std::array<double, 8> common{0.0, M_PI_2, -M_PI_2, M_PI, -M_PI, M_PI_4, 1.5708, 3.14159};
  double worst = 0.0;
  for (int i = 0; i < 2000; ++i) {
    std::array<double, 3> rpy, xyz;
    for (double& a : rpy) a = i % 2 == 0 ? angle(random) : common[random() % common.size()];
    for (double& x : xyz) x = length(random);
    std::array<char, 300> text;
    std::snprintf(text.data(), text.size(), "<origin xyz='%.17g %.17g %.17g' rpy='%.17g %.17g %.17g'/>", xyz[0], xyz[1],
                  xyz[2], rpy[0], rpy[1], rpy[2]);
    const sigmaik::Pose origin = Chain::from_urdf(arm(text.data() + kLimit)).segments()[1].origin;
    CHECK(origin.translation() == Eigen::Vector3d(xyz[0], xyz[1], xyz[2]));
    worst = std::max(
        worst, static_cast<double>((origin.linear().cast<long double>() - exact_rotation(rpy)).cwiseAbs().maxCoeff()));
  }
  MESSAGE("largest error of an entry: ", worst);
  CHECK(worst < 5e-16);
}

TEST_CASE("damaged files are read or refused, nothing else") {
  const std::string whole = robot(link("base") +
                                  link("a",
                                       "<inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' "
                                       "izz='1'/></inertial>") +
                                  link("tip") +
                                  joint("j1", "revolute", "base", "a", "<origin xyz='0 0 1' rpy='1 2 3'/>" + kLimit) +
                                  joint("j2", "continuous", "a", "tip", "<axis xyz='0 1 0'/>"));
  std::mt19937_64 random(99);
  int read = 0, refused = 0;
  for (int i = 0; i < 5000; ++i) {
    std::string text = whole;
    for (auto k = random() % 2 + 1; k > 0; --k) {
      const std::size_t at = random() % text.size(), length = random() % 12;
      switch (random() % 4) {
        case 0: text[at] = static_cast<char>(random() % 256); break;
        case 1: text.erase(at, length); break;
        case 2: text.insert(at, text.substr(random() % text.size(), length)); break;
        default: text[at] = "<>/='0-e&;%"[random() % 11];
      }
    }
    try {
      const Chain chain = Chain::from_urdf(text[0] == '<' ? text : "<" + text);
      ++read;
      CHECK(sigmaik::pose(chain, sigmaik::JointVector::Constant(chain.dof(), 0.5)).matrix().allFinite());
    } catch (const sigmaik::Error&) {
      ++refused;
    }
  }
  CHECK(read > 100);
  CHECK(refused > 100);
}

class Comma : public std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

TEST_CASE("numbers do not depend on the locale") {
  const std::string text = arm("<origin xyz='0.125 1000.5 -0.25' rpy='0 0 0.5'/>" + kLimit);
  const Chain expected = Chain::from_urdf(text);
  const std::locale before = std::locale::global(std::locale(std::locale::classic(), new Comma));
  const char* const c_locale = std::setlocale(LC_NUMERIC, nullptr);
  const std::string c_before = c_locale != nullptr ? c_locale : "C";
  bool found = false;
  for (const char* name : {"de_DE.UTF-8", "de_DE.utf8", "de_DE", "fr_FR.UTF-8", "nl_NL.UTF-8"}) {
    found = found || std::setlocale(LC_NUMERIC, name) != nullptr;
  }
  const Chain chain = Chain::from_urdf(text);
  const std::string error = refusal(arm("<origin xyz='0,125 0 0'/>" + kLimit));
  std::setlocale(LC_NUMERIC, c_before.c_str());
  std::locale::global(before);
  if (!found) MESSAGE("no locale with a decimal comma is installed: only C++ streams were tried");
  CHECK(chain.segments()[1].origin.matrix() == expected.segments()[1].origin.matrix());
  CHECK(chain.limits().velocity == expected.limits().velocity);
  CHECK_FALSE(error.empty());
}

TEST_CASE("large files and long chains") {
  std::string text = link("l0");
  for (int i = 1; i <= 30000; ++i) {
    const std::string n = std::to_string(i);
    text += link("l" + n) + joint("j" + n, "fixed", "l" + std::to_string(i - 1), "l" + n, "<origin xyz='0 0 1e-3'/>");
  }
  text += link("tip") + joint("j", "revolute", "l30000", "tip", kLimit);
  const Chain chain = Chain::from_urdf(robot(text));
  CHECK(chain.dof() == 1);
  CHECK(chain.segments().size() == 30001);
  sigmaik::JointVector q(1);
  q << 0.0;
  CHECK(std::abs(sigmaik::pose(chain, q).translation().z() - 30.0) < 1e-9);
}

// ---- urdfdom's log -------------------------------------------------------------------------------------------------

class Counter final : public console_bridge::OutputHandler {
 public:
  void log(const std::string&, console_bridge::LogLevel, const char*, int) override { ++count; }
  int count = 0;
};

TEST_CASE("urdfdom's messages go into the error, and the log is left as it was") {
  Counter counter;
  console_bridge::OutputHandler* const before = console_bridge::getOutputHandler();
  const console_bridge::LogLevel level = console_bridge::getLogLevel();
  for (const auto wanted : {console_bridge::CONSOLE_BRIDGE_LOG_NONE, console_bridge::CONSOLE_BRIDGE_LOG_DEBUG}) {
    counter.count = 0;
    console_bridge::useOutputHandler(&counter);
    console_bridge::setLogLevel(wanted);
    const std::string text = refusal(arm(""));
    const bool same_handler = console_bridge::getOutputHandler() == &counter;
    const bool same_level = console_bridge::getLogLevel() == wanted;
    console_bridge::useOutputHandler(before);
    console_bridge::setLogLevel(level);
    check_facts(text, {"urdfdom", "[j2]", "limits"});
    CHECK(counter.count == 0);
    CHECK(same_handler);
    CHECK(same_level);
  }
}

TEST_CASE("many threads read at once") {
  std::vector<std::thread> threads;
  std::array<int, 4> wrong{};
  for (std::size_t t = 0; t < wrong.size(); ++t) {
    threads.emplace_back([&wrong, t] {
      const std::string name = "joint_of_thread_" + std::to_string(t);
      const std::string bad = robot(link("a") + link("b") + joint(name, "revolute", "a", "b", ""));
      for (int i = 0; i < 100; ++i) {
        if (Chain::from_urdf(arm(kLimit)).dof() != 2) ++wrong[t];
        const std::string text = refusal(bad);
        if (text.find(name) == std::string::npos || text.find("thread_") != text.rfind("thread_")) ++wrong[t];
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(wrong == std::array<int, 4>{});
}

// ---- The shipped arms ----------------------------------------------------------------------------------------------

TEST_CASE("the shipped arms") {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(SIGMAIK_ROBOTS_DIR)) {
    if (entry.path().extension() != ".urdf") continue;
    CAPTURE(entry.path().string());
    ++count;
    const Chain chain = Chain::from_urdf(entry.path().string());
    CHECK(chain.dof() >= 5);
    CHECK((chain.limits().velocity.array() < kInfinity).all());
  }
  CHECK(count >= 14);
}

}  // namespace
