// URDF, read twice. tinyxml2 sees the file as it stands: its tree, and its numbers digit for digit. urdfdom then sees a
// copy of the arm alone and says whether that is URDF. So nothing beside the arm (a gripper's mimic joint, a missing
// mesh, another tool's extension) refuses it; and no text of the file reaches urdfdom's log, which takes some of it for
// a printf format and crashes on "%s".

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <set>
#include <string_view>
#include <thread>

#include <console_bridge/console.h>
#include <tinyxml2.h>
#include <urdf_parser/urdf_parser.h>

#include <sigmaik/chain.hpp>

#include "link_shapes.hpp"
#include "message.hpp"

namespace sigmaik {
namespace {

using detail::message;
using detail::require;
using tinyxml2::XMLElement;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

template <typename... Parts>
[[noreturn]] void fail(const Parts&... parts) {
  throw Error(message(parts...));
}

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

// Length of the UTF-8 character at the start of `text`, 0 where there is none.
std::size_t utf8_length(std::string_view text) {
  const auto byte = [text](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U; };
  const unsigned first = byte(0), second = byte(1);
  if (first < 0x80) return text.empty() ? 0 : 1;
  if (first < 0xC2 || first > 0xF4) return 0;
  const std::size_t length = first < 0xE0 ? 2 : first < 0xF0 ? 3 : 4;
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0U) != 0x80U) return 0;
  }
  const bool overlong = (first == 0xE0 && second < 0xA0) || (first == 0xF0 && second < 0x90);
  const bool surrogate = first == 0xED && second > 0x9F;
  const bool beyond_last = first == 0xF4 && second > 0x8F;
  return overlong || surrogate || beyond_last ? 0 : length;
}

// What Python can show, whatever the file holds.
std::string printable(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    result += length > 0 && text[0] != '\0' ? std::string(text.substr(0, length)) : "?";
    text.remove_prefix(std::max<std::size_t>(length, 1));
  }
  return result;
}

// So that an error about a long text stays readable.
std::string shortened(std::string_view text) {
  constexpr std::size_t kLongest = 200;
  std::size_t end = 0;
  while (end < text.size() && end < kLongest) end += std::max<std::size_t>(utf8_length(text.substr(end)), 1);
  return std::string(text.substr(0, end)) + (end < text.size() ? "…" : "");
}

std::string listed(const std::vector<std::string>& names) {
  constexpr std::size_t kMost = 50;
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), kMost); ++i) text += (i > 0 ? ", '" : "'") + names[i] + "'";
  if (names.size() > kMost) text += message(" and ", names.size() - kMost, " more");
  return text;
}

// ---- The text ------------------------------------------------------------------------------------------------------

struct Source {
  std::string label;  // where errors say that they come from
  std::string xml;
};

Source read(const std::string& source) {
  const std::size_t mark = source.starts_with("\xEF\xBB\xBF") ? 3 : 0;
  const auto first = std::find_if_not(source.begin() + static_cast<std::ptrdiff_t>(mark), source.end(), is_blank);
  if (first == source.end()) fail("URDF: neither a file's path nor XML was given");
  if (*first == '<') return {"URDF text", source};

  Source result{"URDF '" + printable(shortened(source)) + "'", ""};
  std::error_code error;
  const auto status = std::filesystem::status(source, error);
  if (status.type() == std::filesystem::file_type::none) fail(result.label, ": ", error.message());
  // A path cut off at a NUL would open another file.
  if (!std::filesystem::exists(status) || source.find('\0') != std::string::npos) fail(result.label, ": no such file");
  if (std::filesystem::is_directory(status)) fail(result.label, ": is a directory, not a file");
  if (!std::filesystem::is_regular_file(status)) fail(result.label, ": is not a regular file");
  std::ifstream file(source, std::ios::binary);
  if (!file) fail(result.label, ": cannot be opened: ", std::strerror(errno));
  std::vector<char> part(1 << 16);
  while (file.read(part.data(), static_cast<std::streamsize>(part.size())) || file.gcount() > 0) {
    result.xml.append(part.data(), static_cast<std::size_t>(file.gcount()));
  }
  if (file.bad()) fail(result.label, ": cannot be read: ", std::strerror(errno));
  if (std::all_of(result.xml.begin(), result.xml.end(), is_blank)) fail(result.label, ": the file is empty");
  return result;
}

