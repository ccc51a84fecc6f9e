#pragma once
/// \file jacobian_projection.hpp

#include <sigmaik/parameters.hpp>
#include <sigmaik/rules/rule.hpp>

namespace sigmaik {

/// Ablation of J-PARSE: regular directions only, posture free in the others (eq. 62).
struct JacobianProjection {
  double gamma = 0.1;  ///< in (0, 1]

  static constexpr const char* kName = "JacobianProjection";
  static constexpr const char* kShortName = "projection";
  static constexpr const char* kTitle = "ablation: projection";
  static constexpr const char* kDoc =
      "Ablation of J-PARSE (eq. 62): u_iᵀẋ/σ_i where σ_i > γσ_max, else 0; the posture acts in the directions that "
      "are left out.";
  static constexpr auto parameters() {
    return std::tuple{
        param("gamma", &JacobianProjection::gamma, "threshold in (0, 1] on σ_i/σ_max.").above(0.0).at_most(1.0)};
  }

  double relative_threshold() const noexcept { return gamma; }
  Direction at(double sigma, const SpectrumSummary& spectrum) const noexcept {
    return detail::truncated(sigma, sigma > gamma * spectrum.largest, 0.0);
  }
};

}  // namespace sigmaik
