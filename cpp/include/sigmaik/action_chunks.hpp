#pragma once
/// \file action_chunks.hpp
/// Chunks of a policy's actions in, one smooth target a cycle out: the link between a learned policy and a Servo.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <sigmaik/layout.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/target_stream.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik {

/// Settings of ActionChunks.
struct ActionChunksOptions {
  double dt_action = 0.1;  ///< [s] > 0, from one action of a chunk to the next
  /// [s], from the stamp of a chunk to the time of its first action: 0 where the first action is for the time of the
  /// observation, dt_action where it is for the step after it.
  double first = 0.0;
  /// [s] ≥ 0: the difference that a new chunk makes decays to a tenth in 3.9 `smoothing`, about as long as chunks of a
  /// policy overlap. The acceleration is at most max_speed/smoothing, the jerk 4.2 max_speed/smoothing².
  double smoothing = 0.1;
  double max_speed = 1.5;          ///< [m/s] > 0: the target is never faster
  double max_angular_speed = 4.0;  ///< [rad/s] > 0
  /// [s] ≥ 0: so long takes the stop at the end of a chunk that no other chunk has replaced. It begins half as long
  /// before the last action, which is where the target comes to rest. From 1.8 `smoothing` on the target keeps to the
  /// way there from any speed; a shorter stop goes beyond the last action, as the bounds above ask for, and comes back.
  double stop_time = 0.3;
  int max_actions = 128;  ///< 1 to 10 000: longer chunks are refused. The memory is allocated by the constructor.
};

/// How a chunk was treated.
enum class ChunkStatus : std::int8_t {
  Accepted = 0,
  Expired = 1,     ///< refused: the time of its last action is over
  OutOfOrder = 2,  ///< refused: its stamp is not later than that of a chunk that was accepted
  /// refused: not finite, not poses, empty, too long, twists without a start, or a stamp more than 1 s in the future
  Invalid = 3,
};

/// Number of chunks with each status, and of actions.
struct ChunkCounts {
  std::int64_t accepted = 0;      ///< chunks of ChunkStatus::Accepted
  std::int64_t expired = 0;       ///< chunks of ChunkStatus::Expired
  std::int64_t out_of_order = 0;  ///< chunks of ChunkStatus::OutOfOrder
  std::int64_t invalid = 0;       ///< chunks of ChunkStatus::Invalid
  std::int64_t missed = 0;        ///< actions of accepted chunks whose time was over when the chunk came
  std::int64_t fast = 0;   ///< actions that need more than max_speed or max_angular_speed: they are followed late
  std::int64_t rough = 0;  ///< actions whose rotation was made one, see is_rough()
};

/// What the target does, ordered from the best to the worst.
enum class ActionStatus : std::int8_t {
  Tracking = 0,  ///< on the newest chunk
  Blending = 1,  ///< on the way to it: from an older chunk, from rest, or because its actions are too fast
  Late = 2,      ///< the newest chunk is nearly used up: coming to rest at its last action
  Starved = 3,   ///< the newest chunk is used up: holding its last action
  Waiting = 4,   ///< no chunk yet: where reset() said, or nowhere
};

/// "tracking", "blending", "late", "starved", "waiting".
const char* to_string(ActionStatus status) noexcept;
/// "accepted", "expired", "out of order", "invalid".
const char* to_string(ChunkStatus status) noexcept;

/// Pose and twist for this cycle: `servo.update(target.pose, target.twist)`.
struct ActionTarget {
  Pose pose = Pose::Identity();                 ///< tip in base
  Twist twist = Twist::Zero();                  ///< derivative of the pose: [v; ω], base axes, at its origin
  ActionStatus status = ActionStatus::Waiting;  ///< what the target does
  /// [m, rad] what is not done: from the target to where the newest chunk is at this time, base axes.
  Twist behind = Twist::Zero();
  double age = 0.0;   ///< [s] since the stamp of the chunk; 0 before the first
  double left = 0.0;  ///< [s] until the last action of the chunk; negative after it
};

