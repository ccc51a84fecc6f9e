#include "elbow.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "owner.hpp"

namespace sigmaik::detail {

template class Owner<Elbow>;

namespace {

using Eigen::Vector3d;

constexpr double kMeet = 1e-3;      // axes that are parallel, or meet: rad, or part of the characteristic length
constexpr double kLever = 0.1;      // of the characteristic length: S or W nearer to the axis makes no elbow
constexpr double kShortSide = 0.5;  // of the long side

struct Axis {
  Vector3d point, direction;
};

// The joint axes with all joints at zero. They are rigid to each other from one joint to the next, whatever q is.
std::vector<Axis> axes_of(const Chain& chain) {
  std::vector<Axis> out;
  Pose frame = Pose::Identity();
  for (int i = 0; i < chain.dof(); ++i) {
    const JointConstants& joint = chain.constants()[static_cast<std::size_t>(i)];
    frame.translation() += frame.linear() * joint.translation;
    frame.linear() = frame.linear() * joint.rotation;
    out.push_back({frame.translation(), frame.linear().col(2)});
  }
  return out;
}

bool parallel(const Axis& a, const Axis& b) { return a.direction.cross(b.direction).norm() <= kMeet; }

// The point on `a` where `b` meets it.
std::optional<Vector3d> meeting(const Axis& a, const Axis& b, double length) {
  if (parallel(a, b)) return std::nullopt;
  const Vector3d normal = a.direction.cross(b.direction), way = b.point - a.point;
  const double square = normal.squaredNorm();
  if (std::abs(way.dot(normal)) > kMeet * length * std::sqrt(square)) return std::nullopt;
  return a.point + way.cross(b.direction).dot(normal) / square * a.direction;
}

// From the elbow's axis, square to the axis: to the shoulder or the wrist, which `near` and `far` make.
std::optional<Vector3d> lever(const Axis& elbow, const Axis& near, const Axis* far, double length) {
  std::optional<Vector3d> point;
  if (far != nullptr) point = meeting(near, *far, length);
  if (!point && parallel(near, elbow)) point = near.point;
  if (!point) return std::nullopt;
  const Vector3d way = *point - elbow.point;
  const Vector3d square = way - way.dot(elbow.direction) * elbow.direction;
  if (square.norm() < kLever * length) return std::nullopt;
  return square;
}

}  // namespace

std::unique_ptr<Elbow> Elbow::of(const Chain& chain) {
  const auto& types = chain.joint_types();
  const bool turns = std::none_of(types.begin(), types.end(), [](JointType t) { return t == JointType::Prismatic; });
  if (!turns || chain.has_mimics()) return nullptr;
  const double length = chain.characteristic_length();
  const std::vector<Axis> axes = axes_of(chain);
  const auto n = static_cast<std::size_t>(chain.dof());
  std::unique_ptr<Elbow> out;
  double longest = 0.0;
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const auto to_shoulder = lever(axes[i], axes[i - 1], i >= 2 ? &axes[i - 2] : nullptr, length);
    const auto to_wrist = lever(axes[i], axes[i + 1], i + 2 < n ? &axes[i + 2] : nullptr, length);
    if (!to_shoulder || !to_wrist) continue;
    const double size = std::min(to_shoulder->norm(), to_wrist->norm());
    if (size <= longest) continue;  // a wrist with offsets
    longest = size;
    out.reset();
    const int joint = static_cast<int>(i);
    const double lower = chain.limits().lower[joint], upper = chain.limits().upper[joint];
    constexpr double kTurn = 2.0 * std::numbers::pi;
    if (!(upper - lower <= kTurn)) continue;  // both sides end at another straight angle
    double straight = std::atan2(to_wrist->cross(-*to_shoulder).dot(axes[i].direction), to_wrist->dot(-*to_shoulder));
    straight += kTurn * std::ceil((lower - straight) / kTurn);
    const double below = straight - lower, above = upper - straight;
    if (above < 0.0) continue;
    const int longer = below < kShortSide * above ? 1 : above < kShortSide * below ? -1 : 0;
    if (longer == 0 && chain.dof() > 6) continue;  // a self-motion leads from one side to the other
    out = std::make_unique<Elbow>(Elbow{joint, straight, longer});
  }
  return out;
}

}  // namespace sigmaik::detail
