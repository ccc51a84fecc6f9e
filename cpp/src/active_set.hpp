#pragma once
// The kernel under least_squares.hpp: a primal active set whose every step solves, in the variables that are free, the
// levels
//
//     0. active rows of G    1. C    2. A    3. |x|
//
// one inside the null space of those before it. Reflections from the right take the rows of a level to a triangle,
//
//     row_k · H_0 H_1 … = (along_k, 0),    x = H_0 H_1 … z,
//
// so a level fixes the next few entries of z and leaves the others alone. A row that has nothing left is dependent; the
// level then is a small least-squares problem in its own entries of z. What no level fixes stays zero: the shortest x.
//
// Inequalities are soft constraints of level 0 with a slack s ≥ 0 each: the active ones are its rows, and the sign of a
// residual is the multiplier of its slack. With multipliers level by level (Escande, Mansard and Wieber 2014): at level
// l, minimal over what the levels before leave,
//
//     gradient of ½|residual_l|² + Σ_{k before l} y_k row_k = 0    in the free variables,
//
// and what that sum is in a held variable says whether level l wants to let it go. Where it wants to hold it, strictly,
// no later level may.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "lanes.hpp"

namespace sigmaik::detail {

inline constexpr int kActiveSetRows = 72;

// The problem, padded with zeros, and the answer.
template <int P>
struct alignas(32) ActiveSetProblem {
  double row[kActiveSetRows][P];
  double rhs[kActiveSetRows];
  double lower[P], upper[P];
  double x[P];  // in: where to begin, if the guess does not fit
  int unknowns, inequalities, equalities, objectives;
  std::uint32_t at_lower, at_upper, active;  // in: the guess
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
class ActiveSet {
 public:
  explicit SIGMAIK_INLINE ActiveSet(ActiveSetProblem<P>& problem) : p_(problem), n_(problem.unknowns) {}

  SIGMAIK_INLINE void run() {
    first_[0] = 0;
    first_[1] = p_.inequalities;
    first_[2] = first_[1] + p_.equalities;
    first_[3] = first_[2] + p_.objectives;
    double reach = 0.0;
    for (int level = 0; level < 3; ++level) {
      double largest = 0.0;
      for (int k = first_[level]; k < first_[level + 1]; ++k) {
        square_[k] = dot<lanes>(p_.row[k], p_.row[k]);
        largest = std::max(largest, square_[k]);
        if (p_.rhs[k] * p_.rhs[k] > reach * square_[k] && square_[k] > 0.0) reach = p_.rhs[k] * p_.rhs[k] / square_[k];
      }
      noise_[level] = kRank * kRank * largest;
    }
    rounding_ = 4.0 * std::numeric_limits<double>::epsilon() * std::sqrt(reach);
    always_ = 0;
    for (int i = 0; i < n_; ++i) {
      if (p_.lower[i] == p_.upper[i]) always_ |= 1u << i;
    }
    at_lower_ = p_.at_lower | always_;
    at_upper_ = p_.at_upper & ~at_lower_;
    active_ = p_.active;

    const int limit = 4 * (n_ + p_.inequalities) + 40;
    bool fits = true;  // no step has been blocked yet: the guess may do
    int idle = 0;      // steps that moved nothing, in a row
    barred_ = 0;
    for (p_.steps = 1; p_.steps <= limit; ++p_.steps) {
      solve_levels();
      // Where nothing moves for long, constraints are taken by index, which cannot cycle (Bland 1977), and only where
      // there is no doubt that it is not rounding that lets them come and go.
      const bool cautious = idle > 12;
      const double doubt = idle > 30 ? 1e6 : cautious ? 1e3 : 1.0;
      if (fits) {
        fits = false;
        if (!feasible()) {
          // Begin inside the bounds, at what of the guess holds there.
          begin();
          idle = 0;
          if (changed_) continue;  // the active rows are others
        } else {
          std::copy_n(goal_, P, p_.x);
        }
      }
      bool moved = false;
      if (!advance(moved, doubt)) {
        idle = moved ? 0 : idle + 1;
        if (moved) barred_ = 0;
        continue;
      }
      idle = moved ? 0 : idle + 1;
      if (moved) barred_ = 0;
      if (!let_go(cautious, doubt)) {
        p_.finished = true;
        break;
      }
    }
    p_.at_lower = at_lower_;
    p_.at_upper = at_upper_;
    p_.active = active_;
  }

