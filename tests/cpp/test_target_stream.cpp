// Streams of samples: exact where the target moves as the model says, and continuous for any samples.

#include <doctest/doctest.h>

#include <array>
#include <deque>
#include <limits>
#include <numbers>
#include <vector>

#include <Eigen/LU>

#include <sigmaik/error.hpp>
#include <sigmaik/target_stream.hpp>

#include "heap.hpp"
#include "numbers.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using Eigen::Array2d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using test::kNan;
using test::Random;

constexpr StreamMode kModes[] = {StreamMode::Hold, StreamMode::Interpolate, StreamMode::Predict};

// The pose that a constant twist reaches from `start`.
Pose screw(const Pose& start, const Twist& twist, double seconds) {
  Pose out;
  out.translation() = start.translation() + seconds * twist.head<3>();
  out.linear() = rotation_exp(seconds * twist.tail<3>()) * start.linear();
  return out;
}

Twist slow_twist(Random& random, double linear = 0.5, double angular = 1.0) {
  Twist twist;
  twist << linear * random.unit(3), angular * random.unit(3);
  return twist;
}

// A smooth motion, with its twist: sums of sines in R³ and in a chart of SO(3).
struct Wander {
  explicit Wander(Random& random) : home(random.pose()) {
    for (int i = 0; i < 6; ++i) {
      amplitude[i] = random.uniform(0.02, i < 3 ? 0.15 : 0.3);
      frequency[i] = random.uniform(1.0, 3.0);
      phase[i] = random.uniform(0.0, 6.0);
    }
  }
  Twist coordinates(double t) const { return Twist(amplitude.array() * (frequency.array() * t + phase.array()).sin()); }
  Pose pose(double t) const {
    const Twist x = coordinates(t);
    Pose out = home;
    out.translation() += x.head<3>();
    out.linear() = rotation_exp(x.tail<3>()) * home.linear();
    return out;
  }
  Twist twist(double t) const {
    const Twist rate = amplitude.array() * frequency.array() * (frequency.array() * t + phase.array()).cos();
    Twist out;
    out << rate.head<3>(), rotation_exp_rate(coordinates(t).tail<3>(), rate.tail<3>());
    return out;
  }
  Pose home;
  Twist amplitude, frequency, phase;
};

Pose noisy(Random& random, const Pose& pose, double linear, double angular) {
  Pose out;
  out.translation() = pose.translation() + linear * Vector3d(random.vector(3));
  out.linear() = rotation_exp(angular * Vector3d(random.vector(3))) * pose.linear();
  return out;
}

// What a sensor sends, and when: noise, drop-outs, gaps, outliers, relocations, and steps of the sensor's clock.
struct Arrival {
  double at, stamp;
  Pose pose;
};

std::vector<Arrival> bad_stream(Random& random, const TargetStreamOptions& options, double seconds) {
  const Wander wander(random);
  const double period = random.uniform(0.004, 0.06), delay = random.uniform(0.0, 0.1);
  const double dropout = random.uniform(0.0, 0.5), outliers = random.uniform(0.0, 0.2);
  const bool clean = random.chance(0.2);
  std::vector<Arrival> arrivals;
  Pose off = Pose::Identity();
  double gap_until = 0.0, clock = 0.0;
  for (double time = 0.0; time + delay < seconds; time += period) {
    if (!clean && random.chance(0.01)) gap_until = time + random.uniform(0.0, 0.6);
    if (!clean && random.chance(0.01)) off = random.pose(0.5);
    if (!clean && random.chance(0.01)) clock = random.uniform(-1.0, 1.0);
    Pose seen = noisy(random, off * wander.pose(time), options.noise_linear, options.noise_angular);
    if (!clean && random.chance(outliers)) seen = random.pose(2.0);
    double stamp = time + clock;
    if (!clean && random.chance(0.05)) stamp += period * random.uniform(-3.0, 1.0);
    if (clean || (time >= gap_until && !random.chance(dropout))) arrivals.push_back({time + delay, stamp, seen});
  }
  return arrivals;
}

// Largest of: the target's jerk, from second differences of the twist; its acceleration, from first differences; and
// the distance between a step of the pose and the mean twist of the step, per dt³. One row each for linear and angular.
struct Roughness {
  Array2d jerk = Array2d::Zero(), acceleration = jerk, slip = jerk;
};

