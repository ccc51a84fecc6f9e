#pragma once
// What the searches of a PositionIk have in common.

#include <chrono>
#include <memory>
#include <optional>

#include <sigmaik/analytic_ik.hpp>
#include <sigmaik/position_ik.hpp>

#include "parallel_axes.hpp"
#include "position_ik_branches.hpp"
#include "position_ik_descent.hpp"
#include "position_ik_starts.hpp"

namespace sigmaik {
namespace detail {

inline constexpr Effort kQuick{24, 0.5, false, false};  // of a start
inline constexpr Effort kLong{80, 0.95, false, true};   // of the best start of a block
inline constexpr Effort kPatient{80, 1.0, true, true};  // to the nearest pose
inline constexpr double kLargest = 1e9;                 // of a position [rad or m]: above, rounding exceeds 1e-7

}  // namespace detail

struct PositionIk::Model {
  Model(const Chain& arm, const PositionIkOptions& given);

  Chain chain;
  PositionIkOptions options;
  detail::DescentProblem problem;     // of a search for any solution
  detail::DescentProblem on_turn;     // of a search near a configuration: every joint stays on its turn
  detail::DescentProblem strict;      // `problem`, with a large weight of the rows that are held before the others
  std::unique_ptr<const Model> held;  // these rows alone; null: no row is held before others
  JointVector middle, zero;           // of the joint ranges; 0, or the limit nearest to 0
  JointVector speed, half;            // velocity limits; half of the ranges, π or 1 m where there is none
  detail::StartTable table;
  std::optional<AnalyticIk> analytic;
  std::optional<detail::ParallelAxes> parallel;

  // The distance to the nearest limit.
  double margin(const JointVector& q) const noexcept;
  // The least singular value of the task's rows.
  double least_sigma(const detail::Descent& search, const JointVector& q) const noexcept;
  bool redundant() const noexcept { return chain.dof() > problem.rows.equalities(); }

  // The answer at a point, on the turns nearest to `near`.
  PositionIkResult result(const detail::Descent& search, detail::DescentPoint& point, const JointVector& near,
                          std::chrono::steady_clock::time_point start) const noexcept;
  // The solutions of a closed form inside the limits. Returns whether these are all; where two solutions are almost one
  // or a joint is free, there may be more.
  bool closed_form_branches(const detail::Descent& search, const Pose& pose, const JointVector* near,
                            detail::Branches& out) const noexcept;
  // The solutions that descents from the first entries of the table find.
  void search_all(const detail::Descent& search, const Pose& pose, int starts, detail::Branches& out) const noexcept;
};

}  // namespace sigmaik
