// The states of a ServoLoop: what leads from one to the next, in which state which call is refused, and what stops the
// arm: stop(), halt(), faults. Calls from the sink, from other threads and from a child process.

#include <doctest/doctest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <sys/wait.h>
#include <unistd.h>

#include <sigmaik/error.hpp>
#include <sigmaik/servo_loop.hpp>

#include "arms.hpp"
#include "heap.hpp"

namespace {

using namespace sigmaik;
using State = LoopState;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
const Twist kSlow{{0.02, 0.0, 0.0, 0.0, 0.0, 0.0}};
const Twist kFast{{0.3, 0.2, 0.0, 0.0, 0.3, 0.0}};

void wait(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

// Waits for the condition; machines may be busy.
bool until(const std::function<bool()>& condition) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    wait(5e-4);
  }
  return true;
}

// An arm that has started, and may move.
Servo started(double acceleration = 10.0, const JointVector& qdot = {}, double dt = 1e-3,
              const std::string& name = "franka_panda") {
  const Chain& arm = test::arms().at(name);
  JointLimits limits = arm.limits();
  limits.acceleration = JointVector::Constant(arm.dof(), acceleration);
  Servo servo(arm.with_limits(limits), JParse{}, {.dt = dt});
  JointVector q = JointVector::Constant(arm.dof(), 0.5);
  if (name == "franka_panda") q << 0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785;
  servo.reset(q, qdot);
  return servo;
}

JointVector moving(double speed) {
  JointVector qdot = JointVector::Zero(7);
  qdot[0] = speed;
  return qdot;
}

std::vector<LoopSample> read_all(ServoLoop& loop) {
  std::vector<LoopSample> all(8192);
  all.resize(loop.read(all));
  return all;
}

bool all_at_rest(const std::vector<LoopSample>& samples) {
  for (const LoopSample& s : samples) {
    if (!s.step.qdot.isZero(0.0)) return false;
  }
  return true;
}

bool moves(ServoLoop& loop) {
  const auto samples = read_all(loop);
  return !samples.empty() && !samples.back().step.qdot.isZero(0.0);
}

// The largest |Δq̇| of a cycle.
double hardest(const std::vector<LoopSample>& samples) {
  double worst = 0.0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    worst = std::max(worst, (samples[i].step.qdot - samples[i - 1].step.qdot).cwiseAbs().maxCoeff());
  }
  return worst;
}

bool refused(const std::function<void()>& call) {
  try {
    call();
    return false;
  } catch (const Error&) {
    return true;
  }
}

std::string why(const std::function<void()>& call) {
  try {
    call();
    return "";
  } catch (const Error& error) {
    return error.what();
  }
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

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

constexpr State kStates[] = {State::Disabled, State::Holding, State::Following,
                             State::Stopping, State::Stopped, State::Faulted};
constexpr std::optional<State> kRefused{};

// A row of the table in loop_state.hpp: the state after the call, by the state before.
struct Row {
  const char* name;
  std::function<void(ServoLoop&)> call;
  std::optional<State> after[6];
};

void check(const Row& row) {
  for (int i = 0; i < 6; ++i) {
    Rig rig(kStates[i]);
    const std::string case_name = std::string(row.name) + " while " + to_string(kStates[i]);
    CAPTURE(case_name);
    CHECK(refused([&] { row.call(*rig.loop); }) == !row.after[i].has_value());
    const State expected = row.after[i].value_or(kStates[i]);
    CHECK(until([&] { return rig.loop->state() == expected; }));
    if (kStates[i] != State::Stopping) continue;
    rig.thaw();
    CHECK(until([&] { return rig.loop->state() != State::Stopping; }));
  }
}

}  // namespace

TEST_CASE("the table of calls: starting, stopping, halting") {
  using enum LoopState;
  check({"start", [](ServoLoop& l) { l.start(); }, {Holding, kRefused, kRefused, kRefused, kRefused, kRefused}});
  check({"stop",
         [](ServoLoop& l) { l.stop(l.state() == Stopping ? 0.0 : 20.0); },
         {Disabled, Disabled, Disabled, Stopping, Disabled, Faulted}});
  check({"halt", &ServoLoop::halt, {Disabled, Stopped, Stopped, Stopping, Stopped, Faulted}});
  check({"release", [](ServoLoop& l) { l.release(); }, {Disabled, Holding, Following, kRefused, Holding, kRefused}});
  check({"acknowledge", &ServoLoop::acknowledge, {Disabled, Holding, Following, Stopping, Stopped, Stopped}});
}

