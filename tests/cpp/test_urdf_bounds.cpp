// Bounds of what the reader takes: texts that made the XML parser quadratic, and inertias that no body has.
#include <doctest/doctest.h>

#include <functional>
#include <string>
#include <vector>

#include <sigmaik/chain.hpp>
#include <sigmaik/dynamics.hpp>
#include <sigmaik/error.hpp>

using sigmaik::Chain;

namespace {

constexpr std::size_t kMegabyte = 1 << 20;

// Two links and a joint. `beside` stands in <robot>, `inside` in the joint, whose name is `name`.
std::string arm(const std::string& beside, const std::string& inside = "", const std::string& name = "j") {
  return "<robot name='r'>" + beside + "<link name='a'/><link name='b'/><joint name='" + name + "' type='revolute'>" +
         inside +
         "<parent link='a'/><child link='b'/><axis xyz='0 0 1'/>"
         "<limit lower='-1' upper='1' velocity='1' effort='1'/></joint></robot>";
}

std::string repeated(const std::string& part, std::size_t bytes = kMegabyte) {
  std::string text;
  while (text.size() < bytes) text += part;
  return text;
}

std::string attributes(std::size_t count) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i) text += " a" + std::to_string(i) + "='1'";
  return text;
}

std::string nested(int levels) {
  std::string open, close;
  for (int i = 0; i < levels; ++i) {
    open += "<x>";
    close += "</x>";
  }
  return open + close;
}

// The text of the refusal; "" where there is none.
std::string refusal(const std::string& text) {
  try {
    Chain::from_urdf(text);
  } catch (const sigmaik::Error& e) {
    return e.what();
  }
  return "";
}

void check_refused(const std::string& text, const std::vector<std::string>& facts) {
  const std::string error = refusal(text);
  CHECK(error.size() < 500);
  for (const std::string& fact : facts) {
    INFO("the message: ", error);
    INFO("the fact: ", fact);
    CHECK(error.find(fact) != std::string::npos);
  }
}

}  // namespace

TEST_CASE("an element has at most a hundred attributes") {
  CHECK(refusal(arm("<x" + attributes(100) + "/>")).empty());
  const std::vector<std::string> facts{"line 3", "more than 100 attributes"};
  check_refused(arm("\n\n<x" + attributes(101) + "/>"), facts);
  check_refused(arm("\n\n<x" + attributes(80000) + "/>"), facts);  // a megabyte
  check_refused(arm("", "\n\n<x" + attributes(80000) + "/>"), facts);
  check_refused("\n\n<robot" + attributes(80000) + ">", facts);
  check_refused("\n\n<?xml version='1.0'?><!-- <x> --><robot" + attributes(80000) + ">", facts);
  check_refused(arm("\n\n<x a='<y/>' b=\"'\" c='/>'" + attributes(98) + "/>"), facts);
  CHECK(refusal(arm("<x a='<y/>' b=\"'\" c='/>'" + attributes(97) + "/>")).empty());
  // Many elements with many attributes each.
  CHECK(refusal(arm(repeated("<x" + attributes(100) + "/>"))).empty());
  // Marks in comments and CDATA are no attributes.
  CHECK(refusal(arm("<!--<x" + attributes(2000) + "/>--><![CDATA[<x" + attributes(2000) + "/>]]>")).empty());
}

TEST_CASE("a reference to a character ends soon") {
  const std::vector<std::string> facts{"malformed XML", "\"&#\" without a \";\""};
  check_refused(arm("", "", repeated("&#")), facts);
  check_refused(arm(repeated("&#")), facts);
  check_refused(arm("") + repeated("&#"), facts);
  check_refused(arm("", "", repeated("&#x") + ";"), facts);
  check_refused(arm("", "", "&#" + std::string(kMegabyte, '1') + ";"), facts);
  const Chain chain = Chain::from_urdf(arm("", "", "&#x4A;&#00000065;"));
  CHECK(chain.joint_names()[0] == "JA");
  CHECK(refusal(arm("<!-- &# --><![CDATA[ &# ]]>")).empty());
}

TEST_CASE("elements are nested at most ninety deep") {
  CHECK(refusal(arm(nested(89))).empty());
  CHECK(refusal(arm(repeated(nested(80)))).empty());
  const std::vector<std::string> facts{"nested more than 90 levels deep"};
  check_refused(arm(nested(90)), facts);
  check_refused(arm(repeated("<x>")), facts);
  check_refused(arm("", repeated("<x y='1'>")), facts);
  CHECK(refusal(arm(repeated("<x/>"))).empty());
}

