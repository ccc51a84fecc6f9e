#include "guide.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <sigmaik/pose.hpp>

#include "owner.hpp"

namespace sigmaik {

const char* to_string(GuideState state) noexcept {
  switch (state) {
    case GuideState::Off: return "off";
    case GuideState::Direct: return "direct";
    case GuideState::Searching: return "searching";
    case GuideState::Posture: return "posture";
    case GuideState::ChangingBranch: return "changing branch";
    case GuideState::Unreachable: return "unreachable";
  }
  return "unknown";
}

namespace detail {

template class Owner<Guide>;

namespace {

constexpr double kStep = 4e-3;   // [s] of a predicted cycle: the servo's thresholds are still those of its own cycle
constexpr double kAhead = 32.0;  // [s] of predicted motion in a second, so that a prediction takes a tenth of a second
constexpr double kSlices = 4000.0;    // [1/s] of the search
constexpr double kLongWay = 1.5;      // [s] of predicted motion, from which on the search goes on at the same time
constexpr double kQuiet = 0.1;        // [s] for which a target has to rest: a hand that drags it gets no prediction
constexpr double kSameTarget = 0.01;  // [rad, or L] a target that moves by less is the same: noise, and what is left
                                      // of the way is the servo's own
constexpr double kArrived = 1e-3;     // [L] of the position
constexpr double kTurned = 2.5e-3;    // [rad] of the orientation
constexpr double kPatience = 4.5;     // [s] that the servo's own way may take,
constexpr double kLonger = 1.4;       // or this many times the joints' travel time, or that of the gains
constexpr double kStill = 0.2;        // [s] of rest that end a prediction
constexpr double kStuck = 0.4;        // [s], or
constexpr double kStuckPart = 0.07;   // of the time of the way: in this time the error
constexpr double kProgress = 0.05;    // has to fall by this part of itself, or the servo is in a valley
constexpr double kSettle = 7.0;       // time constants of 1/gain: e⁻⁷ of an error has arrived
constexpr double kLate = 1.3;         // of the predicted time, until the servo counts as stuck,
constexpr double kLateness = 1.0;     // [s] and this time more, for joints that lag behind
constexpr double kLed = 1e-4;         // [rad or m] from the goal: the joints are there
constexpr double kAway = 1.0;         // [s] away from a target where the arm had arrived: somebody moved the arm
constexpr int kLeads = 3;             // to one target, without a rest there: more would go to and fro
constexpr double kOther = 0.5;  // [rad, or L] a joint that ends farther from the servo's own way changes its branch

// Gives a cycle its share of the work. In short cycles shares add up to one step.
void grant(double& budget, double share) noexcept { budget = std::min(budget + share, std::max(1.0, share)); }

ServoOptions of_predictor(const Servo& servo) {
  ServoOptions options = servo.options();
  options.dt = std::max(options.dt, kStep);
  options.guided = false;
  return options;
}

PositionIkOptions of_search(const Servo& servo) {
  PositionIkOptions options;
  options.task = servo.options().task;
  return options;
}

}  // namespace

Guide::Guide(const Servo& servo)
    : predictor_(servo.chain(), servo.method(), of_predictor(servo)), ik_(servo.chain(), of_search(servo)) {
  predictor_.elbow_ = servo.elbow_;
  predictor_.escapes_ = servo.escapes_;
}

void Guide::set_method(const Method& method) {
  predictor_.set_method(method);
  forget();
}

void Guide::set_tool(const Pose& tool) noexcept {
  predictor_.set_tool(tool);
  with_tool_ = tool.matrix() != Pose::Identity().matrix();
  without_tool_ = tool.inverse(Eigen::Isometry);
  forget();
}

void Guide::begin(const Pose& target) noexcept {
  target_ = target;
  restart();
  leads_ = 0;
}

// From the beginning, with the same target.
void Guide::restart() noexcept {
  phase_ = Phase::Waiting;
  state_ = GuideState::Direct;
  searched_ = with_posture_ = false;
  search_.reset();
  open_ = false;
  joints_ = 0;
  time_ = away_ = there_ = 0.0;
}

Guide::Left Guide::left(const Twist& error, const Servo& servo) const noexcept {
  const Task& task = servo.options().task;
  const Eigen::Matrix3d rotation = servo.tip().linear();
  const Twist rows = task.whole() ? error : expand_rows(task, rotation, select_rows(task, rotation, error));
  return {rows.head<3>().norm() / ik_.chain().characteristic_length(), rows.tail<3>().norm()};
}

bool Guide::arrived(const Left& left) const noexcept { return left.linear <= kArrived && left.angular <= kTurned; }

// [s] that the gains and the largest errors give the way, without limits.
double Guide::own_time(const Left& left, const Servo& servo) const noexcept {
  const ServoOptions& o = servo.options();
  const double linear = left.linear * ik_.chain().characteristic_length() / servo.max_linear_error();
  double time = left.linear > kArrived ? (linear + kSettle) / o.gain_linear : 0.0;
  // The ways of the tool and of an elbow that turns with it; no time without a largest speed.
  time += (left.linear + 2.0 * left.angular) * ik_.chain().characteristic_length() / o.max_tool_speed;
  if (left.angular > kTurned) time = std::max(time, (left.angular / o.max_angular_error + kSettle) / o.gain_angular);
  return time;
}

// Whether the target is the one at hand, or one to which the chosen configuration can follow.
bool Guide::same(const Pose& target) noexcept {
  if (phase_ == Phase::Nothing) return false;
  const Twist moved = pose_error(target_, target);
  const double length = ik_.chain().characteristic_length();
  if (moved.head<3>().norm() <= kSameTarget * length && moved.tail<3>().norm() <= kSameTarget) return true;
  if (phase_ != Phase::Leading && !(phase_ == Phase::Following && with_posture_)) return false;
  if (moved.head<3>().norm() > 0.1 * length || moved.tail<3>().norm() > 0.1) return false;
  if (!follow_solution(ik_, tip_at(target), goal_)) return false;
  target_ = target;
  return true;
}

void Guide::advise(const Pose& target, const Twist& error, const Servo& servo) noexcept {
  const double dt = servo.cycle();
  if (with_tool_ && !servo.options().task.whole()) {  // the search has the tip's rows, and not the tool's
    state_ = GuideState::Off;
    return;
  }
  const Left now = left(error, servo);
  if (!same(target)) begin(target);
  if (servo.options().gain_linear == 0.0 || servo.options().gain_angular == 0.0) return;  // a way of the user's own
  time_ += dt;
  grant(steps_, kAhead * dt / predictor_.options().dt);
  grant(slices_, kSlices * dt);
  switch (phase_) {
    case Phase::Waiting:
      if (time_ >= kQuiet) start_prediction(now, servo, false);
      break;
    case Phase::Predicting: predict(now, servo); break;
    case Phase::Searching:
      if (search(servo)) after_search(now, servo);
      break;
    case Phase::Following:
      if (arrived(now)) {
        phase_ = Phase::Done;
      } else if (time_ > kLate * predicted_ + kLateness || stuck(now, dt)) {
        end_ = servo.q();
        open_ = false;
        with_posture_ ? choose_lead(servo) : seek();
      }
      break;
    case Phase::Leading:
      if ((goal_ - servo.q()).cwiseAbs().maxCoeff() <= kLed) {
        phase_ = Phase::Done;
        state_ = GuideState::Direct;
        joints_ = 0;
      }
      break;
    case Phase::Done: rest(arrived(now), dt); break;
    case Phase::Nothing: break;
  }
}

// Whether the arm stays where it had arrived.
void Guide::rest(bool there, double dt) noexcept {
  there_ = there ? there_ + dt : 0.0;
  away_ = there || state_ == GuideState::Unreachable ? 0.0 : away_ + dt;
  if (there_ > kAway) leads_ = 0;
  if (away_ > kAway && leads_ < kLeads) restart();
}

void Guide::start_prediction(const Left& left, const Servo& servo, bool with_posture) noexcept {
  phase_ = Phase::Predicting;
  with_posture_ = with_posture;
  predictor_.guided_posture_ = with_posture ? goal_ : JointVector();
  predictor_.reset(servo.q(), servo.qdot());
  predictor_.nominal_ = servo.nominal_;
  predictor_.fade_ = servo.fade_;
  predicted_ = 0.0;
  const double own = own_time(left, servo), joints = (servo.settling_time() - 3.0) / 3.0;
  patience_ = std::max(kStuck, kStuckPart * std::max(own, joints));
  horizon_ = std::max({kPatience, kLonger * own, with_posture ? kLonger * travel_time(servo.q()) : 0.0});
  start_way(servo);
}

// Whether the error has not fallen for a while.
bool Guide::stuck(const Left& left, double dt) noexcept {
  since_least_ += dt;
  if (left.linear + left.angular < (1.0 - kProgress) * least_) {
    least_ = left.linear + left.angular;
    since_least_ = 0.0;
  }
  return since_least_ > patience_;
}

void Guide::start_way(const Servo& servo) noexcept {
  time_ = still_ = 0.0;
  since_least_ = -std::max(0.0, 1.0 - servo.fade_) * servo.options().soft_start;  // until the command is faded in
  least_ = std::numeric_limits<double>::infinity();
}

Guide::Outcome Guide::run_prediction() noexcept {
  const ServoStep step = predictor_.update(target_);
  const double dt = predictor_.options().dt;
  const Left now = left(step.pose_error, predictor_);
  if (arrived(now)) return Outcome::Arrives;
  predicted_ += dt;
  if (stuck(now, dt)) return Outcome::Rests;
  still_ = step.qdot.isZero(0.0) || predictor_.tracker_.resting() ? still_ + dt : 0.0;
  return still_ > kStill ? Outcome::Rests : Outcome::Open;
}

void Guide::predict(const Left& left, const Servo& servo) noexcept {
  if (steps_ < 1.0) {  // a short cycle does not both
    if (predicted_ > kLongWay) search(servo);
    return;
  }
  for (; steps_ >= 1.0; steps_ -= 1.0) {
    const Outcome outcome = run_prediction();
    if (outcome == Outcome::Arrives) {
      phase_ = Phase::Following;
      state_ = with_posture_ ? GuideState::Posture : GuideState::Direct;
      start_way(servo);
      return;
    }
    if (outcome == Outcome::Open && predicted_ < horizon_) continue;
    if (with_posture_) return choose_lead(servo);
    end_ = predictor_.q();
    open_ = outcome == Outcome::Open;
    return searched_ ? after_search(left, servo) : seek();
  }
  // A motion that takes long may be in vain.
  if (predicted_ > kLongWay && slices_ > 1.0) search(servo);
}

void Guide::seek() noexcept {
  phase_ = Phase::Searching;
  state_ = GuideState::Searching;
}

// Some slices of the search. Returns whether the search has ended.
bool Guide::search(const Servo& servo) noexcept {
  if (searched_) return true;
  if (!search_) {
    const bool large = target_.translation().cwiseAbs().maxCoeff() > kLargest ||
                       servo.q().cwiseAbs().maxCoeff() > kLargest;
    if (large) return searched_ = true;
    search_.emplace(ik_, tip_at(target_), servo.q());
  }
  for (; slices_ >= 1.0 && !searched_; slices_ -= 1.0) searched_ = search_->advance();
  return searched_;
}

// The servo's own way does not arrive, as far as it was predicted, and the search has ended.
void Guide::after_search(const Left& left, const Servo& servo) noexcept {
  if (!search_ || !search_->found()) {
    phase_ = Phase::Done;
    state_ = GuideState::Unreachable;
    return;
  }
  goal_ = search_->best().q;
  horizon_ = kLonger * travel_time(servo.q());
  if (open_ && horizon_ > predicted_) {  // a slow arm: the prediction goes on
    phase_ = Phase::Predicting;
    return;
  }
  if (ik_.chain().dof() > servo.options().task.rows()) return start_prediction(left, servo, true);
  choose_lead(servo);
}

void Guide::choose_lead(const Servo& servo) noexcept {
  with_posture_ = false;
  phase_ = Phase::Leading;
  state_ = GuideState::ChangingBranch;
  joints_ = 0;
  ++leads_;
  for (int i = 0; i < servo.chain().dof(); ++i) {
    const bool slides = servo.chain().joint_types()[static_cast<std::size_t>(i)] == JointType::Prismatic;
    const double unit = slides ? servo.chain().characteristic_length() : 1.0;
    if (std::abs(goal_[i] - end_[i]) > kOther * unit) joints_ |= static_cast<std::uint16_t>(1u << i);
  }
}

// Of a motion that starts and ends at rest.
double Guide::travel_time(const JointVector& from) const noexcept {
  double longest = 0.0;
  for (int i = 0; i < from.size(); ++i) {
    const double way = std::abs(goal_[i] - from[i]);
    const double v = predictor_.tracker_.velocity_limit(i), up = predictor_.tracker_.acceleration_limit(i);
    const double down = predictor_.tracker_.deceleration_limit(i), a = up == down ? up : 2.0 / (1.0 / up + 1.0 / down);
    longest = std::max(longest, way > v * v / a ? way / v + v / a : 2.0 * std::sqrt(way / a));
  }
  return longest;
}

}  // namespace detail
}  // namespace sigmaik