Roughness roughness(const TargetStreamOptions& options, const std::vector<Arrival>& arrivals, double seconds,
                    double dt) {
  const auto lengths = [](const Twist& x) { return Array2d(x.head<3>().norm(), x.tail<3>().norm()); };
  TargetStream stream(options);
  Roughness worst;
  std::size_t next = 0;
  Target before;
  Twist slope = Twist::Zero();
  int known = 0;
  for (int cycle = 0; dt * cycle < seconds; ++cycle) {
    for (; next < arrivals.size() && arrivals[next].at <= dt * cycle; ++next) {
      stream.push(arrivals[next].stamp, arrivals[next].pose);
    }
    const Target target = stream.at(dt * cycle);
    if (target.status == StreamStatus::Waiting) continue;
    const Twist acceleration = (target.twist - before.twist) / dt;
    if (known >= 1) {
      const Twist slip = pose_error(before.pose, target.pose) - 0.5 * dt * (before.twist + target.twist);
      worst.acceleration = worst.acceleration.max(lengths(acceleration));
      worst.slip = worst.slip.max((lengths(slip) - 1e-14).max(0.0) / (dt * dt * dt));
    }
    if (known >= 2) worst.jerk = worst.jerk.max(lengths(acceleration - slope) / dt);
    slope = acceleration;
    before = target;
    ++known;
  }
  return worst;
}

double distance(const Pose& a, const Pose& b) { return pose_error(a, b).norm(); }

}  // namespace

TEST_CASE("predict: a constant twist is met exactly, whatever the delay") {
  Random random(1);
  for (int repeat = 0; repeat < 200; ++repeat) {
    const Pose start = random.pose();
    const Twist twist = slow_twist(random);
    const double period = random.uniform(0.005, 0.05), delay = random.uniform(0.0, 0.05);
    TargetStream stream;
    int pushed = 0;
    for (int cycle = 0; cycle <= 3000; ++cycle) {
      const double now = 1e-3 * cycle;
      for (; pushed * period + delay <= now; ++pushed) {
        CHECK(stream.push(pushed * period, screw(start, twist, pushed * period)) == SampleStatus::Accepted);
      }
      const Target target = stream.at(now);
      if (cycle < 2500) continue;
      CHECK(target.status == StreamStatus::Tracking);
      CHECK(target.age == doctest::Approx(now - (pushed - 1) * period));
      CHECK(distance(target.pose, screw(start, twist, now)) < 1e-8);
      CHECK((target.twist - twist).norm() < 1e-7);
    }
  }
}

TEST_CASE("predict: a Kalman filter of six states gives the same targets") {
  Random random(2);
  for (int repeat = 0; repeat < 50; ++repeat) {
    TargetStreamOptions options;
    options.smoothing = 0.0;
    options.max_speed = 100.0;
    options.noise_linear = random.decades(-4.0, -2.0);
    options.acceleration_linear = random.decades(-1.0, 1.0);
    TargetStream stream(options);
    const Wander wander(random);

    Eigen::Matrix<double, 6, 1> x = Eigen::Matrix<double, 6, 1>::Zero();
    Eigen::Matrix<double, 6, 6> p = Eigen::Matrix<double, 6, 6>::Zero(), f = Eigen::Matrix<double, 6, 6>::Identity();
    const double r = std::pow(options.noise_linear, 2);
    double time = 0.0, last = 0.0;
    for (int i = 0; i < 100; ++i, time += random.uniform(0.005, 0.1)) {
      const Pose seen = noisy(random, wander.pose(time), options.noise_linear, 1e-3);
      REQUIRE(stream.push(time, seen) == SampleStatus::Accepted);
      if (i == 0) {
        x.head<3>() = seen.translation();
        p.diagonal() << Vector3d::Constant(r), Vector3d::Constant(std::pow(0.5 * options.max_speed, 2));
      } else {
        const double dt = time - last;
        f.topRightCorner<3, 3>() = dt * Matrix3d::Identity();
        Eigen::Matrix<double, 6, 3> g;
        g << 0.5 * dt * dt * Matrix3d::Identity(), dt * Matrix3d::Identity();
        g *= options.acceleration_linear;
        x = (f * x).eval();
        p = (f * p * f.transpose() + g * g.transpose()).eval();
        const Matrix3d s = p.topLeftCorner<3, 3>() + r * Matrix3d::Identity();
        const Eigen::Matrix<double, 6, 3> k = p.leftCols<3>() * s.inverse();
        x += k * (seen.translation() - x.head<3>());
        p = (p - k * p.topRows<3>()).eval();
      }
      last = time;
      stream.at(time);
      const Target target = stream.at(time + 1e-3);
      CHECK((target.pose.translation() - x.head<3>() - 1e-3 * x.tail<3>()).norm() < 1e-9);
      CHECK((target.twist.head<3>() - x.tail<3>()).norm() < 1e-6);
    }
  }
}

