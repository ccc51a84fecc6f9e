#include <doctest/doctest.h>

#include <sigmaik/error.hpp>
#include <sigmaik/indices.hpp>

#include "arms.hpp"
#include "heap.hpp"
#include "oracles.hpp"
#include "random.hpp"

using namespace sigmaik;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using test::Random;

namespace {

constexpr Index kAll[] = {Index::Manipulability, Index::ConditionNumber, Index::MinSingularValue, Index::GeometryAware};

// ‖log(Σ^{-1/2} M Σ^{-1/2})‖_F² by generalised eigenvalues.
double distance(const MatrixXd& m, const MatrixXd& sigma) {
  return test::generalised_eigenvalues(m, sigma).array().log().square().sum();
}

TaskMatrix positive(Random& random, int m) {
  const MatrixXd a = random.matrix(m, m + 2);
  return a * a.transpose();
}

}  // namespace

TEST_CASE("values are those of the definitions") {
  Random random(1);
  for (int trial = 0; trial < 3000; ++trial) {
    const int m = random.integer(1, 6), n = random.integer(m, 16);
    const MatrixXd j = random.decades(-1, 1) * random.matrix(m, n);
    const VectorXd sigma = test::singular_values(j);
    const MatrixXd gram = j * j.transpose();
    CHECK(manipulability(j) == doctest::Approx(std::sqrt(gram.determinant())).epsilon(1e-8));
    CHECK(manipulability(j) == doctest::Approx(sigma.prod()).epsilon(1e-12));
    CHECK(condition_number(j) == doctest::Approx(sigma[0] / sigma[m - 1]).epsilon(1e-11));
    CHECK(min_singular_value(j) == doctest::Approx(sigma[m - 1]).epsilon(1e-11));
    const double k = random.decades(-1, 1);
    CHECK(geometry_aware(j, k) == doctest::Approx(distance(gram, k * MatrixXd::Identity(m, m))).epsilon(1e-8));
    const TaskMatrix given = positive(random, m);
    const double xi = IndexFunction(Index::GeometryAware, {.sigma = given}).value(j);
    CHECK(xi == doctest::Approx(distance(gram, given)).epsilon(1e-7));
    // Affine invariance: M → AMAᵀ, Σ → AΣAᵀ. The distance from M to I is also the distance from M⁻¹ to I.
    const MatrixXd a = random.matrix(m, m) + 3.0 * MatrixXd::Identity(m, m);
    TaskMatrix moved = a * given * a.transpose();
    moved = 0.5 * (moved + moved.transpose()).eval();
    CHECK(IndexFunction(Index::GeometryAware, {.sigma = moved}).value(a * j) == doctest::Approx(xi).epsilon(1e-6));
    const MatrixXd inverse = test::pseudo_inverse(j).transpose();
    CHECK(geometry_aware(inverse, 1.0) == doctest::Approx(geometry_aware(j, 1.0)).epsilon(1e-8));
    // The distance is zero at Σ itself.
    const MatrixXd root = test::cholesky(given);
    CHECK(IndexFunction(Index::GeometryAware, {.sigma = given}).value(root) < 1e-18);
  }
}

TEST_CASE("at a singularity") {
  Random random(2);
  const double infinity = std::numeric_limits<double>::infinity();
  for (int trial = 0; trial < 200; ++trial) {
    const int m = random.integer(2, 6), n = random.integer(1, 16);
    MatrixXd j = random.matrix(m, n);
    if (n >= m) j.row(random.integer(0, m - 1)).setZero();
    CHECK(manipulability(j) == 0.0);
    CHECK(min_singular_value(j) == 0.0);
    CHECK(condition_number(j) == infinity);
    CHECK(geometry_aware(j) == infinity);
  }
  CHECK(condition_number(MatrixXd::Zero(6, 7)) == infinity);
  CHECK(geometry_aware(MatrixXd::Zero(6, 7)) == infinity);
  // Exactly singular chains: two parallel axes in one line.
  for (const Index index : kAll) {
    std::vector<Segment> segments;
    for (int i = 0; i < 7; ++i) {
      Segment s;
      s.joint_name = "j" + std::to_string(i);
      s.link_name = "l" + std::to_string(i);
      s.type = JointType::Revolute;
      s.axis = i % 3 == 0 ? Eigen::Vector3d::UnitX() : i % 3 == 1 ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ();
      segments.push_back(s);  // all through one point: rank 3
    }
    JointVector gradient(7);
    const double value = IndexFunction(index).value(Chain("base", segments), JointVector::Constant(7, 0.3), gradient);
    CHECK(gradient.allFinite());
    CHECK(value == (index == Index::ConditionNumber || index == Index::GeometryAware ? infinity : 0.0));
  }
}