 private:
  static constexpr double kRank = 1e-12;  // a row's rest below this part of its level's longest row is rounding
  static constexpr double kSign = 1e-11;  // a multiplier below this part of its terms has no sign
  static constexpr double kNear = 1e-13;  // a bound is kept when it is missed by this part of the numbers around

  SIGMAIK_INLINE std::uint32_t held() const { return at_lower_ | at_upper_; }

  // goal_: the solution of all levels with the held variables at their bounds and the active rows as equalities.
  SIGMAIK_INLINE void solve_levels() {
    alignas(32) double mask[P], fixed[P];
    int open[P], opens = 0;
    for (int i = 0; i < P; ++i) {
      mask[i] = 0.0;
      fixed[i] = 0.0;
    }
    for (int i = 0; i < n_; ++i) {
      if (at_lower_ >> i & 1u) {
        fixed[i] = p_.lower[i];
      } else if (at_upper_ >> i & 1u) {
        fixed[i] = p_.upper[i];
      } else {
        mask[i] = 1.0;
        open[opens++] = i;
      }
    }
    const bool holds = opens < n_;
    count_ = 0;
    for (int level = 0; level < 3; ++level) {
      begin_[level] = count_;
      for (int k = first_[level]; k < first_[level + 1]; ++k) {
        if (level == 0 && (active_ >> k & 1u) == 0) continue;
        const int at = count_++;
        which_[at] = k;
        auto rest = Column<lanes, P>::load(p_.row[k]);
        target_[at] = p_.rhs[k];
        if (holds) {
          target_[at] -= dot<lanes>(p_.row[k], fixed);
          const auto m = Column<lanes, P>::load(mask);
#pragma GCC unroll 12
          for (int j = 0; j < P / lanes; ++j) rest.at[j] *= m.at[j];
        }
        rest.store(rest_[at]);
        clear(along_[at]);
      }
    }
    begin_[3] = count_;

    clear(z_);
    rank_ = 0;
    double square[kActiveSetRows];
    for (int level = 0; level < 3; ++level) {
      const int from = begin_[level], to = begin_[level + 1];
      rank_before_[level] = rank_;
      for (int k = from; k < to; ++k) square[k] = dot<lanes>(rest_[k], rest_[k]);
      int next = from;
      while (next < to && rank_ < opens) {
        int best = next;
        for (int k = next + 1; k < to; ++k) {
          if (square[k] > square[best]) best = k;
        }
        if (!(square[best] > noise_[level])) break;
        if (best != next) {
          exchange(best, next);
          std::swap(square[best], square[next]);
        }
        reflect(next, open[rank_], to, square);
        ++next;
      }
      independent_[level] = next - from;
      if (next == to) {
        for (int k = from, t = rank_before_[level]; k < to; ++k, ++t) {
          double left = target_[k];
          for (int j = 0; j < t; ++j) left -= along_[k][j] * z_[j];
          z_[t] = left / along_[k][t];
        }
      } else {
        fit(level);
      }
    }
    rank_before_[3] = rank_;

    auto x = Column<lanes, P>::load(fixed);  // zero in the free variables
    Column<lanes, P> y;
#pragma GCC unroll 12
    for (int j = 0; j < P / lanes; ++j) y.at[j] = splat<lanes>(0.0);
    for (int t = rank_ - 1; t >= 0; --t) {
      const auto unit = Column<lanes, P>::load(kUnit<P>.at[open[t]]);
      const auto v = Column<lanes, P>::load(direction_[t]);
      const auto entry = splat<lanes>(z_[t]);
      Vector<lanes> products = splat<lanes>(0.0);
#pragma GCC unroll 12
      for (int j = 0; j < P / lanes; ++j) {
        y.at[j] += entry * unit.at[j];
        products += y.at[j] * v.at[j];
      }
      const auto factor = splat<lanes>(factor_[t] * sum(products));
#pragma GCC unroll 12
      for (int j = 0; j < P / lanes; ++j) y.at[j] -= factor * v.at[j];
    }
#pragma GCC unroll 12
    for (int j = 0; j < P / lanes; ++j) x.at[j] += y.at[j];
    x.store(goal_);
  }

