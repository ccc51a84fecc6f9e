#include <sigmaik/planning/arm_spheres.hpp>

#include <algorithm>
#include <cmath>

#include "../finite.hpp"
#include "../link_frames.hpp"
#include "../link_shapes.hpp"
#include "../message.hpp"
#include "../walk.hpp"

namespace sigmaik::planning {
namespace {

using sigmaik::detail::LinkShape;
using sigmaik::detail::require;

void require_radius(double radius) {
  require(std::isfinite(radius) && radius > 0.0, "radius = ", radius, " m must be finite and greater than 0");
}

// Divides the cylinder into m equal pieces, with a sphere around each: the spheres cover the whole cylinder.
void cover_cylinder(const LinkShape& shape, std::vector<LinkSphere>& spheres) {
  const double radius = shape.size[0], length = shape.size[1];
  const int m = static_cast<int>(std::clamp(std::ceil(length / radius), 1.0, 1.0 + kMaxSpheres));
  const double piece = length / m;
  for (int k = 0; k < m; ++k) {
    const Eigen::Vector3d center(0.0, 0.0, (k + 0.5) * piece - 0.5 * length);
    spheres.push_back({shape.segment, shape.origin * center, std::hypot(radius, 0.5 * piece)});
  }
}

// Divides the box into boxes about as large as its smallest side, at most three along its longest side.
void cover_box(const LinkShape& shape, std::vector<LinkSphere>& spheres) {
  const double side = std::max(shape.size.minCoeff(), shape.size.maxCoeff() / 3.0);
  const Eigen::Array3d count = (shape.size.array() / side - 1e-9).ceil().max(1.0), piece = shape.size.array() / count;
  const double radius = 0.5 * piece.matrix().norm();
  for (int x = 0; x < count[0]; ++x) {
    for (int y = 0; y < count[1]; ++y) {
      for (int z = 0; z < count[2]; ++z) {
        const Eigen::Vector3d center = (Eigen::Array3d(x, y, z) + 0.5) * piece - 0.5 * shape.size.array();
        spheres.push_back({shape.segment, shape.origin * center, radius});
      }
    }
  }
}

// Covers a link from its frame to the next link's frame, where the next link's spheres begin; the tip has a single
// sphere.
void cover_link(const Chain& chain, int segment, double radius, std::vector<LinkSphere>& spheres) {
  const std::vector<Segment>& segments = chain.segments();
  const std::size_t next = static_cast<std::size_t>(segment + 1);
  if (next == segments.size()) {
    spheres.push_back({segment, Eigen::Vector3d::Zero(), radius});
    return;
  }
  const Eigen::Vector3d way = segments[next].origin.translation();
  const double length = way.norm();
  const int m = static_cast<int>(std::min(std::ceil(length / radius - 1e-9), 1.0 + kMaxSpheres));
  for (int k = 0; k < m; ++k) spheres.push_back({segment, way * (static_cast<double>(k) / m), radius});
}

// The spheres without those that lie in another sphere of the same link.
std::vector<LinkSphere> without_inner(const std::vector<LinkSphere>& spheres) {
  std::vector<LinkSphere> kept;
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    const LinkSphere& inner = spheres[i];
    const bool hidden = std::any_of(spheres.begin(), spheres.end(), [&](const LinkSphere& outer) {
      if (&outer == &inner || outer.segment != inner.segment) return false;
      const double room = outer.radius - inner.radius;
      const bool equal = room == 0.0 && outer.center == inner.center;
      return equal ? &outer < &inner : (outer.center - inner.center).norm() <= room;
    });
    if (!hidden) kept.push_back(inner);
  }
  return kept;
}

}  // namespace

