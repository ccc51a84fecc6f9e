// The singular value decomposition, for every size, against a decomposition in long double; its warm start and
// continuity.

#include <doctest/doctest.h>

#include <limits>

#include <sigmaik/spectrum.hpp>

#include "oracles.hpp"
#include "random.hpp"

namespace {

using sigmaik::Spectrum;
using test::MatrixXd;
using test::Random;
using test::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

MatrixXd u(const Spectrum& s) {
  MatrixXd out(s.rows(), s.rows());
  for (int i = 0; i < s.rows(); ++i) out.col(i) = s.u(i);
  return out;
}

MatrixXd v(const Spectrum& s) {
  MatrixXd out(s.cols(), s.size());
  for (int i = 0; i < s.size(); ++i) out.col(i) = s.v(i);
  return out;
}

VectorXd sigma(const Spectrum& s) {
  return VectorXd::NullaryExpr(s.size(), [&s](Eigen::Index i) { return s.sigma(static_cast<int>(i)); });
}

double off_orthonormal(const MatrixXd& basis) {
  return (basis.transpose() * basis - MatrixXd::Identity(basis.cols(), basis.cols())).cwiseAbs().maxCoeff();
}

// Checks that hold for every decomposition. Errors are measured against σ_max.
void check_decomposition(const Spectrum& s, const MatrixXd& j) {
  REQUIRE(s.rows() == j.rows());
  REQUIRE(s.cols() == j.cols());
  REQUIRE(s.size() == std::min(j.rows(), j.cols()));
  const MatrixXd left = u(s), right = v(s);
  const VectorXd values = sigma(s);
  REQUIRE((left.allFinite() && right.allFinite() && values.allFinite()));
  CHECK(off_orthonormal(left) < 2e-14);
  CHECK(off_orthonormal(right) < 2e-14);
  for (int i = 0; i < s.size(); ++i) {
    CHECK(values[i] >= 0.0);
    if (i > 0) CHECK(values[i] <= values[i - 1]);
  }
  for (int i = s.size(); i < sigmaik::kMaxTask; ++i) CHECK(s.sigma(i) == 0.0);
  // In units of the largest entry: no square may overflow here.
  const double peak = j.cwiseAbs().maxCoeff();
  if (peak == 0.0) {
    CHECK(values.isZero(0.0));
    return;
  }
  const MatrixXd back = left.leftCols(s.size()) * (values / peak).asDiagonal() * right.transpose();
  // A subnormal entry has fewer digits than a normal one.
  const double grain = std::numeric_limits<double>::denorm_min() / peak;
  const double largest = values[0] / peak;
  CHECK((back - j / peak).cwiseAbs().maxCoeff() < 64.0 * kEpsilon * largest + 8.0 * grain);
  CHECK(s.sweeps() < 12);
}

void check_values(const Spectrum& s, const MatrixXd& j) {
  const double peak = j.cwiseAbs().maxCoeff();
  if (peak == 0.0) return;
  const test::LongMatrix scaled = j.cast<long double>() / static_cast<long double>(peak);
  const test::LongVector oracle = test::singular_values(scaled);
  const double grain = std::numeric_limits<double>::denorm_min() / peak;
  for (int i = 0; i < s.size(); ++i) {
    const long double exact = oracle[i];
    CHECK(std::abs(static_cast<long double>(s.sigma(i)) / static_cast<long double>(peak) - exact) <
          64.0L * kEpsilon * oracle[0] + 8.0L * grain);
  }
}

enum Kind { Regular, Deficient, Repeated, Mixed, Graded, GradedRows, Tiny, Subnormal, Huge, Integers, Twins, Kinds };

MatrixXd random_matrix(Random& random, Kind kind, int m, int n) {
  const int k = std::min(m, n);
  switch (kind) {
    case Regular: return random.matrix(m, n);
    case Deficient: {
      const int rank = random.integer(0, k - 1);
      return rank == 0 ? MatrixXd(MatrixXd::Zero(m, n)) : MatrixXd(random.matrix(m, rank) * random.matrix(rank, n));
    }
    case Repeated: return random.with_singular_values(m, n, VectorXd::Constant(k, random.decades(-3, 3)));
    case Mixed:
      return random.with_singular_values(m, n, test::random_singular_values(random, k, random.decades(-3, 3)));
    case Graded: {
      VectorXd values(k);
      for (int i = 0; i < k; ++i) values[i] = std::pow(10.0, -4.0 * i);
      return random.with_singular_values(m, n, values);
    }
    case GradedRows: {
      MatrixXd j = random.matrix(m, n);
      for (int i = 0; i < m; ++i) j.row(i) *= random.decades(-20.0, 0.0);
      return j;
    }
    case Tiny: return random.matrix(m, n) * random.decades(-300.0, -50.0);
    case Subnormal: return random.matrix(m, n) * random.decades(-322.0, -308.0);
    case Huge: return random.matrix(m, n) * random.decades(50.0, 305.0);
    case Integers: return MatrixXd::NullaryExpr(m, n, [&] { return static_cast<double>(random.integer(-1, 1)); });
    case Twins: {  // rows and columns that are the same, or opposite
      MatrixXd j = random.matrix(m, n);
      j.row(random.integer(0, m - 1)) = j.row(random.integer(0, m - 1));
      j.col(random.integer(0, n - 1)) = -j.col(random.integer(0, n - 1));
      return j;
    }
    default: return {};
  }
}

}  // namespace

