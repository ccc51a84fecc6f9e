#pragma once
// What a Collisions holds: the arm's capsules in the frames of the joints that move them, the pairs that are checked,
// and the scene.

#include <array>
#include <string>
#include <utility>
#include <vector>

#include <sigmaik/collisions.hpp>

#include "collision_scene.hpp"
#include "distances.hpp"
#include "walk.hpp"

namespace sigmaik::detail {

inline constexpr int kMaxBodies = kMaxCapsules + kMaxCarried;  // that joints move, or the base carries

// A capsule of the arm. Slots of carried capsules have their place in the scene's state.
struct ArmBody {
  Capsule capsule;  // in the frame of the last joint that moves it
  int joints = 0;   // that move it: the first joints of the chain
  // [m] The largest distance of its points from each of these joints, prismatic joints in between at 0.
  std::array<double, kMaxJoints> reach{};
};

// `body` is moved by the joints [first, last), while `other` stands still among them.
struct BodyPair {
  int body = 0, other = 0;  // `other`: a body, or kMaxBodies + obstacle
  int first = 0, last = 0;
  bool carried = false;  // one of the bodies is a slot of the carried object
  bool obstacle() const noexcept { return other >= kMaxBodies; }
};

struct CollisionModel {
  CollisionModel(const Chain& arm, CollisionOptions settings, const SceneState& state, int obstacle_count)
      : chain(arm), options(std::move(settings)), scene(state, obstacle_count) {}

  Chain chain;
  CollisionOptions options;
  std::vector<LinkCapsule> capsules;  // in the link frames
  std::vector<ArmBody> bodies;        // `capsules`, then kMaxCarried slots
  std::vector<BodyPair> pairs;        // those without a carried body first
  int pairs_without_carried = 0;
  std::vector<Obstacle> obstacles;
  std::vector<std::string> names;  // of the bodies, then of the obstacles
  Pose tip_in_joint = Pose::Identity();
  double reserve = 0.0;  // [m] that rows keep beyond the margin
  Scene scene;

  int first_carried() const noexcept { return static_cast<int>(capsules.size()); }
  // The number of a body or obstacle in `names`.
  int name_index(int other) const noexcept {
    return other < kMaxBodies ? other : static_cast<int>(bodies.size()) + other - kMaxBodies;
  }
};

// Where the arm's bodies are.
struct BodyState {
  std::array<Vector3, kMaxBodies> a, b;
  std::array<Vector3, kMaxJoints> axis, origin;
};

// Places all bodies at q; `carried`: the object at the tip.
inline void place_bodies(const CollisionModel& model, const JointVector& q, const SceneState& scene,
                         BodyState& state) noexcept {
  const auto count = static_cast<int>(model.capsules.size());
  int i = 0;
  for (; i < count && model.bodies[static_cast<std::size_t>(i)].joints == 0; ++i) {
    const auto at = static_cast<std::size_t>(i);
    state.a[at] = model.bodies[at].capsule.a;
    state.b[at] = model.bodies[at].capsule.b;
  }
  const FrameColumns last = walk(model.chain, q, [&](int k, const FrameColumns& f) {
    const auto joint = static_cast<std::size_t>(k);
    state.axis[joint] = f.z.head<3>();
    state.origin[joint] = f.p.head<3>();
    for (; i < count && model.bodies[static_cast<std::size_t>(i)].joints == k + 1; ++i) {
      const auto at = static_cast<std::size_t>(i);
      state.a[at] = f.at(model.bodies[at].capsule.a).head<3>();
      state.b[at] = f.at(model.bodies[at].capsule.b).head<3>();
    }
  });
  for (int k = 0; k < scene.carried_count; ++k) {
    const auto at = static_cast<std::size_t>(count + k), slot = static_cast<std::size_t>(k);
    state.a[at] = last.at(model.tip_in_joint * scene.carried[slot].a).head<3>();
    state.b[at] = last.at(model.tip_in_joint * scene.carried[slot].b).head<3>();
  }
}

// Where obstacle i is `time` seconds after the state: its twist goes on.
inline PlacedShape placed(const Obstacle& obstacle, const MovingPose& pose, double time) noexcept {
  PlacedShape out{obstacle.shape, pose.rotation, pose.translation + time * pose.velocity, obstacle.size};
  const double angle = time * pose.rate.norm();
  if (angle > 0.0) {
    out.rotation = Eigen::AngleAxisd(angle, pose.rate.normalized()).toRotationMatrix() * pose.rotation;
  }
  return out;
}

}  // namespace sigmaik::detail
