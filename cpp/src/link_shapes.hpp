#pragma once
// Collision shapes of an arm's links, from a URDF.

#include <string>
#include <vector>

#include <sigmaik/chain.hpp>

namespace sigmaik::detail {

struct LinkShape {
  enum class Kind { Box, Cylinder, Sphere, Mesh };
  int segment = -1;  // of the chain; −1: the base
  Kind kind = Kind::Mesh;
  Pose origin = Pose::Identity();                  // in the link frame
  Eigen::Vector3d size = Eigen::Vector3d::Zero();  // [m] box: sides; cylinder, along z: radius, length; sphere: radius
};

// Of all links that move with the arm: its own, and those that fixed joints carry beside it. A link's <collision>
// shapes, or where it has none its <visual> ones; one Mesh for all that is no box, cylinder or sphere. Throws Error
// where the source is no URDF or does not hold the chain's links, or a size is not positive.
std::vector<LinkShape> read_shapes(const Chain& chain, const std::string& source);

}  // namespace sigmaik::detail
