#include "urdfdom.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <mutex>
#include <optional>
#include <string_view>
#include <thread>

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

namespace sigmaik::detail {
namespace {

using xml::fail;
using xml::numbers;
using xml::only_child;
using xml::TreeJoint;
using xml::XMLElement;

// Collects urdfdom's messages. A process has only one log handler. This one is installed only while urdfdom runs, and
// passes on the messages of other threads.
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

void copy(const XMLElement& from, const char* attribute, XMLElement& to) {
  if (from.Attribute(attribute) != nullptr) to.SetAttribute(attribute, from.Attribute(attribute));
}

void copy_numbers(const std::string& owner, const XMLElement& from, const char* attribute, std::size_t count,
                  XMLElement& to) {
  const std::vector<double> values = numbers(owner, from, attribute, count);
  if (values.empty()) return;
  std::string text;
  for (const double value : values) {
    std::array<char, 32> digits;  // the shortest text that reads back as the same number
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
    text += (text.empty() ? "" : " ") + std::string(digits.data(), end);
  }
  to.SetAttribute(attribute, text.c_str());
}

}  // namespace

urdf::ModelInterfaceSharedPtr parse_by_urdfdom(const std::string& text) {
  static std::mutex one_at_a_time;
  const std::lock_guard lock(one_at_a_time);
  const Messages messages;
  urdf::ModelInterfaceSharedPtr model;
  try {
    model = urdf::parseURDF(text);
  } catch (const std::exception& e) {
    fail("urdfdom refuses it: ", e.what());
  }
  if (!model) fail("urdfdom refuses it: ", messages.text());
  // A link owns its children. Without this line the links of a very long chain would be freed recursively and overflow
  // the stack.
  for (const auto& link : model->links_) link.second->child_links.clear();
  return model;
}

std::string reduced(const XMLElement& robot, const std::vector<const TreeJoint*>& path) {
  tinyxml2::XMLDocument document;
  XMLElement* const root = document.NewElement("robot");
  document.InsertEndChild(root);
  copy(robot, "name", *root);
  // urdfdom of today's distributions knows version 1.0 alone. What 1.1 and 1.2 add is read without urdfdom.
  const char* const version = robot.Attribute("version");
  const bool newer = version != nullptr && (std::string_view(version) == "1.1" || std::string_view(version) == "1.2");
  if (!newer) copy(robot, "version", *root);
  root->InsertNewChildElement("link")->SetAttribute("name", path.front()->parent.c_str());
  for (const TreeJoint* joint : path) {
    root->InsertNewChildElement("link")->SetAttribute("name", joint->child.c_str());
    XMLElement* const e = root->InsertNewChildElement("joint");
    e->SetAttribute("name", joint->name.c_str());
    copy(*joint->element, "type", *e);
    e->InsertNewChildElement("parent")->SetAttribute("link", joint->parent.c_str());
    e->InsertNewChildElement("child")->SetAttribute("link", joint->child.c_str());
    if (joint->element->Attribute("type", "fixed") != nullptr) continue;  // a fixed joint needs no axis and no limits
    if (auto* axis = only_child(joint->label(), *joint->element, "axis")) {
      copy_numbers(joint->label(), *axis, "xyz", 3, *e->InsertNewChildElement("axis"));
    }
    if (auto* limit = only_child(joint->label(), *joint->element, "limit")) {
      XMLElement* const to = e->InsertNewChildElement("limit");
      for (const char* attribute : {"lower", "upper", "velocity", "effort"}) {
        const std::optional<double> value = xml::limit(joint->label(), *limit, attribute);
        if (value && std::isfinite(*value)) {
          copy_numbers(joint->label(), *limit, attribute, 1, *to);
        } else if (value || newer) {  // urdfdom knows no infinity, and requires what version 1.2 leaves out
          to->SetAttribute(attribute, "0");
        }
      }
    }
  }
  tinyxml2::XMLPrinter printer(nullptr, true);
  document.Print(&printer);
  return printer.CStr();
}

}  // namespace sigmaik::detail
