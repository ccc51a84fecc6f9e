#pragma once
// Texts of errors, made while setting up.

#include <locale>
#include <sstream>
#include <string>

#include <sigmaik/error.hpp>

namespace sigmaik::detail {

template <typename... Parts>
std::string message(const Parts&... parts) {
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text.precision(17);
  (text << ... << parts);
  return text.str();
}

template <typename... Parts>
void require(bool ok, const Parts&... parts) {
  if (!ok) throw Error(message(parts...));
}

}  // namespace sigmaik::detail
