#pragma once
// Which rows of a task are angular, and their weight.

#include <cstdint>

#include <sigmaik/task.hpp>

namespace sigmaik::detail {

// Bit i: row i of the task is angular.
inline std::uint8_t angular_rows(const Task& task) noexcept {
  if (task.whole()) return 0b111000;
  std::uint8_t angular = 0;
  int row = 0;
  for (unsigned i = 0; i < 6; ++i) {
    if (!task.mask[i]) continue;
    if (i >= 3) angular |= static_cast<std::uint8_t>(1u << row);
    ++row;
  }
  return angular;
}

// Multiplies the angular rows by the length scale.
template <typename Rows>
void weigh(const Task& task, double length_scale, Rows& rows) noexcept {
  const std::uint8_t angular = angular_rows(task);
  for (int row = 0; row < rows.rows(); ++row) {
    if ((angular >> row & 1u) != 0) rows.row(row) *= length_scale;
  }
}

}  // namespace sigmaik::detail
