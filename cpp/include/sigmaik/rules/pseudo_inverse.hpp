#pragma once
/// \file pseudo_inverse.hpp

#include <sigmaik/parameters.hpp>
#include <sigmaik/rules/rule.hpp>

namespace sigmaik {

/// Moore and Penrose's inverse, truncated. Exact until it is not: joint speeds grow as 1/σ_i.
struct PseudoInverse {
  double tolerance = 1e-12;  ///< in (0, 1], of σ_max

  static constexpr const char* kName = "PseudoInverse";
  static constexpr const char* kShortName = "pinv";
  static constexpr const char* kTitle = "pseudo-inverse";
  static constexpr const char* kDoc =
      "Moore and Penrose's inverse, truncated: u_iᵀẋ/σ_i, and 0 where σ_i ≤ tolerance·σ_max.\n\n"
      "The answer is exact, but joint speeds grow as 1/σ_i towards a singularity.";
  static constexpr auto parameters() {
    return std::tuple{param("tolerance", &PseudoInverse::tolerance,
                            "fraction of σ_max in (0, 1] at and below which directions are dropped.")
                          .above(0.0)
                          .at_most(1.0)};
  }

  double relative_threshold() const noexcept { return kDefaultThreshold; }
  Direction at(double sigma, const SpectrumSummary& spectrum) const noexcept {
    return detail::truncated(sigma, sigma > tolerance * spectrum.largest, 0.0);
  }
};

}  // namespace sigmaik
