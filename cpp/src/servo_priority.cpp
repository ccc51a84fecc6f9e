// Exact rows come first: the rule resolves them alone, and the other rows with the motion that leaves them as they are.

#include <sigmaik/servo.hpp>

#include "angular_rows.hpp"

namespace sigmaik {
namespace {

using detail::angular_rows;

// Multiplies the angular rows by the length scale.
template <typename Rows>
void weigh(const Task& task, double length_scale, Rows& rows) noexcept {
  const std::uint8_t angular = angular_rows(task);
  for (int row = 0; row < rows.rows(); ++row) {
    if ((angular >> row & 1u) != 0) rows.row(row) *= length_scale;
  }
}

// x without its part Σ p_i v_i v_iᵀ x.
JointVector rest_of(const JointVector& x, const Spectrum& spectrum, const Resolution& resolution) noexcept {
  std::array<double, kMaxTask> along = spectrum.along_v(x);
  for (std::size_t i = 0; i < along.size(); ++i) along[i] *= resolution.projector[i];
  return x - spectrum.combine_v(along);
}

}  // namespace

TaskJacobian Servo::weighted_rows(const Task& task) const noexcept {
  TaskJacobian rows = select_rows(task, state_.tip.linear(), state_.jacobian);
  weigh(task, solver_.length_scale(), rows);
  return rows;
}

void Servo::prioritize(const Twist& twist, const JointVector& posture, Solution& solution) noexcept {
  const Eigen::Matrix3d& rotation = state_.tip.linear();
  TaskVector command = select_rows(exact_, rotation, twist);
  weigh(exact_, solver_.length_scale(), command);
  Pace pace = solver_.pace();
  pace.largest = solver_.spectrum().sigma(0);
  exact_spectrum_.decompose(weighted_rows(exact_));
  exact_resolution_ = sigmaik::resolve(solver_.method(), exact_spectrum_, command, angular_rows(exact_), pace);
  JointVector qdot = exact_spectrum_.combine_v(exact_resolution_.speed);
  bool exact = exact_resolution_.exact;
  JointVector free = posture;
  if (posture.size() != 0) free = rest_of(posture, exact_spectrum_, exact_resolution_);
  if (rest_.rows() != 0) {
    TaskJacobian rows = weighted_rows(rest_);
    TaskVector missed = select_rows(rest_, rotation, twist);
    weigh(rest_, solver_.length_scale(), missed);
    missed -= rows.lazyProduct(qdot);
    for (int row = 0; row < rows.rows(); ++row) {
      rows.row(row) = rest_of(JointVector(rows.row(row).transpose()), exact_spectrum_, exact_resolution_).transpose();
    }
    rest_spectrum_.decompose(rows);
    rest_resolution_ = sigmaik::resolve(solver_.method(), rest_spectrum_, missed, angular_rows(rest_), pace);
    qdot += rest_spectrum_.combine_v(rest_resolution_.speed);
    exact = exact && rest_resolution_.exact;
    if (posture.size() != 0) free = rest_of(free, rest_spectrum_, rest_resolution_);
  }
  if (posture.size() != 0) qdot += free;
  solution.qdot = qdot;
  solution.achieved_twist = state_.jacobian.lazyProduct(qdot);
  if (!exact) solution.status = Status::Damped;
}

}  // namespace sigmaik
