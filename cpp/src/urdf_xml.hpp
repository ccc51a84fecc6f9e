#pragma once
// A URDF's text as XML: the source, the tree of links and joints, and the numbers of attributes. All functions throw
// Error with the facts. Numbers keep all their digits, whatever the locale.

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <tinyxml2.h>

#include <sigmaik/error.hpp>
#include <sigmaik/types.hpp>

#include "message.hpp"

namespace sigmaik::detail::xml {

using tinyxml2::XMLElement;

template <typename... Parts>
[[noreturn]] void fail(const Parts&... parts) {
  throw Error(message(parts...));
}

// The text with "?" for every byte that is not UTF-8, because Python strings must be UTF-8.
std::string printable(std::string_view text);

// The first 200 characters, so that an error about a long text stays readable.
std::string shortened(std::string_view text);

// The names in quotes, at most 50.
std::string listed(const std::vector<std::string>& names);

struct Source {
  std::string label;  // names the source in errors
  std::string xml;
};

// Reads a file, or takes the source as the text if the source starts with "<".
Source read(const std::string& source);

// Parses the text into `document` and returns the <robot> element.
const XMLElement& parse(const std::string& xml, tinyxml2::XMLDocument& document);

// Returns work(the source's text), and adds the source's name to errors.
template <typename Work>
auto with_label(const std::string& source, Work work) {
  const Source text = read(source);
  try {
    return work(text.xml);
  } catch (const Error& e) {
    throw Error(text.label + ": " + printable(e.what()));
  }
}

struct TreeJoint {
  const XMLElement* element;
  std::string name, parent, child;
  std::string label() const { return "joint '" + name + "'"; }
};

// Links and joints of the whole file. The constructor checks that they form one tree.
class Tree {
 public:
  explicit Tree(const XMLElement& robot);

  const XMLElement& link(const std::string& name) const { return *links_.at(name); }
  const std::string& root() const { return root_; }
  bool has_link(const std::string& name) const { return links_.count(name) != 0; }

  void require_link(const char* role, const std::string& name) const;

  // The only leaf at or below a link.
  std::string leaf(const std::string& base) const;

  // The joints from base to tip.
  std::vector<const TreeJoint*> path(const std::string& base, const std::string& tip) const;

  // The joint with this name, or null.
  const TreeJoint* joint(const std::string& name) const;

  // The joints whose parent is a link.
  std::vector<const TreeJoint*> joints_on(const std::string& link) const;

 private:
  void add_joint(const XMLElement& element, const std::string& name);
  void find_root();
  std::vector<std::string> below(const std::string& base) const;

  std::map<std::string, const XMLElement*> links_;
  std::vector<std::string> names_;                            // in the order of the file
  std::map<std::string, std::vector<std::string>> children_;  // of a link
  std::map<std::string, TreeJoint> carrier_;                  // of a link: the joint whose child the link is
  std::string root_;
};

// The only child with this tag, or null. Two of them are an error: nothing tells which one is meant, and urdfdom would
// take the first. `owner` names the element in errors.
const XMLElement* only_child(const std::string& owner, const XMLElement& parent, const char* tag);

// `count` finite decimal numbers, or none if the attribute is missing.
std::vector<double> numbers(const std::string& owner, const XMLElement& element, const char* attribute,
                            std::size_t count);

// One number. A missing attribute is an error.
double number(const std::string& owner, const XMLElement& element, const char* attribute);

// A limit: one number, which may be infinite ("inf", "-inf"; URDF 1.2). None if the attribute is missing.
std::optional<double> limit(const std::string& owner, const XMLElement& element, const char* attribute);

// Three numbers, zero if the attribute is missing.
Eigen::Vector3d vector(const std::string& owner, const XMLElement& element, const char* attribute);

// The pose in <origin>, the identity if there is none. urdfdom's pose is not used: its conversion to a quaternion and
// back loses some digits.
Pose origin(const std::string& owner, const XMLElement& parent);

}  // namespace sigmaik::detail::xml
