#pragma once
/// \file plan.hpp
/// The planners in one call each: from an arm, two configurations and a cost to a motion.
///
/// TimeOptimal and SupportPlanner do the work, and keep their memory from one plan to the next.

#include <optional>

#include <sigmaik/chain.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/planning/arm_spheres.hpp>
#include <sigmaik/planning/cost.hpp>
#include <sigmaik/planning/distance_field.hpp>
#include <sigmaik/planning/support_states.hpp>
#include <sigmaik/planning/time_optimal.hpp>
#include <sigmaik/planning/trajectory.hpp>

namespace sigmaik::planning {

/// Obstacles that a motion keeps clear of: a cost where the arm is near to them, and a check of the answer.
struct KeepClear {
  /// The obstacles.
  DistanceField field;
  std::optional<ArmSpheres> spheres = std::nullopt;  ///< none: ArmSpheres::along_links(chain)
  double margin = 0.05;                              ///< [m] > 0: obstacles that are farther cost nothing
  double weight = 1e4;                               ///< [1/m] ≥ 0; 0: the answer is checked, and nothing else
};

/// TimeOptimal::plan(), with the arm's singular sets; none: SingularSets::of(chain). With `obstacles` the motion's cost
/// counts them too, and a motion that touches one between the nodes has failed.
/// \throws Error as TimeOptimal, where a cost does not fit or has no Hessian, or an end touches an obstacle
Trajectory time_optimal(const Chain& chain, const TimeOptimalProblem& problem, const Cost& cost = {},
                        const TimeOptimalOptions& options = {},
                        const std::optional<KeepClear>& obstacles = std::nullopt,
                        const std::optional<SingularSets>& sets = std::nullopt);

/// SupportPlanner::plan() by the gradient.
/// \throws Error as SupportPlanner, or where there is no cost at all
Trajectory gradient(const Chain& chain, const JointVector& start, const JointVector& goal, const Cost& cost,
                    const GradientOptions& options = {}, const std::optional<KeepClear>& obstacles = std::nullopt);

/// SupportPlanner::plan() by samples.
/// \throws Error as gradient()
Trajectory stochastic(const Chain& chain, const JointVector& start, const JointVector& goal, const Cost& cost,
                      const StochasticOptions& options = {}, const std::optional<KeepClear>& obstacles = std::nullopt);

SIGMAIK_SAME_LAYOUT(KeepClear);

}  // namespace sigmaik::planning