// No time is asserted. If one of the texts took quadratic time, the test would run into the time-out.
TEST_CASE("a megabyte of anything else is read") {
  for (const std::string& text :
       {arm(repeated("<!-- x -->")), arm("<!--" + std::string(kMegabyte, '-') + " -->"), arm(repeated("<![CDATA[x]]>")),
        arm("", repeated("<x/>")), arm("<x y='" + std::string(kMegabyte, 'y') + "'/>"),
        arm("", "", std::string(kMegabyte, 'n')), arm("", "", repeated("&amp;")), arm("", "", repeated("&")),
        arm(std::string(kMegabyte, '\n')), repeated("<?xml version='1.0'?>") + arm(""),
        arm("", "<origin xyz='0." + std::string(kMegabyte, '1') + " 0 0'/>")}) {
    CHECK(refusal(text).empty());
  }
  std::string star = "<link name='l0'/>", chain = star;
  for (int i = 1; i <= 8000; ++i) {
    const std::string n = std::to_string(i), head = "<link name='l" + n + "'/><joint name='j" + n + "' type='fixed'>";
    star += head + "<parent link='a'/><child link='l" + n + "'/></joint>";
    chain += head + "<parent link='l" + std::to_string(i - 1) + "'/><child link='l" + n + "'/></joint>";
  }
  const std::string to_root = "<joint name='j0' type='fixed'><parent link='a'/><child link='l0'/></joint>";
  CHECK(Chain::from_urdf(arm(star + to_root), "", "b").dof() == 1);
  check_refused(arm(star + to_root), {"8002 leaves below 'a'"});
  CHECK(Chain::from_urdf(arm(chain + to_root), "", "b").dof() == 1);
  std::string bomb = "<!DOCTYPE robot [<!ENTITY e0 'ha'>";
  for (int i = 1; i < 60; ++i) bomb += "<!ENTITY e" + std::to_string(i) + " '&e" + std::to_string(i - 1) + ";'>";
  check_refused(bomb + "]>" + arm("&e59;"), {"declares XML entities"});
}

TEST_CASE("a text of more than 64 MiB is not read") {
  const std::string large(65 * kMegabyte, ' ');
  check_refused("<robot name='r'>" + large, {"68157456 bytes", "more than 67108864"});
}

// ---- Inertias ------------------------------------------------------------------------------------------------------

namespace {

std::string with_inertia(const std::string& mass, const std::string& tensor) {
  return "<robot name='r'><link name='a'/><link name='b'><inertial><mass value='" + mass + "'/><inertia " + tensor +
         "/></inertial></link><joint name='j' type='continuous'><parent link='a'/><child link='b'/></joint></robot>";
}

std::string diagonal(const std::string& xx, const std::string& yy, const std::string& zz) {
  return "ixx='" + xx + "' iyy='" + yy + "' izz='" + zz + "' ixy='0' ixz='0' iyz='0'";
}

}  // namespace

TEST_CASE("inertias with which a mass matrix could be indefinite are refused") {
  const std::vector<std::string> facts{"link 'b'", "principal moment", "no body has a negative one"};
  check_refused(with_inertia("1", diagonal("-1", "1", "1")), facts);
  check_refused(with_inertia("1", diagonal("1", "1", "-1e-3")), facts);
  check_refused(with_inertia("0", diagonal("-1", "-1", "-1")), facts);
  check_refused(with_inertia("1", "ixx='1' iyy='1' izz='1' ixy='2' ixz='0' iyz='0'"), facts);  // -1, 1, 3
  check_refused(with_inertia("1", "ixx='1e-6' iyy='1e-6' izz='1e-6' ixy='0' ixz='0' iyz='1.1e-6'"), facts);
  check_refused(with_inertia("1", diagonal("1e300", "1e300", "-1e300")), facts);
  check_refused(with_inertia("-1", diagonal("1", "1", "1")), {"link 'b'", "mass = -1"});
  check_refused(with_inertia("-1e-9", diagonal("1", "1", "1")), {"link 'b'", "mass = -1"});
  check_refused(with_inertia("nan", diagonal("1", "1", "1")), {"link 'b'", "nan"});
  check_refused(with_inertia("1", diagonal("1", "inf", "1")), {"link 'b'", "inf"});
}

TEST_CASE("inertias that published files have are taken, and where no body has them there is a warning") {
  for (const std::string& fine :
       {with_inertia("0", diagonal("0", "0", "0")), with_inertia("2", diagonal("0", "0", "0")),
        with_inertia("2", diagonal("1", "1", "2")),
        // The rounding of a printed tensor of a flat body.
        with_inertia("2", "ixx='0.1' iyy='0.1' izz='0.2' ixy='0.1000000000001' ixz='0' iyz='0'"),
        with_inertia("2", diagonal("1e-20", "-1e-22", "1e-20"))}) {
    CHECK(Chain::from_urdf(fine).dof() == 1);
  }
  CHECK(Chain::from_urdf(with_inertia("2", diagonal("1", "1", "2"))).warnings().empty());
  for (const std::string& odd :
       {with_inertia("1", diagonal("1", "1", "3")), with_inertia("1", diagonal("0", "0", "0.35")),
        with_inertia("0", diagonal("1", "1", "1"))}) {
    const Chain chain = Chain::from_urdf(odd);
    REQUIRE(chain.warnings().size() == 1);
    CHECK(chain.warnings()[0].find("link 'b': its inertia is no rigid body's") == 0);
    // The mass matrix is that of a sum of squares, so the dynamics are well-posed.
    sigmaik::Dynamics dynamics(chain);
    CHECK(dynamics.mass_matrix(sigmaik::JointVector::Zero(1))(0, 0) >= 0.0);
  }
}
