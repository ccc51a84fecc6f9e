#pragma once
/// \file jacobian_projection.hpp

#include <sigmaik/parameters.hpp>
#include <sigmaik/rules/rule.hpp>

namespace sigmaik {

/// Ablation of J-PARSE: regular directions only, posture free in the others (eq. 62).
struct JacobianProjection {
  double gamma = 0.1;  ///< in (0, 1]

  /// Name of the class.
  static constexpr const char* kName = "JacobianProjection";
  /// Name on the command line.
  static constexpr const char* kShortName = "projection";
  /// Name in figures and tables.
  static constexpr const char* kTitle = "ablation: projection";
  /// Docstring of the Python class.
  static constexpr const char* kDoc =
      "Ablation of J-PARSE (eq. 62): u_iᵀẋ/σ_i where σ_i > γσ_max, else 0; the posture acts in the directions that "
      "are left out.";
  /// Table of the parameters: name, member, meaning, range.
  static constexpr auto parameters() {
    return std::tuple{
        param("gamma", &JacobianProjection::gamma, "threshold in (0, 1] on σ_i/σ_max.").above(0.0).at_most(1.0)};
  }

  /// In (0, 1]: a direction with σ_i at or below this part of σ_max is near a singularity.
  double relative_threshold() const noexcept { return gamma; }
  /// What the rule does with a direction of singular value `sigma`.
  Direction at(double sigma, const SpectrumSummary& spectrum) const noexcept {
    return detail::truncated(sigma, sigma > gamma * spectrum.largest, 0.0);
  }
};

}  // namespace sigmaik
