#pragma once
/// \file collision.hpp
/// Costs of being near to obstacles, to the arm itself, and to joint limits (collision_costs.hpp has the formulas).

#include <optional>

#include <sigmaik/error.hpp>
#include <sigmaik/planning/arm_spheres.hpp>
#include <sigmaik/planning/collision_costs.hpp>
#include <sigmaik/planning/cost.hpp>
#include <sigmaik/planning/distance_field.hpp>

namespace sigmaik::planning::costs {

/// weight · Σ c(d) over the arm's spheres, d their distance to the obstacles.
struct Collision {
  std::optional<DistanceField> field = std::nullopt;  ///< of the obstacles, in the axes of the arm's base
  std::optional<ArmSpheres> spheres = std::nullopt;   ///< none: ArmSpheres::along_links(chain)
  double clearance = 0.05;                            ///< ε [m] > 0; larger distances cost nothing
  double weight = 1e4;                                ///< [1/m] > 0

  /// \throws Error where there is no field, or a parameter is out of its range
  JointCostPtr bind(const Chain& chain) const {
    if (!field) throw Error("a cost of collisions needs obstacles");
    return collision_cost(spheres ? *spheres : ArmSpheres::along_links(chain), *field, clearance, weight);
  }
};

/// weight · Σ c(d) over the pairs of the arm's spheres that may come into contact, d the distance of their surfaces.
struct SelfCollision {
  std::optional<ArmSpheres> spheres = std::nullopt;  ///< none: ArmSpheres::along_links(chain)
  double clearance = 0.02;                           ///< ε [m] > 0
  double weight = 1e4;                               ///< [1/m] > 0

  /// \throws Error where a parameter is out of its range
  JointCostPtr bind(const Chain& chain) const {
    const ArmSpheres arm = spheres ? *spheres : ArmSpheres::along_links(chain);
    return self_collision_cost(arm, self_collision_pairs(arm, clearance), clearance, weight);
  }
};

/// weight · Σ_j ½ x_j², x_j the distance by which joint j is nearer to a limit than `margin`, or beyond it.
struct JointLimits {
  double margin = 0.1;  ///< [rad or m] ≥ 0
  double weight = 1.0;  ///< > 0

  /// \throws Error where a parameter is out of its range
  JointCostPtr bind(const Chain& chain) const { return joint_limit_cost(chain, margin, weight); }
};

}  // namespace sigmaik::planning::costs
