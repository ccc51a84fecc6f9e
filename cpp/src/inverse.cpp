#include <sigmaik/inverse.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "message.hpp"

namespace sigmaik {
namespace {

using detail::require;

// A relative σ that is zero but for rounding: for rules that must not divide by it and have no threshold of their own.
constexpr double kRankTolerance = 1e-12;
// Part of the command that a direction may lose before the answer counts as damped.
constexpr double kExact = 1e-9;
// A Jacobian this small moves nothing; its inverse would only overflow.
constexpr double kVanishing = 1e-100;

// What a rule sees of the whole spectrum.
struct Scene {
  double largest;         // σ_max
  double smallest;        // σ_min
  double manipulability;  // Π σ_i / σ_max^size, or Π σ_i where the rule wants absolute values
};

// What a rule says of one direction: q̇ gets (inverse · command along u_i) v_i.
struct Direction {
  double inverse;
  double projector;
  bool regular;
  double gain_weight = 0.0;  // how much of JParse's K applies: I + w (K − I)
};

// σ/(σ²+λ²) and σ²/(σ²+λ²) without squares that overflow or vanish.
Direction damped(double sigma, double lambda, bool regular) noexcept {
  if (sigma <= 0.0) return {0.0, 0.0, regular};
  if (lambda <= sigma) {
    const double ratio = lambda / sigma, part = 1.0 / (1.0 + ratio * ratio);
    return {part / sigma, part, regular};
  }
  const double ratio = sigma / lambda, part = 1.0 / (1.0 + ratio * ratio);
  return {ratio * part / lambda, ratio * ratio * part, regular};
}

Direction truncated(double sigma, bool keep, double projector_if_dropped) noexcept {
  if (keep) return {1.0 / sigma, 1.0, true};
  return {0.0, projector_if_dropped, false};
}

struct At {
  double sigma;
  const Scene& scene;

