#include <doctest/doctest.h>

#include <functional>
#include <limits>

#include <sigmaik/error.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/planning/collision_costs.hpp>
#include <sigmaik/planning/costs.hpp>

#include "arms.hpp"
#include "heap.hpp"
#include "oracles.hpp"
#include "random.hpp"

using namespace sigmaik;
using namespace sigmaik::planning;
using Eigen::Vector3d;
using test::Random;

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

DistanceField sampled(const std::function<double(const Vector3d&)>& distance, const DistanceField::Shape& shape,
                      const Vector3d& origin, double cell) {
  std::vector<double> values;
  for (int x = 0; x < shape[0]; ++x) {
    for (int y = 0; y < shape[1]; ++y) {
      for (int z = 0; z < shape[2]; ++z) values.push_back(distance(origin + cell * Vector3d(x, y, z)));
    }
  }
  return DistanceField(values, shape, origin, cell);
}

// Two balls in a room of 2 m.
double balls(const Vector3d& p) {
  return std::min((p - Vector3d(0.5, 0.1, 0.4)).norm() - 0.25, (p - Vector3d(-0.3, -0.4, 0.6)).norm() - 0.2);
}
DistanceField room(double cell = 0.02) {
  const int n = static_cast<int>(std::lround(2.0 / cell)) + 1;
  return sampled(balls, {n, n, n}, Vector3d(-1.0, -1.0, -0.5), cell);
}

Vector3d in_box(Random& random, const Vector3d& low, const Vector3d& high) {
  return Vector3d::NullaryExpr([&](Eigen::Index i) { return random.uniform(low[i], high[i]); });
}

// Some spheres on every link, the base's too.
ArmSpheres random_spheres(Random& random, const Chain& chain) {
  std::vector<LinkSphere> spheres;
  for (int s = -1; s < static_cast<int>(chain.segments().size()); ++s) {
    for (int i = random.integer(0, 2); i >= 0; --i) {
      spheres.push_back({s, 0.3 * random.vector(3), random.uniform(0.01, 0.1)});
    }
  }
  return ArmSpheres(chain, spheres);
}

JointVector differences(const JointVector& q, const std::function<double(const JointVector&)>& value, double step) {
  JointVector out(q.size());
  for (int k = 0; k < q.size(); ++k) {
    JointVector up = q, down = q;
    up[k] += step;
    down[k] -= step;
    out[k] = (value(up) - value(down)) / (2.0 * step);
  }
  return out;
}

// The arm up to a segment's link.
Chain up_to(const Chain& chain, int segment) {
  const auto& all = chain.segments();
  return Chain(chain.base(), {all.begin(), all.begin() + segment + 1});
}

}  // namespace

TEST_CASE("the field at its nodes, between them and outside") {
  Random random(1);
  for (const double cell : {0.1, 0.05, 0.02}) {
    const DistanceField field = room(cell);
    for (int trial = 0; trial < 20000; ++trial) {
      const Vector3d p = in_box(random, {-1.0, -1.0, -0.5}, {1.0, 1.0, 1.5});
      // Distances are 1-Lipschitz, and √(Σ w_i |p − n_i|²) ≤ √3/2 cells.
      REQUIRE(std::abs(field.distance(p) - balls(p)) < 0.5 * std::sqrt(3.0) * cell);
    }
    for (int trial = 0; trial < 1000; ++trial) {
      const Vector3d cells(random.integer(0, field.shape()[0] - 1), random.integer(0, field.shape()[1] - 1),
                           random.integer(0, field.shape()[2] - 1));
      const Vector3d node = field.origin() + cell * cells;
      REQUIRE(field.distance(node) == doctest::Approx(balls(node)).epsilon(1e-6));
    }
    // Outside, the field is a lower bound of the distance to the obstacles in the grid, and the bound grows.
    for (int trial = 0; trial < 20000; ++trial) {
      const Vector3d p = in_box(random, {-3.0, -3.0, -3.0}, {3.0, 3.0, 3.0});
      const double d = field.distance(p);
      REQUIRE(d < balls(p) + 0.5 * std::sqrt(3.0) * cell);
      const Vector3d nearest = p.cwiseMax(Vector3d(-1.0, -1.0, -0.5)).cwiseMin(Vector3d(1.0, 1.0, 1.5));
      const double there = field.distance(nearest), way = (p - nearest).norm();
      REQUIRE(d >= (way > 0.0 ? std::max(there, way) : there) - 1e-12);
      REQUIRE(std::abs(field.distance(p + Vector3d(1e-9, -1e-9, 1e-9)) - d) < 4e-9);
    }
  }
}

