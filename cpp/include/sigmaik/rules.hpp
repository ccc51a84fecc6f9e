#pragma once
/// \file rules.hpp
/// The rules: what each method does with one singular direction, J = Σ σ_i u_i v_iᵀ. Each rule has a file in rules/.
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

#include <cstdint>
#include <variant>

#include <sigmaik/layout.hpp>
#include <sigmaik/rules/adaptive_damped_least_squares.hpp>
#include <sigmaik/rules/custom.hpp>
#include <sigmaik/rules/damped_least_squares.hpp>
#include <sigmaik/rules/jacobian_projection.hpp>
#include <sigmaik/rules/jacobian_safety.hpp>
#include <sigmaik/rules/jacobian_safety_projection.hpp>
#include <sigmaik/rules/jparse.hpp>
#include <sigmaik/rules/pseudo_inverse.hpp>
#include <sigmaik/rules/rule.hpp>
#include <sigmaik/rules/selectively_damped_least_squares.hpp>

namespace sigmaik {

/// A list of types that can be visited one by one.
template <typename... Types>
struct TypeList {
  /// Template<Types…, More…>.
  template <template <typename...> typename Template, typename... More>
  using Into = Template<Types..., More...>;

  /// visit(Type{}) for each.
  template <typename Visit>
  static constexpr void for_each(Visit&& visit) {
    (visit(Types{}), ...);
  }
};

/// Every rule of the library, in the order of lists and tables. A new rule needs a file in rules/ and its name here.
using Rules = TypeList<JParse, PseudoInverse, DampedLeastSquares, AdaptiveDampedLeastSquares,
                       SelectivelyDampedLeastSquares, JacobianProjection, JacobianSafety, JacobianSafetyProjection>;

/// One of the rules with its parameters, or an application's own rule.
using Method = Rules::Into<std::variant, CustomRule>;

/// "PseudoInverse", …
const char* name(const Method& method) noexcept;

/// In (0, 1]: a direction with σ_i at or below this part of σ_max is near a singularity to the method.
double relative_threshold(const Method& method) noexcept;

/// Checks the parameters.
/// \throws Error with the parameter, its value and its range
void validate(const Method& method);

/// Applies the method. Real time.
/// \param command (m,) in the rows of the spectrum
/// \param angular bit i: row i of the command is angular, for JParse's gains
/// \param pace for JParse::adaptive and for an application's rules that need the pace
Resolution resolve(const Method& method, const Spectrum& spectrum, const TaskVector& command, std::uint8_t angular,
                   const Pace& pace = {}) noexcept;

SIGMAIK_SAME_LAYOUT(Method, Resolution, Pace);

}  // namespace sigmaik