TEST_CASE("interpolate: through every sample, latency later, and smooth in between") {
  Random random(3);
  for (int repeat = 0; repeat < 100; ++repeat) {
    TargetStreamOptions options;
    options.mode = StreamMode::Interpolate;
    options.smoothing = random.uniform(0.01, 0.1);
    options.latency = 0.13;
    TargetStream stream(options);
    const Wander wander(random);
    std::deque<double> stamps;
    double next = 0.0;
    for (int cycle = 0; cycle <= 2500; ++cycle) {
      const double now = 1e-3 * cycle;
      for (; next + 0.02 <= now; next += 1e-3 * random.integer(5, 50)) {  // two samples ahead of the played time
        stamps.push_back(next);
        REQUIRE(stream.push(next, wander.pose(next)) == SampleStatus::Accepted);
      }
      const Target target = stream.at(now);
      if (cycle < 1500) continue;  // the start is far from R(t), and this takes 30 τ to decay
      const double play = now - options.latency;
      CHECK(distance(target.pose, wander.pose(play)) < 5e-3);
      CHECK((target.twist - wander.twist(play)).norm() < 0.25);
      while (!stamps.empty() && stamps.front() < play - 1e-9) stamps.pop_front();
      if (std::abs(stamps.front() - play) < 1e-9) CHECK(distance(target.pose, wander.pose(play)) < 2e-6);
    }
  }
}

TEST_CASE("interpolate: a constant twist is played as it was, from slow sensors and from those faster than the loop") {
  Random random(4);
  for (const double period : {0.03, 1e-3, 1e-4}) {
    TargetStreamOptions options;
    options.mode = StreamMode::Interpolate;
    TargetStream stream(options);
    const Pose start = random.pose();
    const Twist twist = slow_twist(random);
    int pushed = 0;
    for (int cycle = 0; cycle <= 2000; ++cycle) {
      const double now = 1e-3 * cycle;
      for (; pushed * period <= now; ++pushed) stream.push(pushed * period, screw(start, twist, pushed * period));
      const Target target = stream.at(now);
      if (cycle < 1500) continue;
      CHECK(distance(target.pose, screw(start, twist, now - options.latency)) < 1e-8);
      CHECK((target.twist - twist).norm() < 1e-7);
    }
    CHECK(stream.counts().accepted == pushed);
  }
}

TEST_CASE("hold: goes to the last sample, and rests there without overshoot") {
  Random random(5);
  for (int repeat = 0; repeat < 100; ++repeat) {
    TargetStreamOptions options;
    options.mode = StreamMode::Hold;
    TargetStream stream(options);
    Pose start = random.pose(), goal = start;
    stream.reset(start);
    CHECK(stream.at(0.0).status == StreamStatus::Waiting);
    CHECK(distance(stream.at(0.0).pose, start) < 1e-14);
    goal.translation() += random.uniform(0.0, 1.0) * random.unit(3);
    goal.linear() = rotation_exp(random.uniform(0.0, 3.1) * random.unit(3)) * start.linear();
    CHECK(stream.push(0.0, goal) == SampleStatus::Accepted);
    Twist before = pose_error(start, goal);
    for (int cycle = 1; cycle <= 3000; ++cycle) {
      const Target target = stream.at(1e-3 * cycle);
      const Twist left = pose_error(target.pose, goal);
      CHECK(left.head<3>().norm() <= before.head<3>().norm() + 1e-12);
      CHECK(left.tail<3>().norm() <= before.tail<3>().norm() + 1e-12);
      before = left;
    }
    CHECK(before.norm() < 1e-12);
    CHECK(stream.at(3.0).twist.norm() < 1e-12);
    CHECK(stream.at(3.0).status == StreamStatus::Stale);
  }
}

