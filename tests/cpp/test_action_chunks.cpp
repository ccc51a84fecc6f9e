// Chunks of a policy: exact where they agree, continuous and bounded whatever they say, at rest where they stop.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <sigmaik/action_chunks.hpp>
#include <sigmaik/error.hpp>

#include "heap.hpp"
#include "numbers.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using Eigen::Array2d;
using Eigen::Vector3d;
using test::kNan;
using test::Random;
using Poses = std::vector<Pose>;

// The pose that a constant twist reaches from `start`.
Pose screw(const Pose& start, const Twist& twist, double seconds) {
  Pose out;
  out.translation() = start.translation() + seconds * twist.head<3>();
  out.linear() = rotation_exp(seconds * twist.tail<3>()) * start.linear();
  return out;
}

Twist slow_twist(Random& random) {
  Twist twist;
  twist << 0.4 * random.unit(3), 0.8 * random.unit(3);
  return twist;
}

// What a policy sends: k actions from the stamp on, when they come, and how far they are from the true way.
struct Sent {
  double at, stamp;
  Poses poses;
  std::vector<Twist> twists;  // where not empty, in place of poses
};

// A policy that wants to go round, with noise, another noise in each chunk, chunks late, early, doubled, missing, of
// one action or of many, and at times somewhere else.
std::vector<Sent> schedule(Random& random, const ActionChunksOptions& options, double seconds) {
  std::vector<Sent> out;
  Pose centre = random.pose(0.5);
  const double pace = random.uniform(0.5, 3.0), noise = random.chance(0.3) ? 0.0 : random.uniform(0.0, 0.02);
  const bool by_twists = random.chance(0.3);
  for (double stamp = 0.0; stamp < seconds; stamp += random.uniform(0.03, 0.6)) {
    if (random.chance(0.15)) continue;
    if (random.chance(0.05)) centre = random.pose(0.5);
    Sent chunk{
        stamp + random.uniform(0.02, 0.4), stamp + (random.chance(0.05) ? random.uniform(-1.0, 1.0) : 0.0), {}, {}};
    const int count = random.chance(0.1) ? 1 : random.integer(2, 20);
    for (int i = 0; i < count; ++i) {
      const double t = pace * (stamp + options.first + i * options.dt_action);
      Pose pose = centre;
      pose.translation() += 0.2 * Vector3d(std::sin(t), std::cos(t), std::sin(2.0 * t)) + noise * random.vector(3);
      pose.linear() = rotation_exp(Vector3d(0.5 * std::sin(t), 0.3 * std::cos(t), noise * random.normal())) *
                      pose.linear();
      chunk.poses.push_back(pose);
      Twist twist;
      twist << random.vector(3) * 0.2, random.vector(3) * 0.5;
      if (by_twists) chunk.twists.push_back(twist);
    }
    out.push_back(chunk);
  }
  std::stable_sort(out.begin(), out.end(), [](const Sent& a, const Sent& b) { return a.at < b.at; });
  return out;
}

void send(ActionChunks& chunks, const Sent& chunk) {
  if (chunk.twists.empty()) {
    chunks.push(chunk.stamp, chunk.poses);
  } else {
    chunks.push_twists(chunk.stamp, chunk.twists);
  }
}

Array2d lengths(const Twist& x) { return {x.head<3>().norm(), x.tail<3>().norm()}; }

}  // namespace

TEST_CASE("chunks that agree are followed exactly, however late they come and however they overlap") {
  Random random(1);
  for (int trial = 0; trial < 50; ++trial) {
    ActionChunksOptions options;
    options.dt_action = random.uniform(0.02, 0.2);
    options.first = random.chance(0.5) ? 0.0 : options.dt_action;
    ActionChunks chunks(options);
    const Pose start = random.pose();
    const Twist twist = slow_twist(random);
    const double delay = random.uniform(0.05, 0.3), period = random.uniform(0.05, 0.5);
    const int count = static_cast<int>(std::ceil((delay + period + 0.5) / options.dt_action)) + 2;
    double next = 0.0, worst = 0.0, worst_twist = 0.0;
    for (double time = delay; time < 3.0; time += 1e-3) {
      if (time >= next + delay) {
        Poses poses;
        for (int i = 0; i < count; ++i)
          poses.push_back(screw(start, twist, next + options.first + i * options.dt_action));
        REQUIRE(chunks.push(next, poses) == ChunkStatus::Accepted);
        next += period;
      }
      const ActionTarget target = chunks.at(time);
      if (target.status == ActionStatus::Waiting) continue;
      CHECK(target.status == ActionStatus::Tracking);
      worst = std::max(worst, pose_error(target.pose, screw(start, twist, time)).norm());
      worst_twist = std::max(worst_twist, (target.twist - twist).norm());
    }
    CHECK(worst < 1e-10);
    CHECK(worst_twist < 1e-8);
  }
}