  // Rotates row `at` into entry t = rank_ of z, and the other rows with it. No entry is written by itself into what is
  // then read as a vector: the processor would wait.
  SIGMAIK_INLINE void reflect(int at, int column, int level_end, double* square) {
    const int t = rank_++;
    const double length = std::sqrt(square[at]), head = rest_[at][column];
    const double signed_length = head >= 0.0 ? length : -length;
    const double v_head = head + signed_length;
    factor_[t] = 1.0 / (length * (length + std::abs(head)));
    along_[at][t] = -signed_length;
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
      along_[k][t] = left;
      const auto factor = splat<lanes>(s), minus = splat<lanes>(left);
      Vector<lanes> squares = splat<lanes>(0.0);
#pragma GCC unroll 12
      for (int j = 0; j < P / lanes; ++j) {
        row.at[j] = row.at[j] - factor * v.at[j];
        row.at[j] -= minus * unit.at[j];
        squares += row.at[j] * row.at[j];
      }
      row.store(rest_[k]);
      if (k < level_end) square[k] = sum(squares);
    }
  }

  SIGMAIK_INLINE void exchange(int a, int b) {
    std::swap(which_[a], which_[b]);
    std::swap(target_[a], target_[b]);
    swap(rest_[a], rest_[b]);
    swap(along_[a], along_[b]);
  }

  // Least squares of a level with dependent rows, in its own entries of z: QR of the rows' coefficients.
  SIGMAIK_INLINE void fit(int level) {
    const int from = begin_[level], to = begin_[level + 1], t0 = rank_before_[level];
    const int r = rank_ - t0, m = to - from;
    if (r == 0) return;
    double a[kActiveSetRows][P], y[kActiveSetRows];
    for (int k = 0; k < m; ++k) {
      y[k] = target_[from + k] - dot<lanes>(along_[from + k], z_);
      for (int j = 0; j < r; ++j) a[k][j] = along_[from + k][t0 + j];
    }
    for (int j = 0; j < r; ++j) {
      double square = 0.0;
      for (int k = j; k < m; ++k) square += a[k][j] * a[k][j];
      const double length = a[j][j] >= 0.0 ? std::sqrt(square) : -std::sqrt(square);
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
      for (int c = j + 1; c < r; ++c) s -= a[j][c] * z_[t0 + c];
      z_[t0 + j] = s / a[j][j];
    }
  }

  // How far beyond a bound is beyond.
  SIGMAIK_INLINE double slack(double bound) const { return kNear * (std::abs(bound) + size_) + rounding_; }

  SIGMAIK_INLINE double at_row(int k, const double (&x)[P]) const { return dot<lanes>(p_.row[k], x); }

  // Rounding of row k at x.
  SIGMAIK_INLINE double row_noise(int k) const {
    return kNear * 10.0 * (std::abs(p_.rhs[k]) + std::sqrt(square_[k]) * size_) + std::sqrt(square_[k]) * rounding_;
  }

  SIGMAIK_INLINE void measure_goal() {
    size_ = 0.0;
    for (int i = 0; i < n_; ++i) size_ = std::max(size_, std::abs(goal_[i]));
  }

  SIGMAIK_INLINE bool feasible() {
    measure_goal();
    for (int i = 0; i < n_; ++i) {
      if (goal_[i] > p_.upper[i] && goal_[i] > p_.upper[i] + slack(p_.upper[i])) return false;
      if (goal_[i] < p_.lower[i] && goal_[i] < p_.lower[i] - slack(p_.lower[i])) return false;
    }
    for (int k = 0; k < p_.inequalities; ++k) {
      if ((active_ >> k & 1u) == 0 && at_row(k, goal_) > p_.rhs[k] + row_noise(k)) return false;
    }
    return true;
  }

