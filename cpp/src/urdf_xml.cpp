#include "urdf_xml.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>

#include <Eigen/Geometry>

#include "numbers.hpp"
#include "urdf_scan.hpp"

namespace sigmaik::detail::xml {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

// Length in bytes of the UTF-8 character at the start of `text`, 0 if the bytes are not UTF-8.
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

void refuse_xacro(const XMLElement& element) {
  const std::string_view name = element.Name();
  if (name.starts_with("xacro:")) {
    fail("line ", element.GetLineNum(), ": <", name,
         "> is xacro, not URDF; run it through xacro first: xacro "
         "arm.urdf.xacro > arm.urdf");
  }
  // tinyxml2 refuses deep nesting, which bounds the recursion.
  for (auto* e = element.FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) refuse_xacro(*e);
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

}  // namespace

std::string printable(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    result += length > 0 && text[0] != '\0' ? std::string(text.substr(0, length)) : "?";
    text.remove_prefix(std::max<std::size_t>(length, 1));
  }
  return result;
}

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

Source read(const std::string& source) {
  const std::size_t mark = source.starts_with("\xEF\xBB\xBF") ? 3 : 0;
  const auto first = std::find_if_not(source.begin() + static_cast<std::ptrdiff_t>(mark), source.end(), is_blank);
  if (first == source.end()) fail("URDF: neither a file's path nor XML was given");
  if (*first == '<') return {"URDF text", source};

  Source result{"URDF '" + printable(shortened(source)) + "'", ""};
  std::error_code error;
  const auto status = std::filesystem::status(source, error);
  if (status.type() == std::filesystem::file_type::none) fail(result.label, ": ", error.message());
  // The operating system would cut the path off at the NUL and open another file.
  if (!std::filesystem::exists(status) || source.find('\0') != std::string::npos) fail(result.label, ": no such file");
  if (std::filesystem::is_directory(status)) fail(result.label, ": is a directory, not a file");
  if (!std::filesystem::is_regular_file(status)) fail(result.label, ": is not a regular file");
  const auto size = std::filesystem::file_size(source, error);
  require(error || size <= kLargestText, result.label, ": has ", size, " bytes, and more than ", kLargestText,
          " are not read");
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

const XMLElement& parse(const std::string& xml, tinyxml2::XMLDocument& document) {
  require(xml.find('\0') == std::string::npos, "malformed XML: it holds a NUL byte");
  check_bounds(xml);
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
    // tinyxml2 does not replace "&name;" by the declared text.
    require(node->ToUnknown() == nullptr || std::string_view(node->Value()).find("ENTITY") == std::string_view::npos,
            "line ", node->GetLineNum(), " declares XML entities, which are not supported; write their values out");
  }
  refuse_xacro(*robot);
  return *robot;
}

// ---- The tree ------------------------------------------------------------------------------------------------------

