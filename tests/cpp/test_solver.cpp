// VelocitySolver: its reports on its answers, posture, units, symmetries, bad input; and the solver leaves the heap
// alone.

#include <doctest/doctest.h>

#include <memory>
#include <utility>

#include <sigmaik/error.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/velocity_solver.hpp>

#include "heap.hpp"
#include "methods.hpp"
#include "numbers.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::all_methods;
using test::kInfinity;
using test::kNan;
using test::MatrixXd;
using test::Random;
using test::VectorXd;

// Gain of a method that need not be smooth: bound on the difference of two answers that should be the same.
double gain(const Method& method, const Solution& s) {
  const double largest = s.singular_values.size() > 0 ? std::max(s.singular_values[0], 1e-300) : 1.0;
  return std::holds_alternative<PseudoInverse>(method) ? 1e3 / largest : 30.0 / largest;
}

VectorXd well_separated(Random& random, int k) {  // apart from each other and from the thresholds of 0.1 and 0.2
  VectorXd sigma(k);
  sigma[0] = 1.0;
  for (int i = 1; i < k; ++i) {
    sigma[i] = sigma[i - 1] * random.uniform(0.35, 0.9);
    for (const double threshold : {0.1, 0.2}) {
      if (std::abs(sigma[i] - threshold) < 1e-3) sigma[i] = threshold - 1e-3;
    }
  }
  return sigma;
}

}  // namespace

TEST_CASE("achieved twist and status tell the truth") {
  Random random(1);
  int ok = 0, damped = 0;
  for (int repeat = 0; repeat < 3000; ++repeat) {
    const int m = random.integer(1, 6), n = random.integer(1, 16);
    const MatrixXd j = random.with_singular_values(
        m, n, test::random_singular_values(random, std::min(m, n), random.decades(-3.0, 3.0)));
    VectorXd twist = random.chance(0.5) ? random.vector(m) : VectorXd(j * random.vector(n));
    twist *= random.decades(-6.0, 3.0);
    const JointVector posture = random.chance(0.3) ? JointVector(random.vector(n)) : JointVector();
    for (const Method& method : all_methods()) {
      VelocitySolver solver(method);
      const Solution s = solver.solve(j, twist, posture);
      CAPTURE(repeat);
      CAPTURE(name(method));
      REQUIRE(s.status != Status::BadInput);
      REQUIRE(s.qdot.size() == n);
      CHECK(s.qdot.allFinite());
      CHECK((s.achieved_twist - j * s.qdot).norm() <= 1e-14 * j.norm() * s.qdot.norm());
      CHECK(s.singular_count() == __builtin_popcount(s.singular));
      CHECK(s.singular_values.size() == std::min(m, n));
      CHECK(s.directions.rows() == m);
      CHECK(s.directions.cols() == m);
      const double missed = (s.achieved_twist - twist).norm();
      // Rounding may move a posture, in proportion to the tip's motion by the posture alone.
      const double rest = posture.size() != 0 ? 3e-9 * s.singular_values[0] * posture.norm() : 0.0;
      // Motion that cancels in large joint speeds comes back with the rounding of these speeds.
      const double rounding = 1e-14 * s.singular_values[0] * s.qdot.norm();
      if (s.status == Status::Ok) {
        CHECK(missed <= 3e-9 * twist.norm() + rest + rounding);
        ++ok;
      } else {
        CHECK(s.status == Status::Damped);
        ++damped;
        if (posture.size() == 0) CHECK(missed > 0.3e-9 * twist.norm() - rounding);
      }
    }
  }
  CHECK(ok > 5000);
  CHECK(damped > 5000);
}

TEST_CASE("ok is never said where rounding has spoiled the answer") {
  Random random(2);
  for (int repeat = 0; repeat < 1000; ++repeat) {
    VectorXd sigma(6);
    sigma << 1.0, 0.9, 0.7, 0.5, 0.4, random.decades(-11.9, -3.0);
    const MatrixXd j = random.with_singular_values(6, 7, sigma);
    for (const Method& method : {Method(PseudoInverse{}), Method(PseudoInverse{1e-15}), Method(JParse{1e-11})}) {
      VelocitySolver solver(method);
      const VectorXd twist = random.unit(6);
      const Solution s = solver.solve(j, twist);
      CAPTURE(sigma[5]);
      if (s.status == Status::Ok) CHECK((s.achieved_twist - twist).norm() < 1e-8);
    }
  }
}

