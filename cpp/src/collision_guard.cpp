// Distances of a cycle, and the rows that bound the heading.

#include "collision_guard.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "stopping.hpp"

namespace sigmaik::detail {
namespace {

constexpr double kFollow = 0.2;      // [s] for which an obstacle goes on without news
constexpr double kTolerance = 1e-7;  // [m/s] a row that is broken by less is met

double extent_of(const Obstacle& obstacle) noexcept {
  switch (obstacle.shape) {
    case Obstacle::Shape::Sphere: return obstacle.size[0];
    case Obstacle::Shape::Capsule: return obstacle.size[0] + 0.5 * obstacle.size[1];
    case Obstacle::Shape::Box: return 0.5 * obstacle.size.norm();
    case Obstacle::Shape::Cylinder: return std::hypot(obstacle.size[0], 0.5 * obstacle.size[1]);
    case Obstacle::Shape::HalfSpace: break;
  }
  return 0.0;  // it does not turn
}

}  // namespace

CollisionGuard::CollisionGuard(std::shared_ptr<CollisionModel> model, double gain)
    : model_(std::move(model)),
      gain_(gain),
      lower_(model_->pairs.size(), 0.0),
      is_exact_(model_->pairs.size(), 0),
      floor_(model_->pairs.size(), model_->options.margin - kRounding) {
  for (JointVector& row : row_) row = JointVector::Zero(model_->chain.dof());
}

int CollisionGuard::pair_count() const noexcept {
  return scene_.carried_count > 0 ? static_cast<int>(model_->pairs.size()) : model_->pairs_without_carried;
}

bool CollisionGuard::present(const BodyPair& pair) const noexcept {
  return !pair.carried || pair.body < model_->first_carried() + scene_.carried_count;
}

double CollisionGuard::radius(int body) const noexcept {
  const int slot = body - model_->first_carried();
  return slot < 0 ? model_->bodies[static_cast<std::size_t>(body)].capsule.radius
                  : scene_.carried[static_cast<std::size_t>(slot)].radius;
}

void CollisionGuard::place_obstacles() noexcept {
  moving_ = false;
  for (std::size_t i = 0; i < model_->obstacles.size(); ++i) {
    const Obstacle& obstacle = model_->obstacles[i];
    const MovingPose& pose = scene_.obstacles[i];
    const bool follows = scene_age_ < kFollow;
    obstacles_[i] = placed(obstacle, pose, std::min(scene_age_, kFollow));
    const double rate = pose.rate.norm(), extent = extent_of(obstacle);
    speed_[i] = follows ? pose.velocity.norm() + rate * extent : 0.0;
    spin_[i] = follows ? rate * rate * extent : 0.0;
    if (speed_[i] > 0.0) moving_ = true;
  }
}

// The reach of the joints, with what prismatic joints in between add: now, and along a stop.
void CollisionGuard::reach_now(const StopPath* path) noexcept {
  const Chain& chain = model_->chain;
  const int count = model_->first_carried() + scene_.carried_count;
  for (int i = 0; i < count; ++i) {
    const ArmBody& body = model_->bodies[static_cast<std::size_t>(i)];
    auto& reach = reach_[static_cast<std::size_t>(i)];
    double more = 0.0;
    if (i >= model_->first_carried()) {
      const Capsule& c = scene_.carried[static_cast<std::size_t>(i - model_->first_carried())];
      more = std::max((model_->tip_in_joint * c.a).norm(), (model_->tip_in_joint * c.b).norm());
    }
    for (int j = body.joints - 1; j >= 0; --j) {
      const auto at = static_cast<std::size_t>(j);
      const bool slides = chain.constants()[at].prismatic;
      reach[at] = slides ? 1.0 : body.reach[at] + more;
      if (slides) more += std::abs(q_[j]) + (path != nullptr ? path->reach()[j] : 0.0);
    }
  }
}

void CollisionGuard::travels(const JointVector& of_joint, Travel& travel) const noexcept {
  const int count = model_->first_carried() + scene_.carried_count;
  for (int i = 0; i < count; ++i) {
    const int joints = model_->bodies[static_cast<std::size_t>(i)].joints;
    auto& sums = travel[static_cast<std::size_t>(i)];
    const auto& reach = reach_[static_cast<std::size_t>(i)];
    sums[static_cast<std::size_t>(joints)] = 0.0;
    for (int j = joints - 1; j >= 0; --j) {
      const auto at = static_cast<std::size_t>(j);
      sums[at] = sums[at + 1] + reach[at] * of_joint[j];
    }
  }
}

// A lower bound of the distance, from the balls around the bodies.
double CollisionGuard::coarse(const BodyPair& pair) const noexcept {
  const auto at = static_cast<std::size_t>(pair.body);
  const Vector3 middle = 0.5 * (state_.a[at] + state_.b[at]);
  const double extent = 0.5 * (state_.b[at] - state_.a[at]).norm() + radius(pair.body);
  if (!pair.obstacle()) {
    const auto other = static_cast<std::size_t>(pair.other);
    const Vector3 center = 0.5 * (state_.a[other] + state_.b[other]);
    return (middle - center).norm() - extent - 0.5 * (state_.b[other] - state_.a[other]).norm() - radius(pair.other);
  }
  const auto i = static_cast<std::size_t>(pair.other - kMaxBodies);
  const PlacedShape& shape = obstacles_[i];
  if (shape.shape == Obstacle::Shape::HalfSpace) {
    return (middle - shape.center).dot(shape.rotation.col(2)) - extent;
  }
  return (middle - shape.center).norm() - extent - extent_of(model_->obstacles[i]);
}

Nearest CollisionGuard::nearest_of(const BodyPair& pair) const noexcept {
  const auto at = static_cast<std::size_t>(pair.body);
  Nearest found;
  if (pair.obstacle()) {
    found = segment_to_shape(state_.a[at], state_.b[at], obstacles_[static_cast<std::size_t>(pair.other - kMaxBodies)]);
  } else {
    const auto other = static_cast<std::size_t>(pair.other);
    found = segment_to_segment(state_.a[at], state_.b[at], state_.a[other], state_.b[other]);
    found.distance -= radius(pair.other);
  }
  found.distance -= radius(pair.body);
  return found;
}

double CollisionGuard::distance(const BodyPair& pair, const BodyState& state, double time) const noexcept {
  const auto at = static_cast<std::size_t>(pair.body);
  if (!pair.obstacle()) {
    const auto other = static_cast<std::size_t>(pair.other);
    return segment_to_segment(state.a[at], state.b[at], state.a[other], state.b[other]).distance - radius(pair.other) -
           radius(pair.body);
  }
  const auto i = static_cast<std::size_t>(pair.other - kMaxBodies);
  if (speed_[i] > 0.0) {
    const PlacedShape ahead = placed(model_->obstacles[i], scene_.obstacles[i], std::min(scene_age_ + time, kFollow));
    return segment_to_shape(state.a[at], state.b[at], ahead).distance - radius(pair.body);
  }
  return segment_to_shape(state.a[at], state.b[at], obstacles_[i]).distance - radius(pair.body);
}

double CollisionGuard::exact(int k) noexcept {
  const auto at = static_cast<std::size_t>(k);
  if (is_exact_[at] == 0) {
    lower_[at] = nearest_of(pair(k)).distance;
    is_exact_[at] = 1;
  }
  return lower_[at];
}

void CollisionGuard::look(const JointVector& q, double dt) noexcept {
  q_ = q;
  scene_age_ += dt;
  if (model_->scene.read(scene_, version_)) {
    scene_age_ = 0.0;
    sure_ = false;
  }
  if (moving_ || dt == 0.0 || scene_age_ == 0.0) place_obstacles();
  if (moving_) sure_ = false;
  place_bodies(*model_, q, scene_, state_);
  reach_now(nullptr);
  const int count = pair_count();
  clearance_ = kInfinity;
  for (int k = 0; k < count; ++k) {
    const auto at = static_cast<std::size_t>(k);
    lower_[at] = present(pair(k)) ? coarse(pair(k)) : kInfinity;
    is_exact_[at] = 0;
  }
  // The pair that was the nearest leaves few others to compute.
  if (nearest_ >= 0 && nearest_ < count && present(pair(nearest_)))
    clearance_ = exact(nearest_);
  else
    nearest_ = -1;
  for (int k = 0; k < count; ++k) {
    if (!(lower_[static_cast<std::size_t>(k)] < clearance_)) continue;
    const double found = exact(k);
    if (found < clearance_) {
      clearance_ = found;
      nearest_ = k;
    }
  }
}

void CollisionGuard::begin() noexcept {
  rows_ = 0;
  std::uint64_t version = version_;
  SceneState scene;
  if (!model_->scene.read(scene, version)) return;
  look(q_, 0.0);
}

Proximity CollisionGuard::proximity() noexcept {
  Proximity out;
  if (nearest_ < 0) return out;
  const BodyPair& found = pair(nearest_);
  const Nearest at = nearest_of(found);
  out.distance = at.distance;
  out.body = found.body;
  out.other = model_->name_index(found.other);
  out.point = at.point - radius(found.body) * at.normal;
  out.other_point = out.point - at.distance * at.normal;
  return out;
}

CollisionGuard::Braking CollisionGuard::braking(const JointVector& qdot, const LimitTracker& tracker) const noexcept {
  Braking out{kInfinity, kInfinity, 0.0};
  for (int i = 0; i < qdot.size(); ++i) {
    const double size = std::abs(qdot[i]);
    if (!(size > 0.0)) continue;
    out.a = std::min(out.a, kArrivalAcceleration * tracker.deceleration_limit(i) / size);
    out.j = std::min(out.j, kArrivalJerk * tracker.jerk_limit(i) / size);
  }
  out.time = 1.0 / gain_;
  if (out.a < kInfinity) {
    out.time = std::max(out.time, 0.5 * (1.0 / out.a + (out.j < kInfinity ? out.a / out.j : 0.0)));
  } else if (out.j < kInfinity) {
    out.time = std::max(out.time, std::sqrt(1.0 / out.j));
  }
  return out;
}

bool CollisionGuard::allows(const JointVector& qdot, const LimitTracker& tracker) noexcept {
  const Braking brake = braking(qdot, tracker);
  Travel rate;
  travels(qdot.cwiseAbs(), rate);
  const double kept = model_->options.margin + model_->reserve;
  const int count = pair_count();
  bool allowed = true;
  for (int k = 0; k < count; ++k) {
    const BodyPair& p = pair(k);
    double speed = rate[static_cast<std::size_t>(p.body)][static_cast<std::size_t>(p.first)];
    if (p.obstacle()) speed += speed_[static_cast<std::size_t>(p.other - kMaxBodies)];
    const double far = kept + speed * brake.time;
    if (lower_[static_cast<std::size_t>(k)] > far || exact(k) > far) continue;
    if (!add_rows(k, qdot, tracker, brake)) allowed = false;
  }
  return allowed;
}

// The rows of a pair: at its nearest points, and at the ends of both segments.
bool CollisionGuard::add_rows(int k, const JointVector& qdot, const LimitTracker& tracker,
                              const Braking& brake) noexcept {
  const BodyPair& p = pair(k);
  const auto at = static_cast<std::size_t>(p.body);
  const Vector3 &a = state_.a[at], &b = state_.b[at];
  const Nearest nearest = nearest_of(p);
  bool kept = add_row(5 * k, p, nearest, qdot, tracker, brake);
  const auto another = [&](int key, Nearest found) {
    found.distance -= radius(p.body);
    if (!p.obstacle()) found.distance -= radius(p.other);
    const bool same = (found.point - nearest.point).squaredNorm() < 1e-16 &&
                      std::abs(found.distance - nearest.distance) < 1e-9;
    if (!same && !add_row(5 * k + key, p, found, qdot, tracker, brake)) kept = false;
  };
  if (p.obstacle()) {
    const PlacedShape& shape = obstacles_[static_cast<std::size_t>(p.other - kMaxBodies)];
    another(1, segment_to_shape(a, a, shape));
    another(2, segment_to_shape(b, b, shape));
    return kept;
  }
  const auto other = static_cast<std::size_t>(p.other);
  const Vector3 &c = state_.a[other], &d = state_.b[other];
  another(1, segment_to_segment(a, a, c, d));
  another(2, segment_to_segment(b, b, c, d));
  another(3, segment_to_segment(a, b, c, c));
  another(4, segment_to_segment(a, b, d, d));
  return kept;
}

// Returns whether q̇ keeps the bound of one point. Appends the row where it does not.
bool CollisionGuard::add_row(int key, const BodyPair& p, const Nearest& at, const JointVector& qdot,
                             const LimitTracker& tracker, const Braking& brake) noexcept {
  const double room = at.distance - model_->options.margin - model_->reserve;
  JointVector row = JointVector::Zero(qdot.size());
  double speed = 0.0, back = 0.0;  // of the approach; of a recovery, at most
  for (int j = p.first; j < p.last; ++j) {
    const auto joint = static_cast<std::size_t>(j);
    const Vector3& axis = state_.axis[joint];
    const double slope = model_->chain.constants()[joint].prismatic
                             ? axis.dot(at.normal)
                             : axis.cross(at.point - state_.origin[joint]).dot(at.normal);
    row[j] = -slope;
    speed += row[j] * qdot[j];
    if (slope != 0.0) back = std::max(back, std::abs(slope) * tracker.velocity_limit(j));
  }
  double bound = gain_ * room;
  if (room < 0.0) {
    bound = std::max(bound, -tracker.options().recovery_speed * back);
  } else if (speed > 0.0) {
    bound = std::min(bound, speed * speed_before(room / speed, brake.a, brake.j));
  }
  if (p.obstacle()) {
    const auto i = static_cast<std::size_t>(p.other - kMaxBodies);
    if (speed_[i] > 0.0) {
      const MovingPose& pose = scene_.obstacles[i];
      const Vector3 contact = at.point - (at.distance + radius(p.body)) * at.normal;
      bound -= at.normal.dot(pose.velocity + pose.rate.cross(contact - obstacles_[i].center));
    }
  }
  if (speed <= bound + kTolerance) return true;
  int place = 0;
  while (place < rows_ && key_[static_cast<std::size_t>(place)] != key) ++place;
  if (place == kMaxInequalities) return true;  // the check of the stop is left
  const auto slot = static_cast<std::size_t>(place);
  bound_[slot] = place < rows_ ? std::min(bound_[slot], bound) : bound;
  key_[slot] = key;
  row_[slot] = row;
  rows_ = std::max(rows_, place + 1);
  return false;
}

}  // namespace sigmaik::detail