TEST_CASE("gradients") {
  Random random(3);
  int cases = 0;
  for (int trial = 0; trial < 1500; ++trial) {
    const int n = random.integer(6, 16);
    const Chain chain = random.chain(n, 0.2);
    const JointVector q = random.configuration(n);
    for (const Index index : kAll) {
      IndexOptions options{.k = random.decades(-1, 1), .length_scale = random.decades(-0.5, 0.5)};
      if (random.chance(0.5)) options.sigma = positive(random, 6);
      const IndexFunction function(index, options);
      const auto at = [&](const JointVector& x) {
        ChainState state;
        update(chain, x, state);
        return function.value(state.jacobian);
      };
      JointVector gradient(n), ignored(n);
      const double value = function.value(chain, q, gradient);
      if (std::isinf(value)) {
        CHECK(std::isinf(at(q)));
        CHECK(gradient.isZero(0.0));
        continue;
      }
      CHECK(value == doctest::Approx(at(q)).epsilon(1e-12));
      ChainState state;
      update(chain, q, state);
      Jacobian weighted = state.jacobian;
      weighted.bottomRows<3>() *= options.length_scale;
      const VectorXd sigma = test::singular_values(MatrixXd(weighted));
      // σ_1 and σ_6 have derivatives where they are simple, and differences find these where they are not too curved.
      if (sigma[5] < 1e-2 * sigma[0]) continue;
      const bool simple = sigma[4] - sigma[5] > 1e-2 * sigma[0] && sigma[0] - sigma[1] > 1e-2 * sigma[0];
      if (!simple && (index == Index::MinSingularValue || index == Index::ConditionNumber)) continue;
      ++cases;
      JointVector differences(n);
      for (int k = 0; k < n; ++k) {
        const auto shifted = [&](double step) {
          JointVector x = q;
          x[k] += step;
          return at(x);
        };
        const double h = 1e-4;  // of fourth order
        differences[k] = (8.0 * (shifted(h) - shifted(-h)) - (shifted(2.0 * h) - shifted(-2.0 * h))) / (12.0 * h);
      }
      CHECK((gradient - differences).norm() < 1e-6 * (differences.norm() + 1e-3 * std::abs(value)));
    }
  }
  CHECK(cases > 3000);
}

TEST_CASE("base and threads do not matter, units do as they should") {
  Random random(4);
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    const int n = arm.dof();
    std::vector<Segment> segments = arm.segments();
    segments.front().origin = random.pose() * segments.front().origin;
    const Chain moved("table", segments);
    const std::size_t count = 101;
    const MatrixXd q = MatrixXd::NullaryExpr(n, static_cast<Eigen::Index>(count),
                                             [&] { return random.uniform(-2.0, 2.0); });
    for (const Index index : kAll) {
      const IndexFunction function(index);
      std::vector<double> one(count), two(count), g1(count * static_cast<std::size_t>(n)), g2(g1);
      evaluate(arm, function, count, q.data(), one.data(), g1.data(), 1);
      evaluate(arm, function, count, q.data(), two.data(), g2.data(), 3);
      CHECK(one == two);
      CHECK(g1 == g2);
      evaluate(arm, function, count, q.data(), two.data());
      for (std::size_t i = 0; i < count; ++i) CHECK(one[i] == doctest::Approx(two[i]).epsilon(1e-12));
      evaluate(moved, function, count, q.data(), two.data(), g2.data());
      for (std::size_t i = 0; i < count; ++i) CHECK(one[i] == doctest::Approx(two[i]).epsilon(1e-8));
    }
    const double k = reference_scale(arm);
    CHECK(k == reference_scale(arm));
    double largest = 0.0;
    for (int trial = 0; trial < 5000; ++trial) {
      JointVector x(n);
      for (int i = 0; i < n; ++i) {
        x[i] = random.uniform(std::max(arm.limits().lower[i], -M_PI), std::min(arm.limits().upper[i], M_PI));
      }
      ChainState state;
      update(arm, x, state);
      largest = std::max(largest, std::pow(test::singular_values(MatrixXd(state.jacobian))[0], 2));
    }
    CAPTURE(name);
    CHECK(k >= largest);
    CHECK(k < std::max(6.0, 1.35 * largest) + 1e-9);
  }
}

TEST_CASE("what is refused") {
  CHECK_THROWS_AS(IndexFunction(Index::GeometryAware, {.k = 0.0}), Error);
  CHECK_THROWS_AS(IndexFunction(Index::Manipulability, {.length_scale = -1.0}), Error);
  CHECK_THROWS_AS(IndexFunction(Index::GeometryAware, {.sigma = TaskMatrix::Zero(6, 6)}), Error);
  CHECK_THROWS_AS(IndexFunction(Index::GeometryAware, {.sigma = TaskMatrix::Identity(6, 5)}), Error);
  TaskMatrix skew = TaskMatrix::Identity(6, 6);
  skew(0, 1) = 0.5;
  CHECK_THROWS_AS(IndexFunction(Index::GeometryAware, {.sigma = skew}), Error);
  double value;
  const JointVector zero = JointVector::Zero(7);
  CHECK_THROWS_AS(evaluate(test::arms().at("franka_panda"), IndexFunction(Index::Manipulability), 1, zero.data(),
                           &value, nullptr, 0),
                  Error);
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("no heap") {
  const Chain& chain = test::arms().at("franka_panda");
  const JointVector q = JointVector::Constant(7, 0.5);
  JointVector gradient(7);
  ChainState state;
  update(chain, q, state);
  for (const Index index : kAll) {
    const IndexFunction plain(index), whitened(index, {.sigma = TaskMatrix(2.0 * TaskMatrix::Identity(6, 6))});
    const test::HeapWatch heap;
    double sum = plain.value(chain, q, gradient) + whitened.value(chain, q, gradient);
    sum += plain.value(state.jacobian) + whitened.value(state.jacobian) + geometry_aware(state.jacobian);
    CHECK(heap.calls() == 0);
    CHECK(sum > 0.0);
  }
}
#endif
