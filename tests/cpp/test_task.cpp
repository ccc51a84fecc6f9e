// Task masks and frames: the rows asked for; a solver with a task gives the same answer as masking by hand.

#include <doctest/doctest.h>

#include <sigmaik/error.hpp>
#include <sigmaik/task.hpp>
#include <sigmaik/velocity_solver.hpp>

#include "oracles.hpp"
#include "random.hpp"

namespace {

using sigmaik::Frame;
using sigmaik::Task;
using test::MatrixXd;
using test::Random;
using test::VectorXd;

Task task_of(unsigned bits, Frame frame) {
  Task task;
  for (unsigned i = 0; i < 6; ++i) task.mask[i] = (bits >> i & 1u) != 0;
  task.frame = frame;
  return task;
}

// The rows asked for, selected by a matrix product.
MatrixXd selector(const Task& task, const Eigen::Matrix3d& rotation) {
  MatrixXd turn = MatrixXd::Identity(6, 6);
  if (task.frame == Frame::Tool) {
    turn.topLeftCorner(3, 3) = rotation.transpose();
    turn.bottomRightCorner(3, 3) = rotation.transpose();
  }
  MatrixXd rows(task.rows(), 6);
  int row = 0;
  for (int i = 0; i < 6; ++i) {
    if (task.mask[static_cast<std::size_t>(i)]) rows.row(row++) = turn.row(i);
  }
  return rows;
}

}  // namespace

TEST_CASE("every mask in both frames") {
  Random random(1);
  for (unsigned bits = 1; bits < 64; ++bits) {
    for (const Frame frame : {Frame::Base, Frame::Tool}) {
      const Task task = task_of(bits, frame);
      CHECK_NOTHROW(task.validate());
      CHECK(task.rows() == __builtin_popcount(bits));
      CHECK(task.whole() == (bits == 63));
      for (int n = 1; n <= 16; ++n) {
        const Eigen::Matrix3d rotation = random.rotation();
        const MatrixXd j = random.matrix(6, n);
        const sigmaik::Twist twist = random.vector(6);
        const MatrixXd rows = selector(task, rotation);
        const auto selected = sigmaik::select_rows(task, rotation, sigmaik::Jacobian(j));
        REQUIRE(selected.rows() == task.rows());
        REQUIRE(selected.cols() == n);
        CHECK((selected - rows * j).cwiseAbs().maxCoeff() < 1e-14);
        const sigmaik::TaskVector command = sigmaik::select_rows(task, rotation, twist);
        REQUIRE(command.size() == task.rows());
        CHECK((command - rows * twist).cwiseAbs().maxCoeff() < 1e-14);
      }
    }
  }
}

TEST_CASE("a mask without rows is refused") {
  CHECK_THROWS_AS(task_of(0, Frame::Base).validate(), sigmaik::Error);
  CHECK_THROWS_AS(sigmaik::VelocitySolver(sigmaik::JParse{}, 1.0, task_of(0, Frame::Tool)), sigmaik::Error);
}