TEST_CASE("chunks of twists that agree are followed exactly, from where the target is") {
  Random random(2);
  for (int trial = 0; trial < 50; ++trial) {
    ActionChunks chunks;
    const Pose start = random.pose();
    const Twist twist = slow_twist(random);
    CHECK(chunks.push_twists(0.0, std::vector<Twist>(5, twist)) == ChunkStatus::Invalid);  // no start yet
    chunks.reset(start);
    const double delay = random.uniform(0.05, 0.3);
    double next = 0.0, worst = 0.0;
    Pose settled;
    for (int cycle = 0; cycle < 4000; ++cycle) {
      const double time = 1e-3 * cycle;
      if (time >= next + delay) {
        REQUIRE(chunks.push_twists(next, std::vector<Twist>(10, twist)) == ChunkStatus::Accepted);
        next += 0.2;
      }
      const ActionTarget target = chunks.at(time);
      if (cycle == 3000) settled = target.pose;  // the first chunk's twist was blended in from rest
      if (cycle >= 3000) worst = std::max(worst, pose_error(target.pose, screw(settled, twist, time - 3.0)).norm());
    }
    CHECK(worst < 1e-8);
  }
}

TEST_CASE("a late chunk neither goes back nor repeats a way: no sawtooth") {
  // Straight ahead at 0.3 m/s; every chunk starts where the tip was when it was looked at, 0.25 s before it comes.
  ActionChunks chunks;
  Pose start = Pose::Identity();
  Twist ahead = Twist::Zero();
  ahead[0] = 0.3;
  double next = 0.0, slowest = 1.0;
  for (int cycle = 250; cycle < 5000; ++cycle) {
    const double time = 1e-3 * cycle;
    if (time >= next + 0.25) {
      Poses poses;
      for (int i = 0; i < 16; ++i) poses.push_back(screw(start, ahead, next + 0.1 * i));
      chunks.push(next, poses);
      next += 0.4;
    }
    slowest = std::min(slowest, chunks.at(time).twist[0]);
  }
  CHECK(slowest > 0.3 - 1e-9);
  CHECK(chunks.counts().missed == 3 * chunks.counts().accepted - 3);  // those of the first chunk came before at()
}

TEST_CASE("pose, twist and acceleration are continuous, and speed, acceleration and jerk bounded, for any schedule") {
  Random random(3);
  const double dt = 2e-3;
  for (int trial = 0; trial < 1000; ++trial) {
    CAPTURE(trial);
    ActionChunksOptions options;
    options.dt_action = random.uniform(0.02, 0.2);
    options.first = random.chance(0.5) ? 0.0 : random.uniform(-0.1, 0.3);
    options.smoothing = random.uniform(0.05, 0.2);
    options.max_speed = random.uniform(0.2, 2.0);
    options.stop_time = random.chance(0.2) ? 0.0 : random.uniform(0.05, 0.6);
    ActionChunks chunks(options);
    chunks.reset(random.pose(0.5));
    const std::vector<Sent> sent = schedule(random, options, 1.5);
    const Array2d speed(options.max_speed, options.max_angular_speed);
    std::size_t next = 0;
    ActionTarget before = chunks.at(0.0);
    Twist slope = Twist::Zero();
    Array2d fastest = Array2d::Zero(), acceleration = fastest, jerk = fastest, slip = fastest;
    for (int cycle = 1; cycle < 1000; ++cycle) {
      const double time = dt * cycle;
      for (; next < sent.size() && sent[next].at <= time; ++next) send(chunks, sent[next]);
      const ActionTarget target = chunks.at(time);
      const Twist change = (target.twist - before.twist) / dt;
      const Twist miss = pose_error(before.pose, target.pose) - 0.5 * dt * (before.twist + target.twist);
      fastest = fastest.max(lengths(target.twist));
      acceleration = acceleration.max(lengths(change));
      jerk = jerk.max(lengths(change - slope) / dt);
      slip = slip.max(lengths(miss) / (dt * dt * dt));
      slope = change;
      before = target;
    }
    const double tau = options.smoothing;
    const Array2d most = 4.2 * speed / (tau * tau);
    CHECK((fastest <= speed * (1.0 + 1e-9)).all());
    // A rotating axis adds ω × α to the angular acceleration and jerk of the chart (target_stream.hpp's bounds).
    CHECK((acceleration <= 1.1 * speed / tau).all());
    CHECK((jerk <= 1.2 * most).all());
    CHECK((slip <= most).all());
  }
}

