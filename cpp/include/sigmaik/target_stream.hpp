#pragma once
/// \file target_stream.hpp
/// Stamped samples of a pose in, one smooth target a cycle out: the link between a camera, a tracker or a hand and a
/// Servo.

#include <array>
#include <cstdint>

#include <sigmaik/layout.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik::detail {

// A pose that moves.
struct PoseMotion {
  Pose pose = Pose::Identity();        // tip in base
  Twist twist = Twist::Zero();         // [v; ω], base axes, at the pose's origin
  Twist acceleration = Twist::Zero();  // derivative of the twist
};

}  // namespace sigmaik::detail

namespace sigmaik {

/// Where the target is between samples, and after the last one.
enum class StreamMode {
  Hold,         ///< at the last sample: for devices that send only changes
  Interpolate,  ///< on a C² curve through the samples, `latency` ago: smooth and late
  Predict,      ///< where a constant-velocity Kalman filter expects it now: in time, noisier where the target turns
};

/// Settings of a TargetStream.
struct TargetStreamOptions {
  StreamMode mode = StreamMode::Predict;  ///< how targets are made of samples
  double max_speed = 1.5;          ///< [m/s] > 0: the target is never faster. A sample that needs more is an outlier.
  double max_angular_speed = 4.0;  ///< [rad/s] > 0
  /// [s] ≥ 0: the difference that a new sample makes decays to a tenth in 3.9 `smoothing`; at 0 the twist jumps.
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
  Relocated = 1,   ///< accepted after a run of refused ones: the target is somewhere else, or a clock was set
  Outlier = 2,     ///< refused: too far from the last one for max_speed or max_angular_speed
  OutOfOrder = 3,  ///< refused: its stamp is not later than the last one's
  Invalid = 4,     ///< refused: not finite, not a pose, or more than 10⁹ m away
  Ahead = 5,       ///< refused: its stamp is later than the time of at() by more than the timeout
};

/// Number of samples with each status.
struct SampleCounts {
  std::int64_t accepted = 0;      ///< relocated ones included
  std::int64_t relocated = 0;     ///< samples of SampleStatus::Relocated
  std::int64_t outliers = 0;      ///< samples of SampleStatus::Outlier
  std::int64_t out_of_order = 0;  ///< samples of SampleStatus::OutOfOrder
  std::int64_t invalid = 0;       ///< samples of SampleStatus::Invalid
  std::int64_t rough = 0;         ///< samples whose rotation was made one, see is_rough()
  std::int64_t ahead = 0;         ///< samples of SampleStatus::Ahead
  std::int64_t clock_steps = 0;   ///< steps of the clock of at(), and of the stamps against this clock
};

/// The state of the stream, ordered from the best to the worst.
enum class StreamStatus : std::int8_t {
  Tracking = 0,  ///< as the samples say, or within the horizon of the last one
  Coasting = 1,  ///< longer without a sample than the horizon: coming to rest
  Stale = 2,     ///< longer than the timeout, or a clock has stepped: holding still
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
  double age = 0.0;                             ///< [s] ≥ 0 since the newest sample was taken; 0 before the first
};

/// The link from a sensor to a servo: samples come at any time, late, doubled, wrong or not at all; targets go out each
/// cycle. Pose, twist and acceleration of the targets are continuous, and the targets are never faster than max_speed
/// and max_angular_speed, also when a sample arrives, when the stream stops or starts again, or when the target is
/// found elsewhere.
///
///     stream.push(stamp, pose);                    // for each sample; stamp: when the sample was taken
///     const Target target = stream.at(now);        // each cycle, on the same clock
///     servo.update(target.pose, target.twist);
///
/// A sensor's delay needs no setting: Predict looks ahead from the stamp to now. Threads that share one object need a
/// lock.
///
/// *Model.* The samples make a motion R(t): held, interpolated, or predicted. An interpolated motion is of fifth degree
/// between samples, in R³ and in the chart φ = log(R R_aᵀ) of the earlier sample, with the rates and accelerations of
/// the parabola through three neighbours at each sample. A predicted motion comes from an extended Kalman filter for p,
/// v and R, ω with ṗ = v, Ṙ = [ω]× R, errors p = p̂ + e, R = exp(η) R̂ (invariant under a change of base, Barrau and
/// Bonnabel 2017), and an acceleration that is constant between samples. With isotropic noise, and to first order in
/// the angle turned between samples, its covariances are 2×2 ⊗ I₃: one gain for position and one for velocity, linear
/// and angular. After `horizon` without a sample, v and ω fade to rest by `timeout`. Between two samples all three
/// motions have a continuous acceleration, unless timeout equals horizon.
///
/// *Output.* The target is exp(d(t)) R(t). The difference d from the motion has a triple pole: (D + k)³ d = 0, where D
/// is the derivative and k = e/(2τ), with τ for `smoothing` and e = 2.718. The solution (d₀ + c₁t + c₂t²/2) e^(−kt) is
/// exact for any cycle. When a sample changes the motion, d, ḋ and d̈ start from the target of the last cycle, so that
/// neither pose nor twist nor acceleration jumps. A difference at rest decays to (1 + kt + (kt)²/2) e^(−kt): to a tenth
/// in 3.9 τ, as with a double pole at 1/τ, whose acceleration would jump.
///
/// *Bounds.* The law is the same as w = x + 2ẋ/k + ẍ/k² for the target x: ẇ = u, and ẋ follows u through two lags 1/k.
/// Where a free step would exceed a bound, u is the mean of the step, shortened to the largest speed V. Speeds behind
/// lags are averages of u, so |u| ≤ V bounds the speed by V. From rest, |ẍ| ≤ V ∫|g| = 2kV/e = V/τ with the impulse
/// response g = k²(1 − kt) e^(−kt) from u to ẍ, and likewise the jerk is at most 2(1 + 1/e²) k²V = 4.2 V/τ². Both
/// bounds hold for the target as a whole, linear and angular. For d alone and a motion at rest, u = −z/k, where
/// z = (D + k)² d shrinks along its own direction, so a bounded approach does not overshoot. A motion whose own
/// u = (D + 2D²/k + D³/k²) x is longer than V is followed late: among these are fades shorter than 1.8 τ from the
/// largest speed, and interpolated samples that noise moves apart.
///
/// *Clocks that step.* A clock may be set while the arm moves. As soon as at() sees a step, the target holds still
/// where it is: its twist is zero and its status Stale; from there it goes on smoothly with the samples of the new
/// clock.
///   - The time of at() is before that of the last call, by more than 5 ms (less is two threads that read the clock in
///     turn, and gets the last target again). Samples that are later than the new time belong to the old clock, and are
///     forgotten. Any time before counts as a step, also after one wrong time far ahead.
///   - The time of at() is later by more than the timeout, and by more than four times the last cycle.
///   - The newest sample is later than the time of at() by more than the timeout.
/// Stamps that are off from the clock of at() by more than the timeout (ahead of the clock, or behind it after a jump
/// back or a step of the clock) are refused. If such samples go on, agree with each other, and are as far apart as the
/// calls of at() between them, the sensor's clock has stepped: the third of them, or the second after half of the
/// timeout, is taken as of now (Relocated), and the stream keeps the difference of the clocks from then on, until the
/// stamps agree with the clock of at() again. One wrong stamp among good ones is lost, and nothing else.
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

