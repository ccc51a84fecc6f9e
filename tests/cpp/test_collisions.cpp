// Clear of itself and of the world: distances, capsules, and servos that keep the margin.
#include <doctest/doctest.h>

#include <cmath>
#include <map>
#include <string>

#include <sigmaik/sigmaik.hpp>

#include "../../cpp/src/collision_guard.hpp"
#include "../../cpp/src/distances.hpp"
#include "../../cpp/src/link_shapes.hpp"
#include "arms.hpp"
#include "clear_watch.hpp"
#include "configurations.hpp"
#include "heap.hpp"
#include "limit_watch.hpp"
#include "random.hpp"
#include "settling.hpp"

namespace {

using sigmaik::Capsule;
using sigmaik::Chain;
using sigmaik::CollisionOptions;
using sigmaik::Collisions;
using sigmaik::JointVector;
using sigmaik::LinkCapsule;
using sigmaik::Obstacle;
using sigmaik::Pose;
using sigmaik::Servo;
using sigmaik::ServoOptions;
using sigmaik::ServoStep;
using sigmaik::Twist;
using Vector3 = Eigen::Vector3d;

Obstacle random_obstacle(test::Random& random, double size) {
  const Pose pose = random.pose(1.8 * size);
  switch (random.integer(0, 4)) {
    case 0: return Obstacle::sphere(pose.translation(), size * random.uniform(0.05, 0.3));
    case 1:
      return Obstacle::capsule(pose.translation(),
                               pose.translation() + size * random.uniform(0.0, 1.0) * random.unit(3),
                               size * random.uniform(0.03, 0.2));
    case 2:
      return Obstacle::box(
          pose, size * Vector3(random.uniform(0.05, 1.0), random.uniform(0.05, 1.0), random.uniform(0.05, 0.5)));
    case 3: return Obstacle::cylinder(pose, size * random.uniform(0.05, 0.2), size * random.uniform(0.05, 1.0));
    default: break;
  }
  const Vector3 normal = random.unit(3);
  return Obstacle::half_space(-random.uniform(0.5, 1.5) * size * normal, normal);
}

sigmaik::detail::PlacedShape placed(const Obstacle& o) {
  return {o.shape, o.pose.linear(), o.pose.translation(), o.size};
}

// A start that is clear, among obstacles.
struct Case {
  std::vector<Obstacle> obstacles;
  JointVector q;
  double margin;
};

// The capsules of an arm, fitted once.
const std::vector<LinkCapsule>& capsules_of(const Chain& chain) {
  static std::map<std::string, std::vector<LinkCapsule>> known;
  std::vector<LinkCapsule>& capsules = known[chain.urdf()];
  if (capsules.empty()) capsules = Collisions(chain).capsules();
  return capsules;
}

Collisions collisions_of(const Chain& chain, const std::vector<Obstacle>& obstacles, double margin) {
  return Collisions::with_capsules(chain, capsules_of(chain), obstacles, {.margin = margin});
}

Case random_case(test::Random& random, const Chain& chain) {
  for (;;) {
    Case out;
    out.margin = random.chance(0.3) ? 0.0 : random.uniform(0.002, 0.03);
    const int count = random.integer(0, 6);
    for (int i = 0; i < count; ++i) out.obstacles.push_back(random_obstacle(random, chain.characteristic_length()));
    out.q = test::start_of(random, chain, 0.9);
    const Collisions collisions = collisions_of(chain, out.obstacles, out.margin);
    if (collisions.nearest(out.q).distance > out.margin + 1e-6) return out;
  }
}

// The same arm with jerk limits.
Chain with_jerk(const Chain& chain, double per_acceleration) {
  sigmaik::JointLimits limits = chain.limits();
  for (int i = 0; i < chain.dof(); ++i) {
    limits.jerk[i] = per_acceleration * (std::isfinite(limits.acceleration[i]) ? limits.acceleration[i] : 10.0);
  }
  return chain.with_limits(limits);
}

// What a user may send: poses that rest or jump, twists, stops, and no numbers.
ServoStep random_cycle(test::Random& random, Servo& servo, Pose& target, Twist& twist, int& kind) {
  if (random.chance(0.002)) kind = random.integer(0, 3);
  if (random.chance(0.002)) target = sigmaik::pose(servo.chain(), test::sample(random, servo.chain()));
  if (random.chance(0.004)) twist = random.decades(-2.0, 1.0) * random.vector(6);
  if (random.chance(0.001)) return servo.update_twist(Twist::Constant(std::nan("")));
  if (kind == 0) return servo.hold();
  return kind == 1 ? servo.update_twist(twist) : servo.update(target);
}

}  // namespace

