// The way out of a singularity that the second order shows; servo.hpp has the derivation.

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <variant>

#include <sigmaik/servo.hpp>

#include "angular_rows.hpp"
#include "symmetric_eigen.hpp"

namespace sigmaik {
namespace {

constexpr double kGain = 0.02;   // of σ_max, in m/rad²: up to here λ counts as none, and from twice this on in full
constexpr double kNear = 0.1;    // of the rule's threshold: from here down to zero a direction becomes lost
constexpr double kAsked = 1e-9;  // of the command: less along the lost directions is rounding
constexpr double kFirst = 1e-6;  // of |c| σ_max: where the first order is less, the sign of the last cycle stays
constexpr int kSteps = 8;        // of the power iteration in a cycle

// How much the rule leaves out along each direction, and what the command asks there.
struct Lost {
  std::array<double, kMaxTask> part{};  // w_i, from 0 at a tenth of the rule's threshold to 1 where σ_i vanishes
  std::array<double, kMaxTask> asked{};
  TaskVector wanted;       // c, in the rows of the spectrum
  double threshold = 0.0;  // ε, the rule's

  Lost(const Spectrum& spectrum, const Resolution& resolution, const TaskVector& command) noexcept
      : asked(spectrum.along_u(command)), wanted(TaskVector::Zero(command.size())) {
    for (int i = 0; i < spectrum.size(); ++i) {
      const auto at = static_cast<std::size_t>(i);
      if ((resolution.singular >> i & 1u) == 0 || !(resolution.weight[at] > 0.0)) continue;
      const double share = spectrum.sigma(i) / (kNear * resolution.weight[at]);
      part[at] = std::max(0.0, 1.0 - share * share);
      asked[at] *= part[at];
      wanted += asked[at] * spectrum.u(i);
      threshold = std::max(threshold, resolution.weight[at]);
    }
  }

  // P y: across the directions that the rule does.
  JointVector project(const Spectrum& spectrum, JointVector y) const noexcept {
    for (int i = 0; i < spectrum.size(); ++i) {
      const double away = 1.0 - std::sqrt(part[static_cast<std::size_t>(i)]);
      if (away > 0.0) y -= away * spectrum.v(i).dot(y) * spectrum.v(i);
    }
    return y;
  }

  // cᵀJ `way`: how fast the tool goes where it is asked to go, to first order.
  double first_order(const Spectrum& spectrum, const JointVector& way) const noexcept {
    double sum = 0.0;
    for (int i = 0; i < spectrum.size(); ++i) {
      sum += asked[static_cast<std::size_t>(i)] * spectrum.sigma(i) * spectrum.v(i).dot(way);
    }
    return sum;
  }
};

// [rad] the way along `way` to the first position limit.
double room(const JointLimits& limits, const JointVector& q, const JointVector& way) noexcept {
  double least = std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    const double left = way[i] > 0.0 ? limits.upper[i] - q[i] : q[i] - limits.lower[i];
    if (way[i] != 0.0) least = std::min(least, left / std::abs(way[i]));
  }
  return least;
}

}  // namespace

// Whether the second order may open the rule's singular directions.
bool Servo::escapes() const noexcept {
  const auto* rule = std::get_if<JParse>(&solver_.method());
  return escapes_ && rule != nullptr && rule->adaptive && !has_exact() && solver_.lightness().size() == 0;
}

// Adds the way out to q̇. Returns whether there is one. In a cycle without one, the way of the last cycle is forgotten.
bool Servo::escape(const Twist& twist, JointVector& qdot) noexcept {
  const JointVector before = std::exchange(escape_, JointVector());
  if (solver_.resolution().singular == 0 || !escapes()) return false;

  const Spectrum& spectrum = solver_.spectrum();
  const Eigen::Matrix3d& rotation = state_.tip.linear();
  TaskVector command = select_rows(options_.task, rotation, twist);
  detail::weigh(options_.task, solver_.length_scale(), command);
  const Lost lost(spectrum, solver_.resolution(), command);
  const double asked = lost.wanted.norm();
  if (!(asked > kAsked * command.norm())) return false;

  Twist along = expand_rows(options_.task, rotation, TaskVector(lost.wanted / asked));
  along.tail<3>() *= solver_.length_scale();
  const JointMatrix curvature = second_order(along);
  const auto times = [&](const JointVector& y) {
    return lost.project(spectrum, curvature.lazyProduct(lost.project(spectrum, y)));
  };

  const int n = chain_.dof();
  const bool goes_on = before.size() != 0;
  JointVector y = before;
  if (!goes_on) {
    JointMatrix projected(n, n);
    for (int k = 0; k < n; ++k) projected.col(k) = times(JointVector::Unit(n, k));
    y = detail::symmetric_eigen(projected).vectors.col(n - 1);
  }
  // P H P + |H| 1 has no negative eigenvalue.
  const double shift = curvature.norm();
  for (int k = 0; goes_on && k < kSteps; ++k) y = (times(y) + shift * y).normalized();
  const double eigenvalue = y.dot(times(y));
  const double share = std::clamp(eigenvalue / (kGain * spectrum.sigma(0)) - 1.0, 0.0, 1.0);
  if (!(share > 0.0)) return false;

  JointVector way = lost.project(spectrum, y);
  const double first = lost.first_order(spectrum, way);
  bool turn = first < 0.0;
  if (std::abs(first) <= kFirst * asked * spectrum.sigma(0)) {
    const JointLimits& limits = chain_.limits();
    turn = !goes_on && room(limits, tracker_.q(), -way) > room(limits, tracker_.q(), way);
  }
  escape_ = turn ? JointVector(-y) : y;
  if (turn) way = -way;
  way *= share * (asked / lost.threshold);
  // No joint's velocity limit slows down what the rule does.
  double part = 1.0;
  for (int i = 0; i < n; ++i) {
    const double left = tracker_.velocity_limit(i) - (way[i] > 0.0 ? qdot[i] : -qdot[i]);
    if (std::abs(way[i]) * part > left) part = std::max(0.0, left / std::abs(way[i]));
  }
  qdot += part * way;
  return true;
}

// (n, n) H: the tool's way along `along` is ½ δᵀH δ for a motion δ of the joints that gives none to first order.
JointMatrix Servo::second_order(const Twist& along) const noexcept {
  JacobianGradient gradient;
  jacobian_gradient(chain_, tracker_.q(), state_.jacobian, gradient);
  const int n = chain_.dof();
  JointMatrix h(n, n);
  for (int k = 0; k < n; ++k) {
    for (int j = 0; j < n; ++j) h(k, j) = along.dot(gradient[static_cast<std::size_t>(k)].col(j));
  }
  return 0.5 * (h + JointMatrix(h.transpose()));
}

}  // namespace sigmaik
