#pragma once
// The kernel of least_squares.hpp: a primal active-set method. Each step solves the problem with the active set as
// equalities (hierarchy.hpp), moves towards that solution until a constraint blocks the way, and adds the constraint to
// the active set. At the solution, the signs of the Lagrange multipliers show which constraint has to leave the set.
//
// Inequalities G x ≤ h are soft constraints of level 0, each with a slack s ≥ 0: the active inequalities are the rows
// of level 0, and the sign of a row's residual is the multiplier of its slack. The multipliers are computed level by
// level (Escande, Mansard and Wieber 2014). Level l is minimal over what the levels before it leave, so that
//
//     gradient of ½|residual_l|² + Σ_{k before l} y_k row_k = 0    in the free variables.
//
// In a held variable, the sign of this sum shows whether level l improves if the variable leaves its bound. If level l
// would get worse (a strictly signed multiplier), no later level may release that constraint.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "hierarchy.hpp"
#include "lanes.hpp"

namespace sigmaik::detail {

template <int lanes, int P>
class ActiveSet {
 public:
  explicit SIGMAIK_INLINE ActiveSet(ActiveSetProblem<P>& problem)
      : p_(problem), n_(problem.unknowns), levels_(problem) {}

  SIGMAIK_INLINE void run() {
    take_guess();
    const int limit = 4 * (n_ + p_.inequalities) + 40;
    bool guess_may_do = true;  // until the first step has been tried
    int idle = 0;              // steps in a row that did not move x
    for (p_.steps = 1; p_.steps <= limit; ++p_.steps) {
      levels_.solve(at_lower_, at_upper_, active_);
      // If x has not moved for many steps, the constraint of the smallest index leaves the set, which cannot cycle
      // (Bland 1977), and rounding must not add or remove a constraint: the tolerances grow by `doubt`.
      const bool cautious = idle > 12;
      const double doubt = idle > 30 ? 1e6 : cautious ? 1e3 : 1.0;
      if (guess_may_do) {
        const bool feasible_goal = feasible();
        if (!feasible_goal && p_.inequalities == 0) {
          hold_all_beyond();
          continue;
        }
        guess_may_do = false;
        if (feasible_goal) {
          std::copy_n(levels_.goal, P, p_.x);
        } else {
          // Start inside the bounds, with the part of the guess that holds at the start.
          begin();
          idle = 0;
          if (changed_) continue;  // other active rows need another solution
        }
      }
      bool moved = false;
      const bool arrived = advance(moved, doubt);
      idle = moved ? 0 : idle + 1;
      if (moved) barred_ = 0;
      if (!arrived) continue;
      if (!release(cautious, doubt)) {
        p_.finished = true;
        break;
      }
    }
    p_.at_lower = at_lower_;
    p_.at_upper = at_upper_;
    p_.active = active_;
  }

 private:
  static constexpr double kSign = 1e-11;  // a multiplier below this part of the sum of its terms has no sign
  static constexpr double kNear = 1e-13;  // a constraint is met if it is missed by this part of the numbers involved

  SIGMAIK_INLINE std::uint32_t held() const { return at_lower_ | at_upper_; }

  SIGMAIK_INLINE void take_guess() {
    rounding_ = 4.0 * std::numeric_limits<double>::epsilon() * std::sqrt(levels_.prepare());
    always_ = 0;
    for (int i = 0; i < n_; ++i) {
      if (p_.lower[i] == p_.upper[i]) always_ |= 1u << i;
    }
    at_lower_ = p_.at_lower | always_;
    at_upper_ = p_.at_upper & ~at_lower_;
    active_ = p_.active;
    barred_ = 0;
  }

  // ---- The way to the goal ----------------------------------------------------------------------------------------

  // Tolerance of a variable's bound.
  SIGMAIK_INLINE double slack(double bound) const { return kNear * (std::abs(bound) + size_) + rounding_; }

  SIGMAIK_INLINE double at_row(int k, const double (&x)[P]) const { return dot<lanes>(p_.row[k], x); }

  // Tolerance of row k.
  SIGMAIK_INLINE double row_noise(int k) const {
    return kNear * 10.0 * (std::abs(p_.rhs[k]) + std::sqrt(levels_.square[k]) * size_) +
           std::sqrt(levels_.square[k]) * rounding_;
  }

  SIGMAIK_INLINE void measure_goal() {
    size_ = 0.0;
    for (int i = 0; i < n_; ++i) size_ = std::max(size_, std::abs(levels_.goal[i]));
  }