TEST_CASE("for any samples pose and twist are continuous, and never faster than the limits") {
  long refused = 0, relocated = 0, coasted = 0, stale = 0;
  for (unsigned seed = 0; seed < 3000; ++seed) {
    Random random(seed);
    CAPTURE(seed);
    TargetStreamOptions options;
    options.mode = kModes[seed % 3];
    options.smoothing = random.uniform(0.02, 0.1);
    options.latency = random.uniform(0.0, 0.15);
    options.horizon = random.uniform(0.0, 0.2);
    options.timeout = options.horizon + random.uniform(0.01, 0.3);
    options.max_speed = random.uniform(0.4, 2.0);
    options.max_angular_speed = random.uniform(1.0, 6.0);
    TargetStream stream(options);
    const Wander wander(random);
    Pose off = Pose::Identity();
    const double period = random.uniform(0.004, 0.06), delay = random.uniform(0.0, 0.1);
    // Late stamps are late by whole periods: the curve between two samples turns faster the closer the samples are.
    const double dropout = random.uniform(0.0, 0.5), outliers = random.uniform(0.0, 0.2);
    double next = 0.0, gap_until = 0.0, now = random.uniform(-1e3, 1e9);
    const double zero = now;
    Target before;
    bool first = true;
    for (int cycle = 0; cycle < 1000; ++cycle) {
      const double dt = 1e-3 * (random.chance(0.02) ? random.uniform(0.0, 20.0) : 1.0);
      const double last = now;
      now += dt;
      while (next + delay <= now - zero) {
        if (random.chance(0.01)) gap_until = next + random.uniform(0.0, 0.6);
        if (random.chance(0.01)) off = random.pose(0.5);  // somewhere else from now on
        Pose seen = noisy(random, off * wander.pose(next), options.noise_linear, options.noise_angular);
        if (random.chance(outliers)) seen = random.pose(2.0);
        if (random.chance(0.02)) seen.matrix()(random.integer(0, 3), random.integer(0, 3)) = kNan;
        const double stamp = random.chance(0.05) ? next - random.integer(0, 4) * period : next;
        if (next >= gap_until && !random.chance(dropout)) stream.push(zero + stamp, seen);
        next += period;
      }
      const Target target = stream.at(now);
      REQUIRE(is_pose(target.pose.matrix()));
      REQUIRE(target.twist.allFinite());
      if (target.status == StreamStatus::Waiting) continue;
      coasted += target.status == StreamStatus::Coasting;
      stale += target.status == StreamStatus::Stale;
      const Twist step = pose_error(before.pose, target.pose);
      const double elapsed = now - last;  // as rounded
      CHECK(target.twist.head<3>().norm() <= options.max_speed * (1.0 + 1e-12));
      CHECK(target.twist.tail<3>().norm() <= options.max_angular_speed * (1.0 + 1e-12));
      if (!first) {
        CHECK(step.head<3>().norm() <= options.max_speed * elapsed + 1e-12);
        CHECK(step.tail<3>().norm() <= options.max_angular_speed * elapsed + 1e-12);
        // Accelerations of d, of fading to rest, of the curve between samples, and of d turning with ω.
        const double fade = 1.5 / (options.timeout - options.horizon);
        const double curve = options.mode == StreamMode::Interpolate ? 20.0 / period : 0.0;
        const double a = elapsed * (1.0 / options.smoothing + fade + curve + 4.0 * options.max_angular_speed) + 1e-6;
        if (elapsed < 2e-3) {
          CHECK((target.twist - before.twist).head<3>().norm() <= a * options.max_speed);
          CHECK((step / elapsed - target.twist).head<3>().norm() <= a * options.max_speed);
          CHECK((target.twist - before.twist).tail<3>().norm() <= a * options.max_angular_speed);
          CHECK((step / elapsed - target.twist).tail<3>().norm() <= a * options.max_angular_speed);
        }
      }
      first = false;
      before = target;
    }
    refused += stream.counts().outliers + stream.counts().out_of_order + stream.counts().invalid;
    relocated += stream.counts().relocated;
  }
  CHECK(refused > 10000);  // the input was as bad as intended
  CHECK(relocated > 100);
  CHECK(coasted > 1000);
  CHECK(stale > 1000);
}

