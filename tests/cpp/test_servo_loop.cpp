// A servo in its own thread: commands from other threads, stale commands, changes of rule and options during the
// motion, and the samples that are read.

#include <doctest/doctest.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <thread>
#include <vector>

#include <sigmaik/error.hpp>
#include <sigmaik/servo_loop.hpp>

#include "arms.hpp"
#include "heap.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::Random;

const Chain& panda() { return test::arms().at("franka_panda"); }

JointVector home() {
  JointVector q(7);
  q << 0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785;
  return q;
}

Servo started(ServoOptions options = {}, Method method = JParse{}) {
  Servo servo(panda(), method, options);
  servo.reset(home());
  return servo;
}

Pose moved(const Servo& servo, double x, double y, double z) {
  Pose pose = servo.tip();
  pose.translation() += Eigen::Vector3d(x, y, z);
  return pose;
}

void wait(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

std::vector<LoopSample> read_all(ServoLoop& loop) {
  std::vector<LoopSample> all(8192);
  all.resize(loop.read(all));
  return all;
}

// The largest |Δq̇| of a cycle beyond what the acceleration limits allow, with the start at rest.
double beyond_acceleration(const std::vector<LoopSample>& samples, double dt) {
  JointVector last = JointVector::Zero(7);
  double worst = -std::numeric_limits<double>::infinity();
  for (const LoopSample& s : samples) {
    worst = std::max(worst, ((s.step.qdot - last).cwiseAbs() - dt * panda().limits().acceleration).maxCoeff());
    last = s.step.qdot;
  }
  return worst;
}

}  // namespace

TEST_CASE("another servo takes over in the midst of the motion, as if it had always been there") {
  Random random(1);
  // With the same rule and options and no fade, two servos act as one servo, except for the warm start.
  for (int trial = 0; trial < 50; ++trial) {
    ServoOptions options{.soft_start = 0.0, .posture_gain = 1.0};
    Servo one = started(options), two = started(options), next(panda(), JParse{}, options);
    for (int k = 0; k < 400; ++k) {
      const Twist twist = 0.5 * (k % 100 < 50 ? 1.0 : -1.0) * Twist::Ones();
      Servo& other = k < 200 ? two : next;
      if (k == 200) next.continue_from(two);
      const ServoStep a = one.update_twist(twist), b = other.update_twist(twist);
      CHECK((a.q - b.q).cwiseAbs().maxCoeff() < 1e-12);
    }
  }
  // Random changes of everything, on random limits: no limit is broken by the change.
  for (int trial = 0; trial < 300; ++trial) {
    JointLimits limits = panda().limits();
    const bool with_jerk = random.chance(0.5);
    if (with_jerk) limits.jerk = 200.0 * limits.acceleration;
    const Chain chain = panda().with_limits(limits);
    const auto make = [&] {
      ServoOptions options;
      options.soft_start = random.chance(0.5) ? 0.1 : 0.0;
      options.on_limit = random.chance(0.5) ? OnLimit::Scale : OnLimit::Redistribute;
      options.gain_linear = random.uniform(1.0, 20.0);
      options.task.mask[static_cast<std::size_t>(random.integer(0, 5))] = random.chance(0.5);
      const Method methods[] = {JParse{}, DampedLeastSquares{}, PseudoInverse{}, JacobianSafety{}};
      return Servo(chain, methods[random.integer(0, 3)], options);
    };
    Servo servo = make();
    servo.reset(home());
    JointVector last = JointVector::Zero(7), before = last;
    for (int k = 0; k < 300; ++k) {
      if (k % 37 == 36) {
        Servo next = make();
        next.continue_from(servo);
        servo = next;
      }
      const ServoStep step = random.chance(0.1) ? servo.hold() : servo.update_twist(random.vector(6));
      const JointVector a = (step.qdot - last) / 1e-3;
      CHECK((a.cwiseAbs() - limits.acceleration * (1.0 + 1e-6)).maxCoeff() <= 0.0);
      CHECK((step.qdot.cwiseAbs() - limits.velocity * (1.0 + 1e-9)).maxCoeff() <= 0.0);
      if (with_jerk && k > 0) {
        CHECK(((a - before).cwiseAbs() / 1e-3 - limits.jerk * (1.0 + 1e-5)).maxCoeff() <= 0.0);
      }
      CHECK((step.q - limits.upper).maxCoeff() <= 0.0);
      CHECK((limits.lower - step.q).maxCoeff() <= 0.0);
      last = step.qdot;
      before = a;
    }
  }
}

