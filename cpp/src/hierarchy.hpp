#pragma once
// Hierarchical least squares: the equality-constrained subproblem of an active set (active_set.hpp).
//
// In the free variables, the solver minimises the residuals of these levels, each level inside the null space of the
// levels before it:
//
//     0. active rows of G    1. C    2. A    3. |x|
//
// Householder reflections H_t from the right bring the rows of a level to triangular form,
//
//     row_k · H_0 H_1 … = (along_k, 0),    x = H_0 H_1 … z.
//
// A level therefore determines the next few entries of z and leaves the other entries alone. A row is dependent if
// nothing of the row is left after the reflections so far; the level is then a small least-squares problem in its own
// entries of z. Entries of z that no level determines stay zero, which makes |x| minimal.

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "lanes.hpp"

namespace sigmaik::detail {

inline constexpr int kActiveSetRows = 72;

// The problem, padded with zeros to P unknowns, and the answer.
template <int P>
struct alignas(32) ActiveSetProblem {
  double row[kActiveSetRows][P];  // rows of G, C and A, in this order
  double rhs[kActiveSetRows];
  double lower[P], upper[P];
  double x[P];  // in: the start, if the guess of the active set is not feasible; out: the answer
  int unknowns, inequalities, equalities, objectives;
  std::uint32_t at_lower, at_upper, active;  // in: the guess of the active set; out: the active set of the answer
  int steps;
  bool finished;
};

template <int P>
struct UnitVectors {
  alignas(32) double at[P][P] = {};
  constexpr UnitVectors() {
    for (int i = 0; i < P; ++i) at[i][i] = 1.0;
  }
};
template <int P>
inline constexpr UnitVectors<P> kUnit;

template <int lanes, int P>
class Hierarchy {
 public:
  static constexpr int kLevels = 3;  // those with rows: G, C, A

  explicit SIGMAIK_INLINE Hierarchy(const ActiveSetProblem<P>& problem) : p_(problem), n_(problem.unknowns) {
    first_[0] = 0;
    first_[1] = p_.inequalities;
    first_[2] = first_[1] + p_.equalities;
    first_[3] = first_[2] + p_.objectives;
  }

  // Computes the rows' norms and the levels' rank tolerances. Returns the largest (rhs / |row|)².
  SIGMAIK_INLINE double prepare() {
    double reach = 0.0;
    for (int level = 0; level < kLevels; ++level) {
      double largest = 0.0;
      for (int k = first_[level]; k < first_[level + 1]; ++k) {
        square[k] = dot<lanes>(p_.row[k], p_.row[k]);
        largest = std::max(largest, square[k]);
        if (p_.rhs[k] * p_.rhs[k] > reach * square[k] && square[k] > 0.0) reach = p_.rhs[k] * p_.rhs[k] / square[k];
      }
      noise_[level] = kRank * kRank * largest;
    }
    return reach;
  }

  // Solves all levels, with the held variables at their bounds and the active rows of G as equalities: writes `goal`.
  SIGMAIK_INLINE void solve(std::uint32_t at_lower, std::uint32_t at_upper, std::uint32_t active) {
    Variables variables;
    split(at_lower, at_upper, variables);
    collect_rows(variables, active);
    set_zero<lanes>(z);
    rank_ = 0;
    for (int level = 0; level < kLevels; ++level) {
      triangularise(level, variables);
      if (begin[level] + independent[level] == begin[level + 1]) {
        substitute(level);
      } else {
        fit(level);
      }
    }
    rank_before[kLevels] = rank_;
    transform_back(variables);
  }

  // The row that determined entry t of z.
  SIGMAIK_INLINE int pivot(int t) const {
    int level = 0;
    while (t >= rank_before[level + 1]) ++level;
    return begin[level] + t - rank_before[level];
  }

  // Multipliers y of the first `count` pivot rows: Σ y_k along_k = −h in the entries of z that these rows determined.
  SIGMAIK_INLINE void back_substitute(int count, double (&h)[P], double (&y)[P]) const {
    for (int t = count - 1; t >= 0; --t) {
      const int k = pivot(t);
      y[t] = -h[t] / along[k][t];
      add_scaled<lanes>(h, y[t], along[k]);
    }
  }

  double square[kActiveSetRows];  // squared norms of the problem's rows

  // The rows in use: active inequalities, equalities, objectives. Within a level the independent rows come first.
  int begin[kLevels + 1], independent[kLevels], rank_before[kLevels + 1];
  int which[kActiveSetRows];  // index of the row in the problem
  alignas(32) double along[kActiveSetRows][P];
  alignas(32) double z[P];
  alignas(32) double goal[P];