TEST_CASE("for any samples the acceleration is continuous: shorter cycles change it less, and the jerk is bounded") {
  constexpr std::array kCycles{2e-3, 1e-3, 5e-4};
  std::array<double, kCycles.size()> changes{};  // of acceleration between cycles, largest of each stream, added up
  double most_jerk = 0.0, most_acceleration = 0.0, most_slip = 0.0;
  for (unsigned seed = 0; seed < 600; ++seed) {
    Random random(seed);
    CAPTURE(seed);
    TargetStreamOptions options;
    options.mode = kModes[seed % 3];
    options.smoothing = random.uniform(0.02, 0.1);
    options.latency = random.uniform(0.0, 0.15);
    options.horizon = random.uniform(0.0, 0.2);
    options.timeout = options.horizon + (random.chance(0.2) ? 0.0 : random.uniform(0.0, 0.3)) + 1e-3;
    if (random.chance(0.1)) options.timeout = options.horizon + 1e-9;
    options.max_speed = random.uniform(0.4, 2.0);
    options.max_angular_speed = random.uniform(1.0, 6.0);
    const std::vector<Arrival> arrivals = bad_stream(random, options, 2.0);
    const Array2d speed(options.max_speed, options.max_angular_speed);
    const Array2d acceleration = speed / options.smoothing;
    const Array2d jerk = 0.5 * (std::exp(2.0) + 1.0) * acceleration / options.smoothing;
    // The trapezoidal rule errs by dt³/12 ω̈, and the mean of ω turns as ω(t) does but for dt³/12 ω × ω̇.
    const Array2d slip = (jerk + Array2d(0.0, 1.0) * speed * acceleration) / 12.0;
    for (std::size_t i = 0; i < kCycles.size(); ++i) {
      const Roughness worst = roughness(options, arrivals, 2.0, kCycles[i]);
      CHECK((worst.jerk <= jerk * (1.0 + 1e-6)).all());
      CHECK((worst.acceleration <= acceleration * (1.0 + 1e-6)).all());
      CHECK((worst.slip <= slip * (1.0 + 1e-6)).all());
      changes[i] += kCycles[i] * (worst.jerk / jerk).sum();
      most_jerk = std::max(most_jerk, (worst.jerk / jerk).maxCoeff());
      most_acceleration = std::max(most_acceleration, (worst.acceleration / acceleration).maxCoeff());
      most_slip = std::max(most_slip, (worst.slip / slip).maxCoeff());
    }
  }
  CHECK(changes[1] == doctest::Approx(0.5 * changes[0]).epsilon(0.1));
  CHECK(changes[2] == doctest::Approx(0.5 * changes[1]).epsilon(0.1));
  CHECK(most_jerk > 0.8);  // the streams were as rough as intended
  CHECK(most_acceleration > 0.8);
  CHECK(most_slip > 0.8);
}

TEST_CASE("a difference decays as a triple pole says, in cycles of any length") {
  Random random(10);
  for (int repeat = 0; repeat < 100; ++repeat) {
    TargetStreamOptions options;
    options.mode = StreamMode::Hold;
    options.smoothing = random.uniform(0.01, 0.2);
    TargetStream stream(options);
    const double k = 0.5 * std::numbers::e / options.smoothing;
    Pose goal = random.pose();
    Twist way;  // short enough for no bound to act
    way << random.uniform(0.1, 0.9) * options.max_speed / k * random.unit(3),
        random.uniform(0.1, 0.9) * std::min(options.max_angular_speed / k, 3.0) * random.unit(3);
    stream.reset(screw(goal, way, 1.0));
    stream.at(0.0);
    REQUIRE(stream.push(0.0, goal) == SampleStatus::Accepted);
    for (double time = 0.0; time < 10.0 * options.smoothing;) {
      time += random.uniform(0.0, options.smoothing);
      const Target target = stream.at(time);
      const double x = k * time, left = (1.0 + x + 0.5 * x * x) * std::exp(-x);
      CHECK((pose_error(goal, target.pose) - left * way).norm() < 1e-12);
      CHECK((target.twist + 0.5 * k * x * x * std::exp(-x) * way).norm() < 1e-10);
    }
  }
}