  SIGMAIK_INLINE bool feasible() {
    measure_goal();
    const auto& goal = levels_.goal;
    for (int i = 0; i < n_; ++i) {
      if (goal[i] > p_.upper[i] && goal[i] > p_.upper[i] + slack(p_.upper[i])) return false;
      if (goal[i] < p_.lower[i] && goal[i] < p_.lower[i] - slack(p_.lower[i])) return false;
    }
    for (int k = 0; k < p_.inequalities; ++k) {
      if ((active_ >> k & 1u) == 0 && at_row(k, goal) > p_.rhs[k] + row_noise(k)) return false;
    }
    return true;
  }

  // Holds each free variable whose goal is beyond a bound at this bound, all at once. Each call holds at least one
  // variable, so a feasible goal comes after `unknowns` calls at the latest, and usually after two or three.
  SIGMAIK_INLINE void hold_all_beyond() {
    const auto& goal = levels_.goal;
    const std::uint32_t is_held = held();
    for (int i = 0; i < n_; ++i) {
      if (is_held >> i & 1u) continue;
      if (goal[i] > p_.upper[i] + slack(p_.upper[i])) at_upper_ |= 1u << i;
      if (goal[i] < p_.lower[i] - slack(p_.lower[i])) at_lower_ |= 1u << i;
    }
  }

  // Projects x into the bounds, and makes the inequalities active that x violates, or that the guess holds and x meets.
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

  // The part of the step to the goal up to the first constraint that blocks the step: a bound, or a row.
  struct Step {
    double part = 1.0;
    int bound = -1, row = -1;
  };

  // Moves x towards the goal up to the first constraint in the way, which becomes active. Returns whether x has reached
  // the goal.
  SIGMAIK_INLINE bool advance(bool& moved, double doubt) {
    measure_goal();
    Step step;
    stop_at_bounds(doubt, step);
    stop_at_rows(doubt, step);
    const auto& goal = levels_.goal;
    double largest = 0.0;
    for (int i = 0; i < n_; ++i) {
      const double change = step.part * (goal[i] - p_.x[i]);
      largest = std::max(largest, std::abs(change));
      const double to = step.part == 1.0 ? goal[i] : p_.x[i] + change;
      p_.x[i] = std::min(std::max(to, p_.lower[i]), p_.upper[i]);
    }
    moved = largest > 1e3 * kNear * size_ + rounding_;
    if (step.row >= 0) {
      active_ |= 1u << step.row;
      return false;
    }
    if (const int i = step.bound; i >= 0) {
      const bool up = goal[i] > p_.x[i];
      p_.x[i] = up ? p_.upper[i] : p_.lower[i];
      (up ? at_upper_ : at_lower_) |= 1u << i;
      return false;
    }
    return true;
  }

  SIGMAIK_INLINE void stop_at_bounds(double doubt, Step& step) const {
    const auto& goal = levels_.goal;
    const std::uint32_t is_held = held();
    for (int i = 0; i < n_; ++i) {
      if (is_held >> i & 1u) continue;
      const double way = goal[i] - p_.x[i];
      double room;
      if (way > 0.0 && goal[i] > p_.upper[i] + doubt * slack(p_.upper[i])) {
        room = p_.upper[i] - p_.x[i];
      } else if (way < 0.0 && goal[i] < p_.lower[i] - doubt * slack(p_.lower[i])) {
        room = p_.lower[i] - p_.x[i];
      } else {
        continue;
      }
      const double part = std::max(0.0, room / way);
      if (part < step.part) {
        step.part = part;
        step.bound = i;
      }
    }
  }

  SIGMAIK_INLINE void stop_at_rows(double doubt, Step& step) const {
    for (int k = 0; k < p_.inequalities; ++k) {
      if (active_ >> k & 1u) continue;
      const double there = at_row(k, levels_.goal);
      if (!(there > p_.rhs[k] + doubt * row_noise(k))) continue;
      const double here = at_row(k, p_.x);
      if (!(there > here)) continue;
      const double part = std::max(0.0, (p_.rhs[k] - here) / (there - here));
      if (part < step.part) {
        step.part = part;
        step.row = k;
      }
    }
  }

  // ---- Multipliers at the goal --------------------------------------------------------------------------------------

  // Constraints that an earlier level needs: no later level may release one of them.
  struct Locked {
    std::uint32_t variables, rows = 0;
  };

