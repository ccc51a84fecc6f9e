// Dynamics and ComputedTorque: identities on random arms, payloads as links, no heap. tests/python/test_dynamics.py
// compares the shipped arms with Pinocchio and MuJoCo.

#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <sigmaik/computed_torque.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/kinematics.hpp>

#include "arms.hpp"
#include "heap.hpp"
#include "random.hpp"

using namespace sigmaik;
using test::MatrixXd;
using test::Random;
using test::VectorXd;

namespace {

// A few point masses, which are a body whatever their places are.
Inertia body(Random& random) {
  Inertia result;
  Eigen::Matrix3Xd points(3, 4);
  Eigen::VectorXd mass(4);
  for (int i = 0; i < 4; ++i) {
    points.col(i) = 0.2 * random.vector(3);
    mass[i] = random.uniform(0.1, 2.0);
    result.mass += mass[i];
  }
  result.center_of_mass = points * mass / result.mass;
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d r = points.col(i) - result.center_of_mass;
    result.tensor += mass[i] * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
  }
  return result;
}

Chain arm_with_bodies(Random& random, int n) {
  const Chain bare = random.chain(n, 0.2);
  std::vector<Segment> segments = bare.segments();
  for (Segment& s : segments) s.inertia = body(random);
  return Chain(bare.base(), std::move(segments));
}

}  // namespace

TEST_CASE("inverse and forward dynamics are each other's inverse, and M q̈ + C q̇ + g") {
  Random random(1);
  for (int trial = 0; trial < 500; ++trial) {
    const int n = random.integer(1, kMaxJoints);
    const Chain chain = arm_with_bodies(random, n);
    Dynamics dynamics(chain, random.vector(3), body(random));
    const JointVector q = random.configuration(n), qdot = random.vector(n), qddot = random.vector(n);
    JointVector torque, back;
    dynamics.inverse_dynamics(q, qdot, qddot, torque);
    const VectorXd sum = dynamics.mass_matrix(q) * qddot + dynamics.coriolis(q, qdot) + dynamics.gravity(q);
    const double scale = 1.0 + torque.cwiseAbs().maxCoeff();
    CHECK((torque - sum).cwiseAbs().maxCoeff() < 1e-11 * scale);
    REQUIRE(dynamics.forward_dynamics(q, qdot, torque, back));
    const VectorXd again = dynamics.mass_matrix(q) * (back - qddot);  // without M's condition number
    CHECK(again.cwiseAbs().maxCoeff() < 1e-10 * scale);
    DynamicsTerms terms;
    dynamics.evaluate(q, qdot, terms);
    CHECK((terms.mass - dynamics.mass_matrix(q)).cwiseAbs().maxCoeff() == 0.0);
    CHECK((terms.mass * qddot + terms.bias - torque).cwiseAbs().maxCoeff() < 1e-11 * scale);
  }
}

TEST_CASE("power is the change of energy: q̇ᵀ (C q̇) is half of q̇ᵀ Ṁ q̇") {
  Random random(2);
  for (int trial = 0; trial < 200; ++trial) {
    const int n = random.integer(1, 9);
    Dynamics dynamics(arm_with_bodies(random, n), Eigen::Vector3d::Zero(), body(random));
    const VectorXd q = random.configuration(n), qdot = random.vector(n);
    const double h = 1e-5;
    const MatrixXd rate = (dynamics.mass_matrix(q + h * qdot) - dynamics.mass_matrix(q - h * qdot)) / (2.0 * h);
    const double energy = 1.0 + qdot.dot(dynamics.mass_matrix(q) * qdot);
    CHECK(qdot.dot(dynamics.coriolis(q, qdot)) - 0.5 * qdot.dot(rate * qdot) ==
          doctest::Approx(0.0).scale(energy).epsilon(1e-6));
  }
}