TEST_CASE("where the grid cuts an obstacle off, outside is continuous and becomes free") {
  const DistanceField floor = sampled([](const Vector3d& p) { return p.z(); }, {5, 5, 5}, {-0.2, -0.2, -0.2}, 0.1);
  CHECK(floor.distance({0.05, 0.0, -0.15}) == doctest::Approx(-0.15).epsilon(1e-6));
  double last = floor.distance({0.0, 0.0, -0.2});
  CHECK(last == doctest::Approx(-0.2).epsilon(1e-6));
  for (double z = -0.2; z > -1.0; z -= 1e-3) {
    const double d = floor.distance({0.0, 0.0, z});
    CHECK(d >= last - 1e-12);
    CHECK(d < last + 1.1e-3);
    last = d;
  }
  CHECK(last > 0.5);
}

TEST_CASE("the field's gradient is the slope of its distance") {
  Random random(2);
  const DistanceField field = room(0.05);
  int outside = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    const Vector3d p = in_box(random, {-1.5, -1.5, -1.0}, {1.5, 1.5, 2.0});
    Vector3d gradient, expected;
    const double d = field.distance(p, gradient);
    REQUIRE(d == doctest::Approx(field.distance(p)).epsilon(1e-12));
    // The step does not cross a cell's face.
    const Eigen::Array3d cells = (p - field.origin()).array() / field.cell();
    if (((cells - cells.round()).abs() < 1e-4).any()) continue;
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3d step = 1e-6 * Vector3d::Unit(axis);
      expected[axis] = (field.distance(p + step) - field.distance(p - step)) / 2e-6;
    }
    REQUIRE((gradient - expected).cwiseAbs().maxCoeff() < 1e-7);
    if ((cells < 0.0).any() || (cells > 40.0).any()) ++outside;
  }
  CHECK(outside > 1000);
}

TEST_CASE("centres are where the links are") {
  Random random(3);
  std::vector<Chain> chains;
  for (int n = 1; n <= kMaxJoints; ++n) chains.push_back(random.chain(n, 0.3));
  for (const auto& [name, arm] : test::arms()) chains.push_back(arm);
  for (const Chain& chain : chains) {
    const ArmSpheres spheres = random_spheres(random, chain);
    SphereState state, up, down;
    PointJacobian jacobian;
    JointVector row(chain.dof());
    for (int trial = 0; trial < 50; ++trial) {
      const JointVector q = random.configuration(chain.dof());
      REQUIRE(spheres.update(q, state));
      for (int i = 0; i < spheres.size(); ++i) {
        const LinkSphere& sphere = spheres.spheres()[static_cast<std::size_t>(i)];
        const auto& center = state.center[static_cast<std::size_t>(i)];
        if (sphere.segment < 0 || chain.segments()[0].type == JointType::Fixed) {
          if (sphere.segment < 0) REQUIRE(center == sphere.center);
          continue;
        }
        const Chain part = up_to(chain, sphere.segment);
        REQUIRE(part.dof() == spheres.joints(i));
        REQUIRE((pose(part, q.head(part.dof())) * sphere.center - center).cwiseAbs().maxCoeff() < 1e-13);
      }
      for (int k = 0; k < chain.dof(); ++k) {
        JointVector moved = q;
        moved[k] += 1e-6;
        spheres.update(moved, up);
        moved[k] -= 2e-6;
        spheres.update(moved, down);
        for (int i = 0; i < spheres.size(); ++i) {
          const std::size_t at = static_cast<std::size_t>(i);
          spheres.jacobian(i, state, jacobian);
          REQUIRE((jacobian.col(k) - (up.center[at] - down.center[at]) / 2e-6).cwiseAbs().maxCoeff() < 1e-7);
          const Vector3d direction = random.vector(3);
          spheres.row(i, state, direction, row);
          if (k < spheres.joints(i)) REQUIRE(std::abs(row[k] - direction.dot(jacobian.col(k))) < 1e-12);
        }
      }
    }
    CHECK_FALSE(spheres.update(JointVector::Constant(chain.dof(), kNaN), state));
    CHECK_FALSE(spheres.update(JointVector::Zero(chain.dof() - 1), state));
  }
}

