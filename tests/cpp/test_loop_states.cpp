// The states of a ServoLoop: what leads from one to the next, and in which state which call is refused. Calls from the
// sink, from other threads and from a child process.

#include <doctest/doctest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "loop_rig.hpp"

namespace {

using namespace test;

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
  check({"give_back",
         [](ServoLoop& l) { CHECK(l.give_back(l.take("me"))); },
         {Disabled, Holding, Holding, Stopping, Stopped, Faulted}});
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
    CHECK(until([&] { return loop.statistics().cycles > 20; }));
    CHECK(loop.state() == State::Holding);
    CHECK(loop.stop());
    const auto second = read_all(loop);
    CHECK(all_at_rest(second));
    CHECK(second.back().step.q == first.back().step.q);
    loop.start();
    command(loop);
    CHECK(until([&] { return moves(loop); }));
  }
}

TEST_CASE("stop() returns true when the arm rests, and false where the arm needs longer: the thread goes on stopping") {
  for (const double acceleration : {8.0, 12.0}) {
    ServoLoop loop(started(acceleration, moving(1.0)));  // 0.125 s, 0.083 s to rest
    loop.start();
    CHECK_FALSE(loop.stop(0.01));
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

TEST_CASE("a refused priority starts nothing") {
  // In a child that may not ask for a priority, even where these tests may.
  const pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    alarm(20);
    const rlimit none{0, 0};
    if (setrlimit(RLIMIT_RTPRIO, &none) != 0 || (geteuid() == 0 && setuid(65534) != 0)) _exit(2);
    std::atomic<int> calls{0};
    ServoLoop loop(started(), [&](const LoopSample&) { ++calls; }, {.priority = 99});
    bool right = contains(why([&] { loop.start(); }), "priority 99") &&
                 contains(why([&] { loop.start(); }), "priority");
    wait(0.02);
    right = right && calls == 0 && loop.statistics().cycles == 0 && !loop.running();
    right = right && loop.state() == State::Disabled && loop.stop();
    _exit(right ? 0 : 1);
  }
  int status = -1;
  REQUIRE(waitpid(child, &status, 0) == child);
  CHECK(WIFEXITED(status));
  CHECK(WEXITSTATUS(status) == 0);
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
