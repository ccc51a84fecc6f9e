#pragma once
/// \file jacobian_safety.hpp

#include <algorithm>

#include <sigmaik/parameters.hpp>
#include <sigmaik/rules/rule.hpp>

namespace sigmaik {

/// Ablation of J-PARSE: the Safety Jacobian alone (eq. 63).
struct JacobianSafety {
  double gamma = 0.1;  ///< in (0, 1]

  /// Name of the class.
  static constexpr const char* kName = "JacobianSafety";
  /// Name on the command line.
  static constexpr const char* kShortName = "safety";
  /// Name in figures and tables.
  static constexpr const char* kTitle = "ablation: safety";
  /// Docstring of the Python class.
  static constexpr const char* kDoc = "Ablation of J-PARSE (eq. 63): u_iᵀẋ/max(σ_i, γσ_max).";
  /// Table of the parameters: name, member, meaning, range.
  static constexpr auto parameters() {
    return std::tuple{
        param("gamma", &JacobianSafety::gamma, "threshold in (0, 1] on σ_i/σ_max.").above(0.0).at_most(1.0)};
  }

  /// In (0, 1]: a direction with σ_i at or below this part of σ_max is near a singularity.
  double relative_threshold() const noexcept { return gamma; }
  /// What the rule does with a direction of singular value `sigma`.
  Direction at(double sigma, const SpectrumSummary& spectrum) const noexcept {
    const double threshold = gamma * spectrum.largest;
    return {1.0 / std::max(sigma, threshold), 1.0, sigma > threshold};
  }
};

}  // namespace sigmaik