TEST_CASE("the posture goes through the method's own projector") {
  Random random(3);
  for (int repeat = 0; repeat < 2000; ++repeat) {
    const int m = random.integer(1, 6), n = random.integer(1, 16), k = std::min(m, n);
    const MatrixXd j = random.with_singular_values(m, n, well_separated(random, k));
    const VectorXd twist = random.vector(m), posture = random.vector(n);
    for (const Method& method : all_methods()) {
      CAPTURE(repeat);
      CAPTURE(name(method));
      VelocitySolver solver(method);
      const VectorXd without = solver.solve(j, twist).qdot;
      const VectorXd with = solver.solve(j, twist, posture).qdot;
      const Resolution r = resolve(method, solver.spectrum(), twist, 0b111000);
      MatrixXd projector = MatrixXd::Identity(n, n);
      for (int i = 0; i < k; ++i) {
        const VectorXd v = solver.spectrum().v(i);
        projector -= r.projector[static_cast<std::size_t>(i)] * v * v.transpose();
      }
      CHECK((with - without - projector * posture).norm() < 1e-11 * (1.0 + without.norm()));
      // Exact methods: the posture does nothing to the tip.
      const bool exact = std::holds_alternative<PseudoInverse>(method) || std::holds_alternative<JParse>(method) ||
                         std::holds_alternative<JacobianSafety>(method) ||
                         std::holds_alternative<JacobianSafetyProjection>(method) ||
                         std::holds_alternative<SelectivelyDampedLeastSquares>(method);
      if (exact) CHECK((j * (with - without)).norm() < 1e-11 * (1.0 + without.norm()));
    }
  }
}

TEST_CASE("the base's axes, the tip's axes and the joints' signs do not matter") {
  Random random(4);
  for (int repeat = 0; repeat < 2000; ++repeat) {
    const int n = random.integer(1, 12);
    const MatrixXd j = random.with_singular_values(6, n, well_separated(random, std::min(6, n)));
    const VectorXd twist = random.vector(6), posture = random.vector(n);
    const Eigen::Matrix3d rotation = random.rotation();
    MatrixXd turn = MatrixXd::Zero(6, 6);
    turn.topLeftCorner(3, 3) = rotation;
    turn.bottomRightCorner(3, 3) = rotation;
    const VectorXd signs = VectorXd::NullaryExpr(n, [&] { return random.chance(0.5) ? 1.0 : -1.0; });
    for (const Method& method : all_methods()) {
      CAPTURE(repeat);
      CAPTURE(name(method));
      // The length scale is 1; otherwise the singular values would not be those that were made.
      VelocitySolver a(method), b(method), c(method);
      const Solution s = a.solve(j, twist, posture);
      const double tolerance = 1e-11 * gain(method, s) * (twist.norm() + posture.norm());
      const Solution turned = b.solve(MatrixXd(turn * j), VectorXd(turn * twist), posture);
      CHECK((turned.qdot - s.qdot).norm() < tolerance);
      CHECK(turned.status == s.status);
      CHECK(turned.singular == s.singular);
      const Solution flipped = c.solve(MatrixXd(j * signs.asDiagonal()), twist, VectorXd(signs.asDiagonal() * posture));
      CHECK((VectorXd(signs.asDiagonal() * flipped.qdot) - s.qdot).norm() < tolerance);
      // The command's sign, too.
      const Solution back = c.solve(MatrixXd(j * signs.asDiagonal()), VectorXd(-twist),
                                    VectorXd(-(signs.asDiagonal() * posture)));
      CHECK((back.qdot + flipped.qdot).norm() < tolerance);
    }
  }
}