TEST_CASE("every size and kind, from a cold start, against long double") {
  Random random(1);
  for (int m = 1; m <= 6; ++m) {
    for (int n = 1; n <= 16; ++n) {
      for (int kind = 0; kind < Kinds; ++kind) {
        for (int repeat = 0; repeat < 4; ++repeat) {
          CAPTURE(m);
          CAPTURE(n);
          CAPTURE(kind);
          CAPTURE(repeat);
          const MatrixXd j = random_matrix(random, static_cast<Kind>(kind), m, n);
          Spectrum s;
          s.decompose(j);
          check_decomposition(s, j);
          check_values(s, j);
        }
      }
    }
  }
}

TEST_CASE("warm starts from anything: every kind after every kind") {
  Random random(2);
  for (int repeat = 0; repeat < 60; ++repeat) {
    const int m = random.integer(1, 6), n = random.integer(1, 16);
    Spectrum s;
    for (int step = 0; step < 100; ++step) {
      const MatrixXd j = random_matrix(random, static_cast<Kind>(random.integer(0, Kinds - 1)), m, n);
      CAPTURE(repeat);
      CAPTURE(step);
      s.decompose(j);
      check_decomposition(s, j);
      if (step % 10 == 0) check_values(s, j);
    }
  }
}

TEST_CASE("small singular values are found to full relative accuracy where the rows define them") {
  Random random(3);
  for (int repeat = 0; repeat < 300; ++repeat) {
    const int m = random.integer(2, 6), n = random.integer(m, 16);
    CAPTURE(repeat);
    // Rows of very different size, well conditioned apart from that.
    MatrixXd j = random.with_singular_values(m, n, VectorXd::NullaryExpr(m, [&] { return random.uniform(0.3, 1.0); }));
    for (int i = 0; i < m; ++i) j.row(i) *= random.decades(-12.0, 0.0);
    Spectrum s;
    s.decompose(j);
    const test::LongVector oracle = test::singular_values(test::LongMatrix(j.cast<long double>()));
    for (int i = 0; i < m; ++i) {
      CHECK(s.sigma(i) == doctest::Approx(static_cast<double>(oracle[i])).epsilon(1e-12));
    }
  }
}

TEST_CASE("a warm start gives the result of a cold one, and keeps signs") {
  Random random(4);
  for (int repeat = 0; repeat < 100; ++repeat) {
    const int m = random.integer(1, 6), n = random.integer(1, 16), k = std::min(m, n);
    const MatrixXd a = random.matrix(m, n), b = random.matrix(m, n);
    Spectrum warm;
    MatrixXd last_u, last_v;
    VectorXd last_sigma;
    for (int step = 0; step < 100; ++step) {
      CAPTURE(repeat);
      CAPTURE(step);
      const double t = 0.005 * step;
      const MatrixXd j = std::cos(t) * a + std::sin(t) * b;
      warm.decompose(j);
      Spectrum cold;
      cold.decompose(j);
      check_decomposition(warm, j);
      const VectorXd values = sigma(warm);
      CHECK((values - sigma(cold)).cwiseAbs().maxCoeff() < 64.0 * kEpsilon * values[0]);
      for (int i = 0; i < k; ++i) {
        double gap = values[i];  // to the other values and to zero, each of which blurs the direction
        for (int l = 0; l < k; ++l) {
          if (l != i) gap = std::min(gap, std::abs(values[i] - values[l]));
        }
        if (gap < 1e-3 * values[0]) continue;
        const double tolerance = 1e-13 * values[0] / gap;
        CHECK((warm.u(i) * warm.u(i).transpose() - cold.u(i) * cold.u(i).transpose()).cwiseAbs().maxCoeff() <
              tolerance);
        CHECK((warm.v(i) * warm.v(i).transpose() - cold.v(i) * cold.v(i).transpose()).cwiseAbs().maxCoeff() <
              tolerance);
        if (step > 0 && gap > 0.1 * values[0]) {
          CHECK(warm.u(i).dot(last_u.col(i)) > 0.9);
          CHECK(warm.v(i).dot(last_v.col(i)) > 0.9);
        }
      }
      last_u = u(warm);
      last_v = v(warm);
      last_sigma = values;
    }
  }
}

