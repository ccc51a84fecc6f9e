#pragma once
/// \file distance_field.hpp
/// Signed distances to obstacles on a regular grid, with their gradient anywhere.

#include <array>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include <sigmaik/layout.hpp>

namespace sigmaik::planning {

/// Signed distance to the nearest surface [m]: positive in free space, negative inside obstacles. A value: cheap to
/// copy (copies share one immutable grid), safe to use from many threads.
///
/// Inside the grid the nodes' distances are interpolated trilinearly: the result is continuous, with a gradient that
/// jumps at the cells' faces. Distances change by no more than 1 m per metre, so an interpolated distance is wrong by
/// at most √3/2 cells.
///
/// Outside the grid the field is a lower bound of the distance to every obstacle within the grid: with p̄ the nearest
/// point of the grid's box, and D the distance there, |p − o|² ≥ |p − p̄|² + |p̄ − o|² for every point o of a convex box,
/// so that
///
///     d(p) = √(D(p̄)² + |p − p̄|²)   where D ≥ 0,   D(p̄) + |p − p̄|   where an obstacle is cut off by the grid:
///
/// This bound is continuous, and grows with the distance from the box.
class DistanceField {
 public:
  /// Nodes along each axis.
  using Shape = std::array<int, 3>;

  /// \param distances [m], nodes in C order (z fastest), finite
  /// \param shape at least 2 nodes along each axis
  /// \param origin [m] of node (0, 0, 0), in the axes of the arm's base
  /// \param cell [m] > 0, from node to node
  /// \throws Error where a number is out of its range or sizes do not fit
  DistanceField(const std::vector<double>& distances, const Shape& shape, const Eigen::Vector3d& origin, double cell);

  /// Number of nodes along x, y, z.
  const Shape& shape() const noexcept { return shape_; }
  /// Position of the first node [m], (3,).
  const Eigen::Vector3d& origin() const noexcept { return origin_; }
  /// Distance between neighbouring nodes [m].
  double cell() const noexcept { return cell_; }

  /// The distance at a point [m]. Real time.
  double distance(const Eigen::Vector3d& point) const noexcept;
  /// The same, with its gradient. Real time.
  double distance(const Eigen::Vector3d& point, Eigen::Vector3d& gradient) const noexcept;

 private:
  struct Corner;
  Corner locate(const Eigen::Vector3d& point) const noexcept;

  Shape shape_;
  Eigen::Vector3d origin_, last_;  // of the first node, and of the last in cells from it
  double cell_, inverse_cell_;
  std::shared_ptr<const std::vector<float>> nodes_;  // far more exact than the interpolation, in half the memory
};

SIGMAIK_SAME_LAYOUT(DistanceField);

}  // namespace sigmaik::planning
