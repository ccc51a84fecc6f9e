#include <sigmaik/servo_loop.hpp>

#include <bit>
#include <chrono>
#include <cmath>
#include <cstring>
#include <utility>

#include <pthread.h>
#include <sched.h>

#include <sigmaik/pose.hpp>

#include "finite.hpp"
#include "message.hpp"

namespace sigmaik {
namespace {

using detail::require;

constexpr unsigned kFresh = 4;
constexpr double kLongestStop = 1.0;  // [s]

std::int64_t now() noexcept {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

// [ns] from now on.
std::int64_t deadline(double timeout) {
  require(timeout > 0.0, "timeout = ", timeout, " s must be above 0");
  return now() + static_cast<std::int64_t>(std::min(timeout, 1e9) * 1e9);
}

}  // namespace

ServoLoop::ServoLoop(Servo servo, Sink sink, const ServoLoopOptions& options)
    : dt_(servo.options().dt), dof_(servo.chain().dof()), sink_(std::move(sink)), options_(options) {
  require(servo.q().size() != 0, "the servo has no start: call reset(q) first");
  require(options.history >= 2 && std::has_single_bit(static_cast<unsigned>(options.history)),
          "history = ", options.history, " must be a power of 2, and at least 2");
  require(options.priority >= 0 && options.priority <= 99, "priority = ", options.priority, " must be from 0 to 99");
  samples_.resize(static_cast<std::size_t>(options.history));
  driver_ = new Driver{std::move(servo)};
}

ServoLoop::~ServoLoop() {
  stop();
  sweep();
  delete incoming_.load();
  delete driver_;
}

void ServoLoop::start() {
  const std::lock_guard lock(callers_);
  require(!thread_.joinable(), "the loop runs already");
  stopping_ = false;
  cycles_ = missed_ = unread_ = worst_delay_ = ended_ = 0;
  begun_ = now();
  thread_running_ = true;
  thread_ = std::thread(&ServoLoop::run, this);
  if (options_.priority == 0) return;
  sched_param parameters{};
  parameters.sched_priority = options_.priority;
  const int error = pthread_setschedparam(thread_.native_handle(), SCHED_FIFO, &parameters);
  if (error == 0) return;
  stopping_ = true;
  thread_.join();
  throw Error(
      detail::message("the system refuses SCHED_FIFO with priority ", options_.priority, ": ", std::strerror(error)));
}

void ServoLoop::stop() noexcept {
  const std::lock_guard lock(callers_);
  if (!thread_.joinable()) return;
  stopping_.store(true, std::memory_order_release);
  thread_.join();
}

void ServoLoop::follow(const Pose& target, double timeout) {
  require(is_pose(target.matrix()), "the target is not a pose");
  post({LoopCommand::FollowPose, deadline(timeout), target, Twist::Zero()});
}

void ServoLoop::follow_twist(const Twist& twist, double timeout) {
  require(detail::finite(twist), "the twist has an entry that is not finite");
  post({LoopCommand::FollowTwist, deadline(timeout), Pose::Identity(), twist});
}

void ServoLoop::hold() noexcept { post({}); }

void ServoLoop::post(const Command& command) noexcept {
  const std::lock_guard lock(callers_);
  commands_[writing_] = command;
  writing_ = waiting_.exchange(writing_ | kFresh, std::memory_order_acq_rel) & ~kFresh;
}

const ServoLoop::Command& ServoLoop::latest() noexcept {
  if ((waiting_.load(std::memory_order_relaxed) & kFresh) != 0) {
    reading_ = waiting_.exchange(reading_, std::memory_order_acq_rel) & ~kFresh;
  }
  return commands_[reading_];
}

int ServoLoop::configure(Servo next, bool restart) {
  require(next.chain().dof() == dof_, "the servo has ", next.chain().dof(), " joints, the loop's ", dof_);
  require(next.options().dt == dt_, "the servo has dt = ", next.options().dt, " s, the loop's ", dt_);
  require(!restart || next.q().size() != 0, "the servo has no start: call reset(q) first");
  const std::lock_guard lock(callers_);
  sweep();
  // If the waiting servo never runs, its successor starts where that servo would have started.
  Driver* const driver = new Driver{std::move(next), ++configurations_, restart};
  Driver* const skipped = incoming_.exchange(nullptr, std::memory_order_acq_rel);
  if (skipped != nullptr && skipped->restart && !restart) {
    driver->servo.continue_from(skipped->servo);
    driver->restart = true;
  }
  delete skipped;
  incoming_.store(driver, std::memory_order_release);
  return configurations_;
}

void ServoLoop::take_over() noexcept {
  Driver* const next = incoming_.exchange(nullptr, std::memory_order_acq_rel);
  if (next == nullptr) return;
  if (!next->restart) next->servo.continue_from(driver_->servo);
  Driver* const old = std::exchange(driver_, next);
  old->next = done_.load(std::memory_order_relaxed);
  // Other threads only take the whole list, so the exchange fails at most once for each time they do.
  while (!done_.compare_exchange_weak(old->next, old, std::memory_order_release, std::memory_order_relaxed)) {
  }
}

void ServoLoop::sweep() noexcept {
  for (Driver* driver = done_.exchange(nullptr, std::memory_order_acquire); driver != nullptr;) {
    delete std::exchange(driver, driver->next);
  }
}

LoopSample ServoLoop::cycle(bool stopping) noexcept {
  LoopSample sample;
  Driver* const before = driver_;
  take_over();
  sample.restarted = driver_ != before && driver_->restart;
  sample.configuration = driver_->number;
  Servo& servo = driver_->servo;
  const Command& command = latest();
  sample.time = 1e-9 * static_cast<double>(since_start());
  sample.cycle = cycles_.load(std::memory_order_relaxed);
  sample.command = stopping                                                         ? LoopCommand::Hold
                   : command.kind == LoopCommand::Hold || now() <= command.deadline ? command.kind
                                                                                    : LoopCommand::Stale;
  switch (sample.command) {
    case LoopCommand::FollowPose:
      sample.step = servo.update(command.target);
      sample.target = command.target;
      break;
    case LoopCommand::FollowTwist: sample.step = servo.update_twist(command.twist); break;
    case LoopCommand::Hold:
    case LoopCommand::Stale: sample.step = servo.hold(); break;
  }
  sample.tip = servo.tip();
  if (sample.command != LoopCommand::FollowPose) sample.target = sample.tip;
  return sample;
}

void ServoLoop::run() noexcept {
  using std::chrono::nanoseconds;
  using Clock = std::chrono::steady_clock;
  const auto period = static_cast<std::int64_t>(std::llround(dt_ * 1e9));
  const std::uint64_t mask = samples_.size() - 1;
  std::int64_t due = now();
  double stopped_for = 0.0;
  for (;;) {
    const bool stopping = stopping_.load(std::memory_order_acquire);
    const LoopSample sample = cycle(stopping);
    if (sink_) sink_(sample);

    const std::uint64_t head = head_.load(std::memory_order_relaxed);
    if (head - tail_.load(std::memory_order_acquire) < samples_.size()) {
      samples_[head & mask] = sample;
      head_.store(head + 1, std::memory_order_release);
    } else {
      unread_.fetch_add(1, std::memory_order_relaxed);
    }
    cycles_.fetch_add(1, std::memory_order_relaxed);
    if (stopping) {
      stopped_for += dt_;
      if (sample.step.qdot.isZero(0.0) || stopped_for > kLongestStop) break;
    }

    due += period;
    std::int64_t late = now() - due;
    if (late > period) {
      const std::int64_t missed = late / period;
      missed_.fetch_add(missed, std::memory_order_relaxed);
      due += missed * period;
    } else if (late < 0) {
      std::this_thread::sleep_until(Clock::time_point(std::chrono::duration_cast<Clock::duration>(nanoseconds(due))));
    }
    late = now() - due;
    if (late > worst_delay_.load(std::memory_order_relaxed)) worst_delay_.store(late, std::memory_order_relaxed);
  }
  ended_.store(now(), std::memory_order_relaxed);
  thread_running_.store(false, std::memory_order_release);
}

std::size_t ServoLoop::read(std::span<LoopSample> out) {
  const std::lock_guard lock(callers_);
  const std::uint64_t mask = samples_.size() - 1, tail = tail_.load(std::memory_order_relaxed);
  const std::uint64_t there = head_.load(std::memory_order_acquire) - tail;
  const std::size_t count = std::min<std::size_t>(out.size(), there);
  for (std::size_t i = 0; i < count; ++i) out[i] = samples_[(tail + i) & mask];
  tail_.store(tail + count, std::memory_order_release);
  return count;
}

std::int64_t ServoLoop::since_start() const noexcept { return now() - begun_.load(std::memory_order_relaxed); }

LoopStatistics ServoLoop::statistics() const noexcept {
  LoopStatistics s;
  s.cycles = cycles_.load(std::memory_order_relaxed);
  s.missed = missed_.load(std::memory_order_relaxed);
  s.unread = unread_.load(std::memory_order_relaxed);
  s.worst_delay = 1e-9 * static_cast<double>(worst_delay_.load(std::memory_order_relaxed));
  const std::int64_t begun = begun_.load(), ended = ended_.load();
  s.elapsed = begun == 0 ? 0.0 : 1e-9 * static_cast<double>((ended != 0 ? ended : now()) - begun);
  return s;
}

}  // namespace sigmaik