TEST_CASE("the same arm in other units, or of another size, moves the same") {
  Random random(5);
  for (int repeat = 0; repeat < 2000; ++repeat) {
    const int n = random.integer(1, 9);
    const MatrixXd j = random.matrix(6, n);
    const VectorXd twist = random.vector(6);
    const double length_scale = random.decades(-1.0, 1.0);
    const double unit = random.chance(0.5) ? 1000.0 : random.decades(-1.0, 1.0);  // m to mm; ×0.1 … ×10
    MatrixXd other = j;
    VectorXd command = twist;
    other.topRows(3) *= unit;
    command.head(3) *= unit;
    for (const Method& method : all_methods()) {
      CAPTURE(repeat);
      CAPTURE(name(method));
      Method scaled = method;
      if (auto* dls = std::get_if<DampedLeastSquares>(&scaled)) dls->damping *= unit;  // λ is in the units of σ
      VelocitySolver a(method, length_scale), b(scaled, length_scale * unit);
      const Solution s = a.solve(j, twist), t = b.solve(other, command);
      // Close to a threshold, rounding may decide on the side.
      bool on_edge = false;
      for (int i = 0; i < s.singular_values.size(); ++i) {
        for (const double gamma : {0.1, 0.2}) {
          on_edge = on_edge || std::abs(s.singular_values[i] / s.singular_values[0] - gamma) < 1e-10;
        }
      }
      if (on_edge) continue;
      CHECK((s.qdot - t.qdot).norm() < 1e-10 * (1.0 + s.qdot.norm()));
      CHECK(s.singular == t.singular);
      CHECK(s.status == t.status);
      CHECK((s.singular_values * unit - t.singular_values).norm() < 1e-12 * t.singular_values[0]);
    }
  }
}

TEST_CASE("the length scale weighs angular rows: rows beyond the third, or the mask's") {
  Random random(6);
  for (int repeat = 0; repeat < 1000; ++repeat) {
    const int m = random.integer(1, 6), n = random.integer(1, 9);
    const double length_scale = random.decades(-1.0, 1.0);
    const MatrixXd j = random.matrix(m, n);
    const VectorXd twist = random.vector(m);
    MatrixXd weighted = j;
    VectorXd command = twist;
    for (int row = 3; row < m; ++row) {
      weighted.row(row) *= length_scale;
      command[row] *= length_scale;
    }
    VelocitySolver a(DampedLeastSquares{}, length_scale), b(DampedLeastSquares{}, 1.0);
    const Solution s = a.solve(j, twist), t = b.solve(weighted, command);
    CHECK((s.qdot - t.qdot).norm() < 1e-12 * (1.0 + s.qdot.norm()));
    CHECK((s.singular_values - t.singular_values).norm() < 1e-13 * t.singular_values[0]);
    CHECK((s.achieved_twist - j * s.qdot).norm() < 1e-13 * (1.0 + j.norm() * s.qdot.norm()));
    CHECK((s.directions.transpose() * s.directions - MatrixXd::Identity(m, m)).norm() < 1e-13);
  }
}

TEST_CASE("directions and singular values are a decomposition of the task's Jacobian") {
  Random random(7);
  for (int repeat = 0; repeat < 500; ++repeat) {
    const int n = random.integer(1, 9);
    const MatrixXd j = random.matrix(6, n);
    Task task;
    task.mask = {true, true, true, false, true, false};
    VelocitySolver solver(JParse{}, 0.5, task);
    const Solution s = solver.solve(j, random.vector(6));
    MatrixXd rows(4, n);
    rows << j.topRows(3), 0.5 * j.row(4);
    const MatrixXd square = s.directions.transpose() * rows * rows.transpose() * s.directions;
    VectorXd expected = VectorXd::Zero(4);
    expected.head(s.singular_values.size()) = s.singular_values.cwiseAbs2();
    CHECK((square - MatrixXd(expected.asDiagonal())).cwiseAbs().maxCoeff() < 1e-12 * (1.0 + expected[0]));
  }
}

TEST_CASE("a warm start changes nothing that can be seen; reset() gives the same bits as a new solver") {
  Random random(8);
  for (int repeat = 0; repeat < 40; ++repeat) {
    const int m = random.integer(1, 6), n = random.integer(1, 9);
    const MatrixXd a = random.matrix(m, n), b = random.matrix(m, n);
    const VectorXd twist = random.vector(m);
    VelocitySolver warm(JParse{}), used(JParse{});
    for (int step = 0; step < 100; ++step) {
      const MatrixXd j = std::cos(0.01 * step) * a + std::sin(0.01 * step) * b;
      VelocitySolver cold(JParse{});
      const Solution s = warm.solve(j, twist), t = cold.solve(j, twist);
      CHECK((s.qdot - t.qdot).norm() < 1e-9 * (1.0 + t.qdot.norm()));
      used.reset();
      const Solution u = used.solve(j, twist);
      CHECK(u.qdot == t.qdot);
      CHECK(u.directions == t.directions);
    }
  }
}

