// The singular directions of a cycle are those of the rule, as twists in base axes.

#include <doctest/doctest.h>

#include <vector>

#include <sigmaik/servo.hpp>

#include "oracles.hpp"
#include "random.hpp"
#include "twin.hpp"

using namespace sigmaik;

namespace {

const std::vector<Method> kMethods{PseudoInverse{1e-2},
                                   DampedLeastSquares{},
                                   AdaptiveDampedLeastSquares{},
                                   SelectivelyDampedLeastSquares{},
                                   JParse{.gamma = 0.3},
                                   JacobianProjection{.gamma = 0.3},
                                   JacobianSafety{},
                                   JacobianSafetyProjection{},
                                   AdaptiveDampedLeastSquares{.rule = DampingRule::SmallestSingularValue},
                                   AdaptiveDampedLeastSquares{.rule = DampingRule::Manipulability}};

// (m', 6): maps a twist in base axes to the weighted rows of the task.
Eigen::MatrixXd task_rows(const Task& task, double length_scale, const Eigen::Matrix3d& rotation) {
  Eigen::MatrixXd turn = Eigen::MatrixXd::Identity(6, 6);
  if (task.frame == Frame::Tool) {
    turn.topLeftCorner(3, 3) = turn.bottomRightCorner(3, 3) = rotation.transpose();
  }
  turn.bottomRows(3) *= length_scale;
  Eigen::MatrixXd out(0, 6);
  for (int i = 0; i < 6; ++i) {
    if (!task.mask[static_cast<std::size_t>(i)]) continue;
    out.conservativeResize(out.rows() + 1, 6);
    out.row(out.rows() - 1) = turn.row(i);
  }
  return out;
}

}  // namespace

TEST_CASE("a cycle's singular directions are the rule's, for every method, task and length scale") {
  test::Random random(7);
  int seen = 0;
  for (int k = 0; k < 400; ++k) {
    const Chain chain = random.chain(random.integer(2, 9));
    const Method& method = kMethods[static_cast<std::size_t>(k) % kMethods.size()];
    ServoOptions options;
    options.limits = {.position = false, .velocity = false, .acceleration = false, .jerk = false};
    options.length_scale = random.uniform(0.1, 2.0);
    for (bool& row : options.task.mask) row = random.chance(0.7);
    options.task.mask[static_cast<std::size_t>(random.integer(0, 5))] = true;
    options.task.frame = random.chance(0.5) ? Frame::Tool : Frame::Base;
    const JointVector q = random.chance(0.5) ? JointVector(JointVector::Constant(chain.dof(), 1e-3))
                                             : JointVector(random.vector(chain.dof()));
    Servo servo(chain, method, options);
    servo.reset(q);
    ChainState state;
    update(chain, q, state);
    const Eigen::Matrix3d rotation = state.tip.linear();
    const Twist twist = random.vector(6);
    const ServoStep step = servo.update_twist(twist);
    const Solution solution = test::rule_of(servo).solve(state.jacobian, twist, JointVector(), rotation);
    CAPTURE(k);
    CHECK(step.singular == solution.singular);
    REQUIRE(step.singular_directions.cols() == solution.singular_count());

    // In the rows of the task the directions are the solver's u_i; in the other rows they are zero.
    const Eigen::MatrixXd rows = task_rows(options.task, servo.length_scale(), rotation);
    Task others = options.task;
    for (bool& row : others.mask) row = !row;
    const Eigen::MatrixXd directions = step.singular_directions, u = rows * directions;
    CHECK((task_rows(others, 1.0, rotation) * directions).norm() < 1e-12);
    Eigen::Index column = 0;
    for (int i = 0; i < solution.directions.cols(); ++i) {
      if ((solution.singular >> i & 1u) == 0) continue;
      CHECK((u.col(column++) - solution.directions.col(i)).norm() < 1e-12);
      ++seen;
    }

    // The directions span the space that another decomposition finds, where the singular values are well apart.
    const test::Svd svd = test::svd(rows * state.jacobian);
    Eigen::MatrixXd span(rows.rows(), 0);
    double gap = 1.0;
    const auto sigma = [&](Eigen::Index i) { return i < svd.sigma.size() ? svd.sigma[i] : 0.0; };
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
      const bool singular = (step.singular >> i & 1u) != 0;
      if (i > 0 && singular != ((step.singular >> (i - 1) & 1u) != 0)) gap = std::min(gap, sigma(i - 1) - sigma(i));
      if (!singular) continue;
      span.conservativeResize(rows.rows(), span.cols() + 1);
      span.col(span.cols() - 1) = svd.u.col(i);
    }
    if (gap > 1e-6 * sigma(0)) CHECK((u * u.transpose() - span * span.transpose()).norm() < 1e-8);
  }
  CHECK(seen > 100);
}

TEST_CASE("there are no singular directions while the arm holds, or after bad input") {
  test::Random random(8);
  Servo servo(random.chain(3), JParse{});
  servo.reset(JointVector::Zero(3));
  CHECK(servo.update_twist(Twist::Ones()).singular_directions.cols() > 0);
  CHECK(servo.hold().singular_directions.cols() == 0);
  CHECK(servo.update_twist(Twist::Constant(std::nan(""))).singular_directions.cols() == 0);
}
