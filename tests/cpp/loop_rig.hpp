#pragma once
// Loops for tests: an arm that has started, a sink that throws or waits when it is told to, and short questions.

#include <doctest/doctest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <sigmaik/error.hpp>
#include <sigmaik/servo_loop.hpp>

#include "arms.hpp"

namespace test {

using namespace sigmaik;
using State = LoopState;

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
inline const Twist kSlow{{0.02, 0.0, 0.0, 0.0, 0.0, 0.0}};
inline const Twist kFast{{0.3, 0.2, 0.0, 0.0, 0.3, 0.0}};

inline void wait(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

// Waits for the condition; machines may be busy.
inline bool until(const std::function<bool()>& condition) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    wait(5e-4);
  }
  return true;
}

// An arm that has started, and may move.
inline Servo started(double acceleration = 10.0, const JointVector& qdot = {}, double dt = 1e-3,
                     const std::string& name = "franka_panda") {
  const Chain& arm = arms().at(name);
  JointLimits limits = arm.limits();
  limits.acceleration = JointVector::Constant(arm.dof(), acceleration);
  Servo servo(arm.with_limits(limits), JParse{}, {.dt = dt});
  JointVector q = JointVector::Constant(arm.dof(), 0.5);
  if (name == "franka_panda") q << 0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785;
  servo.reset(q, qdot);
  return servo;
}

inline JointVector moving(double speed) {
  JointVector qdot = JointVector::Zero(7);
  qdot[0] = speed;
  return qdot;
}

inline std::vector<LoopSample> read_all(ServoLoop& loop) {
  std::vector<LoopSample> all(8192);
  all.resize(loop.read(all));
  return all;
}

inline bool all_at_rest(const std::vector<LoopSample>& samples) {
  for (const LoopSample& s : samples) {
    if (!s.step.qdot.isZero(0.0)) return false;
  }
  return true;
}

inline bool moves(ServoLoop& loop) {
  const auto samples = read_all(loop);
  return !samples.empty() && !samples.back().step.qdot.isZero(0.0);
}

// The largest |Δq̇| of a cycle.
inline double hardest(const std::vector<LoopSample>& samples) {
  double worst = 0.0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    worst = std::max(worst, (samples[i].step.qdot - samples[i - 1].step.qdot).cwiseAbs().maxCoeff());
  }
  return worst;
}

inline bool refused(const std::function<void()>& call) {
  try {
    call();
    return false;
  } catch (const Error&) {
    return true;
  }
}

inline std::string why(const std::function<void()>& call) {
  try {
    call();
    return "";
  } catch (const Error& error) {
    return error.what();
  }
}

inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

// A loop whose sink can be told to throw once, or to wait.
class Rig {
 public:
  explicit Rig(State state) : loop(std::make_unique<ServoLoop>(started(), [this](const LoopSample&) { sink(); })) {
    if (state == State::Disabled) return;
    loop->start();
    if (state == State::Following || state == State::Stopping) {
      loop->follow_twist(kSlow, 30.0);
      REQUIRE(until([&] { return loop->state() == State::Following && moves(*loop); }));
    }
    if (state == State::Stopping) {
      freeze_ = true;
      REQUIRE(until([&] { return frozen_.load(); }));
      loop->halt();
    }
    if (state == State::Stopped) loop->halt();
    if (state == State::Faulted) throws_ = true;
    REQUIRE(until([&] { return loop->state() == state; }));
  }
  ~Rig() {
    freeze_ = false;
    loop.reset();
  }
  void thaw() { freeze_ = false; }

  std::unique_ptr<ServoLoop> loop;

 private:
  void sink() {
    if (throws_.exchange(false)) throw std::runtime_error("cable");
    while (freeze_) {
      frozen_ = true;
      wait(2e-4);
    }
  }
  std::atomic<bool> throws_{false}, freeze_{false}, frozen_{false};
};

}  // namespace test