TEST_CASE("a URDF's shapes are covered whole, and not by much more") {
  Random random(4);
  const std::string xml = R"(<robot name="r">
    <link name="base"><visual><geometry><sphere radius="0.2"/></geometry></visual></link>
    <joint name="j1" type="continuous"><parent link="base"/><child link="l1"/><axis xyz="0 0 1"/></joint>
    <link name="l1">
      <collision><origin xyz="0.1 -0.2 0.3" rpy="0.3 -0.4 0.5"/><geometry><cylinder radius="0.07" length="0.5"/></geometry></collision>
      <collision><geometry><sphere radius="0.01"/></geometry></collision>
      <visual><geometry><box size="5 5 5"/></geometry></visual>
    </link>
    <joint name="j2" type="continuous"><parent link="l1"/><child link="l2"/><origin xyz="0 0.3 0"/><axis xyz="1 0 0"/></joint>
    <link name="l2">
      <collision><origin xyz="0 0 0.1" rpy="0 0.7 0"/><geometry><box size="0.3 0.1 0.06"/></geometry></collision>
    </link>
    <joint name="hold" type="fixed"><parent link="l2"/><child link="tool"/><origin xyz="0 0 0.4" rpy="1 0 0"/></joint>
    <link name="tool">
      <collision><origin xyz="0 0.1 0"/><geometry><cylinder radius="0.02" length="0.001"/></geometry></collision>
    </link>
    <joint name="finger" type="prismatic"><parent link="tool"/><child link="jaw"/><limit lower="0" upper="1" velocity="1" effort="1"/></joint>
    <link name="jaw"><collision><geometry><sphere radius="9"/></geometry></collision></link>
    <joint name="j3" type="continuous"><parent link="l2"/><child link="l3"/><origin xyz="0.2 0 0"/></joint>
    <link name="l3"><visual><geometry><mesh filename="package://no.stl"/></geometry></visual></link>
    <joint name="end" type="fixed"><parent link="l3"/><child link="tip"/><origin xyz="0 0 0.25"/></joint>
    <link name="tip"/>
  </robot>)";
  const Chain chain = Chain::from_urdf(xml, "base", "tip");
  const ArmSpheres spheres = ArmSpheres::from_urdf(chain, xml, 0.05);
  int on[5] = {};
  for (const LinkSphere& s : spheres.spheres()) ++on[s.segment + 1];
  CHECK(on[0] == 1);  // the visual, where there is no collision shape
  CHECK(on[1] == 9);  // ⌈0.5/0.07⌉ = 8, and the small sphere
  CHECK(on[2] == 4);  // a box of 3×1×1, and the tool beside the arm; not the finger
  CHECK(on[3] == 5);  // 0.25 m in steps of 0.05 m
  CHECK(on[4] == 0);  // no shape
  CHECK(spheres.first_moving() == 1);
  const auto covered = [&](int segment, const Vector3d& p) {
    double least = 1.0;
    for (const LinkSphere& s : spheres.spheres()) {
      if (s.segment == segment) least = std::min(least, (s.center - p).norm() - s.radius);
    }
    return least < 1e-12;
  };
  const auto turned = [](double angle, const Vector3d& axis) {
    return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
  };
  const Eigen::Matrix3d rpy = turned(0.5, Vector3d::UnitZ()) * turned(-0.4, Vector3d::UnitY()) *
                              turned(0.3, Vector3d::UnitX());
  for (int trial = 0; trial < 20000; ++trial) {
    const double angle = random.uniform(-M_PI, M_PI);
    const Vector3d rim(0.07 * std::cos(angle), 0.07 * std::sin(angle), random.uniform(-0.25, 0.25));
    REQUIRE(covered(0, Vector3d(0.1, -0.2, 0.3) + rpy * rim));
    const Vector3d inside = in_box(random, {-0.15, -0.05, -0.03}, {0.15, 0.05, 0.03});
    REQUIRE(covered(1, Vector3d(0.0, 0.0, 0.1) + turned(0.7, Vector3d::UnitY()) * inside));
    const Vector3d disc(0.02 * std::cos(angle), 0.02 * std::sin(angle), 0.0);
    REQUIRE(covered(1, Vector3d(0.0, 0.0, 0.4) + turned(1.0, Vector3d::UnitX()) * (Vector3d(0.0, 0.1, 0.0) + disc)));
  }
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    const ArmSpheres found = ArmSpheres::from_urdf(arm, SIGMAIK_ROBOTS_DIR "/" + name + ".urdf");
    CAPTURE(name);
    CHECK(found.size() >= 20);
    CHECK(found.size() <= 90);
    for (const LinkSphere& s : found.spheres()) CHECK(s.radius < 0.15);
  }
}

