// An arm from a URDF, which is read twice. tinyxml2 reads the file as it is: the tree, and all digits of the numbers
// (urdf_xml.hpp). urdfdom then reads a copy that contains the arm alone, and decides whether the copy is valid URDF
// (urdfdom.hpp). Elements beside the arm, such as a gripper's mimic joint, a missing mesh or another tool's extension,
// are therefore no reason to refuse a file. No text of the file reaches urdfdom's log, which uses some texts as printf
// formats and crashes on "%s".

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include <sigmaik/chain.hpp>

#include "numbers.hpp"
#include "urdf_xml.hpp"
#include "urdfdom.hpp"

namespace sigmaik {
namespace {

namespace xml = detail::xml;

using detail::require;
using detail::xml::fail;
using detail::xml::listed;
using detail::xml::number;
using detail::xml::numbers;
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

void read_limits(const TreeJoint& from, Segment& segment) {
  const XMLElement* const limit = from.element->FirstChildElement("limit");
  if (limit == nullptr) return;  // a continuous joint: urdfdom requires <limit> of all other types
  const auto read = [&](const char* attribute) {
    return xml::limit(from.label(), *limit, attribute).value_or(kInfinity);
  };
  segment.velocity = none_if_zero(read("velocity"));
  // URDF requires an effort, so files write 0 for an unknown effort; a velocity of 0 may be intended and gets a note.
  if (read("velocity") == 0.0) {
    segment.notes.push_back(from.label() +
                            ": velocity = 0 counts as no limit; a joint that does not move is of type fixed");
  }
  segment.effort = none_if_zero(read("effort"));
  segment.acceleration = none_if_huge(read("acceleration"));
  segment.deceleration = none_if_huge(read("deceleration"));
  segment.jerk = none_if_huge(read("jerk"));
  if (segment.type == JointType::Continuous) return;
  segment.lower = none_if_huge(xml::limit(from.label(), *limit, "lower").value_or(0.0));
  segment.upper = none_if_huge(xml::limit(from.label(), *limit, "upper").value_or(0.0));
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
  segment.axis = Eigen::Vector3d(joint.axis.x, joint.axis.y, joint.axis.z);
  read_limits(from, segment);
  return segment;
}

bool is_fixed(const TreeJoint& joint) { return joint.element->Attribute("type", "fixed") != nullptr; }

// What <mimic> says, followed to a joint that moves by itself.
Mimic mimic_of(const TreeJoint& from, const Tree& tree) {
  Mimic whole{from.name, 1.0, 0.0};
  const TreeJoint* at = &from;
  std::set<std::string> seen;
  while (const XMLElement* const mimic = is_fixed(*at) ? nullptr : only_child(at->label(), *at->element, "mimic")) {
    require(seen.insert(at->name).second, from.label(), " mimics itself in the end");
    const char* const name = mimic->Attribute("joint");
    if (name == nullptr) fail(at->label(), ": <mimic> has no joint");
    const std::vector<double> multiplier = numbers(at->label(), *mimic, "multiplier", 1);
    const std::vector<double> offset = numbers(at->label(), *mimic, "offset", 1);
    whole.offset += whole.multiplier * (offset.empty() ? 0.0 : offset[0]);
    whole.multiplier *= multiplier.empty() ? 1.0 : multiplier[0];
    require(std::abs(whole.multiplier) > 1e-9, from.label(),
            ": multiplier = 0 of its <mimic>; a joint that does not move is of type fixed");
    const TreeJoint* const next = tree.joint(name);
    if (next == nullptr) fail(at->label(), " mimics joint '", name, "', which is not in the file");
    if (is_fixed(*next)) fail(at->label(), " mimics joint '", name, "', which is of type fixed");
    at = next;
    whole.joint = at->name;
  }
  return whole;
}

// Joints that mimic one another by a joint beside the arm: the first of them moves by itself, and the others mimic the
// first. With θ = m q + b of the joint q beside the arm, q = (θ_1 − b_1)/m_1.
void read_mimics(const std::vector<const TreeJoint*>& path, const Tree& tree, std::vector<Segment>& segments) {
  std::map<std::string, Mimic> first;  // by the joint beside the arm: the joint that moves for it
  for (std::size_t i = 0; i < path.size(); ++i) {
    Segment& segment = segments[i];
    if (segment.type == JointType::Fixed) continue;
    Mimic mimic = mimic_of(*path[i], tree);
    if (mimic.joint == segment.joint_name) continue;
    const bool on_path = std::any_of(path.begin(), path.end(),
                                     [&mimic](const TreeJoint* joint) { return joint->name == mimic.joint; });
    if (!on_path) {
      const Mimic own{segment.joint_name, mimic.multiplier, mimic.offset};
      const auto [leader, is_first] = first.try_emplace(mimic.joint, own);
      if (is_first) {
        segment.notes.push_back(path[i]->label() + " mimics joint '" + mimic.joint +
                                "', which is not between base and tip: it counts as a joint that moves by itself");
        continue;
      }
      const Mimic& of = leader->second;
      const double m = mimic.multiplier / of.multiplier;
      mimic = {of.joint, m, mimic.offset - m * of.offset};
    }
    segment.mimic = mimic;
  }
}

void set_acceleration(const std::vector<double>& acceleration, std::vector<Segment>& segments) {
  std::vector<std::string> names;
  for (Segment& segment : segments) {
    if (segment.type == JointType::Fixed || segment.mimic) continue;
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
  read_mimics(path, tree, segments);
  if (!acceleration.empty()) set_acceleration(acceleration, segments);
  return Chain(std::move(base), std::move(segments));
}

}  // namespace

Chain detail::with_urdf(Chain chain, std::string text) {
  chain.urdf_ = text.empty() ? nullptr : std::make_shared<const std::string>(std::move(text));
  return chain;
}

Chain Chain::from_urdf(const std::string& source, const std::string& base, const std::string& tip,
                       const std::vector<double>& acceleration) {
  return detail::xml::with_label(source, [&](const std::string& text) {
    return detail::with_urdf(read_chain(text, base, tip, acceleration), text);
  });
}

}  // namespace sigmaik