TEST_CASE("a point mass at the tip adds m JᵀJ and −m Jᵀ g") {
  Random random(3);
  const Eigen::Vector3d gravity(0.3, -0.2, -9.8);
  for (const auto& [name, chain] : test::arms()) {
    if (name == "kuka_kr6_r900") continue;  // no inertias
    const double mass = random.uniform(0.1, 5.0);
    const Dynamics bare(chain, gravity), loaded(chain, gravity, Inertia{.mass = mass});
    for (int trial = 0; trial < 50; ++trial) {
      const VectorXd q = random.configuration(chain.dof());
      ChainState state;
      update(chain, q, state);
      const MatrixXd j = state.jacobian.topRows<3>();
      const MatrixXd more = loaded.mass_matrix(q) - bare.mass_matrix(q) - mass * j.transpose() * j;
      CHECK(more.cwiseAbs().maxCoeff() < 1e-10 * (1.0 + bare.mass_matrix(q).cwiseAbs().maxCoeff()));
      const VectorXd hold = loaded.gravity(q) - bare.gravity(q) + mass * j.transpose() * gravity;
      CHECK(hold.cwiseAbs().maxCoeff() < 1e-10 * (1.0 + bare.gravity(q).cwiseAbs().maxCoeff()));
    }
  }
}

TEST_CASE("a payload is a link fixed to the tip") {
  Random random(4);
  for (int trial = 0; trial < 100; ++trial) {
    const int n = random.integer(1, 8);
    const Chain chain = arm_with_bodies(random, n);
    const Inertia payload = body(random);
    std::vector<Segment> segments = chain.segments();
    Segment carried;
    carried.joint_name = "grasp";
    carried.link_name = "load";
    carried.inertia = payload;
    segments.push_back(carried);
    Dynamics one(chain, {0, 0, -9.8}, payload), other(Chain("base", segments), {0, 0, -9.8});
    const JointVector q = random.configuration(n), qdot = random.vector(n), qddot = random.vector(n);
    JointVector a, b;
    one.inverse_dynamics(q, qdot, qddot, a);
    other.inverse_dynamics(q, qdot, qddot, b);
    CHECK((a - b).cwiseAbs().maxCoeff() <= 1e-14 * (1.0 + a.cwiseAbs().maxCoeff()));
  }
}

