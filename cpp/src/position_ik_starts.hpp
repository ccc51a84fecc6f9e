#pragma once
// The starts of position_ik.hpp: configurations spread over the joint ranges, in the order of their distance from a
// target.

#include <array>
#include <cstdint>

#include <Eigen/Core>

#include "position_ik_descent.hpp"

namespace sigmaik::detail {

// The table. An entry has features: numbers whose squared differences add up to a distance between poses, as far as the
// task asks for these poses.
class StartTable {
 public:
  static constexpr int kEntries = 2048;
  static constexpr int kFeatures = 9;

  explicit StartTable(const DescentProblem& problem);

  // The configuration of an entry.
  auto configuration(int entry) const noexcept { return configurations_.col(entry); }

  // Squared distances of the entries' poses from a pose, up to a constant.
  using Distances = Eigen::Array<float, kEntries, 1>;
  void measure(const Pose& target, Distances& distances) const noexcept;

 private:
  using Features = Eigen::Matrix<float, kFeatures, 1>;
  Features features(const Pose& pose) const noexcept;

  PoseRows rows_;
  double length_;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic> configurations_;  // (n, kEntries)
  Eigen::Matrix<float, Eigen::Dynamic, kFeatures> features_;              // (kEntries, ·)
  Eigen::Array<float, Eigen::Dynamic, 1> squares_;                        // |features|² of each entry
};

// The entries one after the other, the closest first. Most searches need only a few of them, so that the order is
// computed in blocks.
class StartOrder {
 public:
  StartOrder(const StartTable& table, const Pose& target) noexcept;

  // The next entry. There are StartTable::kEntries of them.
  int next() noexcept;

 private:
  static constexpr int kBlock = 16;
  void fill() noexcept;

  StartTable::Distances distances_;  // infinite for the entries that were given
  std::array<int, kBlock> block_;
  int at_ = kBlock;
};

}  // namespace sigmaik::detail
