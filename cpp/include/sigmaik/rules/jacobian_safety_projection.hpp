#pragma once
/// \file jacobian_safety_projection.hpp

#include <sigmaik/parameters.hpp>
#include <sigmaik/rules/rule.hpp>

namespace sigmaik {

/// Ablation of J-PARSE: regular directions only, posture held in the others (eq. 64).
struct JacobianSafetyProjection {
  double gamma = 0.1;  ///< in (0, 1]

  static constexpr const char* kName = "JacobianSafetyProjection";
  static constexpr const char* kShortName = "safety-projection";
  static constexpr const char* kTitle = "ablation: safety projection";
  static constexpr const char* kDoc =
      "Ablation of J-PARSE (eq. 64): like JacobianProjection, but the posture does not act in the directions that are "
      "left out.";
  static constexpr auto parameters() {
    return std::tuple{
        param("gamma", &JacobianSafetyProjection::gamma, "threshold in (0, 1] on σ_i/σ_max.").above(0.0).at_most(1.0)};
  }

  double relative_threshold() const noexcept { return gamma; }
  Direction at(double sigma, const SpectrumSummary& spectrum) const noexcept {
    return detail::truncated(sigma, sigma > gamma * spectrum.largest, 1.0);
  }
};

}  // namespace sigmaik
