#include <sigmaik/constrained_ik.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include <sigmaik/pose.hpp>

#include "length.hpp"
#include "message.hpp"
#include "numbers.hpp"

namespace sigmaik {
namespace {

using detail::kInfinity;
using detail::require;
constexpr double kMet = 1e-9;    // [m, rad] a smaller error counts as none
constexpr double kAgree = 0.01;  // velocities that differ by less than this part of a joint's bounds are the same

// The rows of the task that are met exactly, or the others.
Task part(const ConstrainedIkOptions& options, bool exact) {
  Task out = options.task;
  for (std::size_t i = 0; i < 6; ++i) out.mask[i] = options.task.mask[i] && options.exact[i] == exact;
  return out;
}

// J_l⁻¹(φ), which takes ω to φ̇ for φ = log(R): I − ½[φ]× + c [φ]×².
Eigen::Matrix3d inverse_left_jacobian(const Eigen::Vector3d& phi) noexcept {
  const double angle = detail::length(phi);
  Eigen::Matrix3d cross;
  cross << 0.0, -phi.z(), phi.y(), phi.z(), 0.0, -phi.x(), -phi.y(), phi.x(), 0.0;
  const double half = 0.5 * angle;
  const double c = angle < 1e-4 ? 1.0 / 12.0 : (1.0 - half / std::tan(half)) / (angle * angle);
  return Eigen::Matrix3d::Identity() - 0.5 * cross + c * cross * cross;
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
  sigmaik::update(chain_, tracker_.q(), state_);
  reference_ = state_.tip;
  last_free_ = true;
}

ConstrainedIkStep ConstrainedIk::update(const Pose& target) noexcept {
  ConstrainedIkStep step;
  if (tracker_.q().size() == 0) {
    step.q = step.qdot = JointVector::Zero(chain_.dof());
    return step;
  }
  const bool good = is_pose(target.matrix());
  if (!good) {
    step.qdot = tracker_.stop();
  } else if (!try_analytic(target, step)) {
    optimise(target, pose_error(reference_, target), step);
  }
  const bool held = step.active != 0 || step.torque_active || step.error_active || !step.exact_met;
  last_free_ = step.used == IkSource::Analytic ||
               (good && analytic_ && !dynamics_ && !held && agrees(*analytic_, target, tracker_, step.qdot));
  tracker_.advance(step.qdot);
  step.q = tracker_.q();
  sigmaik::update(chain_, step.q, state_);
  if (!good) {
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

// (11), (12): e ≈ slope Δq + offset, the tip minus the target; and e* = e + turned ϑ.
struct ConstrainedIk::Linearisation {
  Jacobian slope;
  Twist offset, turned;

  // `state` belongs to the joint positions of this linearisation; `back` is the step from there to the start of the
  // cycle.
  Linearisation(const ChainState& state, const Pose& target, const Twist& motion, const JointVector& back) noexcept
      : slope(state.jacobian), offset(-pose_error(state.tip, target)), turned(motion) {
    const Eigen::Matrix3d turn = inverse_left_jacobian(offset.tail<3>());
    slope.bottomRows<3>() = turn.lazyProduct(state.jacobian.bottomRows<3>());
    turned.tail<3>() = turn * motion.tail<3>();
    for (Eigen::Index j = 0; j < back.size(); ++j) offset += back[j] * slope.col(j);
  }
};

// (24), (25) with the weights α and β, and |e| ≤ max_error.
void ConstrainedIk::set_approximate_rows(const Linearisation& at, const Twist& motion) noexcept {
  const int n = chain_.dof(), ap = approximate_.rows();
  if (ap == 0) return;
  const bool scaled = options_.gamma.has_value();
  const Eigen::Matrix3d& rotation = state_.tip.linear();
  const TaskJacobian rows = select_rows(approximate_, rotation, at.slope);
  const TaskJacobian rate = select_rows(approximate_, rotation, state_.jacobian);
  const TaskVector offset = select_rows(approximate_, rotation, at.offset);
  const TaskVector slowed = select_rows(approximate_, rotation, at.turned);
  const TaskVector asked = select_rows(approximate_, rotation, motion);
  auto& p = problem_;
  int k = 0, bound = torque_rows_;
  for (std::size_t i = 0; i < 6; ++i) {
    if (!approximate_.mask[i]) continue;
    const auto row = static_cast<Eigen::Index>(i);
    const double alpha = options_.alpha[row], beta = options_.beta[row], most = options_.max_error[row];
    p.A.row(k).head(n) = alpha * rows.row(k);
    p.b[k] = -alpha * offset[k];
    p.A.row(ap + k).head(n) = beta * rate.row(k);
    p.b[ap + k] = beta * asked[k];
    if (scaled) p.A(k, n) = alpha * slowed[k];
    if (most < kInfinity) {
      for (const double sign : {1.0, -1.0}) {
        p.G.row(bound).head(n) = sign / most * rows.row(k);
        if (scaled) p.G(bound, n) = sign / most * slowed[k];
        p.h[bound++] = 1.0 - sign / most * offset[k];
      }
    }
    ++k;
  }
}

// (26): e* = 0.
void ConstrainedIk::set_exact_rows(const Linearisation& at) noexcept {
  if (exact_.rows() == 0) return;
  const int n = chain_.dof();
  const Eigen::Matrix3d& rotation = state_.tip.linear();
  problem_.C.leftCols(n) = select_rows(exact_, rotation, at.slope);
  problem_.d = -select_rows(exact_, rotation, at.offset);
  if (options_.gamma) problem_.C.col(n) = select_rows(exact_, rotation, at.turned);
}

void ConstrainedIk::optimise(const Pose& target, const Twist& motion, ConstrainedIkStep& step) noexcept {
  step.used = IkSource::Optimised;
  prepare();
  const int n = chain_.dof();
  const JointVector& from = tracker_.q();
  JointVector q = from;
  LeastSquaresSolution solution;
  bool error_lost = false;
  for (int iteration = 0; iteration < options_.iterations; ++iteration) {
    if (iteration > 0) sigmaik::update(chain_, q, state_);
    const Linearisation at(state_, target, motion, from - q);
    set_approximate_rows(at, motion);
    set_exact_rows(at);
    solution = least_squares_.solve(problem_);
    error_lost = error_rows_ > 0 && solution.equality_error > kMet;
    if (error_lost) {  // the exact part comes first
      problem_.h.tail(error_rows_).setConstant(kInfinity);
      solution = least_squares_.solve(problem_);
    }
    q = from + solution.x.head(n);
  }
  report(solution, error_lost, step);
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
