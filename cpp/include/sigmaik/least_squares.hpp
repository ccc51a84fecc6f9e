#pragma once
/// \file least_squares.hpp
/// Dense constrained least squares of the sizes of an arm, by an active set.
///
///     min |A x − b|²   where   C x = d,   lower ≤ x ≤ upper,   G x ≤ h
///
/// in the tradition of Lawson and Hanson (Solving Least Squares Problems, 1974) and Björck (Numerical Methods for Least
/// Squares Problems, 1996): orthogonal transformations, no normal equations. There is always an answer. Where the
/// levels exclude each other, each level is violated as little as possible (in the least-squares sense) before the next
/// level is considered (Kanoun, Lamiraux and Wieber 2011; Escande, Mansard and Wieber 2014):
///
///     0. lower ≤ x ≤ upper     always kept
///     1. G x ≤ h               min |max(0, G x − h)|²
///     2. C x = d               min |C x − d|²
///     3. A x ≈ b               min |A x − b|²
///     4.                       min |x|²
///
/// Level 4 makes the answer unique where matrices are rank-deficient.

#include <cstdint>

#include <sigmaik/layout.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik {

inline constexpr int kMaxUnknowns = 24;      ///< 16 joints, a time scaling, and slack for 6 task rows
inline constexpr int kMaxObjectives = 32;    ///< rows of A
inline constexpr int kMaxEqualities = 8;     ///< rows of C
inline constexpr int kMaxInequalities = 32;  ///< rows of G

/// One number for each unknown. All sizes are bounded, so no type uses the heap.
using UnknownVector = Eigen::Matrix<double, Eigen::Dynamic, 1, kLayout, kMaxUnknowns, 1>;
/// One number a row of A, C or G, up to 32.
using RowVector = Eigen::Matrix<double, Eigen::Dynamic, 1, kLayout, kMaxObjectives, 1>;
/// Rows of A, C or G: up to 32×24.
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor | Eigen::DontAlign,
                                kMaxObjectives, kMaxUnknowns>;

/// The problem. A part that is empty is absent; the number of unknowns is that of the columns of A, C or G, or the size
/// of the bounds.
struct LeastSquaresProblem {
  RowMatrix A;          ///< (m, n)
  RowVector b;          ///< (m,)
  RowMatrix C;          ///< (p, n), p ≤ 8
  RowVector d;          ///< (p,)
  UnknownVector lower;  ///< (n,), −∞ where there is no bound
  UnknownVector upper;  ///< (n,), at least `lower`, +∞ where there is no bound
  RowMatrix G;          ///< (k, n)
  RowVector h;          ///< (k,), +∞ where there is no bound
};

/// How solve() ended.
enum class LeastSquaresStatus : std::int8_t {
  Optimal = 0,     ///< every constraint is met
  Infeasible = 1,  ///< G x ≤ h or C x = d cannot be met: as well as possible, in the order above
  StepLimit = 2,   ///< inside the bounds, but more steps would be needed
  BadInput = 3,    ///< sizes that do not fit, NaN, infinite entries, lower > upper: x is zero
};

/// "optimal", "infeasible", "step limit", "bad input".
const char* to_string(LeastSquaresStatus status) noexcept;

/// Answer of LeastSquares::solve(). By value, no heap.
struct LeastSquaresSolution {
  UnknownVector x;                                           ///< (n,) inside the bounds exactly
  LeastSquaresStatus status = LeastSquaresStatus::BadInput;  ///< what solve() did
  int steps = 0;                ///< factorisations taken; 1 where the last active set still fits
  std::uint32_t at_lower = 0;   ///< bit i: the answer is held at lower[i]
  std::uint32_t at_upper = 0;   ///< bit i: the answer is held at upper[i]
  std::uint32_t active = 0;     ///< bit k: the answer is held at row k of G, or violates it
  double violation = 0.0;       ///< |max(0, G x − h)|
  double equality_error = 0.0;  ///< |C x − d|
};

/// Solves problems one after the other; the active set of an answer is the first guess for the next problem. Where the
/// answer is unique to rounding, the answer does not depend on the guess.
class LeastSquares {
 public:
  /// Real time: no heap, at most 4 (n + k) + 40 steps for n unknowns and k rows of G.
  LeastSquaresSolution solve(const LeastSquaresProblem& problem) noexcept;

  /// Forgets the guess.
  void reset() noexcept { *this = LeastSquares{}; }

 private:
  friend struct detail::Members<LeastSquares>;
  struct Guess {
    int unknowns = 0, inequalities = 0;
    std::uint32_t at_lower = 0, at_upper = 0, active = 0;
    UnknownVector x;
  };
  Guess guess_;
};

SIGMAIK_SAME_LAYOUT(LeastSquares, LeastSquaresProblem, LeastSquaresSolution);

}  // namespace sigmaik
