#pragma once
/// \file rule.hpp
/// A rule is a struct of parameters that says what to do with one singular direction of J = Σ σ_i u_i v_iᵀ.
///
///     q̇ = Σ_i g_i v_i + (I − Σ_i p_i v_i v_iᵀ) q̇_posture
///
/// A rule needs a name, relative_threshold() and at(σ_i, the spectrum) (concept Rule). Any such struct, also one of an
/// application, runs through VelocitySolver and Servo: see CustomRule, and cpp/examples/08_own_rule.cpp.

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>

#include <sigmaik/error.hpp>
#include <sigmaik/parameters.hpp>
#include <sigmaik/spectrum.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik {

/// A relative σ below this value is zero but for rounding, for rules that must not divide by zero and have no
/// threshold.
inline constexpr double kRankTolerance = 1e-12;
/// relative_threshold() of rules that have none of their own.
inline constexpr double kDefaultThreshold = 0.1;

/// A rule's answer for one direction: g_i = inverse · u_iᵀẋ.
struct Direction {
  double inverse = 0.0;    ///< g_i / u_iᵀẋ
  double projector = 0.0;  ///< p_i: the part of the posture's motion along v_i that is taken away, in [0, 1]
  bool regular = true;     ///< false: the direction counts as singular in the answer
  /// w in [0, 1], for rules with row_gains(): the command along u_i is u_iᵀ(I + w (K − I))ẋ.
  double gain_weight = 0.0;
  /// How much motion along v_i counts, in the unit of σ. Negative: √(σ_i/inverse), see Resolution::weight.
  double weight = -1.0;
};

/// How fast the joints can go, and how fast they can turn round. A rule whose threshold grows with the command
/// (JParse::adaptive) needs these two numbers; a Servo takes them from the arm's limits.
struct Pace {
  JointVector
      slowness{};  ///< (n,) 1/V_j [s/rad or s/m], 0 where joint j has no velocity limit; empty: there is no pace
  /// [m·s], length scale over ω, the bandwidth [rad/s] that the acceleration limits allow.
  double lag = 0.0;
  /// σ_max > 0 that relative thresholds refer to, where this is more than the largest of the spectrum: for the rows of
  /// a task that have what other rows left.
  double largest = 0.0;
};

/// Data of the whole spectrum, for a rule that needs more than its own σ_i.
class SpectrumSummary {
 public:
  /// The spectrum must have at least one direction and must outlive the summary.
  explicit SpectrumSummary(const Spectrum& spectrum, double reference = 0.0) noexcept
      : largest(std::max(spectrum.sigma(0), reference)),
        smallest(spectrum.sigma(spectrum.size() - 1)),
        spectrum_(&spectrum) {}

  const double largest;   ///< σ_max > 0
  const double smallest;  ///< σ_min ≥ 0
  /// The least σ_i at which the command along the directions near a singularity stays within the Pace. Infinite where
  /// there is no pace, 0 where nothing is asked along these directions.
  double needed = std::numeric_limits<double>::infinity();

  /// Π σ_i / unit over all directions. Computed once.
  double manipulability(double unit) const noexcept {
    if (unit != unit_) {
      unit_ = unit;
      product_ = 1.0;
      for (int i = 0; i < spectrum_->size(); ++i) product_ *= spectrum_->sigma(i) / unit;
    }
    return product_;
  }

 private:
  const Spectrum* spectrum_;
  mutable double unit_ = 0.0, product_ = 0.0;
};

/// The paper's K = diag(linear, angular), of the command's rows.
struct RowGains {
  double linear = 1.0;   ///< factor of the linear rows
  double angular = 1.0;  ///< factor of the angular rows
};

/// A rule. at() and relative_threshold() are called in the loop: noexcept, bounded, without heap.
///
/// - `kName` is the rule's name in texts of errors.
/// - relative_threshold(), in (0, 1]: a direction with σ_i at or below this part of σ_max is near a singularity. Where
///   limits act, a Servo weights the directions with this threshold.
/// - at(σ_i ≥ 0, the spectrum) says what to do with a direction.
///
/// Set-up checks the ranges of parameters() and calls check(), where a rule has these members.
template <typename R>
concept Rule = requires(const R rule, double sigma, const SpectrumSummary& spectrum) {
  { R::kName } -> std::convertible_to<const char*>;
  { rule.relative_threshold() } noexcept -> std::same_as<double>;
  { rule.at(sigma, spectrum) } noexcept -> std::same_as<Direction>;
} && std::copyable<R>;  // last: for a type that takes a Method, the concept would depend on itself

/// Checks the parameters of a rule.
/// \throws Error with the parameter, its value and its range
template <Rule R>
void check_rule(const R& rule) {
  if constexpr (requires { R::parameters(); }) check_parameters(rule);
  if constexpr (requires { rule.check(); }) rule.check();
  check_range(R::kName, "relative_threshold()", rule.relative_threshold(), {0.0, 1.0, true});
}

/// A rule that amplifies the command's rows along singular directions, see Direction::gain_weight.
template <typename R>
concept AmplifyingRule = Rule<R> && requires(const R rule) {
  { rule.row_gains() } noexcept -> std::same_as<RowGains>;
};

/// A rule that bounds the joint speeds from one direction, and from all directions together.
template <typename R>
concept ClampingRule = Rule<R> && requires(const R rule, const Spectrum& spectrum, int i) {
  { rule.speed_bound(spectrum, i) } noexcept -> std::same_as<double>;
  { rule.speed_bound() } noexcept -> std::same_as<double>;
};