 private:
  static constexpr double kRank = 1e-12;  // a remainder below this part of the level's longest row is rounding

  // The bounds of the held variables (0 for the free ones), and the free variables: as a mask, and as a list.
  struct Variables {
    alignas(32) double fixed[P], mask[P];
    int free[P], free_count = 0;
  };

  SIGMAIK_INLINE void split(std::uint32_t at_lower, std::uint32_t at_upper, Variables& v) const {
    for (int i = 0; i < P; ++i) {
      v.mask[i] = 0.0;
      v.fixed[i] = 0.0;
    }
    for (int i = 0; i < n_; ++i) {
      if (at_lower >> i & 1u) {
        v.fixed[i] = p_.lower[i];
      } else if (at_upper >> i & 1u) {
        v.fixed[i] = p_.upper[i];
      } else {
        v.mask[i] = 1.0;
        v.free[v.free_count++] = i;
      }
    }
  }

  // Copies the rows in use, restricted to the free variables; the held variables move to the right-hand side.
  SIGMAIK_INLINE void collect_rows(const Variables& v, std::uint32_t active) {
    const bool holds = v.free_count < n_;
    count_ = 0;
    for (int level = 0; level < kLevels; ++level) {
      begin[level] = count_;
      for (int k = first_[level]; k < first_[level + 1]; ++k) {
        if (level == 0 && (active >> k & 1u) == 0) continue;
        const int at = count_++;
        which[at] = k;
        auto rest = Column<lanes, P>::load(p_.row[k]);
        target_[at] = p_.rhs[k];
        if (holds) {
          target_[at] -= dot<lanes>(p_.row[k], v.fixed);
          const auto m = Column<lanes, P>::load(v.mask);
#pragma GCC unroll 12
          for (int j = 0; j < P / lanes; ++j) rest.at[j] *= m.at[j];
        }
        rest.store(rest_[at]);
        set_zero<lanes>(along[at]);
      }
    }
    begin[kLevels] = count_;
  }

  // Reflects the rows of a level one by one, the longest remainder first, until only rounding is left.
  SIGMAIK_INLINE void triangularise(int level, const Variables& v) {
    const int from = begin[level], to = begin[level + 1];
    double remainder[kActiveSetRows];  // squared norms of what the reflections have left of the rows
    rank_before[level] = rank_;
    for (int k = from; k < to; ++k) remainder[k] = dot<lanes>(rest_[k], rest_[k]);
    int next = from;
    while (next < to && rank_ < v.free_count) {
      int best = next;
      for (int k = next + 1; k < to; ++k) {
        if (remainder[k] > remainder[best]) best = k;
      }
      if (!(remainder[best] > noise_[level])) break;
      if (best != next) {
        exchange(best, next);
        std::swap(remainder[best], remainder[next]);
      }
      reflect(next, v.free[rank_], to, remainder);
      ++next;
    }
    independent[level] = next - from;
  }

  // Forward substitution: all rows of the level are independent and met exactly.
  SIGMAIK_INLINE void substitute(int level) {
    for (int k = begin[level], t = rank_before[level]; k < begin[level + 1]; ++k, ++t) {
      double left = target_[k];
      for (int j = 0; j < t; ++j) left -= along[k][j] * z[j];
      z[t] = left / along[k][t];
    }
  }

  // goal = fixed + H_0 H_1 … z.
  SIGMAIK_INLINE void transform_back(const Variables& v) {
    auto x = Column<lanes, P>::load(v.fixed);
    Column<lanes, P> y;
#pragma GCC unroll 12
    for (int j = 0; j < P / lanes; ++j) y.at[j] = splat<lanes>(0.0);
    for (int t = rank_ - 1; t >= 0; --t) {
      const auto unit = Column<lanes, P>::load(kUnit<P>.at[v.free[t]]);
      const auto direction = Column<lanes, P>::load(direction_[t]);
      const auto entry = splat<lanes>(z[t]);
      Vector<lanes> products = splat<lanes>(0.0);
#pragma GCC unroll 12
      for (int j = 0; j < P / lanes; ++j) {
        y.at[j] += entry * unit.at[j];
        products += y.at[j] * direction.at[j];
      }
      const auto factor = splat<lanes>(factor_[t] * sum(products));
#pragma GCC unroll 12
      for (int j = 0; j < P / lanes; ++j) y.at[j] -= factor * direction.at[j];
    }
#pragma GCC unroll 12
    for (int j = 0; j < P / lanes; ++j) x.at[j] += y.at[j];
    x.store(goal);
  }

