// Bounded least squares by the conditions of optimality: level by level, the gradient of the objective lies in the cone
// of the constraints that hold it. An independent non-negative least squares (Lawson and Hanson 1974, ch. 23) measures
// the distance from this cone, so that degenerate and rank-deficient problems need no exception.

#include <doctest/doctest.h>

#include <vector>

#include <sigmaik/least_squares.hpp>

#include "heap.hpp"
#include "numbers.hpp"
#include "oracles.hpp"
#include "random.hpp"

using namespace sigmaik;
using test::kInfinity;
using test::MatrixXd;
using test::Random;
using test::VectorXd;

namespace {

// min |E y − f|, y ≥ 0, by Lawson and Hanson's algorithm. Returns the residual's length.
double distance_to_cone(const MatrixXd& E, const VectorXd& f) {
  const auto n = E.cols();
  VectorXd y = VectorXd::Zero(n);
  std::vector<bool> passive(static_cast<std::size_t>(n), false);
  VectorXd r = f;
  for (int outer = 0; outer < 10 * n + 10; ++outer) {
    const VectorXd w = E.transpose() * r;
    Eigen::Index best = -1;
    double most = 1e-12 * (1.0 + f.norm());
    for (Eigen::Index j = 0; j < n; ++j) {
      const double length = E.col(j).norm();
      if (!passive[static_cast<std::size_t>(j)] && length > 0.0 && w[j] / length > most) {
        most = w[j] / length;
        best = j;
      }
    }
    if (best < 0) break;
    passive[static_cast<std::size_t>(best)] = true;
    for (int inner = 0; inner < 2 * n + 10; ++inner) {
      std::vector<Eigen::Index> set;
      for (Eigen::Index j = 0; j < n; ++j) {
        if (passive[static_cast<std::size_t>(j)]) set.push_back(j);
      }
      MatrixXd part(E.rows(), static_cast<Eigen::Index>(set.size()));
      for (std::size_t k = 0; k < set.size(); ++k) part.col(static_cast<Eigen::Index>(k)) = E.col(set[k]);
      const VectorXd z = test::least_squares(part, f);
      double step = 1.0;
      for (std::size_t k = 0; k < set.size(); ++k) {
        const double zk = z[static_cast<Eigen::Index>(k)];
        if (zk <= 0.0) step = std::min(step, y[set[k]] / (y[set[k]] - zk + 1e-300));
      }
      for (std::size_t k = 0; k < set.size(); ++k) {
        y[set[k]] += step * (z[static_cast<Eigen::Index>(k)] - y[set[k]]);
        if (step < 1.0 && y[set[k]] <= 1e-14) {
          y[set[k]] = 0.0;
          passive[static_cast<std::size_t>(set[k])] = false;
        }
      }
      if (step >= 1.0) break;
    }
    r = f - E * y;
  }
  return r.norm();
}

struct Optimality {
  double bounds = 0.0;      // how far outside
  double residual[4] = {};  // distance of level's gradient from its cone, relative
  double worst() const { return std::max({residual[0], residual[1], residual[2], residual[3]}); }
};

Optimality measure(const LeastSquaresProblem& p, const VectorXd& x) {
  const auto n = x.size();
  Optimality out;
  std::vector<VectorXd> cone;  // directions that constraints may push in, all levels
  const auto unit = [&](Eigen::Index i) { return VectorXd(VectorXd::Unit(n, i)); };
  for (Eigen::Index i = 0; i < n; ++i) {
    const double low = p.lower.size() ? p.lower[i] : -kInfinity, high = p.upper.size() ? p.upper[i] : kInfinity;
    out.bounds = std::max({out.bounds, low - x[i], x[i] - high});
    if (x[i] <= low) cone.push_back(unit(i));
    if (x[i] >= high) cone.push_back(-unit(i));
  }
  const double size = 1.0 + x.norm();
  const auto check = [&](int level, const VectorXd& gradient, double scale) {
    MatrixXd E(n, static_cast<Eigen::Index>(cone.size()));
    for (std::size_t k = 0; k < cone.size(); ++k) E.col(static_cast<Eigen::Index>(k)) = cone[k];
    out.residual[level] = distance_to_cone(E, gradient / scale);
  };
  // The push of a constraint acts against the gradient: gradient = Σ pushes.
  if (p.G.rows() > 0) {
    VectorXd over = VectorXd::Zero(p.G.rows());
    for (Eigen::Index k = 0; k < p.G.rows(); ++k) {
      if (p.h[k] < kInfinity) over[k] = std::max(0.0, p.G.row(k).dot(x) - p.h[k]);
    }
    const double scale = 1e-300 + p.G.norm() * (over.norm() + p.G.norm() * size);
    check(0, p.G.transpose() * over, scale);
    for (Eigen::Index k = 0; k < p.G.rows(); ++k) {
      if (p.h[k] == kInfinity) continue;
      const double gap = p.G.row(k).dot(x) - p.h[k];
      const double noise = 1e-9 * (std::abs(p.h[k]) + p.G.row(k).norm() * size);
      const VectorXd g = p.G.row(k).transpose() / (1e-300 + p.G.row(k).norm());
      if (gap >= -noise) cone.push_back(-g);
      if (gap > noise) cone.push_back(g);
    }
  }
  if (p.C.rows() > 0) {
    const VectorXd r = p.C * x - p.d;
    check(1, p.C.transpose() * r, 1e-300 + p.C.norm() * (r.norm() + p.C.norm() * size));
    for (Eigen::Index k = 0; k < p.C.rows(); ++k) {
      const VectorXd c = p.C.row(k).transpose() / (1e-300 + p.C.row(k).norm());
      cone.push_back(c);
      cone.push_back(-c);
    }
  }
  if (p.A.rows() > 0) {
    const VectorXd r = p.A * x - p.b;
    check(2, p.A.transpose() * r, 1e-300 + p.A.norm() * (r.norm() + p.A.norm() * size));
    for (Eigen::Index k = 0; k < p.A.rows(); ++k) {
      const VectorXd a = p.A.row(k).transpose() / (1e-300 + p.A.row(k).norm());
      cone.push_back(a);
      cone.push_back(-a);
    }
  }
  check(3, x, size);
  return out;
}

enum class Kind { Plain, RankShort, Integers, Tight, Mixed };

MatrixXd random_matrix(Random& random, Eigen::Index m, Eigen::Index n, Kind kind) {
  const int rows = static_cast<int>(m), cols = static_cast<int>(n);
  if (rows == 0) return MatrixXd(0, cols);
  switch (kind) {
    case Kind::Integers: return MatrixXd::NullaryExpr(rows, cols, [&] { return random.integer(-2, 2); });
    case Kind::RankShort: {
      const int rank = random.integer(0, std::min(rows, cols));
      return rank == 0 ? MatrixXd::Zero(rows, cols) : MatrixXd(random.matrix(rows, rank) * random.matrix(rank, cols));
    }
    default: return random.matrix(rows, cols);
  }
}

LeastSquaresProblem random_problem(Random& random) {
  const Kind kind = static_cast<Kind>(random.integer(0, 4));
  const int n = random.chance(0.8) ? random.integer(1, 9) : random.integer(1, 16);
  const int m = random.integer(0, random.chance(0.8) ? 8 : 16);
  const int p = random.chance(0.4) ? 0 : random.integer(1, 8);
  const int k = random.chance(0.5) ? 0 : random.integer(1, random.chance(0.8) ? 8 : 32);
  LeastSquaresProblem out;
  const auto right = [&](const MatrixXd& matrix) -> VectorXd {
    const auto rows = static_cast<int>(matrix.rows());
    if (kind == Kind::Integers) return VectorXd::NullaryExpr(rows, [&] { return random.integer(-2, 2); });
    if (random.chance(0.1)) return VectorXd::Zero(rows);
    if (random.chance(0.3)) return matrix * random.vector(n);  // consistent
    return random.decades(-1, 1) * random.vector(rows);
  };
  const MatrixXd A = random_matrix(random, m, n, kind);
  out.A = A;
  out.b = right(A);
  const MatrixXd C = random_matrix(random, p, n, kind == Kind::Mixed ? Kind::RankShort : kind);
  out.C = C;
  out.d = right(C);
  const MatrixXd G = random_matrix(random, k, n, kind);
  out.G = G;
  out.h = random.chance(0.5) ? VectorXd(right(G)) : VectorXd(right(G).cwiseAbs());
  if (random.chance(0.9)) {
    out.lower.resize(n);
    out.upper.resize(n);
    for (int i = 0; i < n; ++i) {
      const double width = kind == Kind::Tight ? random.decades(-3, -0.5) : random.decades(-1, 0.5);
      double low = -width * random.uniform(-0.2, 1.0), high = low + width;
      if (kind == Kind::Integers) {
        low = random.integer(-2, 1);
        high = low + random.integer(0, 2);
      }
      if (random.chance(0.05)) high = low;
      if (random.chance(0.1)) low = -kInfinity;
      if (random.chance(0.1)) high = kInfinity;
      if (low == high && std::isinf(low)) high = 0.0;
      out.lower[i] = low;
      out.upper[i] = high;
    }
  }
  return out;
}

}  // namespace

