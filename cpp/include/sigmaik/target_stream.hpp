#pragma once
/// \file target_stream.hpp
/// Stamped samples of a pose in, one smooth target a cycle out: the link between a camera, a tracker or a hand and a
/// Servo.

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
  double max_speed = 1.5;          ///< [m/s] > 0: the target is never faster. A sample that needs more is an outlier.
  double max_angular_speed = 4.0;  ///< [rad/s] > 0
  /// [s] ≥ 0, time constant of the decay of the difference that a new sample makes; at 0 the twist jumps.
  double smoothing = 0.05;
  double latency = 0.1;                ///< [s] ≥ 0, delay of Interpolate: the sensor's delay, and one or two samples
  double horizon = 0.1;                ///< [s] ≥ 0: how long the target keeps its twist after the last sample
  double timeout = 0.3;                ///< [s] ≥ horizon, > 0: by then the target is at rest, and the stream is stale
  double noise_linear = 2e-3;          ///< [m] > 0, standard deviation of a sample, each axis
  double noise_angular = 1e-2;         ///< [rad] > 0
  double acceleration_linear = 3.0;    ///< [m/s²] > 0, standard deviation of the target's acceleration between samples
  double acceleration_angular = 10.0;  ///< [rad/s²] > 0
  int relocate = 5;  ///< ≥ 1: so many refused samples in a row that agree with each other are accepted
};

/// How a sample was treated.
enum class SampleStatus : std::int8_t {
  Accepted = 0,
  Relocated = 1,   ///< accepted after a run of refused ones: the target is somewhere else, or the clock was set
  Outlier = 2,     ///< refused: too far from the last one for max_speed or max_angular_speed
  OutOfOrder = 3,  ///< refused: its stamp is not later than the last one's
  Invalid = 4,     ///< refused: not finite, not a pose, or more than 10⁹ m away
};

/// Number of samples with each status.
struct SampleCounts {
  std::int64_t accepted = 0;      ///< relocated ones included
  std::int64_t relocated = 0;     ///< samples of SampleStatus::Relocated
  std::int64_t outliers = 0;      ///< samples of SampleStatus::Outlier
  std::int64_t out_of_order = 0;  ///< samples of SampleStatus::OutOfOrder
  std::int64_t invalid = 0;       ///< samples of SampleStatus::Invalid
};

/// The state of the stream, ordered from the best to the worst.
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

/// Pose and twist for this cycle: `servo.update(target.pose, target.twist)`.
struct Target {
  Pose pose = Pose::Identity();                 ///< tip in base
  Twist twist = Twist::Zero();                  ///< derivative of the pose: [v; ω], base axes, at its origin
  StreamStatus status = StreamStatus::Waiting;  ///< the state of the stream
  double age = 0.0;                             ///< [s] since the newest sample was taken; 0 before the first
};

/// The link from a sensor to a servo: samples come at any time, late, doubled, wrong or not at all; targets go out each
/// cycle. Pose and twist of the targets are continuous and never faster than max_speed and max_angular_speed, also when
/// a sample arrives, when the stream stops or starts again, or when the target is found elsewhere.
///
///     stream.push(stamp, pose);                    // for each sample; stamp: when the sample was taken
///     const Target target = stream.at(now);        // each cycle, on the same clock
///     servo.update(target.pose, target.twist);
///
/// A sensor's delay needs no setting: Predict looks ahead from the stamp to now. Threads that share one object need a
/// lock.
///
/// *Model.* The samples make a motion R(t): held, interpolated, or predicted. An interpolated motion is cubic between
/// samples, in R³ and in the chart φ = log(R R_aᵀ) of the earlier sample, with the slopes of the parabola through three
/// neighbours. A predicted motion comes from an extended Kalman filter for p, v and R, ω with ṗ = v, Ṙ = [ω]× R, errors
/// p = p̂ + e, R = exp(η) R̂ (invariant under a change of base, Barrau and Bonnabel 2017), and an acceleration that is
/// constant between samples. With isotropic noise, and to first order in the angle turned between samples, its
/// covariances are 2×2 ⊗ I₃: one gain for position and one for velocity, linear and angular. After `horizon` without a
/// sample, v and ω fade to rest by `timeout`.
///
/// *Output.* The target is exp(d(t)) R(t). The difference d from the motion decays as d̈ = −2ḋ/τ − d/τ², where τ is
/// `smoothing`. When a sample changes the motion, d and ḋ start from the target of the cycle before, so neither pose
/// nor twist jumps. The acceleration of d is at most the largest speed per τ, and steps beyond the largest speeds are
/// shortened.
class TargetStream {
 public:
  /// \throws Error where an option is out of its range
  explicit TargetStream(const TargetStreamOptions& options = {});

  /// Forgets everything. The next target is where the first sample is.
  void reset() noexcept;

  /// Forgets everything. The next target is at `start`, such as the tip's pose, and goes to the samples from there.
  /// \throws Error where `start` is not a pose
  void reset(const Pose& start);

  /// Adds a sample: the time [s] at which it was taken, and the pose at this time. Real time.
  SampleStatus push(double time, const Pose& pose) noexcept;

  /// The target at `time` [s]. If `time` is before that of the last call, or not finite, the answer is the last target.
  /// Real time.
  Target at(double time) noexcept;

  /// The settings, as given.
  const TargetStreamOptions& options() const noexcept { return options_; }
  /// Counts of the samples since the last reset().
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
  // Covariance of position and velocity; each entry stands for a multiple of I₃.
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