TEST_CASE("the table of calls: commands") {
  using enum LoopState;
  const auto follow = [](ServoLoop& l) {
    Pose target = started().tip();
    target.translation().x() += 0.1;
    l.follow(target, 30.0);
  };
  check({"follow", follow, {kRefused, Following, Following, kRefused, kRefused, kRefused}});
  check({"follow_twist",
         [](ServoLoop& l) { l.follow_twist(kSlow, 30.0); },
         {kRefused, Following, Following, kRefused, kRefused, kRefused}});
  check({"hold", &ServoLoop::hold, {Disabled, Holding, Holding, Stopping, Stopped, Faulted}});
}

TEST_CASE("the table of calls: owner, servo, measurement") {
  using enum LoopState;
  check({"take", [](ServoLoop& l) { l.take("me"); }, {Disabled, Holding, Holding, Stopping, Stopped, Faulted}});
  check({"configure",
         [](ServoLoop& l) { l.configure(started()); },
         {Disabled, Holding, Following, Stopping, Stopped, Faulted}});
  check({"measure",
         [](ServoLoop& l) { CHECK(l.measure(started().q()) == l.running()); },
         {Disabled, Holding, Following, Stopping, Stopped, Faulted}});
}

TEST_CASE("states have names") {
  CHECK(std::string(to_string(State::Disabled)) == "disabled");
  CHECK(std::string(to_string(State::Faulted)) == "faulted");
  CHECK(std::string(to_string(LoopFaultKind::FollowingError)) == "following error");
}

TEST_CASE("after stop() and start() nothing moves without a new command") {
  const Servo servo = started();
  Pose target = servo.tip();
  target.translation().y() += 0.2;
  const std::function<void(ServoLoop&)> commands[] = {[&](ServoLoop& l) { l.follow(target, 10.0); },
                                                      [&](ServoLoop& l) { l.follow_twist(kFast, 60.0); }};
  for (const auto& command : commands) {
    ServoLoop loop(servo);
    loop.start();
    command(loop);
    CHECK(until([&] { return moves(loop); }));
    CHECK(loop.stop());
    const auto first = read_all(loop);
    CHECK(first.back().step.qdot.isZero(0.0));
    loop.start();
    wait(0.03);
    CHECK(loop.state() == State::Holding);
    CHECK(loop.stop());
    const auto second = read_all(loop);
    CHECK(second.size() > 2);
    CHECK(all_at_rest(second));
    CHECK(second.back().step.q == first.back().step.q);
    loop.start();
    command(loop);
    CHECK(until([&] { return moves(loop); }));
  }
}

TEST_CASE("stop() returns true when the arm rests, and false where the arm needs longer: the thread goes on stopping") {
  for (const double acceleration : {5.0, 8.0}) {
    ServoLoop loop(started(acceleration, moving(1.0)));  // 0.2 s, 0.125 s to rest
    loop.start();
    CHECK_FALSE(loop.stop(0.02));
    CHECK(loop.running());
    CHECK(loop.state() == State::Stopping);
    CHECK(refused([&] { loop.follow_twist(kSlow, 1.0); }));
    CHECK(refused([&] { loop.start(); }));
    CHECK(loop.stop());
    CHECK_FALSE(loop.running());
    const auto samples = read_all(loop);
    CHECK(samples.back().step.qdot.isZero(0.0));
    CHECK(samples.size() > static_cast<std::size_t>(900.0 / acceleration));
    CHECK(hardest(samples) <= acceleration * 1e-3 * (1.0 + 1e-9));
  }
  // The destructor waits for rest, too, although the last call did not.
  std::atomic<bool> rests{false};
  {
    ServoLoop loop(started(8.0, moving(0.5)), [&](const LoopSample& s) { rests = s.step.qdot.isZero(0.0); });
    loop.start();
    CHECK_FALSE(loop.stop(0.0));
  }
  CHECK(rests);
  CHECK(ServoLoop(started()).stop());  // nothing runs
}

TEST_CASE("the time that stop() waits comes from the arm's limits") {
  // 1.5 rad/s at 0.5 rad/s²: 3 s.
  const double slow = ServoLoop(started(0.5)).stop_time(), quick = ServoLoop(started(10.0)).stop_time();
  CHECK(slow > 3.0);
  CHECK(slow <= 60.1);
  CHECK(quick < slow);
  ServoLoop loop(started(10.0));
  loop.configure(started(0.5));
  CHECK(loop.stop_time() == slow);
  for (const double wrong : {-1.0, 61.0, kInfinity, kNan}) CHECK_THROWS_AS(loop.stop(wrong), Error);
}

