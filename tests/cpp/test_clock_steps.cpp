// Clocks that step, forwards and back, while a TargetStream follows samples: the target holds still at once, and tracks
// again within the timeout.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <sigmaik/target_stream.hpp>

#include "numbers.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::kNan;
using test::Random;

constexpr StreamMode kModes[] = {StreamMode::Hold, StreamMode::Interpolate, StreamMode::Predict};
constexpr double kCycle = 1e-3;

Pose sine(double time) {
  Pose pose = Pose::Identity();
  pose.translation()[0] = 0.1 * std::sin(2.0 * std::numbers::pi * time);
  return pose;
}

// A loop of 1 kHz and a sensor, whose clocks differ from the true time by `clock` and `stamps`.
struct Rig {
  explicit Rig(StreamMode mode, double samples_per_second = 50.0) : every(1.0 / samples_per_second) {
    TargetStreamOptions options;
    options.mode = mode;
    stream = TargetStream(options);
  }

  Target cycle() {
    now += kCycle;
    if (now >= next) {
      last = stream.push(now - 0.01 + stamps, sine(now - 0.01));
      next += every;
    }
    const Target before = target;
    target = stream.at(now + clock);
    const double way = (target.pose.translation() - before.pose.translation()).norm();
    const double elapsed = target.status == StreamStatus::Stale ? kCycle
                                                                : std::max(kCycle, kCycle + clock - last_clock);
    last_clock = clock;
    if (before.status < StreamStatus::Stale) fastest = std::max(fastest, way / elapsed);
    least_age = std::min(least_age, target.age);
    return target;
  }

  void run(double seconds) {
    for (const double end = now + seconds; now < end;) cycle();
  }

  // [s] until the stream tracks again; the sum over this time of what the twist would move a tool [m].
  double back() {
    const double begin = now;
    while (now < begin + 20.0 && cycle().status != StreamStatus::Tracking) fed += kCycle * target.twist.norm();
    return now - begin;
  }

  TargetStream stream;
  Target target;
  SampleStatus last = SampleStatus::Accepted;
  double every, now = 100.0, next = 100.0, clock = 0.0, stamps = 0.0, last_clock = 0.0, fastest = 0.0, least_age = 0.0,
                fed = 0.0;
};

// The tip is where the samples are, but for the delay and the smoothing of the mode.
void check_tracking(Rig& rig) {
  rig.run(0.6);
  CHECK(rig.target.status == StreamStatus::Tracking);
  double worst = 0.0;
  for (int i = 0; i < 500; ++i) {
    const double late = rig.stream.options().mode == StreamMode::Interpolate ? rig.stream.options().latency : 0.0;
    worst = std::max(worst, (rig.cycle().pose.translation() - sine(rig.now - late).translation()).norm());
  }
  CHECK(worst < (rig.stream.options().mode == StreamMode::Hold ? 0.12 : rig.every > 0.05 ? 0.06 : 0.04));
  CHECK(rig.least_age >= 0.0);
  CHECK(rig.fastest <= rig.stream.options().max_speed * (1.0 + 1e-9));
}

}  // namespace

TEST_CASE("a clock that steps: stale at once, no twist, and tracking again within the timeout") {
  for (const StreamMode mode : kModes) {
    for (const double step : {-10.0, -3600.0, -3.0, -0.5, -0.05, 3.0, 0.5, 1e6}) {
      for (const double rate : {10.0, 30.0, 50.0, 200.0}) {
        CAPTURE(step);
        CAPTURE(rate);
        Rig rig(mode, rate);
        rig.run(1.0);
        CHECK(rig.target.status <= StreamStatus::Coasting);
        rig.clock = rig.stamps = step;
        const Pose before = rig.target.pose;
        rig.cycle();
        CHECK(rig.target.status == StreamStatus::Stale);
        CHECK(rig.target.twist.isZero(0.0));
        CHECK((rig.target.pose.translation() - before.translation()).norm() <= 1.5e-3);
        CHECK(rig.back() <= rig.stream.options().timeout);
        CHECK(rig.stream.counts().clock_steps == 1);
        check_tracking(rig);
      }
    }
  }
}

TEST_CASE("stamps that step against the loop's clock, and back, are taken on the new clock within the timeout") {
  for (const StreamMode mode : kModes) {
    for (const double step : {5.0, 0.5, 1e5, -10.0, -0.7}) {
      for (const double rate : {10.0, 30.0, 50.0, 200.0}) {
        CAPTURE(step);
        CAPTURE(rate);
        Rig rig(mode, rate);
        rig.run(1.0);
        for (const double stamps : {step, 0.0}) {
          rig.stamps = stamps;
          rig.run(rig.stream.options().timeout);
          CHECK(rig.target.age <= 1.0 / rate + 0.02);
          CHECK(rig.stream.counts().relocated >= 1);
          check_tracking(rig);
        }
        CHECK(rig.stream.counts().clock_steps == 2);
      }
    }
  }
}

TEST_CASE("stamps that are ahead from the beginning: never a negative age, no twist before the clocks are matched") {
  for (const StreamMode mode : kModes) {
    Rig rig(mode);
    rig.stamps = 5.0;
    rig.cycle();
    CHECK(rig.target.status >= StreamStatus::Stale);
    CHECK(rig.back() <= rig.stream.options().timeout);
    CHECK(rig.fed == 0.0);
    check_tracking(rig);
  }
}

