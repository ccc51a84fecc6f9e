#pragma once
// The least distance of an arm's capsules from each other and from obstacles, computed in another way than the library
// does: links' poses as products of the URDF's own transforms, distances by alternating projections.

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <sigmaik/collisions.hpp>

namespace test {

class ClearWatch {
 public:
  explicit ClearWatch(const sigmaik::Collisions& collisions)
      : chain_(collisions.chain()),
        capsules_(collisions.capsules()),
        pairs_(collisions.self_pairs()),
        obstacles_(collisions.obstacles()) {}

  /// Poses of the obstacles, which a test may move.
  std::vector<sigmaik::Obstacle>& obstacles() { return obstacles_; }

  using Segment = std::pair<Eigen::Vector3d, Eigen::Vector3d>;

  /// The least distance [m] at q.
  double distance(const sigmaik::JointVector& q) const {
    std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> ends;
    std::vector<bool> moves;
    for (const sigmaik::LinkCapsule& c : capsules_) {
      bool moved = false;
      const sigmaik::Pose link = link_pose(q, c.link, moved);
      ends.emplace_back(link * c.capsule.a, link * c.capsule.b);
      moves.push_back(moved);
    }
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [i, k] : pairs_) {
      const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(k);
      least = std::min(least, between(ends[a], ends[b]) - capsules_[a].capsule.radius - capsules_[b].capsule.radius);
    }
    for (std::size_t i = 0; i < ends.size(); ++i) {
      for (const sigmaik::Obstacle& o : obstacles_) {
        if (moves[i]) least = std::min(least, to_obstacle(ends[i], o) - capsules_[i].capsule.radius);
      }
    }
    return least;
  }

  /// The pose of a link, and whether a joint moves it.
  sigmaik::Pose link_pose(const sigmaik::JointVector& q, const std::string& link, bool& moved) const {
    sigmaik::Pose pose = sigmaik::Pose::Identity();
    moved = false;
    int i = 0;
    if (link == chain_.base()) return pose;
    for (const sigmaik::Segment& s : chain_.segments()) {
      pose = pose * s.origin;
      if (s.type == sigmaik::JointType::Prismatic) {
        pose.translate(q[i++] * s.axis);
        moved = true;
      } else if (s.type != sigmaik::JointType::Fixed) {
        pose.rotate(Eigen::AngleAxisd(q[i++], s.axis));
        moved = true;
      }
      if (s.link_name == link) break;
    }
    return pose;
  }

  static Eigen::Vector3d on(const Segment& s, const Eigen::Vector3d& p) {
    const Eigen::Vector3d along = s.second - s.first;
    const double square = along.squaredNorm();
    return s.first + (square > 0.0 ? std::clamp(along.dot(p - s.first) / square, 0.0, 1.0) : 0.0) * along;
  }

  /// Two segments, each of which is the nearest to the other's ends or crosses it: all ends, and the common normal.
  static double between(const Segment& a, const Segment& b) {
    double least = std::min({(on(b, a.first) - a.first).norm(), (on(b, a.second) - a.second).norm(),
                             (on(a, b.first) - b.first).norm(), (on(a, b.second) - b.second).norm()});
    const Eigen::Vector3d u = a.second - a.first, v = b.second - b.first, w = b.first - a.first;
    const double uu = u.squaredNorm(), vv = v.squaredNorm(), uv = u.dot(v), square = uu * vv - uv * uv;
    if (square > 1e-12 * uu * vv) {
      const double s = (u.dot(w) * vv - v.dot(w) * uv) / square, t = (u.dot(w) * uv - v.dot(w) * uu) / square;
      if (s >= 0.0 && s <= 1.0 && t >= 0.0 && t <= 1.0) least = std::min(least, (s * u - t * v - w).norm());
    }
    return least;
  }

  /// The distance of a point outside; the depth does not matter here, and is 0.
  static double outside(const sigmaik::Obstacle& o, const Eigen::Vector3d& point) {
    const Eigen::Vector3d p = o.pose.inverse() * point;
    using Shape = sigmaik::Obstacle::Shape;
    switch (o.shape) {
      case Shape::Sphere: return p.norm() - o.size[0];
      case Shape::HalfSpace: return p[2];
      case Shape::Capsule: {
        const double half = 0.5 * o.size[1];
        return (p - Eigen::Vector3d(0.0, 0.0, std::clamp(p[2], -half, half))).norm() - o.size[0];
      }
      case Shape::Box: return (p - p.cwiseMax(-0.5 * o.size).cwiseMin(0.5 * o.size)).norm();
      case Shape::Cylinder: break;
    }
    const double around = std::hypot(p[0], p[1]);
    return std::hypot(std::max(0.0, around - o.size[0]), std::max(0.0, std::abs(p[2]) - 0.5 * o.size[1]));
  }

  /// The least value of a convex function along the segment, by golden sections.
  static double to_obstacle(const Segment& s, const sigmaik::Obstacle& o) {
    const auto at = [&](double t) { return outside(o, s.first + t * (s.second - s.first)); };
    double low = 0.0, high = 1.0;
    for (int i = 0; i < 60; ++i) {
      const double third = 0.381966 * (high - low);
      (at(low + third) <= at(high - third) ? high : low) = at(low + third) <= at(high - third) ? high - third
                                                                                               : low + third;
    }
    return std::min({at(0.0), at(1.0), at(0.5 * (low + high))});
  }

 private:
  sigmaik::Chain chain_;
  std::vector<sigmaik::LinkCapsule> capsules_;
  std::vector<std::pair<int, int>> pairs_;
  std::vector<sigmaik::Obstacle> obstacles_;
};

}  // namespace test