TEST_CASE("the sink commands while another thread stops: no deadlock") {
  ServoLoop* self = nullptr;
  const std::function<void()> calls[] = {[&] { self->hold(); },
                                         [&] {
                                           if (self->state() != State::Stopping)
                                             refused([&] { self->follow_twist(kSlow, 1.0); });
                                         },
                                         [&] { self->measure(started().q()); }, [&] { self->configure(started()); }};
  for (const auto& call : calls) {
    for (int trial = 0; trial < 5; ++trial) {
      ServoLoop loop(started(), [&](const LoopSample&) { call(); });
      self = &loop;
      loop.start();
      wait(0.003);
      std::thread other([&] { CHECK(loop.stop()); });
      CHECK(loop.stop());
      other.join();
      CHECK_FALSE(loop.running());
      CHECK(read_all(loop).back().step.qdot.isZero(0.0));
    }
  }
}

TEST_CASE("the sink stops the loop: the thread ends by itself, at rest") {
  ServoLoop* self = nullptr;
  std::atomic<int> cycles{0}, answers{0};
  ServoLoop loop(started(), [&](const LoopSample&) {
    if (++cycles > 20 && !self->stop()) ++answers;
  });
  self = &loop;
  for (int round = 0; round < 2; ++round) {
    cycles = answers = 0;
    loop.start();
    loop.follow_twist(kFast, 10.0);
    CHECK(until([&] { return !loop.running(); }));
    CHECK(loop.state() == State::Disabled);
    CHECK(answers > 0);
    const auto samples = read_all(loop);
    CHECK(samples.back().step.qdot.isZero(0.0));
    CHECK(samples.back().state == State::Stopping);
    CHECK(loop.stop());
  }
}

TEST_CASE("a sink that throws: the arm brakes within its limits, and the fault has the text until it is acknowledged") {
  std::atomic<int> kind{0}, after{0};
  const auto sink = [&](const LoopSample& s) {
    if (kind == 1) throw std::runtime_error("no answer from joint 3\n");
    if (kind == 2) throw 7;
    if (kind == 3) throw std::logic_error(std::string(5000, 'x'));
    if (s.state != State::Following) ++after;
  };
  ServoLoop loop(started(), sink);
  const char* const texts[] = {"the sink threw: no answer from joint 3?", "not a std::exception", "xxx"};
  loop.start();
  for (int round = 1; round <= 3; ++round) {
    loop.follow_twist(kFast, 10.0);
    CHECK(until([&] { return moves(loop); }));
    read_all(loop);
    kind = round;
    CHECK(until([&] { return loop.state() == State::Faulted; }));
    CHECK(loop.statistics().sink_errors > 1);  // of the cycles that brought the arm to rest, too
    const auto samples = read_all(loop);
    CHECK(samples.back().step.qdot.isZero(0.0));
    CHECK(hardest(samples) <= 10.0 * 1e-3 * (1.0 + 1e-9));
    REQUIRE(loop.fault().has_value());
    CHECK(loop.fault()->kind == LoopFaultKind::Sink);
    CHECK(contains(loop.fault()->text, texts[round - 1]));
    CHECK(loop.fault()->text.size() < 220);
    CHECK(loop.fault()->time > 0.0);
    CHECK(contains(why([&] { loop.follow_twist(kSlow, 1.0); }), "acknowledge()"));
    CHECK(contains(why([&] { loop.release(); }), texts[round - 1]));
    loop.acknowledge();  // the sink still throws
    CHECK(until([&] { return loop.state() == State::Faulted; }));
    kind = 0;
    CHECK(until([&] {
      if (loop.state() == State::Faulted) loop.acknowledge();
      return loop.state() == State::Stopped;
    }));
    CHECK_FALSE(loop.fault().has_value());
    CHECK(contains(why([&] { loop.follow_twist(kSlow, 1.0); }), "release()"));
    loop.release();
    CHECK(loop.state() == State::Holding);
  }
}

