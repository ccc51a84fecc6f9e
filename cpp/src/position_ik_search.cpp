#include "position_ik_search.hpp"

#include <algorithm>

#include "numbers.hpp"

namespace sigmaik::detail {
namespace {

constexpr Effort kNear{60, 0.95, false, false};  // of the start from `near`
constexpr int kPatience = 8;                     // slices of this
constexpr int kBlock = 16;                       // starts
constexpr int kSpread = 4;                       // after the first block, one of so many starts is far away
constexpr int kNearStarts = 48;  // starts of the table with which a search near a configuration looks for branches
constexpr int kPulled = 8;       // solutions of a redundant arm that are moved towards `near`
constexpr int kPullSteps = 8;    // of a slice of this
constexpr int kPulls = 5;        // slices
constexpr double kSame = 1e-6;   // [rad, or L] solutions that differ by less are the same

}  // namespace

FirstSearch::FirstSearch(const PositionIk::Model& model, const Descent& descent, const Pose& pose) noexcept
    : model_(model), descent_(descent), order_(model.table, pose) {
  best_.cost = best_of_block_.cost = kInfinity;
}

FirstSearch::FirstSearch(const FirstSearch& other, const Descent& descent) noexcept
    : model_(other.model_),
      descent_(descent),
      order_(other.order_),
      stage_(other.stage_),
      starts_(other.starts_),
      patience_(other.patience_),
      found_(other.found_),
      best_(other.best_),
      best_of_block_(other.best_of_block_),
      held_(other.held_) {}

bool FirstSearch::end(bool found) noexcept {
  found_ = found;
  stage_ = Stage::Ended;
  return true;
}

bool FirstSearch::after_block() noexcept {
  if (best_of_block_.cost < best_.cost) best_ = best_of_block_;
  if (model_.held) held_.add(best_of_block_);
  best_of_block_.cost = kInfinity;
  stage_ = starts_ < model_.options.starts ? Stage::Start : Stage::Patient;
  return false;
}

// To a minimum of E.
bool FirstSearch::patient() noexcept {
  if (model_.held) {  // in one slice: a servo's guide, which needs slices, has no such rows
    best_ = held_.nearest(model_, descent_);
    return end(descent_.reached(best_));
  }
  const double before = best_.cost;
  if (descent_.run(best_, kPatient)) return end(true);
  return ++patience_ == kPatience || !(best_.cost < before) ? end(false) : false;
}

bool FirstSearch::advance() noexcept {
  switch (stage_) {
    case Stage::Start: {
      DescentPoint point;
      // The entries that are close to the target are close to one another where there are few joints.
      const bool spread = starts_ >= kBlock && starts_ % kSpread == 0;
      point.q = model_.table.configuration(spread ? starts_ / kSpread : order_.next());
      ++starts_;
      if (descent_.run(point, kQuick)) {
        best_ = point;
        return end(true);
      }
      if (point.cost < best_of_block_.cost) best_of_block_ = point;
      if (starts_ % kBlock == 0 || starts_ == model_.options.starts) stage_ = Stage::Longer;
      return false;
    }
    case Stage::Longer:
      if (!descent_.run(best_of_block_, kLong)) return after_block();
      best_ = best_of_block_;
      return end(true);
    case Stage::Patient: return patient();
    case Stage::Ended: break;
  }
  return true;
}

bool follow_solution(const PositionIk& ik, const Pose& pose, JointVector& q) noexcept {
  const Descent local(ik.model_->on_turn, pose);
  DescentPoint point;
  point.q = q;
  if (!local.run(point, kQuick)) return false;
  q = point.q;
  return true;
}

NearestSearch::NearestSearch(const PositionIk& ik, const Pose& pose, const JointVector& near) noexcept
    : model_(ik.model_),
      pose_(pose),
      near_(near),
      search_(model_->problem, pose),
      local_(model_->on_turn, pose),
      found_(model_->problem, kSame),
      order_(model_->table, pose),
      least_(kInfinity) {}

// The search for a first solution refers to the descent beside it.
NearestSearch::NearestSearch(const NearestSearch& other) noexcept
    : model_(other.model_),
      pose_(other.pose_),
      near_(other.near_),
      search_(other.search_),
      local_(other.local_),
      found_(other.found_),
      order_(other.order_),
      stage_(other.stage_),
      starts_(other.starts_),
      pulled_(other.pulled_),
      pulls_(other.pulls_),
      slices_(other.slices_),
      least_(other.least_),
      point_(other.point_),
      best_(other.best_) {
  if (other.first_) first_.emplace(*other.first_, search_);
}

double NearestSearch::travel_time(const JointVector& q) const noexcept {
  return (q - near_).cwiseQuotient(model_->speed).cwiseAbs().maxCoeff();
}

// Puts the nearest solutions first. Only these are moved along their self-motion: the others have too far to go.
bool NearestSearch::rank() noexcept {
  for (JointVector& q : found_) model_->problem.place(near_, q);
  std::sort(found_.begin(), found_.end(),
            [&](const JointVector& a, const JointVector& b) { return travel_time(a) < travel_time(b); });
  best_.q = *found_.begin();
  stage_ = model_->redundant() ? Stage::Pull : Stage::Ended;
  return stage_ == Stage::Ended;
}

bool NearestSearch::pull() noexcept {
  if (pulls_ == 0) {
    point_.q = found_.begin()[pulled_];
    local_.evaluate(point_);
  }
  const double before = travel_time(point_.q);
  detail::pull(local_, {near_, model_->speed, true, 1e-4, kPullSteps}, point_);
  const bool moved = travel_time(point_.q) < before;
  if (moved && ++pulls_ < kPulls) return false;
  model_->problem.place(near_, point_.q);
  if (const double time = travel_time(point_.q); time < least_) {
    least_ = time;
    best_ = point_;
  }
  pulls_ = 0;
  if (++pulled_ == std::min(found_.count(), kPulled)) stage_ = Stage::Ended;
  return stage_ == Stage::Ended;
}

bool NearestSearch::advance() noexcept {
  ++slices_;
  switch (stage_) {
    case Stage::ClosedForm:
      if (model_->closed_form_branches(search_, pose_, &near_, found_)) return rank();
      stage_ = Stage::Near;
      return false;
    case Stage::Near:
      point_.q = near_.cwiseMax(model_->on_turn.lower).cwiseMin(model_->on_turn.upper);
      stage_ = Stage::NearLonger;
      if (local_.run(point_, kNear)) {
        found_.add(point_.q, true);  // on the turns of `near`, which rounding at a limit may have taken from another
        stage_ = Stage::Table;
      }
      return false;
    case Stage::NearLonger:
      if (local_.run(point_, kLong)) found_.add(point_.q);
      stage_ = Stage::Table;
      return false;
    case Stage::Table:
      point_.q = model_->table.configuration(order_.next());
      if (search_.run(point_, kQuick)) found_.add(point_.q);
      if (++starts_ < std::min(kNearStarts, model_->options.starts)) return false;
      if (found_.count() > 0) return rank();
      first_.emplace(*model_, search_, pose_);
      stage_ = Stage::First;
      return false;
    case Stage::First:
      if (!first_->advance()) return false;
      best_ = first_->best();
      if (first_->found()) {
        found_.add(best_.q);
        return rank();
      }
      stage_ = Stage::Ended;
      return true;
    case Stage::Pull: return pull();
    case Stage::Ended: break;
  }
  return true;
}

}  // namespace sigmaik::detail