TEST_CASE("a solver with a task: as masked by hand, and as given masked already") {
  Random random(2);
  for (int repeat = 0; repeat < 2000; ++repeat) {
    const Task task = task_of(static_cast<unsigned>(random.integer(1, 63)),
                              random.chance(0.5) ? Frame::Base : Frame::Tool);
    const int n = random.integer(1, 9);
    const MatrixXd j = random.with_singular_values(6, n, test::random_singular_values(random, std::min(6, n), 1.0));
    const VectorXd twist = random.vector(6);
    const Eigen::Matrix3d rotation = random.rotation();
    const double length_scale = random.decades(-1.0, 1.0);
    CAPTURE(repeat);

    const MatrixXd rows = selector(task, rotation);
    MatrixXd masked = rows * j;
    VectorXd command = rows * twist;
    const sigmaik::JParse method{0.2, random.uniform(0.0, 3.0), random.uniform(0.0, 3.0), random.chance(0.5)};

    sigmaik::VelocitySolver solver(method, length_scale, task);
    const sigmaik::Solution s = solver.solve(j, twist, sigmaik::JointVector(), rotation);
    REQUIRE(s.status != sigmaik::Status::BadInput);
    CHECK(s.directions.rows() == task.rows());
    CHECK(s.singular_values.size() == std::min(task.rows(), n));
    CHECK((s.achieved_twist - j * s.qdot).norm() <= 1e-14 * (1.0 + s.qdot.norm()));

    // Weighted by hand, the rows need neither task nor length scale.
    int row = 0;
    for (int i = 0; i < 6; ++i) {
      if (!task.mask[static_cast<std::size_t>(i)]) continue;
      if (i >= 3) {
        masked.row(row) *= length_scale;
        command[row] *= length_scale;
      }
      ++row;
    }
    sigmaik::Spectrum spectrum;
    spectrum.decompose(masked);
    // A singular value on the threshold may be on either side of it, and its direction may then be any.
    bool on_edge = false;
    for (int i = 0; i < spectrum.size(); ++i) {
      const double ratio = spectrum.sigma(i) / spectrum.sigma(0);
      on_edge = on_edge || std::abs(ratio - method.gamma) < 1e-9;
      CHECK(std::abs(spectrum.sigma(i) - s.singular_values[i]) < 1e-13 * spectrum.sigma(0));
    }
    if (on_edge || (masked.rows() != 6 && spectrum.sigma(0) == 0.0)) continue;
    const double bound = command.norm() * (1.0 + std::max(method.gain_linear, method.gain_angular)) /
                         (method.gamma * spectrum.sigma(0));

    if (masked.rows() < 6) {
      // The Jacobian is given as masked already, unweighted.
      MatrixXd given = rows * j;
      VectorXd asked = rows * twist;
      sigmaik::VelocitySolver same(method, length_scale, task);
      const sigmaik::Solution t = same.solve(given, asked);
      REQUIRE(t.status != sigmaik::Status::BadInput);
      CHECK((t.qdot - s.qdot).norm() < 1e-10 * bound);
      CHECK(t.achieved_twist.size() == task.rows());
    }
    sigmaik::VelocitySolver plain(sigmaik::JParse{method.gamma, 1.0, 1.0, true});
    sigmaik::VelocitySolver with_task(plain.method(), length_scale, task);
    const sigmaik::Solution p = plain.solve(masked, command);
    const sigmaik::Solution q = with_task.solve(j, twist, sigmaik::JointVector(), rotation);
    CHECK((p.qdot - q.qdot).norm() < 1e-10 * bound);
  }
}

TEST_CASE("rows that are not asked for are free: their command does not matter, their motion is not held") {
  Random random(3);
  for (int repeat = 0; repeat < 500; ++repeat) {
    const MatrixXd j = random.matrix(6, 7);
    const Task task = task_of(0b000111, Frame::Base);
    sigmaik::VelocitySolver solver(sigmaik::PseudoInverse{}, 1.0, task);
    VectorXd twist = random.vector(6);
    const sigmaik::Solution a = solver.solve(j, twist);
    twist.tail(3) = random.vector(3);
    const sigmaik::Solution b = solver.solve(j, twist);
    CHECK((a.qdot - b.qdot).norm() < 1e-12 * (1.0 + a.qdot.norm()));
    CHECK(a.status == sigmaik::Status::Ok);
    CHECK((j.topRows(3) * a.qdot - twist.head(3)).norm() < 1e-12);
    // The least of all motions with this twist.
    CHECK(a.qdot.norm() <= test::least_squares(j, j * a.qdot).norm() * (1.0 + 1e-9));
  }
}

TEST_CASE("free rotation about the tool's axis: the tool axis is kept whatever the tool's turn") {
  Random random(4);
  for (int repeat = 0; repeat < 300; ++repeat) {
    const MatrixXd j = random.matrix(6, 7);
    const Task task = task_of(0b011111, Frame::Tool);
    const Eigen::Matrix3d rotation = random.rotation();
    sigmaik::VelocitySolver solver(sigmaik::PseudoInverse{}, 1.0, task);
    const VectorXd twist = random.vector(6);
    const sigmaik::Solution a = solver.solve(j, twist, sigmaik::JointVector(), rotation);
    const Eigen::Matrix3d spun = rotation * Eigen::AngleAxisd(random.uniform(-3, 3), Eigen::Vector3d::UnitZ());
    solver.reset();
    const sigmaik::Solution b = solver.solve(j, twist, sigmaik::JointVector(), spun);
    CHECK((a.qdot - b.qdot).norm() < 1e-11 * (1.0 + a.qdot.norm()));
    const Eigen::Vector3d axis = rotation.col(2);
    const Eigen::Vector3d omega = a.achieved_twist.tail(3), asked = twist.tail(3);
    CHECK(((omega - asked).cross(axis)).norm() < 1e-11 * (1.0 + a.qdot.norm()));
  }
}
