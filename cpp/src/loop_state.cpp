#include <sigmaik/loop_state.hpp>

namespace sigmaik {

const char* to_string(LoopState state) noexcept {
  switch (state) {
    case LoopState::Disabled: return "disabled";
    case LoopState::Holding: return "holding";
    case LoopState::Following: return "following";
    case LoopState::Stopping: return "stopping";
    case LoopState::Stopped: return "stopped";
    case LoopState::Faulted: return "faulted";
  }
  return "unknown";
}

const char* to_string(LoopFaultKind kind) noexcept {
  switch (kind) {
    case LoopFaultKind::Sink: return "sink";
    case LoopFaultKind::Late: return "late";
    case LoopFaultKind::FollowingError: return "following error";
    case LoopFaultKind::Unmeasured: return "unmeasured";
  }
  return "unknown";
}

}  // namespace sigmaik
