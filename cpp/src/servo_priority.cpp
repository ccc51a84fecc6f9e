// Exact rows come first: the rule resolves them alone, and the other rows with the motion that leaves them as they are.
//
// Where the exact rows cannot be done, beyond the reach, all rows are resolved together. A strict priority has no
// continuous answer there: the direction v_i that the other rows must leave free is that of Jᵀu_i, which vanishes and
// turns at any speed, and the arm would shake.

#include <algorithm>
#include <cmath>

#include <sigmaik/servo.hpp>

#include "angular_rows.hpp"
#include "joint_weights.hpp"

namespace sigmaik {
namespace {

using detail::angular_rows;
using detail::weigh;

// How far a command is lost, in [0, 1]: 0 where a fifth of the command is left undone or less, 1 where four fifths or
// more.
double lost_part(const Spectrum& spectrum, const Resolution& resolution, const TaskVector& command) noexcept {
  constexpr double kMet = 0.2, kLost = 0.8;
  const double largest = command.cwiseAbs().maxCoeff();  // the squares in a norm overflow or vanish
  if (!(largest > 0.0)) return 0.0;
  const std::array<double, kMaxTask> parts = spectrum.along_u(TaskVector(command / largest));
  double left = 0.0, whole = 0.0;
  for (int i = 0; i < spectrum.rows(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double done = i < spectrum.size() ? spectrum.sigma(i) * (resolution.speed[at] / largest) : 0.0;
    left += (parts[at] - done) * (parts[at] - done);
    whole += parts[at] * parts[at];
  }
  return std::clamp((std::sqrt(left / whole) - kMet) / (kLost - kMet), 0.0, 1.0);
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

JointVector Servo::mixed(const JointVector& by_priority, const JointVector& together) const noexcept {
  return lost_ == 0.0 ? by_priority : lost_ == 1.0 ? together : (1.0 - lost_) * by_priority + lost_ * together;
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
  lost_ = lost_part(exact_spectrum_, exact_resolution_, command);
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
  if (weighs_joints()) {
    detail::WeightedDirections directions;
    directions.add(exact_spectrum_, exact_resolution_);
    if (rest_.rows() != 0) directions.add(rest_spectrum_, rest_resolution_);
    qdot = directions.prefer(qdot, posture, solver_.lightness());
  }
  solution.qdot = mixed(qdot, solution.qdot);
  solution.achieved_twist = state_.jacobian.lazyProduct(solution.qdot);
  if (!exact) solution.status = Status::Damped;
}

}  // namespace sigmaik
