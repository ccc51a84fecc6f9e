// The calls of a ServoLoop's commanders. No mutex is held here while somebody waits for the loop's thread, whose sink
// may call all of these functions. After fork() a mutex may stay locked for ever: forked() comes before every lock.

#include <sigmaik/servo_loop.hpp>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cstring>
#include <system_error>
#include <utility>

#include <pthread.h>
#include <sched.h>
#include <unistd.h>

#include <sigmaik/pose.hpp>

#include "asked_pose.hpp"
#include "finite.hpp"
#include "loop_thread.hpp"
#include "message.hpp"

namespace sigmaik {
namespace {

using detail::message;
using detail::now;
using detail::require;

// [ns] from now on.
std::int64_t deadline(double timeout) {
  require(timeout > 0.0 && timeout <= ServoLoop::kLongestTimeout, "timeout = ", timeout,
          " s must be above 0, and at most ", ServoLoop::kLongestTimeout,
          " s: an arm without a living commander must stop");
  return now() + static_cast<std::int64_t>(timeout * 1e9);
}

double time_to_stop(const Servo& servo) {
  return std::min(servo.settling_time(), ServoLoop::kLongestTimeout) + 2.0 * servo.options().dt;
}

// The cycles of a second.
int max_missed_of(const ServoLoopOptions& options, double dt) {
  return options.max_missed.value_or(std::max(1, static_cast<int>(1.0 / dt)));
}

void check(const Servo& servo, const ServoLoopOptions& options) {
  const double dt = servo.options().dt;
  require(servo.q().size() != 0, "the servo has no start: call reset(q) first");
  require(dt >= ServoLoop::kShortestPeriod && dt <= ServoLoop::kLongestPeriod, "dt = ", dt, " s must be from ",
          ServoLoop::kShortestPeriod, " s to ", ServoLoop::kLongestPeriod, " s in a loop");
  require(options.history >= 2 && std::has_single_bit(static_cast<unsigned>(options.history)),
          "history = ", options.history, " must be a power of 2, and at least 2");
  require(options.priority >= 0 && options.priority <= 99, "priority = ", options.priority, " must be from 0 to 99");
  require(!options.max_missed || *options.max_missed >= 0, "max_missed = ", options.max_missed.value_or(0),
          " must not be below 0");
  const JointVector& bound = options.max_following_error;
  require(bound.size() == 0 || bound.size() == servo.chain().dof(), "max_following_error has ", bound.size(),
          " entries, the servo ", servo.chain().dof(), " joints");
  for (Eigen::Index i = 0; i < bound.size(); ++i) {
    require(bound[i] > 0.0, "max_following_error[", i, "] = ", bound[i], " must be above 0");
  }
  require(!options.measure_timeout || *options.measure_timeout > 0.0,
          "measure_timeout = ", options.measure_timeout.value_or(0.0), " s must be above 0");
}

}  // namespace

// ---- Life -----------------------------------------------------------------------------------------------------------

ServoLoop::ServoLoop(Servo servo, Sink sink, const ServoLoopOptions& options)
    : dt_(servo.options().dt),
      dof_(servo.chain().dof()),
      joint_names_(servo.chain().joint_names()),
      sink_(std::move(sink)),
      options_(options) {
  check(servo, options);
  max_missed_ = max_missed_of(options, dt_);
  stop_time_ = time_to_stop(servo);
  samples_.resize(static_cast<std::size_t>(options.history));
  driver_ = new Driver{std::move(servo)};
}

ServoLoop::~ServoLoop() {
  if (forked()) {
    (void)thread_.release();  // a thread of the parent: here there is nothing to join, and nothing to detach
  } else if (!stop()) {
    abandoned_.store(true, std::memory_order_release);
    const std::lock_guard lock(threads_);
    join();
  }
  sweep();
  delete incoming_.load();
  delete driver_;
}

void ServoLoop::start() {
  refuse_fork();
  const std::lock_guard threads(threads_);
  require(!thread_running_.load(std::memory_order_acquire), "the loop runs already");
  join();  // of a thread that has ended by itself
  const std::lock_guard lock(callers_);
  const auto kind = static_cast<LoopFaultKind>(fault_.load(std::memory_order_acquire));
  if (kind != LoopFaultKind{})
    throw Error("a fault stopped the arm (" + described(kind).text + "): call acknowledge()");
  post({});
  measurements_.fetch();  // what was measured before
  ending_ = following_ = false;
  cycles_ = missed_ = unread_ = sink_errors_ = rough_targets_ = worst_delay_ = ended_ = 0;
  measured_ = 0;
  rested_ = 0;
  make_thread();
}

// The thread waits at the gate until the system has granted its priority.
void ServoLoop::make_thread() {
  gate_ = 0;
  try {
    thread_ = std::make_unique<std::thread>([this] {
      gate_.wait(0);
      if (gate_ == 1) run();
    });
  } catch (const std::system_error& error) {
    throw Error(message("the system refuses a thread: ", error.what()));
  }
  int error = 0;
  if (options_.priority != 0) {
    sched_param parameters{};
    parameters.sched_priority = options_.priority;
    error = pthread_setschedparam(thread_->native_handle(), SCHED_FIFO, &parameters);
  }
  if (error == 0) {
    process_ = getpid();
    begun_ = now();
    ++runs_;
    thread_running_ = true;
  }
  gate_ = error == 0 ? 1 : 2;
  gate_.notify_one();
  if (error == 0) return;
  join();
  throw Error(message("the system refuses SCHED_FIFO with priority ", options_.priority, ": ", std::strerror(error)));
}

// With threads_ locked, of a thread that ends without anybody's help.
void ServoLoop::join() noexcept {
  if (!thread_) return;
  thread_->join();
  thread_.reset();
  process_ = 0;
}

bool ServoLoop::stop() noexcept { return end(stop_time()); }

bool ServoLoop::stop(double timeout) {
  require(timeout >= 0.0 && timeout <= kLongestTimeout, "timeout = ", timeout, " s must be from 0 to ", kLongestTimeout,
          " s");
  return end(timeout);
}

bool ServoLoop::end(double timeout) noexcept {
  if (forked()) return false;
  const std::int64_t last = now() + static_cast<std::int64_t>(timeout * 1e9);
  unsigned run = 0;
  {
    const std::lock_guard lock(threads_);
    run = runs_;
    if (thread_running_.load(std::memory_order_acquire)) ending_.store(true, std::memory_order_release);
  }
  const auto runs = [&] { return thread_running_.load(std::memory_order_acquire) && runs_ == run; };
  if (detail::loop_of_this_thread == this) return false;
  while (runs()) {
    if (now() >= last) return false;
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
  const std::lock_guard lock(threads_);
  if (!thread_running_.load(std::memory_order_acquire)) join();
  return true;
}

bool ServoLoop::forked() const noexcept {
  const long process = process_.load(std::memory_order_acquire);
  return process != 0 && process != getpid();
}

bool ServoLoop::running() const noexcept { return thread_running_.load(std::memory_order_acquire) && !forked(); }

LoopState ServoLoop::state() const noexcept {
  if (forked()) return LoopState::Disabled;
  const bool faulted = fault_.load(std::memory_order_acquire) != 0;
  if (!thread_running_.load(std::memory_order_acquire)) return faulted ? LoopState::Faulted : LoopState::Disabled;
  if (ending_.load(std::memory_order_acquire)) return LoopState::Stopping;
  if ((latch_.load(std::memory_order_acquire) & 1u) != 0) {
    return !rests() ? LoopState::Stopping : faulted ? LoopState::Faulted : LoopState::Stopped;
  }
  return following_.load(std::memory_order_acquire) ? LoopState::Following : LoopState::Holding;
}

// ---- Halt and faults ------------------------------------------------------------------------------------------------

void ServoLoop::halt() noexcept {
  if (!forked()) latch();
}

// Whether a cycle has seen the latch that is closed now, and left the arm at rest.
bool ServoLoop::rests() const noexcept {
  const unsigned latch = latch_.load(std::memory_order_acquire);
  return (latch & 1u) != 0 && rested_.load(std::memory_order_acquire) == latch;
}

void ServoLoop::release(LoopToken token) {
  refuse_fork();
  const std::lock_guard lock(callers_);
  refuse_stranger(token);
  const auto kind = static_cast<LoopFaultKind>(fault_.load(std::memory_order_acquire));
  if (kind != LoopFaultKind{})
    throw Error("a fault stopped the arm (" + described(kind).text + "): call acknowledge()");
  unsigned latch = latch_.load(std::memory_order_acquire);
  if (thread_running_.load(std::memory_order_acquire)) {
    require(!ending_.load(std::memory_order_acquire), "the loop is stopping");
    require((latch & 1u) == 0 || rested_.load(std::memory_order_acquire) == latch, "the arm does not rest yet");
  }
  if ((latch & 1u) == 0) return;
  post({});
  require(latch_.compare_exchange_strong(latch, latch + 1, std::memory_order_acq_rel), "the arm was halted just now");
}

std::optional<LoopFault> ServoLoop::fault() const {
  if (forked()) return std::nullopt;
  const std::lock_guard lock(callers_);
  const auto kind = static_cast<LoopFaultKind>(fault_.load(std::memory_order_acquire));
  if (kind == LoopFaultKind{}) return std::nullopt;
  return described(kind);
}

void ServoLoop::acknowledge() {
  refuse_fork();
  const std::lock_guard lock(callers_);
  if (fault_.load(std::memory_order_acquire) == 0) return;
  require(!thread_running_.load(std::memory_order_acquire) || rests(), "the arm does not rest yet");
  fault_.store(0, std::memory_order_release);
}

// With callers_ locked.
LoopFault ServoLoop::described(LoopFaultKind kind) const {
  LoopFault fault{kind, "", cause_.time, cause_.joint};
  switch (kind) {
    case LoopFaultKind::Sink: fault.text = message("the sink threw: ", cause_.text.data()); break;
    case LoopFaultKind::Late:
      fault.text = message(cause_.value, " cycles of ", dt_,
                           " s were left out in one go, more than max_missed = ", cause_.bound);
      break;
    case LoopFaultKind::FollowingError:
      fault.text = message("joint '", joint_names_[static_cast<std::size_t>(cause_.joint)], "' was measured ",
                           cause_.value, " from its command, more than max_following_error = ", cause_.bound);
      break;
    case LoopFaultKind::Unmeasured:
      fault.text = message("the arm was not measured for ", cause_.value,
                           " s, more than measure_timeout = ", cause_.bound, " s");
      break;
  }
  return fault;
}

// ---- Commands -------------------------------------------------------------------------------------------------------

void ServoLoop::refuse_fork() const {
  require(!forked(), "the loop runs in process ", process_.load(), ", and not in its child ", getpid(),
          ": make a ServoLoop here");
}

// With callers_ locked.
void ServoLoop::refuse_stranger(LoopToken token) const {
  if (token == owner_) return;
  require(owner_ != LoopToken{}, "the token is not valid any more: call take()");
  throw Error("'" + owner_name_ + "' owns the arm: call take() to take it over");
}

// With callers_ locked.
void ServoLoop::refuse_motion() const {
  const auto kind = static_cast<LoopFaultKind>(fault_.load(std::memory_order_acquire));
  if (kind != LoopFaultKind{}) {
    throw Error("a fault stopped the arm (" + described(kind).text + "): call acknowledge(), then release()");
  }
  require(thread_running_.load(std::memory_order_acquire), "the loop does not run: call start()");
  require(!ending_.load(std::memory_order_acquire), "the loop is stopping");
  require((latch_.load(std::memory_order_acquire) & 1u) == 0, "the arm is halted: call release()");
}

void ServoLoop::command(const Command& command, LoopToken token) {
  refuse_fork();
  const std::lock_guard lock(callers_);
  refuse_stranger(token);
  refuse_motion();
  post(command);
}

// With callers_ locked.
void ServoLoop::post(const Command& command) noexcept {
  const Pose tool = posted_.tool;
  const unsigned tools = posted_.tools;
  posted_ = command;
  posted_.tool = tool;
  posted_.tools = tools;
  commands_.post(posted_);
}

// A tool comes with the command: no cycle follows the next command with the last tool.
void ServoLoop::set_tool(const Pose& tool, LoopToken token) {
  const detail::AskedPose read(tool);
  require(read.valid, "the tool's pose is not a pose");
  refuse_fork();
  const std::lock_guard lock(callers_);
  refuse_stranger(token);
  posted_.tool = read.pose;
  ++posted_.tools;
  commands_.post(posted_);
}

void ServoLoop::follow(const Pose& target, double timeout, LoopToken token) {
  const detail::AskedPose read(target);
  require(read.valid, "the target is not a pose");
  command({LoopCommand::FollowPose, deadline(timeout), read.pose, Twist::Zero()}, token);
  if (read.rough) rough_targets_.fetch_add(1, std::memory_order_relaxed);
}

void ServoLoop::follow_twist(const Twist& twist, double timeout, LoopToken token) {
  require(detail::finite(twist), "the twist has an entry that is not finite");
  command({LoopCommand::FollowTwist, deadline(timeout), Pose::Identity(), twist}, token);
}

void ServoLoop::hold() noexcept {
  if (forked()) return;
  const std::lock_guard lock(callers_);
  post({});
}

LoopToken ServoLoop::take(const std::string& name, bool take_over) {
  static std::atomic<std::uint64_t> tokens{0};
  refuse_fork();
  require(!name.empty(), "the owner of an arm needs a name");
  const std::lock_guard lock(callers_);
  if (!take_over) {
    require(owner_ == LoopToken{}, "'", owner_name_, "' owns the arm: it can be taken over with take_over = true");
  }
  owner_name_ = name;
  owner_ = {++tokens};
  post({});
  return owner_;
}

bool ServoLoop::give_back(LoopToken token) noexcept {
  if (forked()) return false;
  const std::lock_guard lock(callers_);
  if (token == LoopToken{} || token != owner_) return false;
  owner_ = {};
  owner_name_.clear();
  post({});
  return true;
}

std::string ServoLoop::owner() const {
  if (forked()) return {};
  const std::lock_guard lock(callers_);
  return owner_name_;
}

bool ServoLoop::measure(const JointRef& q, const JointRef& qdot) noexcept {
  if (!running() || q.size() != dof_ || (qdot.size() != 0 && qdot.size() != dof_)) return false;
  const Measurement measurement{q, qdot};
  if (!detail::finite(measurement.q) || !detail::finite(measurement.qdot)) return false;
  if (measuring_.test_and_set(std::memory_order_acquire)) return false;
  measurements_.post(measurement);
  measuring_.clear(std::memory_order_release);
  return true;
}

int ServoLoop::configure(Servo next, bool restart, LoopToken token) {
  require(next.chain().dof() == dof_, "the servo has ", next.chain().dof(), " joints, the loop's ", dof_);
  require(next.options().dt == dt_, "the servo has dt = ", next.options().dt, " s, the loop's ", dt_);
  require(!restart || next.q().size() != 0, "the servo has no start: call reset(q) first");
  refuse_fork();
  const std::lock_guard lock(callers_);
  refuse_stranger(token);
  sweep();
  stop_time_ = std::max(stop_time(), time_to_stop(next));
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

void ServoLoop::sweep() noexcept {
  for (Driver* driver = done_.exchange(nullptr, std::memory_order_acquire); driver != nullptr;) {
    delete std::exchange(driver, driver->next);
  }
}

// ---- Records --------------------------------------------------------------------------------------------------------

std::size_t ServoLoop::read(std::span<LoopSample> out) {
  if (forked()) return 0;
  const std::lock_guard lock(callers_);
  const std::uint64_t mask = samples_.size() - 1, tail = tail_.load(std::memory_order_relaxed);
  const std::uint64_t there = head_.load(std::memory_order_acquire) - tail;
  const std::size_t count = std::min<std::size_t>(out.size(), there);
  for (std::size_t i = 0; i < count; ++i) out[i] = samples_[(tail + i) & mask];
  tail_.store(tail + count, std::memory_order_release);
  return count;
}

LoopStatistics ServoLoop::statistics() const noexcept {
  LoopStatistics s;
  s.cycles = cycles_.load(std::memory_order_relaxed);
  s.missed = missed_.load(std::memory_order_relaxed);
  s.rough_targets = rough_targets_.load(std::memory_order_relaxed);
  s.unread = unread_.load(std::memory_order_relaxed);
  s.sink_errors = sink_errors_.load(std::memory_order_relaxed);
  s.worst_delay = 1e-9 * static_cast<double>(worst_delay_.load(std::memory_order_relaxed));
  const std::int64_t begun = begun_.load(), ended = ended_.load();
  s.elapsed = begun == 0 ? 0.0 : 1e-9 * static_cast<double>((ended != 0 ? ended : now()) - begun);
  return s;
}

}  // namespace sigmaik