TEST_CASE("where chunks stop, the target comes to rest at the last action, on the policy's way") {
  Random random(4);
  for (int trial = 0; trial < 100; ++trial) {
    ActionChunksOptions options;
    options.stop_time = random.uniform(2.0, 6.0) * options.smoothing;
    ActionChunks chunks(options);
    const Pose start = random.pose();
    const Twist twist = slow_twist(random);
    Poses poses;
    for (int i = 0; i < 11; ++i) poses.push_back(screw(start, twist, 0.1 * i));
    chunks.push(0.0, poses);
    double beyond = 0.0;
    ActionTarget target;
    for (int cycle = 0; cycle < 2000; ++cycle) {
      const double time = 1e-3 * cycle;
      target = chunks.at(time);
      const Vector3d way = target.pose.translation() - start.translation();
      const double along = way.dot(twist.head<3>()) / twist.head<3>().squaredNorm();
      beyond = std::max(beyond, along - 1.0);
      if (time < 1.0 - 0.5 * options.stop_time) CHECK(target.status == ActionStatus::Tracking);
      if (time > 1.0 - 0.4 * options.stop_time && time < 1.0) CHECK(target.status == ActionStatus::Late);
      if (time > 1.001 + 0.5 * options.stop_time) CHECK(target.status == ActionStatus::Starved);
    }
    CHECK(beyond < 1e-9);
    CHECK(pose_error(target.pose, poses.back()).norm() < 1e-9);
    CHECK(target.twist.norm() < 1e-9);
    CHECK(target.left < 0.0);
  }
}

TEST_CASE("whatever was sent before, the target rests in the end") {
  Random random(5);
  for (int trial = 0; trial < 300; ++trial) {
    ActionChunksOptions options;
    options.dt_action = random.uniform(0.02, 0.2);
    ActionChunks chunks(options);
    chunks.reset(random.pose(0.5));
    for (const Sent& chunk : schedule(random, options, 2.0)) {
      chunks.at(chunk.at);
      send(chunks, chunk);
    }
    ActionTarget target;
    for (int cycle = 0; cycle < 6000; ++cycle) target = chunks.at(2.5 + 2e-3 * cycle);
    CHECK(target.twist.norm() < 1e-6);
    CHECK(target.behind.norm() < 1e-6);
    CHECK(target.status == ActionStatus::Starved);
  }
}

TEST_CASE("a chunk from elsewhere is told as blending until it is reached") {
  ActionChunks chunks;
  chunks.reset(Pose::Identity());
  Pose there = Pose::Identity();
  there.translation()[0] = 0.1;
  chunks.at(0.0);
  chunks.push(0.0, Poses(30, there));
  CHECK(chunks.at(1e-3).status == ActionStatus::Blending);
  CHECK(chunks.at(2e-3).behind[0] > 0.099);
  for (int cycle = 3; cycle < 1500; ++cycle) chunks.at(1e-3 * cycle);
  const ActionTarget target = chunks.at(1.5);
  CHECK(target.status == ActionStatus::Tracking);
  CHECK(std::abs(target.pose.translation()[0] - 0.1) < 1e-4);
}

TEST_CASE("a chunk for later waits for its time, and those before it are played meanwhile") {
  ActionChunksOptions options;
  options.first = 0.3;
  ActionChunks chunks(options);
  Pose pose = Pose::Identity();
  chunks.reset(pose);
  chunks.at(0.0);
  for (int k = 0; k < 3; ++k) {  // all come before the first is due
    pose.translation()[0] = 0.01 * (k + 1);
    CHECK(chunks.push(0.1 * k, Poses(20, pose)) == ChunkStatus::Accepted);
  }
  CHECK(chunks.at(0.2).status == ActionStatus::Waiting);
  CHECK(chunks.at(0.31).age == doctest::Approx(0.31));
  CHECK(chunks.at(0.41).age == doctest::Approx(0.31));
  CHECK(chunks.at(0.51).age == doctest::Approx(0.31));
  CHECK(chunks.at(0.90).age == doctest::Approx(0.70));
}

