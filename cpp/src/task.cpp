#include <sigmaik/task.hpp>

#include <algorithm>

#include "message.hpp"

namespace sigmaik {
namespace {

// Copies the rows of the mask, turned into tool axes first where the task wants them.
template <typename In, typename Out>
void select(const Task& task, const Eigen::Matrix3d& rotation, const In& in, Out& out) noexcept {
  int row = 0;
  for (int i = 0; i < 6; ++i) {
    if (!task.mask[static_cast<std::size_t>(i)]) continue;
    if (task.frame == Frame::Base) {
      out.row(row++) = in.row(i);
    } else {
      const int block = i < 3 ? 0 : 3;
      out.row(row++) = rotation.col(i - block).transpose() * in.template middleRows<3>(block);
    }
  }
}

}  // namespace

int Task::rows() const noexcept { return static_cast<int>(std::count(mask.begin(), mask.end(), true)); }

void Task::validate() const { detail::require(rows() > 0, "the task's mask asks for no row at all"); }

TaskJacobian select_rows(const Task& task, const Eigen::Matrix3d& rotation, const Jacobian& rows) noexcept {
  TaskJacobian out(task.rows(), rows.cols());
  select(task, rotation, rows, out);
  return out;
}

TaskVector select_rows(const Task& task, const Eigen::Matrix3d& rotation, const Twist& twist) noexcept {
  TaskVector out(task.rows());
  select(task, rotation, twist, out);
  return out;
}

Twist expand_rows(const Task& task, const Eigen::Matrix3d& rotation, const TaskVector& values) noexcept {
  Twist out = Twist::Zero();
  int row = 0;
  for (int i = 0; i < 6; ++i) {
    if (!task.mask[static_cast<std::size_t>(i)]) continue;
    if (task.frame == Frame::Base) {
      out[i] = values[row++];
    } else {
      const int block = i < 3 ? 0 : 3;
      out.segment<3>(block) += values[row++] * rotation.col(i - block);
    }
  }
  return out;
}

}  // namespace sigmaik
