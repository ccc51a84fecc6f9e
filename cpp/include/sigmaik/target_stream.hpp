#pragma once
/// \file target_stream.hpp
/// Stamped samples of a pose in, one smooth target a cycle out: what stands between a camera, a tracker or a hand and
/// a Servo.

#include <array>
#include <cstdint>

#include <sigmaik/layout.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik {

/// Where the target is between samples, and after the last one.
enum class StreamMode {
  Hold,         ///< at the last sample: for devices that send only changes
  Interpolate,  ///< on a C¹ curve through the samples, `latency` ago: smooth and late
  Predict,      ///< where a constant-velocity Kalman filter expects it now: in time, noisier where the target turns
};

/// Settings of a TargetStream.
struct TargetStreamOptions {
  StreamMode mode = StreamMode::Predict;  ///< how targets are made of samples
  double max_speed = 1.5;          ///< [m/s] > 0: nothing is faster. A sample that would have to be is an outlier.
  double max_angular_speed = 4.0;  ///< [rad/s] > 0
  /// [s] ≥ 0, time constant of the way from where the target is to where a new sample says it is; at 0 the twist jumps.
  double smoothing = 0.05;
  double latency = 0.1;              ///< [s] ≥ 0, Interpolate plays so late: the sensor's delay, and one or two samples
  double horizon = 0.1;              ///< [s] ≥ 0: so long after its last sample the target moves on as it did, …
  double timeout = 0.3;              ///< [s] ≥ horizon, > 0: … and by then it has come to rest, and the stream is stale
  double noise_linear = 2e-3;        ///< [m] > 0, standard deviation of a sample, each axis
  double noise_angular = 1e-2;       ///< [rad] > 0
  double acceleration_linear = 3.0;  ///< [m/s²] > 0, standard deviation of what the target may do between samples
  double acceleration_angular = 10.0;  ///< [rad/s²] > 0
  int relocate = 5;  ///< ≥ 1: so many refused samples in a row that agree with each other are believed
};

/// What became of a sample.
enum class SampleStatus : std::int8_t {
  Accepted = 0,
  Relocated = 1,   ///< accepted after a run of refused ones: the target is somewhere else, or the clock was set
  Outlier = 2,     ///< refused: too far from the last one for max_speed or max_angular_speed
  OutOfOrder = 3,  ///< refused: its stamp is not later than the last one's
  Invalid = 4,     ///< refused: not finite, not a pose, or more than 10⁹ m away
};

/// How many samples had which fate.
struct SampleCounts {
  std::int64_t accepted = 0;      ///< relocated ones included
  std::int64_t relocated = 0;     ///< samples of SampleStatus::Relocated
  std::int64_t outliers = 0;      ///< samples of SampleStatus::Outlier
  std::int64_t out_of_order = 0;  ///< samples of SampleStatus::OutOfOrder
  std::int64_t invalid = 0;       ///< samples of SampleStatus::Invalid
};

/// What a target is, ordered from the best to the worst.
enum class StreamStatus : std::int8_t {
  Tracking = 0,  ///< as the samples say, or within the horizon of the last one
  Coasting = 1,  ///< longer without a sample than the horizon: coming to rest
  Stale = 2,     ///< longer than the timeout: holding still
  Waiting = 3,   ///< no sample yet: where reset() said, or nowhere
};

/// "tracking", "coasting", "stale", "waiting".
const char* to_string(StreamStatus status) noexcept;
/// "accepted", "relocated", "outlier", "out of order", "invalid".
const char* to_string(SampleStatus status) noexcept;

/// Where to be now, and how to move: `servo.update(target.pose, target.twist)`.
struct Target {
  Pose pose = Pose::Identity();                 ///< tip in base
  Twist twist = Twist::Zero();                  ///< derivative of the pose: [v; ω], base axes, at its origin
  StreamStatus status = StreamStatus::Waiting;  ///< what the target is made of
  double age = 0.0;                             ///< [s] since the newest sample was taken; 0 before the first
};

