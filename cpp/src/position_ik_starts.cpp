#include "position_ik_starts.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "numbers.hpp"
#include "quasi_random.hpp"

namespace sigmaik::detail {
namespace {

// The same arm with one turn, around the angle nearest to 0, of joints that may turn further: more turns would be the
// same poses again.
Chain within_one_turn(const DescentProblem& problem) {
  constexpr double kHalf = std::numbers::pi;
  JointLimits limits = problem.chain.limits();
  for (int i = 0; i < limits.lower.size(); ++i) {
    if ((problem.turning >> i & 1u) == 0 || std::isinf(limits.lower[i]) || std::isinf(limits.upper[i])) continue;
    const double middle = std::clamp(0.0, limits.lower[i] + kHalf,
                                     std::max(limits.upper[i] - kHalf, limits.lower[i] + kHalf));
    limits.lower[i] = middle - kHalf;
    limits.upper[i] = middle + kHalf;
  }
  return problem.chain.with_limits(limits);
}

// The one row of three that is not asked for, or −1.
int free_row(const Task& task, std::size_t first) {
  int row = -1, count = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    if (task.mask[first + i]) continue;
    row = static_cast<int>(i);
    ++count;
  }
  return count == 1 ? row : -1;
}

}  // namespace

StartTable::StartTable(const DescentProblem& problem)
    : rows_(problem.rows),
      length_(problem.length),
      configurations_(problem.chain.dof(), kEntries),
      features_(kEntries, kFeatures),
      squares_(kEntries) {
  const QuasiRandom spread(within_one_turn(problem));
  const JointLimits& limits = problem.chain.limits();
  for (int i = 0; i < kEntries; ++i) {
    const JointVector q = spread(i).cwiseMax(limits.lower).cwiseMin(limits.upper);
    configurations_.col(i) = q;
    features_.row(i) = features(pose(problem.chain, q)).transpose();
    squares_[i] = features_.row(i).squaredNorm();
  }
}

// Position over L; two columns of the rotation, whose squared differences are about the squared angle, or the axis
// about which the task leaves the rotation free.
StartTable::Features StartTable::features(const Pose& pose) const noexcept {
  Features out = Features::Zero();
  const Task& task = rows_.task();
  const bool tool = task.frame == Frame::Tool;
  const bool all_positions = task.mask[0] && task.mask[1] && task.mask[2];
  for (int i = 0; i < 3; ++i) {
    if (!task.mask[static_cast<std::size_t>(i)] || (tool && !all_positions)) continue;
    out[i] = static_cast<float>(pose.translation()[i] / length_);
  }
  if (const Eigen::Vector3d* const cone = rows_.cone_axis()) {
    out.segment<3>(3) = (pose.linear() * *cone).cast<float>();
  } else if (task.mask[3] && task.mask[4] && task.mask[5]) {
    const double part = std::sqrt(0.75);  // of |ΔR|² = 2 θ² in three columns, two have about 4/3 θ²
    out.segment<3>(3) = (part * pose.linear().col(0)).cast<float>();
    out.segment<3>(6) = (part * pose.linear().col(2)).cast<float>();
  } else if (const int row = free_row(task, 3); row >= 0) {
    const Eigen::Vector3d axis = tool ? Eigen::Vector3d(pose.linear().col(row))
                                      : Eigen::Vector3d(pose.linear().row(row));
    out.segment<3>(3) = axis.cast<float>();
  }
  return out;
}

void StartTable::measure(const Pose& target, Distances& distances) const noexcept {
  const Features wanted = features(target);
  distances = squares_;
  for (int k = 0; k < kFeatures; ++k) distances -= (2.0f * wanted[k]) * features_.col(k).array();
}

StartOrder::StartOrder(const StartTable& table, const Pose& target) noexcept { table.measure(target, distances_); }

int StartOrder::next() noexcept {
  if (at_ == kBlock) fill();
  return block_[static_cast<std::size_t>(at_++)];
}

// The kBlock smallest distances, by insertion: after the first few, hardly an entry passes the first comparison.
void StartOrder::fill() noexcept {
  std::array<float, kBlock> found;
  found.fill(static_cast<float>(kInfinity));
  block_.fill(0);
  for (int i = 0; i < StartTable::kEntries; ++i) {
    const float distance = distances_[i];
    if (!(distance < found[kBlock - 1])) continue;
    std::size_t k = kBlock - 1;
    for (; k > 0 && distance < found[k - 1]; --k) {
      found[k] = found[k - 1];
      block_[k] = block_[k - 1];
    }
    found[k] = distance;
    block_[k] = i;
  }
  for (const int entry : block_) distances_[entry] = static_cast<float>(kInfinity);
  at_ = 0;
}

}  // namespace sigmaik::detail