void refuse_xacro(const XMLElement& element) {
  const std::string_view name = element.Name();
  if (name.starts_with("xacro:")) {
    fail("line ", element.GetLineNum(), ": <", name,
         "> is xacro, not URDF; run it through xacro first: xacro "
         "arm.urdf.xacro > arm.urdf");
  }
  // tinyxml2 refuses deep nesting, so the recursion is bounded.
  for (auto* e = element.FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) refuse_xacro(*e);
}

const XMLElement& parse(const std::string& xml, tinyxml2::XMLDocument& document) {
  require(xml.find('\0') == std::string::npos, "malformed XML: it holds a NUL byte");
  if (document.Parse(xml.data(), xml.size()) != tinyxml2::XML_SUCCESS) {
    fail("malformed XML in line ", document.ErrorLineNum(), " (", document.ErrorName(), ")");
  }
  const XMLElement* const robot = document.RootElement();
  if (robot == nullptr) fail("malformed XML: there is no element");
  require(std::strcmp(robot->Name(), "robot") == 0, "not a URDF: the root element is <", robot->Name(),
          ">, not <robot>");
  for (auto* node = document.FirstChild(); node != nullptr; node = node->NextSibling()) {
    require(node->ToElement() == nullptr || node == robot, "malformed XML: a second root element <", node->Value(),
            "> in line ", node->GetLineNum());
    // tinyxml2 would leave "&name;" as it is.
    require(node->ToUnknown() == nullptr || std::string_view(node->Value()).find("ENTITY") == std::string_view::npos,
            "line ", node->GetLineNum(), " declares XML entities, which are not supported; write their values out");
  }
  refuse_xacro(*robot);
  return *robot;
}

// ---- The tree ------------------------------------------------------------------------------------------------------

struct TreeJoint {
  const XMLElement* element;
  std::string name, parent, child;
  std::string label() const { return "joint '" + name + "'"; }
};

// Which of two is meant cannot be known; urdfdom takes the first.
const XMLElement* only_child(const std::string& owner, const XMLElement& parent, const char* tag) {
  const XMLElement* const child = parent.FirstChildElement(tag);
  if (child != nullptr && child->NextSiblingElement(tag) != nullptr) {
    fail(owner, ": a second <", tag, "> in line ", child->NextSiblingElement(tag)->GetLineNum());
  }
  return child;
}

std::string name_of(const XMLElement& element) {
  const char* const name = element.Attribute("name");
  require(name != nullptr && *name != '\0', "line ", element.GetLineNum(), ": a <", element.Name(), "> without a name");
  for (std::string_view rest = name; !rest.empty(); rest.remove_prefix(utf8_length(rest))) {
    require(utf8_length(rest) > 0, "line ", element.GetLineNum(), ": the name of a <", element.Name(),
            "> is not UTF-8");
  }
  return name;
}

// Links and joints of the whole file; a tree once it is constructed.
class Tree {
 public:
  explicit Tree(const XMLElement& robot) {
    for (auto* e = robot.FirstChildElement("link"); e != nullptr; e = e->NextSiblingElement("link")) {
      const auto [place, is_new] = links_.emplace(name_of(*e), e);
      if (!is_new) {
        fail("link '", place->first, "' is defined twice, in lines ", place->second->GetLineNum(), " and ",
             e->GetLineNum());
      }
      names_.push_back(place->first);
    }
    require(!links_.empty(), "there is no <link>");
    std::map<std::string, int> lines;
    for (auto* e = robot.FirstChildElement("joint"); e != nullptr; e = e->NextSiblingElement("joint")) {
      const auto [place, is_new] = lines.emplace(name_of(*e), e->GetLineNum());
      if (!is_new) {
        fail("joint '", place->first, "' is defined twice, in lines ", place->second, " and ", e->GetLineNum());
      }
      add_joint(*e, place->first);
    }
    find_root();
  }

