#include <sigmaik/planning/play.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <sigmaik/kinematics.hpp>
#include <sigmaik/pose.hpp>

#include "../message.hpp"
#include "samples.hpp"

namespace sigmaik::planning {
namespace {

using detail::joints;
using sigmaik::detail::require;

// Six significant digits are enough to tell a reader where an arm stands.
std::string short_number(double value) {
  char out[32];
  std::snprintf(out, sizeof out, "%.6g", value);
  return out;
}

void require_at_start(const Servo& servo, const std::vector<double>& planned) {
  constexpr double kAtStart = 1e-6;  // [rad or m]
  require(servo.q().size() > 0, "the servo has no start: call reset(q) first");
  const auto first = joints(planned, 0, static_cast<std::size_t>(servo.chain().dof()));
  Eigen::Index joint = 0;
  const double off = (servo.q() - first).cwiseAbs().maxCoeff(&joint);
  require(off <= kAtStart, "the servo stands at ", short_number(servo.q()[joint]), " in joint ",
          servo.chain().joint_names()[static_cast<std::size_t>(joint)], ", the trajectory begins at ",
          short_number(first[joint]), ": reset the servo there, or plan from where it stands");
}

double largest_norm(const std::vector<double>& errors, std::size_t first) noexcept {
  double out = 0.0;
  for (std::size_t k = 0; k + 6 <= errors.size(); k += 6) {
    out = std::max(out, Eigen::Map<const Eigen::Vector3d>(errors.data() + k + first).norm());
  }
  return out;
}

}  // namespace

double Playback::max_position_error() const noexcept { return largest_norm(pose_error, 0); }
double Playback::max_orientation_error() const noexcept { return largest_norm(pose_error, 3); }
double Playback::max_joint_difference() const noexcept {
  double out = 0.0;
  for (std::size_t i = 0; i < q.size(); ++i) out = std::max(out, std::abs(planned[i] - q[i]));
  return out;
}

Playback play(const Trajectory& trajectory, Servo& servo, double settle) {
  const Chain& chain = servo.chain();
  const double dt = servo.options().dt;
  const auto n = static_cast<std::size_t>(chain.dof());
  require(trajectory.dof == chain.dof(), "the trajectory has ", trajectory.dof, " joints, the servo's arm ",
          chain.dof(), " joints");
  require(settle >= 0.0 && std::isfinite(settle), "settle = ", settle, " must be finite and not negative");
  require(!trajectory.t.empty(), "this trajectory is empty: its plan ", to_string(trajectory.status));
  const double begin = trajectory.t.front(), end = trajectory.t.back();
  const auto cycles = static_cast<std::size_t>(std::max(1.0, std::ceil((end - begin + settle) / dt - 1e-9)));

  Playback out;
  out.dof = chain.dof();
  std::vector<double> middle(cycles);
  for (std::size_t k = 0; k <= cycles; ++k) out.t.push_back(begin + dt * static_cast<double>(k));
  for (std::size_t k = 0; k < cycles; ++k) middle[k] = out.t[k] + 0.5 * dt;
  out.planned = trajectory.sample(out.t).q;
  require_at_start(servo, out.planned);
  const JointSamples between = trajectory.sample(middle);

  const auto add = [](std::vector<double>& rows, const auto& row) {
    rows.insert(rows.end(), row.data(), row.data() + row.size());
  };
  ChainState state;
  add(out.q, servo.q());
  for (std::size_t k = 0; k < cycles; ++k) {
    Twist twist = Twist::Zero();  // the end is held, even where a trajectory ends in motion
    if (middle[k] <= end) {
      update(chain, joints(between.q, k, n), state);
      twist = state.jacobian * joints(between.qdot, k, n);
    }
    const ServoStep step = servo.update(pose(chain, joints(out.planned, k, n)), twist);
    add(out.q, step.q);
    add(out.qdot, step.qdot);
    add(out.pose_error, step.pose_error);
    out.status.push_back(step.status);
  }
  add(out.qdot, servo.qdot());
  add(out.pose_error, pose_error(servo.tip(), pose(chain, joints(out.planned, cycles, n))));
  return out;
}

}  // namespace sigmaik::planning