ArmSpheres::ArmSpheres(const Chain& chain, std::vector<LinkSphere> spheres)
    : chain_(chain), spheres_(std::move(spheres)) {
  const std::vector<Segment>& segments = chain.segments();
  require(!chain.has_mimics(), "the arm has joints that mimic others; spheres support joints that move by themselves");
  require(!spheres_.empty(), "an arm needs at least one sphere");
  require(spheres_.size() <= kMaxSpheres, "the arm has ", spheres_.size(), " spheres; at most ", kMaxSpheres,
          " are supported");
  for (std::size_t i = 0; i < spheres_.size(); ++i) {
    const LinkSphere& s = spheres_[i];
    require(s.segment >= -1 && s.segment < static_cast<int>(segments.size()), "sphere ", i, ": there is no segment ",
            s.segment, "; the chain has ", segments.size());
    require(s.center.allFinite(), "sphere ", i, ": center = (", s.center.transpose(), ") is not finite");
    require(std::isfinite(s.radius) && s.radius > 0.0, "sphere ", i, ": radius = ", s.radius,
            " m must be finite and greater than 0");
  }

  const sigmaik::detail::LinkFrames frames(chain);
  std::stable_sort(spheres_.begin(), spheres_.end(),
                   [](const LinkSphere& a, const LinkSphere& b) { return a.segment < b.segment; });
  for (const LinkSphere& s : spheres_) {
    const std::size_t i = static_cast<std::size_t>(s.segment + 1);
    local_.push_back(frames.in_joint[i] * s.center);
    joints_.push_back(frames.joints[i]);
    if (frames.joints[i] == 0) ++first_moving_;
  }
}

ArmSpheres ArmSpheres::from_urdf(const Chain& chain, const std::string& source, double radius) {
  require_radius(radius);
  std::vector<LinkSphere> spheres;
  for (const LinkShape& shape : sigmaik::detail::read_shapes(chain, source)) {
    switch (shape.kind) {
      case LinkShape::Kind::Box: cover_box(shape, spheres); break;
      case LinkShape::Kind::Cylinder: cover_cylinder(shape, spheres); break;
      case LinkShape::Kind::Sphere:
        spheres.push_back({shape.segment, shape.origin.translation(), shape.size[0]});
        break;
      case LinkShape::Kind::Mesh:
        if (shape.origin.translation().isZero(0.0)) {
          cover_link(chain, shape.segment, radius, spheres);
        } else {  // beside the arm: at its own frame
          spheres.push_back({shape.segment, shape.origin.translation(), radius});
        }
        break;
    }
  }
  require(!spheres.empty(), "the URDF gives no shape to any link between '", chain.base(), "' and '", chain.tip(), "'");
  return ArmSpheres(chain, without_inner(spheres));
}

ArmSpheres ArmSpheres::along_links(const Chain& chain, double radius) {
  require_radius(radius);
  std::vector<LinkSphere> spheres;
  for (int i = -1; i < static_cast<int>(chain.segments().size()); ++i) cover_link(chain, i, radius, spheres);
  return ArmSpheres(chain, without_inner(spheres));
}

bool ArmSpheres::update(const JointRef& q, SphereState& state) const noexcept {
  if (q.size() != chain_.dof() || !sigmaik::detail::finite(q)) return false;
  const std::size_t count = spheres_.size();
  std::size_t i = 0;
  for (; i < static_cast<std::size_t>(first_moving_); ++i) state.center[i] = local_[i];
  sigmaik::detail::walk(chain_, q, [&](int k, const sigmaik::detail::FrameColumns& f) {
    const std::size_t at = static_cast<std::size_t>(k);
    state.axis[at] = f.z.head<3>();
    state.origin[at] = f.p.head<3>();
    for (; i < count && joints_[i] == k + 1; ++i) state.center[i] = f.at(local_[i]).head<3>();
  });
  return true;
}

void ArmSpheres::jacobian(int i, const SphereState& state, PointJacobian& jacobian) const noexcept {
  jacobian.setZero(3, chain_.dof());
  const Eigen::Vector3d& center = state.center[static_cast<std::size_t>(i)];
  for (int k = 0; k < joints(i); ++k) {
    const std::size_t at = static_cast<std::size_t>(k);
    if (chain_.constants()[at].prismatic) {
      jacobian.col(k) = state.axis[at];
    } else {
      jacobian.col(k) = state.axis[at].cross(center - state.origin[at]);
    }
  }
}

void ArmSpheres::row(int i, const SphereState& state, const Eigen::Vector3d& direction,
                     JointVector& row) const noexcept {
  const Eigen::Vector3d& center = state.center[static_cast<std::size_t>(i)];
  for (int k = 0; k < joints(i); ++k) {
    const std::size_t at = static_cast<std::size_t>(k);
    const Eigen::Vector3d& axis = state.axis[at];
    row[k] = chain_.constants()[at].prismatic ? axis.dot(direction)
                                              : axis.dot((center - state.origin[at]).cross(direction));
  }
}

}  // namespace sigmaik::planning