TEST_CASE("a fault outlives stop(): start() is refused until it is acknowledged, and the arm is halted then") {
  Rig rig(State::Faulted);
  CHECK(rig.loop->stop());
  CHECK(rig.loop->state() == State::Faulted);
  CHECK_FALSE(rig.loop->running());
  CHECK(contains(why([&] { rig.loop->start(); }), "cable"));
  rig.loop->acknowledge();
  CHECK(rig.loop->state() == State::Disabled);
  rig.loop->start();
  CHECK(until([&] { return rig.loop->state() == State::Stopped; }));
  rig.loop->release();
  rig.loop->follow_twist(kSlow, 1.0);
}

TEST_CASE("a halt is latched until release(), whoever commands, and nothing moves before a new command") {
  ServoLoop loop(started());
  loop.start();
  loop.follow_twist(kFast, 30.0);
  CHECK(until([&] { return moves(loop); }));
  loop.halt();
  for (int i = 0; i < 20; ++i) {
    CHECK(contains(why([&] { loop.follow_twist(kFast, 1.0); }), "release()"));
    wait(5e-4);
  }
  CHECK(until([&] { return loop.state() == State::Stopped; }));
  read_all(loop);
  loop.release();
  CHECK(loop.state() == State::Holding);
  wait(0.02);
  CHECK(all_at_rest(read_all(loop)));
  // From the sink, before start(), and again while halted.
  loop.halt();
  loop.halt();
  CHECK(loop.stop());
  loop.halt();
  loop.start();
  CHECK(until([&] { return loop.state() == State::Stopped; }));
  CHECK(refused([&] { loop.follow_twist(kFast, 1.0); }));
  loop.release();
  loop.follow_twist(kFast, 1.0);
}

TEST_CASE("halting and releasing at the same time: the arm is halted, or moves by a new command only") {
  ServoLoop loop(started(), {}, {.history = 8192});
  loop.start();
  std::atomic<bool> done{false};
  std::thread red([&] {
    while (!done) {
      loop.halt();
      wait(1e-3);
    }
  });
  std::thread commander([&] {
    while (!done) refused([&] { loop.follow_twist(kFast, 1.0); });
  });
  for (int i = 0; i < 50; ++i) {
    refused([&] { loop.release(); });
    wait(1e-3);
  }
  done = true;
  red.join();
  commander.join();
  loop.halt();
  CHECK(until([&] { return loop.state() == State::Stopped; }));
  for (const LoopSample& s : read_all(loop)) {
    if (s.state == State::Stopped) CHECK(s.step.qdot.isZero(0.0));
    if (s.state != State::Following) CHECK(s.command != LoopCommand::FollowTwist);
  }
}

TEST_CASE("one commander at a time owns the arm, and everybody may stop it") {
  ServoLoop loop(started());
  loop.start();
  loop.follow_twist(kSlow, 10.0);  // nobody owns the arm
  const LoopToken page = loop.take("page");
  CHECK(loop.owner() == "page");
  CHECK(loop.state() != State::Stopping);
  CHECK(until([&] { return loop.state() == State::Holding; }));  // the command of before is forgotten
  CHECK(contains(why([&] { loop.follow_twist(kSlow, 1.0); }), "'page' owns the arm"));
  CHECK(contains(why([&] { loop.take("script"); }), "'page'"));
  CHECK(refused([&] { loop.configure(started()); }));
  loop.follow_twist(kSlow, 10.0, page);
  loop.configure(started(), false, page);
  const LoopToken script = loop.take("script", true);
  CHECK(script != page);
  CHECK(contains(why([&] { loop.follow_twist(kSlow, 1.0, page); }), "'script' owns the arm"));
  CHECK_FALSE(loop.give_back(page));
  loop.follow_twist(kSlow, 10.0, script);
  loop.hold();
  loop.halt();
  CHECK(until([&] { return loop.state() == State::Stopped; }));
  CHECK(refused([&] { loop.release(); }));
  loop.release(script);
  loop.follow_twist(kSlow, 10.0, script);
  CHECK(loop.give_back(script));
  CHECK(loop.owner().empty());
  CHECK_FALSE(loop.give_back(script));
  CHECK_FALSE(loop.give_back(LoopToken{}));
  CHECK(until([&] { return loop.state() == State::Holding; }));
  CHECK(contains(why([&] { loop.follow_twist(kSlow, 1.0, script); }), "not valid any more"));
  loop.follow_twist(kSlow, 1.0);
  CHECK_THROWS_AS(loop.take(""), Error);
}

