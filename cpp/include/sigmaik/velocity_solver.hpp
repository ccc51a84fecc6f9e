#pragma once
/// \file velocity_solver.hpp
/// A rule and a posture: twist in, joint velocities out.

#include <cstdint>

#include <sigmaik/layout.hpp>
#include <sigmaik/rules.hpp>
#include <sigmaik/spectrum.hpp>
#include <sigmaik/status.hpp>
#include <sigmaik/task.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik {

/// Answer of VelocitySolver::solve(). By value, no heap.
struct Solution {
  JointVector qdot;                  ///< (n,) [rad/s or m/s]
  Status status = Status::BadInput;  ///< Ok, Damped or BadInput
  TaskVector singular_values;        ///< (min(m,n),) from large to small, of the weighted task Jacobian
  TaskVector achieved_twist;         ///< (m,) J q̇, in the rows of the J that came in
  TaskMatrix directions;             ///< (m', m') columns u_i in the task's rows, angular ones times length_scale
  std::uint8_t singular = 0;         ///< bit i: direction i is singular to the rule
  /// Number of singular directions.
  int singular_count() const noexcept;
};

/// Resolves twists at given Jacobians by one method. A solver keeps only the last decomposition, as a warm start.
class VelocitySolver {
 public:
  /// \param length_scale [m] > 0: 1 rad/s weighs as much as length_scale m/s. Singular values of a Jacobian that mixes
  ///     lengths and angles have no meaning without it; with length_scale in proportion to the arm, the same arm in
  ///     other units behaves the same.
  /// \throws Error where a parameter is out of its range
  explicit VelocitySolver(const Method& method, double length_scale = 1.0, const Task& task = {});

  /// Real time.
  ///
  /// \param jacobian m×n, 1 ≤ m ≤ 6, 1 ≤ n ≤ 16. If J has six rows, the task's mask and frame apply. If J has as many
  ///     rows as the mask, its rows count as masked already. Any other m needs a task that asks for all rows; rows from
  ///     the fourth on then count as angular.
  /// \param twist (m,) [m/s, rad/s]
  /// \param posture (n,) q̇_posture [rad/s or m/s]; empty: none
  /// \param rotation tip in base; used where the task is in tool axes
  Solution solve(const TaskJacobianRef& jacobian, const TaskRef& twist, const JointRef& posture = JointVector(),
                 const Eigen::Matrix3d& rotation = Eigen::Matrix3d::Identity()) noexcept;

  /// Forgets the warm start: the next answer does not depend on the calls before it.
  void reset() noexcept { spectrum_ = Spectrum{}; }

  /// How fast the arm can go, for rules whose threshold grows with the command (JParse::adaptive). Without a pace these
  /// rules have their published thresholds.
  /// \throws Error where an entry is negative or not finite
  void set_pace(const Pace& pace);

  /// How much the motion of each joint counts, where there are more joints than rows: of all motions that move the tip
  /// as the rule says, the answer has the least Σ w_j (q̇_j − q̇_posture,j)². Only ratios of weights matter. Singular
  /// values, thresholds and status are those without weights, which say nothing of how hard the arm is to move.
  /// Jacobians of another number of joints are solved without weights.
  /// \param weights (n,) > 0, finite, at most 1e6 apart; empty: all 1
  /// \throws Error where an entry is out of its range
  void set_joint_weights(const JointRef& weights);

  /// Changes the rule; the warm start stays.
  /// \throws Error where a parameter is out of its range
  void set_method(const Method& method);

  /// The rule.
  const Method& method() const noexcept { return method_; }
  /// [m], the length that weighs as much as one radian.
  double length_scale() const noexcept { return length_scale_; }
  /// The rows asked for, and their axes.
  const Task& task() const noexcept { return task_; }
  /// Decomposition of the last solve().
  const Spectrum& spectrum() const noexcept { return spectrum_; }
  /// What the rule said of each direction of spectrum() in the last solve().
  const Resolution& resolution() const noexcept { return resolution_; }
  /// (n,) min_j w_j / w_j of the joint weights, in (0, 1]; empty: there are none.
  const JointVector& lightness() const noexcept { return lightness_; }
  /// As given to set_pace().
  const Pace& pace() const noexcept { return pace_; }

 private:
  friend struct detail::Members<VelocitySolver>;
  // The arguments of solve(), and their meaning for the task.
  struct Question {
    const TaskJacobianRef& jacobian;
    const TaskRef& twist;
    const JointRef& posture;
    const Eigen::Matrix3d& rotation;
    std::uint8_t angular;  // bit i: row i of the task is angular
    bool select;           // the task's rows have to be taken from six
  };
  bool selects(const TaskJacobianRef& jacobian) const noexcept;
  // Whether sizes fit and every number is finite.
  bool checked(const TaskJacobianRef& jacobian, const TaskRef& twist, const JointRef& posture,
               const Eigen::Matrix3d& rotation) const noexcept;
  // Decomposes the task's rows, angular ones times length_scale; `command` becomes the twist in these rows. false where
  // a number overflows.
  bool weighted(const Question& question, TaskVector& command) noexcept;
  Solution answer(const Question& question, const TaskVector& command) const noexcept;
  // Whether the answer misses at most `tolerance` of the command, in the task's weighted rows.
  bool exact(const Question& question, const TaskVector& achieved, double tolerance) const noexcept;

  Method method_;
  double length_scale_;
  Task task_;
  Pace pace_;
  JointVector lightness_;
  Spectrum spectrum_;
  Resolution resolution_;
};

SIGMAIK_SAME_LAYOUT(VelocitySolver, Method, Solution);

}  // namespace sigmaik