TEST_CASE("the rule may be changed on the way") {
  Random random(9);
  const MatrixXd j = random.matrix(6, 7);
  const VectorXd twist = random.vector(6);
  VelocitySolver solver(PseudoInverse{});
  solver.solve(j, twist);
  solver.set_method(DampedLeastSquares{0.5});
  CHECK(std::string(name(solver.method())) == "DampedLeastSquares");
  VelocitySolver fresh(DampedLeastSquares{0.5});
  CHECK((solver.solve(j, twist).qdot - fresh.solve(j, twist).qdot).norm() < 1e-13);
  CHECK_THROWS_AS(solver.set_method(DampedLeastSquares{-1.0}), Error);
  CHECK(std::get<DampedLeastSquares>(solver.method()).damping == 0.5);
}

TEST_CASE("set-up refuses what makes no sense") {
  for (const double bad : {0.0, -1.0, kNan, kInfinity, -kInfinity}) {
    CHECK_THROWS_AS(VelocitySolver(JParse{}, bad), Error);
    CHECK_THROWS_AS(VelocitySolver(JParse{bad}), Error);
  }
}

TEST_CASE("bad input: zero velocity and a status, and no trace afterwards") {
  Random random(10);
  for (int repeat = 0; repeat < 300; ++repeat) {
    const int m = random.integer(1, 6), n = random.integer(1, 16);
    const MatrixXd j = random.matrix(m, n);
    const VectorXd twist = random.vector(m), posture = random.vector(n);
    VelocitySolver solver(JParse{}), untouched(JParse{});
    solver.solve(j, twist, posture);
    untouched.solve(j, twist, posture);
    const auto refused = [&](const Solution& s) {
      CHECK(s.status == Status::BadInput);
      CHECK(s.qdot.size() == n);
      CHECK(s.qdot.isZero(0.0));
      CHECK(s.achieved_twist.isZero(0.0));
      CHECK(s.singular_values.allFinite());
      CHECK(s.directions.allFinite());
    };
    for (const double bad : {kNan, kInfinity, -kInfinity}) {
      MatrixXd bad_j = j;
      bad_j(random.integer(0, m - 1), random.integer(0, n - 1)) = bad;
      refused(solver.solve(bad_j, twist, posture));
      VectorXd bad_twist = twist;
      bad_twist[random.integer(0, m - 1)] = bad;
      refused(solver.solve(j, bad_twist, posture));
      VectorXd bad_posture = posture;
      bad_posture[random.integer(0, n - 1)] = bad;
      refused(solver.solve(j, twist, bad_posture));
    }
    const VectorXd longer = random.vector(m + 1), shorter = random.vector(m - 1);
    if (m < 6) refused(solver.solve(j, longer, posture));
    if (m > 1) refused(solver.solve(j, shorter, posture));
    if (n < 16) refused(solver.solve(j, twist, VectorXd(random.vector(n + 1))));
    if (n > 1) refused(solver.solve(j, twist, VectorXd(random.vector(n - 1))));
    const Solution a = solver.solve(j, twist, posture), b = untouched.solve(j, twist, posture);
    CHECK(a.qdot == b.qdot);
    CHECK(a.status == b.status);
  }
}

TEST_CASE("sizes beyond every bound are refused, not copied") {
  Random random(11);
  VelocitySolver solver(JParse{});
  const MatrixXd j = random.matrix(6, 7), tall = random.matrix(9, 7), wide = random.matrix(6, 40);
  const VectorXd twist = random.vector(6), long_twist = random.vector(40), long_posture = random.vector(40);
  CHECK(solver.solve(tall, twist).status == Status::BadInput);
  CHECK(solver.solve(wide, twist).status == Status::BadInput);
  CHECK(solver.solve(j, long_twist).status == Status::BadInput);
  CHECK(solver.solve(j, twist, long_posture).status == Status::BadInput);
  CHECK(solver.solve(tall, long_twist, long_posture).status == Status::BadInput);
  const MatrixXd none(6, 0), nothing(0, 7);
  CHECK(solver.solve(none, twist).status == Status::BadInput);
  CHECK(solver.solve(nothing, VectorXd()).status == Status::BadInput);
  CHECK(solver.solve(j, twist).status == Status::Ok);
}