  const XMLElement& link(const std::string& name) const { return *links_.at(name); }
  const std::string& root() const { return root_; }

  void require_link(const char* role, const std::string& name) const {
    if (links_.count(name) == 0) fail(role, " '", shortened(name), "' is not a link; links: ", listed(names_));
  }

  // The only leaf at or below a link.
  std::string leaf(const std::string& base) const {
    std::vector<std::string> leaves = below(base);
    std::erase_if(leaves, [this](const std::string& link) { return children_.count(link) != 0; });
    if (leaves.size() > 1) fail(leaves.size(), " leaves below '", base, "'; choose the tip: ", listed(leaves));
    return leaves.front();
  }

  // Joints from base to tip.
  std::vector<const TreeJoint*> path(const std::string& base, const std::string& tip) const {
    require(base != tip, "base and tip are the same link '", base, "'");
    std::vector<const TreeJoint*> joints;
    std::vector<std::string> above;
    for (std::string link = tip; link != base; link = above.back()) {
      const auto joint = carrier_.find(link);
      if (joint == carrier_.end()) {
        fail("tip '", tip, "' is not below base '", base, "'; above it: ", above.empty() ? "nothing" : listed(above));
      }
      joints.push_back(&joint->second);
      above.push_back(joint->second.parent);
    }
    std::reverse(joints.begin(), joints.end());
    return joints;
  }

  // Joints that hang on a link.
  std::vector<const TreeJoint*> joints_on(const std::string& link) const {
    std::vector<const TreeJoint*> joints;
    const auto children = children_.find(link);
    if (children == children_.end()) return joints;
    for (const std::string& child : children->second) joints.push_back(&carrier_.at(child));
    return joints;
  }

 private:
  void add_joint(const XMLElement& element, const std::string& name) {
    TreeJoint joint{&element, name, "", ""};
    for (const auto& [tag, link] : {std::pair{"parent", &joint.parent}, std::pair{"child", &joint.child}}) {
      const XMLElement* const e = only_child(joint.label(), element, tag);
      const char* const value = e != nullptr ? e->Attribute("link") : nullptr;
      if (value == nullptr) fail(joint.label(), ": no <", tag, " link=…>");
      *link = value;
      if (links_.count(*link) == 0) fail(joint.label(), ": its ", tag, " '", *link, "' is not a link of the file");
    }
    children_[joint.parent].push_back(joint.child);
    const auto [place, is_new] = carrier_.emplace(joint.child, joint);
    if (!is_new) {
      fail("link '", joint.child, "' is the child of two joints, '", place->second.name, "' and '", name,
           "'; a URDF is a tree");
    }
  }

  void find_root() {
    std::vector<std::string> roots;
    for (const std::string& name : names_) {
      if (carrier_.count(name) == 0) roots.push_back(name);
    }
    require(!roots.empty(), "no root: every link is the child of a joint, so the links form a loop");
    if (roots.size() > 1) fail("not one tree: ", roots.size(), " links are no joint's child: ", listed(roots));
    root_ = roots.front();
    const std::vector<std::string> reached = below(root_);
    if (reached.size() == names_.size()) return;
    const std::set<std::string> found(reached.begin(), reached.end());
    std::vector<std::string> lost = names_;
    std::erase_if(lost, [&found](const std::string& name) { return found.count(name) != 0; });
    fail("links form a loop apart from the root '", root_, "': ", listed(lost));
  }