TEST_CASE("payloads that are no bodies are refused") {
  const Chain& chain = test::arms().at("franka_panda");
  const auto made = [&](const Inertia& payload) { Dynamics dynamics(chain, {0, 0, -9.8}, payload); };
  const auto tensor = [](double x, double y, double z) {
    return Inertia{1.0, Eigen::Vector3d::Zero(), Eigen::Vector3d(x, y, z).asDiagonal()};
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  made(tensor(1.0, 1.0, 2.0));  // a thin disc
  made(Inertia{});
  CHECK_THROWS_AS(made(tensor(1.0, 1.0, 2.1)), Error);
  CHECK_THROWS_AS(made(tensor(-1.0, 1.0, 1.0)), Error);
  CHECK_THROWS_AS(made(Inertia{.mass = -1.0}), Error);
  CHECK_THROWS_AS(made(Inertia{.mass = nan}), Error);
  CHECK_THROWS_AS(made(Inertia{1.0, Eigen::Vector3d(0.0, nan, 0.0)}), Error);
  CHECK_THROWS_AS(made(Inertia{0.0, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity()}), Error);
  Inertia skew = tensor(1.0, 1.0, 1.0);
  skew.tensor(0, 1) = 0.1;
  CHECK_THROWS_AS(made(skew), Error);
  CHECK_THROWS_AS(Dynamics(chain, Eigen::Vector3d(0.0, 0.0, nan)), Error);
}

TEST_CASE("computed torque gives every joint the error's dynamics that were asked for") {
  Random random(5);
  for (int trial = 0; trial < 300; ++trial) {
    const int n = random.integer(1, 9);
    const Chain chain = arm_with_bodies(random, n);
    const double w = random.uniform(1.0, 50.0), z = random.uniform(0.3, 2.0);
    const Inertia payload = body(random);
    ComputedTorque control(chain, {w, z, {0.1, 0.2, -9.8}, payload});
    Dynamics dynamics(chain, {0.1, 0.2, -9.8}, payload);
    const JointVector q = random.configuration(n), qdot = random.vector(n);
    const JointVector e = 0.1 * random.vector(n), edot = random.vector(n), qddot = random.vector(n);
    const ComputedTorqueStep step = control.update(q, qdot, q + e, qdot + edot, qddot);
    CHECK(step.status == Status::Ok);
    JointVector truly;
    REQUIRE(dynamics.forward_dynamics(q, qdot, step.torque, truly));
    const JointVector v = qddot + 2.0 * z * w * edot + w * w * e;
    const VectorXd wrong = dynamics.mass_matrix(q) * (truly - v);
    CHECK(wrong.cwiseAbs().maxCoeff() < 1e-9 * (1.0 + step.torque.cwiseAbs().maxCoeff()));
  }
}

TEST_CASE("computed torque stays within effort limits, and answers bad input") {
  const Chain& chain = test::arms().at("franka_panda");
  ComputedTorque control(chain);
  Dynamics dynamics(chain);
  JointVector q(7), bad = JointVector::Zero(7);
  q << 0.1, -0.7, 0.2, -2.3, 0.1, 1.5, 0.7;
  bad[3] = std::numeric_limits<double>::quiet_NaN();
  const JointVector zero = JointVector::Zero(7), qdot = JointVector::Constant(7, 0.3);
  const ComputedTorqueStep far = control.update(q, zero, q.array() + 2.0, zero, zero);
  CHECK(far.status == Status::Limited);
  CHECK(far.limiting_joints != 0);
  CHECK((far.torque.cwiseAbs().array() <= chain.limits().effort.array()).all());

  CHECK(far.scale < 1.0);
  JointVector asked, truly;
  asked = JointVector::Constant(7, 2.0 * 400.0);
  REQUIRE(dynamics.forward_dynamics(q, zero, far.torque, truly));
  CHECK((truly - far.scale * asked).cwiseAbs().maxCoeff() < 1e-9 * asked[0]);  // the direction is kept
  const double most = (far.torque.cwiseAbs().array() / chain.limits().effort.array()).maxCoeff();
  CHECK(most == doctest::Approx(1.0).epsilon(1e-12));  // no more is given up than necessary

  const ComputedTorqueStep brake = control.update(q, qdot, bad, zero, zero);
  JointVector expected;
  dynamics.inverse_dynamics(q, qdot, -40.0 * qdot, expected);
  CHECK(brake.status == Status::BadInput);
  CHECK((brake.torque - expected).cwiseAbs().maxCoeff() < 1e-12);
  for (const JointVector& wrong : {bad, JointVector(JointVector::Zero(6)), JointVector()}) {
    const ComputedTorqueStep step = control.update(wrong, qdot, q, zero, zero);
    CHECK(step.status == Status::BadInput);
    CHECK(step.torque.isZero(0.0));
    CHECK(control.update(q, qdot, q, wrong, zero).status == Status::BadInput);
    CHECK(control.update(q, qdot, q, zero, wrong).status == Status::BadInput);
  }
  for (const double value : {0.0, -1.0, std::numeric_limits<double>::infinity()}) {
    CHECK_THROWS_AS(ComputedTorque(chain, {.frequency = value}), Error);
    CHECK_THROWS_AS(ComputedTorque(chain, {.damping_ratio = value}), Error);
  }
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("no heap in the loop") {
  Random random(6);
  const Chain chain = arm_with_bodies(random, 7);
  const Inertia payload = body(random);
  Dynamics dynamics(chain, {0, 0, -9.8}, payload);
  ComputedTorque control(chain, {.payload = payload});
  const JointVector q = random.configuration(7), qdot = random.vector(7), qddot = random.vector(7);
  JointVector torque, back;
  DynamicsTerms terms;
  const test::HeapWatch watch;
  for (int i = 0; i < 10; ++i) {
    dynamics.evaluate(q, qdot, terms);
    dynamics.inverse_dynamics(q, qdot, qddot, torque);
    dynamics.forward_dynamics(q, qdot, torque, back);
    control.update(q, qdot, q, qdot, qddot);
  }
  CHECK(watch.calls() == 0);
}
#endif
