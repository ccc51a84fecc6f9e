#pragma once
/// \file damped_least_squares.hpp

#include <sigmaik/parameters.hpp>
#include <sigmaik/rules/rule.hpp>

namespace sigmaik {

/// Constant damping (Wampler 1986; Nakamura and Hanafusa 1986). Inexact everywhere, by λ²/(σ_i²+λ²).
struct DampedLeastSquares {
  double damping = 0.1;  ///< λ > 0, in the units of σ

  static constexpr const char* kName = "DampedLeastSquares";
  static constexpr const char* kShortName = "dls";
  static constexpr const char* kTitle = "damped least squares";
  static constexpr const char* kDoc =
      "Constant damping: σ_i/(σ_i²+λ²) u_iᵀẋ (Wampler 1986; Nakamura and Hanafusa 1986).\n\n"
      "The answer is smooth, and inexact everywhere by λ²/(σ_i²+λ²). |q̇| ≤ |ẋ|/(2λ).";
  static constexpr auto parameters() {
    return std::tuple{param("damping", &DampedLeastSquares::damping, "λ > 0, in the units of σ.")
                          .above(0.0, "use PseudoInverse for none")};
  }

  double relative_threshold() const noexcept { return kDefaultThreshold; }
  Direction at(double sigma, const SpectrumSummary& spectrum) const noexcept {
    return detail::damped(sigma, damping, sigma > kRankTolerance * spectrum.largest);
  }
};

}  // namespace sigmaik