TEST_CASE("along the links: no gap wider than the radius, from the base to the tip") {
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    CAPTURE(name);
    const ArmSpheres spheres = ArmSpheres::along_links(arm, 0.04);
    SphereState state;
    spheres.update(JointVector::Zero(arm.dof()), state);
    CHECK(state.center[0].isZero());
    const auto& last = state.center[static_cast<std::size_t>(spheres.size() - 1)];
    CHECK((last - pose(arm, JointVector::Zero(arm.dof())).translation()).norm() < 1e-12);
    for (std::size_t i = 1; i < static_cast<std::size_t>(spheres.size()); ++i) {
      CHECK((state.center[i] - state.center[i - 1]).norm() < 0.04 + 1e-9);
    }
  }
}

TEST_CASE("collision cost: CHOMP's hinge of every moving sphere, with its gradient and Hessian") {
  Random random(5);
  const DistanceField field = room(0.05);
  for (const double clearance : {0.05, 0.4}) {
    double deepest = 1.0;
    int checked = 0;
    for (int trial = 0; trial < 400; ++trial) {
      const int n = random.integer(1, 9);
      const Chain chain = random.chain(n, 0.3, 0.3);
      const ArmSpheres spheres = random_spheres(random, chain);
      const JointCostPtr cost = collision_cost(spheres, field, clearance, 3.0);
      const JointVector q = random.configuration(n);
      SphereState state;
      spheres.update(q, state);
      double expected = 0.0, least = 1e9;
      bool smooth = true;
      JointVector row(n), slope = JointVector::Zero(n);
      JointMatrix curvature = JointMatrix::Zero(n, n);
      for (int i = 0; i < spheres.size(); ++i) {
        if (spheres.joints(i) == 0) continue;
        Vector3d gradient;
        PointJacobian jacobian;
        const Vector3d& center = state.center[static_cast<std::size_t>(i)];
        const double d = field.distance(center, gradient) - spheres.radius(i), e = clearance;
        least = std::min(least, d);
        const Eigen::Array3d cells = (center - field.origin()).array() / field.cell();
        smooth = smooth && ((cells - cells.round()).abs() > 1e-3).all();
        if (d >= e) continue;
        spheres.jacobian(i, state, jacobian);
        row = jacobian.transpose() * gradient;
        expected += d < 0.0 ? 0.5 * e - d : (e - d) * (e - d) / (2.0 * e);
        slope += (d < 0.0 ? -1.0 : (d - e) / e) * row;
        curvature += (d < 0.0 ? 1.0 / (e - d) : 1.0 / e) * row * row.transpose();
      }
      deepest = std::min(deepest, least);
      JointVector g(n), g2(n);
      JointMatrix h(n, n);
      const double value = cost->value(q);
      REQUIRE(value == doctest::Approx(3.0 * expected).epsilon(1e-12));
      REQUIRE(cost->model(q, g, h) == doctest::Approx(value).epsilon(1e-12));
      REQUIRE(cost->gradient(q, g2) == doctest::Approx(value).epsilon(1e-12));
      REQUIRE((g - 3.0 * slope).cwiseAbs().maxCoeff() < 1e-11);
      REQUIRE((g - g2).cwiseAbs().maxCoeff() < 1e-12);
      REQUIRE((h - 3.0 * curvature).cwiseAbs().maxCoeff() < 1e-9);
      REQUIRE(test::eigenvalues(h)[0] > -1e-9);
      REQUIRE(min_distance(spheres, field, q) == doctest::Approx(least).epsilon(1e-12));
      if (!smooth) continue;
      ++checked;
      const JointVector by_differences = differences(q, [&](const JointVector& x) { return cost->value(x); }, 1e-6);
      REQUIRE((g - by_differences).cwiseAbs().maxCoeff() < 1e-6 * (1.0 + g.cwiseAbs().maxCoeff()));
    }
    CHECK(checked > 200);
    CHECK(deepest < -0.1);
  }
}

