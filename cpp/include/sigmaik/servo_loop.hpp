#pragma once
/// \file servo_loop.hpp
/// A servo in a thread of its own, at its own rate, whatever the rest of the program does.
///
///     ServoLoop loop(servo, [&](const LoopSample& s) { robot.command(s.step.q, s.step.qdot); });
///     loop.start();
///     loop.follow(target, 0.25);     // after 0.25 s without a new command the target is stale, and the arm stops
///     loop.read(samples);            // a sample for each cycle, from any other thread
///     loop.halt();                   // stops the arm, until release()
///     if (!loop.stop()) …;           // the arm does not rest yet: the thread goes on stopping it
///
/// Commands go in and samples come out without a lock in the loop. A thread that sends commands may hang: the arm
/// stops when its last command is stale. Late cycles are counted and left out, never made up for by a burst; where too
/// many are late, the arm stops. The states and what leads from one to the next: loop_state.hpp.

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include <sigmaik/layout.hpp>
#include <sigmaik/loop_state.hpp>
#include <sigmaik/servo.hpp>

namespace sigmaik::detail {

// The newest of the values that one thread posts, for one other thread. Neither waits: of three slots one is written,
// one is read, and one changes hands.
template <typename Value>
class Mailbox {
 public:
  void post(const Value& value) noexcept {
    slots_[writing_] = value;
    writing_ = waiting_.exchange(writing_ | kFresh, std::memory_order_acq_rel) & ~kFresh;
  }
  // Whether newest() changes, because something was posted since the last call.
  bool fetch() noexcept {
    if ((waiting_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
    reading_ = waiting_.exchange(reading_, std::memory_order_acq_rel) & ~kFresh;
    return true;
  }
  const Value& newest() const noexcept { return slots_[reading_]; }

 private:
  static constexpr unsigned kFresh = 4;  // a bit of waiting_: nobody has read the slot yet
  std::array<Value, 3> slots_;
  std::atomic<unsigned> waiting_{1};
  unsigned writing_ = 0, reading_ = 2;
};

}  // namespace sigmaik::detail

namespace sigmaik {

/// The command that a cycle followed.
enum class LoopCommand : std::int8_t {
  Hold = 0,  ///< nothing: the arm stops, or rests
  FollowPose = 1,
  FollowTwist = 2,
  Stale = 3,  ///< a command that was not repeated in time: as Hold
};

/// Record of one cycle.
struct LoopSample {
  std::int64_t cycle = 0;                   ///< from 0, of those that ran
  double time = 0.0;                        ///< [s] since start()
  LoopCommand command = LoopCommand::Hold;  ///< which command the cycle followed
  int configuration = 0;                 ///< the number that configure() gave to this cycle's servo; 0: the first servo
  LoopState state = LoopState::Holding;  ///< that this cycle leaves the loop in
  bool restarted = false;                ///< the servo started from its own reset(): see ServoLoop::configure
  Pose target = Pose::Identity();        ///< the pose that is followed, else the tip's pose
  Pose tip = Pose::Identity();           ///< after the step, in base
  ServoStep step;                        ///< the servo's answer
};

/// Counts and times of a loop since its start.
struct LoopStatistics {
  std::int64_t cycles = 0;         ///< cycles done
  std::int64_t missed = 0;         ///< cycles left out, because their time had passed
  std::int64_t unread = 0;         ///< samples lost, because no read() came in time
  std::int64_t sink_errors = 0;    ///< exceptions of the sink
  std::int64_t rough_targets = 0;  ///< poses of follow() whose rotation was made one, see is_rough()
  double worst_delay = 0.0;        ///< [s] from when a cycle was due to its start
  double elapsed = 0.0;            ///< [s] since start(), or from start() to stop()
  /// Cycles per second [1/s].
  double rate() const noexcept { return elapsed > 0.0 ? static_cast<double>(cycles) / elapsed : 0.0; }
};

/// Settings of ServoLoop.
struct ServoLoopOptions {
  int history = 4096;  ///< samples kept for read(), a power of 2
  int priority = 0;    ///< of SCHED_FIFO, 1 to 99; 0 is the ordinary scheduler
  /// ≥ 0, cycles left out in one go, beyond which the loop stops the arm with the fault Late. None: the cycles of one
  /// second, at least 1. Without a real-time scheduler a desktop under load leaves out hundreds of cycles of 1 ms now
  /// and then; a second without a cycle means that the program was halted. A real arm needs a bound from its own
  /// controller: the time for which the controller goes on without a command.
  std::optional<int> max_missed{};
  /// (n,) [rad or m] > 0: a joint that is measured (measure()) farther than this from its command stops the arm with
  /// the fault FollowingError. Empty: no check, because the bound depends on the arm's joint controllers: the lag of a
  /// controller times the speed, and a reserve.
  JointVector max_following_error{};
  /// [s] > 0: after this time without measure(), from start() on, the loop stops the arm with the fault Unmeasured.
  /// None: no check, for arms that are not measured.
  std::optional<double> measure_timeout{};
};

/// All functions may be called from any thread, and from the sink. Of a loop that runs in another process (fork()), all
/// commands are refused, running() is false, and hold(), halt() and stop() do nothing.
class ServoLoop {
 public:
  /// Called in the loop's thread, once a cycle: the cycle is real time only if the sink is. An exception of the sink
  /// stops the arm with the fault Sink; the sink is still called with the cycles that bring the arm to rest.
  using Sink = std::function<void(const LoopSample&)>;