TEST_CASE("a small part may change completely while the large part stands still") {
  Random random(12);
  for (int repeat = 0; repeat < 200; ++repeat) {
    const int m = random.integer(4, 6), n = random.integer(m, 12), large = random.integer(1, m - 3);
    const MatrixXd left = random.orthonormal(m, m), right = random.orthonormal(n, n);
    const double size = random.decades(-13.0, -1.0);
    Spectrum s;
    for (int step = 0; step < 20; ++step) {
      MatrixXd core = MatrixXd::Zero(m, n);
      core.topLeftCorner(large, large).setIdentity();
      core.bottomRightCorner(m - large, n - large) = size * random.matrix(m - large, n - large);
      const MatrixXd j = left * core * right.transpose();
      s.decompose(j);
      CAPTURE(repeat);
      CAPTURE(size);
      check_decomposition(s, j);
      check_values(s, j);
    }
  }
}

TEST_CASE("a million cycles leave U and V orthogonal") {
  Random random(5);
  struct Run {
    int m, n, steps;
  };
  for (const Run& run : {Run{6, 7, 1000000}, Run{3, 9, 100000}, Run{6, 4, 100000}, Run{6, 6, 100000}}) {
    const int m = run.m, n = run.n, steps = run.steps;
    CAPTURE(m);
    CAPTURE(n);
    const MatrixXd a = random.matrix(m, n), b = random.matrix(m, n), c = random.matrix(m, n);
    Spectrum s;
    double worst_u = 0.0, worst_v = 0.0, worst_back = 0.0;
    int most_sweeps = 0;
    for (int step = 0; step < steps; ++step) {
      const double t = 1e-3 * step;
      const MatrixXd j = std::cos(t) * a + std::sin(1.7 * t) * b + std::sin(0.3 * t) * c;
      s.decompose(j);
      if (step > 0) most_sweeps = std::max(most_sweeps, s.sweeps());
      if (step % 7 != 0) continue;
      const MatrixXd left = u(s), right = v(s);
      worst_u = std::max(worst_u, off_orthonormal(left));
      worst_v = std::max(worst_v, off_orthonormal(right));
      const MatrixXd back = left.leftCols(s.size()) * sigma(s).asDiagonal() * right.transpose();
      worst_back = std::max(worst_back, (back - j).cwiseAbs().maxCoeff() / s.sigma(0));
    }
    CHECK(worst_u < 1e-14);
    CHECK(worst_v < 2e-14);
    CHECK(worst_back < 64.0 * kEpsilon);
    CHECK(most_sweeps <= 5);
  }
}

TEST_CASE("a Jacobian that stands still leaves the decomposition still") {
  Random random(6);
  for (int repeat = 0; repeat < 50; ++repeat) {
    const int m = random.integer(1, 6), n = random.integer(1, 16);
    const MatrixXd j = random_matrix(random, static_cast<Kind>(random.integer(0, Kinds - 1)), m, n);
    Spectrum s;
    s.decompose(j);
    const MatrixXd first_u = u(s), first_v = v(s);
    for (int step = 0; step < 1000; ++step) s.decompose(j);
    CAPTURE(repeat);
    check_decomposition(s, j);
    // Where a singular value is at the edge of rounding, its direction is noise: only the others must stand still.
    for (int i = 0; i < s.size(); ++i) {
      if (s.sigma(i) < 1e-6 * s.sigma(0)) continue;
      CHECK((s.u(i) - first_u.col(i)).norm() < 1e-9);
      CHECK((s.v(i) - first_v.col(i)).norm() < 1e-9);
    }
  }
}

TEST_CASE("the same calls give the same bits") {
  Random random(7);
  for (int repeat = 0; repeat < 50; ++repeat) {
    const int m = random.integer(1, 6), n = random.integer(1, 16);
    Spectrum first, second;
    for (int step = 0; step < 40; ++step) {
      const MatrixXd j = random_matrix(random, static_cast<Kind>(random.integer(0, Kinds - 1)), m, n);
      first.decompose(j);
      const MatrixXd copy = j;
      second.decompose(copy);
      CHECK(u(first) == u(second));
      CHECK(v(first) == v(second));
      CHECK(sigma(first) == sigma(second));
      if (step == 20) second = Spectrum(first);  // a copy goes on like the original
    }
  }
}