Tree::Tree(const XMLElement& robot) {
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

void Tree::require_link(const char* role, const std::string& name) const {
  if (links_.count(name) == 0) fail(role, " '", shortened(name), "' is not a link; links: ", listed(names_));
}

std::string Tree::leaf(const std::string& base) const {
  std::vector<std::string> leaves = below(base);
  std::erase_if(leaves, [this](const std::string& link) { return children_.count(link) != 0; });
  if (leaves.size() > 1) fail(leaves.size(), " leaves below '", base, "'; choose the tip: ", listed(leaves));
  return leaves.front();
}

std::vector<const TreeJoint*> Tree::path(const std::string& base, const std::string& tip) const {
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

const TreeJoint* Tree::joint(const std::string& name) const {
  for (const auto& [link, joint] : carrier_) {
    if (joint.name == name) return &joint;
  }
  return nullptr;
}

std::vector<const TreeJoint*> Tree::joints_on(const std::string& link) const {
  std::vector<const TreeJoint*> joints;
  const auto children = children_.find(link);
  if (children == children_.end()) return joints;
  for (const std::string& child : children->second) joints.push_back(&carrier_.at(child));
  return joints;
}

void Tree::add_joint(const XMLElement& element, const std::string& name) {
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

void Tree::find_root() {
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

std::vector<std::string> Tree::below(const std::string& base) const {
  std::vector<std::string> links{base};
  for (std::size_t i = 0; i < links.size(); ++i) {
    const auto children = children_.find(links[i]);
    if (children != children_.end()) links.insert(links.end(), children->second.begin(), children->second.end());
  }
  return links;
}

const XMLElement* only_child(const std::string& owner, const XMLElement& parent, const char* tag) {
  const XMLElement* const child = parent.FirstChildElement(tag);
  if (child != nullptr && child->NextSiblingElement(tag) != nullptr) {
    fail(owner, ": a second <", tag, "> in line ", child->NextSiblingElement(tag)->GetLineNum());
  }
  return child;
}

// ---- Numbers -------------------------------------------------------------------------------------------------------

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
    fail(owner, ": <", element.Name(), " ", attribute, "=\"", shortened(text), "\">: ",
         count == 1   ? "one finite number is"
         : count == 3 ? "three finite numbers are"
                      : "four finite numbers are",
         " needed",
         std::strchr(text, '$') != nullptr ? "; an expression of xacro's? run the file through xacro first" : "");
  }
  return values;
}

double number(const std::string& owner, const XMLElement& element, const char* attribute) {
  const std::vector<double> values = numbers(owner, element, attribute, 1);
  if (values.empty()) fail(owner, ": <", element.Name(), "> has no ", attribute);
  return values.front();
}

std::optional<double> limit(const std::string& owner, const XMLElement& element, const char* attribute) {
  const char* const text = element.Attribute(attribute);
  if (text == nullptr) return std::nullopt;
  std::string_view word = text;
  while (!word.empty() && is_blank(word.front())) word.remove_prefix(1);
  while (!word.empty() && is_blank(word.back())) word.remove_suffix(1);
  const bool negative = word.starts_with('-');
  if (negative || word.starts_with('+')) word.remove_prefix(1);
  std::string lower(word);
  for (char& c : lower) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  if (lower == "inf" || lower == "infinity") return negative ? -kInfinity : kInfinity;
  return number(owner, element, attribute);
}

Eigen::Vector3d vector(const std::string& owner, const XMLElement& element, const char* attribute) {
  const std::vector<double> values = numbers(owner, element, attribute, 3);
  return values.empty() ? Eigen::Vector3d(Eigen::Vector3d::Zero()) : Eigen::Vector3d(values[0], values[1], values[2]);
}

Pose origin(const std::string& owner, const XMLElement& parent) {
  Pose pose = Pose::Identity();
  const XMLElement* const e = only_child(owner, parent, "origin");
  if (e == nullptr) return pose;
  pose.translation() = vector(owner, *e, "xyz");
  if (const std::vector<double> q = numbers(owner, *e, "quat_xyzw", 4); !q.empty()) {  // URDF 1.1
    require(e->Attribute("rpy") == nullptr, owner, ": <origin> gives both rpy and quat_xyzw");
    const Eigen::Quaterniond quaternion(q[3], q[0], q[1], q[2]);
    constexpr double kRounding = 0.01;
    require(std::abs(quaternion.norm() - 1.0) <= kRounding, owner, ": <origin quat_xyzw=\"",
            shortened(e->Attribute("quat_xyzw")), "\"> has the length ", quaternion.norm(), ", not 1: no rotation");
    pose.linear() = quaternion.normalized().toRotationMatrix();
    return pose;
  }
  const Eigen::Vector3d rpy = vector(owner, *e, "rpy");
  const Eigen::Array3d c = rpy.array().cos(), s = rpy.array().sin();
  // Rz(yaw) Ry(pitch) Rx(roll)
  pose.linear() << c[2] * c[1], c[2] * s[1] * s[0] - s[2] * c[0], c[2] * s[1] * c[0] + s[2] * s[0], s[2] * c[1],
      s[2] * s[1] * s[0] + c[2] * c[0], s[2] * s[1] * c[0] - c[2] * s[0], -s[1], c[1] * s[0], c[1] * c[0];
  return pose;
}

}  // namespace sigmaik::detail::xml