TEST_CASE("where distances are linear in q, the Hessian is the true one") {
  // A cart on three rails before a wall: d = x − r.
  std::vector<Segment> segments;
  for (int i = 0; i < 3; ++i) {
    Segment s;
    s.joint_name = "j" + std::to_string(i);
    s.link_name = "l" + std::to_string(i);
    s.type = JointType::Prismatic;
    s.axis = Vector3d(1.0 + i, 0.5 - i, 0.25 * i);
    segments.push_back(s);
  }
  const Chain chain("base", segments);
  const ArmSpheres spheres(chain, {{2, {0.1, 0.0, 0.0}, 0.05}, {1, {0.2, 0.0, 0.0}, 0.02}});
  const DistanceField wall = sampled([](const Vector3d& p) { return p.x(); }, {11, 3, 3}, {-1.0, -1.0, -1.0}, 1.0);
  const JointCostPtr cost = collision_cost(spheres, wall, 0.5, 2.0);
  const JointVector q = JointVector::Constant(3, 0.01);
  JointVector g(3), g2(3);
  JointMatrix h(3, 3), h2(3, 3);
  REQUIRE(cost->model(q, g, h) > 0.0);
  for (int k = 0; k < 3; ++k) {
    const JointVector column = differences(
        q,
        [&](const JointVector& x) {
          cost->model(x, g2, h2);
          return g2[k];
        },
        1e-5);
    CHECK((h.col(k) - column).cwiseAbs().maxCoeff() < 1e-6);
  }
}

TEST_CASE("self-collision cost") {
  Random random(6);
  int touched = 0;
  std::size_t left_out = 0;
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    CAPTURE(name);
    const ArmSpheres spheres = ArmSpheres::from_urdf(arm, SIGMAIK_ROBOTS_DIR "/" + name + ".urdf");
    const std::vector<SpherePair> pairs = self_collision_pairs(spheres);
    CHECK(pairs == self_collision_pairs(spheres));
    CHECK(pairs.size() > 100);
    // No pair of spheres is near by design: most configurations cost nothing.
    const JointCostPtr narrow = self_collision_cost(spheres, pairs, 0.02);
    int free = 0;
    for (int trial = 0; trial < 200; ++trial) {
      JointVector q(arm.dof());
      for (int j = 0; j < arm.dof(); ++j) {
        q[j] = random.uniform(std::max(arm.limits().lower[j], -M_PI), std::min(arm.limits().upper[j], M_PI));
      }
      if (narrow->value(q) == 0.0) ++free;
    }
    CHECK(free > 60);
    left_out += self_collision_pairs(spheres, 0.02, 1.0).size() - pairs.size();
    const JointCostPtr cost = self_collision_cost(spheres, pairs, 0.05, 2.0);
    const int n = arm.dof();
    for (int trial = 0; trial < 300; ++trial) {
      const JointVector q = random.configuration(n);
      SphereState state;
      spheres.update(q, state);
      double expected = 0.0;
      bool kink = false;
      JointMatrix curvature = JointMatrix::Zero(n, n);
      PointJacobian a, b;
      for (const auto& [i, j] : pairs) {
        CHECK(std::abs(spheres.joints(i) - spheres.joints(j)) >= 2);
        const Vector3d way = state.center[static_cast<std::size_t>(i)] - state.center[static_cast<std::size_t>(j)];
        const double d = way.norm() - spheres.radius(i) - spheres.radius(j);
        if (d >= 0.05) continue;
        expected += d < 0.0 ? 0.025 - d : (0.05 - d) * (0.05 - d) / 0.1;
        spheres.jacobian(i, state, a);
        spheres.jacobian(j, state, b);
        const JointVector row = (a - b).transpose() * way.normalized();
        curvature += row * row.transpose() / std::max(0.05, 0.05 - d);
        kink = kink || way.norm() < 1e-3;
      }
      JointVector g(n), g2(n);
      JointMatrix h(n, n);
      REQUIRE(cost->value(q) == doctest::Approx(2.0 * expected).epsilon(1e-10));
      REQUIRE(cost->model(q, g, h) == doctest::Approx(2.0 * expected).epsilon(1e-10));
      cost->gradient(q, g2);
      REQUIRE((g - g2).cwiseAbs().maxCoeff() == 0.0);
      REQUIRE((h - 2.0 * curvature).cwiseAbs().maxCoeff() < 1e-9 * (1.0 + h.cwiseAbs().maxCoeff()));
      if (expected == 0.0 || kink) continue;
      ++touched;
      const JointVector by_differences = differences(q, [&](const JointVector& x) { return cost->value(x); }, 1e-6);
      REQUIRE((g - by_differences).cwiseAbs().maxCoeff() < 2e-6 * (1.0 + g.cwiseAbs().maxCoeff()));
    }
  }
  CHECK(touched > 100);
  CHECK(left_out > 10);
}

