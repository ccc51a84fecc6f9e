#pragma once
/// \file pseudo_inverse.hpp

#include <sigmaik/parameters.hpp>
#include <sigmaik/rules/rule.hpp>

namespace sigmaik {

/// Moore and Penrose's inverse, truncated: exact, but joint speeds grow as 1/σ_i.
struct PseudoInverse {
  double tolerance = 1e-12;  ///< in (0, 1], of σ_max

  /// Name of the class.
  static constexpr const char* kName = "PseudoInverse";
  /// Name on the command line.
  static constexpr const char* kShortName = "pinv";
  /// Name in figures and tables.
  static constexpr const char* kTitle = "pseudo-inverse";
  /// Docstring of the Python class.
  static constexpr const char* kDoc =
      "Moore and Penrose's inverse, truncated: u_iᵀẋ/σ_i, and 0 where σ_i ≤ tolerance·σ_max.\n\n"
      "The answer is exact, but joint speeds grow as 1/σ_i towards a singularity.";
  /// Table of the parameters: name, member, meaning, range.
  static constexpr auto parameters() {
    return std::tuple{param("tolerance", &PseudoInverse::tolerance,
                            "fraction of σ_max in (0, 1] at and below which directions are dropped.")
                          .above(0.0)
                          .at_most(1.0)};
  }

  /// In (0, 1]: a direction with σ_i at or below this part of σ_max is near a singularity.
  double relative_threshold() const noexcept { return kDefaultThreshold; }
  /// What the rule does with a direction of singular value `sigma`.
  Direction at(double sigma, const SpectrumSummary& spectrum) const noexcept {
    return detail::truncated(sigma, sigma > tolerance * spectrum.largest, 0.0);
  }
};

}  // namespace sigmaik