TEST_CASE("a change of rule at a singularity is faded in, with no velocity or acceleration limit to help") {
  const Chain& chain = panda();
  JointVector stretched(7);
  stretched << 0.0, 0.3, 0.0, -0.08, 0.0, 1.6, 0.8;
  const Twist out{{0.3, 0.0, 0.3, 0.0, 0.0, 0.0}};
  const LimitOptions unlimited{.velocity = false, .acceleration = false};
  const auto jump = [&](bool fade) {
    Servo servo(chain, JParse{}, {.limits = unlimited});
    servo.reset(stretched);
    for (int k = 0; k < 20; ++k) servo.update_twist(out);
    Servo next(chain, PseudoInverse{}, {.soft_start = fade ? 0.1 : 0.0, .limits = unlimited});
    next.continue_from(servo);
    const JointVector last = servo.qdot();
    return (next.update_twist(out).qdot - last).cwiseAbs().maxCoeff();
  };
  CHECK(jump(false) > 0.2);
  CHECK(jump(true) < 0.05 * jump(false));
}

TEST_CASE("taking over: refusals") {
  Servo servo = started(), other(test::arms().at("ur10"), JParse{}), slower(panda(), JParse{}, {.dt = 2e-3}),
        fresh(panda(), JParse{});
  CHECK_THROWS_AS(other.continue_from(servo), Error);
  CHECK_THROWS_AS(slower.continue_from(servo), Error);
  fresh.continue_from(Servo(panda(), JParse{}));  // nothing to take over
  CHECK(fresh.q().size() == 0);
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("taking over and holding do not touch the heap") {
  Servo servo = started(), next(panda(), DampedLeastSquares{});
  servo.update_twist(Twist::Ones());
  const test::HeapWatch watch;
  next.continue_from(servo);
  next.hold();
  CHECK(watch.calls() == 0);
}
#endif

TEST_CASE("a pose is followed, at the rate, and every cycle can be read") {
  Servo servo = started();
  const Pose target = moved(servo, 0.0, 0.1, 0.05);
  long sent = 0;
  ServoLoop loop(servo, [&](const LoopSample&) { ++sent; });
  CHECK_FALSE(loop.running());
  loop.start();
  CHECK(loop.running());
  CHECK_THROWS_AS(loop.start(), Error);
  loop.follow(target, 60.0);
  std::vector<LoopSample> samples;
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);  // machines may be busy
  while (samples.empty() || (samples.back().tip.translation() - target.translation()).norm() > 1e-3) {
    REQUIRE(std::chrono::steady_clock::now() < deadline);
    wait(0.05);
    const auto more = read_all(loop);
    samples.insert(samples.end(), more.begin(), more.end());
  }
  loop.stop();
  CHECK_FALSE(loop.running());
  const auto rest = read_all(loop);
  samples.insert(samples.end(), rest.begin(), rest.end());

  const LoopStatistics s = loop.statistics();
  CHECK(s.cycles == static_cast<std::int64_t>(samples.size()) + s.unread);
  CHECK(sent == s.cycles);
  CHECK(s.elapsed >= 1e-3 * static_cast<double>(s.cycles - 1));  // never faster than asked
  CHECK(static_cast<double>(s.cycles + s.missed) == doctest::Approx(s.elapsed / 1e-3).epsilon(0.05));
  CHECK(samples.back().step.qdot.isZero(0.0));
  for (std::size_t i = 1; i < samples.size(); ++i) {
    if (s.unread == 0) CHECK(samples[i].cycle == samples[i - 1].cycle + 1);
    CHECK(samples[i].time > samples[i - 1].time);
  }
  if (s.unread == 0) CHECK(beyond_acceleration(samples, 1e-3) < 1e-12);
}

