// Joint weights: the tip moves as the rule says, and of all such motions the joints do the lightest.

#include <doctest/doctest.h>

#include <cmath>
#include <numbers>

#include <sigmaik/error.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/servo.hpp>
#include <sigmaik/velocity_solver.hpp>

#include "arms.hpp"
#include "methods.hpp"
#include "numbers.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::Random;

// An arm on a rail along x of 1.2 m.
Chain on_rail(const char* name, double half = 0.6) {
  const Chain& arm = test::arms().at(name);
  Segment rail;
  rail.joint_name = "rail";
  rail.link_name = "carriage";
  rail.type = JointType::Prismatic;
  rail.axis = Eigen::Vector3d::UnitX();
  rail.lower = -half;
  rail.upper = half;
  rail.velocity = 1.0;
  rail.acceleration = 5.0;
  std::vector<Segment> segments{rail};
  segments.insert(segments.end(), arm.segments().begin(), arm.segments().end());
  return Chain("floor", segments);
}

JointVector ur10_start() {
  JointVector q(7);
  q << 0.0, 0.0, -1.2, 1.5, -1.87, -1.57, 0.0;
  return q;
}

JointVector rail_weight(int n, double weight) {
  JointVector w = JointVector::Ones(n);
  w[0] = weight;
  return w;
}

}  // namespace

TEST_CASE("regular: the weighted pseudo-inverse, with its posture") {
  Random random(1);
  for (int trial = 0; trial < 300; ++trial) {
    const int n = random.integer(6, 12), m = random.integer(1, 6);
    const Eigen::MatrixXd j = random.matrix(m, n);
    const Eigen::VectorXd twist = random.vector(m), posture = random.vector(n);
    const JointVector w = JointVector::NullaryExpr(n, [&] { return random.decades(-1.5, 1.5); });
    VelocitySolver solver(PseudoInverse{});
    solver.set_joint_weights(w);
    const Solution got = solver.solve(j, twist, posture);
    CHECK(got.status == Status::Ok);
    const Eigen::MatrixXd light = w.cwiseInverse().asDiagonal();
    const Eigen::VectorXd expected = posture + light * j.transpose() *
                                                   (j * light * j.transpose()).ldlt().solve(twist - j * posture);
    CHECK((got.qdot - expected).norm() < 1e-8 * (1.0 + expected.norm()));
    // Only ratios matter.
    VelocitySolver other(PseudoInverse{});
    other.set_joint_weights(7.0 * w);
    CHECK((other.solve(j, twist, posture).qdot - got.qdot).norm() < 1e-10 * (1.0 + expected.norm()));
  }
}

TEST_CASE("weights change neither the twist that a rule does, nor singular values and status; equal weights nothing") {
  Random random(2);
  for (const Method& method : test::all_methods()) {
    for (int trial = 0; trial < 60; ++trial) {
      const int n = random.integer(6, 9);
      const Eigen::VectorXd sigma = test::random_singular_values(random, 6, 1.0);
      const Eigen::MatrixXd j = random.with_singular_values(6, n, sigma);
      const Eigen::VectorXd twist = random.vector(6);
      VelocitySolver plain(method), weighted(method), equal(method);
      weighted.set_joint_weights(JointVector::NullaryExpr(n, [&] { return random.decades(-1.0, 1.0); }));
      equal.set_joint_weights(JointVector::Constant(n, 3.0));
      const Solution a = plain.solve(j, twist), b = weighted.solve(j, twist);
      CHECK(equal.solve(j, twist).qdot == a.qdot);
      CHECK(b.singular_values == a.singular_values);
      CHECK(b.singular == a.singular);
      CHECK(b.qdot.allFinite());
      // Directions that the rule does as asked are done as asked; the others by a part of what is left undone.
      for (int i = 0; i < 6; ++i) {
        const Eigen::VectorXd u = a.directions.col(i);
        const double done = u.dot(a.achieved_twist), asked = u.dot(twist), with = u.dot(b.achieved_twist);
        const double undone = std::abs(asked - done);
        CHECK(std::abs(with - done) <
              1e-8 * (1.0 + twist.norm()) + 20.0 * undone + 20.0 * std::abs(done) * (undone > 1e-9));
      }
    }
  }
}

