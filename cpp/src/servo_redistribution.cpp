// OnLimit::Redistribute: inside the bounds, the joint velocities whose twist is nearest to that of the rule's answer.

#include <algorithm>
#include <cmath>
#include <limits>

#include <sigmaik/servo.hpp>

namespace sigmaik {
namespace {

// Weight of joint motion against twist, as a part of σ_max. The weight bounds how fast joints move to make up for
// little twist where the remaining joints come to a singularity of their own.
constexpr double kJointWeight = 1e-2;
// Weight of the exact rows against the other rows.
constexpr double kExactWeight = 1e3;

// Adds Σ (w_i − σ_i) u_i v_iᵀ to the rows J, w_i the rule's weight of direction i (Resolution::weight). With the sum
// S = Σ w_i u_i v_iᵀ the rule's q̇ minimises ½|S q̇|² − ẋᵀJ q̇, so what limits leave of q̇ has ẋᵀJ q̇ ≥ ½|S q̇|² wherever
// they allow rest: the tool never moves away from the target. (Guptasarma et al., eq. 37, with limits and with any
// threshold.)
void raise(const Spectrum& spectrum, const Resolution& resolution, TaskJacobian& rows) noexcept {
  for (int i = 0; i < spectrum.size(); ++i) {
    const double more = resolution.weight[static_cast<std::size_t>(i)] - spectrum.sigma(i);
    if (more != 0.0) rows += more * spectrum.u(i) * spectrum.v(i).transpose();
  }
}

}  // namespace

JointVector Servo::redistribute(const JointVector& qdot, const VelocityBounds& bounds, ServoStep& step) noexcept {
  if (!has_exact() || lost_ == 1.0) return redistribute_together(qdot, bounds, step);
  const JointVector by_priority = redistribute_by_priority(qdot, bounds, step);
  return lost_ == 0.0 ? by_priority : mixed(by_priority, redistribute_together(qdot, bounds, step));
}

JointVector Servo::redistribute_together(const JointVector& qdot, const VelocityBounds& bounds,
                                         ServoStep& step) noexcept {
  const Spectrum& spectrum = solver_.spectrum();
  const Resolution& resolution = solver_.resolution();
  rows_.setZero(spectrum.size(), chain_.dof());
  for (int i = 0; i < spectrum.size(); ++i) {
    rows_.row(i) = resolution.weight[static_cast<std::size_t>(i)] * spectrum.v(i).transpose();
  }
  return nearest(qdot, rows_, rows_.lazyProduct(qdot), spectrum.sigma(0), qdot, bounds, step);
}

JointVector Servo::redistribute_by_priority(const JointVector& qdot, const VelocityBounds& bounds,
                                            ServoStep& step) noexcept {
  // First, the problem has the exact rows alone.
  TaskJacobian first = weighted_rows(exact_);
  raise(exact_spectrum_, exact_resolution_, first);
  const JointVector begin = nearest(qdot, first, first.lazyProduct(qdot), exact_spectrum_.sigma(0), qdot, bounds, step);
  if (rest_.rows() == 0) return begin;

  // Then the problem has all rows, with so much weight on the exact rows that their part stays. The spectrum of the
  // other rows is that of their part which leaves the exact rows as they are: only singular directions of this part are
  // raised.
  TaskJacobian second = weighted_rows(rest_);
  raise(rest_spectrum_, rest_resolution_, second);
  const int exact = exact_.rows(), rest = rest_.rows();
  rows_.resize(exact + rest, chain_.dof());
  rows_.topRows(exact) = kExactWeight * first;
  rows_.bottomRows(rest) = second;
  TaskVector goal(exact + rest);
  goal.head(exact) = kExactWeight * first.lazyProduct(begin);
  goal.tail(rest) = second.lazyProduct(qdot);
  return nearest(begin, rows_, goal, solver_.spectrum().sigma(0), qdot, bounds, step);
}

// Minimises |rows q̇ − goal|² + λ² |q̇ − begin|² inside the bounds, then once more with the answer in place of `begin`.
// In the second pass, twist that the bounds leave undone adds weight to joint motion as a whole, by the same law that
// makes the rule's threshold grow (Pace): the answer would otherwise jump where remaining joints can hardly do that
// twist.
JointVector Servo::nearest(const JointVector& begin, const TaskJacobian& rows, const TaskVector& goal, double largest,
                           const JointVector& asked, const VelocityBounds& bounds, ServoStep& step) noexcept {
  // In x = q̇ − begin and a slack s for the twist still missed: min |x|² + |s|² where rows x + λ s = missed. This form
  // is one level of least squares, and does not square the rows.
  const auto m = rows.rows(), n = rows.cols();
  const double least = kJointWeight * kJointWeight * largest * largest;
  problem_.C.setZero(m, n + m);
  problem_.C.leftCols(n) = rows;
  JointVector heavy = JointVector::Ones(n);  // x_j = √w_j (q̇_j − begin_j)
  if (weighs_joints()) {
    for (int i = 0; i < n; ++i) {
      heavy[i] = heaviness(i);
      problem_.C.col(i) /= heavy[i];
    }
  }
  problem_.lower.setConstant(n + m, -std::numeric_limits<double>::infinity());
  problem_.upper.setConstant(n + m, std::numeric_limits<double>::infinity());
  std::uint32_t held = 0;
  JointVector qdot = begin;
  double weight = least;
  for (int pass = 0; pass < 2; ++pass) {
    problem_.C.rightCols(m).diagonal().setConstant(std::sqrt(weight));
    problem_.lower.head(n) = heavy.cwiseProduct(bounds.lower - qdot);
    problem_.upper.head(n) = heavy.cwiseProduct(bounds.upper - qdot);
    problem_.d = goal - rows.lazyProduct(qdot);
    add_clear_rows(qdot);
    const LeastSquaresSolution solution = least_squares_.solve(problem_);
    if (solution.status == LeastSquaresStatus::BadInput) {  // numbers too far apart
      return begin.cwiseMax(bounds.lower).cwiseMin(bounds.upper);
    }
    // Clamp exactly: one ulp outside, and the next cycle's bounds could be empty.
    const JointVector answer =
        (qdot + solution.x.head(n).cwiseQuotient(heavy)).cwiseMax(bounds.lower).cwiseMin(bounds.upper);
    held |= solution.at_lower | solution.at_upper;
    if (pass == 1) {
      qdot = answer;
      break;
    }
    const double undone = (goal - rows.lazyProduct(answer)).norm();
    weight = least + solver_.pace().lag * undone;
    qdot = (least / weight) * answer;
  }
  for (int i = 0; i < n; ++i) {
    const double rounding = 1e-12 * std::abs(qdot[i]);
    const bool on = qdot[i] <= bounds.lower[i] + rounding || qdot[i] >= bounds.upper[i] - rounding;
    const bool free = bounds.lower[i] < bounds.upper[i] || asked[i] != bounds.lower[i];
    if ((held >> i & 1u) != 0 && on && free) step.limiting_joints |= static_cast<std::uint16_t>(1u << i);
  }
  return qdot;
}

}  // namespace sigmaik