  // The sum of a level's gradient and the multipliers times the rows of the levels before it.
  struct Gradient {
    alignas(32) double sum[P], terms[P];  // in x; `terms` adds up absolute values: the scale of the sum's rounding
    alignas(32) double h[P], y[P];        // the gradient in z; the multipliers
    double scale = 0.0;                   // of the gradient, before the levels cancel in the sum

    SIGMAIK_INLINE Gradient() {
      set_zero<lanes>(sum);
      set_zero<lanes>(terms);
      set_zero<lanes>(h);
      set_zero<lanes>(y);
    }
    SIGMAIK_INLINE void add(double factor, const double (&row)[P]) {
      add_scaled<lanes>(sum, factor, row);
      for (int j = 0; j < P; ++j) terms[j] += std::abs(factor * row[j]);
    }
  };

  // At the goal: removes from the active set the constraint that the first possible level wants to release. Returns
  // false if no level wants to release a constraint: x is the answer.
  SIGMAIK_INLINE bool release(bool cautious, double doubt) {
    if (((held() & ~always_) | active_) == 0) return false;
    Locked locked{always_};
    for (int level = 0; level <= kNorm; ++level) {
      Gradient g;
      if (level == kNorm) {
        add_norm(g);
      } else {
        const int dependent = levels_.begin[level + 1] - levels_.begin[level] - levels_.independent[level];
        if (dependent == 0) continue;  // every row is met exactly
        const Residuals residuals = add_residuals(level, doubt, g);
        if (residuals.slackest_row >= 0) {
          active_ &= ~(1u << residuals.slackest_row);
          return true;
        }
        locked.rows |= residuals.violated_rows;
        if (!residuals.any) {
          if (repair(level, locked.variables)) return true;
          continue;
        }
      }
      add_multipliers(level, g);
      if (release_one(level, g, cautious, doubt, locked)) return true;
      if (level < kNorm && repair(level, locked.variables)) return true;
    }
    return false;
  }

  struct Residuals {
    bool any = false;                 // some row of the level is not met
    int slackest_row = -1;            // the active inequality whose slack has the most negative multiplier
    std::uint32_t violated_rows = 0;  // inequalities that cannot be met
  };

  // Adds the gradient of ½|residual|² of a level, from the residuals at x.
  SIGMAIK_INLINE Residuals add_residuals(int level, double doubt, Gradient& g) const {
    Residuals r;
    double most = 0.0;
    for (int k = levels_.begin[level]; k < levels_.begin[level + 1]; ++k) {
      const int at = levels_.which[k];
      const double residual = at_row(at, p_.x) - p_.rhs[at];
      if (std::abs(residual) <= doubt * row_noise(at)) continue;
      r.any = true;
      g.add(residual, p_.row[at]);
      g.scale += std::abs(residual) * std::sqrt(levels_.square[at]);
      add_scaled<lanes>(g.h, residual, levels_.along[k]);
      if (level > 0) continue;
      if (residual > 0.0) {
        r.violated_rows |= 1u << at;
      } else if (-residual > most) {
        most = -residual;
        r.slackest_row = at;
      }
    }
    return r;
  }

  // Adds the gradient of ½|x|², the last level.
  SIGMAIK_INLINE void add_norm(Gradient& g) const {
    for (int i = 0; i < n_; ++i) {
      g.sum[i] = p_.x[i];
      g.terms[i] = std::abs(p_.x[i]);
      g.scale += g.terms[i];
    }
    copy_column<lanes>(levels_.z, g.h);
  }

  // Adds y_k row_k of the levels before `level`.
  SIGMAIK_INLINE void add_multipliers(int level, Gradient& g) const {
    levels_.back_substitute(levels_.rank_before[level], g.h, g.y);
    for (int t = 0; t < levels_.rank_before[level]; ++t) {
      const int at = levels_.which[levels_.pivot(t)];
      g.add(g.y[t], p_.row[at]);
    }
  }

  // The constraint that gains most if it leaves the active set (if cautious: the first one that gains), and the
  // constraints that must stay.
  struct Choice {
    int index = -1;
    bool is_row = false;
    double most = 0.0;
    std::uint32_t strict = 0, strict_rows = 0;
  };