/// The link from a policy to a servo. A policy looks at the arm (the chunk's stamp), thinks, and sends the actions of
/// the next second, which come 50 to 300 ms late, overlap the chunk before, or do not come at all. Targets go out each
/// cycle.
///
///     chunks.push(stamp, poses);                     // for each chunk; stamp: when its observation was made
///     const ActionTarget target = chunks.at(now);    // each cycle, on the same clock
///     servo.update(target.pose, target.twist);
///
/// Threads that share one object need a lock.
///
/// *Model.* Action i of a chunk of poses is for the time stamp + first + i dt_action: what a chunk says of the time
/// before its arrival is over, and is not done again, so that a late chunk neither goes back nor repeats a way. Between
/// its actions a chunk is a curve of fifth degree with a continuous acceleration (TargetStream::knot's law), through
/// every action. Twist i of a chunk of twists is the mean twist from stamp + first + i dt_action to the next: the
/// twists are summed up to k + 1 poses, and the chunk is anchored so that at the time of its first cycle its pose is
/// the target's: only the difference of twists is left.
///
/// *End of a chunk.* Where no other chunk comes, the clock of the chunk slows down on its last stop_time/2, as
/// 1 − 3u² + 2u³, u from 0 to 1 in stop_time: ∫(1 − 3u² + 2u³) du = 1/2, so that the clock stands still at the last
/// action. The target stays on the policy's way, and comes to rest where the policy has been heading.
///
/// *Output.* The law of TargetStream: the difference from the chunk's motion has a triple pole and starts, when another
/// chunk becomes the newest, from pose, twist and acceleration of the last target. None of the three jumps, whatever
/// the chunks say. Where chunks agree, the difference is zero and stays zero. Speed, acceleration (max_speed/smoothing)
/// and jerk (4.2 max_speed/smoothing²) are bounded, linear and angular; see target_stream.hpp for the proof.
class ActionChunks {
 public:
  /// \throws Error where an option is out of its range
  explicit ActionChunks(const ActionChunksOptions& options = {});

  /// Forgets everything. The next target is where the first chunk is.
  void reset() noexcept;

  /// Forgets everything. The next target is at `start`, such as the tip's pose, and goes to the chunks from there.
  /// \throws Error where `start` is not a pose
  void reset(const Pose& start);

  /// Adds a chunk of poses of the tip in base. Real time.
  /// \param stamp [s] when the observation was made, on the clock of at()
  ChunkStatus push(double stamp, std::span<const Pose> poses) noexcept;

  /// Adds a chunk of twists [v; ω], base axes, at the tip's origin. It needs a target to start from: reset(start), or a
  /// chunk of poses before it. Real time.
  ChunkStatus push_twists(double stamp, std::span<const Twist> twists) noexcept;

  /// The target at `time` [s]. If `time` is before that of the last call, or not finite, the answer is the last target
  /// without its twist. A clock that was set back by more than 1 s starts anew: chunks of the old clock are forgotten,
  /// and the target stays where it is, ActionStatus::Waiting, until a chunk of the new clock comes. A chunk that came
  /// before the first call and has a stamp more than 1 s after it is forgotten, too. Real time.
  ActionTarget at(double time) noexcept;

  /// The settings, as given.
  const ActionChunksOptions& options() const noexcept { return options_; }
  /// Counts since the last reset().
  const ChunkCounts& counts() const noexcept { return counts_; }

 private:
  void forget() noexcept;
  using Motion = detail::PoseMotion;
  // The actions of a chunk as a motion; `count` of the knots are used.
  struct Chunk {
    double stamp = 0.0;
    bool anchored = true;  // false: the poses start anywhere, see anchor()
    int count = 0;
    std::vector<Motion> knots;
  };
  // The newest chunk in use, and those whose time has not come.
  static constexpr int kChunks = 4;

  Chunk& chunk(int i) noexcept { return chunks_[static_cast<std::size_t>((first_ + i) % kChunks)]; }
  const Chunk& chunk(int i) const noexcept { return chunks_[static_cast<std::size_t>((first_ + i) % kChunks)]; }
  double begin(const Chunk& chunk) const noexcept { return chunk.stamp + options_.first; }
  double end(const Chunk& chunk) const noexcept { return begin(chunk) + (chunk.count - 1) * options_.dt_action; }
  ChunkStatus judge(double stamp, std::size_t actions, std::size_t knots) noexcept;
  ChunkStatus refuse(ChunkStatus status) noexcept;
  Chunk& next() noexcept;
  void shape(Chunk& chunk) noexcept;
  void anchor(Chunk& chunk, double time) noexcept;
  bool advance(double time) noexcept;
  Motion motion(const Chunk& chunk, double time) const noexcept;
  ActionStatus status(const Chunk& chunk, double time) const noexcept;

  ActionChunksOptions options_;
  ChunkCounts counts_;
  std::array<Chunk, kChunks> chunks_;  // a ring
  int first_ = 0, count_ = 0;
  bool running_ = false;  // chunk(0) is in use; else its time has not come
  double newest_ = 0.0;   // stamp of the newest chunk, where count_ > 0
  ActionTarget last_;
  Twist acceleration_ = Twist::Zero();  // of last_, the derivative of its twist
  double time_ = 0.0;
  bool placed_ = false, timed_ = false;  // whether last_.pose is set, and whether time_ is set
};

SIGMAIK_SAME_LAYOUT(ActionChunks, ActionChunksOptions, ChunkCounts, ActionTarget);

}  // namespace sigmaik