TEST_CASE("spheres on one another: finite, and no force") {
  const Chain& arm = test::arms().at("franka_panda");
  const ArmSpheres spheres(arm, {{-1, Vector3d::Zero(), 0.1}, {3, Vector3d::Zero(), 0.1}});
  JointVector q = JointVector::Constant(7, 0.3);
  SphereState state;
  spheres.update(q, state);
  const ArmSpheres same(arm, {{-1, state.center[1], 0.1}, {3, Vector3d::Zero(), 0.1}});
  JointVector g(7);
  JointMatrix h(7, 7);
  const JointCostPtr cost = self_collision_cost(same, {{0, 1}}, 0.02);
  CHECK(cost->model(q, g, h) == doctest::Approx(0.21));
  CHECK(g.allFinite());
  CHECK(h.allFinite());
}

TEST_CASE("joint-limit cost and sums") {
  Random random(7);
  const Chain& arm = test::arms().at("franka_panda");
  const JointCostPtr limits = joint_limit_cost(arm, 0.3, 5.0);
  const JointCostPtr obstacles = collision_cost(ArmSpheres::along_links(arm), room(0.05), 0.2);
  const JointCostPtr sum = sum_of_costs({limits, obstacles});
  JointVector g(7), g2(7), g3(7);
  JointMatrix h(7, 7), h2(7, 7), h3(7, 7);
  for (int trial = 0; trial < 500; ++trial) {
    const JointVector q = random.configuration(7);
    double expected = 0.0;
    for (int j = 0; j < 7; ++j) {
      const double room = std::min(q[j] - arm.limits().lower[j], arm.limits().upper[j] - q[j]);
      expected += 2.5 * std::pow(std::max(0.0, 0.3 - room), 2);
    }
    const double value = limits->model(q, g, h);
    CHECK(value == doctest::Approx(expected).epsilon(1e-12));
    CHECK(limits->value(q) == doctest::Approx(expected).epsilon(1e-12));
    CHECK((g - differences(
                   q, [&](const JointVector& x) { return limits->value(x); }, 1e-6))
              .cwiseAbs()
              .maxCoeff() < 1e-5);
    for (int k = 0; k < 7; ++k) {
      JointMatrix scratch(7, 7);
      const JointVector column = differences(
          q,
          [&](const JointVector& x) {
            limits->model(x, g2, scratch);
            return g2[k];
          },
          1e-6);
      CHECK((h.col(k) - column).cwiseAbs().maxCoeff() < 1e-5);
    }
    const double other = obstacles->model(q, g2, h2);
    CHECK(sum->model(q, g3, h3) == doctest::Approx(value + other).epsilon(1e-12));
    CHECK((g3 - g - g2).cwiseAbs().maxCoeff() < 1e-12);
    CHECK((h3 - h - h2).cwiseAbs().maxCoeff() < 1e-12);
    CHECK(sum->value(q) == doctest::Approx(value + other).epsilon(1e-12));
    CHECK(sum->gradient(q, g2) == doctest::Approx(value + other).epsilon(1e-12));
    CHECK((g3 - g2).cwiseAbs().maxCoeff() < 1e-12);
  }
  const Chain endless = random.chain(3);  // no limits
  CHECK(joint_limit_cost(endless)->value(JointVector::Constant(3, 1e6)) == 0.0);
}