  // Releases the constraint that `level` gains most from. If there is none, locks the constraints that the level needs.
  SIGMAIK_INLINE bool release_one(int level, const Gradient& g, bool cautious, double doubt, Locked& locked) {
    // In the free variables the sum is zero except for rounding, which is measured there.
    const std::uint32_t is_held = held();
    double rounding = kNear * g.scale;
    for (int i = 0; i < n_; ++i) {
      if ((is_held >> i & 1u) == 0) rounding = std::max(rounding, 30.0 * std::abs(g.sum[i]));
    }
    Choice choice;
    choose_variable(g, is_held & ~locked.variables, rounding, cautious, doubt, choice);
    if (level > 0) choose_row(g, locked.rows, rounding, cautious, doubt, choice);
    if (choice.index >= 0) {
      if (choice.is_row) {
        active_ &= ~(1u << choice.index);
      } else {
        at_lower_ &= ~(1u << choice.index);
        at_upper_ &= ~(1u << choice.index);
      }
      return true;
    }
    locked.variables |= choice.strict;
    locked.rows |= choice.strict_rows;
    return false;
  }

  SIGMAIK_INLINE void choose_variable(const Gradient& g, std::uint32_t candidates, double rounding, bool cautious,
                                      double doubt, Choice& choice) const {
    for (int i = 0; i < n_; ++i) {
      if ((candidates >> i & 1u) == 0) continue;
      const double gain = at_upper_ >> i & 1u ? g.sum[i] : -g.sum[i];
      const double noise = kSign * g.terms[i] + rounding;
      if (gain > doubt * noise) {
        if (choice.index < 0 || (!cautious && gain > choice.most)) {
          choice.most = gain;
          choice.index = i;
        }
      } else if (gain < -noise) {
        choice.strict |= 1u << i;
      }
    }
  }

  SIGMAIK_INLINE void choose_row(const Gradient& g, std::uint32_t locked_rows, double rounding, bool cautious,
                                 double doubt, Choice& choice) const {
    for (int t = 0; t < levels_.rank_before[1]; ++t) {
      const int at = levels_.which[levels_.pivot(t)];
      if (locked_rows >> at & 1u) continue;
      const double gain = -g.y[t] * std::sqrt(levels_.square[at]);
      const double noise = kSign * g.scale + rounding;
      if (gain > doubt * noise) {
        if (choice.index < 0 || (cautious ? choice.is_row && at < choice.index : gain > choice.most)) {
          choice.most = gain;
          choice.index = at;
          choice.is_row = true;
        }
      } else if (gain < -noise) {
        choice.strict_rows |= 1u << at;
      }
    }
  }

  // A row of the level can be met and still be dependent, only because of the held variables. Its multiplier is then
  // not unique. Releasing one held variable that the row contains makes the row independent and does not move x.
  SIGMAIK_INLINE bool repair(int level, std::uint32_t locked) {
    const std::uint32_t candidates = held() & ~locked & ~barred_;
    if (candidates == 0) return false;
    const int end = levels_.rank_before[level + 1];
    for (int k = levels_.begin[level] + levels_.independent[level]; k < levels_.begin[level + 1]; ++k) {
      // The row, less its part in the rows that are independent.
      alignas(32) double rest[P], h[P], y[P];
      set_zero<lanes>(y);
      copy_column<lanes>(p_.row[levels_.which[k]], rest);
      copy_column<lanes>(levels_.along[k], h);
      levels_.back_substitute(end, h, y);
      for (int t = 0; t < end; ++t) add_scaled<lanes>(rest, y[t], p_.row[levels_.which[levels_.pivot(t)]]);
      int drop = -1;
      double most = 1e-8 * std::sqrt(levels_.square[levels_.which[k]]);
      for (int i = 0; i < n_; ++i) {
        if ((candidates >> i & 1u) != 0 && std::abs(rest[i]) > most) {
          most = std::abs(rest[i]);
          drop = i;
        }
      }
      if (drop >= 0) {
        at_lower_ &= ~(1u << drop);
        at_upper_ &= ~(1u << drop);
        barred_ |= 1u << drop;
        return true;
      }
    }
    return false;
  }

  static constexpr int kNorm = Hierarchy<lanes, P>::kLevels;  // the level |x|

  ActiveSetProblem<P>& p_;
  const int n_;
  Hierarchy<lanes, P> levels_;
  double size_ = 0.0;                                                    // largest entry of the goal
  double rounding_ = 0.0;                                                // of x, from the largest |rhs| / |row|
  std::uint32_t always_ = 0, at_lower_ = 0, at_upper_ = 0, active_ = 0;  // always_: variables with lower = upper
  std::uint32_t barred_ = 0;  // variables that repair() must not release again before x has moved
  bool changed_ = false;
};

}  // namespace sigmaik::detail