  static constexpr double kShortestPeriod = 1e-5;  ///< [s], the least dt
  static constexpr double kLongestPeriod = 10.0;   ///< [s], the greatest dt
  static constexpr double kLongestTimeout = 60.0;  ///< [s], of a command, and of a stop

  /// \throws Error where the servo has not started, or dt or an option is out of its range
  explicit ServoLoop(Servo servo, Sink sink = {}, const ServoLoopOptions& options = {});
  /// stop(); and where the arm does not rest after stop_time(), the thread ends while the arm moves. Waits for a sink
  /// that does not return. Not to be called from the sink. In a child process of fork() nothing is waited for.
  ~ServoLoop();
  ServoLoop(const ServoLoop&) = delete;
  ServoLoop& operator=(const ServoLoop&) = delete;

  /// Starts the thread. The arm rests until a command comes: commands from before are forgotten.
  /// \throws Error where the loop runs already, a fault is not acknowledged, or the system refuses a thread or the
  ///     priority; then no cycle has run
  void start();
  /// Brings the arm to rest by the fastest stop that its limits allow, and then ends the thread: waits for both, for
  /// stop_time() at most. A call from the sink does not wait.
  /// \return whether the arm rests and no thread runs. False: the thread goes on stopping the arm, and ends by itself
  bool stop() noexcept;
  /// \param timeout [s] in [0, kLongestTimeout], to wait at most
  /// \throws Error where the timeout is out of its range; then nothing is stopped
  bool stop(double timeout);
  /// [s], for which stop() and the destructor wait at most: Servo::settling_time(), which is more than three times the
  /// time of any motion that the limits allow, up to kLongestTimeout, and 2 dt.
  double stop_time() const noexcept { return stop_time_.load(std::memory_order_relaxed); }
  /// Whether the thread runs.
  bool running() const noexcept;
  /// The state that the last cycle and the calls since have left.
  LoopState state() const noexcept;

  /// Stops the arm as fast as its limits allow, and latches: the arm rests until release(), whoever commands. Anyone
  /// may halt. Takes no lock.
  void halt() noexcept;
  /// Whether the latch of halt(), or of a fault, is closed: also while no thread runs.
  bool halted() const noexcept { return (latch_.load(std::memory_order_acquire) & 1u) != 0; }
  /// Opens the latch of halt(), or of a fault that is acknowledged. The arm rests until a new command comes.
  /// \throws Error where the arm does not rest yet, a fault is not acknowledged, somebody halts the arm at the same
  ///     time, or somebody else owns the arm
  void release(LoopToken token = {});
  /// The fault that stopped the arm, until acknowledge().
  std::optional<LoopFault> fault() const;
  /// Forgets the fault. The arm stays halted, until release().
  /// \throws Error where the arm does not rest yet
  void acknowledge();

  /// Makes the caller the arm's owner: until give_back(), follow(), follow_twist(), configure() and release() need the
  /// token. A live command is forgotten. Anyone may stop(), halt() and hold() the arm, and acknowledge() a fault.
  /// \param name of the commander, for errors
  /// \param take_over whether an owner loses the arm
  /// \throws Error where the name is empty, or without `take_over` the arm has an owner
  LoopToken take(const std::string& name, bool take_over = false);
  /// Gives the arm back. The arm stops, and without an owner anyone may command it.
  /// \return false where the token is not the owner's; then nothing changes
  bool give_back(LoopToken token) noexcept;
  /// The owner's name; empty: nobody owns the arm.
  std::string owner() const;

  /// Follows a pose from the next cycle on, for `timeout` seconds.
  /// \param timeout [s] in (0, kLongestTimeout]
  /// \throws Error where the target is not a pose, the timeout is out of its range, the loop does not run, is halted,
  ///     stopping or faulted, or somebody else owns the arm
  void follow(const Pose& target, double timeout, LoopToken token = {});
  /// As follow().
  /// \param twist [v; ω], base axes, at the tip's origin
  void follow_twist(const Twist& twist, double timeout, LoopToken token = {});
  /// Puts a tool on the tip from the next cycle on, without a jump: see Servo::set_tool(). The live command goes on,
  /// and is then the tool's. The tool stays through configure(), until another. Takes no lock in the loop.
  /// \throws Error where the tool is not a pose, or somebody else owns the arm
  void set_tool(const Pose& tool, LoopToken token = {});
  /// Stops the arm as fast as its limits allow, until the next command.
  void hold() noexcept;

  /// Tells the loop where the arm is, as often as the arm is measured, from the sink or from one other thread. The next
  /// cycle compares q with the command (max_following_error), and gives both to Servo::measure. Real time.
  /// \param q (n,) measured positions
  /// \param qdot (n,) measured velocities; empty: unknown
  /// \return false where the measurement is not taken: a size is wrong, an entry is not finite, the loop does not run,
  ///     or another thread is just measuring
  bool measure(const JointRef& q, const JointRef& qdot = JointVector()) noexcept;

