#include <sigmaik/servo.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include <sigmaik/pose.hpp>

#include "asked_pose.hpp"
#include "collision_guard.hpp"
#include "elbow.hpp"
#include "finite.hpp"
#include "guide.hpp"
#include "length.hpp"
#include "message.hpp"
#include "numbers.hpp"

namespace sigmaik {
namespace {

using detail::kInfinity;
using detail::require;

void check(const char* what, double value, bool zero_allowed, const char* unit) {
  require(value > 0.0 || (zero_allowed && value == 0.0), what, " = ", value, " ", unit, " must be ",
          zero_allowed ? "at least" : "above", " 0");
}

void check_finite(const char* what, double value, bool zero_allowed, const char* unit) {
  check(what, value, zero_allowed, unit);
  require(std::isfinite(value), what, " must be finite");
}

void check_joints(const char* what, const JointRef& values, const Chain& chain) {
  require(values.size() == chain.dof(), what, " has ", values.size(), " entries, the chain ", chain.dof(), " joints");
  for (int i = 0; i < chain.dof(); ++i) {
    require(std::isfinite(values[i]), what, " of joint '", chain.joint_names()[static_cast<std::size_t>(i)],
            "' is not finite");
  }
}

// [rad or m] A following error that changes by more while the reference rests comes from outside.
constexpr double kMoved = 1e-3;

// [1/s] towards the posture of the guide. The servo's own way must not end before the arm has taken this posture.
constexpr double kGuidedPostureGain = 5.0;

// [s] time constant of measure(): a hundred cycles of noise, and several times the lag of a joint's controller.
constexpr double kMeasuringTime = 0.1;

// With a tenth of a radian of phase per cycle, and with the acceleration and jerk that carry 0.02 rad (or m) to and
// fro, a loop of this bandwidth does not saturate the limits.
constexpr double kPhasePerCycle = 0.1;
constexpr double kAmplitude = 0.02;

Pace pace_of(const LimitTracker& tracker, double length_scale) {
  Pace pace;
  pace.slowness.resize(tracker.dof());
  for (int i = 0; i < tracker.dof(); ++i) pace.slowness[i] = 1.0 / tracker.velocity_limit(i);
  const double bandwidth = std::min({kPhasePerCycle / tracker.dt(),
                                     std::sqrt(tracker.least_acceleration() / kAmplitude),
                                     std::cbrt(tracker.least_jerk() / kAmplitude)});
  pace.lag = length_scale / bandwidth;
  return pace;
}

// The singular directions as twists. The solution gives their columns u_i in the rows of the task.
TwistColumns singular_twists(const Solution& solution, const Task& task, const Eigen::Matrix3d& rotation,
                             double length_scale) noexcept {
  TwistColumns out(6, solution.singular_count());
  Eigen::Index k = 0;
  for (int i = 0; i < solution.directions.cols(); ++i) {
    if ((solution.singular >> i & 1u) == 0) continue;
    out.col(k) = expand_rows(task, rotation, solution.directions.col(i));
    out.col(k++).tail<3>() /= length_scale;
  }
  return out;
}

}  // namespace

Servo::Servo(Chain chain, const Method& method, const ServoOptions& options)
    : chain_(std::move(chain)),
      options_(options),
      exact_{options.exact, options.task.frame},
      rest_(options.task),
      solver_(method, options.length_scale.value_or(chain_.characteristic_length()), options.task),
      avoidance_(chain_, options.avoid),
      tracker_(chain_.limits(), options.dt, options.limits),
      max_linear_error_(options.max_linear_error.value_or(0.5 * solver_.length_scale())) {
  check_finite("gain_linear", options.gain_linear, true, "1/s");
  check_finite("gain_angular", options.gain_angular, true, "1/s");
  check("max_linear_error", max_linear_error_, false, "m");
  check("max_angular_error", options.max_angular_error, false, "rad");
  check_finite("soft_start", options.soft_start, true, "s");
  check_finite("posture_gain", options.posture_gain, true, "1/s");
  check("posture_max_speed", options.posture_max_speed, false, "rad/s");
  check("max_tool_speed", options.max_tool_speed, false, "m/s");
  require(options.speed_points.allFinite(), "speed_points has an entry that is not finite");
  if (options.posture.size() != 0) check_joints("posture", options.posture, chain_);
  for (std::size_t i = 0; i < 6; ++i) {
    require(!options.exact[i] || options.task.mask[i], "exact asks for row ", i, ", which the task's mask leaves out");
    rest_.mask[i] = options.task.mask[i] && !options.exact[i];
  }
  if (options.joint_weights.size() != 0) check_joints("joint_weights", options.joint_weights, chain_);
  solver_.set_joint_weights(options.joint_weights);
  solver_.set_pace(pace_of(tracker_, solver_.length_scale()));
  following_error_ = expected_error_ = JointVector::Zero(chain_.dof());
  expect_motion();
  set_collisions();
  escapes_ = options.guided;
  if (options.guided && options.limits.position) elbow_ = detail::Owner(detail::Elbow::of(chain_));
  if (options.guided) guide_ = detail::Owner<detail::Guide>(std::make_unique<detail::Guide>(*this));
}

void Servo::reset(const JointRef& q, const JointRef& qdot, const JointRef& qddot) {
  check_joints("q", q, chain_);
  if (qdot.size() != 0) check_joints("qdot", qdot, chain_);
  if (qddot.size() != 0) check_joints("qddot", qddot, chain_);
  tracker_.reset(q, qdot, qddot);
  qdot_start_ = qdot.size() != 0 ? JointVector(qdot) : JointVector(JointVector::Zero(chain_.dof()));
  begin(q);
}

void Servo::begin(const JointRef& posture) noexcept {
  nominal_ = options_.posture.size() != 0 ? options_.posture : JointVector(posture);
  for (int i = 0; i < chain_.dof(); ++i) {
    if (chain_.joint_types()[static_cast<std::size_t>(i)] != JointType::Continuous) continue;
    constexpr double kTurn = 6.283185307179586;
    nominal_[i] += kTurn * std::round((tracker_.q()[i] - nominal_[i]) / kTurn);
  }
  solver_.reset();
  least_squares_.reset();
  slowing_.reset();
  exact_spectrum_ = rest_spectrum_ = Spectrum{};
  locate();
  look_around(nullptr, 0.0);
  fade_ = 0.0;
  expect_motion();
  forget_guide();
  escape_.resize(0);
  following_error_.setZero();
  expected_error_.setZero();
  measured_ = false;
}

bool Servo::measure(const JointRef& q, const JointRef& qdot) noexcept {
  const int n = chain_.dof();
  if (tracker_.q().size() == 0 || q.size() != n || (qdot.size() != 0 && qdot.size() != n)) return false;
  if (!detail::finite(JointVector(q)) || !detail::finite(JointVector(qdot))) return false;
  if (!measured_) {
    following_error_ = q - tracker_.q();
  } else {
    if (qdot.size() != 0) following_error_ += cycle() * (qdot - tracker_.qdot());
    following_error_ += std::min(1.0, cycle() / kMeasuringTime) * (q - tracker_.q() - following_error_);
  }
  measured_ = true;
  // The arm was moved while the reference rested: this is no swing, and no creep.
  if (tracker_.resting() && (following_error_ - expected_error_).cwiseAbs().maxCoeff() > kMoved) {
    expected_error_ = following_error_;
    expect_motion();
  }
  locate_measured();
  return true;
}

void Servo::continue_from(const Servo& other) {
  tracker_.continue_from(other.tracker_);
  if (other.tracker_.q().size() == 0) return;
  qdot_start_ = other.tracker_.qdot();
  if (!with_tool_ && other.with_tool_) {
    tool_ = other.tool_;
    with_tool_ = true;
    if (guide_) guide_->set_tool(tool_);
  }
  begin(other.nominal_);
}

void Servo::locate() noexcept {
  sigmaik::update(chain_, tracker_.q(), state_);
  if (!with_tool_) return;
  const Eigen::Vector3d lever = state_.tip.linear() * tool_.translation();
  state_.tip = state_.tip * tool_;
  for (int i = 0; i < chain_.dof(); ++i) {
    const Eigen::Vector3d omega = state_.jacobian.col(i).tail<3>();
    state_.jacobian.col(i).head<3>() += omega.cross(lever);
  }
}

// The tool where the measured joints, filtered, have it.
void Servo::locate_measured() noexcept {
  measured_tip_ = pose(chain_, tracker_.q() + following_error_);
  if (with_tool_) measured_tip_ = measured_tip_ * tool_;
}

bool Servo::set_tool(const Pose& tool) noexcept {
  const detail::AskedPose read(tool);
  if (!read.valid) return false;
  const Pose& next = read.pose;
  if (next.matrix() == tool_.matrix()) return true;
  tool_ = next;
  with_tool_ = next.matrix() != Pose::Identity().matrix();
  if (guide_) guide_->set_tool(tool_);
  if (tracker_.q().size() == 0) return true;
  locate();
  if (measured_) locate_measured();
  qdot_start_ = tracker_.qdot();
  fade_ = 0.0;
  expect_motion();
  forget_guide();
  return true;
}

void Servo::set_method(const Method& method) {
  solver_.set_method(method);
  if (guide_) guide_->set_method(method);
  expect_motion();  // the new rule may do what the last one could not
}

JointVector Servo::posture_velocity() const noexcept {
  JointVector velocity;
  const bool guided = guided_posture_.size() != 0;
  const double gain = guided ? kGuidedPostureGain : options_.posture_gain;
  if (gain != 0.0) {
    const double cap = options_.posture_max_speed;
    velocity = (gain * ((guided ? guided_posture_ : nominal_) - tracker_.q())).cwiseMax(-cap).cwiseMin(cap);
    velocity *= tracker_.arrival(velocity, gain);
  }
  if (!avoidance_.active()) return velocity;
  const JointVector away = avoidance_.velocity(tracker_.q());
  return velocity.size() == 0 ? away : JointVector(velocity + away);
}

// The time of the cycle. Outside the range: the nearest time in the range, and false.
bool Servo::begin_cycle(std::optional<double> dt) noexcept {
  if (!dt) return tracker_.set_cycle(options_.dt);
  if (guard_) {  // the stop after a command is verified for cycles of one time
    tracker_.set_cycle(options_.dt);
    return std::abs(*dt - options_.dt) <= 1e-9 * options_.dt;
  }
  if (tracker_.set_cycle(*dt)) return true;
  const double nearest = *dt > options_.dt ? kLongestCycle : *dt < options_.dt ? kShortestCycle : 1.0;  // 1 for NaN
  tracker_.set_cycle(nearest * options_.dt);
  return false;
}

ServoStep Servo::stop(Status status) noexcept {
  ServoStep step;
  step.status = status;
  step.qdot = tracker_.stop();
  step.scale = 0.0;
  if (holds_tool_speed() && tracker_.q().size() != 0) hold_tool_speed(step);
  take(step, false);
  if (fade_ < 1.0) qdot_start_ = tracker_.qdot();  // the next command starts from here
  return step;
}

ServoStep Servo::update(const Pose& asked, const Twist& feedforward, std::optional<double> dt) noexcept {
  if (!begin_cycle(dt)) return stop(Status::BadInput);
  const detail::AskedPose read(asked);
  if (!read.valid || !detail::finite(feedforward)) return stop(Status::BadInput);
  if (read.rough) ++rough_targets_;
  const Pose& target = read.pose;
  const Twist error = pose_error(measured_ ? measured_tip_ : state_.tip, target);
  Twist twist = error;
  detail::shorten(twist.head<3>(), max_linear_error_);
  detail::shorten(twist.tail<3>(), options_.max_angular_error);
  // A cycle longer than dt does not take the tip beyond its target.
  const auto gain_of = [this](double gain) { return std::min(gain, std::max(1.0, gain * options_.dt) / cycle()); };
  twist.head<3>() *= gain_of(options_.gain_linear);
  twist.tail<3>() *= gain_of(options_.gain_angular);
  twist += feedforward;
  const JointVector* goal = guide_ && tracker_.q().size() != 0 ? ask_guide(target, error) : nullptr;
  ServoStep step = resolve(twist, &feedforward, true, goal);
  step.pose_error = error;
  if (guide_) {
    step.guide = guide_->state();
    step.guide_joints = guide_->joints();
  }
  watch(target, step);
  return step;
}

// Whether the arm still moves after the target has rested for longer than any motion takes.
void Servo::watch(const Pose& target, ServoStep& step) noexcept {
  if (target.matrix() != last_target_.matrix()) {
    last_target_ = target;
    expect_motion();
    return;
  }
  // Without limits that delay the command, a motion that does not settle is the rule's own.
  if (!tracker_.delays()) return;
  count_reversals(step.qdot);
  rested_ += cycle();
  if (rested_ < settling_time()) return;
  step.not_settling = !tracker_.resting();
}

ServoStep Servo::update_twist(const Twist& twist, std::optional<double> dt) noexcept {
  if (!begin_cycle(dt)) return stop(Status::BadInput);
  if (!detail::finite(twist)) return stop(Status::BadInput);
  expect_motion();
  forget_guide();
  return resolve(twist, nullptr, qdot_start_.size() != 0 && !qdot_start_.isZero(0.0), nullptr);
}

ServoStep Servo::update_twist(const Twist& twist, Frame frame, const Eigen::Vector3d& point,
                              std::optional<double> dt) noexcept {
  const Pose& tip = measured_ ? measured_tip_ : state_.tip;
  Twist at_tip = twist;
  Eigen::Vector3d from_tip = point - tip.translation();
  if (frame == Frame::Tool) {
    at_tip.head<3>() = tip.linear() * twist.head<3>();
    at_tip.tail<3>() = tip.linear() * twist.tail<3>();
    from_tip = tip.linear() * point;
  }
  at_tip.head<3>() -= at_tip.tail<3>().cross(from_tip);
  return update_twist(at_tip, dt);
}

// A slice of the guide's work. Returns where the joints go; null: the servo goes its own way.
const JointVector* Servo::ask_guide(const Pose& target, const Twist& error) noexcept {
  guide_->advise(target, error, *this);
  const JointVector* posture = guide_->posture();
  guided_posture_ = posture != nullptr ? *posture : JointVector();
  return guide_->goal();
}

void Servo::forget_guide() noexcept {
  if (!guide_) return;
  guide_->forget();
  guided_posture_.resize(0);
}

// `feedforward`: null for a twist command, which has nowhere to arrive. `goal`: null, or where the guide leads to.
ServoStep Servo::resolve(const Twist& twist, const Twist* feedforward, bool fade, const JointVector* goal) noexcept {
  if (tracker_.q().size() == 0) return stop(Status::BadInput);
  if (guard_) guard_->begin();
  const Eigen::Matrix3d& rotation = state_.tip.linear();
  const JointVector posture = posture_velocity();
  Solution solution = solver_.solve(state_.jacobian, twist, posture, rotation);
  if (solution.status == Status::BadInput) return stop(Status::BadInput);
  if (has_exact()) prioritize(twist, posture, solution);

  ServoStep step;
  step.asked_twist = twist;
  step.status = solution.status;
  step.singular_values = solution.singular_values;
  step.singular = solution.singular;
  step.task_rows = static_cast<int>(solution.directions.cols());
  if (solution.singular != 0) {
    step.singular_directions = singular_twists(solution, options_.task, rotation, solver_.length_scale());
  }
  step.qdot = solution.qdot;
  step.achieved_twist = solution.achieved_twist;

  const bool leaves = escape(twist, step.qdot);
  bool rule = feedforward == nullptr || !arrive(*feedforward, step.qdot);  // the rule's answer stands
  if (leaves) rule = false;
  if (fade_in(step.qdot, fade)) rule = false;
  if (goal != nullptr) {
    lead(*goal, step);
    rule = false;
  } else if (tracker_.has_jerk() || !tracker_.bounds().contain(step.qdot) ||
             (holds_tool_speed() && !(tool_speed_part(step.qdot) <= 1.0)) || folds(step.qdot) || !clears(step.qdot)) {
    limit(step);
    rule = false;
  }
  // Without velocity limits, a huge twist can move the arm beyond the range of the numbers.
  if (!detail::finite(tracker_.q() + cycle() * step.qdot) || !detail::finite(step.achieved_twist)) {
    return stop(Status::BadInput);
  }
  if (shield(solution.qdot, step)) rule = false;
  take(step, rule);
  return step;
}

// Counts the time since reset(), and mixes the first commands with the velocity there. Returns whether the command
// changed.
bool Servo::fade_in(JointVector& qdot, bool fade) noexcept {
  if (fade_ >= 1.0) return false;
  fade_ = options_.soft_start > 0.0 ? std::min(1.0, fade_ + cycle() / options_.soft_start) : 1.0;
  if (!fade || fade_ >= 1.0) return false;
  qdot = fade_ * qdot + (1.0 - fade_) * qdot_start_;
  return true;
}

// Sends the command: from here on the command is history. `achieved`: the step holds the command's twist already.
void Servo::take(ServoStep& step, bool achieved) noexcept {
  if (tracker_.q().size() == 0) {  // there is no position to command
    step.q = step.qdot = JointVector::Zero(chain_.dof());
    step.status = Status::BadInput;
    return;
  }
  if (holds_tool_speed()) step.tool_speed = tool_speed(step.qdot);
  const bool changed = tracker_.advance(step.qdot);
  step.q = tracker_.q();
  if (!achieved || changed) {
    step.achieved_twist.setZero();
    for (int i = 0; i < chain_.dof(); ++i) step.achieved_twist += step.qdot[i] * state_.jacobian.col(i);
  }
  locate();
  look_around(&step, cycle());
}

}  // namespace sigmaik