TEST_CASE("distances from a segment to every shape are those of another search") {
  test::Random random(1);
  for (int i = 0; i < 3000; ++i) {
    const Obstacle o = random_obstacle(random, 0.5);
    const Vector3 a = random.vector(3), b = random.chance(0.1) ? a : Vector3(random.vector(3));
    const auto found = sigmaik::detail::segment_to_shape(a, b, placed(o));
    const double expected = test::ClearWatch::to_obstacle({a, b}, o);
    CHECK(std::max(found.distance, 0.0) == doctest::Approx(std::max(expected, 0.0)).epsilon(1e-7).scale(1.0));
    CHECK(found.normal.norm() == doctest::Approx(1.0));
    if (!(found.distance > 1e-3)) continue;
    // The distance of the point grows along the normal, by the way.
    const double further = sigmaik::detail::point_distance(placed(o), found.point + 1e-3 * found.normal).distance;
    CHECK(further == doctest::Approx(found.distance + 1e-3).epsilon(1e-9));
  }
}

TEST_CASE("inside a shape the distance is minus the way out") {
  test::Random random(2);
  for (int i = 0; i < 500; ++i) {
    const Obstacle o = random_obstacle(random, 0.5);
    if (o.shape == Obstacle::Shape::HalfSpace) continue;
    const Vector3 point = o.pose * Vector3(0.3 * o.size[0] * Vector3(random.unit(3)));
    const auto found = sigmaik::detail::point_distance(placed(o), point);
    if (!(found.distance < -1e-6)) continue;
    const Vector3 out = point - (found.distance - 1e-9) * found.gradient;
    CHECK(sigmaik::detail::point_distance(placed(o), out).distance == doctest::Approx(0.0).scale(1.0).epsilon(1e-7));
    for (int k = 0; k < 20; ++k) {  // no direction leads out on a shorter way
      const Vector3 other = point - 0.999 * found.distance * Vector3(random.unit(3));
      CHECK(sigmaik::detail::point_distance(placed(o), other).distance < 0.0);
    }
  }
}

TEST_CASE("distances of an arm are those of its links' own transforms") {
  for (const auto& arm : test::arms()) {
    test::Random random(3);
    std::vector<Obstacle> obstacles;
    for (int i = 0; i < 5; ++i) obstacles.push_back(random_obstacle(random, arm.second.characteristic_length()));
    const Collisions collisions(arm.second, obstacles);
    const test::ClearWatch watch(collisions);
    for (int i = 0; i < 50; ++i) {
      const JointVector q = test::sample(random, arm.second);
      const double expected = watch.distance(q), found = collisions.nearest(q).distance;
      CHECK(std::max(found, 0.0) == doctest::Approx(std::max(expected, 0.0)).epsilon(1e-7).scale(1.0));
    }
  }
}

