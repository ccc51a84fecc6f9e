#pragma once
/// \file manipulability.hpp
/// Costs that fall with the manipulability m = √det(JJᵀ).

#include <optional>

#include <sigmaik/planning/costs/known_sets.hpp>

namespace sigmaik::planning::costs {

/// weight/(m(q) + ε) (Beck et al. 2022, eq. 23).
struct Manipulability {
  double weight = 1e2;    ///< > 0
  double epsilon = 1e-6;  ///< > 0
  /// m in closed form where the arm's singular sets are known, which is faster; false: always from the Jacobian
  bool closed_form = true;
  std::optional<SingularSets> sets = std::nullopt;  ///< none: SingularSets::of(chain)

  /// \throws Error where a parameter is out of its range
  JointCostPtr bind(const Chain& chain) const {
    const std::optional<SingularSets> known = !closed_form ? std::nullopt : sets ? sets : SingularSets::of(chain);
    return known ? manipulability_cost(*known, weight, epsilon) : manipulability_cost(chain, weight, epsilon);
  }
};

/// −weight · log m(q), m no less than 1e-9 (after Marić et al. 2019).
struct LogManipulability {
  double weight = 1.0;  ///< > 0

  /// \throws Error where the weight is out of its range
  JointCostPtr bind(const Chain& chain) const { return log_manipulability_cost(chain, weight); }
};

}  // namespace sigmaik::planning::costs
