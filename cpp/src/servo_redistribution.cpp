// OnLimit::Redistribute: inside the bounds, the joint velocities whose twist is nearest to that of the rule's answer.

#include <algorithm>
#include <limits>

#include <sigmaik/servo.hpp>

namespace sigmaik {
namespace {

// Weight of joint motion against twist, as a part of σ_max. The weight bounds how fast joints move to make up for
// little twist where the remaining joints come to a singularity of their own: with a hundredth of this weight the arm
// swings.
constexpr double kJointWeight = 1e-2;
// With this weight λ, the twist of a direction with σ_i misses (λ/σ_i)² of itself; after a second pass from the answer,
// the square of this part.
constexpr int kPasses = 2;
// Weight of the exact rows against the other rows.
constexpr double kExactWeight = 1e3;

// Σ w_i u_i v_iᵀ, w_i = max(σ_i, threshold σ_max): how much each direction counts. With S = Σ w_i u_i v_iᵀ, J-PARSE's q̇
// (K = I, no posture) minimises ½|S q̇|² − ẋᵀJ q̇, so what limits leave of q̇ has ẋᵀJ q̇ ≥ ½|S q̇|² wherever they allow
// rest: the tool never moves away from the target. (Guptasarma et al., eq. 37, with limits.)
double weight(const Spectrum& spectrum, int i, double threshold) noexcept {
  return std::max(spectrum.sigma(i), threshold * spectrum.sigma(0));
}

void weigh(const Spectrum& spectrum, double threshold, TaskJacobian& rows) noexcept {
  rows.setZero(spectrum.rows(), spectrum.cols());
  for (int i = 0; i < spectrum.size(); ++i) {
    rows += weight(spectrum, i, threshold) * spectrum.u(i) * spectrum.v(i).transpose();
  }
}

}  // namespace

JointVector Servo::redistribute(const JointVector& qdot, const VelocityBounds& bounds, ServoStep& step) noexcept {
  const Spectrum& spectrum = solver_.spectrum();
  const double largest = spectrum.sigma(0), regular = relative_threshold(solver_.method());
  if (options_.exact == std::array<bool, 6>{}) {
    rows_.setZero(spectrum.size(), chain_.dof());
    for (int i = 0; i < spectrum.size(); ++i) {
      rows_.row(i) = weight(spectrum, i, regular) * spectrum.v(i).transpose();
    }
    return nearest(qdot, rows_, rows_.lazyProduct(qdot), largest, qdot, bounds, step);
  }

  // First, the problem has the exact rows alone.
  const TaskJacobian first = exact_rows(regular);
  const JointVector begin = nearest(qdot, first, first.lazyProduct(qdot), exact_spectrum_.sigma(0), qdot, bounds, step);

  // Then the problem has all rows, with so much weight on the exact rows that their part stays.
  weigh(spectrum, regular, rows_);
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

// The exact rows of the Jacobian, which have singularities of their own, with the weights of their own spectrum.
TaskJacobian Servo::exact_rows(double regular) noexcept {
  TaskJacobian rows = select_rows(exact_, state_.tip.linear(), state_.jacobian);
  int at = 0;
  for (std::size_t i = 0; i < 6; ++i) {
    if (!options_.exact[i]) continue;
    if (i >= 3) rows.row(at) *= options_.length_scale;
    ++at;
  }
  exact_spectrum_.decompose(rows);
  weigh(exact_spectrum_, regular, rows);
  return rows;
}

// Minimises |rows q̇ − goal|² + λ² |q̇ − begin|² inside the bounds, then once more with the answer in place of `begin`.
JointVector Servo::nearest(const JointVector& begin, const TaskJacobian& rows, const TaskVector& goal, double largest,
                           const JointVector& asked, const VelocityBounds& bounds, ServoStep& step) noexcept {
  // In x = q̇ − begin and a slack s for the twist still missed: min |x|² + |s|² where rows x + λ s = missed. This form
  // is one level of least squares, and does not square the rows.
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
    // Clamp exactly: one ulp outside, and the next cycle's bounds could be empty.
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