TEST_CASE("a stream that stops: coasts for the horizon, and rests from the timeout on") {
  Random random(6);
  for (const StreamMode mode : kModes) {
    TargetStreamOptions options;
    options.mode = mode;
    TargetStream stream(options);
    const Pose start = random.pose();
    const Twist twist = slow_twist(random);
    double now = 0.0;
    for (int cycle = 0; cycle <= 2000; ++cycle, now += 1e-3) {
      if (cycle % 25 == 0) stream.push(now, screw(start, twist, now));
      stream.at(now);
    }
    const double last = 2.0;
    Target before = stream.at(now), target = before;
    for (; now < 5.0; now += 1e-3) {
      target = stream.at(now);
      CHECK((target.twist - before.twist).norm() < 0.1);
      if (target.status == StreamStatus::Stale && mode != StreamMode::Interpolate)
        CHECK(now - last >= options.timeout - 1e-9);
      before = target;
    }
    CHECK(target.status == StreamStatus::Stale);
    CHECK(target.twist.norm() < 1e-9);
    const double moved = mode == StreamMode::Hold ? 0.0 : 0.5 * (options.horizon + options.timeout);
    CHECK(distance(target.pose, screw(start, twist, last + moved)) < 1e-6);
    // The stream starts again, from where the target stands.
    CHECK(stream.push(now, start) == SampleStatus::Accepted);
    CHECK(distance(stream.at(now).pose, target.pose) < 2e-3);
  }
}

TEST_CASE("outliers leave no trace; a run of outliers that agree is accepted") {
  Random random(7);
  for (const StreamMode mode : kModes) {
    TargetStreamOptions options;
    options.mode = mode;
    TargetStream clean(options), spoilt(options);
    const Wander wander(random);
    for (int cycle = 0; cycle < 3000; ++cycle) {
      const double now = 1e-3 * cycle;
      if (cycle % 30 == 0) {
        clean.push(now, wander.pose(now));
        CHECK(spoilt.push(now, wander.pose(now)) == SampleStatus::Accepted);
      } else if (cycle % 30 == 10) {
        Pose wrong = wander.pose(now);
        if (cycle % 60 == 10)
          wrong.translation() += random.uniform(0.2, 3.0) * random.unit(3);
        else
          wrong.linear() = rotation_exp(random.uniform(1.0, 3.1) * random.unit(3)) * wrong.linear();
        CHECK(spoilt.push(now, wrong) == SampleStatus::Outlier);
      }
      CHECK(clean.at(now).pose.matrix() == spoilt.at(now).pose.matrix());
    }
    CHECK(spoilt.counts().outliers == 100);

    Pose moved = wander.pose(3.0);
    moved.translation() += Vector3d(1.0, 0.0, 0.0);
    for (int i = 1; i <= options.relocate; ++i) {
      const SampleStatus status = spoilt.push(3.0 + 0.03 * i, moved);
      CHECK(status == (i < options.relocate ? SampleStatus::Outlier : SampleStatus::Relocated));
    }
    double now = 3.15;
    for (; now < 8.0; now += 1e-3) spoilt.at(now);
    CHECK(distance(spoilt.at(now).pose, moved) < 1e-9);
    CHECK(spoilt.counts().relocated == 1);
    CHECK(spoilt.counts().outliers == 100 + options.relocate);
  }
}

TEST_CASE("stamps: doubled and late ones are refused, a clock that was set back is followed") {
  const Pose pose = Pose::Identity();
  TargetStream stream;
  CHECK(stream.push(10.0, pose) == SampleStatus::Accepted);
  for (int i = 0; i < 20; ++i) CHECK(stream.push(10.0, pose) == SampleStatus::OutOfOrder);
  CHECK(stream.push(9.99, pose) == SampleStatus::OutOfOrder);
  CHECK(stream.push(10.03, pose) == SampleStatus::Accepted);
  CHECK(stream.push(1e12, pose) == SampleStatus::Accepted);  // a wrong stamp, which must not block the stream for ever
  int i = 0;
  while (stream.push(10.06 + 0.03 * i, pose) == SampleStatus::OutOfOrder) ++i;
  CHECK(i == stream.options().relocate - 1);
  CHECK(stream.push(10.06 + 0.03 * ++i, pose) == SampleStatus::Accepted);
  CHECK(stream.counts().out_of_order == 21 + stream.options().relocate);
  CHECK(stream.counts().accepted == 5);
}

TEST_CASE("invalid samples and times are refused") {
  TargetStream stream;
  Random random(8);
  CHECK(stream.at(0.0).status == StreamStatus::Waiting);
  Pose bad = random.pose();
  bad.linear() *= 1.1;
  Pose far = random.pose();
  far.translation()[1] = 1e300;
  for (const Pose& wrong : {bad, far}) CHECK(stream.push(0.0, wrong) == SampleStatus::Invalid);
  for (const double time : {kNan, std::numeric_limits<double>::infinity()}) {
    CHECK(stream.push(time, random.pose()) == SampleStatus::Invalid);
  }
  CHECK(stream.counts().invalid == 4);
  const Pose pose = random.pose();
  CHECK(stream.push(0.0, pose) == SampleStatus::Accepted);
  const Target target = stream.at(0.1);
  CHECK(distance(target.pose, pose) < 1e-14);
  for (const double time : {kNan, -1.0, 0.1, std::numeric_limits<double>::infinity()}) {
    CHECK(stream.at(time).pose.matrix() == target.pose.matrix());
  }
  CHECK(stream.at(1e300).status == StreamStatus::Stale);
  stream.reset();
  CHECK(stream.at(0.0).status == StreamStatus::Waiting);
  CHECK(stream.counts().accepted == 0);
  CHECK_THROWS_AS(stream.reset(bad), Error);
}

