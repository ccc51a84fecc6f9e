// The check of a command: whether the stop after the command keeps every pair at the margin.

#include <algorithm>
#include <cmath>

#include "collision_guard.hpp"

namespace sigmaik::detail {

bool CollisionGuard::shield(const LimitTracker& tracker, JointVector& qdot) noexcept {
  const double dt = tracker.dt();
  if (floors_found_) std::fill(floor_.begin(), floor_.end(), model_->options.margin - kRounding);
  floors_found_ = false;
  const StopPath path(tracker, qdot);
  if (clear(path, dt)) {
    sure_ = !moving_;
    return false;
  }
  const JointVector stop = tracker.stop(), asked = qdot;
  if (!sure_) {  // the margin may be broken already, or the stop may break it
    find_floors(tracker, path.cycles());
    if (clear(path, dt)) return false;
  }
  double kept = 0.0, broken = 1.0;
  for (int i = 0; i < kBisections; ++i) {
    const double part = 0.5 * (kept + broken);
    qdot = (stop + part * (asked - stop)).cwiseMax(tracker.bounds().lower).cwiseMin(tracker.bounds().upper);
    (clear(StopPath(tracker, qdot), dt) ? kept : broken) = part;
  }
  qdot = kept == 0.0 ? stop : JointVector(stop + kept * (asked - stop));
  qdot = qdot.cwiseMax(tracker.bounds().lower).cwiseMin(tracker.bounds().upper);
  return true;
}

// Lists the pairs that the path could bring below their floors, and looks at these.
bool CollisionGuard::clear(const StopPath& path, double dt) noexcept {
  reach_now(&path);
  Travel travel;
  travels(path.reach(), travel);
  const int count = pair_count();
  int listed = 0;
  for (int k = 0; k < count; ++k) {
    const BodyPair& p = pair(k);
    double way = travel[static_cast<std::size_t>(p.body)][static_cast<std::size_t>(p.first)];
    if (p.obstacle()) way += speed_[static_cast<std::size_t>(p.other - kMaxBodies)] * path.cycles() * dt;
    const double near = floor_[static_cast<std::size_t>(k)] + way;
    if (lower_[static_cast<std::size_t>(k)] >= near || exact(k) >= near) continue;
    listed_[static_cast<std::size_t>(listed++)] = k;
    if (listed < kListed) continue;
    if (!clear_listed(path, dt, listed)) return false;
    listed = 0;
  }
  return listed == 0 || clear_listed(path, dt, listed);
}

// Halves the intervals between the configurations that are looked at, from the first to the last cycle, until each is
// clear; those within a cycle are.
bool CollisionGuard::clear_listed(const StopPath& path, double dt, int count) noexcept {
  constexpr int kDeepest = 24;
  std::array<Look, kDeepest> ahead;  // the ends of the intervals that are left, the nearest last
  Look now;
  now.k = 0;
  now.q = q_;
  for (int i = 0; i < count; ++i) {
    const auto at = static_cast<std::size_t>(i);
    now.distance[at] = exact(listed_[at]);
  }
  int left = 1, looks = 1;
  look_ahead(path, dt, path.cycles(), count, ahead[0]);
  while (left > 0) {
    const Look& next = ahead[static_cast<std::size_t>(left - 1)];
    const Between found = between(path, dt, now, next, count);
    if (found == Between::Broken) return false;
    if (found == Between::Clear || next.k - now.k <= 1) {
      now = next;
      --left;
      continue;
    }
    if (left == kDeepest || looks++ == kLooks) return false;
    look_ahead(path, dt, now.k + (next.k - now.k) / 2, count, ahead[static_cast<std::size_t>(left)]);
    ++left;
  }
  return true;
}

void CollisionGuard::look_ahead(const StopPath& path, double dt, int k, int count, Look& look) const noexcept {
  look.k = k;
  look.q = path.q(k);
  BodyState state;
  place_bodies(*model_, look.q, scene_, state);
  for (int i = 0; i < count; ++i) {
    const auto at = static_cast<std::size_t>(i);
    look.distance[at] = distance(pair(listed_[at]), state, k * dt);
  }
}

CollisionGuard::Between CollisionGuard::between(const StopPath& path, double dt, const Look& from, const Look& to,
                                                int count) const noexcept {
  const JointVector change = to.q - from.q;
  JointVector bend(change.size());
  for (int j = 0; j < change.size(); ++j) bend[j] = path.bend(j, from.k, to.k, change[j]);
  const double time = (to.k - from.k) * dt;
  bool unknown = false;
  for (int i = 0; i < count; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const auto k = static_cast<std::size_t>(listed_[at]);
    const double least = std::min(from.distance[at], to.distance[at]);
    if (!(least >= floor_[k])) return Between::Broken;
    unknown = unknown || least - dip(pair(listed_[at]), change, bend, time) < floor_[k];
  }
  return unknown ? Between::Unknown : Between::Clear;
}

// ε of collisions.hpp. R_max(i,k) is that of the later joint.
double CollisionGuard::dip(const BodyPair& pair, const JointVector& change, const JointVector& bend,
                           double time) const noexcept {
  const auto& reach = reach_[static_cast<std::size_t>(pair.body)];
  double before = 0.0, turn = 0.0, out = 0.0;
  for (int j = pair.first; j < pair.last; ++j) {
    const double size = std::abs(change[j]), r = reach[static_cast<std::size_t>(j)];
    turn += r * size * (size + 2.0 * before);
    before += size;
    out += r * bend[j];
  }
  if (pair.obstacle()) out += 0.125 * time * time * spin_[static_cast<std::size_t>(pair.other - kMaxBodies)];
  return out + 0.125 * turn;
}

// The least distance that the stop leaves to each pair, where this is less than the margin. The stop, and the rest
// after it, last as long as the command's path: obstacles that move come nearer to an arm that rests, too, so that a
// command which leads away leaves more.
void CollisionGuard::find_floors(const LimitTracker& tracker, int least_cycles) noexcept {
  constexpr int kParts = 8;
  floors_found_ = true;
  const double dt = tracker.dt();
  const StopPath path(tracker, tracker.stop());
  const int cycles = moving_ ? std::max(path.cycles(), least_cycles) : path.cycles();
  reach_now(&path);
  Travel travel;
  travels(path.reach(), travel);
  const int count = pair_count();
  for (int from = 0; from < count;) {
    int listed = 0;
    for (; from < count && listed < kListed; ++from) {
      const BodyPair& p = pair(from);
      double way = travel[static_cast<std::size_t>(p.body)][static_cast<std::size_t>(p.first)];
      if (p.obstacle()) way += speed_[static_cast<std::size_t>(p.other - kMaxBodies)] * cycles * dt;
      const double near = model_->options.margin + way;
      if (lower_[static_cast<std::size_t>(from)] >= near || exact(from) >= near) continue;
      listed_[static_cast<std::size_t>(listed++)] = from;
    }
    Look last;
    look_ahead(path, dt, 0, listed, last);
    for (int part = 1; part <= kParts; ++part) {
      Look next;
      const int k = cycles * part / kParts;
      if (k == last.k) continue;
      look_ahead(path, dt, k, listed, next);
      const JointVector change = next.q - last.q;
      JointVector bend(change.size());
      for (int j = 0; j < change.size(); ++j) bend[j] = path.bend(j, last.k, k, change[j]);
      for (int i = 0; i < listed; ++i) {
        const auto at = static_cast<std::size_t>(i);
        double& floor = floor_[static_cast<std::size_t>(listed_[at])];
        double least = std::min(last.distance[at], next.distance[at]);
        if (k - last.k > 1) least -= dip(pair(listed_[at]), change, bend, (k - last.k) * dt);
        floor = std::min(floor, least - kRounding);
      }
      last = next;
    }
  }
}

}  // namespace sigmaik::detail
