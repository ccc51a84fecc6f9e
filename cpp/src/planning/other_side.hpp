#pragma once
// First guesses that lead round what a motion has run into.

#include <sigmaik/chain.hpp>
#include <sigmaik/planning/clearance.hpp>
#include <sigmaik/planning/time_optimal.hpp>
#include <sigmaik/singularities.hpp>

namespace sigmaik::planning::detail {

/// The problem with its first guess bent by 0.6 rad or m along `direction` (n,) half-way. Each joint is bent by no more
/// than 0.4 of its way from the ends to its limits, so that the guess stays within them.
TimeOptimalProblem bent(const Chain& chain, const TimeOptimalProblem& problem, const JointVector& direction);

/// The direction (n,), of length 1, that leads from a crossing to the other side: back to the start's side of a wall,
/// and for sets of higher codimension to the side where the motion is not. Zero where the set has no slope there.
JointVector other_side(const SingularSets& sets, const Crossing& crossing, const JointVector& start);

}  // namespace sigmaik::planning::detail
