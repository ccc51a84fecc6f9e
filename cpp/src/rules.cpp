#include <sigmaik/rules.hpp>

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace sigmaik {

const char* name(const Method& method) noexcept {
  return std::visit(
      []<typename R>(const R& rule) {
        if constexpr (std::is_same_v<R, CustomRule>) {
          return rule.name();
        } else {
          return R::kName;
        }
      },
      method);
}

double relative_threshold(const Method& method) noexcept {
  return std::visit([](const auto& rule) { return rule.relative_threshold(); }, method);
}

void validate(const Method& method) {
  std::visit(
      []<typename R>(const R& rule) {
        if constexpr (std::is_same_v<R, CustomRule>) {
          rule.check();
        } else {
          check_rule(rule);
        }
      },
      method);
}

Resolution resolve(const Method& method, const Spectrum& spectrum, const TaskVector& command, std::uint8_t angular,
                   const Pace& pace) noexcept {
  return std::visit(
      [&]<typename R>(const R& rule) {
        if constexpr (std::is_same_v<R, CustomRule>) {
          return rule.resolve(spectrum, command, angular, pace);
        } else {
          return resolve_by(rule, spectrum, command, angular, pace);
        }
      },
      method);
}

namespace {

// The part of the command, in (0, 1], that the joints can do at once by their velocity limits, as far as the directions
// that are regular at `threshold` decide this: along the others the answer is J-PARSE's.
double part_within_pace(const Spectrum& spectrum, const std::array<double, kMaxTask>& parts, double threshold,
                        const Pace& pace) noexcept {
  std::array<double, kMaxTask> speed{};
  for (int i = 0; i < spectrum.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double regular = std::max(spectrum.sigma(i), threshold);
    speed[at] = parts[at] * (spectrum.sigma(i) / regular) / regular;
  }
  const double fastest = spectrum.combine_v(speed).cwiseAbs().cwiseProduct(pace.slowness).maxCoeff();
  return fastest > 1.0 ? 1.0 / fastest : 1.0;
}

// How far u_i and v_i are undetermined, from 0 to 1: where σ_i vanishes, v_i is any vector of the null space, u_i any
// of the left null space, and rounding alone chooses them.
double vagueness(const Spectrum& spectrum, int i) noexcept {
  constexpr double kKnown = 1e-6, kUnknown = 1e-9;  // of σ_max; rounding turns v_i by about 1e-16/kUnknown
  const double relative = spectrum.sigma(i) / spectrum.sigma(0);
  return std::clamp((kKnown - relative) / (kKnown - kUnknown), 0.0, 1.0);
}

// (n,) the largest square of each entry of a unit vector across the directions that are determined.
JointVector room(const Spectrum& spectrum) noexcept {
  JointVector out = JointVector::Ones(spectrum.cols());
  for (int i = 0; i < spectrum.size(); ++i) out -= (1.0 - vagueness(spectrum, i)) * spectrum.v(i).cwiseAbs2();
  return out.cwiseMax(0.0);
}

}  // namespace

double detail::needed(const Spectrum& spectrum, const std::array<double, kMaxTask>& parts, double threshold,
                      const Pace& pace) noexcept {
  double square = 0.0, vague = 0.0;
  JointVector motion;  // Σ (share v_ij)²
  for (int i = spectrum.size() - 1; i >= 0 && spectrum.sigma(i) < threshold; --i) {
    const double share = std::min(1.0, 4.0 * (1.0 - spectrum.sigma(i) / threshold));
    const double part = share * parts[static_cast<std::size_t>(i)];
    if (motion.size() == 0) motion = JointVector::Zero(spectrum.cols());
    const double unknown = vagueness(spectrum, i);
    square += part * part;
    vague = std::max(vague, share * unknown);
    motion += (1.0 - unknown) * (share * spectrum.v(i)).cwiseAbs2();
  }
  if (vague > 0.0) {
    for (int i = spectrum.size(); i < spectrum.rows(); ++i) {
      const double part = parts[static_cast<std::size_t>(i)];
      square += vague * part * part;
    }
    motion += vague * room(spectrum);
  }
  if (square == 0.0) return 0.0;
  const double size = part_within_pace(spectrum, parts, threshold, pace) * std::sqrt(square);
  const double fastest = std::sqrt(motion.cwiseProduct(pace.slowness.cwiseAbs2()).maxCoeff());
  return std::max(size * fastest, std::sqrt(pace.lag * size));
}

}  // namespace sigmaik
