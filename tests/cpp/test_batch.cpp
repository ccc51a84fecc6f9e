// solve_batch() answers as fresh solvers do, and each answer is the same to the last bit wherever its problem stands.

#include <doctest/doctest.h>

#include <algorithm>
#include <limits>

#include <sigmaik/batch.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/velocity_solver.hpp>

#include "heap.hpp"
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

TEST_CASE("answers and statuses are those of fresh solvers to 1e-9, exactly singular Jacobians included") {
  Random random(1);
  for (int m = 1; m <= 6; ++m) {
    for (int n = 1; n <= 16; n += (n < 9 ? 1 : 7)) {
      const Problem p = random_problem(random, 60, m, n);
      for (const Method& method : all_methods()) {
        CAPTURE(m);
        CAPTURE(n);
        CAPTURE(name(method));
        std::vector<double> qdot(p.shape.count * static_cast<std::size_t>(n), -1.0), without_status = qdot;
        std::vector<std::int8_t> status(p.shape.count, -1);
        solve_batch(method, 0.7, p.shape, p.jacobian.data(), p.twist.data(), qdot.data(), status.data());
        solve_batch(method, 0.7, p.shape, p.jacobian.data(), p.twist.data(), without_status.data());
        for (std::size_t b = 0; b < p.shape.count; ++b) {
          VelocitySolver solver(method, 0.7);
          const Solution s = solver.solve(p.j(b), p.x(b));
          const auto row = [&](const std::vector<double>& rows) {
            return Eigen::Map<const VectorXd>(rows.data() + b * static_cast<std::size_t>(n), n);
          };
          const double size = s.qdot.cwiseAbs().maxCoeff();
          CHECK((row(qdot) - s.qdot).cwiseAbs().maxCoeff() <= 1e-9 * size);
          CHECK((row(without_status) - s.qdot).cwiseAbs().maxCoeff() <= 1e-9 * size);
          CHECK(status[b] == static_cast<std::int8_t>(s.status));
        }
      }
    }
  }
}

TEST_CASE("an answer depends, to the last bit, on its own problem alone: not on neighbours, place, size or threads") {
  Random random(4);
  for (const int m : {1, 3, 5, 6}) {
    for (const int n : {2, 6, 7, 16}) {
      const Problem p = random_problem(random, 41, m, n);
      for (const Method& method : all_methods()) {
        CAPTURE(m);
        CAPTURE(n);
        CAPTURE(name(method));
        const auto width = static_cast<std::size_t>(n);
        std::vector<double> all(p.shape.count * width), alone(p.shape.count * width), other(p.shape.count * width);
        solve_batch(method, 0.7, p.shape, p.jacobian.data(), p.twist.data(), all.data());
        for (std::size_t b = 0; b < p.shape.count; ++b) {
          solve_batch(method, 0.7, {1, m, n}, p.jacobian.data() + b * static_cast<std::size_t>(m * n),
                      p.twist.data() + b * static_cast<std::size_t>(m), alone.data() + b * width);
        }
        CHECK(alone == all);
        for (const int threads : {2, 3, 7, 40, 41, 100}) {
          solve_batch(method, 0.7, p.shape, p.jacobian.data(), p.twist.data(), other.data(), nullptr, threads);
          CHECK(other == all);
        }
        // Shifted by three places: other lanes, other neighbours.
        const std::size_t from = 3;
        solve_batch(method, 0.7, {p.shape.count - from, m, n},
                    p.jacobian.data() + from * static_cast<std::size_t>(m * n),
                    p.twist.data() + from * static_cast<std::size_t>(m), other.data());
        CHECK(std::equal(all.begin() + static_cast<std::ptrdiff_t>(from * width), all.end(), other.begin()));
      }
    }
  }
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("a batch on one thread uses no heap") {
  Random random(5);
  const Problem p = random_problem(random, 100, 6, 7);
  std::vector<double> qdot(700);
  std::vector<std::int8_t> status(100);
  for (const Method& method : all_methods()) {
    const test::HeapWatch watch;
    solve_batch(method, 0.7, p.shape, p.jacobian.data(), p.twist.data(), qdot.data(), status.data());
    CHECK(watch.calls() == 0);
  }
}
#endif

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