  std::vector<std::string> below(const std::string& base) const {
    std::vector<std::string> links{base};
    for (std::size_t i = 0; i < links.size(); ++i) {
      const auto children = children_.find(links[i]);
      if (children != children_.end()) links.insert(links.end(), children->second.begin(), children->second.end());
    }
    return links;
  }

  std::map<std::string, const XMLElement*> links_;
  std::vector<std::string> names_;                            // in the order of the file
  std::map<std::string, std::vector<std::string>> children_;  // of a link
  std::map<std::string, TreeJoint> carrier_;                  // of a link: the joint that it hangs on
  std::string root_;
};

// ---- Numbers -------------------------------------------------------------------------------------------------------

// Decimal numbers, in any locale; none where the attribute is missing.
std::vector<double> numbers(const std::string& owner, const XMLElement& element, const char* attribute,
                            std::size_t count) {
  const char* const text = element.Attribute(attribute);
  if (text == nullptr) return {};
  std::vector<double> values;
  const char* const end = text + std::strlen(text);
  bool ok = true;
  for (const char* p = std::find_if_not(text, end, is_blank); ok && p != end; p = std::find_if_not(p, end, is_blank)) {
    double value = 0.0;
    if (*p == '+' && p[1] != '-') ++p;
    const auto [next, error] = std::from_chars(p, end, value);
    ok = error == std::errc() && std::isfinite(value) && (next == end || is_blank(*next));
    values.push_back(value);
    p = next;
  }
  if (!ok || values.size() != count) {
    fail(owner, ": <", element.Name(), " ", attribute, "=\"", shortened(text),
         "\">: ", count == 1 ? "one finite number is" : "three finite numbers are", " needed",
         std::strchr(text, '$') != nullptr ? "; an expression of xacro's? run the file through xacro first" : "");
  }
  return values;
}

double number(const std::string& owner, const XMLElement& element, const char* attribute) {
  const std::vector<double> values = numbers(owner, element, attribute, 1);
  if (values.empty()) fail(owner, ": <", element.Name(), "> has no ", attribute);
  return values.front();
}

Eigen::Vector3d vector(const std::string& owner, const XMLElement& element, const char* attribute) {
  const std::vector<double> values = numbers(owner, element, attribute, 3);
  return values.empty() ? Eigen::Vector3d(Eigen::Vector3d::Zero()) : Eigen::Vector3d(values[0], values[1], values[2]);
}

// The pose in <origin>, which may be missing. Not urdfdom's, whose way through a quaternion costs some digits.
Pose origin(const std::string& owner, const XMLElement& parent) {
  Pose pose = Pose::Identity();
  const XMLElement* const e = only_child(owner, parent, "origin");
  if (e == nullptr) return pose;
  require(e->Attribute("quat_xyzw") == nullptr, owner, ": <origin quat_xyzw=…> is not URDF 1.0; give rpy");
  const Eigen::Vector3d rpy = vector(owner, *e, "rpy");
  const Eigen::Array3d c = rpy.array().cos(), s = rpy.array().sin();
  // Rz(yaw) Ry(pitch) Rx(roll)
  pose.linear() << c[2] * c[1], c[2] * s[1] * s[0] - s[2] * c[0], c[2] * s[1] * c[0] + s[2] * s[0], s[2] * c[1],
      s[2] * s[1] * s[0] + c[2] * c[0], s[2] * s[1] * c[0] - c[2] * s[0], -s[1], c[1] * s[0], c[1] * c[0];
  pose.translation() = vector(owner, *e, "xyz");
  return pose;
}

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

// ---- urdfdom -------------------------------------------------------------------------------------------------------

// Catches what urdfdom says. The process has one log handler: ours is in place only while urdfdom runs, and passes on
// what other threads say meanwhile.
class Messages final : public console_bridge::OutputHandler {
 public:
  Messages() : previous_(console_bridge::getOutputHandler()), level_(console_bridge::getLogLevel()) {
    console_bridge::useOutputHandler(this);
    console_bridge::setLogLevel(console_bridge::CONSOLE_BRIDGE_LOG_WARN);
  }
  ~Messages() override {
    console_bridge::setLogLevel(level_);
    console_bridge::useOutputHandler(previous_);
  }
  Messages(const Messages&) = delete;
  Messages& operator=(const Messages&) = delete;

