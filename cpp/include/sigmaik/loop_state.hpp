#pragma once
/// \file loop_state.hpp
/// The states of a ServoLoop, the faults that stop it, and the token of the commander that owns its arm.
///
///     Disabled ── start() ──▶ Holding ◀── follow / hold, stale ──▶ Following
///        ▲                       ▲                                    │
///        │                   release()            halt(), stop(), a fault (from Holding, too)
///        │                       │                                    ▼
///        │                    Stopped ◀──── at rest after halt() ── Stopping ── at rest after stop() ──▶ Disabled
///        │                       ▲                                    │
///        │                 acknowledge()                    at rest after a fault
///        │                       │                                    ▼
///        └── acknowledge() ── Faulted ◀───────────────────────────────┘
///            after stop()
///
/// *The latch.* halt() and every fault latch: from the next cycle on the loop commands the fastest stop that the limits
/// allow, then rest, whatever was commanded before. Only release() opens the latch, and only where the arm rests and
/// the fault, if there was one, is acknowledged. The latch outlives stop() and start().
///
/// *No motion without a new command.* start(), release(), take() and give_back() forget every earlier command.
///
/// *Which call does something in which state.* "–": the call is refused with an Error that says why, and nothing
/// changes. ".": the call is accepted, and changes no state.
///
///     call                    Disabled     Holding    Following  Stopping   Stopped    Faulted
///     start()                 Holding (1)  –          –          –          –          –
///     stop()                  .            Stopping   Stopping   .          Disabled   Faulted (2)
///     follow(), follow_twist  –            Following  Following  –          –          –
///     hold()                  .            .          Holding    .          .          .
///     halt()                  . (3)        Stopping   Stopping   .          .          .
///     release()               .            .          .          –          Holding    –
///     acknowledge()           .            .          .          .  (4)     .          Stopped (5)
///     take(), give_back()     .            Holding    Holding    .          .          .
///     configure()             .            .          .          .          .          .
///     measure()               false        .          .          .          .          .
///
/// (1) Where the loop is halted: Stopping, then Stopped. Where there is a fault: refused. (2) The thread ends, and the
/// fault stays. (3) The latch is set, for the next start(). (4) Where a fault stops the arm: refused, until the arm
/// rests. (5) Disabled, where the thread has ended.
///
/// In a child process of fork() the loop of the parent does not run: the state is Disabled, and commands are refused.

#include <cstdint>
#include <string>

#include <sigmaik/layout.hpp>

namespace sigmaik {

/// What a ServoLoop does; see the table of the transitions at the top of loop_state.hpp.
enum class LoopState : std::int8_t {
  Disabled = 0,   ///< no thread runs, and no cycle
  Holding = 1,    ///< there is no command, or a stale one: the arm brakes, or rests, and goes with the next command
  Following = 2,  ///< the arm follows a command
  Stopping = 3,   ///< stop(), halt() or a fault brings the arm to rest, whatever is commanded
  Stopped = 4,    ///< at rest after halt(), until release()
  Faulted = 5,    ///< at rest after a fault, until acknowledge()
};

/// "disabled", "holding", "following", "stopping", "stopped", "faulted".
const char* to_string(LoopState state) noexcept;

/// Why a loop stopped the arm by itself.
enum class LoopFaultKind : std::int8_t {
  Sink = 1,            ///< the sink threw an exception
  Late = 2,            ///< more cycles in one go were left out than ServoLoopOptions::max_missed
  FollowingError = 3,  ///< a measured joint was farther from its command than ServoLoopOptions::max_following_error
  Unmeasured = 4,      ///< no measure() came for ServoLoopOptions::measure_timeout
};

/// "sink", "late", "following error", "unmeasured".
const char* to_string(LoopFaultKind kind) noexcept;

/// The first fault since the last acknowledge().
struct LoopFault {
  LoopFaultKind kind = LoopFaultKind::Sink;  ///< what happened
  std::string text;                          ///< the cause with its figures; of an exception the first 200 characters
  double time = 0.0;                         ///< [s] since start()
  int joint = -1;                            ///< of a following error; else −1
};

/// Names a commander to a loop: ServoLoop::take. A token of its own value is nobody's.
struct LoopToken {
  std::uint64_t number = 0;  ///< unique in the process; 0: nobody
  /// Whether both name the same commander.
  bool operator==(const LoopToken&) const = default;
};

SIGMAIK_SAME_LAYOUT(LoopFault, LoopToken);

}  // namespace sigmaik