TEST_CASE("a command that is not repeated goes stale, and the arm stops within its limits") {
  ServoLoop loop(started());
  loop.start();
  loop.follow_twist(Twist{{0.1, 0.0, 0.0, 0.0, 0.0, 0.0}}, 0.1);
  wait(0.6);
  loop.stop();
  const auto samples = read_all(loop);
  double moved_until = 0.0, told_from = 1e9, told_until = 0.0;
  bool stale = false;
  for (const LoopSample& s : samples) {
    if (s.command == LoopCommand::FollowTwist) {
      told_from = std::min(told_from, s.time);
      told_until = s.time;
    }
    if (!s.step.qdot.isZero(0.0)) moved_until = s.time;
    if (s.command == LoopCommand::Stale) {
      stale = true;
      CHECK(s.step.status == Status::Holding);
    }
  }
  CHECK(stale);
  CHECK(told_until > 0.0);
  CHECK(told_until - told_from < 0.11);
  CHECK(moved_until >= told_until);
  CHECK(moved_until < told_until + 0.5);
  CHECK(beyond_acceleration(samples, 1e-3) < 1e-12);
}

TEST_CASE("rule and options change under way, again and again, from more than one thread") {
  ServoLoop loop(started(), {}, {.history = 8192});
  loop.start();
  loop.follow_twist(Twist{{0.1, 0.1, 0.0, 0.0, 0.3, 0.0}}, 60.0);
  const auto change = [&](unsigned seed) {
    Random random(seed);
    const Method methods[] = {JParse{}, DampedLeastSquares{}, JacobianSafety{}, PseudoInverse{}};
    for (int i = 0; i < 200; ++i) {
      loop.configure(Servo(panda(), methods[random.integer(0, 3)], {.gain_linear = random.uniform(1.0, 9.0)}));
      loop.follow_twist(0.1 * random.vector(6), 60.0);
      if (random.chance(0.2)) wait(2e-3);
    }
  };
  std::thread other(change, 1u);
  change(2u);
  other.join();
  loop.hold();
  wait(0.05);
  loop.stop();
  const auto samples = read_all(loop);
  REQUIRE(loop.statistics().unread == 0);
  CHECK(samples.size() > 10);
  CHECK(beyond_acceleration(samples, 1e-3) < 1e-12);
}

TEST_CASE("restarting puts the arm elsewhere, also through a change that follows at once") {
  ServoLoop loop(started());
  loop.start();
  Servo elsewhere(panda(), JParse{});
  JointVector q = home();
  q[0] = 1.0;
  elsewhere.reset(q);
  CHECK(loop.configure(elsewhere, true) == 1);
  CHECK(loop.configure(Servo(panda(), DampedLeastSquares{})) == 2);
  wait(0.05);
  loop.stop();
  const auto samples = read_all(loop);
  int restarts = 0;
  for (const LoopSample& s : samples) restarts += s.restarted ? 1 : 0;
  CHECK(restarts == 1);
  CHECK(samples.back().step.q == q);
  CHECK(samples.back().configuration == 2);
}

TEST_CASE("nobody reads: samples are counted, the loop goes on") {
  ServoLoop loop(started(), {}, {.history = 16});
  loop.start();
  wait(0.1);
  loop.stop();
  CHECK(read_all(loop).size() == 16);
  CHECK(loop.statistics().unread == loop.statistics().cycles - 16);
}

TEST_CASE("wrong input of a loop is refused") {
  CHECK_THROWS_AS(ServoLoop(Servo(panda(), JParse{})), Error);
  CHECK_THROWS_AS(ServoLoop(started(), {}, {.history = 1000}), Error);
  CHECK_THROWS_AS(ServoLoop(started(), {}, {.priority = 100}), Error);
  ServoLoop loop(started());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(loop.follow_twist(Twist::Constant(nan), 1.0), Error);
  CHECK_THROWS_AS(loop.follow_twist(Twist::Zero(), 0.0), Error);
  CHECK_THROWS_AS(loop.follow_twist(Twist::Zero(), nan), Error);
  Pose sheared = Pose::Identity();
  sheared.linear()(0, 1) = 0.1;
  CHECK_THROWS_AS(loop.follow(sheared, 1.0), Error);
  CHECK_THROWS_AS(loop.configure(Servo(test::arms().at("ur10"), JParse{})), Error);
  CHECK_THROWS_AS(loop.configure(Servo(panda(), JParse{}, {.dt = 2e-3})), Error);
  CHECK_THROWS_AS(loop.configure(Servo(panda(), JParse{}), true), Error);
}
