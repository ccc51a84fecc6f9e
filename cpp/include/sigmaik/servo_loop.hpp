#pragma once
/// \file servo_loop.hpp
/// A servo in a thread of its own, at its own rate, whatever the rest of the program does.
///
///     ServoLoop loop(servo, [&](const LoopSample& s) { robot.command(s.step.q, s.step.qdot); });
///     loop.start();
///     loop.follow(target, 0.25);     // after 0.25 s without a new command the target is stale, and the arm stops
///     loop.read(samples);            // a sample for each cycle, from any other thread
///
/// Commands go in and samples come out without a lock in the loop. A thread that sends commands may hang: the arm
/// stops when its last command is stale. Late cycles are counted and left out, never made up for by a burst.

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

#include <sigmaik/layout.hpp>
#include <sigmaik/servo.hpp>

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
  int configuration = 0;           ///< the number that configure() gave to this cycle's servo; 0: the first servo
  bool restarted = false;          ///< the servo started from its own reset(): see ServoLoop::configure
  Pose target = Pose::Identity();  ///< the pose that is followed, else the tip's pose
  Pose tip = Pose::Identity();     ///< after the step, in base
  ServoStep step;                  ///< the servo's answer
};

/// Counts and times of a loop since its start.
struct LoopStatistics {
  std::int64_t cycles = 0;   ///< cycles done
  std::int64_t missed = 0;   ///< cycles left out, because their time had passed
  std::int64_t unread = 0;   ///< samples lost, because no read() came in time
  double worst_delay = 0.0;  ///< [s] from when a cycle was due to its start
  double elapsed = 0.0;      ///< [s] since start(), or from start() to stop()
  /// Cycles per second [1/s].
  double rate() const noexcept { return elapsed > 0.0 ? static_cast<double>(cycles) / elapsed : 0.0; }
};

/// Settings of ServoLoop.
struct ServoLoopOptions {
  int history = 4096;  ///< samples kept for read(), a power of 2
  int priority = 0;    ///< of SCHED_FIFO, 1 to 99; 0 is the ordinary scheduler
};

/// All functions may be called from any thread.
class ServoLoop {
 public:
  /// Called in the loop's thread, once a cycle: the cycle is real time only if the sink is. A sink must not throw.
  using Sink = std::function<void(const LoopSample&)>;

  /// \throws Error where the servo has not started, or an option is out of its range
  explicit ServoLoop(Servo servo, Sink sink = {}, const ServoLoopOptions& options = {});
  ~ServoLoop();  ///< stop()
  ServoLoop(const ServoLoop&) = delete;
  ServoLoop& operator=(const ServoLoop&) = delete;

  /// \throws Error where the loop runs already, or the system refuses the priority
  void start();
  /// Brings the arm to rest, in a second at most, and ends the thread.
  void stop() noexcept;
  /// Whether the thread runs.
  bool running() const noexcept { return thread_running_.load(std::memory_order_acquire); }

  /// Follows a pose from the next cycle on, for `timeout` seconds.
  /// \throws Error where the target is not a pose, or the timeout not above 0
  void follow(const Pose& target, double timeout);
  /// \param twist [v; ω], base axes, at the tip's origin
  void follow_twist(const Twist& twist, double timeout);
  /// Stops the arm as fast as its limits allow, until the next command.
  void hold() noexcept;

  /// Goes on with another servo of the same arm and dt, with another rule or other options. From the next cycle on this
  /// servo takes over the motion (Servo::continue_from), or with `restart` starts from its last reset(). `restart` is
  /// for simulation only: a real arm would jump.
  /// \return a number for LoopSample::configuration, one more at each call
  /// \throws Error where joints or dt differ, or with `restart` the servo has not started
  int configure(Servo next, bool restart = false);

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
  };
  struct Driver {
    Servo servo;
    int number = 0;
    bool restart = false;
    Driver* next = nullptr;  // of those that are done
  };

  void post(const Command& command) noexcept;
  const Command& latest() noexcept;
  void run() noexcept;
  LoopSample cycle(bool stopping) noexcept;
  void take_over() noexcept;
  void sweep() noexcept;
  std::int64_t since_start() const noexcept;

  double dt_;
  int dof_;
  Sink sink_;
  ServoLoopOptions options_;
  std::mutex callers_;  // never taken by the loop
  int configurations_ = 0;

  // Three commands: one is written, one is read, one waits. Bit 2 of the waiting one's number: nobody has read it yet.
  std::array<Command, 3> commands_;
  std::atomic<unsigned> waiting_{1};
  unsigned writing_ = 0, reading_ = 2;

  Driver* driver_;  // the loop's
  std::atomic<Driver*> incoming_{nullptr}, done_{nullptr};

  std::vector<LoopSample> samples_;
  std::atomic<std::uint64_t> head_{0}, tail_{0};

  std::thread thread_;
  std::atomic<bool> stopping_{false}, thread_running_{false};
  std::atomic<std::int64_t> begun_{0}, ended_{0}, cycles_{0}, missed_{0}, unread_{0}, worst_delay_{0};
};

SIGMAIK_SAME_LAYOUT(ServoLoop, ServoLoopOptions, LoopSample, LoopStatistics);

}  // namespace sigmaik
