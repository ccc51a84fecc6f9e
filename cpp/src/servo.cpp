#include <sigmaik/servo.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <sigmaik/pose.hpp>

#include "finite.hpp"
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

// What redistribution weighs joint motion with, against twist: of σ_max. It bounds how fast joints move to make up for
// little, where those that are left come to a singularity of their own: with a hundredth of it the arm swings there.
constexpr double kJointWeight = 1e-2;
// So weighed, a twist of a direction with σ_i misses (λ/σ_i)² of itself. Again from the answer, the square of that.
constexpr int kPasses = 2;
// What rows that come first weigh, against the others.
constexpr double kExactWeight = 1e3;
// A twist that misses this part of itself is done.
constexpr double kDone = 1e-4;

// How much direction i counts in redistribution. With S = Σ s_i u_i v_iᵀ, J-PARSE's q̇ (K = I, no posture) minimises
// ½|S q̇|² − ẋᵀJ q̇ for just these s_i, so what limits leave of it has ẋᵀJ q̇ ≥ ½|S q̇|² wherever they allow rest: it never
// moves the tool away from the target. (Guptasarma et al., eq. 37, with limits.)
double weight(double sigma, double largest, double threshold) noexcept { return std::max(sigma, threshold * largest); }

bool inside(const JointVector& qdot, const VelocityBounds& bounds) noexcept {
  for (Eigen::Index i = 0; i < qdot.size(); ++i) {
    if (!(qdot[i] >= bounds.lower[i] && qdot[i] <= bounds.upper[i])) return false;
  }
  return true;
}

// from + s (to − from) for the largest s in [0, 1] for which it is inside the bounds; where none is, for the largest
// for which it is nearest to them. Sets the bits of the joints that decide it.
JointVector furthest(const JointVector& from, const JointVector& to, const VelocityBounds& bounds,
                     std::uint16_t& limiting) noexcept {
  const auto n = from.size();
  const JointVector way = to - from;
  const auto moves = [&](Eigen::Index i) {
    return std::abs(way[i]) > 1e-12 * std::abs(from[i]);
  };  // more than rounding
  double least = 0.0, s = 1.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (!moves(i)) continue;
    const bool up = way[i] > 0.0;
    s = std::min(s, ((up ? bounds.upper : bounds.lower)[i] - from[i]) / way[i]);
    least = std::max(least, ((up ? bounds.lower : bounds.upper)[i] - from[i]) / way[i]);
  }
  const bool meets = s >= least;
  if (!meets) {
    // Half the derivative of the squared distance never falls.
    const double size = way.cwiseAbs().maxCoeff();
    const auto slope = [&](double at) {
      double sum = 0.0;
      for (Eigen::Index i = 0; i < n; ++i) {
        const double v = from[i] + at * way[i];
        sum += way[i] / size * (v - std::clamp(v, bounds.lower[i], bounds.upper[i]));
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
  JointVector at = from + s * way;
  bool rounded = meets;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double more = at[i] + 1e-9 * way[i];
    const bool beyond = at[i] > bounds.upper[i] || at[i] < bounds.lower[i];
    if (beyond || more > bounds.upper[i] || more < bounds.lower[i]) limiting |= static_cast<std::uint16_t>(1u << i);
    rounded = rounded && (!beyond || moves(i));
  }
  return rounded ? at.cwiseMax(bounds.lower).cwiseMin(bounds.upper) : at;  // not by rounding beyond what it meets
}

}  // namespace

Servo::Servo(Chain chain, const Method& method, const ServoOptions& options)
    : chain_(std::move(chain)),
      options_(options),
      exact_{options.exact, options.task.frame},
      solver_(method, options.length_scale, options.task),
      avoidance_(chain_, options.avoid),
      tracker_(chain_.limits(), options.dt, options.limits) {
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
  begin(q);
}

void Servo::begin(const JointRef& posture) noexcept {
  nominal_ = options_.posture.size() != 0 ? options_.posture : JointVector(posture);
  for (int i = 0; i < chain_.dof(); ++i) {
    if (chain_.joint_types()[static_cast<std::size_t>(i)] != JointType::Continuous) continue;
    constexpr double kTurn = 6.283185307179586;
    nominal_[i] += kTurn * std::round((tracker_.q()[i] - nominal_[i]) / kTurn);
  }
  solver_.reset();
  least_squares_.reset();
  exact_spectrum_ = Spectrum{};
  sigmaik::update(chain_, tracker_.q(), state_);
  fade_ = 0.0;
}

void Servo::continue_from(const Servo& other) {
  tracker_.continue_from(other.tracker_);
  if (other.tracker_.q().size() == 0) return;
  qdot_start_ = other.tracker_.qdot();
  begin(other.nominal_);
}

void Servo::set_method(const Method& method) { solver_.set_method(method); }

