#include "capsule_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include <Eigen/Eigenvalues>

#include "distances.hpp"
#include "link_frames.hpp"
#include "numbers.hpp"

namespace sigmaik::detail {
namespace {

struct Ball {
  Vector3 center;
  double radius;
};

// What a capsule has to cover, in the frame of a group's first link.
struct Cover {
  std::vector<Ball> balls;          // a convex set that contains them all contains the shapes
  std::vector<PlacedShape> shapes;  // empty for a mesh
  std::vector<int> segments;
  Capsule capsule;
  double volume = 0.0;
  int id = 0;
};

double volume_of(const Capsule& c) {
  return std::numbers::pi * c.radius * c.radius * ((c.b - c.a).norm() + 4.0 / 3.0 * c.radius);
}

// The least radius with which the segment's capsule contains all balls.
double radius_around(const Vector3& a, const Vector3& b, const std::vector<Ball>& balls) {
  const Vector3 along = b - a;
  const double square = along.squaredNorm();
  double radius = 0.0;
  for (const Ball& ball : balls) {
    const double t = square > 1e-18 ? std::clamp(along.dot(ball.center - a) / square, 0.0, 1.0) : 0.0;
    radius = std::max(radius, (ball.center - a - t * along).norm() + ball.radius);
  }
  return radius;
}

// Searches the segment of the least volume, from `a` and `b`: each coordinate up and down, by steps that are halved.
Capsule search(Vector3 a, Vector3 b, const std::vector<Ball>& balls, double size) {
  const auto made = [&](const Vector3& from, const Vector3& to) {
    return Capsule{from, to, radius_around(from, to, balls)};
  };
  Capsule best = made(a, b);
  double least = volume_of(best);
  for (double step = 0.2 * size; step > 1e-3 * size;) {
    bool better = false;
    for (int k = 0; k < 12; ++k) {
      Capsule other = best;
      (k < 6 ? other.a : other.b)[k % 3] += (k / 3) % 2 == 0 ? step : -step;
      other = made(other.a, other.b);
      const double volume = volume_of(other);
      if (volume < least * (1.0 - 1e-6)) {
        least = volume;
        best = other;
        better = true;
      }
    }
    if (!better) step *= 0.5;
  }
  return best;
}

// The smallest capsule that a search from the principal axes finds.
void fit(Cover& cover) {
  Vector3 mean = Vector3::Zero();
  for (const Ball& ball : cover.balls) mean += ball.center / static_cast<double>(cover.balls.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  double size = 0.0;
  for (const Ball& ball : cover.balls) {
    spread += (ball.center - mean) * (ball.center - mean).transpose();
    size = std::max(size, (ball.center - mean).norm() + ball.radius);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(spread);
  cover.volume = kInfinity;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3 along = principal.eigenvectors().col(axis);
    double low = 0.0, high = 0.0;
    for (const Ball& ball : cover.balls) {
      low = std::min(low, along.dot(ball.center - mean));
      high = std::max(high, along.dot(ball.center - mean));
    }
    const Capsule found = search(mean + 0.6 * low * along, mean + 0.6 * high * along, cover.balls, size);
    if (volume_of(found) < cover.volume) {
      cover.capsule = found;
      cover.volume = volume_of(found);
    }
  }
}

// The corners of a shape, and of polygons around the circles of a cylinder.
Cover cover_of(const LinkShape& shape, const Pose& to_group) {
  const Pose pose = to_group * shape.origin;
  Cover out;
  out.segments = {shape.segment};
  PlacedShape placed{Obstacle::Shape::Box, pose.linear(), pose.translation(), shape.size};
  switch (shape.kind) {
    case LinkShape::Kind::Sphere:
      placed.shape = Obstacle::Shape::Sphere;
      out.balls.push_back({pose.translation(), shape.size[0]});
      break;
    case LinkShape::Kind::Cylinder: {
      placed.shape = Obstacle::Shape::Cylinder;
      constexpr int kCorners = 16;
      const double radius = shape.size[0] / std::cos(std::numbers::pi / kCorners);
      for (int k = 0; k < kCorners; ++k) {
        const double angle = 2.0 * std::numbers::pi * k / kCorners;
        for (const double end : {-0.5, 0.5}) {
          out.balls.push_back(
              {pose * Vector3(radius * std::cos(angle), radius * std::sin(angle), end * shape.size[1]), 0.0});
        }
      }
      break;
    }
    case LinkShape::Kind::Box:
    case LinkShape::Kind::Mesh:
      for (int k = 0; k < 8; ++k) {
        const Vector3 corner(k & 1 ? 0.5 : -0.5, k & 2 ? 0.5 : -0.5, k & 4 ? 0.5 : -0.5);
        out.balls.push_back({pose * corner.cwiseProduct(shape.size), 0.0});
      }
      break;
  }
  out.shapes = {placed};
  fit(out);
  return out;
}

Cover joined(const Cover& a, const Cover& b) {
  Cover out = a;
  out.balls.insert(out.balls.end(), b.balls.begin(), b.balls.end());
  out.shapes.insert(out.shapes.end(), b.shapes.begin(), b.shapes.end());
  for (const int segment : b.segments) {
    if (std::find(out.segments.begin(), out.segments.end(), segment) == out.segments.end()) {
      out.segments.push_back(segment);
    }
  }
  fit(out);
  return out;
}

// How far a capsule stands out from the shapes, from points spread over its surface.
double excess_of(const Cover& cover) {
  if (cover.shapes.empty()) return std::nan("");
  const Capsule& c = cover.capsule;
  const Vector3 along = c.b - c.a;
  double most = 0.0;
  constexpr int kPoints = 1000;
  for (int k = 0; k < kPoints; ++k) {
    const double z = 1.0 - (2.0 * k + 1.0) / kPoints, angle = k * std::numbers::pi * (3.0 - std::sqrt(5.0));
    const double around = std::sqrt(std::max(0.0, 1.0 - z * z));
    const Vector3 normal(around * std::cos(angle), around * std::sin(angle), z);
    for (const double t : {0.0, 0.5, 1.0}) {
      if (t == 0.5 ? std::abs(normal.dot(along)) > 0.1 * along.norm() : (t - 0.5) * normal.dot(along) < 0.0) {
        continue;
      }
      const Vector3 point = c.a + t * along + c.radius * normal;
      double beside = kInfinity;
      for (const PlacedShape& shape : cover.shapes) beside = std::min(beside, point_distance(shape, point).distance);
      most = std::max(most, beside);
    }
  }
  return most;
}

// The capsule of a link that has no shape but a mesh: from its frame to the next.
Cover along_link(const Chain& chain, int segment, double radius, const Pose& at, const Pose& to_group) {
  const std::size_t next = static_cast<std::size_t>(segment + 1);
  const bool beside = !at.translation().isZero(0.0);
  Cover out;
  out.segments = {segment};
  out.balls.push_back({to_group * at.translation(), radius});
  if (!beside && next < chain.segments().size()) {
    out.balls.push_back({to_group * chain.segments()[next].origin.translation(), radius});
  }
  out.capsule = {out.balls.front().center, out.balls.back().center, radius};
  out.volume = volume_of(out.capsule);
  return out;
}

using Groups = std::vector<std::vector<Cover>>;  // one for each number of joints that move the links

// Joins covers of one group, the two that this makes the least larger first.
class Joiner {
 public:
  explicit Joiner(Groups& groups) : groups_(groups) {
    for (std::vector<Cover>& group : groups) {
      for (Cover& cover : group) cover.id = ids_++;
    }
  }

  // Returns false where no group has two covers that can be joined.
  bool join_two() {
    double least = kInfinity;
    std::array<std::size_t, 3> where{};
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      for (std::size_t i = 0; i < groups_[g].size(); ++i) {
        for (std::size_t j = 0; j < i; ++j) {
          const Cover &a = groups_[g][j], &b = groups_[g][i];
          if (a.shapes.empty() != b.shapes.empty()) continue;
          const double more = both(a, b).volume - a.volume - b.volume;
          if (more < least) {
            least = more;
            where = {g, i, j};
          }
        }
      }
    }
    if (least == kInfinity) return false;
    std::vector<Cover>& group = groups_[where[0]];
    Cover found = both(group[where[2]], group[where[1]]);
    found.id = ids_++;
    group[where[2]] = std::move(found);
    group.erase(group.begin() + static_cast<std::ptrdiff_t>(where[1]));
    return true;
  }

 private:
  const Cover& both(const Cover& a, const Cover& b) {
    const auto key = std::pair(a.id, b.id);
    const auto known = joined_.find(key);
    return known != joined_.end() ? known->second : joined_.emplace(key, joined(a, b)).first->second;
  }

  Groups& groups_;
  int ids_ = 0;
  std::map<std::pair<int, int>, Cover> joined_;
};

std::vector<FittedCapsule> made_of(const Groups& groups, const std::vector<int>& first) {
  std::vector<FittedCapsule> out;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    for (const Cover& cover : groups[g]) {
      out.push_back({first[g] - 1, cover.capsule, excess_of(cover), cover.segments});
    }
  }
  return out;
}

// The first link of each group, by its place in LinkFrames.
std::vector<int> first_links(const LinkFrames& frames) {
  std::vector<int> first(static_cast<std::size_t>(frames.joints.back() + 1), -1);
  for (std::size_t i = frames.joints.size(); i-- > 0;) {
    first[static_cast<std::size_t>(frames.joints[i])] = static_cast<int>(i);
  }
  return first;
}

Pose to_first(const LinkFrames& frames, const std::vector<int>& first, int segment) {
  const auto link = static_cast<std::size_t>(segment + 1);
  const auto of_group = static_cast<std::size_t>(first[static_cast<std::size_t>(frames.joints[link])]);
  return frames.in_joint[of_group].inverse() * frames.in_joint[link];
}

}  // namespace

