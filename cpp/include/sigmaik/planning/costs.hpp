#pragma once
/// \file costs.hpp
/// Costs that keep a plan away from singularities (Beck et al. 2022, section 3).

#include <vector>

#include <sigmaik/chain.hpp>
#include <sigmaik/planning/joint_cost.hpp>
#include <sigmaik/singularities.hpp>

namespace sigmaik::planning {

/// weight · Σ_i w_i exp(η₁ − η₂ ψ_i(q)): high near the known singular sets, and nothing elsewhere (eqs. 26, 27).
/// \throws Error where a parameter is out of its range
JointCostPtr potential_cost(const SingularSets& sets, const Potential& potential = {}, double weight = 1e2);

/// weight/(m(q) + ε), m = √det(JJᵀ) in closed form (eq. 23).
/// \throws Error where a parameter is out of its range
JointCostPtr manipulability_cost(const SingularSets& sets, double weight = 1e2, double epsilon = 1e-6);

/// The same cost for any chain, from its Jacobian. The Hessian comes from differences of the gradient.
/// \throws Error where a parameter is out of its range
JointCostPtr manipulability_cost(const Chain& chain, double weight = 1e2, double epsilon = 1e-6);

/// weight · ξ(q), the geometry-aware index with Σ = kI (Petrović et al., eq. 12), cut off at `most`: at a singularity
/// the index is infinite, outweighs every other cost, and has no slope.
/// \throws Error where a parameter is out of its range
JointCostPtr geometry_aware_cost(const Chain& chain, double k, double weight = 1.0, double most = 2000.0);

/// −weight · log m(q), m = √det(JJᵀ) from the Jacobian, with m no less than 1e-9.
/// \throws Error where a parameter is out of its range
JointCostPtr log_manipulability_cost(const Chain& chain, double weight = 1.0);

/// factor · cost, with its gradient and Hessian.
/// \throws Error where the factor is not finite or negative, or there is no cost
JointCostPtr scaled_cost(double factor, JointCostPtr cost);

/// Σ of costs for the same joints.
/// \throws Error where there is none, or their numbers of joints differ
JointCostPtr sum_of_costs(std::vector<JointCostPtr> costs);

}  // namespace sigmaik::planning
