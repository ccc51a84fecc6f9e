#include <sigmaik/action_chunks.hpp>

#include <algorithm>
#include <cmath>

#include "asked_pose.hpp"
#include "finite.hpp"
#include "length.hpp"
#include "message.hpp"
#include "pose_motion.hpp"

namespace sigmaik {
namespace {

using detail::require;

constexpr double kFarthest = 1e9;  // [m]: differences of positions and their squares stay finite
constexpr double kLatest = 1e12;   // [s]: differences of times keep their digits
// A difference below this part of the way that max_speed goes in `smoothing` is done.
constexpr double kDone = 0.01;
// [s] that the clocks of a policy's machine and of the robot may differ: a stamp farther in the future, or a time so
// far back, is of another clock.
constexpr double kClocksDiffer = 1.0;

void check(const char* what, double value, bool zero_allowed) {
  require(std::isfinite(value) && (value > 0.0 || (zero_allowed && value == 0.0)), what, " = ", value,
          " must be finite and ", zero_allowed ? "at least" : "above", " 0");
}

bool usable(const Pose& pose) noexcept {
  return is_pose(pose.matrix()) && pose.translation().cwiseAbs().maxCoeff() <= kFarthest;
}

}  // namespace

const char* to_string(ActionStatus status) noexcept {
  switch (status) {
    case ActionStatus::Tracking: return "tracking";
    case ActionStatus::Blending: return "blending";
    case ActionStatus::Late: return "late";
    case ActionStatus::Starved: return "starved";
    case ActionStatus::Waiting: return "waiting";
  }
  return "?";
}

const char* to_string(ChunkStatus status) noexcept {
  switch (status) {
    case ChunkStatus::Accepted: return "accepted";
    case ChunkStatus::Expired: return "expired";
    case ChunkStatus::OutOfOrder: return "out of order";
    case ChunkStatus::Invalid: return "invalid";
  }
  return "?";
}

ActionChunks::ActionChunks(const ActionChunksOptions& options) : options_(options) {
  check("dt_action", options.dt_action, false);
  require(options.dt_action >= 1e-6, "dt_action = ", options.dt_action, " s must be at least 1e-6 s");
  require(std::isfinite(options.first), "first = ", options.first, " must be finite");
  check("smoothing", options.smoothing, true);
  check("max_speed", options.max_speed, false);
  check("max_angular_speed", options.max_angular_speed, false);
  check("stop_time", options.stop_time, true);
  require(options.max_actions >= 1 && options.max_actions <= 10000, "max_actions = ", options.max_actions,
          " must be from 1 to 10000");
  for (Chunk& chunk : chunks_) chunk.knots.resize(static_cast<std::size_t>(options.max_actions) + 1);
}

void ActionChunks::reset() noexcept {
  counts_ = {};
  placed_ = timed_ = false;
  last_ = {};
  forget();
}

// No chunk is left; the target stays where it is.
void ActionChunks::forget() noexcept {
  first_ = count_ = 0;
  running_ = false;
  last_ = {.pose = last_.pose};
  acceleration_.setZero();
}

void ActionChunks::reset(const Pose& start) {
  require(usable(start), "start is not a pose, or farther than 1e9 m away");
  reset();
  last_.pose = nearest_pose(start);
  placed_ = true;
}

// Chunks -------------------------------------------------------------------------------------------------------------

ChunkStatus ActionChunks::refuse(ChunkStatus status) noexcept {
  ++(status == ChunkStatus::Expired      ? counts_.expired
     : status == ChunkStatus::OutOfOrder ? counts_.out_of_order
                                         : counts_.invalid);
  return status;
}

// Whether a chunk with these numbers of actions and of poses on its way has come in time and in order.
ChunkStatus ActionChunks::judge(double stamp, std::size_t actions, std::size_t knots) noexcept {
  if (!(std::abs(stamp + options_.first) <= kLatest) || actions == 0 ||
      actions > static_cast<std::size_t>(options_.max_actions)) {
    return refuse(ChunkStatus::Invalid);
  }
  if (timed_ && stamp > time_ + kClocksDiffer) return refuse(ChunkStatus::Invalid);
  if (count_ > 0 && stamp <= newest_) return refuse(ChunkStatus::OutOfOrder);
  const double start = stamp + options_.first;
  const double span = static_cast<double>(knots - 1) * options_.dt_action;
  if (timed_ && start + span < time_) return refuse(ChunkStatus::Expired);
  if (timed_ && start < time_) {
    counts_.missed += std::min(static_cast<std::int64_t>(actions),
                               static_cast<std::int64_t>(std::ceil((time_ - start) / options_.dt_action)));
  }
  ++counts_.accepted;
  return ChunkStatus::Accepted;
}

// The place of the next chunk: the newest of those whose time has not come gives way where there are too many.
ActionChunks::Chunk& ActionChunks::next() noexcept {
  if (count_ < kChunks) ++count_;
  return chunk(count_ - 1);
}

ChunkStatus ActionChunks::push(double stamp, std::span<const Pose> poses) noexcept {
  if (!std::all_of(poses.begin(), poses.end(), usable)) return refuse(ChunkStatus::Invalid);
  const ChunkStatus status = judge(stamp, poses.size(), poses.size());
  if (status != ChunkStatus::Accepted) return status;
  Chunk& to = next();
  to.stamp = newest_ = stamp;
  to.anchored = true;
  to.count = static_cast<int>(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const detail::AskedPose read(poses[i]);
    to.knots[i].pose = read.pose;
    if (read.rough) ++counts_.rough;
  }
  shape(to);
  return status;
}

ChunkStatus ActionChunks::push_twists(double stamp, std::span<const Twist> twists) noexcept {
  const auto sound = [&](const Twist& twist) {
    return detail::finite(twist) && twist.cwiseAbs().maxCoeff() * options_.dt_action * options_.max_actions < kFarthest;
  };
  if (!placed_ || !std::all_of(twists.begin(), twists.end(), sound)) return refuse(ChunkStatus::Invalid);
  const ChunkStatus status = judge(stamp, twists.size(), twists.size() + 1);
  if (status != ChunkStatus::Accepted) return status;
  Chunk& to = next();
  to.stamp = newest_ = stamp;
  to.anchored = false;
  to.count = static_cast<int>(twists.size()) + 1;
  to.knots[0].pose = Pose::Identity();
  for (std::size_t i = 0; i < twists.size(); ++i) {
    const Pose& from = to.knots[i].pose;
    Pose& pose = to.knots[i + 1].pose;
    pose = from;
    pose.translation() += options_.dt_action * twists[i].head<3>();
    pose.linear() = nearest_rotation(rotation_exp(options_.dt_action * twists[i].tail<3>()) * from.linear());
  }
  shape(to);
  return status;
}

// Twists and accelerations of the knots: those of the parabola through three neighbours.
void ActionChunks::shape(Chunk& chunk) noexcept {
  const double dt = options_.dt_action;
  const int last = chunk.count - 1;
  const auto at = [&](int i) -> Motion& { return chunk.knots[static_cast<std::size_t>(i)]; };
  at(0).twist.setZero();
  at(0).acceleration.setZero();
  for (int i = 0; i < last; ++i) {
    const Twist mean = pose_error(at(i).pose, at(i + 1).pose) / dt;
    if (detail::length(mean.head<3>()) > options_.max_speed ||
        detail::length(mean.tail<3>()) > options_.max_angular_speed) {
      ++counts_.fast;
    }
    at(i + 1).acceleration.setZero();
    at(i + 1).twist = mean;  // for now: of the way to the knot
    if (i == 0) {
      at(0).twist = mean;
      continue;
    }
    at(i).acceleration = (mean - at(i).twist) / dt;
    at(i).twist = 0.5 * (mean + at(i).twist);
  }
  if (last < 2) return;
  at(0).acceleration = at(1).acceleration;
  at(0).twist -= 0.5 * dt * at(0).acceleration;
  at(last).acceleration = at(last - 1).acceleration;
  at(last).twist += 0.5 * dt * at(last).acceleration;
}

// Moves a chunk of twists so that its pose at `time` is that of the last target.
void ActionChunks::anchor(Chunk& chunk, double time) noexcept {
  chunk.anchored = true;
  const Motion now = motion(chunk, time);
  const Eigen::Vector3d shift = last_.pose.translation() - now.pose.translation();
  const Eigen::Matrix3d turn = nearest_rotation(now.pose.linear().transpose() * last_.pose.linear());
  for (int i = 0; i < chunk.count; ++i) {
    Pose& pose = chunk.knots[static_cast<std::size_t>(i)].pose;
    pose.translation() += shift;
    pose.linear() = nearest_rotation(pose.linear() * turn);
  }
}

// Goes on to the newest chunk whose time has come. Returns whether there is a chunk to follow.
bool ActionChunks::advance(double time) noexcept {
  int newest = running_ ? 0 : -1;
  for (int i = newest + 1; i < count_; ++i) {
    if (begin(chunk(i)) <= time) newest = i;
  }
  if (newest > 0) {
    first_ = (first_ + newest) % kChunks;
    count_ -= newest;
  }
  running_ = newest >= 0;
  if (running_ && !chunk(0).anchored) anchor(chunk(0), timed_ ? time_ : time);
  return running_;
}

// Motion -------------------------------------------------------------------------------------------------------------

ActionChunks::Motion ActionChunks::motion(const Chunk& chunk, double time) const noexcept {
  const double dt = options_.dt_action, from = begin(chunk), to = end(chunk);
  // The clock of the chunk: its time since the first action, rate and rate of the rate.
  double clock = time - from, rate = 1.0, slope = 0.0;
  const double stop = std::min(options_.stop_time, 2.0 * (to - from));
  if (time > to - 0.5 * stop) {
    const double u = stop > 0.0 ? std::min(1.0, (time - to + 0.5 * stop) / stop) : 1.0;
    clock = to - from - 0.5 * stop + stop * u * (1.0 + u * u * (0.5 * u - 1.0));
    rate = 1.0 + u * u * (2.0 * u - 3.0);
    slope = stop > 0.0 ? 6.0 * u * (u - 1.0) / stop : 0.0;
  }
  Motion out;
  if (chunk.count == 1) {
    out.pose = chunk.knots[0].pose;
    return out;
  }
  if (clock < 0.0) {
    out = detail::extrapolated(chunk.knots[0], std::max(clock, -dt));
  } else {
    const int i = std::min(static_cast<int>(clock / dt), chunk.count - 2);
    const auto at = static_cast<std::size_t>(i);
    out = detail::between(chunk.knots[at], chunk.knots[at + 1], dt, std::min(1.0, (clock - i * dt) / dt));
  }
  out.acceleration = rate * rate * out.acceleration + slope * out.twist;
  out.twist *= rate;
  return out;
}

ActionStatus ActionChunks::status(const Chunk& chunk, double time) const noexcept {
  const double stop = std::min(options_.stop_time, 2.0 * (end(chunk) - begin(chunk)));
  if (time >= end(chunk) + 0.5 * stop) return ActionStatus::Starved;
  if (time > end(chunk) - 0.5 * stop) return ActionStatus::Late;
  const double done = kDone * std::max(options_.smoothing, detail::kShortest);
  const bool there = detail::length(last_.behind.head<3>()) <= done * options_.max_speed &&
                     detail::length(last_.behind.tail<3>()) <= done * options_.max_angular_speed;
  return there ? ActionStatus::Tracking : ActionStatus::Blending;
}

// Output -------------------------------------------------------------------------------------------------------------

ActionTarget ActionChunks::at(double time) noexcept {
  const bool back = timed_ && time < time_;
  if (!std::isfinite(time) || (back && time >= time_ - kClocksDiffer)) {
    ActionTarget out = last_;  // a target that stays where it is does not move
    out.twist.setZero();
    return out;
  }
  if (back) {
    forget();
    timed_ = false;
  }
  // Before the first call nobody could tell that a stamp was of another clock.
  if (!timed_ && count_ > 0 && newest_ > time + kClocksDiffer) forget();
  const double dt = timed_ ? time - time_ : 0.0;
  if (advance(time)) {
    const Chunk& newest = chunk(0);
    const Motion now = motion(newest, time);
    Motion target{last_.pose, last_.twist, acceleration_};
    if (!placed_) {
      target = {now.pose, now.twist, Twist::Zero()};
      detail::shorten(target.twist.head<3>(), options_.max_speed);
      detail::shorten(target.twist.tail<3>(), options_.max_angular_speed);
      placed_ = true;
    } else if (dt > 0.0) {
      detail::follow(motion(newest, time_), now, dt,
                     {options_.max_speed, options_.max_angular_speed, options_.smoothing}, target);
    }
    last_.pose = target.pose;
    last_.twist = target.twist;
    acceleration_ = target.acceleration;
    last_.behind = pose_error(target.pose, now.pose);
    last_.status = status(newest, time);
    last_.age = time - newest.stamp;
    last_.left = end(newest) - time;
  }
  time_ = time;
  timed_ = true;
  return last_;
}

}  // namespace sigmaik
