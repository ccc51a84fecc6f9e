// How ConstrainedIk closes an error so that the joints can still brake before the target.

#include <algorithm>
#include <cmath>

#include <sigmaik/constrained_ik.hpp>
#include <sigmaik/pose.hpp>

#include "constrained_ik_parts.hpp"
#include "numbers.hpp"

namespace sigmaik {
namespace {

using detail::kInfinity;
using namespace detail::constrained;
constexpr double kMissed = 0.25;   // part of the exact rows' change from which on the joints go in proportion
constexpr double kCalming = 0.05;  // [s] in which the patience comes back by 1 − 1/e where the target moves
constexpr double kLess = 0.7;      // of the closing speed stays at each further turn
constexpr double kNearer = 0.98;   // of the least error: below, a turn is forgiven
constexpr double kJump = 0.5;      // part of the joints' bounds; a larger change of the target's motion is a jump
constexpr double kLarge = 0.1;     // [rad, m] an error of the approximate rows that needs an arrival
constexpr double kFade = 1.0;      // [s] time constant of a motion's end after the settling time
constexpr int kTurns = 2;          // times that the closing motion may turn against the arm before it is calmed

}  // namespace

// The problem without limits but for a joint's step of a radian or a metre a time constant: farther, no linearisation
// holds. The step is a part of the way that is left, and this way ends at the position limits: past them, a joint would
// stand at its limit, and the others would take the tip away from the target.
LeastSquaresSolution ConstrainedIk::solve_freely(double part) noexcept {
  const int n = chain_.dof();
  const double most = std::min(1.0, options_.dt / kSettling);
  auto& p = problem_;
  p.h.setConstant(kInfinity);
  p.lower.head(n).setConstant(-most);
  p.upper.head(n).setConstant(most);
  if (options_.limits.position) {
    const JointLimits& limits = chain_.limits();
    p.lower.head(n) = p.lower.head(n).cwiseMax((part * (limits.lower - tracker_.q())).cwiseMin(0.0));
    p.upper.head(n) = p.upper.head(n).cwiseMin((part * (limits.upper - tracker_.q())).cwiseMax(0.0));
  }
  p.lower.tail(p.lower.size() - n).setZero();
  p.upper.tail(p.upper.size() - n).setZero();
  return closing_.solve(p);
}

// The largest part of an error that a cycle closes without limits.
double ConstrainedIk::decay() const noexcept {
  double part = exact_.rows() > 0 ? std::min(1.0, options_.dt / kSettling) : 0.0;
  for (Eigen::Index i = 0; i < 6; ++i) {
    if (!approximate_.mask[static_cast<std::size_t>(i)] || options_.alpha[i] == 0.0) continue;
    const double ratio = options_.beta[i] / options_.alpha[i];
    part = std::max(part, 1.0 / (1.0 + ratio * ratio));
  }
  return part;
}

// Whether the target jumps: no posture lets the joints reach this velocity of the tip in one cycle. Also true where an
// error of the approximate rows has become so large that the arm would swing about the target.
bool ConstrainedIk::jumps(const Twist& motion) const noexcept {
  if (!tracker_.delays()) return false;
  const double dt = options_.dt;
  Eigen::Vector2d most = Eigen::Vector2d::Zero();
  for (int i = 0; i < chain_.dof(); ++i) {
    const VelocityBounds& bounds = tracker_.bounds();
    const double change = dt * (bounds.upper[i] - bounds.lower[i]);
    most[0] += change * state_.jacobian.col(i).head<3>().norm();
    most[1] += change * state_.jacobian.col(i).tail<3>().norm();
  }
  const Twist change = motion - last_motion_;
  if (change.head<3>().norm() > kMet + kJump * most[0] || change.tail<3>().norm() > kMet + kJump * most[1]) return true;
  const Twist behind = -pose_error(state_.tip, reference_);
  const TaskVector rows = select_rows(approximate_, state_.tip.linear(), behind);
  return rows.size() > 0 && rows.norm() > kLarge;
}

void ConstrainedIk::end_arrival() noexcept {
  arriving_ = against_ = false;
  patience_ = 1.0;
  turns_ = 0;
  least_error_ = kInfinity;
}

// How much of the error that is behind may be closed in this cycle, see constrained_ik.hpp. `still`: the target rests.
ConstrainedIk::Closing ConstrainedIk::close(bool still) noexcept {
  Closing out;
  const int n = chain_.dof();
  out.qdot = JointVector::Zero(n);
  if (!tracker_.delays()) return out;
  out.behind = -pose_error(state_.tip, reference_);
  const TaskVector behind = select_rows(options_.task, state_.tip.linear(), out.behind);
  out.small = behind.cwiseAbs().maxCoeff() <= kMet;
  if (out.small) return out;
  out.active = true;
  const double part = decay();
  if (part == 0.0) return out;
  prepare();
  const Linearisation at(state_, reference_, Twist::Zero(), JointVector());
  set_approximate_rows(at, Twist::Zero(), Closing{});
  set_exact_rows(at, Closing{});
  problem_.d *= part;
  const LeastSquaresSolution solution = solve_freely(part);
  if (solution.status == LeastSquaresStatus::BadInput) return out;
  Twist change = Twist::Zero();
  for (int j = 0; j < n; ++j) change += solution.x[j] * at.slope.col(j);
  out.qdot = solution.x.head(n) / options_.dt;
  calm(out.qdot, behind.norm(), still);
  const double brake = patience_ * tracker_.arrival(out.qdot, part / options_.dt);
  // An error so small that one cycle can both make it up and stop again needs no decay.
  const VelocityBounds& bounds = tracker_.bounds();
  for (int i = 0; i < n; ++i) {
    const double width = kAtOnce * (bounds.upper[i] - bounds.lower[i]), size = std::abs(out.qdot[i]);
    if (size > out.size * width) out.size = width > 0.0 ? size / width : kInfinity;
  }
  out.small = out.size <= part;
  const double once = std::min(patience_ / part, 1.0 / out.size);
  out.size *= brake;
  out.qdot *= brake;
  out.approximate = brake * change;
  out.exact = std::max(brake, once) * change;
  return out;
}

// At the edge of the reach, and where the approximate rows cannot be met together with the exact ones, the way that a
// linearisation shows is too long, and the arm would swing about a resting target. So each time that the closing motion
// turns against the arm, more than twice, a part of its speed stays; all of it comes back when the target moves. Each
// time that the error has become less by a fiftieth, one turn is forgiven: an arm that swings about a singularity on
// its way goes on, and at the edge of the reach the error falls no further.
void ConstrainedIk::calm(const JointVector& wanted, double error, bool still) noexcept {
  const bool against = tracker_.qdot().dot(wanted) < 0.0;
  if (!still) {
    patience_ += std::min(0.5, options_.dt / kCalming) * (1.0 - patience_);
    turns_ = 0;
    least_error_ = kInfinity;
  } else if (against && !against_ && ++turns_ > kTurns) {
    patience_ *= kLess;
    turns_ = kTurns;
  } else if (error < kNearer * least_error_) {
    patience_ = std::min(1.0, patience_ / kLess);
    least_error_ = error;
  }
  against_ = against;
}

// The joint velocity that follows the target's motion, without limits.
JointVector ConstrainedIk::follow(const Twist& motion) noexcept {
  const int n = chain_.dof();
  if (motion.isZero(0.0)) return JointVector::Zero(n);
  prepare();
  Linearisation at(state_, state_.tip, Twist::Zero(), JointVector());
  at.offset = -motion;
  set_approximate_rows(at, motion, Closing{});
  set_exact_rows(at, Closing{});
  const LeastSquaresSolution solution = solve_freely(1.0);
  if (solution.status == LeastSquaresStatus::BadInput) return JointVector::Zero(n);
  return solution.x.head(n) / options_.dt;
}

// The velocity to head for: `wanted`, slowed down to the velocity limits, and inside the heading bounds.
JointVector ConstrainedIk::head(const JointVector& wanted) const noexcept {
  const JointVector out = tracker_.velocity_scale(wanted).part * wanted;
  const VelocityBounds heading = tracker_.heading();
  return out.cwiseMax(heading.lower).cwiseMin(heading.upper);
}

// Where a cycle cannot make the exact part, or where an error is to end under jerk limits, the joints go their way to
// the velocity that is wanted in proportion; see constrained_ik.hpp. `missed`: the part that the cycle cannot make.
void ConstrainedIk::settle(const Closing& closing, const Twist& motion, double missed,
                           ConstrainedIkStep& step) noexcept {
  double share = std::min(1.0, missed / kMissed);
  if (tracker_.has_jerk()) share = std::max(share, std::min(1.0, closing.size));
  if (!(share > 0.0)) return;
  head_for(head((1.0 - step.time_scale) * follow(motion) + closing.qdot), share, step);
}

// Mixes q̇ with the joints' way to a velocity, in proportion, by the share of the way.
void ConstrainedIk::head_for(const JointVector& velocity, double share, ConstrainedIkStep& step) noexcept {
  const VelocityBounds& bounds = tracker_.bounds();
  const JointVector way = tracker_.approach(velocity).cwiseMax(bounds.lower).cwiseMin(bounds.upper) - step.qdot;
  if (dynamics_) {  // torque limits come first
    prepare();
    for (int k = 0; k < torque_rows_; ++k) {
      const auto row = problem_.G.row(k).head(chain_.dof());
      const double now = options_.dt * row.dot(step.qdot), more = options_.dt * row.dot(way);
      const double most = std::max(now, problem_.h[k]);
      if (now + share * more > most) share = (most - now) / more;
    }
  }
  step.qdot += share * way;
  for (int i = 0; i < chain_.dof(); ++i) {
    if (step.qdot[i] <= bounds.lower[i] || step.qdot[i] >= bounds.upper[i]) {
      step.active |= static_cast<std::uint16_t>(1u << i);
    }
  }
}

// A motion that still goes on after the settling time ends; see constrained_ik.hpp. Without limits that delay the
// joints, a motion that does not settle is the options' own.
void ConstrainedIk::fade(const Pose& target, ConstrainedIkStep& step) noexcept {
  if (target.matrix() != last_target_.matrix()) {
    last_target_ = target;
    rested_ = 0.0;
    return;
  }
  if (!tracker_.delays()) return;
  rested_ += options_.dt;
  const double over = rested_ - settling_time();
  if (over < 0.0) return;
  const JointVector velocity = std::exp(-over / kFade) * step.qdot;
  if (velocity == step.qdot) return;
  step.used = IkSource::Optimised;
  head_for(velocity, 1.0, step);
}

// The part of the exact rows' change of velocity that the limits leave undone, in [0, 1].
double ConstrainedIk::missed(const LeastSquaresSolution& solution) const noexcept {
  if (solution.equality_error <= kMet) return 0.0;
  RowVector change = problem_.d;
  for (int j = 0; j < chain_.dof(); ++j) change -= options_.dt * tracker_.qdot()[j] * problem_.C.col(j);
  return std::min(1.0, solution.equality_error / std::max(solution.equality_error, change.norm()));
}

// Whether an approximate row is expected to exceed its largest error after the cycle.
bool ConstrainedIk::exceeds(const Eigen::Matrix3d& rotation, const Closing& closing) const noexcept {
  const TaskVector stays = select_rows(approximate_, rotation, Twist(closing.behind + closing.approximate));
  int k = 0;
  for (std::size_t i = 0; i < 6; ++i) {
    if (approximate_.mask[i] && std::abs(stays[k++]) > options_.max_error[static_cast<Eigen::Index>(i)]) return true;
  }
  return false;
}

}  // namespace sigmaik