TEST_CASE("the answer is continuous through a singularity, with any weights") {
  Random random(3);
  for (int trial = 0; trial < 40; ++trial) {
    const int n = 7;
    const Eigen::MatrixXd u = random.orthonormal(6, 6), v = random.orthonormal(n, 6), v_after = [&] {
      Eigen::MatrixXd turned = v;  // the direction that is lost comes back as another
      Eigen::VectorXd other = random.vector(n);
      other -= v.leftCols(5) * (v.leftCols(5).transpose() * other);
      turned.col(5) = other.normalized();
      return turned;
    }();
    Eigen::VectorXd sigma(6);
    sigma << 2.0, 1.5, 1.0, 0.8, 0.6, 0.0;
    VelocitySolver before(JParse{}), after(JParse{});
    const JointVector w = JointVector::NullaryExpr(n, [&] { return random.decades(-1.5, 1.5); });
    before.set_joint_weights(w);
    after.set_joint_weights(w);
    const Eigen::VectorXd twist = random.vector(6);
    sigma[5] = 1e-9;
    const JointVector a = before.solve(u * sigma.asDiagonal() * v.transpose(), twist).qdot;
    const JointVector b = after.solve(u * sigma.asDiagonal() * v_after.transpose(), twist).qdot;
    CHECK((a - b).norm() < 1e-5 * (1.0 + a.norm()));
  }
}

TEST_CASE("a rail with weight 1e4 rests while the tool follows a sine of 50 mm, and moves without weight") {
  const Chain arm = on_rail("ur10");
  for (const int axis : {0, 1, 2}) {
    double moved[2];
    for (const bool weighted : {false, true}) {
      ServoOptions options;
      options.dt = 4e-3;
      if (weighted) options.joint_weights = rail_weight(7, 1e4);
      Servo servo(arm, JParse{}, options);
      servo.reset(ur10_start());
      const Pose start = servo.tip();
      double low = 0.0, high = 0.0, error = 0.0;
      for (int i = 0; i < 2500; ++i) {
        Pose target = start;
        const double phase = 2.0 * std::numbers::pi * 0.2 * options.dt * i;
        target.translation()[axis] += 0.05 * std::sin(phase);
        const ServoStep step = servo.update(target);
        low = std::min(low, step.q[0]);
        high = std::max(high, step.q[0]);
        error = std::max(error, step.pose_error.head<3>().norm());
      }
      moved[weighted ? 1 : 0] = high - low;
      CHECK(error < 0.02);
    }
    CAPTURE(axis);
    CAPTURE(moved[0]);
    CHECK(moved[1] < 1e-3);
    if (axis == 0) CHECK(moved[0] > 5e-3);
  }
}

TEST_CASE("the heavy rail moves where the arm cannot: to a target beyond the arm's reach, for each way to give way") {
  const Chain arm = on_rail("ur10", 2.0);
  for (const OnLimit on_limit : {OnLimit::Redistribute, OnLimit::Scale}) {
    ServoOptions options;
    options.dt = 4e-3;
    options.on_limit = on_limit;
    options.joint_weights = rail_weight(7, 1e4);
    Servo servo(arm, JParse{}, options);
    servo.reset(ur10_start());
    Pose target = servo.tip();
    target.translation().x() += 1.5;
    ServoStep step;
    for (int i = 0; i < 8000; ++i) {
      step = servo.update(target);
      for (int k = 0; k < 7; ++k) {
        REQUIRE(std::abs(step.qdot[k]) <= arm.limits().velocity[k] * (1.0 + 1e-9));
        REQUIRE(step.q[k] <= arm.limits().upper[k]);
        REQUIRE(step.q[k] >= arm.limits().lower[k]);
      }
    }
    CHECK(step.pose_error.head<3>().norm() < 1e-3);
    CHECK(step.qdot.cwiseAbs().maxCoeff() < 1e-3);
    CHECK(step.q[0] > 0.3);
  }
}

TEST_CASE("exact rows keep their priority with weights") {
  const Chain arm = on_rail("ur10");
  ServoOptions options;
  options.dt = 4e-3;
  options.exact = {true, true, true, false, false, false};
  options.joint_weights = rail_weight(7, 1e3);
  Servo servo(arm, JParse{}, options);
  servo.reset(ur10_start());
  for (int i = 0; i < 500; ++i) {
    const ServoStep step = servo.update_twist((Twist() << 0.05, 0.02, 0.0, 0.0, 0.0, 0.1).finished());
    REQUIRE(step.qdot.allFinite());
    if (i > 100) REQUIRE((step.achieved_twist.head<3>() - Eigen::Vector3d(0.05, 0.02, 0.0)).norm() < 1e-9);
  }
  CHECK(std::abs(servo.q()[0]) < 2e-2);
}

TEST_CASE("weights that have no meaning are refused") {
  const Chain arm = on_rail("ur10");
  const auto refused = [&](const JointVector& weights) {
    ServoOptions options;
    options.joint_weights = weights;
    CHECK_THROWS_AS(Servo(arm, JParse{}, options), Error);
  };
  refused(rail_weight(7, 0.0));
  refused(rail_weight(7, -1.0));
  refused(rail_weight(7, test::kNan));
  refused(rail_weight(7, test::kInfinity));
  refused(rail_weight(7, 1e7));
  refused(rail_weight(6, 1.0));
}