TEST_CASE("chunks that cannot be used are refused, counted and change nothing") {
  ActionChunksOptions options;
  options.max_actions = 4;
  ActionChunks chunks(options);
  const Poses good(4, Pose::Identity());
  chunks.reset(Pose::Identity());
  chunks.at(1.0);
  CHECK(chunks.push(1.0, good) == ChunkStatus::Accepted);
  CHECK(chunks.push(1.0, good) == ChunkStatus::OutOfOrder);
  CHECK(chunks.push(0.9, good) == ChunkStatus::OutOfOrder);
  CHECK(chunks.push(1.1, Poses(5, Pose::Identity())) == ChunkStatus::Invalid);
  CHECK(chunks.push(1.1, Poses()) == ChunkStatus::Invalid);
  CHECK(chunks.push(kNan, good) == ChunkStatus::Invalid);
  CHECK(chunks.push(1e300, good) == ChunkStatus::Invalid);
  Poses bad = good;
  bad[2].matrix()(0, 0) = 2.0;
  CHECK(chunks.push(1.1, bad) == ChunkStatus::Invalid);
  bad = good;
  bad[3].matrix()(0, 3) = kNan;
  CHECK(chunks.push(1.1, bad) == ChunkStatus::Invalid);
  CHECK(chunks.push_twists(1.1, std::vector<Twist>(3, Twist::Constant(kNan))) == ChunkStatus::Invalid);
  chunks.at(5.0);
  CHECK(chunks.push(4.0, good) == ChunkStatus::Expired);
  const ChunkCounts counts = chunks.counts();
  CHECK(counts.accepted == 1);
  CHECK(counts.out_of_order == 2);
  CHECK(counts.invalid == 7);
  CHECK(counts.expired == 1);
  CHECK(chunks.at(5.1).pose.matrix() == Eigen::Matrix4d::Identity());
  for (const double wrong : {0.0, -1.0, kNan}) {
    CHECK_THROWS_AS(ActionChunks({.dt_action = wrong}), Error);
    CHECK_THROWS_AS(ActionChunks({.max_speed = wrong}), Error);
  }
  CHECK_THROWS_AS(ActionChunks({.stop_time = -1.0}), Error);
  CHECK_THROWS_AS(ActionChunks({.max_actions = 0}), Error);
}

TEST_CASE("stamps and times of another clock: refused or begun anew, the target stays, and later chunks are followed") {
  const auto along_x = [](double from) {
    Poses poses(8, Pose::Identity());
    for (std::size_t i = 0; i < poses.size(); ++i) poses[i].translation()[0] = from + 0.03 * static_cast<double>(i);
    return poses;
  };
  SUBCASE("a stamp of the future") {
    ActionChunks chunks;
    chunks.reset(Pose::Identity());
    CHECK(chunks.push(3600.0, along_x(0.0)) == ChunkStatus::Accepted);  // nobody has told the time yet
    CHECK(chunks.at(10.0).status == ActionStatus::Waiting);
    CHECK(chunks.push(3600.0, along_x(0.0)) == ChunkStatus::Invalid);
    CHECK(chunks.push(10.0, along_x(0.0)) == ChunkStatus::Accepted);
    CHECK(chunks.at(10.1).status <= ActionStatus::Blending);
    CHECK(chunks.push(10.9, along_x(0.0)) == ChunkStatus::Accepted);  // two clocks that differ a little
  }
  SUBCASE("a clock that goes back") {
    for (const double back : {0.5, 2.0, 1000.0}) {
      CAPTURE(back);
      ActionChunks chunks;
      chunks.reset(Pose::Identity());
      chunks.at(5000.0);
      REQUIRE(chunks.push(5000.0, along_x(0.0)) == ChunkStatus::Accepted);
      ActionTarget last;
      for (int k = 0; k < 400; ++k) last = chunks.at(5000.0 + 1e-3 * k);
      REQUIRE(last.twist[0] > 0.2);
      for (int k = 0; k < 300; ++k) {
        const ActionTarget now = chunks.at(5000.4 - back + 1e-3 * k);
        CHECK(now.twist == Twist::Zero());
        CHECK(now.pose.matrix() == last.pose.matrix());
        if (back > 1.0) CHECK(now.status == ActionStatus::Waiting);
      }
      if (back < 1.0) continue;
      const double time = 5000.4 - back + 0.3;
      CHECK(chunks.push(time, along_x(last.pose.translation()[0])) == ChunkStatus::Accepted);
      for (int k = 0; k < 2000; ++k) last = chunks.at(time + 1e-3 * k);
      CHECK(last.pose.translation()[0] == doctest::Approx(along_x(0.12).back().translation()[0]).epsilon(0.02));
    }
  }
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("push and at use no heap") {
  Random random(6);
  ActionChunksOptions options;
  ActionChunks chunks(options);
  chunks.reset(random.pose());
  const std::vector<Sent> sent = schedule(random, options, 5.0);
  const test::HeapWatch watch;
  std::size_t next = 0;
  for (int cycle = 0; cycle < 5000; ++cycle) {
    for (; next < sent.size() && sent[next].at <= 1e-3 * cycle; ++next) send(chunks, sent[next]);
    chunks.at(1e-3 * cycle);
  }
  CHECK(watch.calls() == 0);
}
#endif