TEST_CASE("periods and timeouts have bounds, and the errors name them") {
  for (const double dt : {1e-10, 1e-9, 5e-6, 11.0, 1e9}) {
    CHECK(contains(why([&] { ServoLoop(started(10.0, {}, dt)); }), "1.0000000000000001e-05 s to 10 s"));
  }
  ServoLoop loop(started());
  loop.start();
  for (const double timeout : {0.0, -1.0, 60.1, 1e300, kInfinity, -kInfinity, kNan}) {
    CHECK(contains(why([&] { loop.follow_twist(kSlow, timeout); }), "60 s"));
    CHECK(refused([&] { loop.follow(started().tip(), timeout); }));
  }
  loop.follow_twist(kSlow, 60.0);
  CHECK_THROWS_AS(ServoLoop(started(), {}, {.max_missed = -1}), Error);
  CHECK_THROWS_AS(ServoLoop(started(), {}, {.max_following_error = JointVector::Zero(7)}), Error);
  CHECK_THROWS_AS(ServoLoop(started(), {}, {.max_following_error = JointVector::Ones(6)}), Error);
  CHECK_THROWS_AS(ServoLoop(started(), {}, {.measure_timeout = 0.0}), Error);
}

TEST_CASE("a resting arm stops at once, however long the period is") {
  for (const double dt : {0.5, 5.0, 10.0}) {
    ServoLoop loop(started(10.0, {}, dt));
    for (int round = 0; round < 2; ++round) {
      loop.start();
      CHECK(until([&] { return loop.statistics().cycles > 0; }));
      const auto begin = std::chrono::steady_clock::now();
      if (round == 1) {
        loop.halt();
        CHECK(until([&] { return loop.state() == State::Stopped; }));
      }
      CHECK(loop.stop());
      CHECK(std::chrono::steady_clock::now() - begin < std::chrono::milliseconds(400));
    }
  }
}

TEST_CASE("cycles left out in one go stop the arm, beyond the number that is set") {
  std::atomic<double> nap{0.0};
  const auto sink = [&](const LoopSample&) {
    if (const double time = nap.exchange(0.0); time > 0.0) wait(time);
  };
  for (const bool moving_arm : {true, false}) {
    ServoLoop loop(started(), sink, {.max_missed = 60});
    loop.start();
    if (moving_arm) loop.follow_twist(kFast, 10.0);
    nap = 0.1;
    CHECK(until([&] { return loop.state() == State::Faulted; }));
    CHECK(loop.fault()->kind == LoopFaultKind::Late);
    CHECK(contains(loop.fault()->text, "more than max_missed = 60"));
    CHECK(loop.statistics().missed > 60);
    CHECK(read_all(loop).back().step.qdot.isZero(0.0));
  }
  ServoLoop loop(started(), sink);  // a second, unless said
  loop.start();
  nap = 0.05;
  CHECK(until([&] { return loop.statistics().missed > 20; }));
  CHECK_FALSE(loop.fault().has_value());
}

TEST_CASE("a joint that is measured too far from its command stops the arm, and the fault names the joint") {
  JointVector bound = JointVector::Constant(7, 0.05);
  bound[3] = 0.2;
  for (const int joint : {0, 3, 6}) {
    ServoLoop* self = nullptr;
    std::atomic<double> offset{0.0};
    ServoLoop loop(started(),
                   [&](const LoopSample& s) {
                     JointVector q = s.step.q;
                     q[joint] += offset;
                     CHECK(self->measure(q, s.step.qdot));
                   },
                   {.max_following_error = bound});
    self = &loop;
    loop.start();
    loop.follow_twist(kSlow, 10.0);
    offset = -0.9 * bound[joint];
    wait(0.02);
    CHECK(loop.state() == State::Following);
    offset = 1.1 * bound[joint];
    CHECK(until([&] { return loop.state() == State::Faulted; }));
    const LoopFault fault = *loop.fault();
    CHECK(fault.kind == LoopFaultKind::FollowingError);
    CHECK(fault.joint == joint);
    CHECK(contains(fault.text, test::arms().at("franka_panda").joint_names()[static_cast<std::size_t>(joint)]));
    loop.acknowledge();  // the joint stands there still
    CHECK(until([&] { return loop.state() == State::Faulted; }));
    offset = 0.0;
    CHECK(until([&] {
      if (loop.state() == State::Faulted) loop.acknowledge();
      return loop.state() == State::Stopped;
    }));
  }
}

