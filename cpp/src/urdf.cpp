// An arm from a URDF, which is read twice. tinyxml2 reads the file as it is: the tree, and all digits of the numbers
// (urdf_xml.hpp). urdfdom then reads a copy that contains the arm alone, and decides whether the copy is valid URDF
// (urdfdom.hpp). Elements beside the arm, such as a gripper's mimic joint, a missing mesh or another tool's extension,
// are therefore no reason to refuse a file. No text of the file reaches urdfdom's log, which uses some texts as printf
// formats and crashes on "%s".

#include <cmath>
#include <utility>

#include <sigmaik/chain.hpp>

#include "numbers.hpp"
#include "urdf_xml.hpp"
#include "urdfdom.hpp"

namespace sigmaik {
namespace {

using detail::require;
using detail::xml::fail;
using detail::xml::listed;
using detail::xml::number;
using detail::xml::only_child;
using detail::xml::origin;
using detail::xml::parse;
using detail::xml::Tree;
using detail::xml::TreeJoint;
using detail::xml::XMLElement;

using detail::kInfinity;

std::optional<Inertia> inertia(const std::string& link, const XMLElement& element) {
  const std::string owner = "link '" + link + "'";
  const XMLElement* const inertial = only_child(owner, element, "inertial");
  if (inertial == nullptr) return std::nullopt;
  const XMLElement* const mass = only_child(owner, *inertial, "mass");
  const XMLElement* const tensor = only_child(owner, *inertial, "inertia");
  if (mass == nullptr || tensor == nullptr) fail(owner, ": <inertial> needs both <mass> and <inertia>");
  const Pose pose = origin(owner, *inertial);
  const auto entry = [&](const char* attribute) { return number(owner, *tensor, attribute); };
  const double xx = entry("ixx"), xy = entry("ixy"), xz = entry("ixz");
  const double yy = entry("iyy"), yz = entry("iyz"), zz = entry("izz");
  Eigen::Matrix3d t;
  t << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  return Inertia{number(owner, *mass, "value"), pose.translation(), pose.linear() * t * pose.linear().transpose()};
}

// Gazebo writes ±1e16 for "no limit", other tools write the largest double.
double none_if_huge(double limit) { return std::abs(limit) >= 1e9 ? std::copysign(kInfinity, limit) : limit; }

// Exporters write 0 for a limit that they do not know. A joint that must not move would be a fixed joint.
double none_if_zero(double limit) { return limit == 0.0 ? kInfinity : none_if_huge(limit); }

void read_limits(const TreeJoint& from, const urdf::Joint& joint, Segment& segment) {
  const XMLElement* const limit = from.element->FirstChildElement("limit");
  if (limit == nullptr) return;  // a continuous joint: urdfdom requires <limit> of all other types
  segment.velocity = none_if_zero(joint.limits->velocity);
  // URDF requires an effort, so files write 0 for an unknown effort; a velocity of 0 may be intended and gets a note.
  if (joint.limits->velocity == 0.0 && limit->Attribute("velocity") != nullptr) {
    segment.notes.push_back(from.label() +
                            ": velocity = 0 counts as no limit; a joint that does not move is of type fixed");
  }
  segment.effort = none_if_zero(joint.limits->effort);
  if (limit->Attribute("acceleration") != nullptr) {
    segment.acceleration = none_if_huge(number(from.label(), *limit, "acceleration"));
  }
  if (limit->Attribute("jerk") != nullptr) segment.jerk = none_if_huge(number(from.label(), *limit, "jerk"));
  if (segment.type == JointType::Continuous) return;
  segment.lower = none_if_huge(joint.limits->lower);
  segment.upper = none_if_huge(joint.limits->upper);
  // Both bounds default to 0 in URDF, and the joint could not move.
  require(limit->Attribute("lower") != nullptr || limit->Attribute("upper") != nullptr, from.label(),
          ": <limit> gives neither lower nor upper; a joint that turns without end is of type continuous");
  require(segment.lower != segment.upper, from.label(), ": lower = upper = ", segment.lower,
          ", so it cannot move; a joint that does not move is of type fixed");
}

Segment read_segment(const TreeJoint& from, const urdf::Joint& joint, const Tree& tree) {
  Segment segment;
  segment.joint_name = from.name;
  segment.link_name = from.child;
  segment.origin = origin(from.label(), *from.element);
  segment.inertia = inertia(from.child, tree.link(from.child));
  switch (joint.type) {
    case urdf::Joint::FIXED: return segment;
    case urdf::Joint::REVOLUTE: segment.type = JointType::Revolute; break;
    case urdf::Joint::CONTINUOUS: segment.type = JointType::Continuous; break;
    case urdf::Joint::PRISMATIC: segment.type = JointType::Prismatic; break;
    default:
      fail(from.label(), " is of type ", from.element->Attribute("type"),
           "; an arm has revolute, continuous, prismatic and fixed joints");
  }
  if (const XMLElement* const mimic = from.element->FirstChildElement("mimic")) {
    const char* const other = mimic->Attribute("joint");
    fail(from.label(), " mimics joint '", other != nullptr ? other : "",
         "'; only joints that move by themselves can be part of an arm");
  }
  segment.axis = Eigen::Vector3d(joint.axis.x, joint.axis.y, joint.axis.z);
  read_limits(from, joint, segment);
  return segment;
}

void set_acceleration(const std::vector<double>& acceleration, std::vector<Segment>& segments) {
  std::vector<std::string> names;
  for (Segment& segment : segments) {
    if (segment.type == JointType::Fixed) continue;
    if (names.size() < acceleration.size()) segment.acceleration = acceleration[names.size()];
    names.push_back(segment.joint_name);
  }
  if (acceleration.size() != names.size()) {
    fail("acceleration has ", acceleration.size(), " entries, the arm ", names.size(), " joints: ", listed(names));
  }
}

Chain read_chain(const std::string& xml, std::string base, std::string tip, const std::vector<double>& acceleration) {
  tinyxml2::XMLDocument document;
  const XMLElement& robot = parse(xml, document);
  const Tree tree(robot);
  if (base.empty()) base = tree.root();
  tree.require_link("base", base);
  if (tip.empty()) tip = tree.leaf(base);
  tree.require_link("tip", tip);
  const std::vector<const TreeJoint*> path = tree.path(base, tip);
  const urdf::ModelInterfaceSharedPtr model = detail::parse_by_urdfdom(detail::reduced(robot, path));
  std::vector<Segment> segments;
  for (const TreeJoint* joint : path) {
    const urdf::JointConstSharedPtr known = model->getJoint(joint->name);
    if (!known) fail(joint->label(), ": urdfdom reads its name as another");
    segments.push_back(read_segment(*joint, *known, tree));
  }
  if (!acceleration.empty()) set_acceleration(acceleration, segments);
  return Chain(std::move(base), std::move(segments));
}

}  // namespace

Chain Chain::from_urdf(const std::string& source, const std::string& base, const std::string& tip,
                       const std::vector<double>& acceleration) {
  return detail::xml::with_label(source, [&](const std::string& text) {
    Chain chain = read_chain(text, base, tip, acceleration);
    chain.urdf_ = std::make_shared<const std::string>(text);
    return chain;
  });
}

}  // namespace sigmaik
