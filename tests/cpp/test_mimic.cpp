// Joints that mimic others: kinematics, gradients and dynamics of J A, against the chain of all joints and differences.

#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include <sigmaik/analytic_ik.hpp>
#include <sigmaik/dynamics.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/indices.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/position_ik.hpp>
#include <sigmaik/servo.hpp>

#include "arms.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::Random;

// A chain some of whose joints mimic others, the same chain without mimics, and θ = A q + b.
struct Coupled {
  Chain arm, free;
  JointVector offset;
  JointVector all(const JointVector& q) const { return arm.coupling_matrix() * q + offset; }
};

Coupled coupled(Random& random, int moving, double prismatic = 0.2) {
  const Chain drawn = random.chain(moving, prismatic);
  std::vector<Segment> segments = drawn.segments();
  std::vector<std::size_t> movable;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    segments[i].lower = -10.0;
    segments[i].upper = 10.0;
    Inertia inertia;
    inertia.mass = random.uniform(0.5, 2.0);
    inertia.center_of_mass = 0.1 * random.vector(3);
    inertia.tensor = random.uniform(0.01, 0.1) * Eigen::Matrix3d::Identity();
    segments[i].inertia = inertia;
    if (segments[i].type == JointType::Continuous) segments[i].type = JointType::Revolute;
    if (segments[i].type != JointType::Fixed) movable.push_back(i);
  }
  const Chain free(drawn.base(), segments);
  // A third of the joints mimics a joint of a smaller place in a random order, so that there are chains of mimics.
  std::vector<std::size_t> order = movable;
  for (std::size_t i = order.size(); i > 1; --i) {
    std::swap(order[i - 1], order[static_cast<std::size_t>(random.integer(0, static_cast<int>(i) - 1))]);
  }
  int mimics = 0;
  for (std::size_t i = 1; i < order.size(); ++i) {
    if (!random.chance(0.35) && !(i + 1 == order.size() && mimics == 0)) continue;
    const auto from = static_cast<std::size_t>(random.integer(0, static_cast<int>(i) - 1));
    const double sign = random.chance(0.5) ? -1.0 : 1.0;
    segments[order[i]].mimic = Mimic{segments[order[from]].joint_name, sign * random.uniform(0.3, 1.5),
                                     random.uniform(-0.5, 0.5)};
    ++mimics;
  }
  Coupled out{Chain(drawn.base(), segments), free, JointVector(moving)};
  for (int i = 0; i < moving; ++i) out.offset[i] = out.arm.couplings()[static_cast<std::size_t>(i)].offset;
  return out;
}

}  // namespace

TEST_CASE("pose, Jacobian, its gradient and the indices' gradients are those of J A") {
  Random random(3);
  for (int trial = 0; trial < 100; ++trial) {
    const Coupled c = coupled(random, random.integer(2, 9));
    const int n = c.arm.dof();
    REQUIRE(n < c.arm.moving());
    const JointVector q = random.configuration(n);
    ChainState state, free;
    REQUIRE(update(c.arm, q, state));
    REQUIRE(update(c.free, c.all(q), free));
    CHECK((state.tip.matrix() - free.tip.matrix()).cwiseAbs().maxCoeff() < 1e-13);
    CHECK((state.jacobian - free.jacobian * c.arm.coupling_matrix()).cwiseAbs().maxCoeff() < 1e-12);
    CHECK((pose(c.arm, q).matrix() - state.tip.matrix()).cwiseAbs().maxCoeff() == 0.0);

    JacobianGradient gradient;
    jacobian_gradient(c.arm, q, state.jacobian, gradient);
    const IndexFunction index(Index::GeometryAware);
    JointVector slope;
    index.value(c.arm, q, slope);
    constexpr double h = 1e-4;
    for (int k = 0; k < n; ++k) {
      ChainState at[4];
      double value[4];
      for (int i = 0; i < 4; ++i) {
        JointVector moved = q;
        moved[k] += h * (i < 2 ? i - 2.0 : i - 1.0);  // −2, −1, 1, 2
        update(c.arm, moved, at[i]);
        value[i] = index.value(at[i].jacobian);
      }
      const Jacobian difference = (8.0 * (at[2].jacobian - at[1].jacobian) - (at[3].jacobian - at[0].jacobian)) /
                                  (12.0 * h);
      CHECK((gradient[static_cast<std::size_t>(k)] - difference).cwiseAbs().maxCoeff() < 1e-9);
      if (n < 6) continue;  // the index is infinite, or has no slope, where the arm has fewer joints than rows
      const double rate = (8.0 * (value[2] - value[1]) - (value[3] - value[0])) / (12.0 * h);
      CHECK(slope[k] == doctest::Approx(rate).epsilon(1e-4).scale(1.0 + slope.cwiseAbs().maxCoeff()));
    }
  }
}