JointVector Servo::posture_velocity() const noexcept {
  JointVector velocity;
  if (options_.posture_gain != 0.0) {
    const double cap = options_.posture_max_speed;
    velocity = (options_.posture_gain * (nominal_ - tracker_.q())).cwiseMax(-cap).cwiseMin(cap);
  }
  if (!avoidance_.active()) return velocity;
  const JointVector away = avoidance_.velocity(tracker_.q());
  return velocity.size() == 0 ? away : JointVector(velocity + away);
}

ServoStep Servo::stop(Status status) noexcept {
  ServoStep step;
  step.status = status;
  step.qdot = tracker_.stop();
  step.scale = 0.0;
  take(step, false);
  return step;
}

ServoStep Servo::update(const Pose& target, const Twist& feedforward) noexcept {
  if (!is_pose(target.matrix()) || !detail::finite(feedforward)) return stop(Status::BadInput);
  const Twist error = pose_error(state_.tip, target);
  Twist twist = error;
  detail::shorten(twist.head<3>(), options_.max_linear_error);
  detail::shorten(twist.tail<3>(), options_.max_angular_error);
  twist.head<3>() *= options_.gain_linear;
  twist.tail<3>() *= options_.gain_angular;
  twist += feedforward;
  ServoStep step = resolve(twist, true);
  step.pose_error = error;
  return step;
}

ServoStep Servo::update_twist(const Twist& twist) noexcept {
  if (!detail::finite(twist)) return stop(Status::BadInput);
  return resolve(twist, qdot_start_.size() != 0 && !qdot_start_.isZero(0.0));
}

ServoStep Servo::resolve(const Twist& twist, bool fade) noexcept {
  if (tracker_.q().size() == 0) return stop(Status::BadInput);
  const Solution solution = solver_.solve(state_.jacobian, twist, posture_velocity(), state_.tip.linear());
  if (solution.status == Status::BadInput) return stop(Status::BadInput);

  ServoStep step;
  step.asked_twist = twist;
  step.status = solution.status;
  step.singular_values = solution.singular_values;
  step.singular = solution.singular;
  step.task_rows = static_cast<int>(solution.directions.cols());
  step.qdot = solution.qdot;
  step.achieved_twist = solution.achieved_twist;

  bool rule = true;  // the rule's answer stands
  if (fade_ < 1.0) {
    fade_ = options_.soft_start > 0.0 ? std::min(1.0, fade_ + options_.dt / options_.soft_start) : 1.0;
    if (fade && fade_ < 1.0) {
      step.qdot = fade_ * step.qdot + (1.0 - fade_) * qdot_start_;
      rule = false;
    }
  }

  if (!inside(step.qdot, tracker_.bounds())) {
    limit(step);
    rule = false;
  }
  // Twists beyond all measure, where no velocity limit is held.
  if (!detail::finite(tracker_.q() + options_.dt * step.qdot) || !detail::finite(step.achieved_twist)) {
    return stop(Status::BadInput);
  }
  take(step, rule);
  return step;
}

// Sends the command: from here on it is history. `achieved`: its twist is known.
void Servo::take(ServoStep& step, bool achieved) noexcept {
  if (tracker_.q().size() == 0) {
    step.q = step.qdot = JointVector::Zero(chain_.dof());
    return;
  }
  const bool changed = tracker_.advance(step.qdot);
  step.q = tracker_.q();
  if (!achieved || changed) {
    step.achieved_twist.setZero();
    for (int i = 0; i < chain_.dof(); ++i) step.achieved_twist += step.qdot[i] * state_.jacobian.col(i);
  }
  sigmaik::update(chain_, step.q, state_);
}

void Servo::limit(ServoStep& step) noexcept {
  const VelocityBounds& bounds = tracker_.bounds();
  const JointVector asked = step.qdot;

  // Where to head.
  const VelocityBounds heading = tracker_.heading();
  if (!inside(asked, heading)) {
    if (options_.on_limit == OnLimit::Redistribute) {
      step.qdot = redistribute(asked, heading, step);
    } else {
      const JointVector rest = JointVector::Zero(chain_.dof());
      step.qdot = furthest(rest, asked, heading, step.limiting_joints);
    }
  }
  // How far to get there in this cycle.
  if (!inside(step.qdot, bounds)) {
    step.qdot = furthest(tracker_.qdot(), step.qdot, bounds, step.limiting_joints);
    if (options_.on_limit == OnLimit::Redistribute && !inside(step.qdot, bounds)) {
      step.qdot = redistribute(step.qdot, bounds, step);
    }
    step.qdot = step.qdot.cwiseMax(bounds.lower).cwiseMin(bounds.upper);
  }

  // How much of the rule's twist is left, along itself and in the weights of the rule, and how much is missed at all.
  const Spectrum& spectrum = solver_.spectrum();
  const double size = std::max(asked.cwiseAbs().maxCoeff(), std::numeric_limits<double>::min());  // squares overflow
  double along = 0.0, whole = 0.0, missed = 0.0;
  for (int i = 0; i < spectrum.size(); ++i) {
    const double part = spectrum.sigma(i) * (spectrum.v(i).dot(asked) / size);
    const double done = spectrum.sigma(i) * (spectrum.v(i).dot(step.qdot) / size);
    along += part * done;
    whole += part * part;
    missed += (part - done) * (part - done);
  }
  if (missed > kDone * kDone * whole) {
    step.scale = along >= whole ? 1.0 : along > 0.0 ? along / whole : 0.0;  // NaN, where nothing was asked: 0
    step.status = Status::Limited;
  }
}