  SIGMAIK_INLINE void begin() {
    for (int i = 0; i < n_; ++i) {
      if (at_lower_ >> i & 1u) {
        p_.x[i] = p_.lower[i];
      } else if (at_upper_ >> i & 1u) {
        p_.x[i] = p_.upper[i];
      } else {
        p_.x[i] = std::min(std::max(p_.x[i], p_.lower[i]), p_.upper[i]);
      }
    }
    std::uint32_t active = 0;
    for (int k = 0; k < p_.inequalities; ++k) {
      const double over = at_row(k, p_.x) - p_.rhs[k];
      if (over > row_noise(k) || ((active_ >> k & 1u) != 0 && over >= -row_noise(k))) active |= 1u << k;
    }
    changed_ = active != active_;
    active_ = active;
  }

  // From x towards the goal, up to what blocks. True: the goal is reached.
  SIGMAIK_INLINE bool advance(bool& moved, double doubt) {
    measure_goal();
    double part = 1.0;
    int bound = -1, row = -1;
    const std::uint32_t is_held = held();
    for (int i = 0; i < n_; ++i) {
      if (is_held >> i & 1u) continue;
      const double step = goal_[i] - p_.x[i];
      double room;
      if (step > 0.0 && goal_[i] > p_.upper[i] + doubt * slack(p_.upper[i])) {
        room = p_.upper[i] - p_.x[i];
      } else if (step < 0.0 && goal_[i] < p_.lower[i] - doubt * slack(p_.lower[i])) {
        room = p_.lower[i] - p_.x[i];
      } else {
        continue;
      }
      const double share = std::max(0.0, room / step);
      if (share < part) {
        part = share;
        bound = i;
      }
    }
    for (int k = 0; k < p_.inequalities; ++k) {
      if (active_ >> k & 1u) continue;
      const double there = at_row(k, goal_);
      if (!(there > p_.rhs[k] + doubt * row_noise(k))) continue;
      const double here = at_row(k, p_.x);
      if (!(there > here)) continue;
      const double share = std::max(0.0, (p_.rhs[k] - here) / (there - here));
      if (share < part) {
        part = share;
        row = k;
      }
    }
    double largest = 0.0;
    for (int i = 0; i < n_; ++i) {
      const double step = part * (goal_[i] - p_.x[i]);
      largest = std::max(largest, std::abs(step));
      const double to = part == 1.0 ? goal_[i] : p_.x[i] + step;
      p_.x[i] = std::min(std::max(to, p_.lower[i]), p_.upper[i]);
    }
    moved = largest > 1e3 * kNear * size_ + rounding_;
    if (row >= 0) {
      active_ |= 1u << row;
      return false;
    }
    if (bound >= 0) {
      const bool up = goal_[bound] > p_.x[bound];
      p_.x[bound] = up ? p_.upper[bound] : p_.lower[bound];
      (up ? at_upper_ : at_lower_) |= 1u << bound;
      return false;
    }
    return true;
  }

