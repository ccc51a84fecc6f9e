#pragma once
/// \file damped_least_squares.hpp

#include <sigmaik/parameters.hpp>
#include <sigmaik/rules/rule.hpp>

namespace sigmaik {

/// Constant damping (Wampler 1986; Nakamura and Hanafusa 1986). Inexact everywhere, by λ²/(σ_i²+λ²).
struct DampedLeastSquares {
  double damping = 0.1;  ///< λ > 0, in the units of σ

  /// Name of the class.
  static constexpr const char* kName = "DampedLeastSquares";
  /// Name on the command line.
  static constexpr const char* kShortName = "dls";
  /// Name in figures and tables.
  static constexpr const char* kTitle = "damped least squares";
  /// Docstring of the Python class.
  static constexpr const char* kDoc =
      "Constant damping: σ_i/(σ_i²+λ²) u_iᵀẋ (Wampler 1986; Nakamura and Hanafusa 1986).\n\n"
      "The answer is smooth, and inexact everywhere by λ²/(σ_i²+λ²). |q̇| ≤ |ẋ|/(2λ).";
  /// Table of the parameters: name, member, meaning, range.
  static constexpr auto parameters() {
    return std::tuple{param("damping", &DampedLeastSquares::damping, "λ > 0, in the units of σ.")
                          .above(0.0, "use PseudoInverse for none")};
  }

  /// In (0, 1]: a direction with σ_i at or below this part of σ_max is near a singularity.
  double relative_threshold() const noexcept { return kDefaultThreshold; }
  /// What the rule does with a direction of singular value `sigma`.
  Direction at(double sigma, const SpectrumSummary& spectrum) const noexcept {
    return detail::damped(sigma, damping, sigma > kRankTolerance * spectrum.largest);
  }
};

}  // namespace sigmaik