TEST_CASE("one wrong time of at(), or one wrong stamp, costs no more than a cycle") {
  for (const StreamMode mode : kModes) {
    for (const double wrong : {1e6, 1e300, -1e6, 0.0, 50.0}) {
      CAPTURE(wrong);
      Rig rig(mode);
      rig.run(1.0);
      const Target at = rig.stream.at(wrong);
      CHECK(at.status == StreamStatus::Stale);
      CHECK(at.twist.isZero(0.0));
      CHECK(rig.back() <= 0.05);
      check_tracking(rig);

      rig.run(1.0);
      const std::int64_t accepted = rig.stream.counts().accepted;
      rig.stream.push(wrong, sine(rig.now));
      rig.run(0.5);
      CHECK(rig.target.status == StreamStatus::Tracking);
      CHECK(rig.target.age <= 0.04);
      CHECK(rig.stream.counts().accepted >= accepted + 23);
    }
    Rig first(mode);
    first.stream.at(1e6);  // before the first sample
    CHECK(first.back() <= 0.05);
    check_tracking(first);
  }
}

TEST_CASE("a time that is not finite: the target holds still for this call alone") {
  for (const StreamMode mode : kModes) {
    Rig rig(mode), other(mode);
    rig.run(1.0);
    other.run(1.0);
    for (const double time :
         {kNan, std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()}) {
      const Target held = rig.stream.at(time);
      CHECK(held.status == StreamStatus::Stale);
      CHECK(held.twist.isZero(0.0));
      CHECK(held.pose.matrix() == rig.target.pose.matrix());
      CHECK(rig.stream.push(time, sine(rig.now)) == SampleStatus::Invalid);
    }
    rig.run(0.1);
    other.run(0.1);
    CHECK(rig.target.pose.matrix() == other.target.pose.matrix());
    CHECK(rig.target.twist == other.target.twist);
  }
}

TEST_CASE("no clock has stepped: late samples, bursts, pauses of the loop and two threads that read the clock") {
  for (const StreamMode mode : kModes) {
    Rig rig(mode);
    rig.run(1.0);
    const std::int64_t steps = rig.stream.counts().clock_steps;
    // Samples of the last second arrive in one go, out of order; they are old, and stay so.
    for (int i = 0; i < 20; ++i) {
      CHECK(rig.stream.push(rig.now - 1.0 + 0.02 * i, sine(rig.now)) == SampleStatus::OutOfOrder);
    }
    // A time that is a little earlier: the same target again.
    const Target again = rig.stream.at(rig.now - 1e-3);
    CHECK(again.pose.matrix() == rig.target.pose.matrix());
    CHECK(again.twist == rig.target.twist);
    CHECK(again.status == rig.target.status);
    // The loop pauses while samples come: they count at once.
    for (int i = 1; i < 100; ++i)
      CHECK(rig.stream.push(rig.now + 0.02 * i, sine(rig.now + 0.02 * i)) == SampleStatus::Accepted);
    CHECK(rig.stream.counts().clock_steps == steps);
    // A loop of 2 Hz: only its beginning can be taken for a step.
    TargetStreamOptions options;
    options.mode = mode;
    TargetStream slow(options);
    int stale = 0;
    for (int i = 0; i < 20; ++i) {
      for (int k = 0; k < 25; ++k) slow.push(0.5 * i + 0.02 * k, Pose::Identity());
      stale += slow.at(0.5 * i + 0.49).status == StreamStatus::Stale;
    }
    CHECK(stale <= 1);
  }
}

TEST_CASE("any steps of both clocks: targets stay finite and within the speeds, ages are not negative") {
  for (unsigned seed = 0; seed < 300; ++seed) {
    Random random(seed);
    Rig rig(kModes[seed % 3], random.uniform(5.0, 200.0));
    CAPTURE(seed);
    double fastest = 0.0;
    for (int i = 0; i < 2000; ++i) {
      const double size = random.decades(-4.0, 9.0) * (random.chance(0.5) ? 1.0 : -1.0);
      if (random.chance(0.003)) rig.clock += size;
      if (random.chance(0.003)) rig.stamps = random.chance(0.5) ? rig.clock : rig.stamps + size;
      const bool far = std::abs(size - rig.now - rig.clock) > 1.0;  // else no step, and the target goes there
      if (far && random.chance(0.003)) rig.stream.at(random.chance(0.3) ? kNan : size);
      if (random.chance(0.003)) rig.stream.push(size, sine(rig.now));
      rig.cycle();
      if (!rig.target.pose.matrix().allFinite() || !rig.target.twist.allFinite()) FAIL("not finite");
      fastest = std::max(fastest, rig.target.twist.head<3>().norm());
    }
    CHECK(fastest <= rig.stream.options().max_speed * (1.0 + 1e-9));
    CHECK(rig.least_age >= 0.0);
    rig.stamps = rig.clock;
    rig.run(1.0);
    CHECK(rig.target.status <= StreamStatus::Coasting);
  }
}
