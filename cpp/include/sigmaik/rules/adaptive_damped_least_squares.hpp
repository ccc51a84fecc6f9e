#pragma once
/// \file adaptive_damped_least_squares.hpp

#include <algorithm>
#include <array>
#include <cmath>

#include <sigmaik/parameters.hpp>
#include <sigmaik/rules/rule.hpp>

namespace sigmaik {

/// How AdaptiveDampedLeastSquares measures the distance to a singularity.
enum class DampingRule {
  /// Only directions with σ_i < ε are damped, each by its own λ_i² = (1 − (σ_i/ε)²) λ². For one small
  /// direction this is Maciejewski and Klein's numerical filtering (1988; Chiaverini 1997, eq. 17); where
  /// several are small the answer stays continuous as their singular values cross.
  NumericalFiltering,
  /// All directions, λ² (1 − w/w₀)² where the manipulability w = Π σ_i < w₀ (Nakamura and Hanafusa 1986).
  Manipulability,
  /// All directions, λ² (1 − (σ_min/ε)²) where σ_min < ε (Chiaverini 1997, eq. 15).
  SmallestSingularValue,
};

/// Texts of the damping rules.
template <>
struct Choices<DampingRule> {
  /// Text and value of each.
  static constexpr std::array all{Choice<DampingRule>{"numerical_filtering", DampingRule::NumericalFiltering},
                                  Choice<DampingRule>{"manipulability", DampingRule::Manipulability},
                                  Choice<DampingRule>{"smallest_singular_value", DampingRule::SmallestSingularValue}};
};

/// Damping that grows towards a singularity and vanishes away from it.
struct AdaptiveDampedLeastSquares {
  DampingRule rule = DampingRule::NumericalFiltering;  ///< how the distance to a singularity is measured
  double damping = 0.1;                                ///< λ > 0, reached at the singularity
  double threshold = 0.0;  ///< ε or w₀ > 0 below which damping sets in; 0: 0.1, or 1e-3 for Manipulability
  /// λ and ε are fractions of σ_max, w₀ of σ_max^size: the same arm in other units, or of another size,
  /// behaves the same. false: absolute values, as in the papers.
  bool relative = true;

  /// Name of the class.
  static constexpr const char* kName = "AdaptiveDampedLeastSquares";
  /// Name on the command line.
  static constexpr const char* kShortName = "adaptive-dls";
  /// Name in figures and tables.
  static constexpr const char* kTitle = "adaptive damped least squares";
  /// Docstring of the Python class.
  static constexpr const char* kDoc =
      "Damping that grows towards a singularity and vanishes away from it. λ is `damping`, ε or w₀ `threshold`.\n\n"
      "rule 'numerical_filtering': only directions with σ_i < ε, λ_i² = (1 − (σ_i/ε)²) λ² (Maciejewski and Klein\n"
      "    1988, as in Chiaverini 1997; the answer is continuous too where several directions are small)\n"
      "rule 'manipulability': all directions, λ² (1 − w/w₀)² where w = Π σ_i < w₀ (Nakamura and Hanafusa 1986)\n"
      "rule 'smallest_singular_value': all directions, (1 − (σ_min/ε)²) λ² where σ_min < ε (Chiaverini 1997)";
  /// Table of the parameters: name, member, meaning, range.
  static constexpr auto parameters() {
    using Self = AdaptiveDampedLeastSquares;
    return std::tuple{
        param("rule", &Self::rule, "how the distance to a singularity is measured."),
        param("damping", &Self::damping, "λ > 0 at the singularity.").above(0.0),
        param("threshold", &Self::threshold, "> 0; by default 0.1, or 1e-3 for 'manipulability'.")
            .at_least(0.0)
            .none_is(0.0),
        param("relative", &Self::relative,
              "λ and ε are fractions of σ_max, w₀ of σ_max to the number of directions, so that units and size of the "
              "arm do not matter; False: absolute values, as in the papers.")};
  }

  /// In (0, 1]: a direction with σ_i at or below this part of σ_max is near a singularity.
  double relative_threshold() const noexcept {
    const bool told = relative && rule != DampingRule::Manipulability && threshold > 0.0;
    return told ? std::min(threshold, 1.0) : kDefaultThreshold;
  }
  /// What the rule does with a direction of singular value `sigma`.
  Direction at(double sigma, const SpectrumSummary& spectrum) const noexcept {
    const double unit = relative ? spectrum.largest : 1.0;
    const double lambda = damping * unit;
    double near = 0.0;  // λ_i² as a part of λ²: 0 from the threshold on, 1 at the singularity
    if (rule == DampingRule::Manipulability) {
      const double limit = threshold > 0.0 ? threshold : 1e-3;
      const double distance = 1.0 - std::min(1.0, spectrum.manipulability(unit) / limit);
      near = distance * distance;
    } else {
      const double limit = (threshold > 0.0 ? threshold : 0.1) * unit;
      const double watched = rule == DampingRule::NumericalFiltering ? sigma : spectrum.smallest;
      const double ratio = std::min(1.0, watched / limit);
      near = 1.0 - ratio * ratio;
    }
    return detail::damped(sigma, lambda * std::sqrt(near), near == 0.0);
  }
};

}  // namespace sigmaik
