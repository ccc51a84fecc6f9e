// solve_batch() is a loop of fresh solvers, whatever the number of threads.

#include <doctest/doctest.h>

#include <limits>

#include <sigmaik/batch.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/velocity_solver.hpp>

#include "methods.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::all_methods;
using test::MatrixXd;
using test::Random;
using test::VectorXd;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct Problem {
  BatchShape shape;
  std::vector<double> jacobian, twist;

  MatrixXd j(std::size_t b) const {
    return Eigen::Map<const RowMajor>(jacobian.data() + b * static_cast<std::size_t>(shape.rows * shape.cols),
                                      shape.rows, shape.cols);
  }
  VectorXd x(std::size_t b) const {
    return Eigen::Map<const VectorXd>(twist.data() + b * static_cast<std::size_t>(shape.rows), shape.rows);
  }
};

Problem random_problem(Random& random, std::size_t count, int m, int n) {
  Problem p{{count, m, n}, {}, {}};
  for (std::size_t b = 0; b < count; ++b) {
    const RowMajor j = random.with_singular_values(m, n, test::random_singular_values(random, std::min(m, n), 1.0));
    p.jacobian.insert(p.jacobian.end(), j.data(), j.data() + j.size());
    const VectorXd x = random.vector(m);
    p.twist.insert(p.twist.end(), x.data(), x.data() + x.size());
  }
  return p;
}

}  // namespace

TEST_CASE("bit for bit a loop of fresh solvers, any size, any number of threads") {
  Random random(1);
  for (int m = 1; m <= 6; ++m) {
    for (int n = 1; n <= 16; n += (n < 9 ? 1 : 7)) {
      const Problem p = random_problem(random, 40, m, n);
      for (const Method& method : all_methods()) {
        CAPTURE(m);
        CAPTURE(n);
        CAPTURE(name(method));
        std::vector<double> expected;
        std::vector<std::int8_t> expected_status;
        for (std::size_t b = 0; b < p.shape.count; ++b) {
          VelocitySolver solver(method, 0.7);
          const Solution s = solver.solve(p.j(b), p.x(b));
          expected.insert(expected.end(), s.qdot.data(), s.qdot.data() + n);
          expected_status.push_back(static_cast<std::int8_t>(s.status));
        }
        for (const int threads : {1, 2, 3, 7, 40, 41, 100}) {
          std::vector<double> qdot(p.shape.count * static_cast<std::size_t>(n), -1.0);
          std::vector<std::int8_t> status(p.shape.count, -1);
          solve_batch(method, 0.7, p.shape, p.jacobian.data(), p.twist.data(), qdot.data(), status.data(), threads);
          CHECK(qdot == expected);
          CHECK(status == expected_status);
        }
        std::vector<double> qdot(p.shape.count * static_cast<std::size_t>(n), -1.0);
        solve_batch(method, 0.7, p.shape, p.jacobian.data(), p.twist.data(), qdot.data());
        CHECK(qdot == expected);
      }
    }
  }
}

TEST_CASE("a problem that is not finite gives zero, and does not change the others") {
  Random random(2);
  for (const int threads : {1, 3}) {
    Problem p = random_problem(random, 30, 6, 7);
    std::vector<double> clean(30 * 7), qdot(30 * 7, -1.0);
    solve_batch(JParse{}, 1.0, p.shape, p.jacobian.data(), p.twist.data(), clean.data());
    p.jacobian[4 * 42 + 5] = std::numeric_limits<double>::quiet_NaN();
    p.twist[9 * 6 + 1] = std::numeric_limits<double>::infinity();
    std::vector<std::int8_t> status(30, -1);
    solve_batch(JParse{}, 1.0, p.shape, p.jacobian.data(), p.twist.data(), qdot.data(), status.data(), threads);
    for (std::size_t b = 0; b < 30; ++b) {
      const bool bad = b == 4 || b == 9;
      CHECK((status[b] == static_cast<std::int8_t>(Status::BadInput)) == bad);
      for (std::size_t i = 0; i < 7; ++i) CHECK(qdot[b * 7 + i] == (bad ? 0.0 : clean[b * 7 + i]));
    }
  }
}

TEST_CASE("an empty batch does nothing") {
  for (const int threads : {1, 4})
    CHECK_NOTHROW(solve_batch(JParse{}, 1.0, {0, 6, 7}, nullptr, nullptr, nullptr, nullptr, threads));
}

TEST_CASE("shapes and parameters out of their range are refused before anything is written") {
  const std::vector<double> j(1000, 1.0), x(100, 1.0);
  std::vector<double> qdot(100, -1.0);
  const auto refuses = [&](const Method& method, double length_scale, const BatchShape& shape, int threads) {
    CHECK_THROWS_AS(solve_batch(method, length_scale, shape, j.data(), x.data(), qdot.data(), nullptr, threads), Error);
    for (const double q : qdot) REQUIRE(q == -1.0);
  };
  for (const int bad : {0, -1, 7, 1000}) refuses(JParse{}, 1.0, {1, bad, 7}, 1);
  for (const int bad : {0, -1, 17, 1000}) refuses(JParse{}, 1.0, {1, 6, bad}, 1);
  for (const int bad : {0, -1, -1000}) refuses(JParse{}, 1.0, {1, 6, 7}, bad);
  for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    refuses(JParse{}, bad, {1, 6, 7}, 1);
    refuses(JParse{bad}, 1.0, {1, 6, 7}, 1);
  }
}

TEST_CASE("more threads than problems, and than the machine has") {
  Random random(3);
  const Problem p = random_problem(random, 5000, 3, 4);
  std::vector<double> one(5000 * 4), many(5000 * 4);
  solve_batch(JParse{}, 1.0, p.shape, p.jacobian.data(), p.twist.data(), one.data(), nullptr, 1);
  solve_batch(JParse{}, 1.0, p.shape, p.jacobian.data(), p.twist.data(), many.data(), nullptr, 1000);
  CHECK(one == many);
  solve_batch(JParse{}, 1.0, p.shape, p.jacobian.data(), p.twist.data(), many.data(), nullptr,
              std::numeric_limits<int>::max());
  CHECK(one == many);
}
