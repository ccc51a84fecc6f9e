#pragma once
// The functions that the public headers mark real time, found in the headers' text.

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

namespace test {

/// "header.hpp function" and the number of its overloads that are marked.
using Marks = std::map<std::string, int>;

class MarkReader {
 public:
  explicit MarkReader(std::string header) : header_(std::move(header)) {}

  void line(std::string text) {
    text.erase(0, text.find_first_not_of(' '));
    if (text.starts_with("//")) {
      text.erase(0, text.find_first_not_of("/ "));  // words that a line break parts stay together
      if (declaration_.empty()) comment_ += lower(text) + " ";
      return;
    }
    if (text.empty()) {
      if (has("the next calls are real time")) rest_of_class_ = true;
      if (has("the next calls allocate")) rest_of_class_ = false;
      if (declaration_.empty()) comment_.clear();
      return;
    }
    declaration_ += text + " ";
    if (text.find(';') == std::string::npos && text.find('{') == std::string::npos &&
        text.find('}') == std::string::npos && !text.ends_with(":")) {
      return;
    }
    take();
    declaration_.clear();
    comment_.clear();
  }

  Marks marks;

 private:
  static std::string lower(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
    return text;
  }
  bool has(const char* words) const { return comment_.find(words) != std::string::npos; }

  void take() {
    if (declaration_.starts_with("}")) marked_class_ = rest_of_class_ = false;
    if (declaration_.starts_with("class ") && declaration_.find('{') != std::string::npos) {
      marked_class_ = has("calls on q are real time") || has("call after construction is real time");
      return;
    }
    const std::size_t open = declaration_.find('(');
    if (open == std::string::npos || declaration_.starts_with("struct ") || declaration_.starts_with("class ")) return;
    const bool own = has("real time") && !has("only if the sink is");
    const bool of_class = marked_class_ && declaration_[open + 1] != ')' &&
                          declaration_.starts_with("explicit") == false;
    if (has("as the next three functions")) more_ = 4;
    const bool of_group = more_ > 0;
    if (more_ > 0) --more_;
    if (!own && !of_group && !(of_class && is_noexcept()) && !(rest_of_class_ && is_noexcept())) return;
    std::size_t begin = open;
    while (begin > 0 &&
           (std::isalnum(static_cast<unsigned char>(declaration_[begin - 1])) != 0 || declaration_[begin - 1] == '_')) {
      --begin;
    }
    ++marks[header_ + " " + declaration_.substr(begin, open - begin)];
  }
  bool is_noexcept() const { return declaration_.find(" noexcept") != std::string::npos; }

  std::string header_, comment_, declaration_;
  bool marked_class_ = false, rest_of_class_ = false;
  int more_ = 0;
};

inline Marks realtime_marks(const std::filesystem::path& include) {
  Marks all;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(include)) {
    if (entry.path().extension() != ".hpp" || entry.path().filename() == "sigmaik.hpp") continue;
    MarkReader reader(entry.path().filename().string());
    std::ifstream file(entry.path());
    for (std::string text; std::getline(file, text);) reader.line(text);
    for (const auto& [name, count] : reader.marks) all[name] += count;
  }
  return all;
}

}  // namespace test