TEST_CASE("capsules cover every shape of their links, and stand out by no more than their excess") {
  for (const auto& arm : test::arms()) {
    const Chain& chain = arm.second;
    const Collisions collisions(chain);
    CHECK(static_cast<int>(collisions.capsules().size()) <= chain.dof() + 3);
    for (const LinkCapsule& c : collisions.capsules()) CHECK(c.excess < 2.0 * c.capsule.radius);
    const test::ClearWatch watch(collisions);
    test::Random random(4);
    const JointVector q = test::sample(random, chain);
    for (const auto& shape : sigmaik::detail::read_shapes(chain, chain.urdf())) {
      const std::string link = shape.segment < 0 ? chain.base()
                                                 : chain.segments()[static_cast<std::size_t>(shape.segment)].link_name;
      bool moved = false;
      const Pose pose = watch.link_pose(q, link, moved) * shape.origin;
      for (int i = 0; i < 60; ++i) {
        const double angle = random.uniform(0.0, 6.3);
        Vector3 p = shape.size[0] * Vector3(random.unit(3));
        if (shape.kind == sigmaik::detail::LinkShape::Kind::Cylinder) {
          p = {shape.size[0] * std::cos(angle), shape.size[0] * std::sin(angle),
               shape.size[1] * (random.chance(0.5) ? 0.5 : -0.5)};
        } else if (shape.kind == sigmaik::detail::LinkShape::Kind::Box) {
          p = 0.5 * shape.size.cwiseProduct(
                        Vector3(random.chance(0.5) ? 1 : -1, random.chance(0.5) ? 1 : -1, random.chance(0.5) ? 1 : -1));
        }
        double least = 1.0;
        for (const LinkCapsule& c : collisions.capsules()) {
          bool with = false;
          const Pose at = watch.link_pose(q, c.link, with);
          const auto found = sigmaik::detail::segment_to_segment(pose * p, pose * p, at * c.capsule.a,
                                                                 at * c.capsule.b);
          least = std::min(least, found.distance - c.capsule.radius);
        }
        CHECK(least < 1e-9);
      }
    }
  }
}

TEST_CASE("rows are the derivatives of distances") {
  const Chain& chain = test::arms().at("ufactory_xarm7");
  test::Random random(5);
  int seen = 0;
  for (int i = 0; i < 400; ++i) {
    const Obstacle o = random_obstacle(random, 0.5);
    const std::vector<LinkCapsule> ball{{"flange", {Vector3(0.02, 0.0, 0.05), Vector3(0.02, 0.0, 0.05), 0.04}}};
    const Collisions collisions = Collisions::with_capsules(chain, ball, {o}, {.margin = 0.0});
    const JointVector q = test::sample(random, chain);
    sigmaik::LimitTracker tracker(chain.limits());
    tracker.reset(q);
    sigmaik::detail::CollisionGuard guard(collisions.model(), 10.0);
    guard.look(q, 0.0);
    if (!(guard.clearance() > 1e-3)) continue;
    const JointVector qdot = 50.0 * JointVector(random.vector(7));
    if (guard.allows(qdot, tracker)) continue;
    REQUIRE(guard.rows() == 1);
    ++seen;
    for (int k = 0; k < 7; ++k) {
      constexpr double kStep = 1e-6;
      JointVector up = q, down = q;
      up[k] += kStep;
      down[k] -= kStep;
      const double slope = (collisions.nearest(up).distance - collisions.nearest(down).distance) / (2.0 * kStep);
      CHECK(guard.row(0)[k] == doctest::Approx(-slope).scale(1.0).epsilon(2e-5));
    }
  }
  CHECK(seen > 60);
}

