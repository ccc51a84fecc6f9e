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

// Σ w_i u_i v_iᵀ, w_i the rule's weight of direction i (Resolution::weight). With S = Σ w_i u_i v_iᵀ the rule's q̇
// minimises ½|S q̇|² − ẋᵀJ q̇, so what limits leave of q̇ has ẋᵀJ q̇ ≥ ½|S q̇|² wherever they allow rest: the tool never
// moves away from the target. (Guptasarma et al., eq. 37, with limits and with any threshold.)
void weigh(const Spectrum& spectrum, const Resolution& resolution, TaskJacobian& rows) noexcept {
  rows.setZero(spectrum.rows(), spectrum.cols());
  for (int i = 0; i < spectrum.size(); ++i) {
    rows += resolution.weight[static_cast<std::size_t>(i)] * spectrum.u(i) * spectrum.v(i).transpose();
  }
}

}  // namespace

JointVector Servo::redistribute(const JointVector& qdot, const VelocityBounds& bounds, ServoStep& step) noexcept {
  const Spectrum& spectrum = solver_.spectrum();
  const Resolution& resolution = solver_.resolution();
  const double largest = spectrum.sigma(0);
  if (!has_exact()) {
    rows_.setZero(spectrum.size(), chain_.dof());
    for (int i = 0; i < spectrum.size(); ++i) {
      rows_.row(i) = resolution.weight[static_cast<std::size_t>(i)] * spectrum.v(i).transpose();
    }
    return nearest(qdot, rows_, rows_.lazyProduct(qdot), largest, qdot, bounds, step);
  }

  // First, the problem has the exact rows alone.
  TaskJacobian first;
  weigh(exact_spectrum_, exact_resolution_, first);
  const JointVector begin = nearest(qdot, first, first.lazyProduct(qdot), exact_spectrum_.sigma(0), qdot, bounds, step);

  // Then the problem has all rows, with so much weight on the exact rows that their part stays.
  weigh(spectrum, resolution, rows_);
  TaskVector goal = rows_.lazyProduct(qdot);
  int row = 0, exact_row = 0;
  for (std::size_t i = 0; i < 6; ++i) {
    if (options_.exact[i]) {
      rows_.row(row) = kExactWeight * first.row(exact_row++);
      goal[row] = rows_.row(row).dot(begin);
    }
    if (options_.task.mask[i]) ++row;
  }
  return nearest(begin, rows_, goal, largest, qdot, bounds, step);
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
  problem_.lower.setConstant(n + m, -std::numeric_limits<double>::infinity());
  problem_.upper.setConstant(n + m, std::numeric_limits<double>::infinity());
  std::uint32_t held = 0;
  JointVector qdot = begin;
  double weight = least;
  for (int pass = 0; pass < 2; ++pass) {
    problem_.C.rightCols(m).diagonal().setConstant(std::sqrt(weight));
    problem_.lower.head(n) = bounds.lower - qdot;
    problem_.upper.head(n) = bounds.upper - qdot;
    problem_.d = goal - rows.lazyProduct(qdot);
    const LeastSquaresSolution solution = least_squares_.solve(problem_);
    if (solution.status == LeastSquaresStatus::BadInput) {  // numbers too far apart
      return begin.cwiseMax(bounds.lower).cwiseMin(bounds.upper);
    }
    // Clamp exactly: one ulp outside, and the next cycle's bounds could be empty.
    const JointVector answer = (qdot + solution.x.head(n)).cwiseMax(bounds.lower).cwiseMin(bounds.upper);
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