std::vector<FittedCapsule> fit_capsules(const Chain& chain, const std::vector<LinkShape>& shapes, double radius,
                                        int most) {
  const LinkFrames frames(chain);
  const std::vector<int> first = first_links(frames);
  Groups groups(first.size());
  int count = 0;
  for (const LinkShape& shape : shapes) {
    const Pose to_group = to_first(frames, first, shape.segment);
    const auto group = static_cast<std::size_t>(frames.joints[static_cast<std::size_t>(shape.segment + 1)]);
    const bool mesh = shape.kind == LinkShape::Kind::Mesh;
    groups[group].push_back(mesh ? along_link(chain, shape.segment, radius, shape.origin, to_group)
                                 : cover_of(shape, to_group));
    ++count;
  }
  Joiner joiner(groups);
  for (; count > most && joiner.join_two(); --count) {
  }
  return made_of(groups, first);
}

std::vector<FittedCapsule> capsules_along_links(const Chain& chain, double radius) {
  const LinkFrames frames(chain);
  const std::vector<int> first = first_links(frames);
  Groups groups(first.size());
  for (int segment = -1; segment < static_cast<int>(chain.segments().size()); ++segment) {
    const Cover cover = along_link(chain, segment, radius, Pose::Identity(), to_first(frames, first, segment));
    std::vector<Cover>& group = groups[static_cast<std::size_t>(frames.joints[static_cast<std::size_t>(segment + 1)])];
    const auto holds = [&](const Cover& other) {
      return radius_around(other.capsule.a, other.capsule.b, cover.balls) <= other.capsule.radius * (1.0 + 1e-9);
    };
    if (std::none_of(group.begin(), group.end(), holds)) group.push_back(cover);
  }
  return made_of(groups, first);
}

}  // namespace sigmaik::detail