  /// The target at `time` [s]. Where the clock steps, and for a time that is not finite, the target holds still. Real
  /// time.
  Target at(double time) noexcept;

  /// The settings, as given.
  const TargetStreamOptions& options() const noexcept { return options_; }
  /// Counts of the samples since the last reset().
  const SampleCounts& counts() const noexcept { return counts_; }

 private:
  friend struct detail::Members<TargetStream>;
  struct Sample {
    double time = 0.0;
    Pose pose = Pose::Identity();  ///< tip in base
  };
  using Motion = detail::PoseMotion;
  // Covariance of position and velocity; each entry stands for a multiple of I₃.
  struct Covariance {
    double place, cross, velocity;
  };
  static constexpr int kHistory = 64;  // number of samples that Interpolate keeps

  const Sample& sample(int i) const noexcept { return history_[static_cast<std::size_t>((first_ + i) % kHistory)]; }
  bool reachable(const Sample& from, const Sample& to) const noexcept;
  bool of_another_clock(double time) const noexcept;
  SampleStatus refuse(const Sample& next, SampleStatus why, double stamp) noexcept;
  bool keeps_pace(double time) const noexcept;
  bool step_of_clock(double time) noexcept;
  void hold_still() noexcept;
  void start(const Sample& sample) noexcept;
  void extend(const Sample& sample) noexcept;
  void correct(const Sample& sample) noexcept;
  Motion knot(int i) const noexcept;
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
  double first_stamp_ = 0.0, first_clock_ = 0.0;  // of the first candidate: its time, and that of the last at() then
  double shift_ = 0.0;                            // [s] the stamps' clock minus that of at()
  double period_ = 0.0;                           // [s] between the last two calls of at()
  bool other_clock_ = false;                      // the candidates' stamps are off from the clock of at()
  bool called_ = false;                           // at() was called since the newest sample
  bool stepped_ = false;                          // the clock of at() has stepped forwards, and no sample followed
  Target last_;
  Twist acceleration_ = Twist::Zero();  // of last_, the derivative of its twist
  double time_ = 0.0;
  bool placed_ = false, timed_ = false;  // whether last_.pose is set, and whether time_ is set
};

SIGMAIK_SAME_LAYOUT(TargetStream, TargetStreamOptions, SampleCounts, Target);

}  // namespace sigmaik