  // At the goal: finds what a level wants to let go, first levels first. False: nothing, x is the answer.
  SIGMAIK_INLINE bool let_go(bool cautious, double doubt) {
    if (((held() & ~always_) | active_) == 0) return false;
    std::uint32_t locked = always_, locked_rows = 0;
    double residual[kActiveSetRows];
    for (int level = 0; level < 4; ++level) {
      alignas(32) double gradient[P], terms[P], h[P], y[P];
      clear(gradient);
      clear(terms);
      clear(h);
      clear(y);
      double scale = 0.0;  // of the gradient, before the levels cancel in it
      if (level < 3) {
        const int from = begin_[level], to = begin_[level + 1], rank = to - from;
        if (independent_[level] == rank) continue;  // every row is met exactly
        bool any = false;
        std::uint32_t wants = 0;
        double most = 0.0;
        int drop_row = -1;
        for (int k = from; k < to; ++k) {
          const int at = which_[k];
          residual[k] = at_row(at, p_.x) - p_.rhs[at];
          if (std::abs(residual[k]) <= doubt * row_noise(at)) {
            residual[k] = 0.0;
            continue;
          }
          any = true;
          add(gradient, residual[k], p_.row[at]);
          add_absolute(terms, residual[k], p_.row[at]);
          scale += std::abs(residual[k]) * std::sqrt(square_[at]);
          add(h, residual[k], along_[k]);
          if (level == 0) {
            if (residual[k] > 0.0) {
              wants |= 1u << at;
            } else if (-residual[k] > most) {
              most = -residual[k];
              drop_row = at;
            }
          }
        }
        if (drop_row >= 0) {
          active_ &= ~(1u << drop_row);
          return true;
        }
        locked_rows |= wants;
        if (!any) {
          if (repair(level, locked)) return true;
          continue;
        }
      } else {
        for (int i = 0; i < n_; ++i) {
          gradient[i] = p_.x[i];
          terms[i] = std::abs(p_.x[i]);
          scale += terms[i];
        }
        copy(z_, h);
      }
      back_substitute(rank_before_[level], h, y);
      for (int t = 0; t < rank_before_[level]; ++t) {
        const int at = which_[pivot(t)];
        add(gradient, y[t], p_.row[at]);
        add_absolute(terms, y[t], p_.row[at]);
      }

      // In the free variables the gradient is zero but for rounding, which is thereby measured.
      const std::uint32_t is_held = held();
      double rounding = kNear * scale;
      for (int i = 0; i < n_; ++i) {
        if ((is_held >> i & 1u) == 0) rounding = std::max(rounding, 30.0 * std::abs(gradient[i]));
      }
      int drop = -1;
      double most = 0.0;
      bool drop_is_row = false;
      std::uint32_t strict = 0, strict_rows = 0;
      const std::uint32_t candidates = is_held & ~locked;
      for (int i = 0; i < n_; ++i) {
        if ((candidates >> i & 1u) == 0) continue;
        const double wish = at_upper_ >> i & 1u ? gradient[i] : -gradient[i];  // > 0: better without
        const double noise = kSign * terms[i] + rounding;
        if (wish > doubt * noise) {
          if (drop < 0 || (!cautious && wish > most)) {
            most = wish;
            drop = i;
          }
        } else if (wish < -noise) {
          strict |= 1u << i;
        }
      }
      if (level > 0) {
        for (int t = 0; t < rank_before_[1]; ++t) {
          const int at = which_[pivot(t)];
          if (locked_rows >> at & 1u) continue;
          const double wish = -y[t] * std::sqrt(square_[at]);
          const double noise = kSign * scale + rounding;
          if (wish > doubt * noise) {
            if (drop < 0 || (cautious ? drop_is_row && at < drop : wish > most)) {
              most = wish;
              drop = at;
              drop_is_row = true;
            }
          } else if (wish < -noise) {
            strict_rows |= 1u << at;
          }
        }
      }
      if (drop >= 0) {
        if (drop_is_row) {
          active_ &= ~(1u << drop);
        } else {
          at_lower_ &= ~(1u << drop);
          at_upper_ &= ~(1u << drop);
        }
        return true;
      }
      locked |= strict;
      locked_rows |= strict_rows;
      if (level < 3 && repair(level, locked)) return true;
    }
    return false;
  }

  // The row that fixed entry t of z.
  SIGMAIK_INLINE int pivot(int t) const {
    int level = 0;
    while (t >= rank_before_[level + 1]) ++level;
    return begin_[level] + t - rank_before_[level];
  }

  // y of the first `count` pivot rows with Σ y_k along_k = −h in their entries of z.
  SIGMAIK_INLINE void back_substitute(int count, double (&h)[P], double (&y)[P]) const {
    for (int t = count - 1; t >= 0; --t) {
      const int k = pivot(t);
      y[t] = -h[t] / along_[k][t];
      add(h, y[t], along_[k]);
    }
  }