TEST_CASE("whatever is sent, no pair comes nearer than the margin, and limits hold") {
  for (const char* name : {"ufactory_xarm7", "franka_panda", "ur10"}) {
    long held = 0;
    for (unsigned seed = 0; seed < 4; ++seed) {
      test::Random random(100 + seed);
      const Chain& arm = test::arms().at(name);
      const Chain chain = seed % 2 == 0 ? arm : with_jerk(arm, random.decades(0.5, 2.5));
      const Case c = random_case(random, chain);
      const Collisions collisions = collisions_of(chain, c.obstacles, c.margin);
      const test::ClearWatch watch(collisions);
      ServoOptions options{.dt = random.chance(0.5) ? 1e-3 : random.uniform(1e-3, 8e-3)};
      options.on_limit = random.chance(0.7) ? sigmaik::OnLimit::Redistribute : sigmaik::OnLimit::Scale;
      options.collisions = collisions;
      Servo servo(chain, sigmaik::JParse{}, options);
      servo.reset(c.q);
      test::LimitWatch limits(chain.limits(), options.dt, JointVector::Zero(chain.dof()));
      Pose target = servo.tip();
      Twist twist = random.vector(6);
      int kind = 2;
      for (int i = 0; i < 1500; ++i) {
        const ServoStep step = random_cycle(random, servo, target, twist, kind);
        limits.step(step);
        if (step.limited_by_collisions) ++held;
        if (i % (step.clearance > c.margin + 5e-3 ? 32 : 4) != 0) continue;
        const double distance = watch.distance(step.q);
        if (!(distance >= c.margin - 1e-8))
          FAIL_CHECK(name << ", seed " << seed << ", cycle " << i << ": " << distance);
        CHECK(std::max(step.clearance, 0.0) == doctest::Approx(std::max(distance, 0.0)).scale(1.0).epsilon(1e-6));
      }
      CHECK(limits.broken == 0);
    }
    CHECK(held > 100);
  }
}

TEST_CASE("towards a target that rests the arm comes to rest, and arrives where its own way is clear") {
  int free = 0, arrived = 0;
  for (const char* name : {"ufactory_xarm7", "franka_panda", "ur10"}) {
    const Chain& chain = test::arms().at(name);
    for (unsigned seed = 0; seed < 6; ++seed) {
      test::Random random(200 + seed);
      const Case c = random_case(random, chain);
      const Collisions collisions = collisions_of(chain, c.obstacles, c.margin);
      ServoOptions options{.dt = 4e-3};
      Servo plain(chain, sigmaik::JParse{}, options);
      options.collisions = collisions;
      Servo servo(chain, sigmaik::JParse{}, options);
      servo.reset(c.q);
      plain.reset(c.q);
      const Pose target = sigmaik::pose(chain, test::near(random, chain, c.q, 0.5));
      double clear = 1.0;
      ServoStep step, alone;
      const int cycles = static_cast<int>((servo.settling_time() + 10.0) / options.dt);
      for (int i = 0; i < cycles; ++i) {
        step = servo.update(target);
        alone = plain.update(target);
        clear = std::min(clear, collisions.nearest(alone.q).distance);
      }
      CHECK(test::at_rest(chain, step.qdot));
      if (!(alone.pose_error.norm() < 1e-3 && clear > c.margin + 0.03)) continue;
      ++free;
      if (step.pose_error.norm() < 1e-3) ++arrived;
    }
  }
  CHECK(free > 0);
  CHECK(arrived == free);
}

TEST_CASE("a start inside the margin leads outwards, and no pair comes nearer than it was") {
  const Chain& chain = test::arms().at("kuka_lbr_iiwa_14_r820");
  int seen = 0;
  for (unsigned seed = 0; seed < 40 && seen < 12; ++seed) {
    test::Random random(300 + seed);
    const JointVector q = test::start_of(random, chain, 0.7);
    const Pose tip = sigmaik::pose(chain, q);
    // A ball that overlaps the margin around the flange.
    const Vector3 away = random.unit(3);
    const double gap = random.uniform(-0.01, 0.025);
    const Collisions bare = collisions_of(chain, {}, 0.01);
    if (!(bare.nearest(q).distance > 0.04)) continue;
    const Vector3 center = tip.translation() + 0.15 * away;
    double reach = 1.0;
    for (const LinkCapsule& c : bare.capsules()) {
      bool moved = false;
      const Pose at = test::ClearWatch(bare).link_pose(q, c.link, moved);
      if (!moved) continue;
      reach = std::min(
          reach, sigmaik::detail::segment_to_segment(center, center, at * c.capsule.a, at * c.capsule.b).distance -
                     c.capsule.radius);
    }
    if (!(reach - gap > 0.01)) continue;
    ++seen;
    const Collisions collisions = collisions_of(chain, {Obstacle::sphere(center, reach - gap)}, 0.03);
    ServoOptions options;
    options.collisions = collisions;
    Servo servo(chain, sigmaik::JParse{}, options);
    servo.reset(q);
    double last = collisions.nearest(q).distance;
    CHECK(last == doctest::Approx(gap).scale(1.0).epsilon(1e-9));
    for (int i = 0; i < 4000; ++i) {
      const ServoStep step = servo.update(tip);
      CHECK(step.clearance > gap - 1e-4);
      last = step.clearance;
    }
    CHECK(last > 0.03);
  }
  CHECK(seen >= 6);
}

