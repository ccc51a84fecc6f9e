#pragma once
/// \file status.hpp

#include <cstdint>

namespace sigmaik {

/// What a real-time call did, ordered from the best to the worst. Degraded is not failed: everything below
/// BadInput is finite, inside the stated bound, and may be sent to the arm.
enum class Status : std::int8_t {
  Ok = 0,        ///< done as asked
  Damped = 1,    ///< near a singularity: part of the command is damped, or cannot be done
  Limited = 2,   ///< a joint limit holds part of the command back
  Holding = 3,   ///< no motion: there is no target, or none is allowed
  BadInput = 4,  ///< NaN, infinite, not a rotation, or a wrong size: a stop, as fast as limits allow
};

/// "ok", "damped", "limited", "holding", "bad input".
const char* to_string(Status status) noexcept;

/// The worse of two.
constexpr Status worst(Status a, Status b) noexcept { return a < b ? b : a; }

}  // namespace sigmaik