TEST_CASE("a batch is one by one, whatever the threads") {
  Random random(8);
  const Chain& arm = test::arms().at("kuka_lbr_iiwa_14_r820");
  const ArmSpheres spheres = ArmSpheres::along_links(arm);
  const DistanceField field = room(0.05);
  const std::size_t count = 1003;
  std::vector<double> q;
  for (std::size_t i = 0; i < 7 * count; ++i) q.push_back(random.uniform(-3.0, 3.0));
  for (const JointCostPtr& cost : {collision_cost(spheres, field), joint_limit_cost(arm),
                                   self_collision_cost(spheres, self_collision_pairs(spheres))}) {
    std::vector<double> one(count), two(count), three(count), g1(7 * count), g2(7 * count);
    evaluate(*cost, count, q.data(), one.data(), g1.data(), 1);
    evaluate(*cost, count, q.data(), two.data(), g2.data(), 3);
    evaluate(*cost, count, q.data(), three.data(), nullptr, 2);
    CHECK(one == two);
    CHECK(g1 == g2);
    JointVector slope(7);
    for (std::size_t i = 0; i < count; ++i) {
      const JointVector at = Eigen::Map<const Eigen::VectorXd>(q.data() + 7 * i, 7);
      REQUIRE(cost->value(at) == three[i]);
      REQUIRE(cost->gradient(at, slope) == one[i]);
      REQUIRE(slope == Eigen::Map<const Eigen::VectorXd>(g1.data() + 7 * i, 7));
    }
    CHECK_THROWS_AS(evaluate(*cost, count, q.data(), one.data(), nullptr, 0), Error);
  }
  std::vector<double> one(count), two(count);
  min_distance(spheres, field, count, q.data(), one.data(), 1);
  min_distance(spheres, field, count, q.data(), two.data(), 4);
  CHECK(one == two);
  CHECK(one[7] == min_distance(spheres, field, Eigen::Map<const Eigen::VectorXd>(q.data() + 49, 7)));
  CHECK_THROWS_AS(min_distance(spheres, field, count, q.data(), one.data(), -1), Error);
}