TEST_CASE("a ball that comes towards a resting tool, as it was told, is let through: the arm moves away in time") {
  int frozen = 0, seen = 0;
  for (const char* name : {"ufactory_xarm7", "franka_panda", "ur10", "kuka_lbr_iiwa_14_r820"}) {
    const Chain& chain = test::arms().at(name);
    test::Random random(17);
    for (int trial = 0; trial < 30; ++trial) {
      CAPTURE(name);
      CAPTURE(trial);
      const JointVector q = test::start_of(random, chain, 0.5);
      const Pose tip = sigmaik::pose(chain, q);
      Vector3 direction = random.unit(3);
      direction = (direction - (trial % 2 == 0 ? 1.0 : 0.5) * direction.z() * Vector3::UnitZ()).normalized();
      const double speed = random.uniform(0.05, 0.2);
      Pose ball = Pose::Identity();
      ball.translation() = tip.translation() - 0.4 * direction;
      Twist twist = Twist::Zero();
      twist.head<3>() = speed * direction;
      Collisions collisions = collisions_of(chain, {Obstacle::sphere(ball.translation(), 0.05)}, 0.02);
      if (!(collisions.nearest(q).distance > 0.03)) continue;
      ++seen;
      ServoOptions options;
      options.collisions = collisions;
      Servo servo(chain, sigmaik::JParse{}, options);
      servo.reset(q);
      double least = 1.0;
      for (int i = 0; i < static_cast<int>(0.7 / speed / options.dt); ++i) {
        ball.translation() += speed * options.dt * direction;
        collisions.move(0, ball, twist);
        const ServoStep step = servo.update_twist(Twist::Zero());
        least = std::min(least, step.clearance);
        frozen += step.clearance < 0.019 && step.qdot.isZero(0.0) ? 1 : 0;
      }
      INFO("least ", least);
      CHECK(least > 0.015);
    }
  }
  CHECK(frozen == 0);
  CHECK(seen >= 20);
}

TEST_CASE("far from everything the command is that of a servo without collisions, to the last digit") {
  const Chain& chain = test::arms().at("ufactory_xarm7");
  const JointVector q = (JointVector(7) << 0.1, -0.6, 0.0, 0.9, 0.1, 1.3, 0.2).finished();
  ServoOptions options;
  Servo plain(chain, sigmaik::JParse{}, options);
  options.collisions = Collisions(chain, {Obstacle::sphere({3.0, 0.0, 0.0}, 0.1)}, {.self_collision = false});
  Servo servo(chain, sigmaik::JParse{}, options);
  plain.reset(q);
  servo.reset(q);
  Pose target = servo.tip();
  target.translation() += Vector3(0.05, 0.05, 0.05);
  for (int i = 0; i < 500; ++i) {
    const ServoStep a = plain.update(target), b = servo.update(target);
    REQUIRE(b.clearance > 1.0);
    CHECK(a.qdot == b.qdot);
    CHECK(std::isinf(a.clearance));
  }
}

