#pragma once
// The descent of position_ik.hpp: from a configuration to a local minimum of the pose error, inside position limits.

#include <array>
#include <cstdint>

#include <sigmaik/chain.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/task.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik::detail {

using Row6 = Eigen::Matrix<double, 6, 1>;

// What the descents of one arm have in common.
struct DescentProblem {
  // `turns`: joints whose range is a whole turn or more have no limits in the search, because whole turns bring any
  // angle inside. Otherwise this is true of continuous joints alone.
  DescentProblem(const Chain& arm, const Task& rows, const std::array<double, 2>& tolerances, bool turns);

  Chain chain;
  Task task;
  bool whole = true;                // all six rows are asked for
  std::array<double, 2> tolerance;  // [m], [rad]
  double length;                    // L [m]
  JointVector lower, upper;         // limits of the search
  // Reach of a joint's step, squared: 1 rad, or L for a joint that slides. This keeps the steps independent of units.
  JointVector reach;
  std::uint32_t turning = 0;  // bit i: joint i turns, and has no limits in the search

  // Puts each joint on the turn within its limits that is nearest to `near`.
  void place(const JointRef& near, JointVector& q) const noexcept;
  // q − from, by the shorter way round for the joints that turn.
  JointVector difference(const JointVector& q, const JointVector& from) const noexcept;
};

// A configuration, and what is known there.
struct DescentPoint {
  JointVector q;
  ChainState state;
  Twist error;    // pose_error
  Row6 residual;  // the task's rows of the error, lengths divided by L, zero in the other rows
  double cost;    // E = |residual|²
};

// When a descent gives up.
struct Effort {
  int steps;          // at most
  double progress;    // a descent whose E falls by less than this factor in four steps is given up
  bool always_lower;  // every step must make E smaller; otherwise smaller than one of the last three is enough
  bool curved;        // steps with the second derivatives of the pose: slower, for singular and unreachable targets
};

// A local search for one target.
class Descent {
 public:
  Descent(const DescentProblem& problem, const Pose& target) noexcept : problem_(problem), target_(target) {}

  // Computes everything of a point from its q.
  void evaluate(DescentPoint& point) const noexcept;

  // Whether the errors are inside the tolerance.
  bool reached(const DescentPoint& point) const noexcept;

  // Goes down from point.q, which must be inside the limits, and evaluates `point` there. Returns reached(point).
  bool run(DescentPoint& point, const Effort& effort) const noexcept;

  // One step that keeps the error and takes q by `wish`, as far as the self-motion allows, with few joints' motion
  // where inverse_weight is small. The new configuration is inside the limits, and is not evaluated.
  JointVector self_motion(const DescentPoint& point, const JointVector& wish,
                          const JointVector& inverse_weight) const noexcept;

  // Columns of the residual's derivative, with the opposite sign: residual(q + Δq) ≈ residual − J Δq.
  using Columns = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, kMaxJoints>;
  void derivative(const DescentPoint& point, Columns& columns) const noexcept;

  const DescentProblem& problem() const noexcept { return problem_; }

 private:
  JointVector step(const DescentPoint& point, double damping, const JointVector* wish,
                   const JointVector& inverse_weight, double& expected) const noexcept;
  JointVector curved_step(const DescentPoint& point, double damping, double& expected) const noexcept;
  void polish(DescentPoint& point) const noexcept;

  const DescentProblem& problem_;
  const Pose target_;
};

}  // namespace sigmaik::detail
