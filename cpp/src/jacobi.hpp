#pragma once
// The kernel under the singular value decomposition: one-sided Jacobi on a few short columns, written in the compiler's
// vector types so that no vectoriser has to guess. `lanes` is the width of a vector: two on every x86-64, four where
// the processor has AVX2, which is checked at run time.

#include <cstddef>
#include <limits>
#include <type_traits>

#include "lanes.hpp"

namespace sigmaik::detail {

// k columns of `length` entries to make orthogonal, and k of eight that are rotated with them.
template <int length>
struct alignas(32) JacobiWork {
  double w[6][length];
  double r[6][8];
  double square[6];  // |w_i|²
};

template <int lanes, int length>
SIGMAIK_INLINE void rotate(double (&x)[length], double (&y)[length], double cosine, double sine) {
  auto a = Column<lanes, length>::load(x), b = Column<lanes, length>::load(y);
  const auto c = splat<lanes>(cosine), s = splat<lanes>(sine);
#pragma GCC unroll 8
  for (int i = 0; i < length / lanes; ++i) {
    const auto ai = a.at[i], bi = b.at[i];
    a.at[i] = c * ai - s * bi;
    b.at[i] = s * ai + c * bi;
  }
  a.store(x);
  b.store(y);
}

SIGMAIK_INLINE double larger(double a, double b) { return a > b ? a : b; }

// Round robin: every round pairs all columns once, and the pairs of a round are independent of each other.
template <int k>
struct Rounds;
// clang-format off
template <> struct Rounds<1> { static constexpr int count = 0, width = 1; static constexpr int pairs[1][1][2] = {{{0,0}}}; };
template <> struct Rounds<2> { static constexpr int count = 1, width = 1; static constexpr int pairs[1][1][2] = {{{0,1}}}; };
template <> struct Rounds<3> { static constexpr int count = 3, width = 1; static constexpr int pairs[3][1][2] = {
    {{0,1}}, {{0,2}}, {{1,2}}}; };
template <> struct Rounds<4> { static constexpr int count = 3, width = 2; static constexpr int pairs[3][2][2] = {
    {{0,1},{2,3}}, {{0,2},{1,3}}, {{0,3},{1,2}}}; };
template <> struct Rounds<5> { static constexpr int count = 5, width = 2; static constexpr int pairs[5][2][2] = {
    {{0,1},{2,4}}, {{0,3},{1,2}}, {{3,4},{0,2}}, {{1,4},{2,3}}, {{0,4},{1,3}}}; };
template <> struct Rounds<6> { static constexpr int count = 5, width = 3; static constexpr int pairs[5][3][2] = {
    {{0,1},{2,5},{3,4}}, {{0,5},{1,4},{2,3}}, {{0,4},{3,5},{1,2}}, {{0,3},{2,4},{1,5}}, {{0,2},{1,3},{4,5}}}; };
// clang-format on

// Columns shorter than this part of the longest are mostly rounding, and are not made orthogonal.
constexpr double kNoise = 16.0 * std::numeric_limits<double>::epsilon();
// Columns with a cosine up to this value are orthogonal but for rounding. Further rotations would change, in every
// cycle, the directions of singular values that are equal.
constexpr double kOrthogonal = 16.0 * std::numeric_limits<double>::epsilon();

// The inner product c of columns of squares a and b, or 0 where they are to be left as they are.
SIGMAIK_INLINE double to_turn(double a, double b, double c, double noise) {
  const bool rest = c * c <= kOrthogonal * kOrthogonal * (a * b) || (a < b ? a : b) <= noise;
  return rest ? 0.0 : c;
}

template <int k, int lanes, int length>
SIGMAIK_INLINE double measure(JacobiWork<length>& work) {
  double peak = 0.0;
#pragma GCC unroll 6
  for (int i = 0; i < k; ++i) {
    work.square[i] = dot<lanes>(work.w[i], work.w[i]);
    peak = larger(peak, work.square[i]);
  }
  return peak;
}

// A last sweep for columns that are almost orthogonal: all angles at once, to first order, which is exact to rounding
// if all angles are below 1e-8. Without the chain of angles this sweep costs a fraction of a full one. Returns false,
// with nothing done, if an angle is larger.
template <int k, int lanes, int length>
SIGMAIK_INLINE bool polish(JacobiWork<length>& work, double noise) {
  using Order = Rounds<k>;
  double angle[Order::count > 0 ? Order::count : 1][Order::width];
  double worst = 0.0;
#pragma GCC unroll 5
  for (int round = 0; round < Order::count; ++round) {
#pragma GCC unroll 3
    for (int j = 0; j < Order::width; ++j) {
      const int p = Order::pairs[round][j][0], q = Order::pairs[round][j][1];
      const double a = work.square[p], b = work.square[q];
      const double c = to_turn(a, b, dot<lanes>(work.w[p], work.w[q]), noise);
      angle[round][j] = c == 0.0 ? 0.0 : c / (b - a);
      worst = larger(worst, __builtin_fabs(angle[round][j]));
    }
  }
  if (!(worst <= 1e-8)) return false;
#pragma GCC unroll 5
  for (int round = 0; round < Order::count; ++round) {
#pragma GCC unroll 3
    for (int j = 0; j < Order::width; ++j) {
      const int p = Order::pairs[round][j][0], q = Order::pairs[round][j][1];
      rotate<lanes>(work.w[p], work.w[q], 1.0, angle[round][j]);
      rotate<lanes>(work.r[p], work.r[q], 1.0, angle[round][j]);
    }
  }
  return true;
}

// Small angles, usual at a warm start: series, exact to rounding, in place of square roots. `t` holds the tangents of
// the doubled angles, halved, and then those of the angles.
template <int width>
SIGMAIK_INLINE void small_angles(double (&t)[width], double (&cosine)[width]) {
#pragma GCC unroll 3
  for (int j = 0; j < width; ++j) {
    t[j] -= t[j] * t[j] * t[j];
    const double tt = t[j] * t[j];
    cosine[j] = 1.0 - tt * (0.5 - 0.375 * tt);
  }
}

// The tangents t and cosines of the smaller angles that zero the inner products c of columns whose squares differ by d.
template <int lanes, int width>
SIGMAIK_INLINE void smaller_angles(const double (&c)[width], const double (&d)[width], double (&t)[width],
                                   double (&cosine)[width]) {
#pragma GCC unroll 2
  for (int first = 0; first < width; first += lanes) {
    auto cs = splat<lanes>(0.0), ds = splat<lanes>(1.0);
#pragma GCC unroll 4
    for (int i = 0; i < lanes; ++i) {
      if (first + i >= width) break;
      cs[i] = c[first + i];
      ds[i] = d[first + i];
    }
    const auto sign = ds < 0.0 ? splat<lanes>(-2.0) : splat<lanes>(2.0);
    const auto magnitude = ds < 0.0 ? -ds : ds;
    const auto ts = sign * cs / (magnitude + square_root(ds * ds + 4.0 * cs * cs) + 1e-300);
    const auto cosines = 1.0 / square_root(1.0 + ts * ts);  // ts: tan of the smaller angle
#pragma GCC unroll 4
    for (int i = 0; i < lanes; ++i) {
      if (first + i >= width) break;
      t[first + i] = ts[i];
      cosine[first + i] = cosines[i];
    }
  }
}

// Rotates pairs of columns of w, and of r with them, until all are orthogonal; leaves their squares. Returns the number
// of sweeps, or 0 with nothing done where squares or their squares would overflow or vanish.
template <int k, int lanes, int length>
SIGMAIK_INLINE int orthogonalise(JacobiWork<length>& work, int max_sweeps) {
  using Order = Rounds<k>;
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  double left = 1.0;  // bound on the cosines that the last sweep has left
  int sweep = 1;
  for (; sweep <= max_sweeps; ++sweep) {
    double* const square = work.square;
    const double peak = measure<k, lanes>(work);
    if (!(peak > 1e-100 && peak < 1e100)) return 0;
    const double noise = peak * (kNoise * kNoise);
    if (left < 1e-9 && polish<k, lanes>(work, noise)) break;
    double worst_cosine = 0.0, worst_tangent = 0.0;  // the cosine is squared
#pragma GCC unroll 5
    for (int round = 0; round < Order::count; ++round) {
      double c[Order::width], d[Order::width], t[Order::width], cosine[Order::width], ratio = 0.0;
#pragma GCC unroll 3
      for (int j = 0; j < Order::width; ++j) {
        const int p = Order::pairs[round][j][0], q = Order::pairs[round][j][1];
        c[j] = to_turn(square[p], square[q], dot<lanes>(work.w[p], work.w[q]), noise);
        d[j] = square[q] - square[p];
        worst_cosine = larger(worst_cosine, c[j] * c[j] / (square[p] * square[q] + 1e-300));
        t[j] = c[j] / (d[j] + __builtin_copysign(1e-300, d[j]));
        ratio = larger(ratio, __builtin_fabs(t[j]));
      }
      if (ratio < 2e-3) {
        small_angles(t, cosine);
      } else {
        smaller_angles<lanes>(c, d, t, cosine);
      }
#pragma GCC unroll 3
      for (int j = 0; j < Order::width; ++j) {
        const int p = Order::pairs[round][j][0], q = Order::pairs[round][j][1];
        rotate<lanes>(work.w[p], work.w[q], cosine[j], cosine[j] * t[j]);
        rotate<lanes>(work.r[p], work.r[q], cosine[j], cosine[j] * t[j]);
        square[p] -= t[j] * c[j];
        square[q] += t[j] * c[j];
        worst_tangent = larger(worst_tangent, __builtin_fabs(t[j]));
      }
    }
    // The inner products after a sweep are of second order: later rotations change an inner product that was zeroed
    // early to at most (cosine of the one) × (cosine, or tangent, of the other).
    worst_cosine = __builtin_sqrt(worst_cosine);
    left = worst_cosine * larger(worst_cosine, worst_tangent);
    if (left <= kEpsilon) break;
  }
  measure<k, lanes>(work);
  return sweep;
}

// `lanes` entries from index `from` on of a strided vector with `count` entries, zeros beyond the end.
template <int lanes>
SIGMAIK_INLINE Vector<lanes> gather(const double* x, std::ptrdiff_t stride, int from, int count, double factor) {
  Vector<lanes> out = splat<lanes>(0.0);
  x += from * stride;
  if (from + lanes <= count) {
#pragma GCC unroll 4
    for (int i = 0; i < lanes; ++i) out[i] = x[i * stride];
  } else {
#pragma GCC unroll 4
    for (int i = 0; i < lanes; ++i) {
      if (from + i < count) out[i] = x[i * stride];
    }
  }
  return factor * out;
}

// w ← factor · A r for the k columns of A, which have `count` entries: A(j, i) = a[j·inner + i·outer].
template <int k, int lanes, int length>
SIGMAIK_INLINE void multiply(JacobiWork<length>& work, const double* a, std::ptrdiff_t inner, std::ptrdiff_t outer,
                             int count, double factor) {
#pragma GCC unroll 8
  for (int b = 0; b < length / lanes; ++b) {
    Vector<lanes> block[k];
#pragma GCC unroll 6
    for (int j = 0; j < k; ++j) block[j] = gather<lanes>(a + j * outer, inner, b * lanes, count, factor);
#pragma GCC unroll 6
    for (int i = 0; i < k; ++i) {
      Vector<lanes> s = work.r[i][0] * block[0];
#pragma GCC unroll 6
      for (int j = 1; j < k; ++j) s += work.r[i][j] * block[j];
      __builtin_memcpy(work.w[i] + b * lanes, &s, sizeof s);
    }
  }
}

template <int lanes, int length>
SIGMAIK_INLINE int jacobi(JacobiWork<length>& work, int k, const double* a, std::ptrdiff_t inner, std::ptrdiff_t outer,
                          int count, double factor, int max_sweeps) {
  const auto run = [&](auto columns) __attribute__((always_inline)) {
    constexpr int kColumns = decltype(columns)::value;
    multiply<kColumns, lanes>(work, a, inner, outer, count, factor);
    return orthogonalise<kColumns, lanes>(work, max_sweeps);
  };
  switch (k) {
    case 1: return run(std::integral_constant<int, 1>{});
    case 2: return run(std::integral_constant<int, 2>{});
    case 3: return run(std::integral_constant<int, 3>{});
    case 4: return run(std::integral_constant<int, 4>{});
    case 5: return run(std::integral_constant<int, 5>{});
    default: return run(std::integral_constant<int, 6>{});
  }
}

}  // namespace sigmaik::detail