JointVector Servo::redistribute(const JointVector& qdot, const VelocityBounds& bounds, ServoStep& step) noexcept {
  const Spectrum& spectrum = solver_.spectrum();
  const double largest = spectrum.sigma(0), regular = relative_threshold(solver_.method());
  rows_.setZero(spectrum.size(), chain_.dof());
  if (options_.exact == std::array<bool, 6>{}) {
    for (int i = 0; i < spectrum.size(); ++i) {
      rows_.row(i) = weight(spectrum.sigma(i), largest, regular) * spectrum.v(i).transpose();
    }
    return nearest(qdot, rows_, rows_.lazyProduct(qdot), largest, qdot, bounds, step);
  }

  // First what comes first, by itself: it has singularities of its own.
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
    const double w = weight(exact_spectrum_.sigma(i), exact_spectrum_.sigma(0), regular);
    first += w * exact_spectrum_.u(i) * exact_spectrum_.v(i).transpose();
  }
  const JointVector begin = nearest(qdot, first, first.lazyProduct(qdot), exact_spectrum_.sigma(0), qdot, bounds, step);

  // Then all the rest, while that stays.
  rows_.setZero(spectrum.rows(), chain_.dof());
  for (int i = 0; i < spectrum.size(); ++i) {
    rows_ += weight(spectrum.sigma(i), largest, regular) * spectrum.u(i) * spectrum.v(i).transpose();
  }
  TaskVector goal = rows_.lazyProduct(qdot);
  int row = 0;
  at = 0;
  for (std::size_t i = 0; i < 6; ++i) {
    if (options_.exact[i]) {
      rows_.row(row) = kExactWeight * first.row(at++);
      goal[row] = rows_.row(row).dot(begin);
    }
    if (options_.task.mask[i]) ++row;
  }
  return nearest(begin, rows_, goal, largest, qdot, bounds, step);
}

// Inside the bounds, min |rows q̇ − goal|² + λ² |q̇ − begin|², and again from there.
JointVector Servo::nearest(const JointVector& begin, const TaskJacobian& rows, const TaskVector& goal, double largest,
                           const JointVector& asked, const VelocityBounds& bounds, ServoStep& step) noexcept {
  // For q̇ + x, and slack s that stands for the twist still missed: min |x|² + |s|², M x + λ s = missed, in one level,
  // and without squaring M.
  const auto m = rows.rows(), n = rows.cols();
  problem_.C.setZero(m, n + m);
  problem_.C.leftCols(n) = rows;
  problem_.C.rightCols(m).diagonal().setConstant(kJointWeight * largest);
  problem_.lower.setConstant(n + m, -std::numeric_limits<double>::infinity());
  problem_.upper.setConstant(n + m, std::numeric_limits<double>::infinity());
  std::uint32_t held = 0;
  JointVector qdot = begin;
  for (int pass = 0; pass < kPasses; ++pass) {
    problem_.lower.head(n) = bounds.lower - qdot;
    problem_.upper.head(n) = bounds.upper - qdot;
    problem_.d = goal - rows.lazyProduct(qdot);
    const LeastSquaresSolution solution = least_squares_.solve(problem_);
    if (solution.status == LeastSquaresStatus::BadInput) {  // numbers too far apart
      return begin.cwiseMax(bounds.lower).cwiseMin(bounds.upper);
    }
    // One ulp beyond a bound that the last command is on, and there would be no way from there.
    qdot = (qdot + solution.x.head(n)).cwiseMax(bounds.lower).cwiseMin(bounds.upper);
    held |= solution.at_lower | solution.at_upper;
  }
  for (int i = 0; i < n; ++i) {
    const bool on = qdot[i] == bounds.lower[i] || qdot[i] == bounds.upper[i];
    const bool free = bounds.lower[i] < bounds.upper[i] || asked[i] != bounds.lower[i];
    if ((held >> i & 1u) != 0 && on && free) step.limiting_joints |= static_cast<std::uint16_t>(1u << i);
  }
  return qdot;
}

}  // namespace sigmaik
