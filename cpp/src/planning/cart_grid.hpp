#pragma once
// The forbidden region of a cart's law: the samples, and what the region has between them.

#include <vector>

#include <sigmaik/planning/cart.hpp>

namespace sigmaik::planning::detail {

struct GridPoint {
  double px, py;        // P [m]
  double lower, upper;  // λ∓ [m]; +∞, −∞ where nothing is forbidden
};

// A connected part of the forbidden region.
struct Extent {
  int first, last;   // in the grid
  double low, high;  // least λ−, largest λ+ [m]
  int winding;       // turns of P's azimuth if the cart passes above, more than if it passes below: 1, 0 or −1
};

// The samples, and between them what the region has there: its tips, and all of it where a step leaps over it.
struct Grid {
  std::vector<double> at;  // [samples], whole numbers at samples
  std::vector<GridPoint> points;
  std::vector<Extent> extents;
};

Grid make_grid(const PlanarPath& path, double radius);

}  // namespace sigmaik::planning::detail