/// A rule's answer to a command.
struct Resolution {
  std::array<double, kMaxTask> speed{};      ///< g_i: q̇ = Σ g_i v_i; 0 beyond size()
  std::array<double, kMaxTask> projector{};  ///< p_i of the posture; 0 beyond size()
  /// w_i > 0, in the unit of σ: along v_i, without a posture, the rule's answer minimises ½(w_i v_iᵀq̇)² − ẋᵀJ q̇. A
  /// regular direction has σ_i. 0 beyond size().
  std::array<double, kMaxTask> weight{};
  std::uint8_t singular = 0;  ///< bit i: the rule does not treat direction u_i as regular
  bool exact = true;          ///< every direction that the command uses is done in full
};

namespace detail {

// Part of the command that a direction may lose before the answer counts as damped.
inline constexpr double kExact = 1e-9;
// A Jacobian this small moves nothing; its inverse would only overflow.
inline constexpr double kVanishing = 1e-100;

// σ/(σ²+λ²) and σ²/(σ²+λ²) without squares that overflow or vanish.
inline Direction damped(double sigma, double lambda, bool regular) noexcept {
  if (sigma <= 0.0) return {0.0, 0.0, regular};
  if (lambda <= sigma) {
    const double ratio = lambda / sigma, part = 1.0 / (1.0 + ratio * ratio);
    return {part / sigma, part, regular};
  }
  const double ratio = sigma / lambda, part = 1.0 / (1.0 + ratio * ratio);
  return {ratio * part / lambda, ratio * ratio * part, regular};
}

// 1/σ_i, or 0 if the direction is dropped.
inline Direction truncated(double sigma, bool keep, double projector_if_dropped) noexcept {
  if (keep) return {1.0 / sigma, 1.0, true};
  return {0.0, projector_if_dropped, false};
}

}  // namespace detail

namespace detail {

// SpectrumSummary::needed: with c the length of the command along the directions whose σ_i is below `threshold`, the σ
// at which c/σ keeps each joint within its velocity limit, and at which the answer does not change faster than ω: σ_i
// falls by about L for each radian along v_i, so the loop that closes through σ_i has a gain of (c/σ²) L. One number
// for all directions, so that the answer does not depend on the choice of u_i and v_i where two σ_i are the same. A
// direction counts in full from 3/4 of `threshold` downwards, and not at all from `threshold` upwards. Where σ_i
// vanishes, and u_i and v_i are any vectors of the null spaces, the command along all such u_i and the largest motion
// that such a v_i can give a joint count.
double needed(const Spectrum& spectrum, const std::array<double, kMaxTask>& parts, double threshold,
              const Pace& pace) noexcept;

}  // namespace detail

/// Applies one rule that is known at compile time. Real time.
/// \param command (m,) in the rows of the spectrum
/// \param angular bit i: row i of the command is angular
/// \param pace for rules whose threshold grows with the command
template <Rule R>
Resolution resolve_by(const R& rule, const Spectrum& spectrum, const TaskVector& command, std::uint8_t angular,
                      const Pace& pace = {}) noexcept {
  const int m = spectrum.rows(), size = spectrum.size();
  Resolution out;
  const double enough = detail::kExact * command.cwiseAbs().maxCoeff();  // the squares in a norm overflow or vanish
  SpectrumSummary summary(spectrum, pace.largest);
  const std::array<double, kMaxTask> parts = spectrum.along_u(command);

  // If m > n, no joint can move the tip along the u_i beyond the n-th.
  for (int i = size; i < m; ++i) {
    out.singular |= static_cast<std::uint8_t>(1u << i);
    if (std::abs(parts[static_cast<std::size_t>(i)]) > enough) out.exact = false;
  }
  if (summary.largest < detail::kVanishing) {
    out.singular = static_cast<std::uint8_t>((1u << m) - 1u);
    out.exact = command.isZero(0.0);
    return out;
  }

  std::array<double, kMaxTask> amplified = parts;  // u_iᵀKẋ
  if constexpr (AmplifyingRule<R>) {
    const RowGains gains = rule.row_gains();
    if (gains.linear != 1.0 || gains.angular != 1.0) {
      TaskVector product = command;
      for (int row = 0; row < m; ++row) product[row] *= (angular >> row & 1u) != 0 ? gains.angular : gains.linear;
      amplified = spectrum.along_u(product);
    }
  }
  const double lightest = rule.relative_threshold() * summary.largest;
  if (pace.slowness.size() != 0) summary.needed = detail::needed(spectrum, parts, lightest, pace);
  for (int i = 0; i < size; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double sigma = spectrum.sigma(i);
    const double part = parts[at];
    const Direction direction = rule.at(sigma, summary);
    double speed = direction.inverse * (part + direction.gain_weight * (amplified[at] - part));
    bool regular = direction.regular;
    if constexpr (ClampingRule<R>) {
      if (regular) {
        const double fastest = std::abs(speed) * spectrum.v(i).cwiseAbs().maxCoeff();
        const double bound = rule.speed_bound(spectrum, i);
        if (fastest > bound) {
          speed *= bound / fastest;
          regular = false;
        }
      }
    }
    out.speed[at] = speed;
    out.projector[at] = direction.projector;
    out.weight[at] = direction.weight >= 0.0   ? direction.weight
                     : direction.inverse > 0.0 ? std::sqrt(sigma / direction.inverse)
                                               : std::max(sigma, lightest);
    if (!regular) out.singular |= static_cast<std::uint8_t>(1u << i);
    if (std::abs(sigma * speed - part) > enough) out.exact = false;
  }
  if constexpr (ClampingRule<R>) {
    const double fastest = spectrum.combine_v(out.speed).cwiseAbs().maxCoeff();
    if (fastest > rule.speed_bound()) {
      for (double& speed : out.speed) speed *= rule.speed_bound() / fastest;
      out.exact = false;
    }
  }
  return out;
}

}  // namespace sigmaik
