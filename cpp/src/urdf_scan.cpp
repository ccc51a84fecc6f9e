#include "urdf_scan.hpp"

#include <algorithm>

#include "message.hpp"

namespace sigmaik::detail::xml {
namespace {

class Scan {
 public:
  explicit Scan(std::string_view text) : text_(text) {}

  void run() {
    while (at_ < text_.size()) {
      if (text_[at_] != '<') {
        check_references(skip_to("<", 0));
      } else if (starts("<!--")) {
        skip_to("-->", 3);
      } else if (starts("<![CDATA[")) {
        skip_to("]]>", 3);
      } else if (starts("<?")) {
        skip_to("?>", 2);
      } else if (starts("<!")) {
        skip_to(">", 1);
      } else {
        tag();
      }
    }
  }

 private:
  bool starts(std::string_view mark) const { return text_.substr(at_, mark.size()) == mark; }

  // Moves on to the next mark, or behind the first `behind` bytes of the mark. Returns what was passed.
  std::string_view skip_to(std::string_view mark, std::size_t behind) {
    const std::size_t from = at_;
    at_ = text_.find(mark, from);
    at_ = at_ == std::string_view::npos ? text_.size() : at_ + behind;
    return text_.substr(from, at_ - from);
  }

  void tag() {
    const bool closes = starts("</");
    int attributes = 0;
    bool empty = false;
    for (++at_; at_ < text_.size() && text_[at_] != '>'; ++at_) {
      empty = text_[at_] == '/';
      if (text_[at_] != '"' && text_[at_] != '\'') continue;
      ++attributes;
      if (attributes > kMostAttributes) refuse("an element has more than ", kMostAttributes, " attributes");
      const std::string_view quote = text_.substr(at_, 1);
      ++at_;
      check_references(skip_to(quote, 0));
    }
    ++at_;
    if (!empty) depth_ += closes ? -1 : 1;
    if (depth_ > kDeepest) refuse("elements are nested more than ", kDeepest, " levels deep");
  }

  void check_references(std::string_view part) const {
    for (std::size_t k = part.find("&#"); k != std::string_view::npos; k = part.find("&#", k + 2)) {
      if (part.substr(k, kLongestReference).find(';') != std::string_view::npos) continue;
      refuse("malformed XML: \"&#\" without a \";\" within ", kLongestReference, " bytes");
    }
  }

  template <typename... Parts>
  [[noreturn]] void refuse(const Parts&... parts) const {
    const std::string_view before = text_.substr(0, at_);
    throw Error(message("line ", 1 + std::count(before.begin(), before.end(), '\n'), ": ", parts...));
  }

  std::string_view text_;
  std::size_t at_ = 0;
  int depth_ = 0;
};

}  // namespace

void check_bounds(std::string_view text) {
  require(text.size() <= kLargestText, "the text has ", text.size(), " bytes, and more than ", kLargestText,
          " are not read");
  Scan(text).run();
}

}  // namespace sigmaik::detail::xml