TEST_CASE("what is refused") {
  const std::vector<double> eight(8, 1.0);
  CHECK_THROWS_WITH_AS(DistanceField(eight, {2, 2, 1}, Vector3d::Zero(), 0.1),
                       "the grid has 1 nodes along axis 2; at least 2 are needed", Error);
  CHECK_THROWS_WITH_AS(DistanceField(eight, {2, 2, 3}, Vector3d::Zero(), 0.1),
                       "there are 8 distances for a grid of 2×2×3 = 12 nodes", Error);
  for (const double bad : {0.0, -1.0, kNaN})
    CHECK_THROWS_AS(DistanceField(eight, {2, 2, 2}, Vector3d::Zero(), bad), Error);
  CHECK_THROWS_AS(DistanceField(eight, {2, 2, 2}, Vector3d(0.0, kNaN, 0.0), 0.1), Error);
  std::vector<double> broken = eight;
  broken[5] = kNaN;
  CHECK_THROWS_WITH_AS(DistanceField(broken, {2, 2, 2}, Vector3d::Zero(), 0.1), "distance 5 is not finite", Error);

  const Chain& arm = test::arms().at("ufactory_xarm7");
  const DistanceField field(eight, {2, 2, 2}, Vector3d::Zero(), 0.1);
  CHECK_THROWS_AS(ArmSpheres(arm, {}), Error);
  CHECK_THROWS_AS(ArmSpheres(arm, std::vector<LinkSphere>(kMaxSpheres + 1, {0, Vector3d::Zero(), 0.1})), Error);
  CHECK_THROWS_AS(ArmSpheres(arm, {{-2, Vector3d::Zero(), 0.1}}), Error);
  CHECK_THROWS_AS(ArmSpheres(arm, {{50, Vector3d::Zero(), 0.1}}), Error);
  for (const double bad : {0.0, -0.1, kNaN}) {
    CHECK_THROWS_AS(ArmSpheres(arm, {{0, Vector3d::Zero(), bad}}), Error);
    CHECK_THROWS_AS(ArmSpheres::along_links(arm, bad), Error);
    const ArmSpheres spheres = ArmSpheres::along_links(arm);
    CHECK_THROWS_AS(collision_cost(spheres, field, bad), Error);
    CHECK_THROWS_AS(collision_cost(spheres, field, 0.1, bad), Error);
    CHECK_THROWS_AS(self_collision_cost(spheres, {}, bad), Error);
    CHECK_THROWS_AS(joint_limit_cost(arm, 0.1, bad), Error);
  }
  CHECK_THROWS_AS(ArmSpheres::along_links(arm, 1e-4), Error);
  CHECK_THROWS_AS(joint_limit_cost(arm, -0.1), Error);
  CHECK_THROWS_AS(sum_of_costs({}), Error);
  CHECK_THROWS_AS(sum_of_costs({nullptr}), Error);
  CHECK_THROWS_AS(sum_of_costs({joint_limit_cost(arm), joint_limit_cost(test::arms().at("ur10"))}), Error);
  const ArmSpheres spheres = ArmSpheres::along_links(arm);
  CHECK_THROWS_AS(self_collision_pairs(spheres, 0.02, 1.5), Error);
  CHECK_THROWS_AS(self_collision_pairs(spheres, -0.1), Error);
  CHECK_THROWS_AS(self_collision_cost(spheres, {{0, spheres.size()}}), Error);
  CHECK_THROWS_AS(self_collision_cost(spheres, {{5, 5}}), Error);
  CHECK_THROWS_AS(collision_cost(ArmSpheres(arm, {{-1, Vector3d::Zero(), 0.1}}), field), Error);
  const std::string robots = SIGMAIK_ROBOTS_DIR;
  CHECK_THROWS_AS(ArmSpheres::from_urdf(arm, robots + "/ur10.urdf"), Error);
  CHECK_THROWS_AS(ArmSpheres::from_urdf(arm, robots + "/none.urdf"), Error);
  const auto one_link = [](const std::string& shape) {
    return R"(<robot name="r"><link name="a"/><joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>
              <link name="b">)" +
           shape + "</link></robot>";
  };
  const Chain small = Chain::from_urdf(one_link(""));
  CHECK_THROWS_AS(ArmSpheres::from_urdf(small, one_link("")), Error);
  for (const char* geometry : {"<box size='1 1 0'/>", "<box/>", "<cylinder radius='1'/>", "<sphere radius='-1'/>",
                               "<sphere radius='x'/>", ""}) {
    CAPTURE(geometry);
    const std::string xml = one_link(std::string("<collision><geometry>") + geometry + "</geometry></collision>");
    CHECK_THROWS_AS(ArmSpheres::from_urdf(small, xml), Error);
  }
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("no heap") {
  const Chain& arm = test::arms().at("franka_panda");
  const ArmSpheres spheres = ArmSpheres::along_links(arm);
  const DistanceField field = room(0.05);
  const JointCostPtr cost = sum_of_costs({collision_cost(spheres, field, 0.5), joint_limit_cost(arm, 1.0),
                                          self_collision_cost(spheres, self_collision_pairs(spheres), 0.5)});
  const JointVector q = JointVector::Constant(7, 0.5);
  JointVector gradient(7);
  JointMatrix hessian(7, 7);
  SphereState state;
  const test::HeapWatch heap;
  double sum = cost->value(q) + cost->gradient(q, gradient) + cost->model(q, gradient, hessian);
  sum += min_distance(spheres, field, q) + (spheres.update(q, state) ? 1.0 : 0.0);
  CHECK(heap.calls() == 0);
  CHECK(sum > 0.0);
}
#endif