  void log(const std::string& text, console_bridge::LogLevel level, const char* file, int line) override {
    if (std::this_thread::get_id() == owner_) {
      text_ += (text_.empty() ? "" : "; ") + text;
    } else if (previous_ != nullptr && level >= level_) {
      previous_->log(text, level, file, line);
    }
  }
  const std::string& text() const { return text_; }

 private:
  console_bridge::OutputHandler* previous_;
  console_bridge::LogLevel level_;
  std::thread::id owner_ = std::this_thread::get_id();
  std::string text_;
};

urdf::ModelInterfaceSharedPtr parse_by_urdfdom(const std::string& xml) {
  static std::mutex one_at_a_time;
  const std::lock_guard lock(one_at_a_time);
  const Messages messages;
  urdf::ModelInterfaceSharedPtr model;
  try {
    model = urdf::parseURDF(xml);
  } catch (const std::exception& e) {
    fail("urdfdom refuses it: ", e.what());
  }
  if (!model) fail("urdfdom refuses it: ", messages.text());
  // Else links would free one another by recursion, and a very long chain the stack.
  for (const auto& link : model->links_) link.second->child_links.clear();
  return model;
}

void copy(const XMLElement& from, const char* attribute, XMLElement& to) {
  if (from.Attribute(attribute) != nullptr) to.SetAttribute(attribute, from.Attribute(attribute));
}

void copy_numbers(const std::string& owner, const XMLElement& from, const char* attribute, std::size_t count,
                  XMLElement& to) {
  const std::vector<double> values = numbers(owner, from, attribute, count);
  if (values.empty()) return;
  std::string text;
  for (const double value : values) {
    std::array<char, 32> digits;  // the shortest that reads back as the same number
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
    text += (text.empty() ? "" : " ") + std::string(digits.data(), end);
  }
  to.SetAttribute(attribute, text.c_str());
}

// The joints of the path and their links: what urdfdom is asked about.
std::string reduced(const XMLElement& robot, const std::vector<const TreeJoint*>& path) {
  tinyxml2::XMLDocument document;
  XMLElement* const root = document.NewElement("robot");
  document.InsertEndChild(root);
  copy(robot, "name", *root);
  copy(robot, "version", *root);
  root->InsertNewChildElement("link")->SetAttribute("name", path.front()->parent.c_str());
  for (const TreeJoint* joint : path) {
    root->InsertNewChildElement("link")->SetAttribute("name", joint->child.c_str());
    XMLElement* const e = root->InsertNewChildElement("joint");
    e->SetAttribute("name", joint->name.c_str());
    copy(*joint->element, "type", *e);
    e->InsertNewChildElement("parent")->SetAttribute("link", joint->parent.c_str());
    e->InsertNewChildElement("child")->SetAttribute("link", joint->child.c_str());
    if (joint->element->Attribute("type", "fixed") != nullptr) continue;  // axis and limits mean nothing there
    if (auto* axis = only_child(joint->label(), *joint->element, "axis")) {
      copy_numbers(joint->label(), *axis, "xyz", 3, *e->InsertNewChildElement("axis"));
    }
    if (auto* limit = only_child(joint->label(), *joint->element, "limit")) {
      XMLElement* const to = e->InsertNewChildElement("limit");
      for (const char* attribute : {"lower", "upper", "velocity", "effort"}) {
        copy_numbers(joint->label(), *limit, attribute, 1, *to);
      }
    }
  }
  tinyxml2::XMLPrinter printer(nullptr, true);
  document.Print(&printer);
  return printer.CStr();
}

