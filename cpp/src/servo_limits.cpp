// Joint limits change the rule's answer: they bound the heading, and the part of the way that fits into this cycle.

#include <algorithm>
#include <cmath>
#include <limits>

#include <sigmaik/servo.hpp>

#include "elbow.hpp"

namespace sigmaik {
namespace {

// A twist counts as done if no more than this part of it is missing.
constexpr double kDone = 1e-4;

// from + s (to − from) for the largest s in [0, 1] that is inside the bounds; if no s is inside, for the largest of
// those nearest to the bounds. Sets the bits of the joints that decide s.
JointVector furthest(const JointVector& from, const JointVector& to, const VelocityBounds& bounds,
                     std::uint16_t& limiting) noexcept {
  const auto n = from.size();
  const JointVector way = to - from;
  // Whether joint i moves by more than rounding.
  const auto moves = [&](Eigen::Index i) { return std::abs(way[i]) > 1e-12 * std::abs(from[i]); };
  double least = 0.0, s = 1.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (!moves(i)) continue;
    const bool up = way[i] > 0.0;
    s = std::min(s, ((up ? bounds.upper : bounds.lower)[i] - from[i]) / way[i]);
    least = std::max(least, ((up ? bounds.lower : bounds.upper)[i] - from[i]) / way[i]);
  }
  const bool meets = s >= least;
  if (!meets) {
    // Half the derivative of the squared distance does not decrease with s, so bisection finds its zero.
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
  return rounded ? at.cwiseMax(bounds.lower).cwiseMin(bounds.upper) : at;  // rounding must not exceed a bound
}

}  // namespace

void Servo::limit(ServoStep& step) noexcept {
  const JointVector asked = step.qdot;
  slow_down(step);
  if (holds_tool_speed()) slow_tool(step);
  head(step);
  if (holds_tool_speed()) slow_tool(step);  // joints that take over may move an elbow
  approach(step, options_.on_limit == OnLimit::Redistribute);
  if (holds_tool_speed()) hold_tool_speed(step);
  judge(asked, step);
}

// [rad/s] ≥ 0, how fast the elbow may come near its straight angle; see Servo, the elbow's side.
double Servo::folding_limit() const noexcept {
  const detail::Elbow* elbow = elbow_.operator->();
  if (elbow == nullptr) return std::numeric_limits<double>::infinity();
  const double q = tracker_.q()[elbow->joint], room = std::abs(q - elbow->straight) - detail::Elbow::kMargin;
  if (elbow->side(q) == 0) return std::numeric_limits<double>::infinity();
  return room > 0.0 ? tracker_.heading_speed(elbow->joint, room) : 0.0;
}

// Whether q̇ folds the elbow faster than that.
bool Servo::folds(const JointVector& qdot) const noexcept {
  const detail::Elbow* elbow = elbow_.operator->();
  return elbow != nullptr && -elbow->side(tracker_.q()[elbow->joint]) * qdot[elbow->joint] > folding_limit();
}

// Puts the elbow's side into heading bounds.
void Servo::keep_side(VelocityBounds& heading) const noexcept {
  const detail::Elbow* elbow = elbow_.operator->();
  if (elbow == nullptr) return;
  const int i = elbow->joint, side = elbow->side(tracker_.q()[i]);
  const auto at = static_cast<std::size_t>(i);
  const double most = folding_limit();
  if (side > 0 && -most > heading.lower[i]) {
    heading.lower[i] = std::min(-most, heading.upper[i]);
    heading.lower_kind[at] = LimitKind::Position;
  } else if (side < 0 && most < heading.upper[i]) {
    heading.upper[i] = std::max(most, heading.lower[i]);
    heading.upper_kind[at] = LimitKind::Position;
  }
}

// The command without folding the elbow: other joints do as much of the twist as possible. A part of a command that
// folds an elbow at its bound would be rest, for ever.
JointVector Servo::unfolded(const JointVector& asked, ServoStep& step) noexcept {
  VelocityBounds side;
  side.upper.resize(chain_.dof());
  for (int i = 0; i < chain_.dof(); ++i) side.upper[i] = tracker_.velocity_limit(i);
  side.lower = -side.upper;
  keep_side(side);
  return redistribute(asked, side, step);
}

// Position limits: the command becomes a velocity inside the heading bounds, and inside the velocity limits still.
void Servo::head(ServoStep& step) noexcept {
  VelocityBounds heading = tracker_.heading();
  keep_side(heading);
  const bool clear = clears(step.qdot);
  if (clear && heading.contain(step.qdot)) return;
  for (int i = 0; i < chain_.dof(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double limit = tracker_.velocity_limit(i);
    if (heading.upper[i] > limit) {
      heading.upper[i] = std::max(limit, heading.lower[i]);
      heading.upper_kind[at] = LimitKind::Velocity;
    }
    if (heading.lower[i] < -limit) {
      heading.lower[i] = std::min(-limit, heading.upper[i]);
      heading.lower_kind[at] = LimitKind::Velocity;
    }
  }
  const JointVector asked = step.qdot;
  if (options_.on_limit == OnLimit::Redistribute) {
    if (clear) step.qdot = redistribute(asked, heading, step);
    if (!clear || !clears(step.qdot)) head_clear(asked, heading, step);
  } else {
    const JointVector rest = JointVector::Zero(chain_.dof());
    const JointVector open = folds(asked) ? unfolded(asked, step) : asked;
    step.qdot = furthest(rest, open, heading, step.limiting_joints);
    if (!clears(step.qdot)) head_clear(JointVector(step.qdot), heading, step);
  }
}

// Acceleration and jerk limits: the command becomes the part of the way to the heading that fits into this cycle.
// `redistributes`: where one joint must brake as hard as it can, the other joints do as much of the twist as possible.
void Servo::approach(ServoStep& step, bool redistributes) noexcept {
  const VelocityBounds& bounds = tracker_.bounds();
  if (tracker_.has_jerk()) {
    const JointVector wanted = step.qdot;
    step.qdot = tracker_.approach(wanted);
    for (int i = 0; i < chain_.dof(); ++i) {
      if (step.qdot[i] != wanted[i] || !(wanted[i] >= bounds.lower[i] && wanted[i] <= bounds.upper[i])) {
        step.limiting_joints |= static_cast<std::uint16_t>(1u << i);
      }
    }
    step.qdot = step.qdot.cwiseMax(bounds.lower).cwiseMin(bounds.upper);
    return;
  }
  if (bounds.contain(step.qdot)) return;
  step.qdot = furthest(tracker_.qdot(), step.qdot, bounds, step.limiting_joints);
  if (redistributes && !bounds.contain(step.qdot)) {
    step.qdot = redistribute(step.qdot, bounds, step);
  }
  step.qdot = step.qdot.cwiseMax(bounds.lower).cwiseMin(bounds.upper);
}

// Instead of the rule's answer: straight to joint positions, all joints in proportion, so that they stop there. The
// tool is no faster than the gains and the largest errors let it be, and starts as softly.
void Servo::lead(const JointVector& goal, ServoStep& step) noexcept {
  // No singularity delays joints by themselves, so their gain can be larger than that of the pose.
  constexpr double kGain = 2.5;
  const JointVector asked = step.qdot;
  const double gain = std::min(solver_.length_scale() / solver_.pace().lag,
                               kGain * std::max(options_.gain_linear, options_.gain_angular));
  step.qdot = gain * (goal - tracker_.q());
  step.qdot *= tracker_.arrival(step.qdot, gain);
  double part = tracker_.velocity_scale(step.qdot).part;
  const Twist twist = state_.jacobian.lazyProduct(step.qdot);
  const double linear = options_.gain_linear * max_linear_error_;
  const double angular = options_.gain_angular * options_.max_angular_error;
  if (twist.head<3>().norm() * part > linear) part = linear / twist.head<3>().norm();
  if (twist.tail<3>().norm() * part > angular) part = angular / twist.tail<3>().norm();
  step.qdot *= std::min(1.0, fade_) * part;
  if (holds_tool_speed()) slow_tool(step);
  if (!clears(step.qdot)) head_clear(JointVector(step.qdot), tracker_.heading(), step);
  approach(step, false);
  if (holds_tool_speed()) hold_tool_speed(step);
  judge(asked, step);
}

// Measures how much of the rule's twist is left, along this twist and in the weights of the rule, and whether any is
// missing.
void Servo::judge(const JointVector& asked, ServoStep& step) const noexcept {
  const Spectrum& spectrum = solver_.spectrum();
  // Velocities are divided by the largest entry, so that squares do not overflow.
  const double size = std::max(asked.cwiseAbs().maxCoeff(), std::numeric_limits<double>::min());
  double along = 0.0, whole = 0.0, missed = 0.0;
  for (int i = 0; i < spectrum.size(); ++i) {
    const double part = spectrum.sigma(i) * (spectrum.v(i).dot(asked) / size);
    const double done = spectrum.sigma(i) * (spectrum.v(i).dot(step.qdot) / size);
    along += part * done;
    whole += part * part;
    missed += (part - done) * (part - done);
  }
  if (missed > kDone * kDone * whole) {
    step.scale = along >= whole ? 1.0 : along > 0.0 ? along / whole : 0.0;  // 0 where nothing was asked (NaN)
    step.status = Status::Limited;
  }
}

}  // namespace sigmaik