TEST_CASE("an object that the arm carries keeps clear of a table, from attach to detach") {
  const Chain& chain = test::arms().at("ufactory_xarm7");
  const JointVector q = (JointVector(7) << 0.1, -0.2, 0.0, 0.9, 0.1, 1.1, 0.2).finished();
  ServoOptions options{.dt = 2e-3};
  const Pose tip = sigmaik::pose(chain, q);
  Obstacle table = Obstacle::half_space({0.0, 0.0, tip.translation()[2] - 0.35}, {0.0, 0.0, 1.0});
  table.links = {"flange"};
  Collisions collisions(chain, {table}, {.self_collision = false});
  options.collisions = collisions;
  Servo servo(chain, sigmaik::JParse{}, options);
  servo.reset(q);
  collisions.attach({{Vector3(0.0, 0.0, 0.0), Vector3(0.0, 0.0, 0.2), 0.03}});
  Pose target = tip;
  target.translation()[2] -= 0.4;
  const auto lowest = [&](const ServoStep& step) {
    return (sigmaik::pose(chain, step.q) * Vector3(0.0, 0.0, 0.2))[2] - 0.03 - (tip.translation()[2] - 0.35);
  };
  ServoStep step;
  for (int i = 0; i < 3000; ++i) {
    step = servo.update(target);
    if (i > 0) CHECK(lowest(step) > 0.01 - 1e-9);
  }
  CHECK(lowest(step) < 0.02);
  CHECK(collisions.body_names()[static_cast<std::size_t>(step.nearest[0])] == "carried 1");
  const double with = step.pose_error.norm();
  collisions.detach();
  for (int i = 0; i < 3000; ++i) step = servo.update(target);
  CHECK(step.pose_error.norm() < with - 0.1);
}

TEST_CASE("set-up refuses what makes no sense, with the facts") {
  const Chain& chain = test::arms().at("ur10");
  const auto fails = [](const auto& make, const char* text) {
    try {
      make();
      FAIL_CHECK("no error: " << text);
    } catch (const sigmaik::Error& e) {
      if (std::string(e.what()).find(text) == std::string::npos) FAIL_CHECK(e.what() << " lacks " << text);
    }
  };
  fails([&] { Collisions(chain, {}, {.margin = -1.0}); }, "margin = -1 m");
  fails([&] { Collisions(chain, {Obstacle::sphere({0.0, 0.0, 0.0}, -1.0)}); }, "obstacle 0: radius = -1 m");
  fails([&] { Collisions(chain, {}, {.ignore = {{"no", "such"}}}); }, "no link 'no'");
  fails([&] { Collisions(chain, std::vector<Obstacle>(40, Obstacle::sphere({9.0, 0.0, 0.0}, 0.1))); }, "at most 32");
  Collisions collisions(chain);
  fails([&] { collisions.move(0, Pose::Identity()); }, "no obstacle 0");
  fails([&] { collisions.attach(std::vector<Capsule>(5)); }, "at most 4");
  ServoOptions options;
  options.collisions = collisions;
  fails([&] { Servo(test::arms().at("franka_panda"), sigmaik::JParse{}, options); }, "another arm");
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("cycles among obstacles, and moves of these, need no heap") {
  const Chain& chain = test::arms().at("franka_panda");
  test::Random random(6);
  const Case c = random_case(random, chain);
  std::vector<Obstacle> obstacles = c.obstacles;
  obstacles.push_back(Obstacle::box(random.pose(0.7), {0.1, 0.1, 0.1}));
  ServoOptions options;
  options.collisions = collisions_of(chain, obstacles, c.margin);
  Servo servo(chain, sigmaik::JParse{}, options);
  servo.reset(c.q);
  const Pose target = sigmaik::pose(chain, test::sample(random, chain)), place = random.pose(0.8);
  const std::vector<Capsule> object{{Eigen::Vector3d::Zero(), {0.0, 0.0, 0.1}, 0.03}};
  options.collisions->attach(object);
  const test::HeapWatch watch;
  for (int i = 0; i < 1000; ++i) {
    if (i % 100 == 50) options.collisions->move(static_cast<int>(obstacles.size()) - 1, place);
    servo.update(target);
  }
  CHECK(watch.calls() == 0);
}
#endif
