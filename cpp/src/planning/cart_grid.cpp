#include "cart_grid.hpp"
#include "../numbers.hpp"

#include <algorithm>
#include <cmath>

namespace sigmaik::planning {
namespace detail {
namespace {

using sigmaik::detail::kInfinity;
constexpr double kPi = 3.14159265358979323846;
constexpr double kNear = 1e-6;  // [samples] least distance of a tip from the samples beside it
constexpr int kLeap = 16;       // points inside a region that lies between two samples

}  // namespace

Grid make_grid(const PlanarPath& path, double r) {
  const int m = static_cast<int>(path.rows());
  Grid g;
  g.at.reserve(static_cast<std::size_t>(m + kLeap));
  g.points.reserve(static_cast<std::size_t>(m + kLeap));
  bool open = false;  // the last point is in the last extent, which may go on
  const auto add = [&](double at, double px, double py, double h) {
    const int k = static_cast<int>(g.at.size());
    g.at.push_back(at);
    g.points.push_back({px, py, h >= 0.0 ? px - h : kInfinity, h >= 0.0 ? px + h : -kInfinity});
    if (h < 0.0) {
      open = false;
      return;
    }
    if (!open) g.extents.push_back({k, k, kInfinity, -kInfinity, 0});
    open = true;
    Extent& e = g.extents.back();
    e.last = k;
    e.low = std::min(e.low, px - h);
    e.high = std::max(e.high, px + h);
    const bool from_right = g.points[static_cast<std::size_t>(e.first)].py < 0.0;
    e.winding = (py < 0.0) == from_right ? 0 : from_right ? -1 : 1;
  };
  // Adds the point of the step from sample i at which y has this value.
  const auto add_between = [&](int i, double y, double h) {
    const double f = std::clamp((y - path(i, 1)) / (path(i + 1, 1) - path(i, 1)), kNear, 1.0 - kNear);
    add(i + f, path(i, 0) + f * (path(i + 1, 0) - path(i, 0)), path(i, 1) + f * (path(i + 1, 1) - path(i, 1)), h);
  };
  for (int i = 0; i < m; ++i) {
    const double x = path(i, 0), y = path(i, 1);
    const bool in = std::abs(y) < r;
    add(i, x, y, in ? std::sqrt((r - y) * (r + y)) : -1.0);
    if (i + 1 == m) break;
    const double next = path(i + 1, 1);
    const bool next_in = std::abs(next) < r;
    if (in != next_in) {
      add_between(i, std::copysign(r, in ? next : y), 0.0);
    } else if (!in && (y > 0.0) != (next > 0.0)) {
      for (int k = 0; k <= kLeap; ++k) {
        const double angle = kPi * (static_cast<double>(k) / kLeap - 0.5), sign = y > 0.0 ? -1.0 : 1.0;
        add_between(i, sign * r * std::sin(angle), k % kLeap == 0 ? 0.0 : r * std::cos(angle));
      }
    }
  }
  return g;
}

}  // namespace detail

void forbidden_intervals(const PlanarPath& path, double radius, std::vector<double>& lower,
                         std::vector<double>& upper) {
  const auto m = static_cast<std::size_t>(path.rows());
  lower.assign(m, detail::kInfinity);
  upper.assign(m, -detail::kInfinity);
  for (Eigen::Index i = 0; i < path.rows(); ++i) {
    const double y = path(i, 1);
    if (std::abs(y) >= radius) continue;
    const double h = std::sqrt((radius - y) * (radius + y));
    lower[static_cast<std::size_t>(i)] = path(i, 0) - h;
    upper[static_cast<std::size_t>(i)] = path(i, 0) + h;
  }
}

}  // namespace sigmaik::planning