/// The way from a sensor to a servo: samples come when they come, late, doubled, wrong or not at all; targets go out
/// each cycle. They are continuous, with their twist, and never faster than max_speed and max_angular_speed: not when a
/// sample arrives, not when the stream stops or starts again, not when the target is found elsewhere.
///
///     stream.push(stamp, pose);                    // whenever there is one: stamp = when it was taken
///     const Target target = stream.at(now);        // each cycle, on the same clock
///     servo.update(target.pose, target.twist);
///
/// A sensor's delay needs no setting: Predict looks ahead from the stamp to now. Not to be shared between threads
/// without a lock.
///
/// *Model.* The samples make a motion R(t): held, interpolated, or predicted. Interpolated is cubic between samples, in
/// R³ and in the chart φ = log(R R_aᵀ) of the earlier one, with the slopes of the parabola through three neighbours.
/// Predicted is an extended Kalman filter for p, v and R, ω with ṗ = v, Ṙ = [ω]× R, errors p = p̂ + e, R = exp(η) R̂
/// (invariant under a change of base, Barrau and Bonnabel 2017), and an acceleration that is constant between samples.
/// With noise that is alike in all directions, and to first order in the angle turned between samples, its covariances
/// are 2×2 ⊗ I₃: one gain for place and one for velocity, linear and angular. After `horizon` without a sample, v and ω
/// fade to rest by `timeout`.
///
/// *Output.* The target is exp(d(t)) R(t), with the difference d from the motion decaying as d̈ = −2ḋ/τ − d/τ², τ the
/// `smoothing`, from where it was, and as fast as it was, in the cycle before: so neither pose nor twist jump when a
/// sample changes the motion. d is accelerated by the largest speed per τ at most, and steps beyond the largest speeds
/// are shortened.
class TargetStream {
 public:
  /// \throws Error where an option is out of its range
  explicit TargetStream(const TargetStreamOptions& options = {});

  /// Forgets everything. The next target is where the first sample is.
  void reset() noexcept;

  /// Forgets everything. The next target is at `start`, such as the tip's pose, and goes to the samples from there.
  /// \throws Error where it is not a pose
  void reset(const Pose& start);

  /// A sample: when it was taken [s], and the pose then. Real time.
  SampleStatus push(double time, const Pose& pose) noexcept;

  /// The target at a time [s] not before that of the last call; else, or where it is not finite, the last one again.
  /// Real time.
  Target at(double time) noexcept;

  /// The settings, as given.
  const TargetStreamOptions& options() const noexcept { return options_; }
  /// What became of the samples since the last reset().
  const SampleCounts& counts() const noexcept { return counts_; }

 private:
  struct Sample {
    double time = 0.0;
    Pose pose = Pose::Identity();  ///< tip in base
  };
  struct Motion {
    Pose pose = Pose::Identity();  ///< tip in base
    Twist twist = Twist::Zero();
  };
  // Covariance of place and velocity; each entry stands for a multiple of I₃.
  struct Covariance {
    double place, cross, velocity;
  };
  static constexpr int kHistory = 64;  // number of samples that Interpolate keeps

  const Sample& sample(int i) const noexcept { return history_[static_cast<std::size_t>((first_ + i) % kHistory)]; }
  bool reachable(const Sample& from, const Sample& to) const noexcept;
  void start(const Sample& sample) noexcept;
  void extend(const Sample& sample) noexcept;
  void correct(const Sample& sample) noexcept;
  Twist slope(int i) const noexcept;
  Motion coast(const Motion& from, double seconds) const noexcept;
  Motion motion(double time) const noexcept;
  StreamStatus status(double time) const noexcept;
  void place(const Motion& now) noexcept;
  void approach(const Motion& then, const Motion& now, double dt) noexcept;

  TargetStreamOptions options_;
  SampleCounts counts_;
  std::array<Sample, kHistory> history_;  // a ring; Hold and Predict need only the newest sample
  int first_ = 0, count_ = 0;
  Motion estimate_;  // of Predict, at the time of the newest sample
  Covariance linear_{}, angular_{};
  Sample candidate_;  // the last refused sample
  int candidates_ = 0;
  Target last_;
  double time_ = 0.0;
  bool placed_ = false, timed_ = false;  // whether last_.pose is set, and whether time_ is set
};

SIGMAIK_SAME_LAYOUT(TargetStream, TargetStreamOptions, SampleCounts, Target);

}  // namespace sigmaik
