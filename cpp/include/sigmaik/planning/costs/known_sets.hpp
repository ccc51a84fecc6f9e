#pragma once
/// \file known_sets.hpp
/// The singular sets that costs are made of.

#include <sigmaik/chain.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/planning/cost.hpp>
#include <sigmaik/planning/costs.hpp>
#include <sigmaik/singularities.hpp>

namespace sigmaik::planning::costs {

/// SingularSets::of(chain).
/// \throws Error with the arms that are known, where this one is not
inline SingularSets known_sets(const Chain& chain) {
  if (std::optional<SingularSets> sets = SingularSets::of(chain)) return *sets;
  std::string names;
  for (const std::string& name : SingularSets::names()) names += (names.empty() ? "" : ", ") + name;
  throw Error("the singular sets of this arm are not known; avoid='manipulability' needs none. Known are: " + names);
}

}  // namespace sigmaik::planning::costs