TEST_CASE("a mask and a Jacobian whose rows do not fit are refused") {
  Random random(12);
  Task task;
  task.mask = {true, true, true, false, false, false};
  VelocitySolver solver(JParse{}, 1.0, task);
  for (int m = 1; m <= 6; ++m) {
    const Solution s = solver.solve(random.matrix(m, 7), random.vector(m));
    CHECK((s.status != Status::BadInput) == (m == 3 || m == 6));
  }
  task.frame = Frame::Tool;
  VelocitySolver tool(JParse{}, 1.0, task);
  Eigen::Matrix3d rotation = random.rotation();
  rotation(1, 1) = kNan;
  CHECK(tool.solve(random.matrix(6, 7), random.vector(6), JointVector(), rotation).status == Status::BadInput);
}

TEST_CASE("huge and tiny numbers: finite or refused, and no trace afterwards") {
  Random random(13);
  for (const Method& method : all_methods()) {
    VelocitySolver solver(method), scaled(method, 1e300);
    for (int repeat = 0; repeat < 1000; ++repeat) {
      const int n = 7;
      const MatrixXd j = random.matrix(6, n) * random.decades(-323.0, 307.9);
      const VectorXd twist = random.vector(6) * random.decades(-323.0, 307.9);
      const VectorXd posture = random.vector(n) * random.decades(-323.0, 307.9);
      CAPTURE(name(method));
      CAPTURE(repeat);
      for (VelocitySolver* s : {&solver, &scaled}) {
        for (const Solution& t : {s->solve(j, twist), s->solve(j, twist, posture)}) {
          CHECK(t.qdot.allFinite());
          CHECK(t.achieved_twist.allFinite());
          CHECK(t.singular_values.allFinite());
          CHECK(t.directions.allFinite());
          if (t.status == Status::BadInput) CHECK(t.qdot.isZero(0.0));
        }
      }
    }
    const MatrixXd j = random.matrix(6, 7);
    const VectorXd twist = random.vector(6);
    VelocitySolver fresh(method);
    const Solution a = solver.solve(j, twist), b = fresh.solve(j, twist);
    CHECK((a.qdot - b.qdot).norm() < 1e-9 * (1.0 + b.qdot.norm()));
  }
}

TEST_CASE("random arms of 1 to 9 joints: regular directions are exact") {
  Random random(14);
  for (int repeat = 0; repeat < 1500; ++repeat) {
    const int n = random.integer(1, 9);
    const Chain chain = random.chain(n, 0.2);
    ChainState state;
    REQUIRE(update(chain, random.configuration(n), state));
    const double length_scale = random.decades(-1.0, 1.0);
    const VectorXd twist = random.vector(6);
    for (const Method& method :
         {Method(JParse{0.1, 2.0, 0.5}), Method(JacobianProjection{}), Method(JacobianSafety{}),
          Method(PseudoInverse{}), Method(AdaptiveDampedLeastSquares{}), Method(JacobianSafetyProjection{})}) {
      VelocitySolver solver(method, length_scale);
      const Solution s = solver.solve(state.jacobian, twist, JointVector(random.vector(n)));
      VectorXd missed = s.achieved_twist - twist;
      missed.tail(3) *= length_scale;
      for (int i = 0; i < 6; ++i) {
        const bool projection = std::holds_alternative<JacobianProjection>(method);
        if ((s.singular >> i & 1u) != 0 || projection) continue;
        CHECK(std::abs(s.directions.col(i).dot(missed)) < 1e-10 * (1.0 + s.qdot.norm() * s.singular_values[0]));
      }
    }
  }
}

