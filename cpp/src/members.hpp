#pragma once
// The members of each type that has bytes (values.hpp), in the order of its struct: archive.hpp says how.

#include <tuple>

#include <sigmaik/pose.hpp>
#include <sigmaik/values.hpp>

#include "archive.hpp"
#include "guide.hpp"

namespace sigmaik::detail {

// ---- Values ---------------------------------------------------------------------------------------------------------

template <>
struct Members<JointLimits> {
  using T = JointLimits;
  static constexpr std::tuple all{&T::lower, &T::upper,  &T::velocity,    &T::acceleration,
                                  &T::jerk,  &T::effort, &T::deceleration};
  static void check(const T& limits) {
    for (const JointVector* v : {&limits.upper, &limits.velocity, &limits.acceleration, &limits.jerk, &limits.effort}) {
      require(v->size() == limits.lower.size(), "the limits have ", v->size(), " and ", limits.lower.size(), " joints");
    }
    require(limits.deceleration.size() == 0 || limits.deceleration.size() == limits.lower.size(), "deceleration has ",
            limits.deceleration.size(), " entries for ", limits.lower.size(), " joints");
  }
};

template <>
struct Members<Inertia> {
  static constexpr std::tuple all{&Inertia::mass, &Inertia::center_of_mass, &Inertia::tensor};
};

template <>
struct Members<Segment> {
  using T = Segment;
  static constexpr std::tuple all{
      &T::joint_name,   &T::link_name, ranged(&T::type, JointType::Fixed, JointType::Prismatic),
      &T::origin,       &T::axis,      &T::lower,
      &T::upper,        &T::velocity,  &T::acceleration,
      &T::deceleration, &T::jerk,      &T::effort,
      &T::inertia,      &T::mimic,     &T::notes};
};

template <>
struct Members<Mimic> {
  static constexpr std::tuple all{&Mimic::joint, &Mimic::multiplier, &Mimic::offset};
};

template <>
struct Members<ServoStep> {
  using T = ServoStep;
  static constexpr std::tuple all{&T::q,
                                  &T::qdot,
                                  ranged(&T::status, Status::Ok, Status::BadInput),
                                  &T::pose_error,
                                  &T::asked_twist,
                                  &T::achieved_twist,
                                  &T::scale,
                                  &T::limiting_joints,
                                  &T::tool_speed_limits,
                                  &T::tool_speed,
                                  &T::singular_values,
                                  &T::singular,
                                  ranged(&T::task_rows, 0, kMaxTask),
                                  &T::singular_directions,
                                  &T::not_settling,
                                  ranged(&T::guide, GuideState::Off, GuideState::Unreachable),
                                  &T::guide_joints,
                                  &T::clearance,
                                  &T::nearest,
                                  &T::limited_by_collisions};
};

template <>
struct Members<ConstrainedIkStep> {
  using T = ConstrainedIkStep;
  static constexpr std::tuple all{
      &T::q,         &T::qdot,          ranged(&T::status, Status::Ok, Status::BadInput),
      &T::error,     &T::path_error,    &T::time_scale,
      &T::active,    &T::torque_active, &T::error_active,
      &T::exact_met, &T::not_settling,  ranged(&T::used, IkSource::Analytic, IkSource::Optimised)};
};

template <>
struct Members<ComputedTorqueStep> {
  using T = ComputedTorqueStep;
  static constexpr std::tuple all{&T::torque, ranged(&T::status, Status::Ok, Status::BadInput), &T::scale,
                                  &T::limiting_joints};
};

template <>
struct Members<Solution> {
  using T = Solution;
  static constexpr std::tuple all{&T::qdot,
                                  ranged(&T::status, Status::Ok, Status::BadInput),
                                  &T::singular_values,
                                  &T::achieved_twist,
                                  &T::directions,
                                  &T::singular};
};

template <>
struct Members<LeastSquaresSolution> {
  using T = LeastSquaresSolution;
  static constexpr std::tuple all{
      &T::x,         ranged(&T::status, LeastSquaresStatus::Optimal, LeastSquaresStatus::BadInput),
      &T::steps,     &T::at_lower,
      &T::at_upper,  &T::active,
      &T::violation, &T::equality_error};
};

template <>
struct Members<AnalyticBranch> {
  using T = AnalyticBranch;
  static constexpr std::tuple all{&T::q, &T::within_limits, &T::singular};
};

template <>
struct Members<PositionIkResult> {
  using T = PositionIkResult;
  static constexpr std::tuple all{&T::q, ranged(&T::status, PositionIkStatus::Ok, PositionIkStatus::BadInput),
                                  &T::error, &T::solve_time};
};

template <>
struct Members<PositionIkBranch> {
  using T = PositionIkBranch;
  static constexpr std::tuple all{&T::q, &T::sigma_min, &T::margin};
};

template <>
struct Members<Target> {
  using T = Target;
  static constexpr std::tuple all{&T::pose, &T::twist,
                                  ranged(&T::status, StreamStatus::Tracking, StreamStatus::Waiting), &T::age};
};

template <>
struct Members<SampleCounts> {
  using T = SampleCounts;
  static constexpr std::tuple all{&T::accepted, &T::relocated, &T::outliers, &T::out_of_order,
                                  &T::invalid,  &T::rough,     &T::ahead,    &T::clock_steps};
};

// ---- Parts of states ------------------------------------------------------------------------------------------------

template <>
struct Members<Spectrum> {
  using T = Spectrum;
  static constexpr std::tuple all{
      ranged(&T::m_, 0, kMaxTask), ranged(&T::n_, 0, kMaxJoints), &T::sweeps_, &T::cycle_, &T::sigma_, &T::u_, &T::v_};
};

template <>
struct Members<LeastSquares> {
  using T = LeastSquares;
  using Guess = T::Guess;
  static constexpr std::tuple all{&T::guess_};
};

template <>
struct Members<Members<LeastSquares>::Guess> {
  using T = Members<LeastSquares>::Guess;
  static constexpr std::tuple all{ranged(&T::unknowns, 0, kMaxUnknowns),
                                  ranged(&T::inequalities, 0, kMaxInequalities),
                                  &T::at_lower,
                                  &T::at_upper,
                                  &T::active,
                                  &T::x};
  static void check(const T& guess) {
    require(guess.x.size() == 0 || guess.x.size() == guess.unknowns, "a guess has ", guess.x.size(), " entries for ",
            guess.unknowns, " unknowns");
  }
};

template <>
struct Members<Pace> {
  static constexpr std::tuple all{&Pace::slowness, &Pace::lag, &Pace::largest};
};

template <>
struct Members<Resolution> {
  using T = Resolution;
  static constexpr std::tuple all{&T::speed, &T::projector, &T::weight, &T::singular, &T::exact};
};

template <>
struct Members<VelocityBounds> {
  using T = VelocityBounds;
  static constexpr std::tuple all{&T::lower, &T::upper, &T::lower_kind, &T::upper_kind};
};

template <>
struct Members<ChainState> {
  static constexpr std::tuple all{&ChainState::tip, &ChainState::jacobian};
};

template <>
struct Members<DynamicsTerms> {
  static constexpr std::tuple all{&DynamicsTerms::mass, &DynamicsTerms::bias};
};

template <>
struct Members<LimitTracker> {
  using T = LimitTracker;
  using JerkMemory = T::JerkMemory;
  static constexpr std::tuple all{made(&T::options_),
                                  &T::dt_,
                                  &T::cycle_,
                                  &T::per_dt_,
                                  &T::last_,
                                  &T::uneven_,
                                  &T::changing_,
                                  made(&T::n_),
                                  &T::lower_,
                                  &T::upper_,
                                  &T::velocity_,
                                  &T::acceleration_,
                                  &T::braking_,
                                  &T::jerk_,
                                  &T::recovery_,
                                  &T::most_acceleration_,
                                  &T::most_braking_,
                                  &T::most_jerk_,
                                  &T::settling_time_,
                                  &T::with_jerk_,
                                  &T::unequal_,
                                  &T::jerk_states_,
                                  &T::q_,
                                  &T::v_,
                                  &T::stop_,
                                  &T::bounds_,
                                  &T::outside_,
                                  &T::recovering_};
  static void check(const T& tracker) {
    for (const JointVector* v : {&tracker.v_, &tracker.stop_, &tracker.bounds_.lower, &tracker.bounds_.upper}) {
      require(v->size() == tracker.q_.size(), "the tracker has ", v->size(), " and ", tracker.q_.size(), " joints");
    }
    require(tracker.q_.allFinite() && tracker.v_.allFinite(), "a position or a velocity is not finite");
    require(((tracker.with_jerk_ | tracker.unequal_ | tracker.changing_) >> tracker.n_) == 0,
            "a joint that does not exist has a limit");
    require(tracker.dt_ > 0.0 && std::isfinite(tracker.dt_), "dt = ", tracker.dt_, " s");
    require(tracker.cycle_ > 0.0 && std::isfinite(tracker.cycle_), "a cycle takes ", tracker.cycle_, " s");
  }
};

template <>
struct Members<Members<LimitTracker>::JerkMemory> {
  using T = Members<LimitTracker>::JerkMemory;
  static constexpr std::tuple all{&T::change, &T::slope, &T::next_slope, &T::next};
};

// ---- States ---------------------------------------------------------------------------------------------------------

template <>
struct Members<VelocitySolver> {
  using T = VelocitySolver;
  static constexpr std::tuple all{made(&T::method_), &T::length_scale_, made(&T::task_), &T::pace_,
                                  &T::lightness_,    &T::spectrum_,     &T::resolution_};
};

template <>
struct Members<Servo> {
  using T = Servo;
  static constexpr std::uint64_t kRest = 1;
  static constexpr std::tuple all{made(&T::chain_),
                                  made(&T::options_),
                                  made(&T::exact_),
                                  made(&T::rest_),
                                  &T::solver_,
                                  made(&T::avoidance_),
                                  &T::tracker_,
                                  &T::least_squares_,
                                  &T::slowing_,
                                  made(&T::problem_),  // of one call
                                  made(&T::rows_),     // of one call
                                  &T::exact_spectrum_,
                                  &T::rest_spectrum_,
                                  &T::exact_resolution_,
                                  &T::rest_resolution_,
                                  &T::lost_,
                                  &T::state_,
                                  &T::nominal_,
                                  &T::qdot_start_,
                                  &T::following_error_,
                                  &T::expected_error_,
                                  &T::last_way_,
                                  ranged(&T::reversals_, 0, 1 << 30),
                                  &T::rough_targets_,
                                  &T::tool_,
                                  &T::with_tool_,
                                  &T::measured_tip_,
                                  &T::last_target_,
                                  &T::max_linear_error_,
                                  &T::fade_,
                                  &T::rested_,
                                  &T::measured_,
                                  &T::escapes_,
                                  &T::escape_,
                                  &T::guided_posture_,
                                  made(&T::guide_),
                                  made(&T::elbow_),
                                  made(&T::guard_)};  // verifies anew
  // The memory behind vectors of fewer joints than there is room for must hold numbers: reset() sees to this.
  static void prepare(T& servo) {
    if (servo.q().size() == 0) servo.reset(JointVector::Zero(servo.chain().dof()));
  }
  template <typename Archive, typename Object>
  static void rest(Archive& archive, Object& servo) {
    bool guided = bool(servo.guide_);
    archive.number(guided);
    require(guided == bool(servo.guide_), "the state is of a servo ", guided ? "with" : "without", " a guide");
    if (guided) transfer(archive, *servo.guide_.operator->());
  }
  static void check(const T& servo) {
    const bool started = servo.tracker_.q().size() != 0;
    require(servo.state_.jacobian.cols() == servo.tracker_.q().size() || !started, "the Jacobian has ",
            servo.state_.jacobian.cols(), " columns");
    for (const JointVector* v : {&servo.nominal_, &servo.qdot_start_}) {
      require(!started || v->size() == servo.chain().dof(), "a vector of a servo that has started is empty");
    }
    for (const JointVector* v : {&servo.following_error_, &servo.expected_error_}) {
      require(v->size() == servo.chain().dof(), "a vector of a servo is empty");
    }
  }
};

template <>
struct Members<Guide> {
  using T = Guide;
  static constexpr std::uint64_t kRest = 1;
  static constexpr double kMost = 1e6;  // steps and slices that a cycle may find left over
  static constexpr std::tuple all{&T::predictor_,
                                  made(&T::ik_),
                                  made(&T::search_),
                                  ranged(&T::phase_, T::Phase::Nothing, T::Phase::Done),
                                  ranged(&T::state_, GuideState::Off, GuideState::Unreachable),
                                  &T::target_,
                                  &T::without_tool_,
                                  &T::with_tool_,
                                  &T::goal_,
                                  &T::end_,
                                  &T::searched_,
                                  &T::open_,
                                  &T::with_posture_,
                                  &T::joints_,
                                  &T::time_,
                                  &T::predicted_,
                                  &T::horizon_,
                                  &T::still_,
                                  &T::least_,
                                  &T::since_least_,
                                  &T::away_,
                                  &T::there_,
                                  &T::patience_,
                                  ranged(&T::steps_, 0.0, kMost),
                                  ranged(&T::slices_, 0.0, kMost),
                                  &T::leads_};
  // A search refers to tables of its PositionIk, and has many configurations in its memory. The same calls make the
  // same search again.
  template <typename Archive, typename Object>
  static void rest(Archive& archive, Object& guide) {
    bool searches = guide.search_.has_value();
    archive.number(searches);
    if constexpr (Archive::kReads) guide.search_.reset();
    if (!searches) return;
    Pose pose = Pose::Identity();
    JointVector near;
    std::int32_t slices = 0;
    if constexpr (!Archive::kReads) {
      pose = guide.search_->pose();
      near = guide.search_->near();
      slices = guide.search_->slices();
    }
    transfer(archive, pose);
    transfer(archive, near);
    archive.number(slices);
    if constexpr (Archive::kReads) {
      const bool small = pose.translation().cwiseAbs().maxCoeff() <= kLargest;
      require(is_pose(pose.matrix()) && small, "a search is for no pose");
      require(near.size() == archive.joints() && near.cwiseAbs().maxCoeff() <= kLargest, "a search starts nowhere");
      guide.search_.emplace(guide.ik_, pose, near);
      bool ended = false;
      for (std::int32_t k = 0; k < slices && !ended; ++k) ended = guide.search_->advance();
      require(slices >= 0 && guide.search_->slices() == slices, "a search has taken ", slices, " slices");
    }
  }
  static void check(const T& guide) {
    const auto n = static_cast<Eigen::Index>(guide.ik_.chain().dof());
    const bool leads = guide.phase_ == T::Phase::Leading || guide.with_posture_;
    require(!leads || (guide.goal_.size() == n && (guide.phase_ == T::Phase::Predicting || guide.end_.size() == n)),
            "a guide leads nowhere");
    const bool predicts = guide.phase_ == T::Phase::Predicting;
    require(!predicts || guide.predictor_.q().size() == n, "a guide predicts the motion of nothing");
  }
};

template <>
struct Members<TargetStream> {
  using T = TargetStream;
  using Sample = T::Sample;
  using Motion = T::Motion;
  using Covariance = T::Covariance;
  static constexpr std::uint64_t kRest = 1;
  static constexpr std::tuple all{made(&T::options_),
                                  &T::counts_,
                                  made(&T::history_),
                                  ranged(&T::first_, 0, T::kHistory - 1),
                                  ranged(&T::count_, 0, T::kHistory),
                                  &T::estimate_,
                                  &T::linear_,
                                  &T::angular_,
                                  &T::candidate_,
                                  &T::candidates_,
                                  &T::first_stamp_,
                                  &T::first_clock_,
                                  &T::shift_,
                                  &T::period_,
                                  &T::other_clock_,
                                  &T::called_,
                                  &T::stepped_,
                                  &T::last_,
                                  &T::acceleration_,
                                  &T::time_,
                                  &T::placed_,
                                  &T::timed_};
  template <typename Archive, typename Object>
  static void rest(Archive& archive, Object& stream) {
    for (int i = 0; i < stream.count_; ++i) {
      transfer(archive, stream.history_[static_cast<std::size_t>((stream.first_ + i) % T::kHistory)]);
    }
  }
};

template <>
struct Members<Members<TargetStream>::Sample> {
  using T = Members<TargetStream>::Sample;
  static constexpr std::tuple all{&T::time, &T::pose};
};

template <>
struct Members<Members<TargetStream>::Motion> {
  using T = Members<TargetStream>::Motion;
  static constexpr std::tuple all{&T::pose, &T::twist, &T::acceleration};
};

template <>
struct Members<Members<TargetStream>::Covariance> {
  using T = Members<TargetStream>::Covariance;
  static constexpr std::tuple all{&T::place, &T::cross, &T::velocity};
};

template <>
struct Members<ConstrainedIk> {
  using T = ConstrainedIk;
  using Preview = T::Preview;
  static constexpr std::tuple all{made(&T::chain_),
                                  made(&T::options_),
                                  made(&T::approximate_),
                                  made(&T::exact_),
                                  made(&T::analytic_),
                                  made(&T::dynamics_),
                                  &T::tracker_,
                                  &T::least_squares_,
                                  &T::closing_,
                                  made(&T::problem_),  // of one call
                                  made(&T::terms_),    // of one call
                                  made(&T::torque_rows_),
                                  made(&T::error_rows_),
                                  &T::arriving_,
                                  &T::last_motion_,
                                  &T::last_way_,
                                  &T::patience_,
                                  &T::turns_,
                                  &T::against_,
                                  &T::least_error_,
                                  &T::state_,
                                  &T::preview_,
                                  &T::turn_,
                                  &T::stuck_,
                                  &T::reference_,
                                  &T::last_target_,
                                  &T::rested_,
                                  &T::last_free_};
  static void prepare(T& ik) {
    if (ik.q().size() == 0) ik.reset(JointVector::Zero(ik.chain().dof()));
  }
  static void check(const T& ik) {
    const auto n = static_cast<Eigen::Index>(ik.chain().dof());
    require(ik.q().size() == 0 || ik.state_.jacobian.cols() == n, "the Jacobian has ", ik.state_.jacobian.cols(),
            " columns");
    const ConstrainedIk::Preview& p = ik.preview_;
    require(p.count == 0 || (p.q.size() == n && p.slope.size() == n && p.state.jacobian.cols() == n),
            "a preview is of nothing");
  }
};

template <>
struct Members<Members<ConstrainedIk>::Preview> {
  using T = Members<ConstrainedIk>::Preview;
  static constexpr std::uint64_t kRest = 1;
  static constexpr std::tuple all{made(&T::points),
                                  made(&T::asked),
                                  made(&T::fastest),  // the last two: of one call
                                  ranged(&T::first, 0, T::kPoints - 1),
                                  ranged(&T::count, 0, T::kPoints),
                                  &T::way,
                                  &T::direction,
                                  &T::start,
                                  &T::state,
                                  &T::q,
                                  &T::slope};
  template <typename Archive, typename Object>
  static void rest(Archive& archive, Object& preview) {
    for (int i = 0; i < preview.count; ++i) {
      transfer(archive, preview.points[static_cast<std::size_t>((preview.first + i) % T::kPoints)]);
    }
  }
};

template <>
struct Members<Members<ConstrainedIk>::Preview::Point> {
  using T = Members<ConstrainedIk>::Preview::Point;
  static constexpr std::tuple all{&T::at, &T::most, &T::left, &T::brake};
};

}  // namespace sigmaik::detail
