#include <sigmaik/servo.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include <sigmaik/pose.hpp>

#include "length.hpp"
#include "message.hpp"

namespace sigmaik {
namespace {

using detail::require;

void check(const char* what, double value, bool zero_allowed, const char* unit) {
  require(value > 0.0 || (zero_allowed && value == 0.0), what, " = ", value, " ", unit, " must be ",
          zero_allowed ? "at least" : "above", " 0");
}

void check_finite(const char* what, double value, bool zero_allowed, const char* unit) {
  check(what, value, zero_allowed, unit);
  require(std::isfinite(value), what, " must be finite");
}

void check_joints(const char* what, const JointRef& values, const Chain& chain) {
  require(values.size() == chain.dof(), what, " has ", values.size(), " entries, the chain ", chain.dof(), " joints");
  for (int i = 0; i < chain.dof(); ++i) {
    require(std::isfinite(values[i]), what, " of joint '", chain.joint_names()[static_cast<std::size_t>(i)],
            "' is not finite");
  }
}

void shorten(Eigen::Ref<Eigen::Vector3d> vector, double longest) noexcept {
  const double length = detail::length(vector);
  if (length > longest) vector *= longest / length;
}

// Below this part of σ_max the rule treats a direction as singular.
double threshold(const Method& method) noexcept {
  return std::visit(
      [](const auto& rule) {
        if constexpr (requires { rule.gamma; }) return rule.gamma;
        return 0.1;
      },
      method);
}

// What redistribution weighs joint motion with, against twist: of σ_max. Small, so that what joints can do is done to
// eight digits; not zero, so that the answer stays unique where some are held.
constexpr double kJointWeight = 1e-4;
// What rows that come first weigh, against the others.
constexpr double kExactWeight = 1e3;

// A twist that misses this part of itself is done.
constexpr double kDone = 1e-6;

// How much direction i counts in redistribution: σ_i where it is regular, nothing where it is singular, and in between
// by equal factors for equal steps of σ, as the answer follows the ratio of weights.
double weight(double sigma, double largest, double threshold) noexcept {
  const double floor = kJointWeight * largest;
  const double t = std::clamp(2.0 * sigma / (threshold * largest) - 1.0, 0.0, 1.0);
  if (!(t > 0.0) || sigma <= floor) return 0.0;
  const double whole = floor * std::pow(sigma / floor, t);
  return std::sqrt(std::max(0.0, whole * whole - floor * floor));
}

LimitOptions limit_options(const ServoOptions& options) {
  LimitOptions out;
  out.dt = options.dt;
  out.position = options.position_limits;
  out.velocity = options.velocity_limits;
  out.acceleration = options.acceleration_limits;
  out.jerk = options.jerk_limits;
  out.recovery_speed = options.recovery_speed;
  return out;
}

}  // namespace

Servo::Servo(Chain chain, const Method& method, const ServoOptions& options)
    : chain_(std::move(chain)),
      options_(options),
      exact_{options.exact, options.task.frame},
      solver_(method, options.length_scale, options.task),
      tracker_(chain_.limits(), limit_options(options)) {
  check_finite("gain_linear", options.gain_linear, true, "1/s");
  check_finite("gain_angular", options.gain_angular, true, "1/s");
  check("max_linear_error", options.max_linear_error, false, "m");
  check("max_angular_error", options.max_angular_error, false, "rad");
  check_finite("soft_start", options.soft_start, true, "s");
  check_finite("posture_gain", options.posture_gain, true, "1/s");
  check("posture_max_speed", options.posture_max_speed, false, "rad/s");
  if (options.posture.size() != 0) check_joints("posture", options.posture, chain_);
  for (std::size_t i = 0; i < 6; ++i) {
    require(!options.exact[i] || options.task.mask[i], "exact asks for row ", i, ", which the task's mask leaves out");
  }
}

void Servo::reset(const JointRef& q, const JointRef& qdot) {
  check_joints("q", q, chain_);
  if (qdot.size() != 0) check_joints("qdot", qdot, chain_);
  tracker_.reset(q, qdot);
  qdot_start_ = qdot.size() != 0 ? JointVector(qdot) : JointVector(JointVector::Zero(chain_.dof()));
  nominal_ = options_.posture.size() != 0 ? options_.posture : JointVector(q);
  for (int i = 0; i < chain_.dof(); ++i) {
    if (chain_.joint_types()[static_cast<std::size_t>(i)] != JointType::Continuous) continue;
    constexpr double kTurn = 6.283185307179586;
    nominal_[i] += kTurn * std::round((q[i] - nominal_[i]) / kTurn);
  }
  solver_.reset();
  least_squares_.reset();
  exact_spectrum_ = Spectrum{};
  sigmaik::update(chain_, tracker_.q(), state_);
  fade_ = 0.0;
}

void Servo::set_method(const Method& method) { solver_.set_method(method); }

JointVector Servo::posture_velocity() const noexcept {
  if (options_.posture_gain == 0.0) return {};
  const double cap = options_.posture_max_speed;
  return (options_.posture_gain * (nominal_ - tracker_.q())).cwiseMax(-cap).cwiseMin(cap);
}

ServoStep Servo::stop(Status status) noexcept {
  ServoStep step;
  step.status = status;
  step.qdot = tracker_.stop();
  step.scale = 0.0;
  take(step);
  return step;
}

ServoStep Servo::update(const Pose& target) noexcept {
  if (!is_pose(target.matrix())) return stop(Status::BadInput);
  const Twist error = pose_error(state_.tip, target);
  Twist twist = error;
  shorten(twist.head<3>(), options_.max_linear_error);
  shorten(twist.tail<3>(), options_.max_angular_error);
  twist.head<3>() *= options_.gain_linear;
  twist.tail<3>() *= options_.gain_angular;
  ServoStep step = resolve(twist, true);
  step.pose_error = error;
  return step;
}

ServoStep Servo::update_twist(const Twist& twist) noexcept {
  if (!twist.allFinite()) return stop(Status::BadInput);
  return resolve(twist, qdot_start_.size() != 0 && !qdot_start_.isZero(0.0));
}

ServoStep Servo::resolve(const Twist& twist, bool fade) noexcept {
  if (tracker_.q().size() == 0) return stop(Status::BadInput);
  const Solution solution = solver_.solve(state_.jacobian, twist, posture_velocity(), state_.tip.linear());
  if (solution.status == Status::BadInput) return stop(Status::BadInput);

  ServoStep step;
  step.status = solution.status;
  step.singular_values = solution.singular_values;
  step.singular = solution.singular;
  step.task_rows = static_cast<int>(solution.directions.cols());
  step.qdot = solution.qdot;

  if (fade_ < 1.0) {
    fade_ = options_.soft_start > 0.0 ? std::min(1.0, fade_ + options_.dt / options_.soft_start) : 1.0;
    if (fade && fade_ < 1.0) step.qdot = fade_ * step.qdot + (1.0 - fade_) * qdot_start_;
  }

  const VelocityBounds& bounds = tracker_.bounds();
  if ((step.qdot.array() > bounds.upper.array()).any() || (step.qdot.array() < bounds.lower.array()).any()) {
    if (options_.on_limit == OnLimit::Scale) {
      scale(step);
    } else {
      redistribute(step);
    }
  }
  if (!(tracker_.q() + options_.dt * step.qdot).allFinite()) return stop(Status::BadInput);  // too far for numbers
  take(step);
  return step;
}

// Sends the command: from here on it is history.
void Servo::take(ServoStep& step) noexcept {
  if (tracker_.q().size() == 0) {
    step.q = step.qdot = JointVector::Zero(chain_.dof());
    return;
  }
  tracker_.advance(step.qdot);
  step.q = tracker_.q();
  Twist achieved = Twist::Zero();
  for (int i = 0; i < chain_.dof(); ++i) achieved += step.qdot[i] * state_.jacobian.col(i);
  step.achieved_twist = achieved;
  sigmaik::update(chain_, step.q, state_);
}

void Servo::redistribute(ServoStep& step) noexcept {
  // x = q̇ − q̇_rule, and slack s that stands for the twist: min |x|² + |s|², M x + λ s = 0, which is
  // min |M x|² + λ² |x|² in one level, without squaring M.
  const int n = chain_.dof();
  const Spectrum& spectrum = solver_.spectrum();
  const int m = spectrum.size();
  const double largest = spectrum.sigma(0), limit = threshold(solver_.method());
  const bool ranked = options_.exact != std::array<bool, 6>{};
  const int rows = ranked ? spectrum.rows() : m;

  auto& C = problem_.C;
  C.setZero(rows, n + rows);
  problem_.d.setZero(rows);
  if (!ranked) {
    for (int i = 0; i < m; ++i) C.row(i).head(n) = weight(spectrum.sigma(i), largest, limit) * spectrum.v(i).transpose();
  } else {
    for (int i = 0; i < m; ++i) {
      const double w = weight(spectrum.sigma(i), largest, limit);
      for (int k = 0; k < rows; ++k) C.row(k).head(n) += w * spectrum.u(i)[k] * spectrum.v(i).transpose();
    }
    // The rows that come first have singularities of their own.
    TaskJacobian first = select_rows(exact_, state_.tip.linear(), state_.jacobian);
    int at = 0;
    for (std::size_t i = 0; i < 6; ++i) {
      if (!options_.exact[i]) continue;
      if (i >= 3) first.row(at) *= options_.length_scale;
      ++at;
    }
    exact_spectrum_.decompose(first);
    first.setZero();
    for (int i = 0; i < exact_spectrum_.size(); ++i) {
      const double w = weight(exact_spectrum_.sigma(i), exact_spectrum_.sigma(0), limit);
      first += w * exact_spectrum_.u(i) * exact_spectrum_.v(i).transpose();
    }
    int row = 0;
    at = 0;
    for (std::size_t i = 0; i < 6; ++i) {
      if (options_.exact[i]) C.row(row).head(n) = kExactWeight * first.row(at++);
      if (options_.task.mask[i]) ++row;
    }
  }
  for (int k = 0; k < rows; ++k) C(k, n + k) = kJointWeight * largest;

  const VelocityBounds& bounds = tracker_.bounds();
  problem_.lower.setConstant(n + rows, -std::numeric_limits<double>::infinity());
  problem_.upper.setConstant(n + rows, std::numeric_limits<double>::infinity());
  problem_.lower.head(n) = bounds.lower - step.qdot;
  problem_.upper.head(n) = bounds.upper - step.qdot;
  const LeastSquaresSolution solution = least_squares_.solve(problem_);
  if (solution.status == LeastSquaresStatus::BadInput) {
    scale(step);  // numbers too far apart
    return;
  }
  const JointVector asked = step.qdot;
  step.qdot += solution.x.head(n);
  const std::uint32_t held = solution.at_lower | solution.at_upper;
  for (int i = 0; i < n; ++i) {
    const bool free = bounds.lower[i] < bounds.upper[i] || asked[i] != bounds.lower[i];
    if ((held >> i & 1u) != 0 && free) step.limiting_joints |= static_cast<std::uint16_t>(1u << i);
  }

  // How much of the rule's twist is left, along itself and in the weights of the rule, and how much is missed at all.
  double along = 0.0, whole = 0.0, missed = 0.0;
  for (int i = 0; i < m; ++i) {
    const double part = spectrum.sigma(i) * spectrum.v(i).dot(asked);
    const double done = spectrum.sigma(i) * spectrum.v(i).dot(step.qdot);
    along += part * done;
    whole += part * part;
    missed += (part - done) * (part - done);
  }
  step.scale = whole > 0.0 ? std::clamp(along / whole, 0.0, 1.0) : 1.0;
  if (missed > kDone * kDone * whole) {
    step.status = Status::Limited;
  } else {
    step.scale = 1.0;  // other joints do it all
  }
}

void Servo::scale(ServoStep& step) const noexcept {
  const VelocityBounds& bounds = tracker_.bounds();
  const JointVector asked = step.qdot;
  const int n = chain_.dof();

  // The largest s in [0, 1] whose s q̇ is inside the bounds.
  double least = 0.0, s = 1.0;
  for (int i = 0; i < n; ++i) {
    if (asked[i] == 0.0) continue;
    const bool up = asked[i] > 0.0;
    s = std::min(s, (up ? bounds.upper : bounds.lower)[i] / asked[i]);
    least = std::max(least, (up ? bounds.lower : bounds.upper)[i] / asked[i]);
  }
  if (s < least) {
    // None is: the largest that is nearest to them. Half the derivative of the squared distance never falls.
    const double size = asked.cwiseAbs().maxCoeff();
    const auto slope = [&](double at) {
      double sum = 0.0;
      for (int i = 0; i < n; ++i) {
        const double v = at * asked[i];
        sum += asked[i] / size * (v - std::clamp(v, bounds.lower[i], bounds.upper[i]));
      }
      return sum;
    };
    s = 1.0;
    if (slope(1.0) > 0.0) {
      s = 0.0;
      for (double part = 0.5; part > 1e-17; part *= 0.5) {
        if (!(slope(s + part) > 0.0)) s += part;
      }
    }
  }
  for (int i = 0; i < n; ++i) {
    const double v = s * asked[i], more = s * (1.0 + 1e-9) * asked[i];
    step.qdot[i] = std::clamp(v, bounds.lower[i], bounds.upper[i]);
    if (v != step.qdot[i] || more > bounds.upper[i] || more < bounds.lower[i]) {
      step.limiting_joints |= static_cast<std::uint16_t>(1u << i);
    }
  }
  step.scale = s;
  step.status = Status::Limited;
}

}  // namespace sigmaik