TEST_CASE("optimal, level by level: random, rank-deficient, degenerate and infeasible problems") {
  Random random(1);
  LeastSquares solver;
  const char* many = std::getenv("SIGMAIK_STRESS");
  const int problems = many ? std::atoi(many) : 60000;
  int failed = 0, limited = 0, most_steps = 0;
  double worst = 0.0;
  for (int i = 0; i < problems; ++i) {
    const LeastSquaresProblem p = random_problem(random);
    if (random.chance(0.5)) solver.reset();
    const LeastSquaresSolution s = solver.solve(p);
    if (s.status == LeastSquaresStatus::BadInput)
      MESSAGE(i, " ", p.lower.transpose(), " ", p.upper.transpose(), " ", p.h.transpose(), " ", p.A.cols(), p.C.cols(),
              p.G.cols());
    REQUIRE(s.status != LeastSquaresStatus::BadInput);
    most_steps = std::max(most_steps, s.steps);
    limited += s.status == LeastSquaresStatus::StepLimit;
    const Optimality optimality = measure(p, s.x);
    REQUIRE(optimality.bounds <= 0.0);
    worst = std::max(worst, optimality.worst());
    if (s.status == LeastSquaresStatus::StepLimit)
      MESSAGE("limited ", i, " n ", s.x.size(), " m ", p.A.rows(), " p ", p.C.rows(), " k ", p.G.rows());
    if (optimality.worst() > 1e-7) {
      ++failed;
      if (failed <= 5) {
        MESSAGE("problem ", i, ": n ", s.x.size(), " m ", p.A.rows(), " p ", p.C.rows(), " k ", p.G.rows(), " status ",
                std::string(to_string(s.status)), " steps ", s.steps, " residuals ", optimality.residual[0], " ",
                optimality.residual[1], " ", optimality.residual[2], " ", optimality.residual[3]);
      }
    }
  }
  MESSAGE("worst ", worst, ", most steps ", most_steps);
  CHECK(failed == 0);
  CHECK(limited == 0);
}

