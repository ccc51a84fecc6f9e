#pragma once
// One-sided Jacobi (Hestenes) of several matrices side by side: lane l of every vector belongs to matrix l. A lane does
// what it would do alone: its rotations depend on its own entries, and stop when its own columns are orthogonal. The
// answer of a matrix therefore does not depend on its neighbours. (Its last bits depend on whether the processor has
// fused products, as those of Spectrum do.)

#include <cstddef>

#include "jacobi.hpp"
#include "lanes.hpp"

namespace sigmaik::detail {

// A column whose square is below this part of the largest square belongs to a matrix that is singular, or nearly: its
// direction is known to some 1e-11 at best.
constexpr double kLaneSingular = 1e-10;
constexpr int kLaneSweeps = 12;  // five or six are usual
constexpr int kLaneEntries = 16 + 6;

// k columns, of `length` entries to make orthogonal and `carried` more that are rotated with them.
template <int lanes>
struct LaneWork {
  Vector<lanes> w[6][kLaneEntries];
  Vector<lanes> square[6];  // out: |w_i|² of the first `length` entries
  Mask<lanes> regular;      // out: −1 where the columns are orthogonal and none is negligible, else 0
};

// Sizes are ints, or constants of the compiler's (std::integral_constant), with which all loops are unrolled.
template <int lanes, typename Size>
SIGMAIK_INLINE Vector<lanes> lane_dot(const Vector<lanes>* x, const Vector<lanes>* y, Size length) {
  Vector<lanes> even = x[0] * y[0], odd = splat<lanes>(0.0);
  for (int j = 1; j < length; ++j) (j % 2 == 0 ? even : odd) += x[j] * y[j];
  return even + odd;
}

template <int lanes>
SIGMAIK_INLINE Vector<lanes> lane_magnitude(Vector<lanes> x) {
  return x < 0.0 ? -x : x;
}

// Squares of the columns. Returns the lanes whose largest square is a number that squares neither to 0 nor to infinity.
template <int k, int lanes, typename Size>
SIGMAIK_INLINE Mask<lanes> lane_measure(LaneWork<lanes>& work, Size length, Vector<lanes>& peak) {
  peak = splat<lanes>(0.0);
#pragma GCC unroll 6
  for (int i = 0; i < k; ++i) {
    work.square[i] = lane_dot<lanes>(work.w[i], work.w[i], length);
    peak = work.square[i] > peak ? work.square[i] : peak;
    peak = work.square[i] != work.square[i] ? work.square[i] : peak;  // NaN stays
  }
  return (peak > 1e-100) & (peak < 1e100);
}

// One rotation: cosine and sine of the angle, which is at most 45°.
template <int lanes>
struct LaneTurn {
  Vector<lanes> cosine, sine;
};

// The rotation that makes the inner product c of columns of squares a and b zero, in the lanes of `turn`; `change` is
// what a loses and b gains. With d = b − a, g = |d| + √(d² + 4c²) and e = ±2c, tan θ = e/g, so cos θ = g/√(g² + e²) and
// sin θ = e/√(g² + e²). The change is c tan θ; 1/cos θ by two Newton steps is enough, as each sweep measures anew.
template <int lanes>
SIGMAIK_INLINE LaneTurn<lanes> lane_angle(Vector<lanes> d, Vector<lanes> c, Mask<lanes> turn, Vector<lanes>& tangent) {
  const Vector<lanes> zero = splat<lanes>(0.0), one = splat<lanes>(1.0);
  const Vector<lanes> e = d < 0.0 ? -2.0 * c : 2.0 * c;
  const Vector<lanes> g = lane_magnitude<lanes>(d) + square_root(d * d + e * e);
  const Vector<lanes> per_length = 1.0 / square_root(g * g + e * e);
  const Vector<lanes> cosine = turn ? g * per_length : one, sine = turn ? e * per_length : zero;
  Vector<lanes> per_cosine = 2.4 - 1.4 * cosine;
  per_cosine *= 2.0 - cosine * per_cosine;
  per_cosine *= 2.0 - cosine * per_cosine;
  tangent = sine * per_cosine;
  return {cosine, sine};
}

template <int lanes, typename Size>
SIGMAIK_INLINE void lane_rotate(Vector<lanes>* x, Vector<lanes>* y, Size entries, const LaneTurn<lanes>& turn) {
  for (int j = 0; j < entries; ++j) {
    const Vector<lanes> xj = x[j], yj = y[j];
    x[j] = turn.cosine * xj - turn.sine * yj;
    y[j] = turn.sine * xj + turn.cosine * yj;
  }
}

template <int lanes>
SIGMAIK_INLINE bool any(Mask<lanes> mask) {
  long long bits = 0;
#pragma GCC unroll 8
  for (int l = 0; l < lanes; ++l) bits |= mask[l];
  return bits != 0;
}

// Where the lanes of one work stand.
template <int lanes>
struct LaneState {
  Mask<lanes> sound, active, left;  // can be done at all; not yet orthogonal; will not be so after this sweep
  Vector<lanes> noise;
};

// The angles of a round.
template <int k, int lanes, typename Size>
SIGMAIK_INLINE void lane_angles(LaneWork<lanes>& work, Size length, int round, LaneState<lanes>& state,
                                LaneTurn<lanes> (&turns)[Rounds<k>::width]) {
  constexpr double kRest = 1e-15;   // columns with this cosine stay as they are
  constexpr double kAlmost = 1e-6;  // the products of such angles are the cosines that a sweep leaves, see jacobi.hpp
#pragma GCC unroll 3
  for (int j = 0; j < Rounds<k>::width; ++j) {
    const int p = Rounds<k>::pairs[round][j][0], q = Rounds<k>::pairs[round][j][1];
    const Vector<lanes> a = work.square[p], b = work.square[q], c = lane_dot<lanes>(work.w[p], work.w[q], length);
    const Vector<lanes> product = a * b, square = c * c;
    const Mask<lanes> turn = state.active & (square > kRest * kRest * product) & ((a < b ? a : b) > state.noise);
    Vector<lanes> tangent;
    turns[j] = lane_angle<lanes>(b - a, c, turn, tangent);
    work.square[p] = a - tangent * c;
    work.square[q] = b + tangent * c;
    state.left |= turn & ((square > kAlmost * kAlmost * product) | (tangent * tangent > kAlmost * kAlmost));
  }
}

template <int k, int lanes, typename Size>
SIGMAIK_INLINE void lane_rotations(LaneWork<lanes>& work, Size entries, int round,
                                   const LaneTurn<lanes> (&turns)[Rounds<k>::width]) {
#pragma GCC unroll 3
  for (int j = 0; j < Rounds<k>::width; ++j) {
    lane_rotate<lanes>(work.w[Rounds<k>::pairs[round][j][0]], work.w[Rounds<k>::pairs[round][j][1]], entries, turns[j]);
  }
}

template <int k, int lanes, typename Size>
SIGMAIK_INLINE void lane_end(LaneWork<lanes>& work, Size length, const LaneState<lanes>& state) {
  Vector<lanes> peak;
  lane_measure<k, lanes>(work, length, peak);
  work.regular = state.sound & ~state.active;
#pragma GCC unroll 6
  for (int i = 0; i < k; ++i) work.regular &= work.square[i] > kLaneSingular * peak;
}

// Rotates pairs of columns, in the order of Rounds<k> (jacobi.hpp), until the columns of all lanes are orthogonal.
template <int k, int lanes, typename Size, typename Entries>
SIGMAIK_INLINE void lane_orthogonalise(LaneWork<lanes>& work, Size length, Entries entries) {
  using Order = Rounds<k>;
  LaneState<lanes> state;
  Vector<lanes> peak;
  state.active = state.sound = lane_measure<k, lanes>(work, length, peak);
  state.noise = 0.1 * kLaneSingular * peak;
  for (int sweep = 0; sweep < kLaneSweeps && any<lanes>(state.active); ++sweep) {
    // What rotations leave of small squares is mostly rounding.
    if (sweep > 0) lane_measure<k, lanes>(work, length, peak);
    state.left = state.active ^ state.active;
#pragma GCC unroll 5
    for (int round = 0; round < Order::count; ++round) {
      LaneTurn<lanes> turns[Order::width];
      lane_angles<k, lanes>(work, length, round, state, turns);
      lane_rotations<k, lanes>(work, entries, round, turns);
    }
    state.active &= state.left;
  }
  lane_end<k, lanes>(work, length, state);
}

}  // namespace sigmaik::detail