  /// Goes on with another servo of the same arm and dt, with another rule or other options. From the next cycle on this
  /// servo takes over the motion (Servo::continue_from), or with `restart` starts from its last reset(). `restart` is
  /// for simulation, and for an arm that rests there already, such as after a following error: any other arm jumps.
  /// \return a number for LoopSample::configuration, one more at each call
  /// \throws Error where joints or dt differ, with `restart` the servo has not started, or somebody else owns the arm
  int configure(Servo next, bool restart = false, LoopToken token = {});

  /// Copies out the oldest samples that nobody has read, and forgets them.
  /// \return the number of samples
  std::size_t read(std::span<LoopSample> out);

  /// Counts and times since the start.
  LoopStatistics statistics() const noexcept;
  /// Control period [s].
  double dt() const noexcept { return dt_; }
  /// Number n of movable joints.
  int dof() const noexcept { return dof_; }

 private:
  struct Command {
    LoopCommand kind = LoopCommand::Hold;
    std::int64_t deadline = 0;  // [ns] of the steady clock
    Pose target = Pose::Identity();
    Twist twist = Twist::Zero();
    Pose tool = Pose::Identity();
    unsigned tools = 0;  // set_tool() was called so often
  };
  struct Measurement {
    JointVector q, qdot;
  };
  struct Driver {
    Servo servo;
    int number = 0;
    bool restart = false;
    Driver* next = nullptr;  // of those that are done
  };
  // What a fault's text is made of, by whoever asks.
  struct Cause {
    double time = 0.0, value = 0.0, bound = 0.0;
    int joint = -1;
    std::array<char, 201> text{};  // of an exception
  };

  // servo_loop.cpp: the loop's thread
  void run() noexcept;
  void supervise() noexcept;
  LoopSample cycle(bool halted, bool ending) noexcept;
  void send(const LoopSample& sample) noexcept;
  void record(const LoopSample& sample) noexcept;
  std::int64_t wait(std::int64_t due, bool resting, unsigned latch) noexcept;
  bool take_over() noexcept;
  void fail(LoopFaultKind kind, const Cause& cause) noexcept;
  std::int64_t since_start() const noexcept;

  void latch() noexcept;

  // servo_loop_calls.cpp: the callers' threads
  bool forked() const noexcept;
  bool rests() const noexcept;
  void refuse_fork() const;
  void refuse_stranger(LoopToken token) const;
  void refuse_motion() const;
  void command(const Command& command, LoopToken token);
  void post(const Command& command) noexcept;
  void make_thread();
  bool end(double timeout) noexcept;
  void join() noexcept;
  LoopFault described(LoopFaultKind kind) const;
  void sweep() noexcept;

  double dt_;
  int dof_;
  int max_missed_;
  std::vector<std::string> joint_names_;
  Sink sink_;
  ServoLoopOptions options_;

  // Neither is taken by the loop, or held while somebody waits for the loop. threads_ comes before callers_.
  std::mutex threads_;          // thread_, and starting and ending it
  mutable std::mutex callers_;  // what follows
  int configurations_ = 0;
  LoopToken owner_;
  std::string owner_name_;
  Command posted_;  // the newest, with the tool

  detail::Mailbox<Command> commands_;
  detail::Mailbox<Measurement> measurements_;
  std::atomic_flag measuring_;
  std::int64_t measured_ = 0;  // [ns] since start(), of the last measurement; the loop's

  Driver* driver_;            // the loop's
  unsigned tools_taken_ = 0;  // the loop's: Command::tools of the tool that the servo has
  std::atomic<Driver*> incoming_{nullptr}, done_{nullptr};

  std::vector<LoopSample> samples_;
  std::atomic<std::uint64_t> head_{0}, tail_{0};

  std::unique_ptr<std::thread> thread_;
  std::atomic<long> process_{0};   // in which the thread runs; 0: there is no thread
  std::atomic<unsigned> runs_{0};  // starts so far
  std::atomic<int> gate_{0};       // of a new thread: 0 wait, 1 run, 2 leave
  std::atomic<bool> thread_running_{false}, ending_{false}, abandoned_{false}, following_{false};
  std::atomic<unsigned> latch_{0};   // odd: halted; another number at each change, and at each halt
  std::atomic<unsigned> rested_{0};  // the latch with which a cycle has last brought the arm to rest
  std::atomic<double> stop_time_{0.0};

  std::atomic<std::int8_t> fault_{0};  // LoopFaultKind; while this is 0, cause_ is the loop's, else the callers'
  Cause cause_;

  std::atomic<std::int64_t> begun_{0}, ended_{0}, cycles_{0}, missed_{0}, unread_{0}, sink_errors_{0},
      rough_targets_{0}, worst_delay_{0};
};

SIGMAIK_SAME_LAYOUT(ServoLoop, ServoLoopOptions, LoopSample, LoopStatistics);

}  // namespace sigmaik
