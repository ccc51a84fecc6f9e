#pragma once
/// \file inverse.hpp
/// The rules: what each method does with one singular direction, J = Σ σ_i u_i v_iᵀ.
///
///     q̇ = Σ_i g_i v_i + (I − Σ_i p_i v_i v_iᵀ) q̇_posture
///
/// g_i depends on σ_i and on the command's part along u_i, p_i is the diagonal of the method's own J⁺J. With
/// c_i = u_iᵀẋ, σ_max the largest singular value and γ a threshold in (0, 1]:
///
/// | method | g_i | p_i | largest g_i / c_i |
/// |---|---|---|---|
/// | PseudoInverse | c_i/σ_i, 0 where σ_i ≤ tolerance·σ_max | 1, 0 where dropped | 1/(tolerance·σ_max) |
/// | DampedLeastSquares | σ_i/(σ_i²+λ²) c_i | σ_i²/(σ_i²+λ²) | 1/(2λ) |
/// | AdaptiveDampedLeastSquares | the same, λ from the distance to a singularity | the same | |
/// | SelectivelyDampedLeastSquares | c_i/σ_i, each direction clamped by itself | 1, 0 where dropped | joint speed max_speed |
/// | JParse | c_i/σ_i where σ_i > γσ_max, else σ_i/(γσ_max)² u_iᵀKẋ | 1 | 1/(γσ_max) for K = I |
/// | JacobianProjection | c_i/σ_i where σ_i > γσ_max, else 0 | 1, 0 where dropped | 1/(γσ_max) |
/// | JacobianSafety | c_i/max(σ_i, γσ_max) | 1 | 1/(γσ_max) |
/// | JacobianSafetyProjection | like projection | 1 | 1/(γσ_max) |

#include <array>
#include <cstdint>
#include <variant>

#include <sigmaik/spectrum.hpp>
#include <sigmaik/status.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik {

/// Moore and Penrose's inverse, truncated. Exact until it is not: joint speeds grow as 1/σ_i.
struct PseudoInverse {
  double tolerance = 1e-12;  ///< of σ_max, in (0, 1): directions at or below it are dropped
};

/// Constant damping (Wampler 1986; Nakamura and Hanafusa 1986). Inexact everywhere, by λ²/(σ_i²+λ²).
struct DampedLeastSquares {
  double damping = 0.1;  ///< λ > 0, in the units of σ
};

/// How AdaptiveDampedLeastSquares measures the distance to a singularity.
enum class DampingRule {
  /// Only directions with σ_i < ε are damped, each by its own λ_i² = (1 − (σ_i/ε)²) λ². For one small
  /// direction this is Maciejewski and Klein's numerical filtering (1988; Chiaverini 1997, eq. 17); where
  /// several are small it stays continuous as they cross.
  NumericalFiltering,
  /// All directions, λ² (1 − w/w₀)² where the manipulability w = Π σ_i < w₀ (Nakamura and Hanafusa 1986).
  Manipulability,
  /// All directions, λ² (1 − (σ_min/ε)²) where σ_min < ε (Chiaverini 1997, eq. 15).
  SmallestSingularValue,
};

/// Damping that grows towards a singularity and vanishes away from it.
struct AdaptiveDampedLeastSquares {
  DampingRule rule = DampingRule::NumericalFiltering;
  double damping = 0.1;    ///< λ > 0, reached at the singularity
  double threshold = 0.0;  ///< ε or w₀ > 0 below which damping sets in; 0: 0.1, or 1e-3 for Manipulability
  /// λ and ε are fractions of σ_max, w₀ of σ_max^size: the same arm in other units, or of another size,
  /// behaves the same. false: absolute values, as in the papers.
  bool relative = true;
};

/// Each direction clamped by what it moves the joints for what it moves the tip (Buss and Kim 2005), for
/// velocities: their angle limit per update γ_max is a joint speed here. One end effector, whose twist counts
/// as one target. Directions with σ_i ≤ 1e-12 σ_max are dropped. The answer depends on the basis chosen where
/// singular values are equal, as the paper's does.
struct SelectivelyDampedLeastSquares {
  double max_speed = 0.7853981633974483;  ///< [rad/s] > 0: no joint is asked for more
};

/// J-PARSE (Guptasarma et al.): regular directions exact; along a singular direction the command is scaled
/// by σ_i/(γσ_max), so that motion stops at the singularity and leaves it again.
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
};

/// Ablation of J-PARSE: regular directions only, posture free in the others (eq. 62).
struct JacobianProjection {
  double gamma = 0.1;
};

/// Ablation of J-PARSE: the Safety Jacobian alone (eq. 63).
struct JacobianSafety {
  double gamma = 0.1;
};

/// Ablation of J-PARSE: regular directions only, posture held in the others (eq. 64).
struct JacobianSafetyProjection {
  double gamma = 0.1;
};

using Method =
    std::variant<PseudoInverse, DampedLeastSquares, AdaptiveDampedLeastSquares, SelectivelyDampedLeastSquares, JParse,
                 JacobianProjection, JacobianSafety, JacobianSafetyProjection>;

/// "PseudoInverse", …
const char* name(const Method& method) noexcept;

/// Checks the parameters.
/// \throws Error with the parameter, its value and its range
void validate(const Method& method);

/// What a rule made of a command.
struct Resolution {
  std::array<double, kMaxTask> speed{};      ///< g_i: q̇ = Σ g_i v_i; 0 beyond size()
  std::array<double, kMaxTask> projector{};  ///< p_i of the posture; 0 beyond size()
  std::uint8_t singular = 0;                 ///< bit i: the rule does not treat direction u_i as regular
  bool exact = true;                         ///< every direction that the command uses is done in full
};

/// Applies the rule. Real time.
/// \param command (m,) in the rows of the spectrum
/// \param angular bit i: row i of the command is angular, for JParse's gains
Resolution resolve(const Method& method, const Spectrum& spectrum, const TaskVector& command,
                   std::uint8_t angular) noexcept;

}  // namespace sigmaik
