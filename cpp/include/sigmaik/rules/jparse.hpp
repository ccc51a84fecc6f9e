#pragma once
/// \file jparse.hpp

#include <sigmaik/parameters.hpp>
#include <sigmaik/rules/rule.hpp>

namespace sigmaik {

/// J-PARSE (Guptasarma et al.): regular directions are exact; along a singular direction the command is scaled by
/// σ_i/(γσ_max), so that motion stops at the singularity and leaves it again.
struct JParse {
  double gamma = 0.1;         ///< in (0, 1]
  double gain_linear = 1.0;   ///< ≥ 0, of the command's linear rows along singular directions (the paper's K)
  double gain_angular = 1.0;  ///< ≥ 0, of its angular rows
  /// The gain is K at σ_i = 0 and goes linearly to I at σ_i = γσ_max. false: K throughout, as published;
  /// with K ≠ I the answer then jumps at the threshold.
  bool continuous = true;
  /// Whether the posture acts along singular directions, as far as J-PARSE's own inverse does not: I − J⁺J, whose p_i
  /// is (σ_i/(γσ_max))². An arm that was stretched out then folds back to the side of its posture. false: p_i = 1, as
  /// published.
  bool singular_posture = false;
  /// Whether the threshold grows with what is asked along the direction: min(γσ_max, the σ_i that the command needs, by
  /// the velocity and acceleration limits of the arm (SpectrumSummary::needed)). A Servo then is exact up to the
  /// neighbourhood of a singularity that matters for this command, and comes to rest beyond reach. Without a Pace
  /// (VelocitySolver), or false: γσ_max, as published.
  bool adaptive = true;

  /// Name of the class.
  static constexpr const char* kName = "JParse";
  /// Name on the command line.
  static constexpr const char* kShortName = "jparse";
  /// Name in figures and tables.
  static constexpr const char* kTitle = "J-PARSE";
  /// Docstring of the Python class.
  static constexpr const char* kDoc =
      "J-PARSE (Guptasarma et al.): u_iᵀẋ/σ_i where σ_i > γσ_max, else σ_i/(γσ_max)² u_iᵀKẋ.\n\n"
      "Regular directions are exact; along a singular one motion fades out at the singularity and can leave it\n"
      "again. |q̇| ≤ |ẋ|/(γσ_max) for unit gains.";
  /// Table of the parameters: name, member, meaning, range.
  static constexpr auto parameters() {
    return std::tuple{
        param("gamma", &JParse::gamma, "threshold in (0, 1] on σ_i/σ_max.").above(0.0).at_most(1.0),
        param("gain_linear", &JParse::gain_linear, "the paper's K ≥ 0, for the command's linear rows.").at_least(0.0),
        param("gain_angular", &JParse::gain_angular, "the paper's K ≥ 0, for the command's angular rows.")
            .at_least(0.0),
        param("continuous", &JParse::continuous,
              "the gain is K at σ_i = 0 and goes linearly to 1 at the threshold; False: K throughout, as "
              "published, which jumps at the threshold where K ≠ 1."),
        param("singular_posture", &JParse::singular_posture,
              "the posture acts along singular directions, as far as J-PARSE's own inverse does not, by its "
              "I − J⁺J: an arm that was stretched out folds back to the side of its posture. False: the posture "
              "does not act there, as published."),
        param("adaptive", &JParse::adaptive,
              "the threshold is min(γσ_max, the σ_i that the command along u_i needs to stay within the arm's velocity "
              "and acceleration limits); False, and in a VelocitySolver: γσ_max, as published.")};
  }

  /// In (0, 1]: a direction with σ_i at or below this part of σ_max is near a singularity.
  double relative_threshold() const noexcept { return gamma; }
  /// The paper's K.
  RowGains row_gains() const noexcept { return {gain_linear, gain_angular}; }
  /// What the rule does with a direction of singular value `sigma`.
  Direction at(double sigma, const SpectrumSummary& spectrum) const noexcept {
    double threshold = gamma * spectrum.largest;
    if (adaptive) threshold = std::min(threshold, std::max(spectrum.needed, kRankTolerance * spectrum.largest));
    if (sigma > threshold) return {1.0 / sigma, 1.0, true, 0.0, sigma};
    const double share = sigma / threshold;
    return {share / threshold, singular_posture ? share * share : 1.0, false, continuous ? 1.0 - share : 1.0,
            threshold};
  }
};

}  // namespace sigmaik
