#pragma once

#include <limits>

namespace sigmaik::detail {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace sigmaik::detail
