#pragma once
/// \file collision_costs.hpp
/// Costs that keep a plan off obstacles, off the arm itself, and off its joint limits.
///
/// A collision cost is a sum of hinges c of distances d that should be at least the clearance ε, as in CHOMP (Ratliff
/// et al. 2009; Zucker et al. 2013):
///
///     c(d) = 0   d ≥ ε,        (ε − d)²/(2ε)   0 ≤ d < ε,        ε/2 − d   d < 0
///
/// c is quadratic shortly before contact and linear in contact, with one continuous slope. The Hessians are positive
/// semidefinite: Σ w(d) (∂d/∂q)ᵀ(∂d/∂q) with w = 1/max(ε, ε − d) within the clearance, the curvature of the parabola
/// that touches the hinge from above. Where 0 ≤ d < ε, w is c″, so that the sum is the Gauss-Newton Hessian.

#include <array>
#include <cstddef>
#include <vector>

#include <sigmaik/chain.hpp>
#include <sigmaik/planning/arm_spheres.hpp>
#include <sigmaik/planning/distance_field.hpp>
#include <sigmaik/planning/joint_cost.hpp>

namespace sigmaik::planning {

/// weight · Σ_i c(d_i): d_i the signed distance from sphere i's surface to the obstacles, i all spheres that a joint
/// moves. The field is in the axes of the arm's base.
/// \param clearance ε [m] > 0
/// \throws Error where a parameter is out of its range
JointCostPtr collision_cost(const ArmSpheres& spheres, const DistanceField& field, double clearance = 0.05,
                            double weight = 1.0);

/// Two spheres of an arm, by index.
using SpherePair = std::array<int, 2>;

/// Pairs of spheres that may come into contact: spheres of links that are not neighbours, i.e. with two or more joints
/// between them, the base included. Pairs that are nearer than `clearance` at more than a share `most_contacts` of 1000
/// quasi-random configurations within the joint limits (±π where there are none) are left out: such spheres are close
/// by the arm's design. The result is the same on every machine, and takes some ms.
/// \param clearance [m] ≥ 0, that of the cost   \param most_contacts 0 … 1
/// \throws Error where a parameter is out of its range
std::vector<SpherePair> self_collision_pairs(const ArmSpheres& spheres, double clearance = 0.02,
                                             double most_contacts = 0.1);

/// weight · Σ c(d) over pairs of spheres, d the distance of their surfaces.
/// \param clearance ε [m] > 0
/// \throws Error where a parameter is out of its range, or a pair is not of two spheres of this arm
JointCostPtr self_collision_cost(const ArmSpheres& spheres, const std::vector<SpherePair>& pairs,
                                 double clearance = 0.02, double weight = 1.0);

/// weight · Σ_j ½ x_j², x_j the distance by which joint j is nearer to a limit than `margin` [rad or m], or beyond it.
/// Joints without limits cost nothing.
/// \param margin ≥ 0
/// \throws Error where a parameter is out of its range
JointCostPtr joint_limit_cost(const Chain& chain, double margin = 0.1, double weight = 1.0);

/// The least signed distance [m] from a sphere that a joint moves to the obstacles: below 0 there is contact. Real
/// time; q must have chain().dof() finite entries.
double min_distance(const ArmSpheres& spheres, const DistanceField& field, const JointRef& q) noexcept;

/// The same at `count` configurations.
/// \param q (count, n) in C order, finite   \param distance out: (count,)
/// \param threads ≥ 1, the most that work at once
/// \throws Error where threads is below 1
void min_distance(const ArmSpheres& spheres, const DistanceField& field, std::size_t count, const double* q,
                  double* distance, int threads = 1);

}  // namespace sigmaik::planning
