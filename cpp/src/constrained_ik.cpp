// One cycle of ConstrainedIk: the rows of the problem, its linearisations, and what is reported.

#include <sigmaik/constrained_ik.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include <sigmaik/pose.hpp>

#include "asked_pose.hpp"
#include "constrained_ik_parts.hpp"
#include "message.hpp"
#include "numbers.hpp"

namespace sigmaik {
namespace {

using detail::kInfinity;
using detail::require;
using detail::constrained::kMet;
constexpr double kStuck = 1.0 - 1e-6;  // ϑ of an arm that stands
constexpr double kAgree = 0.01;        // velocities that differ by less than this part of a joint's bounds are the same

// The rows of the task that are met exactly, or the others.
Task part(const ConstrainedIkOptions& options, bool exact) {
  Task out = options.task;
  for (std::size_t i = 0; i < 6; ++i) out.mask[i] = options.task.mask[i] && options.exact[i] == exact;
  return out;
}

// Whether the closed form asks for the velocity that was optimised. Where the two differ, an error still decays by β.
// The closed form would make up for that error in one cycle, with all the acceleration that the limits allow, and the
// next cycle would have to optimise again, to brake.
bool agrees(const AnalyticIk& analytic, const Pose& target, const LimitTracker& tracker,
            const JointVector& qdot) noexcept {
  const AnalyticNearest nearest = analytic.nearest(target, tracker.q());
  if (nearest.status != AnalyticStatus::Ok) return false;
  const JointVector apart = (nearest.branch.q - tracker.q()) / tracker.dt() - qdot;
  const VelocityBounds& bounds = tracker.bounds();
  return (apart.array().abs() <= kAgree * (bounds.upper - bounds.lower).array()).all();
}

}  // namespace

const char* to_string(IkSource source) noexcept { return source == IkSource::Analytic ? "analytic" : "optimised"; }

ConstrainedIk::ConstrainedIk(Chain chain, const ConstrainedIkOptions& options)
    : chain_(std::move(chain)),
      options_(options),
      approximate_(part(options, false)),
      exact_(part(options, true)),
      tracker_(chain_.limits(), options.dt, options.limits) {
  options.task.validate();
  static constexpr const char* kRows[6] = {"vx", "vy", "vz", "ωx", "ωy", "ωz"};
  for (std::size_t i = 0; i < 6; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    require(options.alpha[k] >= 0.0 && std::isfinite(options.alpha[k]), "alpha of row ", kRows[i], " = ",
            options.alpha[k], " must be finite and at least 0");
    require(options.beta[k] >= 0.0 && std::isfinite(options.beta[k]), "beta of row ", kRows[i], " = ", options.beta[k],
            " must be finite and at least 0");
    require(options.max_error[k] > 0.0, "max_error of row ", kRows[i], " = ", options.max_error[k], " must be above 0");
    require(!approximate_.mask[i] || options.alpha[k] > 0.0 || options.beta[k] > 0.0, "alpha and beta of row ",
            kRows[i], " are both 0: leave the row out of the mask instead");
    if (approximate_.mask[i] && options.max_error[k] < kInfinity) error_rows_ += 2;
  }
  if (options.gamma) {
    require(*options.gamma > 0.0 && std::isfinite(*options.gamma), "gamma = ", *options.gamma,
            " must be finite and above 0");
  }
  require(options.iterations >= 1 && options.iterations <= 100, "iterations = ", options.iterations,
          " must be from 1 to 100");
  if (options.torque_limits) {
    dynamics_.emplace(chain_, options.gravity);
    for (int i = 0; i < chain_.dof(); ++i) torque_rows_ += chain_.limits().effort[i] < kInfinity ? 2 : 0;
    require(torque_rows_ > 0, "torque_limits: no joint of the chain has an effort limit");
  }
  require(torque_rows_ + error_rows_ <= kMaxInequalities, "torque limits take ", torque_rows_, " rows and max_error ",
          error_rows_, "; together at most ", kMaxInequalities);
  if (options.analytic && options.task.whole()) {
    try {
      analytic_.emplace(chain_);
    } catch (const Error&) {  // most arms have no closed form
    }
  }
}

void ConstrainedIk::reset(const JointRef& q, const JointRef& qdot) {
  tracker_.reset(q, qdot);
  least_squares_.reset();
  closing_.reset();
  sigmaik::update(chain_, tracker_.q(), state_);
  reference_ = state_.tip;
  last_free_ = true;
  preview_.count = 0;
  turn_.resize(0);
  stuck_ = false;
  rested_ = 0.0;
  last_motion_.setZero();
  last_way_ = 0.0;
  end_arrival();
}

ConstrainedIkStep ConstrainedIk::update(const Pose& asked) noexcept {
  ConstrainedIkStep step;
  if (tracker_.q().size() == 0) {
    step.q = step.qdot = JointVector::Zero(chain_.dof());
    return step;
  }
  const detail::AskedPose read(asked);
  const Pose& target = read.pose;
  if (!read.valid) {
    step.qdot = tracker_.stop();
  } else {
    const Twist motion = pose_error(reference_, target);
    if (!turn(motion, step)) {
      const double least = look_ahead(motion);
      if (least > 0.0 || !try_analytic(target, step)) optimise(target, motion, least, step);
    }
    if (step.used == IkSource::Analytic) end_arrival();
    fade(target, step);
    last_motion_ = motion;
    last_way_ = (1.0 - step.time_scale) * motion.norm();
    stuck_ = step.time_scale > kStuck && motion.norm() > kMet;
    preview_.way += last_way_;
  }
  const bool held = step.active != 0 || step.torque_active || step.error_active || !step.exact_met;
  last_free_ = step.used == IkSource::Analytic ||
               (read.valid && analytic_ && !dynamics_ && !held && agrees(*analytic_, target, tracker_, step.qdot));
  tracker_.advance(step.qdot);
  step.not_settling = rested_ >= settling_time() && !tracker_.resting();
  step.q = tracker_.q();
  sigmaik::update(chain_, step.q, state_);
  if (!read.valid) {
    reference_ = state_.tip;
    return step;
  }

  if (step.time_scale == 0.0) {
    reference_ = target;
  } else {
    const Twist motion = (1.0 - step.time_scale) * pose_error(reference_, target);
    reference_.translation() += motion.head<3>();
    reference_.linear() = (rotation_exp(motion.tail<3>()) * reference_.linear()).eval();
  }
  step.error = -pose_error(state_.tip, target);
  step.path_error = -pose_error(state_.tip, reference_);
  const TaskVector missed = select_rows(options_.task, state_.tip.linear(), step.error);
  step.status = held ? Status::Limited : missed.cwiseAbs().maxCoeff() <= kMet ? Status::Ok : Status::Damped;
  return step;
}

// (35): the closed form, where its answer is inside the limits. After an optimised step, the closed form is used again
// only where that step met no limit and the two agreed.
bool ConstrainedIk::try_analytic(const Pose& target, ConstrainedIkStep& step) noexcept {
  if (!analytic_ || !last_free_ || dynamics_) return false;
  const JointVector& from = tracker_.q();
  const AnalyticNearest nearest = analytic_->nearest(target, from);
  if (nearest.status != AnalyticStatus::Ok || !nearest.branch.within_limits) return false;
  step.qdot = (nearest.branch.q - from) / options_.dt;
  const VelocityBounds& bounds = tracker_.bounds();
  if (!bounds.contain(step.qdot)) return false;
  step.used = IkSource::Analytic;
  return true;
}

// Rows of G that do not change with the iterations: |M q̈ + bias| ≤ effort, with q̈ = (Δq/dt − q̇)/dt.
void ConstrainedIk::prepare_torques() noexcept {
  const int n = chain_.dof();
  const double dt = options_.dt;
  dynamics_->evaluate(tracker_.q(), tracker_.qdot(), terms_);
  JointVector now = terms_.bias;
  for (int j = 0; j < n; ++j) now -= tracker_.qdot()[j] / dt * terms_.mass.col(j);
  int row = 0;
  for (int i = 0; i < n; ++i) {
    const double effort = chain_.limits().effort[i];
    if (!(effort < kInfinity)) continue;
    for (const double sign : {1.0, -1.0}) {
      problem_.G.row(row).head(n) = sign / (effort * dt * dt) * terms_.mass.row(i);
      problem_.h[row++] = 1.0 - sign * now[i] / effort;
    }
  }
}

// Sizes, bounds and all rows of the problem that the linearisations have in common.
void ConstrainedIk::prepare() noexcept {
  const int n = chain_.dof(), ap = approximate_.rows(), ex = exact_.rows();
  const bool scaled = options_.gamma.has_value();
  const int unknowns = n + (scaled ? 1 : 0);
  auto& p = problem_;
  p.A.setZero(2 * ap + (scaled ? 1 : 0), unknowns);
  p.b.setZero(p.A.rows());
  p.C.setZero(ex, unknowns);
  p.d.setZero(ex);
  p.G.setZero(torque_rows_ + error_rows_, unknowns);
  p.h.setZero(p.G.rows());
  p.lower.resize(unknowns);
  p.upper.resize(unknowns);
  p.lower.head(n) = options_.dt * tracker_.bounds().lower;
  p.upper.head(n) = options_.dt * tracker_.bounds().upper;
  if (scaled) {
    p.lower[n] = 0.0;
    p.upper[n] = 1.0;
    p.A(2 * ap, n) = *options_.gamma;
  }
  if (dynamics_) prepare_torques();
}

// (24), (25) with the weights α and β, and |e| ≤ max_error.
void ConstrainedIk::set_approximate_rows(const Linearisation& at, const Twist& motion,
                                         const Closing& closing) noexcept {
  const int n = chain_.dof(), ap = approximate_.rows();
  if (ap == 0) return;
  const bool scaled = options_.gamma.has_value();
  const Eigen::Matrix3d& rotation = state_.tip.linear();
  const TaskJacobian rows = select_rows(approximate_, rotation, at.slope);
  const TaskJacobian rate = select_rows(approximate_, rotation, state_.jacobian);
  const TaskVector offset = select_rows(approximate_, rotation, at.offset);
  const TaskVector slowed = select_rows(approximate_, rotation, at.turned);
  const TaskVector asked = select_rows(approximate_, rotation, motion);
  const TaskVector behind = select_rows(approximate_, rotation, closing.behind);
  const TaskVector change = select_rows(approximate_, rotation, closing.approximate);
  auto& p = problem_;
  int k = 0, bound = torque_rows_;
  for (std::size_t i = 0; i < 6; ++i) {
    if (!approximate_.mask[i]) continue;
    const auto row = static_cast<Eigen::Index>(i);
    const double alpha = options_.alpha[row], beta = options_.beta[row], most = options_.max_error[row];
    p.A.row(k).head(n) = alpha * rows.row(k);
    p.b[k] = -alpha * offset[k];
    // The part of the error that stays: without limits the rest of the error changes by −α²/(α²+β²) of itself.
    if (closing.active && alpha > 0.0) {
      p.b[k] += alpha * behind[k] + (alpha * alpha + beta * beta) / alpha * change[k];
    }
    p.A.row(ap + k).head(n) = beta * rate.row(k);
    p.b[ap + k] = beta * asked[k];
    if (scaled) p.A(k, n) = alpha * slowed[k];
    if (most < kInfinity) {
      for (const double sign : {1.0, -1.0}) {
        p.G.row(bound).head(n) = sign / most * rows.row(k);
        if (scaled) p.G(bound, n) = sign / most * slowed[k];
        // A larger error that is behind comes back no faster than the joints can brake.
        const double stays = sign / most * (behind[k] + change[k]);
        p.h[bound++] = std::max(1.0, stays) - sign / most * offset[k];
      }
    }
    ++k;
  }
}

// (26): e* = 0, or what of the error stays.
void ConstrainedIk::set_exact_rows(const Linearisation& at, const Closing& closing) noexcept {
  if (exact_.rows() == 0) return;
  const int n = chain_.dof();
  const Eigen::Matrix3d& rotation = state_.tip.linear();
  problem_.C.leftCols(n) = select_rows(exact_, rotation, at.slope);
  problem_.d = select_rows(exact_, rotation, Twist(closing.behind + closing.exact - at.offset));
  if (options_.gamma) problem_.C.col(n) = select_rows(exact_, rotation, at.turned);
}

void ConstrainedIk::optimise(const Pose& target, const Twist& motion, double least, ConstrainedIkStep& step) noexcept {
  step.used = IkSource::Optimised;
  if (!arriving_ && jumps(motion)) arriving_ = true;
  if (!optimise_once(target, motion, least, step)) {
    arriving_ = true;
    optimise_once(target, motion, least, step);
  }
}

// Returns whether the answer stands: an exact part that cannot be met has to be approached as in constrained_ik.hpp.
bool ConstrainedIk::optimise_once(const Pose& target, const Twist& motion, double least,
                                  ConstrainedIkStep& step) noexcept {
  const ChainState start = state_;
  Closing closing;
  if (arriving_) closing = close(motion.cwiseAbs().maxCoeff() <= kMet);
  const int n = chain_.dof();
  prepare();
  if (options_.gamma) problem_.lower[n] = least;
  const JointVector& from = tracker_.q();
  LeastSquaresSolution solution;
  bool error_lost = false;
  // Where something is behind, close() has solved a problem at `from`; going on with q̇ is as good a start as its
  // answer.
  const bool ahead = closing.active && options_.iterations > 1;
  JointVector q = from;
  if (ahead) q += options_.dt * tracker_.qdot();
  for (int iteration = ahead ? 1 : 0; iteration < options_.iterations; ++iteration) {
    if (iteration > 0) sigmaik::update(chain_, q, state_);
    const Linearisation at(state_, target, motion, from - q);
    set_approximate_rows(at, motion, closing);
    set_exact_rows(at, closing);
    solution = least_squares_.solve(problem_);
    error_lost = error_rows_ > 0 && solution.equality_error > kMet;
    if (error_lost) {  // the exact part comes first
      problem_.h.tail(error_rows_).setConstant(kInfinity);
      solution = least_squares_.solve(problem_);
    }
    q = from + solution.x.head(n);
  }
  if (!arriving_ && tracker_.delays() && solution.equality_error > kMet) {
    state_ = start;
    return false;
  }
  report(solution, error_lost, step);
  if (solution.status == LeastSquaresStatus::BadInput || !arriving_) return true;
  const double lost = missed(solution);
  if (closing.active) {
    const Eigen::Matrix3d& rotation = start.tip.linear();
    const TaskVector stays = select_rows(exact_, rotation, Twist(closing.behind + closing.exact));
    for (int k = 0; k < exact_.rows(); ++k) step.exact_met = step.exact_met && std::abs(stays[k]) <= kMet;
    step.error_active = step.error_active || exceeds(rotation, closing);
  }
  state_ = start;
  settle(closing, motion, lost, step);
  if (closing.small && step.active == 0 && !step.torque_active && solution.equality_error <= kMet) end_arrival();
  return true;
}

// Fills in the fields that the last solution decides.
void ConstrainedIk::report(const LeastSquaresSolution& solution, bool error_lost,
                           ConstrainedIkStep& step) const noexcept {
  if (solution.status == LeastSquaresStatus::BadInput) {
    step.qdot = tracker_.stop();
    step.exact_met = false;
    return;
  }
  const int n = chain_.dof();
  step.qdot = solution.x.head(n) / options_.dt;
  if (options_.gamma) step.time_scale = solution.x[n];
  const std::uint32_t held = solution.at_lower | solution.at_upper;
  step.active = static_cast<std::uint16_t>(held & ((1u << n) - 1u));
  for (int k = 0; k < problem_.G.rows(); ++k) {
    if (solution.active >> k & 1u) (k < torque_rows_ ? step.torque_active : step.error_active) = true;
  }
  step.error_active = step.error_active || error_lost;
  step.exact_met = solution.equality_error <= kMet;
}

}  // namespace sigmaik
