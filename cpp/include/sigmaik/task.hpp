#pragma once
/// \file task.hpp
/// Which of the six rows of a twist are asked for, and in which axes.

#include <array>
#include <cstdint>

#include <sigmaik/layout.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik {

/// Axes that a task's rows are named in. The reference point is the tip's origin in both.
enum class Frame {
  Base,  ///< base axes
  Tool,  ///< the tip's own axes
};

/// Rows (vx, vy, vz, ωx, ωy, ωz) that matter. {{1,1,1,0,0,0}}: position only. {{1,1,1,1,1,0}, Frame::Tool}: free
/// rotation about the tool's z axis.
struct Task {
  std::array<bool, 6> mask{true, true, true, true, true, true};  ///< rows (vx, vy, vz, ωx, ωy, ωz) asked for
  Frame frame = Frame::Base;                                     ///< axes that the rows are named in

  /// Number of rows asked for.
  int rows() const noexcept;
  /// Whether all six rows are asked for.
  bool whole() const noexcept { return rows() == 6; }
  /// \throws Error where no row is asked for
  void validate() const;
};

/// The rows of `rows` (6×k) that the task asks for, in the task's axes. Real time.
/// \param rotation tip in base
TaskJacobian select_rows(const Task& task, const Eigen::Matrix3d& rotation, const Jacobian& rows) noexcept;

/// The same for a twist.
TaskVector select_rows(const Task& task, const Eigen::Matrix3d& rotation, const Twist& twist) noexcept;

/// Up to six twists, one a column.
using TwistColumns = Eigen::Matrix<double, 6, Eigen::Dynamic, kLayout, 6, kMaxTask>;

/// The twist, base axes, with these values in the rows of the task and zero in the others: the inverse of select_rows.
Twist expand_rows(const Task& task, const Eigen::Matrix3d& rotation, const TaskVector& values) noexcept;

SIGMAIK_SAME_LAYOUT(Task);

}  // namespace sigmaik
