#pragma once
// Capsules around the shapes of links.

#include <vector>

#include <sigmaik/collisions.hpp>

#include "link_shapes.hpp"

namespace sigmaik::detail {

// A capsule, and the shapes that it covers.
struct FittedCapsule {
  int segment = -1;  // in whose link frame the capsule is
  Capsule capsule;
  double excess = 0.0;        // [m]; NaN where the shape is a mesh
  std::vector<int> segments;  // that have the covered shapes
};

// Capsules that contain all shapes, links that fixed joints connect together: at most `most`, but at least one for each
// group of links that move together. Shapes are joined where this adds the least volume. Links with meshes have a
// capsule of the given radius from their frame to the next link's.
std::vector<FittedCapsule> fit_capsules(const Chain& chain, const std::vector<LinkShape>& shapes, double radius,
                                        int most);

// Capsules from each link's frame to the next.
std::vector<FittedCapsule> capsules_along_links(const Chain& chain, double radius);

}  // namespace sigmaik::detail