// The problems of a servo's redistribution: joints inside bounds, a slack for each row, and a guess from another
// problem.
TEST_CASE("many bounds change at once, and the steps are about as many as the joints") {
  Random random(5);
  LeastSquares solver;
  int most = 0;
  long sum = 0;
  constexpr int kProblems = 3000, kJoints = 16, kRows = 6;
  for (int i = 0; i < kProblems; ++i) {
    LeastSquaresProblem p;
    p.C = RowMatrix::Zero(kRows, kJoints + kRows);
    p.C.leftCols(kJoints) = random.matrix(kRows, kJoints);
    p.C.rightCols(kRows).diagonal().setConstant(random.decades(-3.0, 0.0));
    const VectorXd direction = random.vector(kRows);  // first: compilers draw the factors of a product in any order
    p.d = random.decades(-1.0, 1.5) * direction;
    p.lower = UnknownVector::Constant(kJoints + kRows, -kInfinity);
    p.upper = UnknownVector::Constant(kJoints + kRows, kInfinity);
    for (int j = 0; j < kJoints; ++j) {
      p.lower[j] = random.uniform(-1.0, 0.5);
      p.upper[j] = p.lower[j] + random.decades(-3.0, 0.5);
    }
    const LeastSquaresSolution s = solver.solve(p);
    REQUIRE(s.status == LeastSquaresStatus::Optimal);
    most = std::max(most, s.steps);
    sum += s.steps;
  }
  MESSAGE("steps: mean ", static_cast<double>(sum) / kProblems, ", most ", most);
  CHECK(sum <= 20 * kProblems);
  CHECK(most <= 40);
}
