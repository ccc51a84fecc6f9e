#pragma once
// The guide of a servo: whether the servo's own way arrives, and another way where it does not.

#include <cstdint>
#include <optional>

#include <sigmaik/position_ik.hpp>
#include <sigmaik/servo.hpp>

#include "position_ik_search.hpp"

namespace sigmaik::detail {

// For a target that rests the guide
//   1. predicts the servo's own motion, in cycles of 4 ms, until it arrives, rests elsewhere, or takes too long;
//   2. if it does not arrive, searches the joint positions of the target, the nearest in travel time (PositionIk);
//   3. predicts the servo's motion once more, with these positions as its posture: an arm with more joints than the
//      task has rows may arrive on the tool's own way by another self-motion;
//   4. if this does not arrive either, leads the joints to these positions. The ranges of the joints are a box, so the
//      straight line of the joints is inside them.
// The work is cut into slices, one a cycle, so that a cycle stays bounded. Meanwhile the servo goes its own way. The
// slices depend on nothing but the target and the state of the servo: the same motion comes out every time. No heap.
class Guide {
 public:
  explicit Guide(const Servo& servo);

  // The next target is a new one.
  void forget() noexcept { phase_ = Phase::Nothing; }
  // See Servo::set_method().
  void set_method(const Method& method);
  // See Servo::set_tool().
  void set_tool(const Pose& tool) noexcept;

  // One slice. `error`: pose_error from the tip to the target.
  void advise(const Pose& target, const Twist& error, const Servo& servo) noexcept;

  GuideState state() const noexcept { return state_; }
  // Bit i: the way that the guide chose ends with joint i elsewhere than the servo's own way.
  std::uint16_t joints() const noexcept { return joints_; }
  // (n,) where the joints go by themselves; null: the servo goes its own way.
  const JointVector* goal() const noexcept { return phase_ == Phase::Leading ? &goal_ : nullptr; }
  // (n,) a posture for the servo's own way; null: none.
  const JointVector* posture() const noexcept { return with_posture_ ? &goal_ : nullptr; }

 private:
  friend struct Members<Guide>;
  enum class Phase : std::int8_t { Nothing, Waiting, Predicting, Searching, Following, Leading, Done };
  enum class Outcome : std::int8_t { Open, Arrives, Rests };

  // The error of the task's rows: in characteristic lengths, and in radians.
  struct Left {
    double linear, angular;
  };

  bool same(const Pose& target) noexcept;
  void begin(const Pose& target) noexcept;
  void restart() noexcept;
  void start_prediction(const Left& left, const Servo& servo, bool with_posture) noexcept;
  void predict(const Left& left, const Servo& servo) noexcept;
  bool search(const Servo& servo) noexcept;
  void after_search(const Left& left, const Servo& servo) noexcept;
  void choose_lead(const Servo& servo) noexcept;
  void seek() noexcept;
  Outcome run_prediction() noexcept;
  void start_way(const Servo& servo) noexcept;
  void rest(bool there, double dt) noexcept;
  bool stuck(const Left& left, double dt) noexcept;
  Left left(const Twist& error, const Servo& servo) const noexcept;
  bool arrived(const Left& left) const noexcept;
  double own_time(const Left& left, const Servo& servo) const noexcept;
  double travel_time(const JointVector& from) const noexcept;

  // The tip's pose where the tool is at `target`.
  Pose tip_at(const Pose& target) const noexcept { return with_tool_ ? target * without_tool_ : target; }

  Servo predictor_;
  PositionIk ik_;
  std::optional<NearestSearch> search_;
  Phase phase_ = Phase::Nothing;
  GuideState state_ = GuideState::Off;
  Pose target_ = Pose::Identity();
  Pose without_tool_ = Pose::Identity();  // the tip in the tool
  bool with_tool_ = false;
  JointVector goal_;           // joint positions of the target
  JointVector end_;            // of the servo's own way
  bool searched_ = false;      // the search has ended
  bool open_ = false;          // the prediction of the servo's own way ended before the servo did
  bool with_posture_ = false;  // the prediction, and then the servo, has goal_ as its posture
  std::uint16_t joints_ = 0;
  double time_ = 0.0;         // [s] in this phase
  double predicted_ = 0.0;    // [s] that the prediction has reached
  double horizon_ = 0.0;      // [s] of the prediction
  double still_ = 0.0;        // [s] for which the predicted arm has rested
  double least_ = 0.0;        // error of the motion that is watched, when it had fallen last
  double since_least_ = 0.0;  // [s] since then
  double away_ = 0.0;         // [s] for which the arm has been away from a target where it had arrived
  double there_ = 0.0;        // [s] for which it has been there
  double patience_ = 0.0;     // [s] in which the error has to fall
  double steps_ = 0.0;        // of the prediction, that the cycles so far allow
  double slices_ = 0.0;       // the same of the search
  int leads_ = 0;             // to this target
};

}  // namespace sigmaik::detail
