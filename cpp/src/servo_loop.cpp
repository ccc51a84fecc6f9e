// The loop's thread: no lock, no heap, no exception. (What a sink throws has been on the heap already.)

#include <sigmaik/servo_loop.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <utility>

#include "loop_thread.hpp"

namespace sigmaik {
namespace {

using detail::now;

// [ns] The longest sleep, so that a stop of a resting arm does not wait for a long period's end.
constexpr std::int64_t kNap = 5'000'000;

// ASCII without line breaks, whatever an exception holds: the text goes to terminals and to Python.
template <std::size_t size>
void copy_text(const char* from, std::array<char, size>& to) noexcept {
  std::size_t i = 0;
  for (; i + 1 < size && from[i] != 0; ++i) to[i] = from[i] >= ' ' && from[i] <= '~' ? from[i] : '?';
  to[i] = 0;
}

void sleep_until(std::int64_t time) noexcept {
  using Clock = std::chrono::steady_clock;
  std::this_thread::sleep_until(
      Clock::time_point(std::chrono::duration_cast<Clock::duration>(std::chrono::nanoseconds(time))));
}

}  // namespace

void ServoLoop::run() noexcept {
  detail::loop_of_this_thread = this;
  std::int64_t due = now();
  for (;;) {
    const bool restarted = take_over();
    supervise();
    // The latch before the command: release() forgets the command, and opens the latch then.
    const unsigned latch = latch_.load(std::memory_order_acquire);
    const bool halted = (latch & 1u) != 0, ending = ending_.load(std::memory_order_acquire);
    LoopSample sample = cycle(halted, ending);
    sample.restarted = restarted;
    send(sample);
    record(sample);
    const bool resting = sample.step.qdot.isZero(0.0);
    if (halted && resting) rested_.store(latch, std::memory_order_release);
    following_.store(sample.state == LoopState::Following, std::memory_order_release);
    if ((ending && resting) || abandoned_.load(std::memory_order_acquire)) break;
    due = wait(due, resting, latch);
  }
  ended_.store(now(), std::memory_order_relaxed);
  thread_running_.store(false, std::memory_order_release);
}

bool ServoLoop::take_over() noexcept {
  Driver* const next = incoming_.exchange(nullptr, std::memory_order_acq_rel);
  if (next == nullptr) return false;
  if (!next->restart) next->servo.continue_from(driver_->servo);
  if (next->restart) tools_taken_ = 0;  // the loop's tool comes back with the cycle
  Driver* const old = std::exchange(driver_, next);
  old->next = done_.load(std::memory_order_relaxed);
  // Other threads only take the whole list, so the exchange fails at most once for each time they do.
  while (!done_.compare_exchange_weak(old->next, old, std::memory_order_release, std::memory_order_relaxed)) {
  }
  return next->restart;
}

void ServoLoop::supervise() noexcept {
  Servo& servo = driver_->servo;
  const std::int64_t time = since_start();
  if (measurements_.fetch()) {
    const Measurement& measurement = measurements_.newest();
    const JointVector& bound = options_.max_following_error;
    for (Eigen::Index i = 0; i < bound.size(); ++i) {
      const double error = std::abs(measurement.q[i] - servo.q()[i]);
      if (error > bound[i]) {
        fail(LoopFaultKind::FollowingError, {.value = error, .bound = bound[i], .joint = static_cast<int>(i)});
      }
    }
    servo.measure(measurement.q, measurement.qdot);
    measured_ = time;
  }
  if (!options_.measure_timeout) return;
  const double age = 1e-9 * static_cast<double>(time - measured_);
  if (age > *options_.measure_timeout) {
    fail(LoopFaultKind::Unmeasured, {.value = age, .bound = *options_.measure_timeout});
  }
}

LoopSample ServoLoop::cycle(bool halted, bool ending) noexcept {
  LoopSample sample;
  Servo& servo = driver_->servo;
  commands_.fetch();
  const Command& command = commands_.newest();
  if (command.tools != tools_taken_) {
    servo.set_tool(command.tool);
    tools_taken_ = command.tools;
  }
  sample.configuration = driver_->number;
  sample.time = 1e-9 * static_cast<double>(since_start());
  sample.cycle = cycles_.load(std::memory_order_relaxed);
  sample.command = halted || ending                                                 ? LoopCommand::Hold
                   : command.kind == LoopCommand::Hold || now() <= command.deadline ? command.kind
                                                                                    : LoopCommand::Stale;
  sample.state = LoopState::Following;
  switch (sample.command) {
    case LoopCommand::FollowPose:
      sample.step = servo.update(command.target);
      sample.target = command.target;
      break;
    case LoopCommand::FollowTwist: sample.step = servo.update_twist(command.twist); break;
    case LoopCommand::Hold:
    case LoopCommand::Stale:
      sample.step = servo.hold();
      sample.state = LoopState::Holding;
      break;
  }
  sample.tip = servo.tip();
  if (sample.command != LoopCommand::FollowPose) sample.target = sample.tip;
  if (ending || (halted && !sample.step.qdot.isZero(0.0))) {
    sample.state = LoopState::Stopping;
  } else if (halted) {
    sample.state = fault_.load(std::memory_order_relaxed) != 0 ? LoopState::Faulted : LoopState::Stopped;
  }
  return sample;
}

void ServoLoop::send(const LoopSample& sample) noexcept {
  if (!sink_) return;
  Cause cause;
  try {
    sink_(sample);
    return;
  } catch (const std::exception& error) {
    copy_text(error.what(), cause.text);
  } catch (...) {
    copy_text("an exception that is not a std::exception", cause.text);
  }
  sink_errors_.fetch_add(1, std::memory_order_relaxed);
  fail(LoopFaultKind::Sink, cause);
}

void ServoLoop::record(const LoopSample& sample) noexcept {
  const std::uint64_t mask = samples_.size() - 1, head = head_.load(std::memory_order_relaxed);
  if (head - tail_.load(std::memory_order_acquire) < samples_.size()) {
    samples_[head & mask] = sample;
    head_.store(head + 1, std::memory_order_release);
  } else {
    unread_.fetch_add(1, std::memory_order_relaxed);
  }
  cycles_.fetch_add(1, std::memory_order_relaxed);
}

// Returns when the next cycle is due, at that time. A cycle that stops a resting arm is due at once.
std::int64_t ServoLoop::wait(std::int64_t due, bool resting, unsigned latch) noexcept {
  const auto period = static_cast<std::int64_t>(std::llround(dt_ * 1e9));
  due += period;
  std::int64_t late = now() - due;
  if (late > period) {
    const std::int64_t missed = late / period;
    missed_.fetch_add(missed, std::memory_order_relaxed);
    due += missed * period;
    if (missed > max_missed_) {
      fail(LoopFaultKind::Late, {.value = static_cast<double>(missed), .bound = static_cast<double>(max_missed_)});
    }
  }
  for (std::int64_t time = now(); time < due; time = now()) {
    sleep_until(std::min(due, time + kNap));
    const unsigned newest = latch_.load(std::memory_order_acquire);
    const bool stops = ending_.load(std::memory_order_acquire) || (newest != latch && (newest & 1u) != 0);
    if ((resting && stops) || abandoned_.load(std::memory_order_acquire)) due = std::min(due, now());
  }
  late = now() - due;
  if (late > worst_delay_.load(std::memory_order_relaxed)) worst_delay_.store(late, std::memory_order_relaxed);
  return due;
}

// The first fault stays until it is acknowledged.
void ServoLoop::fail(LoopFaultKind kind, const Cause& cause) noexcept {
  if (fault_.load(std::memory_order_acquire) != 0) return;
  cause_ = cause;
  cause_.time = 1e-9 * static_cast<double>(since_start());
  fault_.store(static_cast<std::int8_t>(kind), std::memory_order_release);
  latch();
}

// A closed latch gets another number, so that a release() at the same time fails.
void ServoLoop::latch() noexcept {
  unsigned before = latch_.load(std::memory_order_relaxed);
  // Others change the latch by a person's calls, so the exchange fails a few times at most.
  while (!latch_.compare_exchange_weak(before, (before + 1) | 1u, std::memory_order_acq_rel)) {
  }
}

std::int64_t ServoLoop::since_start() const noexcept { return now() - begun_.load(std::memory_order_relaxed); }

}  // namespace sigmaik
