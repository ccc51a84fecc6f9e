#pragma once
/// \file potential.hpp
/// weight · Σ_i exp(η₁ − η₂ ψ_i(q)), high near the arm's known singular sets (Beck et al. 2022, eqs. 26, 27).

#include <optional>

#include <sigmaik/planning/costs/known_sets.hpp>

namespace sigmaik::planning::costs {

/// Potentials around the known singular sets as a cost.
struct Potential {
  double weight = 1e2;                              ///< > 0
  double eta1 = sigmaik::Potential{}.eta1;          ///< log of the height
  double eta2 = sigmaik::Potential{}.eta2;          ///< [1/rad²] > 0, inverse squared width
  std::optional<SingularSets> sets = std::nullopt;  ///< none: SingularSets::of(chain)

  /// \throws Error where the sets of this arm are not known, or a parameter is out of its range
  JointCostPtr bind(const Chain& chain) const {
    return potential_cost(sets ? *sets : known_sets(chain), {.eta1 = eta1, .eta2 = eta2}, weight);
  }
};

}  // namespace sigmaik::planning::costs
