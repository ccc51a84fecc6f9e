#pragma once
/// \file geometry_aware.hpp
/// weight · ξ(q), the geometry-aware index with Σ = kI (Petrović et al., eq. 12), cut off at `most`.

#include <optional>

#include <sigmaik/chain.hpp>
#include <sigmaik/planning/cost.hpp>
#include <sigmaik/planning/costs.hpp>

namespace sigmaik::planning::costs {

/// reference_scale(chain), which takes some ms, found once for each of the last 32 arms. Safe to call from many
/// threads.
double cached_reference_scale(const Chain& chain);

/// The geometry-aware index as a cost.
struct GeometryAware {
  double weight = 1.0;                     ///< > 0
  std::optional<double> k = std::nullopt;  ///< > 0; none: reference_scale(chain)
  double most = 2000.0;                    ///< > 0

  /// \throws Error where a parameter is out of its range
  JointCostPtr bind(const Chain& chain) const {
    return geometry_aware_cost(chain, k ? *k : cached_reference_scale(chain), weight, most);
  }
};

}  // namespace sigmaik::planning::costs
