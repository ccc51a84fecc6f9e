// Collision shapes of an arm's links.

#include <string_view>
#include <utility>

#include "link_shapes.hpp"
#include "urdf_xml.hpp"

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
using detail::xml::vector;
using detail::xml::XMLElement;

double positive(const std::string& owner, const XMLElement& element, const char* attribute) {
  const double value = number(owner, element, attribute);
  require(value > 0.0, owner, ": <", element.Name(), " ", attribute, "=\"", value, "\">: it must be above 0");
  return value;
}

// Appends the shapes of one link, whose frame is at `pose` in the frame of `segment`.
void add_shapes(const XMLElement& link, const std::string& name, int segment, const Pose& pose,
                std::vector<detail::LinkShape>& shapes) {
  using Kind = detail::LinkShape::Kind;
  const std::string owner = "link '" + name + "'";
  const char* const tag = link.FirstChildElement("collision") != nullptr ? "collision" : "visual";
  bool mesh = false;
  for (auto* e = link.FirstChildElement(tag); e != nullptr; e = e->NextSiblingElement(tag)) {
    const XMLElement* const geometry = only_child(owner, *e, "geometry");
    const XMLElement* const g = geometry != nullptr ? geometry->FirstChildElement() : nullptr;
    if (g == nullptr) fail(owner, ": a <", tag, "> without geometry in line ", e->GetLineNum());
    detail::LinkShape shape{segment, Kind::Mesh, pose * origin(owner, *e)};
    const std::string_view what = g->Name();
    if (what == "box") {
      shape.kind = Kind::Box;
      shape.size = vector(owner, *g, "size");
      require(shape.size.minCoeff() > 0.0, owner, ": <box size=\"", shape.size.transpose(), "\">: it must be above 0");
    } else if (what == "cylinder") {
      shape.kind = Kind::Cylinder;
      shape.size = Eigen::Vector3d(positive(owner, *g, "radius"), positive(owner, *g, "length"), 0.0);
    } else if (what == "sphere") {
      shape.kind = Kind::Sphere;
      shape.size = Eigen::Vector3d(positive(owner, *g, "radius"), 0.0, 0.0);
    } else {
      mesh = true;
      continue;
    }
    shapes.push_back(shape);
  }
  if (mesh) shapes.push_back({segment, Kind::Mesh, pose});
}

// The names of the links from base to tip, in which a link that the URDF does not have is empty.
std::vector<std::string> links_of(const Chain& chain, const Tree& tree, bool strict) {
  std::vector<std::string> expected{chain.base()};
  for (const Segment& segment : chain.segments()) expected.push_back(segment.link_name);
  if (!strict) {
    for (std::string& link : expected) {
      if (!tree.has_link(link)) link.clear();
    }
    return expected;
  }
  tree.require_link("base", chain.base());
  // Tools (Chain::with_tool) are not in the file, and have no shapes.
  std::size_t count = chain.segments().size();
  const auto is_tool = [&tree](const Segment& s) { return s.type == JointType::Fixed && !tree.has_link(s.link_name); };
  while (count > 1 && is_tool(chain.segments()[count - 1])) --count;
  const std::string& tip = chain.segments()[count - 1].link_name;
  tree.require_link("tip", tip);
  std::vector<std::string> links{chain.base()};
  for (const TreeJoint* joint : tree.path(chain.base(), tip)) links.push_back(joint->child);
  expected.resize(count + 1);
  if (links != expected) fail("not the arm's: its links are ", listed(links), ", the arm's ", listed(expected));
  return links;
}

std::vector<detail::LinkShape> shapes_of(const Chain& chain, const std::string& xml, bool strict) {
  tinyxml2::XMLDocument document;
  const Tree tree(parse(xml, document));
  const std::vector<std::string> links = links_of(chain, tree, strict);
  std::vector<detail::LinkShape> shapes;
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (links[i].empty()) continue;
    // The link itself, and all links that fixed joints attach to it beside the arm.
    std::vector<std::pair<std::string, Pose>> rigid{{links[i], Pose::Identity()}};
    for (std::size_t k = 0; k < rigid.size(); ++k) {
      const auto [name, pose] = rigid[k];
      add_shapes(tree.link(name), name, static_cast<int>(i) - 1, pose, shapes);
      for (const TreeJoint* joint : tree.joints_on(name)) {
        if (i + 1 < links.size() && joint->child == links[i + 1]) continue;
        if (joint->element->Attribute("type", "fixed") == nullptr) continue;
        rigid.emplace_back(joint->child, pose * origin(joint->label(), *joint->element));
      }
    }
  }
  return shapes;
}

}  // namespace

std::vector<detail::LinkShape> detail::read_shapes(const Chain& chain, const std::string& source, bool strict) {
  return xml::with_label(source, [&](const std::string& text) { return shapes_of(chain, text, strict); });
}

}  // namespace sigmaik