TEST_CASE("along the error, J-PARSE with equal gains never moves away from the target") {
  Random random(15);
  for (int repeat = 0; repeat < 5000; ++repeat) {
    const int m = random.integer(1, 6), n = random.integer(1, 9);
    const MatrixXd j = random.with_singular_values(m, n, test::random_singular_values(random, std::min(m, n), 1.0));
    const VectorXd error = random.vector(m);
    for (const bool continuous : {true, false}) {
      const double k = random.uniform(0.0, 5.0);
      VelocitySolver solver(JParse{random.uniform(0.01, 1.0), k, k, continuous});
      // eᵀ J q̇ = −½ d/dt eᵀe
      CHECK(error.dot(solver.solve(j, error).achieved_twist) >= -1e-13 * error.squaredNorm());
    }
  }
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("the watch on the heap counts every call") {
  const auto seen = [](auto work) {
    const test::HeapWatch watch;
    work();
    return watch.calls();
  };
  CHECK(seen([] {}) == 0);
  CHECK(seen([] { const std::unique_ptr<volatile int> p(new volatile int(1)); }) == 2);
  CHECK(seen([] {
          const auto p = std::make_unique<std::string>(100, 'x');
          CHECK(p->size() == 100);
        }) >= 4);
  CHECK(seen([] {
          const VectorXd x = VectorXd::Constant(7, 1.0);
          CHECK(x.sum() == 7.0);
        }) >= 2);
  volatile std::size_t size = 64;
  void* volatile kept = nullptr;  // keeps a compiler from leaving out memory that nobody uses
  const auto free_again = [&](void* block) {
    kept = block;
    std::free(kept);
  };
  CHECK(seen([&] { free_again(std::malloc(size)); }) == 2);
  CHECK(seen([&] { free_again(std::calloc(size, 2)); }) == 2);
  CHECK(seen([&] {
          void* const block = std::malloc(size);
          kept = block;
          free_again(std::realloc(block, 2 * size));
        }) == 3);
  CHECK(seen([&] { free_again(std::aligned_alloc(64, size)); }) == 2);
}

TEST_CASE("decompose(), solve(), update() and jacobian_gradient() leave the heap alone") {
  Random random(16);
  for (const Method& method : all_methods()) {
    for (int m = 1; m <= 6; ++m) {
      for (int n = 1; n <= 16; ++n) {
        const MatrixXd regular = random.matrix(m, n), zero = MatrixXd::Zero(m, n);
        const VectorXd twist = random.vector(m), posture_values = random.vector(n), wrong = random.vector(m % 6 + 1);
        const JointVector posture = posture_values;
        VelocitySolver solver(method, 0.5);
        Spectrum spectrum;
        Solution s;
        const test::HeapWatch watch;
        for (const MatrixXd* j : {&regular, &zero, &regular}) {
          spectrum.decompose(*j);
          s = solver.solve(*j, twist);
          s = solver.solve(*j, twist, posture);
          s = solver.solve(*j, wrong, posture);
        }
        CHECK(watch.calls() == 0);
      }
    }
    for (unsigned bits = 1; bits < 64; bits += 3) {
      for (const Frame frame : {Frame::Base, Frame::Tool}) {
        Task task;
        for (unsigned i = 0; i < 6; ++i) task.mask[i] = (bits >> i & 1u) != 0;
        task.frame = frame;
        VelocitySolver solver(method, 0.5, task);
        const MatrixXd j = random.matrix(6, 7);
        const VectorXd twist = random.vector(6);
        const Eigen::Matrix3d rotation = random.rotation();
        const test::HeapWatch watch;
        const Solution s = solver.solve(j, twist, JointVector(), rotation);
        CHECK(watch.calls() == 0);
        CHECK(s.status != Status::BadInput);
      }
    }
  }
  for (int n = 1; n <= 16; ++n) {
    const Chain chain = random.chain(n, 0.3);
    const VectorXd q = random.configuration(n);
    ChainState state;
    const auto gradient = std::make_unique<JacobianGradient>();
    Pose tip;
    const test::HeapWatch watch;
    CHECK(update(chain, q, state));
    tip = pose(chain, q);
    jacobian_gradient(state.jacobian, *gradient);
    CHECK_FALSE(update(chain, VectorXd::Constant(n, kNan).eval(), state));
    CHECK(watch.calls() == 2);  // the vector of NaN that was made here
    CHECK(tip.matrix() == state.tip.matrix());
  }
}
#endif
