#pragma once
// Collision shapes of an arm's links, from a URDF.

#include <string>
#include <vector>

#include <sigmaik/chain.hpp>

namespace sigmaik::detail {

struct LinkShape {
  enum class Kind { Box, Cylinder, Sphere, Mesh };
  int segment = -1;  // index of the chain's segment; −1: the base
  Kind kind = Kind::Mesh;
  Pose origin = Pose::Identity();                  // in the link frame
  Eigen::Vector3d size = Eigen::Vector3d::Zero();  // [m] box: sides; cylinder, along z: radius, length; sphere: radius
};

// The shapes of all links that move with the arm: the arm's own links, and the links that fixed joints attach beside
// the arm. A link without <collision> shapes gives its <visual> shapes; one Mesh stands for all shapes of the link that
// are no box, cylinder or sphere. Throws Error if the source is no URDF or does not contain the chain's links, or if a
// size is not positive. Not `strict`: links of the chain that the URDF does not have, such as a tool that was added to
// the chain, have no shape.
std::vector<LinkShape> read_shapes(const Chain& chain, const std::string& source, bool strict = true);

}  // namespace sigmaik::detail