  // A row that is met, and dependent only because of what is held: multipliers are not unique there. Letting go of one
  // variable that it needs changes nothing but that.
  SIGMAIK_INLINE bool repair(int level, std::uint32_t locked) {
    const std::uint32_t candidates = held() & ~locked & ~barred_;
    if (candidates == 0) return false;
    const int end = rank_before_[level + 1];
    for (int k = begin_[level] + independent_[level]; k < begin_[level + 1]; ++k) {
      alignas(32) double rest[P], h[P], y[P];
      clear(y);
      copy(p_.row[which_[k]], rest);
      copy(along_[k], h);
      back_substitute(end, h, y);
      for (int t = 0; t < end; ++t) add(rest, y[t], p_.row[which_[pivot(t)]]);
      int drop = -1;
      double most = 1e-8 * std::sqrt(square_[which_[k]]);
      for (int i = 0; i < n_; ++i) {
        if ((candidates >> i & 1u) != 0 && std::abs(rest[i]) > most) {
          most = std::abs(rest[i]);
          drop = i;
        }
      }
      if (drop >= 0) {
        at_lower_ &= ~(1u << drop);
        at_upper_ &= ~(1u << drop);
        barred_ |= 1u << drop;  // once, until x has moved
        return true;
      }
    }
    return false;
  }

  static SIGMAIK_INLINE void clear(double (&x)[P]) {
    const auto zero = splat<lanes>(0.0);
#pragma GCC unroll 12
    for (int j = 0; j < P / lanes; ++j) __builtin_memcpy(x + j * lanes, &zero, sizeof zero);
  }
  static SIGMAIK_INLINE void copy(const double (&x)[P], double (&to)[P]) { Column<lanes, P>::load(x).store(to); }
  static SIGMAIK_INLINE void swap(double (&x)[P], double (&y)[P]) {
    const auto a = Column<lanes, P>::load(x), b = Column<lanes, P>::load(y);
    a.store(y);
    b.store(x);
  }
  static SIGMAIK_INLINE void add(double (&x)[P], double factor, const double (&y)[P]) {
    auto a = Column<lanes, P>::load(x);
    const auto b = Column<lanes, P>::load(y);
    const auto f = splat<lanes>(factor);
#pragma GCC unroll 12
    for (int j = 0; j < P / lanes; ++j) a.at[j] += f * b.at[j];
    a.store(x);
  }
  static SIGMAIK_INLINE void subtract(double (&x)[P], double factor, const double (&y)[P]) { add(x, -factor, y); }
  static SIGMAIK_INLINE void add_absolute(double (&x)[P], double factor, const double (&y)[P]) {
    for (int j = 0; j < P; ++j) x[j] += std::abs(factor * y[j]);
  }

  ActiveSetProblem<P>& p_;
  const int n_;
  int first_[4];                   // of a level, among the problem's rows
  double square_[kActiveSetRows];  // of the problem's rows
  double noise_[3];
  double size_ = 0.0;      // of the goal
  double rounding_ = 0.0;  // of x, from the largest |rhs| / |row|
  std::uint32_t always_ = 0, at_lower_ = 0, at_upper_ = 0, active_ = 0;
  std::uint32_t barred_ = 0;  // not to be let go again by repair() before x has moved
  bool changed_ = false;

  // The rows at work: active inequalities, equalities, objective; within a level, independent ones first.
  int count_ = 0, begin_[4], independent_[3], rank_before_[4], rank_ = 0;
  int which_[kActiveSetRows];
  double target_[kActiveSetRows];
  alignas(32) double rest_[kActiveSetRows][P];
  alignas(32) double along_[kActiveSetRows][P];
  alignas(32) double direction_[P][P];
  double factor_[P];
  alignas(32) double z_[P];
  alignas(32) double goal_[P];
};

}  // namespace sigmaik::detail
