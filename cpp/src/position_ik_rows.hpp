#pragma once
// What counts of a pose error in position_ik.hpp: rows that are left out, ranges, a cone, and rows that are held before
// the others.

#include <array>
#include <cstdint>

#include <sigmaik/position_ik.hpp>

namespace sigmaik::detail {

using Row6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Errors y of the task's rows, in the task's axes; with a cone the last three are the rotation by which the tool's axis
// misses its direction, base axes. Rows that the task leaves out are zero.
struct RowErrors {
  Row6 y;
  Matrix6 rate;  // y changes by −rate·s in a motion by the twist s, base axes, at the tip
};

// The residual of a pose is
//
//     r = W (y − P(y)),    P: the projection onto the allowed errors, a box of ranges or the ball of a cone
//
// so that |r|² is zero inside the ranges, and has a continuous gradient, −2 rateᵀ W² (y − P(y)). W divides lengths by
// the characteristic length, and multiplies the rows that are held by a factor.
class PoseRows {
 public:
  // `hold`: the factor of the rows that are held before others.
  PoseRows(const PositionIkOptions& options, double length, double hold);

  // All six rows, no range, no cone, and none held before the others: the residual is the pose error itself.
  bool plain() const noexcept { return plain_; }
  const Task& task() const noexcept { return task_; }
  // The axis of the cone, tool axes; null: there is none.
  const Eigen::Vector3d* cone_axis() const noexcept { return cone_ ? &axis_ : nullptr; }
  // Some rows are held before the others.
  bool some_held() const noexcept { return some_held_; }
  // Number of rows in which a solution has no freedom.
  int equalities() const noexcept { return equalities_; }

  // y alone. `error`: pose_error from `tip` to `target`.
  Row6 errors(const Pose& tip, const Pose& target, const Twist& error) const noexcept;
  // y and its rate.
  RowErrors rates(const Pose& tip, const Pose& target, const Twist& error) const noexcept;
  // y − P(y).
  Row6 outside(const Row6& y) const noexcept;
  // W y.
  Row6 weighted(const Row6& y) const noexcept { return weight_.cwiseProduct(y); }
  // y − P(y) in the rows that are held, zero in the others.
  Row6 held(const Row6& y) const noexcept { return hold_.cwiseProduct(outside(y)); }
  // Derivatives of ½ |r|² with respect to a twist of the tip, base axes: minus the first, and the symmetric part of the
  // second. `shift` is added to y.
  Row6 force(const Pose& tip, const Pose& target, const Row6& shift) const noexcept;
  Matrix6 stiffness(const Pose& tip, const Pose& target, const Row6& shift) const noexcept;
  // The rows of a Jacobian in which a solution without ranges has no freedom, lengths divided by L.
  TaskJacobian jacobian(const Pose& tip, const Jacobian& rows) const noexcept;
  // The part of the error that counts, base axes.
  Twist counted(const Pose& tip, const Pose& target, const Twist& error) const noexcept;

  // Ends of the ranges at which a linear step keeps the rows: −1 the least, 1 the largest error, 0 none.
  struct Ends {
    std::array<std::int8_t, 6> box{};
    Eigen::Vector3d ball = Eigen::Vector3d::Zero();  // where y leaves the ball; zero: it does not
  };
  // The ends that y is beyond.
  Ends beyond(const Row6& y) const noexcept;
  // Adds the ends that the errors `next` after a step are beyond. Returns whether there were any.
  bool add_beyond(const Row6& next, Ends& ends) const noexcept;
  // W and the errors from the ends: residual r and matrix M with r − M s after the twist s.
  void linear(const RowErrors& errors, const Ends& ends, Row6& residual, Matrix6& matrix) const noexcept;

 private:
  Task task_;
  bool plain_, some_held_, cone_;
  int equalities_ = 0;
  double length_;
  Row6 lower_, upper_, weight_, hold_;
  Eigen::Vector3d axis_ = Eigen::Vector3d::Zero();
  double angle_ = 0.0;
};

}  // namespace sigmaik::detail
