#pragma once
// The descent of position_ik.hpp: from a configuration to a local minimum of the pose error, inside position limits.

#include <array>
#include <cstdint>

#include <sigmaik/chain.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/position_ik.hpp>
#include <sigmaik/types.hpp>

#include "position_ik_rows.hpp"

namespace sigmaik::detail {

// What the descents of one arm have in common.
struct DescentProblem {
  // `turns`: joints whose range is a whole turn or more have no limits in the search, because whole turns bring any
  // angle inside. Otherwise this is true of continuous joints alone.
  DescentProblem(const Chain& arm, const PositionIkOptions& options, bool turns, double hold = 30.0);

  Chain chain;
  double length;  // L [m]
  PoseRows rows;
  std::array<double, 2> tolerance;  // [m], [rad]
  JointVector lower, upper;         // limits of the search
  // Reach of a joint's step, squared: 1 rad, or L for a joint that slides. This keeps the steps independent of units.
  JointVector reach;
  std::uint32_t turning = 0;  // bit i: joint i turns, and has no limits in the search

  // Whether errors of the rows are inside the tolerance.
  bool tolerates(const Row6& miss) const noexcept {
    return miss.head<3>().norm() <= tolerance[0] && miss.tail<3>().norm() <= tolerance[1];
  }
  // Puts each joint on the turn within its limits that is nearest to `near`, or else onto a limit. Returns whether the
  // limits hold then but for `rounding` [rad or m]; rounding beyond a limit is no reason for a turn.
  bool place(const JointRef& near, JointVector& q, double rounding = 1e-10) const noexcept;
  // q − from, by the shorter way round for the joints that turn.
  JointVector difference(const JointVector& q, const JointVector& from) const noexcept;
};

// A configuration, and what is known there.
struct DescentPoint {
  JointVector q;
  ChainState state;
  Twist error;    // pose_error
  Row6 rows;      // errors of the task's rows, with the descent's shift; of a plain problem not used
  Row6 residual;  // of `rows`: see PoseRows
  double cost;    // E = |residual|²
};

// When a descent gives up.
struct Effort {
  int steps;          // at most
  double progress;    // a descent whose E falls by less than this factor in four steps is given up; ≥ 1: none is
  bool always_lower;  // every step must make E smaller; otherwise smaller than one of the last three is enough
  bool curved;        // steps with the second derivatives of the pose: slower, for singular and unreachable targets
};

// A local search for one target. `shift` is added to the errors of the rows: multipliers over weights, for rows that
// are held before the others. A point of a descent with a shift is never a solution.
class Descent {
 public:
  Descent(const DescentProblem& problem, const Pose& target) noexcept : Descent(problem, target, Row6::Zero()) {}
  Descent(const DescentProblem& problem, const Pose& target, const Row6& shift) noexcept
      : problem_(problem), target_(target), shift_(shift), shifted_(!shift.isZero(0.0)) {}

  // Computes everything of a point from its q.
  void evaluate(DescentPoint& point) const noexcept;

  // Whether the errors are inside the tolerance.
  bool reached(const DescentPoint& point) const noexcept;

  // The same of the rows that are held before the others.
  bool reached_held(const DescentPoint& point) const noexcept;

  // Goes down from point.q, which must be inside the limits, and evaluates `point` there. Returns reached(point).
  bool run(DescentPoint& point, const Effort& effort) const noexcept;

  // One step that keeps the error and takes q by `wish`, as far as the self-motion allows, with few joints' motion
  // where inverse_weight is small. The new configuration is inside the limits, and is not evaluated.
  JointVector self_motion(const DescentPoint& point, const JointVector& wish,
                          const JointVector& inverse_weight) const noexcept;

  // The part of the error that counts, base axes.
  Twist counted(const DescentPoint& point) const noexcept {
    return problem_.rows.counted(point.state.tip, target_, point.error);
  }

  const Pose& target() const noexcept { return target_; }
  const DescentProblem& problem() const noexcept { return problem_; }

 private:
  // Columns of the residual's derivative, with the opposite sign: residual(q + Δq) ≈ residual − J Δq.
  using Columns = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, kMaxJoints>;

  JointVector step(const DescentPoint& point, double damping, const JointVector* wish,
                   const JointVector& inverse_weight, double& expected) const noexcept;
  JointVector bounded_step(const JointVector& q, const Columns& columns, const Row6& residual, double damping,
                           const JointVector* wish, const JointVector& inverse_weight, double& expected) const noexcept;
  JointVector curved_step(const DescentPoint& point, double damping, double& expected) const noexcept;
  void polish(DescentPoint& point) const noexcept;

  const DescentProblem& problem_;
  const Pose target_;
  const Row6 shift_;
  const bool shifted_;
};

}  // namespace sigmaik::detail