  Direction operator()(const PseudoInverse& rule) const noexcept {
    return truncated(sigma, sigma > rule.tolerance * scene.largest, 0.0);
  }
  Direction operator()(const DampedLeastSquares& rule) const noexcept {
    return damped(sigma, rule.damping, sigma > kRankTolerance * scene.largest);
  }
  Direction operator()(const AdaptiveDampedLeastSquares& rule) const noexcept {
    const double unit = rule.relative ? scene.largest : 1.0;
    const double lambda = rule.damping * unit;
    double near = 0.0;  // how near a singularity: 0 at the threshold, 1 there; λ²'s share
    if (rule.rule == DampingRule::Manipulability) {
      const double threshold = rule.threshold > 0.0 ? rule.threshold : 1e-3;
      const double distance = 1.0 - std::min(1.0, scene.manipulability / threshold);
      near = distance * distance;
    } else {
      const double threshold = (rule.threshold > 0.0 ? rule.threshold : 0.1) * unit;
      const double watched = rule.rule == DampingRule::NumericalFiltering ? sigma : scene.smallest;
      const double ratio = std::min(1.0, watched / threshold);
      near = 1.0 - ratio * ratio;
    }
    return damped(sigma, lambda * std::sqrt(near), near == 0.0);
  }
  Direction operator()(const SelectivelyDampedLeastSquares&) const noexcept {
    return truncated(sigma, sigma > kRankTolerance * scene.largest, 0.0);
  }
  Direction operator()(const JParse& rule) const noexcept {
    const double threshold = rule.gamma * scene.largest;
    if (sigma > threshold) return {1.0 / sigma, 1.0, true};
    const double share = sigma / threshold;
    return {share / threshold, rule.singular_posture ? share * share : 1.0, false, rule.continuous ? 1.0 - share : 1.0};
  }
  Direction operator()(const JacobianProjection& rule) const noexcept {
    return truncated(sigma, sigma > rule.gamma * scene.largest, 0.0);
  }
  Direction operator()(const JacobianSafety& rule) const noexcept {
    const double threshold = rule.gamma * scene.largest;
    return {1.0 / std::max(sigma, threshold), 1.0, sigma > threshold};
  }
  Direction operator()(const JacobianSafetyProjection& rule) const noexcept {
    return truncated(sigma, sigma > rule.gamma * scene.largest, 1.0);
  }
};

Scene survey(const Method& method, const Spectrum& spectrum) noexcept {
  const int size = spectrum.size();
  Scene scene{spectrum.sigma(0), spectrum.sigma(size - 1), 1.0};
  if (const auto* rule = std::get_if<AdaptiveDampedLeastSquares>(&method)) {
    const double unit = rule->relative ? scene.largest : 1.0;
    for (int i = 0; i < size; ++i) scene.manipulability *= spectrum.sigma(i) / unit;
  }
  return scene;
}

// Buss and Kim's bound on the joint speeds from direction i: max_speed · min(1, N_i/M_i), with N_i = |u_i| = 1 what
// the direction moves the tip, M_i = Σ_j |v_ji| |J_j| / σ_i what the joints move it on their own.
double selective_bound(const Spectrum& spectrum, int i, double max_speed) noexcept {
  double moved = 0.0;
  for (int j = 0; j < spectrum.cols(); ++j) {
    double column = 0.0;  // |J_j|², from the decomposition
    for (int l = 0; l < spectrum.size(); ++l) {
      const double part = spectrum.sigma(l) / spectrum.sigma(0) * spectrum.v(l)[j];
      column += part * part;
    }
    moved += std::abs(spectrum.v(i)[j]) * std::sqrt(column);
  }
  return max_speed * std::min(1.0, spectrum.sigma(i) / spectrum.sigma(0) / moved);
}

// Throws unless low < value ≤ high (low ≤ value where `closed`).
void check(const char* what, double value, double low, double high, bool closed = false) {
  require((closed ? value >= low : value > low) && value <= high && std::isfinite(value), what, " = ", value,
          " must be finite and ", closed ? "at least " : "above ", low,
          std::isinf(high) ? std::string() : detail::message(" and at most ", high));
}

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Validate {
  void operator()(const PseudoInverse& r) const { check("PseudoInverse: tolerance", r.tolerance, 0.0, 1.0); }
  void operator()(const DampedLeastSquares& r) const {
    check("DampedLeastSquares: damping (use PseudoInverse for none)", r.damping, 0.0, kInfinity);
  }
  void operator()(const AdaptiveDampedLeastSquares& r) const {
    check("AdaptiveDampedLeastSquares: damping", r.damping, 0.0, kInfinity);
    check("AdaptiveDampedLeastSquares: threshold", r.threshold, 0.0, kInfinity, true);
  }
  void operator()(const SelectivelyDampedLeastSquares& r) const {
    check("SelectivelyDampedLeastSquares: max_speed", r.max_speed, 0.0, kInfinity);
  }
  void operator()(const JParse& r) const {
    check("JParse: gamma", r.gamma, 0.0, 1.0);
    check("JParse: gain_linear", r.gain_linear, 0.0, kInfinity, true);
    check("JParse: gain_angular", r.gain_angular, 0.0, kInfinity, true);
  }
  void operator()(const JacobianProjection& r) const { check("JacobianProjection: gamma", r.gamma, 0.0, 1.0); }
  void operator()(const JacobianSafety& r) const { check("JacobianSafety: gamma", r.gamma, 0.0, 1.0); }
  void operator()(const JacobianSafetyProjection& r) const {
    check("JacobianSafetyProjection: gamma", r.gamma, 0.0, 1.0);
  }
};

struct Name {
  const char* operator()(const PseudoInverse&) const noexcept { return "PseudoInverse"; }
  const char* operator()(const DampedLeastSquares&) const noexcept { return "DampedLeastSquares"; }
  const char* operator()(const AdaptiveDampedLeastSquares&) const noexcept { return "AdaptiveDampedLeastSquares"; }
  const char* operator()(const SelectivelyDampedLeastSquares&) const noexcept {
    return "SelectivelyDampedLeastSquares";
  }
  const char* operator()(const JParse&) const noexcept { return "JParse"; }
  const char* operator()(const JacobianProjection&) const noexcept { return "JacobianProjection"; }
  const char* operator()(const JacobianSafety&) const noexcept { return "JacobianSafety"; }
  const char* operator()(const JacobianSafetyProjection&) const noexcept { return "JacobianSafetyProjection"; }
};

}  // namespace

const char* name(const Method& method) noexcept { return std::visit(Name{}, method); }

void validate(const Method& method) { std::visit(Validate{}, method); }

Resolution resolve(const Method& method, const Spectrum& spectrum, const TaskVector& command,
                   std::uint8_t angular) noexcept {
  const int m = spectrum.rows(), size = spectrum.size();
  Resolution out;
  const double enough = kExact * command.cwiseAbs().maxCoeff();  // a norm's squares overflow and vanish
  const Scene scene = survey(method, spectrum);
  const std::array<double, kMaxTask> parts = spectrum.along_u(command);

  // Rows that no joint can move at all, of an m×n matrix with m > n.
  for (int i = size; i < m; ++i) {
    out.singular |= static_cast<std::uint8_t>(1u << i);
    if (std::abs(parts[static_cast<std::size_t>(i)]) > enough) out.exact = false;
  }
  if (scene.largest < kVanishing) {
    out.singular = static_cast<std::uint8_t>((1u << m) - 1u);
    out.exact = command.isZero(0.0);
    return out;
  }

  std::visit(
      [&](const auto& rule) {
        using Rule = std::decay_t<decltype(rule)>;
        constexpr bool kSelective = std::is_same_v<Rule, SelectivelyDampedLeastSquares>;
        std::array<double, kMaxTask> amplified = parts;  // uᵢᵀKẋ
        if constexpr (std::is_same_v<Rule, JParse>) {
          if (rule.gain_linear != 1.0 || rule.gain_angular != 1.0) {
            TaskVector product = command;
            for (int row = 0; row < m; ++row) {
              product[row] *= (angular >> row & 1u) != 0 ? rule.gain_angular : rule.gain_linear;
            }
            amplified = spectrum.along_u(product);
          }
        }
        for (int i = 0; i < size; ++i) {
          const double sigma = spectrum.sigma(i);
          const Direction direction = At{sigma, scene}(rule);
          const double part = parts[static_cast<std::size_t>(i)];
          const double asked = part + direction.gain_weight * (amplified[static_cast<std::size_t>(i)] - part);
          double speed = direction.inverse * asked;
          bool regular = direction.regular;
          if constexpr (kSelective) {
            if (regular) {
              const double largest = std::abs(speed) * spectrum.v(i).cwiseAbs().maxCoeff();
              const double bound = selective_bound(spectrum, i, rule.max_speed);
              if (largest > bound) {
                speed *= bound / largest;
                regular = false;
              }
            }
          }
          out.speed[static_cast<std::size_t>(i)] = speed;
          out.projector[static_cast<std::size_t>(i)] = direction.projector;
          if (!regular) out.singular |= static_cast<std::uint8_t>(1u << i);
          if (std::abs(sigma * speed - part) > enough) out.exact = false;
        }
        if constexpr (kSelective) {
          const double largest = spectrum.combine_v(out.speed).cwiseAbs().maxCoeff();
          if (largest > rule.max_speed) {
            for (double& speed : out.speed) speed *= rule.max_speed / largest;
            out.exact = false;
          }
        }
      },
      method);
  return out;
}

}  // namespace sigmaik