TEST_CASE("measurements: refused ones, a missing one, and their way to the servo") {
  const JointVector q = started().q();
  ServoLoop loop(started());
  CHECK_FALSE(loop.measure(q));  // nothing runs
  loop.start();
  CHECK(loop.measure(q));
  CHECK(loop.measure(q, JointVector::Zero(7)));
  CHECK_FALSE(loop.measure(JointVector::Zero(6)));
  CHECK_FALSE(loop.measure(q, JointVector::Zero(6)));
  CHECK_FALSE(loop.measure(JointVector::Constant(7, kNan)));
  CHECK_FALSE(loop.measure(q, JointVector::Constant(7, kInfinity)));
  // An arm that hangs behind by 0.01 rad: the servo sees the measured tip, not the one of its own command.
  JointVector behind = q;
  behind[0] -= 0.01;
  CHECK(loop.measure(behind));
  wait(0.01);
  loop.follow(started().tip(), 1.0);
  CHECK(until([&] { return loop.state() == State::Following; }));
  CHECK(until([&] {
    const auto samples = read_all(loop);
    return !samples.empty() && samples.back().step.pose_error.norm() > 1e-5;
  }));

  ServoLoop watched(started(), {}, {.measure_timeout = 0.08});
  watched.start();
  for (int i = 0; i < 15; ++i) {
    CHECK(watched.measure(q));
    wait(0.01);
  }
  CHECK_FALSE(watched.fault().has_value());
  CHECK(until([&] { return watched.state() == State::Faulted; }));
  CHECK(watched.fault()->kind == LoopFaultKind::Unmeasured);
}

TEST_CASE("a refused priority starts nothing") {
  std::atomic<int> cycles{0};
  ServoLoop loop(started(), [&](const LoopSample&) { ++cycles; }, {.priority = 99});
  const std::string text = why([&] { loop.start(); });
  if (text.empty()) {
    MESSAGE("the system grants SCHED_FIFO");
    CHECK(loop.stop());
    return;
  }
  CHECK(contains(text, "priority 99"));
  CHECK(loop.state() == State::Disabled);
  wait(0.02);
  CHECK(cycles == 0);
  CHECK(loop.statistics().cycles == 0);
  CHECK(refused([&] { loop.start(); }));
}

TEST_CASE("in a child process no loop runs, and nothing blocks") {
  auto loop = std::make_unique<ServoLoop>(started());
  loop->start();
  loop->follow_twist(kSlow, 30.0);
  for (int round = 0; round < 2; ++round) {
    const pid_t child = fork();
    REQUIRE(child >= 0);
    if (child == 0) {
      alarm(20);
      bool right = !loop->running() && loop->state() == State::Disabled && !loop->fault().has_value();
      right = right && contains(why([&] { loop->follow_twist(kSlow, 1.0); }), "child");
      right = right && refused([&] { loop->follow(started().tip(), 1.0); }) && refused([&] { loop->start(); });
      right = right && refused([&] { loop->take("child"); }) && refused([&] { loop->configure(started()); });
      right = right && !loop->measure(started().q()) && !loop->stop() && read_all(*loop).empty();
      loop->hold();
      loop->halt();
      loop.reset();
      _exit(right ? 0 : 1);
    }
    int status = -1;
    REQUIRE(waitpid(child, &status, 0) == child);
    CHECK(WIFEXITED(status));
    CHECK(WEXITSTATUS(status) == 0);
  }
  CHECK(loop->running());
  CHECK(until([&] { return loop->state() == State::Following; }));
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("a cycle that is supervised, halted, late or stopping does not touch the heap") {
  ServoLoop* self = nullptr;
  std::atomic<int> calls{0};
  int cycles = 0;
  long last = 0;
  ServoLoop loop(started(),
                 [&](const LoopSample& s) {
                   if (++cycles > 1 && test::heap_calls != last) ++calls;
                   self->measure(s.step.q, s.step.qdot);
                   if (cycles == 30) self->halt();
                   if (cycles == 60) wait(0.02);
                   last = test::heap_calls;
                 },
                 {.max_missed = 5, .max_following_error = JointVector::Ones(7), .measure_timeout = 1.0});
  self = &loop;
  loop.start();
  loop.follow_twist(kFast, 1.0);
  CHECK(until([&] { return loop.state() == State::Faulted; }));
  CHECK(loop.fault()->kind == LoopFaultKind::Late);
  CHECK(loop.stop());
  CHECK(calls == 0);
}
#endif
