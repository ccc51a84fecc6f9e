#include <sigmaik/planning/distance_field.hpp>

#include <algorithm>
#include <cmath>

#include "../message.hpp"

namespace sigmaik::planning {

using sigmaik::detail::require;

// The cell of a point, and where the point is in it.
struct DistanceField::Corner {
  const float* node;         // with the smallest indices
  std::ptrdiff_t x, y;       // to the next along x and y; along z it is 1
  Eigen::Vector3d fraction;  // 0 … 1
  Eigen::Vector3d beyond;    // [m] from the grid's box to the point, zero inside
};

DistanceField::DistanceField(const std::vector<double>& distances, const Shape& shape, const Eigen::Vector3d& origin,
                             double cell)
    : shape_(shape), origin_(origin), cell_(cell), inverse_cell_(1.0 / cell) {
  require(std::isfinite(cell) && cell > 0.0, "cell = ", cell, " m must be finite and greater than 0");
  require(origin.allFinite(), "origin = (", origin.transpose(), ") is not finite");
  std::size_t count = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const int length = shape[static_cast<std::size_t>(axis)];
    require(length >= 2, "the grid has ", length, " nodes along axis ", axis, "; at least 2 are needed");
    count *= static_cast<std::size_t>(length);
    last_[axis] = length - 1.0;
  }
  require(distances.size() == count, "there are ", distances.size(), " distances for a grid of ", shape[0], "×",
          shape[1], "×", shape[2], " = ", count, " nodes");
  const auto bad = std::find_if(distances.begin(), distances.end(), [](double d) { return !(std::abs(d) < 1e30); });
  require(bad == distances.end(), "distance ", bad - distances.begin(), " is not finite");
  nodes_ = std::make_shared<const std::vector<float>>(distances.begin(), distances.end());
}

DistanceField::Corner DistanceField::locate(const Eigen::Vector3d& point) const noexcept {
  Corner corner;
  std::array<std::ptrdiff_t, 3> index;
  for (int axis = 0; axis < 3; ++axis) {
    const double cells = (point[axis] - origin_[axis]) * inverse_cell_;
    const double inside = cells > 0.0 ? std::min(cells, last_[axis]) : 0.0;  // NaN becomes 0: its cell exists
    const int first = std::min(static_cast<int>(inside), shape_[static_cast<std::size_t>(axis)] - 2);
    index[static_cast<std::size_t>(axis)] = first;
    corner.fraction[axis] = inside - first;
    corner.beyond[axis] = (cells - inside) * cell_;
  }
  corner.y = shape_[2];
  corner.x = corner.y * shape_[1];
  corner.node = nodes_->data() + index[0] * corner.x + index[1] * corner.y + index[2];
  return corner;
}

double DistanceField::distance(const Eigen::Vector3d& point) const noexcept {
  const Corner c = locate(point);
  const double x = c.fraction[0], y = c.fraction[1], z = c.fraction[2];
  const auto along_z = [z](const float* n) { return n[0] + z * (static_cast<double>(n[1]) - n[0]); };
  const auto along_y = [&](const float* n) {
    const double low = along_z(n);
    return low + y * (along_z(n + c.y) - low);
  };
  const double low = along_y(c.node), inside = low + x * (along_y(c.node + c.x) - low);
  const double way = c.beyond.squaredNorm();
  if (way == 0.0) return inside;
  return inside > 0.0 ? std::sqrt(inside * inside + way) : inside + std::sqrt(way);
}

double DistanceField::distance(const Eigen::Vector3d& point, Eigen::Vector3d& gradient) const noexcept {
  const Corner c = locate(point);
  const double x = c.fraction[0], y = c.fraction[1], z = c.fraction[2];
  // n_ab: the node at the near (0) or far (1) side of x and y; first interpolated along z, then y, then x.
  const float *n00 = c.node, *n01 = n00 + c.y, *n10 = n00 + c.x, *n11 = n10 + c.y;
  const double s00 = static_cast<double>(n00[1]) - n00[0], s01 = static_cast<double>(n01[1]) - n01[0];
  const double s10 = static_cast<double>(n10[1]) - n10[0], s11 = static_cast<double>(n11[1]) - n11[0];
  const double v00 = n00[0] + z * s00, v01 = n01[0] + z * s01, v10 = n10[0] + z * s10, v11 = n11[0] + z * s11;
  const double low = v00 + y * (v01 - v00), high = v10 + y * (v11 - v10), inside = low + x * (high - low);
  const double slope_z = (1.0 - x) * (s00 + y * (s01 - s00)) + x * (s10 + y * (s11 - s10));
  gradient << high - low, (1.0 - x) * (v01 - v00) + x * (v11 - v10), slope_z;
  gradient *= inverse_cell_;
  const double way = c.beyond.squaredNorm();
  if (way == 0.0) return inside;
  for (int axis = 0; axis < 3; ++axis) {
    if (c.beyond[axis] != 0.0) gradient[axis] = 0.0;  // the nearest point of the box does not move
  }
  if (inside > 0.0) {
    const double distance = std::sqrt(inside * inside + way);
    gradient = (inside * gradient + c.beyond) / distance;
    return distance;
  }
  const double out = std::sqrt(way);
  gradient += c.beyond / out;
  return inside + out;
}

}  // namespace sigmaik::planning
