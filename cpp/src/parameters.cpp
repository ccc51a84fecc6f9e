#include <sigmaik/parameters.hpp>

#include <cmath>

#include "message.hpp"

namespace sigmaik {

bool Range::contains(double value) const noexcept {
  return std::isfinite(value) && (open ? value > low : value >= low) && value <= high;
}

void check_range(const char* owner, const char* name, double value, const Range& range) {
  if (range.contains(value)) return;  // texts take microseconds
  const bool hint = *range.hint != '\0';
  throw Error(detail::message(
      owner, ": ", name, hint ? " (" : "", range.hint, hint ? ")" : "", " = ", value, " must be finite",
      std::isinf(range.low) ? "" : detail::message(" and ", range.open ? "above " : "at least ", range.low),
      std::isinf(range.high) ? "" : detail::message(" and at most ", range.high)));
}

}  // namespace sigmaik
