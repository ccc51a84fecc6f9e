// What stops the arm of a ServoLoop by itself: a sink that throws, late cycles, a following error. In the loop's
// thread.

#include <doctest/doctest.h>

#include <atomic>
#include <stdexcept>
#include <string>

#include <sigmaik/servo_loop.hpp>

#include "heap.hpp"
#include "loop_rig.hpp"

using namespace test;

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

  std::atomic<bool> measures{true};
  ServoLoop* self = nullptr;
  ServoLoop watched(started(), [&](const LoopSample& s) { CHECK((!measures || self->measure(s.step.q))); },
                    {.measure_timeout = 0.1});
  self = &watched;
  watched.start();
  CHECK(until([&] { return watched.statistics().cycles > 150; }));
  CHECK_FALSE(watched.fault().has_value());
  measures = false;
  CHECK(until([&] { return watched.state() == State::Faulted; }));
  CHECK(watched.fault()->kind == LoopFaultKind::Unmeasured);
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