  // The Householder reflection that takes the remainder of row `at` into entry t = rank_ of z, applied to all rows
  // after `at`. Entries that are read as part of a vector afterwards are not written one by one: the processor would
  // stall on the store.
  SIGMAIK_INLINE void reflect(int at, int column, int level_end, double* remainder) {
    const int t = rank_++;
    const double length = std::sqrt(remainder[at]), head = rest_[at][column];
    const double signed_length = head >= 0.0 ? length : -length;
    const double v_head = head + signed_length;
    factor_[t] = 1.0 / (length * (length + std::abs(head)));
    along[at][t] = -signed_length;
    const auto unit = Column<lanes, P>::load(kUnit<P>.at[column]);
    auto v = Column<lanes, P>::load(rest_[at]);
    const auto add = splat<lanes>(signed_length);
#pragma GCC unroll 12
    for (int j = 0; j < P / lanes; ++j) v.at[j] += add * unit.at[j];
    v.store(direction_[t]);
    for (int k = at + 1; k < count_; ++k) {
      auto row = Column<lanes, P>::load(rest_[k]);
      Vector<lanes> products = row.at[0] * v.at[0];
#pragma GCC unroll 12
      for (int j = 1; j < P / lanes; ++j) products += row.at[j] * v.at[j];
      const double s = factor_[t] * sum(products);
      const double left = rest_[k][column] - s * v_head;
      along[k][t] = left;
      const auto factor = splat<lanes>(s), minus = splat<lanes>(left);
      Vector<lanes> squares = splat<lanes>(0.0);
#pragma GCC unroll 12
      for (int j = 0; j < P / lanes; ++j) {
        row.at[j] = row.at[j] - factor * v.at[j];
        row.at[j] -= minus * unit.at[j];
        squares += row.at[j] * row.at[j];
      }
      row.store(rest_[k]);
      if (k < level_end) remainder[k] = sum(squares);
    }
  }

  SIGMAIK_INLINE void exchange(int a, int b) {
    std::swap(which[a], which[b]);
    std::swap(target_[a], target_[b]);
    swap_columns<lanes>(rest_[a], rest_[b]);
    swap_columns<lanes>(along[a], along[b]);
  }

  // Least squares of a level with dependent rows, in the level's own entries of z: QR of the rows' coefficients.
  SIGMAIK_INLINE void fit(int level) {
    const int from = begin[level], to = begin[level + 1], t0 = rank_before[level];
    const int r = rank_ - t0, m = to - from;
    if (r == 0) return;
    double a[kActiveSetRows][P], y[kActiveSetRows];
    for (int k = 0; k < m; ++k) {
      y[k] = target_[from + k] - dot<lanes>(along[from + k], z);
      for (int j = 0; j < r; ++j) a[k][j] = along[from + k][t0 + j];
    }
    for (int j = 0; j < r; ++j) {
      double square_below = 0.0;
      for (int k = j; k < m; ++k) square_below += a[k][j] * a[k][j];
      const double length = a[j][j] >= 0.0 ? std::sqrt(square_below) : -std::sqrt(square_below);
      const double head = a[j][j] + length, factor = 1.0 / (length * head);
      a[j][j] = -length;
      for (int c = j + 1; c <= r; ++c) {
        const auto at = [&](int k) -> double& { return c == r ? y[k] : a[k][c]; };
        double s = head * at(j);
        for (int k = j + 1; k < m; ++k) s += a[k][j] * at(k);
        s *= factor;
        at(j) -= s * head;
        for (int k = j + 1; k < m; ++k) at(k) -= s * a[k][j];
      }
    }
    for (int j = r - 1; j >= 0; --j) {
      double s = y[j];
      for (int c = j + 1; c < r; ++c) s -= a[j][c] * z[t0 + c];
      z[t0 + j] = s / a[j][j];
    }
  }

  const ActiveSetProblem<P>& p_;
  const int n_;
  int first_[kLevels + 1];  // first row of each level in the problem
  double noise_[kLevels];   // squared norm below which a remainder is rounding
  int count_ = 0, rank_ = 0;
  double target_[kActiveSetRows];               // right-hand sides, less the held variables
  alignas(32) double rest_[kActiveSetRows][P];  // what the reflections have left of the rows
  alignas(32) double direction_[P][P];          // Householder vectors
  double factor_[P];                            // 2 / |vector|²
};

}  // namespace sigmaik::detail