// ---- The arm -------------------------------------------------------------------------------------------------------

// Gazebo writes ±1e16 for "no limit", others the largest double.
double none_if_huge(double limit) { return std::abs(limit) >= 1e9 ? std::copysign(kInfinity, limit) : limit; }

// Exporters write 0 where they know no limit; a joint that must not move is a fixed joint.
double none_if_zero(double limit) { return limit == 0.0 ? kInfinity : none_if_huge(limit); }

void read_limits(const TreeJoint& from, const urdf::Joint& joint, Segment& segment) {
  const XMLElement* const limit = from.element->FirstChildElement("limit");
  if (limit == nullptr) return;  // continuous: urdfdom wants one of the others
  segment.velocity = none_if_zero(joint.limits->velocity);
  segment.effort = none_if_zero(joint.limits->effort);
  if (limit->Attribute("acceleration") != nullptr) {
    segment.acceleration = none_if_huge(number(from.label(), *limit, "acceleration"));
  }
  if (limit->Attribute("jerk") != nullptr) segment.jerk = none_if_huge(number(from.label(), *limit, "jerk"));
  if (segment.type == JointType::Continuous) return;
  segment.lower = none_if_huge(joint.limits->lower);
  segment.upper = none_if_huge(joint.limits->upper);
  // By URDF's default the joint would be stuck at 0.
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
  const urdf::ModelInterfaceSharedPtr model = parse_by_urdfdom(reduced(robot, path));
  std::vector<Segment> segments;
  for (const TreeJoint* joint : path) {
    const urdf::JointConstSharedPtr known = model->getJoint(joint->name);
    if (!known) fail(joint->label(), ": urdfdom reads its name as another");
    segments.push_back(read_segment(*joint, *known, tree));
  }
  if (!acceleration.empty()) set_acceleration(acceleration, segments);
  return Chain(std::move(base), std::move(segments));
}

// ---- Shapes --------------------------------------------------------------------------------------------------------

double positive(const std::string& owner, const XMLElement& element, const char* attribute) {
  const double value = number(owner, element, attribute);
  require(value > 0.0, owner, ": <", element.Name(), " ", attribute, "=\"", value, "\">: it must be above 0");
  return value;
}

// The shapes of one link, which stands at `pose` in the frame of `segment`.
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

std::vector<detail::LinkShape> shapes_of(const Chain& chain, const std::string& xml) {
  tinyxml2::XMLDocument document;
  const Tree tree(parse(xml, document));
  tree.require_link("base", chain.base());
  tree.require_link("tip", chain.tip());
  std::vector<std::string> links{chain.base()};
  for (const TreeJoint* joint : tree.path(chain.base(), chain.tip())) links.push_back(joint->child);
  std::vector<std::string> expected{chain.base()};
  for (const Segment& segment : chain.segments()) expected.push_back(segment.link_name);
  if (links != expected) fail("not the arm's: its links are ", listed(links), ", the arm's ", listed(expected));

  std::vector<detail::LinkShape> shapes;
  for (std::size_t i = 0; i < links.size(); ++i) {
    // The link, and what fixed joints carry beside the arm.
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

// What `work` makes of a source's XML, whose errors say where they come from.
template <typename Work>
auto with_label(const std::string& source, Work work) {
  const Source text = read(source);
  try {
    return work(text.xml);
  } catch (const Error& e) {
    throw Error(text.label + ": " + printable(e.what()));
  }
}

}  // namespace

std::vector<detail::LinkShape> detail::read_shapes(const Chain& chain, const std::string& source) {
  return with_label(source, [&chain](const std::string& xml) { return shapes_of(chain, xml); });
}

Chain Chain::from_urdf(const std::string& source, const std::string& base, const std::string& tip,
                       const std::vector<double>& acceleration) {
  return with_label(source, [&](const std::string& xml) { return read_chain(xml, base, tip, acceleration); });
}

}  // namespace sigmaik