TEST_CASE("targets are finite and within the speeds for smoothing, latency and stamps of any size") {
  for (unsigned seed = 0; seed < 2000; ++seed) {
    Random random(seed);
    CAPTURE(seed);
    const auto any = [&random] {
      return random.decades(random.chance(0.3) ? -300.0 : -6.0, random.chance(0.3) ? 300.0 : 3.0);
    };
    TargetStreamOptions options;
    options.mode = kModes[seed % 3];
    options.smoothing = random.chance(0.1) ? 0.0 : any();
    options.latency = random.chance(0.1) ? 0.0 : any();
    options.max_speed = random.decades(-6.0, 4.0);
    options.max_angular_speed = random.decades(-6.0, 4.0);
    options.horizon = random.chance(0.1) ? 0.0 : random.decades(-6.0, 1.0);
    options.timeout = options.horizon * (random.chance(0.2) ? 1.0 : 1.5) + 1e-300;
    TargetStream stream(options);
    const Wander wander(random);
    double stamp = 0.0, now = 0.0;
    for (int i = 0; i < 60; ++i) {
      stream.push(stamp, noisy(random, wander.pose(1e-3 * i), options.noise_linear, options.noise_angular));
      stamp += random.decades(random.chance(0.5) ? -320.0 : -4.0, random.chance(0.02) ? 300.0 : -2.0);
      now = random.chance(0.5) ? stamp : now + random.decades(random.chance(0.5) ? -320.0 : -4.0, -2.0);
      const Target target = stream.at(now);
      REQUIRE(is_pose(target.pose.matrix()));
      REQUIRE(target.twist.allFinite());
      const Twist twist = target.twist;
      CHECK(std::hypot(twist[0], twist[1], twist[2]) <= options.max_speed * (1.0 + 1e-12));
      CHECK(std::hypot(twist[3], twist[4], twist[5]) <= options.max_angular_speed * (1.0 + 1e-12));
    }
  }
}

TEST_CASE("options out of their range are refused") {
  const auto refused = [](auto change) {
    TargetStreamOptions options;
    change(options);
    CHECK_THROWS_AS(TargetStream{options}, Error);
  };
  for (const double bad : {-1.0, kNan, std::numeric_limits<double>::infinity()}) {
    refused([&](auto& o) { o.max_speed = bad; });
    refused([&](auto& o) { o.max_angular_speed = bad; });
    refused([&](auto& o) { o.smoothing = bad; });
    refused([&](auto& o) { o.latency = bad; });
    refused([&](auto& o) { o.horizon = bad; });
    refused([&](auto& o) { o.timeout = bad; });
    refused([&](auto& o) { o.noise_linear = bad; });
    refused([&](auto& o) { o.noise_angular = bad; });
    refused([&](auto& o) { o.acceleration_linear = bad; });
    refused([&](auto& o) { o.acceleration_angular = bad; });
  }
  refused([](auto& o) { o.timeout = 0.5 * o.horizon; });
  refused([](auto& o) { o.relocate = 0; });
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("push() and at() leave the heap alone") {
  Random random(9);
  for (const StreamMode mode : kModes) {
    TargetStreamOptions options;
    options.mode = mode;
    TargetStream stream(options);
    const Wander wander(random);
    const Pose wrong = random.pose(10.0);
    double sum = 0.0;
    const test::HeapWatch watch;
    for (int cycle = 0; cycle < 3000; ++cycle) {
      const double now = 1e-3 * cycle;
      if (cycle % 30 == 0) stream.push(now, wander.pose(now));
      if (cycle % 100 == 50) stream.push(now, wrong);
      sum += stream.at(now).twist.sum();
    }
    CHECK(watch.calls() == 0);
    CHECK(std::isfinite(sum));
  }
}
#endif