TEST_CASE("dynamics are those of all joints, projected by virtual work") {
  Random random(4);
  for (int trial = 0; trial < 50; ++trial) {
    const Coupled c = coupled(random, random.integer(2, 8));
    const int n = c.arm.dof();
    const JointMatrix a = c.arm.coupling_matrix();
    Dynamics arm(c.arm), free(c.free);
    const JointVector q = random.configuration(n), v = random.vector(n), acceleration = random.vector(n);
    JointVector torque, of_all;
    arm.inverse_dynamics(q, v, acceleration, torque);
    free.inverse_dynamics(c.all(q), a * v, a * acceleration, of_all);
    CHECK((torque - a.transpose() * of_all).cwiseAbs().maxCoeff() < 1e-10);
    DynamicsTerms terms;
    arm.evaluate(q, v, terms);
    CHECK((terms.mass * acceleration + terms.bias - torque).cwiseAbs().maxCoeff() < 1e-10);
    CHECK((arm.mass_matrix(q) - terms.mass).cwiseAbs().maxCoeff() < 1e-12);
    CHECK((arm.coriolis(q, v) + arm.gravity(q) - terms.bias).cwiseAbs().maxCoeff() < 1e-10);

    // Gravity is the slope of the potential energy, of which the virtual work knows nothing.
    const auto energy = [&](const JointVector& at) {
      Pose frame = Pose::Identity();
      const JointVector positions = c.all(at);
      double sum = 0.0;
      int i = 0;
      for (const Segment& s : c.free.segments()) {
        frame = frame * s.origin;
        if (s.type == JointType::Prismatic) frame.translate(Eigen::Vector3d(positions[i++] * s.axis));
        if (s.type == JointType::Revolute) frame.rotate(rotation_exp(positions[i++] * s.axis));
        sum += s.inertia->mass * 9.80665 * (frame * s.inertia->center_of_mass).z();
      }
      return sum;
    };
    for (int k = 0; k < n; ++k) {
      JointVector up = q, down = q;
      up[k] += 1e-5;
      down[k] -= 1e-5;
      CHECK(arm.gravity(q)[k] == doctest::Approx((energy(up) - energy(down)) / 2e-5).epsilon(1e-6).scale(10.0));
    }
    JointVector back;
    REQUIRE(arm.forward_dynamics(q, v, torque, back));
    CHECK((back - acceleration).cwiseAbs().maxCoeff() < 1e-7);
  }
}

TEST_CASE("a palletiser: the passive joints keep the tool upright, and the servo drives it inside all limits") {
  // Shoulder and elbow by parallel links, the wrist with −(shoulder + elbow): as two mimics in series.
  const auto joint = [](const char* name, const char* link, const Eigen::Vector3d& axis, const Eigen::Vector3d& at) {
    Segment s;
    s.joint_name = name;
    s.link_name = link;
    s.type = JointType::Revolute;
    s.axis = axis;
    s.origin.translation() = at;
    s.lower = -3.0;
    s.upper = 3.0;
    s.velocity = 2.0;
    s.acceleration = 10.0;
    return s;
  };
  const Eigen::Vector3d y = Eigen::Vector3d::UnitY(), z = Eigen::Vector3d::UnitZ();
  std::vector<Segment> segments{joint("turn", "a", z, {0, 0, 0.4}),  joint("shoulder", "b", y, {0, 0, 0.1}),
                                joint("back", "c", y, {0, 0, 0.8}),  joint("elbow", "d", y, {0, 0, 0}),
                                joint("level", "e", y, {0.7, 0, 0}), joint("tool", "tip", z, {0.1, 0, -0.1})};
  segments[2].mimic = Mimic{"shoulder", -1.0, 0.0};  // the forearm keeps its direction when the shoulder moves
  segments[4].mimic = Mimic{"elbow", -1.0, 0.0};
  segments[4].lower = -0.8;
  segments[4].velocity = 1.0;
  const Chain arm("base", segments);
  REQUIRE(arm.dof() == 4);
  CHECK(arm.limits().upper[2] == 0.8);
  CHECK(arm.limits().velocity[2] == 1.0);
  CHECK_THROWS_AS((void)AnalyticIk(arm), Error);

  ServoOptions options;
  options.task.mask = {true, true, true, false, false, true};
  Servo servo(arm, JParse{}, options);
  const JointVector start = Eigen::Vector4d(0.2, 0.3, 0.2, 0.1);
  servo.reset(start);
  Pose target = servo.tip();
  target.translation() += Eigen::Vector3d(0.1, -0.1, -0.15);
  ServoStep step;
  for (int i = 0; i < 3000; ++i) {
    step = servo.update(target);
    CHECK((step.q.array() <= arm.limits().upper.array()).all());
    REQUIRE((step.qdot.cwiseAbs().array() <= arm.limits().velocity.array() * (1.0 + 1e-9)).all());
    REQUIRE(servo.tip().linear()(2, 2) == doctest::Approx(1.0).epsilon(1e-12));
  }
  CHECK(step.pose_error.head<3>().norm() < 1e-4);

  const PositionIk ik(arm, {.task = options.task});
  const PositionIkResult solution = ik.solve(target, start);
  CHECK((pose(arm, solution.q).translation() - target.translation()).norm() < 1e-5);
}

TEST_CASE("mimics in the C++ interface that have no meaning are refused") {
  Random random(5);
  std::vector<Segment> segments = random.chain(3).segments();
  std::vector<std::size_t> at;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    if (segments[i].type != JointType::Fixed) at.push_back(i);
  }
  const auto refused = [&](const Mimic& mimic) {
    std::vector<Segment> bad = segments;
    bad[at[1]].mimic = mimic;
    CHECK_THROWS_AS(Chain("base_link", bad), Error);
  };
  refused({"nobody", 1.0, 0.0});
  refused({segments[at[1]].joint_name, 1.0, 0.0});
  refused({segments[at[0]].joint_name, 0.0, 0.0});
  refused({segments[at[0]].joint_name, std::nan(""), 0.0});
  refused({segments[at[0]].joint_name, 1.0, std::nan("")});
}
