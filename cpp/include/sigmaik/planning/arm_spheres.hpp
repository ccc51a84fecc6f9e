#pragma once
/// \file arm_spheres.hpp
/// An arm as spheres along its links, for collision costs.

#include <array>
#include <string>
#include <vector>

#include <sigmaik/chain.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik::planning {

inline constexpr int kMaxSpheres = 256;  ///< most spheres of an arm

/// A sphere fixed to a link.
struct LinkSphere {
  int segment = 0;                                   ///< index into Chain::segments(); −1: the base
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< [m] in the link frame
  double radius = 0.0;                               ///< [m] > 0
};

/// Memory and result of ArmSpheres::update(), one object for each thread; no heap.
struct SphereState {
  std::array<Eigen::Vector3d, kMaxSpheres> center;  ///< [m] in base, of the first size()
  std::array<Eigen::Vector3d, kMaxJoints> axis;     ///< of every joint, in base
  std::array<Eigen::Vector3d, kMaxJoints> origin;   ///< [m] of every joint, in base
};

/// ∂center/∂q, 3×n.
using PointJacobian = Eigen::Matrix<double, 3, Eigen::Dynamic, kLayout, 3, kMaxJoints>;

/// Spheres that cover an arm. Immutable, safe to use from many threads.
class ArmSpheres {
 public:
  /// Keeps the spheres in the order in which joints move them, base to tip.
  /// \throws Error where there is no sphere or too many, a segment does not exist, or a number is out of its range
  ArmSpheres(const Chain& chain, std::vector<LinkSphere> spheres);

  /// Covers the boxes, cylinders and spheres of a URDF completely: each link's `collision` shapes, or the `visual`
  /// shapes of a link that has no `collision` shapes. Links that fixed joints attach beside the arm belong to the arm,
  /// e.g. a tool behind the tip; movable branches do not. Links with meshes get spheres as by along_links(), links
  /// without any shape get none. A cylinder of radius r and length L becomes m = ⌈L/r⌉ spheres of radius √(r² +
  /// (L/2m)²), at most 1.12 r; a box becomes small boxes, with a sphere for each.
  /// \param source a file's path, or the XML itself: what the chain was read from
  /// \param radius [m] > 0, of links with meshes
  /// \throws Error where the source is no URDF, does not hold this arm, or a shape's size is not positive
  static ArmSpheres from_urdf(const Chain& chain, const std::string& source, double radius = 0.05);

  /// Capsules from each link's frame to the next, of spheres no further apart than their radius.
  /// \throws Error where the radius is not positive, or so small that there would be too many spheres
  static ArmSpheres along_links(const Chain& chain, double radius = 0.05);

  /// Number of spheres.
  int size() const noexcept { return static_cast<int>(spheres_.size()); }
  /// The arm.
  const Chain& chain() const noexcept { return chain_; }
  /// The spheres, base to tip.
  const std::vector<LinkSphere>& spheres() const noexcept { return spheres_; }
  /// Radius of sphere i [m].
  double radius(int i) const noexcept { return spheres_[static_cast<std::size_t>(i)].radius; }
  /// Number of joints that move sphere i, 0 … n: the first joints of the chain.
  int joints(int i) const noexcept { return joints_[static_cast<std::size_t>(i)]; }
  /// Index of the first sphere that a joint moves; the spheres before it belong to the base.
  int first_moving() const noexcept { return first_moving_; }

  /// Fills `state` for joint positions q (n,). Real time.
  /// \return false, with `state` unchanged, where q has a wrong size or is not finite
  bool update(const JointRef& q, SphereState& state) const noexcept;

  /// ∂center_i/∂q (3, n): column k is z_k × (c_i − p_k), z_k where joint k is prismatic, and zero where joint k does
  /// not move the sphere. Real time.
  void jacobian(int i, const SphereState& state, PointJacobian& jacobian) const noexcept;

  /// directionᵀ ∂center_i/∂q, the first joints(i) entries of `row`. Real time.
  void row(int i, const SphereState& state, const Eigen::Vector3d& direction, JointVector& row) const noexcept;

 private:
  Chain chain_;
  std::vector<LinkSphere> spheres_;
  std::vector<Eigen::Vector3d> local_;  // centres in the frame of the last joint that moves them
  std::vector<int> joints_;
  int first_moving_ = 0;
};

SIGMAIK_SAME_LAYOUT(ArmSpheres, LinkSphere, SphereState);

}  // namespace sigmaik::planning