TEST_CASE("another size is a fresh start") {
  Random random(8);
  Spectrum used;
  for (int repeat = 0; repeat < 500; ++repeat) {
    const int m = random.integer(1, 6), n = random.integer(1, 16);
    if (m == used.rows() && n == used.cols()) continue;
    const MatrixXd j = random_matrix(random, static_cast<Kind>(random.integer(0, Kinds - 1)), m, n);
    used.decompose(j);
    Spectrum fresh;
    fresh.decompose(j);
    CHECK(u(used) == u(fresh));
    CHECK(v(used) == v(fresh));
    CHECK(sigma(used) == sigma(fresh));
  }
}

TEST_CASE("directions of zero singular values move no more than the matrix") {
  Random random(9);
  struct Size {
    int m, n;
  };
  for (const Size& size : {Size{6, 7}, Size{6, 6}, Size{3, 3}, Size{6, 3}, Size{4, 12}, Size{6, 16}}) {
    const int m = size.m, n = size.n;
    for (int rank = 0; rank < std::min(m, n); ++rank) {
      CAPTURE(m);
      CAPTURE(n);
      CAPTURE(rank);
      const MatrixXd left = random.orthonormal(m, m), right = random.orthonormal(n, n);
      // Generators of rotations in the task's and the joints' spaces.
      MatrixXd gl = random.matrix(m, m), gr = random.matrix(n, n);
      gl = (gl - gl.transpose()).eval();
      gr = (gr - gr.transpose()).eval();
      gl /= gl.norm();
      gr /= gr.norm();
      MatrixXd rl = left, rr = right;
      const double h = 1e-3;
      Spectrum s;
      MatrixXd last_u, last_v;
      for (int step = 0; step < 400; ++step) {
        MatrixXd j = MatrixXd::Zero(m, n);
        for (int i = 0; i < rank; ++i) j += (1.0 + 0.3 * i) * rl.col(i) * rr.col(i).transpose();
        s.decompose(j);
        if (step > 0) {
          CHECK((u(s) - last_u).cwiseAbs().maxCoeff() < 4.0 * h);
          CHECK((v(s) - last_v).cwiseAbs().maxCoeff() < 4.0 * h);
        }
        last_u = u(s);
        last_v = v(s);
        // A Cayley step is a rotation; QR takes out what rounding adds.
        rl = test::solve(MatrixXd::Identity(m, m) - 0.5 * h * gl, (MatrixXd::Identity(m, m) + 0.5 * h * gl) * rl);
        rr = test::solve(MatrixXd::Identity(n, n) - 0.5 * h * gr, (MatrixXd::Identity(n, n) + 0.5 * h * gr) * rr);
      }
    }
  }
}

TEST_CASE("through a singularity and out: the directions go on") {
  Random random(10);
  for (int repeat = 0; repeat < 40; ++repeat) {
    const int m = random.integer(2, 6), n = random.integer(2, 12), k = std::min(m, n);
    const MatrixXd left = random.orthonormal(m, k), right = random.orthonormal(n, k);
    Spectrum s;
    MatrixXd last_u, last_v;
    for (int step = -50; step <= 50; ++step) {
      VectorXd values(k);
      for (int i = 0; i < k; ++i) values[i] = 1.0 + 0.5 * (k - i);
      values[k - 1] = 1e-3 * step;  // goes through exactly zero, and changes sign
      s.decompose(MatrixXd(left * values.asDiagonal() * right.transpose()));
      const MatrixXd uu = s.u(k - 1) * s.u(k - 1).transpose(), vv = s.v(k - 1) * s.v(k - 1).transpose();
      if (step > -50) {
        CAPTURE(repeat);
        CAPTURE(step);
        CHECK((uu - last_u).cwiseAbs().maxCoeff() < 1e-10);
        CHECK((vv - last_v).cwiseAbs().maxCoeff() < 1e-10);
      }
      last_u = uu;
      last_v = vv;
    }
  }
}

TEST_CASE("blocks, rows and transposes of larger matrices") {
  Random random(11);
  const MatrixXd large = random.matrix(12, 20);
  for (int m = 1; m <= 6; ++m) {
    for (int n = 1; n <= 16; ++n) {
      Spectrum s;
      s.decompose(large.block(3, 2, m, n));
      check_decomposition(s, large.block(3, 2, m, n));
      Spectrum t;
      t.decompose(large.block(0, 0, 16 < n ? 16 : std::min(n, 12), m).transpose());
      check_decomposition(t, large.block(0, 0, std::min(n, 12), m).transpose());
    }
  }
}
