#pragma once
// What the loop's thread (servo_loop.cpp) and its callers (servo_loop_calls.cpp) share.

#include <chrono>
#include <cstdint>

namespace sigmaik {
class ServoLoop;
}

namespace sigmaik::detail {

/// [ns] of the steady clock.
inline std::int64_t now() noexcept {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

/// The loop whose thread this is, such as in its sink; null in all other threads.
inline thread_local const ServoLoop* loop_of_this_thread = nullptr;

}  // namespace sigmaik::detail
