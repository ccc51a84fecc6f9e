#include "fields.hpp"

namespace sigmaik::bindings {
namespace {

constexpr std::size_t kColumns = 100;  // of a docstring

// In characters, not bytes.
std::size_t width(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0u) != 0x80u; }));
}

// "name: doc", folded at blanks, further lines set in by four.
std::string folded(const std::string& text) {
  std::string out, line;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    const std::string word = text.substr(at, end - at);
    if (width(line) + 1 + width(word) > kColumns && !line.empty()) {
      out += line + "\n";
      line = "    " + word;
    } else {
      line += (at == 0 ? "" : " ") + word;
    }
    at = end + 1;
  }
  return out + line + "\n";
}

std::string listed(const std::vector<Slot>& slots, std::size_t from, std::size_t to) {
  std::string out;
  for (std::size_t i = from; i < to; ++i) out += (i == from ? "" : ", ") + slots[i].name;
  return out;
}

}  // namespace

std::string shown(py::handle object) {
  constexpr std::size_t kMost = 60;
  const std::string text = py::repr(object).cast<std::string>();
  std::string out;
  for (std::size_t i = 0; i < text.size() && text[i] != '\n'; ++i) {
    if (width(out) >= kMost && (static_cast<unsigned char>(text[i]) & 0xC0u) != 0x80u) return out + "…";
    out += text[i];
  }
  return out.size() < text.size() ? out + "…" : out;
}

void refuse(const char* what, const std::string& need, py::handle object) {
  throw ArgumentError(std::string(what) + " must be " + need + ", not " + shown(object));
}

std::string text_of(double value) {
  if (std::isinf(value)) return value > 0.0 ? "inf" : "-inf";
  return py::repr(py::float_(value)).cast<std::string>();
}

std::string Argument<Twist>::text(const Twist& value) {
  if (value == Twist::Constant(value[0])) return text_of(value[0]);
  std::string out;
  for (const double entry : value) out += (out.empty() ? "(" : ", ") + text_of(entry);
  return out + ")";
}

Twist Argument<Twist>::from(py::handle object, const char* what) {
  const Array array = Array::ensure(object);
  if (!array) PyErr_Clear();
  if (array && array.ndim() == 0) return Twist::Constant(*array.data());
  if (!array || array.ndim() != 1 || array.shape(0) != 6) {
    throw Error(std::string(what) + " must be a number or have shape (6,)");
  }
  return Eigen::Map<const Twist>(array.data());
}

std::string Argument<Eigen::Vector3d>::text(const Eigen::Vector3d& value) {
  return "(" + text_of(value[0]) + ", " + text_of(value[1]) + ", " + text_of(value[2]) + ")";
}

Eigen::Vector3d Argument<Eigen::Vector3d>::from(py::handle object, const char* what) {
  return vector_argument(object, what);
}

std::vector<py::handle> Signature::sort(const py::args& args, const py::kwargs& kwargs) const {
  std::vector<py::handle> out(slots.size());
  if (args.size() > positional) {
    throw ArgumentError(function + " takes " + std::to_string(positional) + " arguments by position (" +
                        listed(slots, 0, positional) + "), got " + std::to_string(args.size()) +
                        "; give the others by name");
  }
  for (std::size_t i = 0; i < args.size(); ++i) out[i] = args[i];
  for (const auto& [key, value] : kwargs) {
    const std::string name = text_argument(key, "option");
    const auto slot = std::find_if(slots.begin(), slots.end(), [&](const Slot& s) { return s.name == name; });
    if (slot == slots.end()) {
      py::list names;
      std::size_t first_option = 0;
      for (const Slot& s : slots) names.append(s.name);
      while (first_option < slots.size() && slots[first_option].text.empty()) ++first_option;
      const py::list close = py::module_::import("difflib").attr("get_close_matches")(name, names, 1);
      throw ArgumentError(function + " has no option '" + name + "'; " +
                          (close.empty() ? "" : "did you mean '" + close[0].cast<std::string>() + "'? ") + "It has " +
                          listed(slots, first_option, slots.size()));
    }
    py::handle& to = out[static_cast<std::size_t>(slot - slots.begin())];
    if (to.ptr() != nullptr) throw ArgumentError(function + " is given " + name + " twice: by position, and by name");
    to = value;
  }
  for (std::size_t i = 0; i < slots.size(); ++i) {
    if (out[i].ptr() == nullptr && slots[i].text.empty()) throw ArgumentError(function + " needs " + slots[i].name);
  }
  return out;
}

std::string Signature::docstring(const std::string& name, const std::string& self, const std::string& returns,
                                 const std::string& doc) const {
  std::string out = name + "(";
  if (!self.empty()) out += "self: " + self;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    if (out.back() != '(') out += ", ";
    if (i == positional) out += "*, ";
    out += slots[i].name + ": " + slots[i].type + (slots[i].text.empty() ? "" : " = " + slots[i].text);
  }
  out += ") -> " + returns + "\n\n" + doc + (doc.empty() ? "" : "\n\n");
  for (const Slot& slot : slots) {
    if (!slot.doc.empty()) out += folded(slot.name + ": " + slot.doc);
  }
  return out;
}

}  // namespace sigmaik::bindings
