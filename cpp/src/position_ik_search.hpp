#pragma once
// The searches of a PositionIk, cut into slices: one descent, or a few steps along a self-motion, at a time. A servo's
// guide has a slice of time in each cycle. No heap.

#include <optional>

#include "position_ik_held.hpp"
#include "position_ik_model.hpp"

namespace sigmaik::detail {

// The first solution that a descent finds, or the best point of all descents. Most descents that give up are in a local
// minimum at a limit; some were on the way to a solution, but slow. Hence the best of each block goes on for longer.
class FirstSearch {
 public:
  FirstSearch(const PositionIk::Model& model, const Descent& descent, const Pose& pose) noexcept;

  // A copy that uses another, equal descent.
  FirstSearch(const FirstSearch& other, const Descent& descent) noexcept;

  // One slice. Returns whether the search has ended.
  bool advance() noexcept;

  bool found() const noexcept { return found_; }
  // The solution, or the point with the smallest E.
  const DescentPoint& best() const noexcept { return best_; }

 private:
  enum class Stage : std::int8_t { Start, Longer, Patient, Ended };
  bool end(bool found) noexcept;
  bool after_block() noexcept;
  bool patient() noexcept;

  const PositionIk::Model& model_;
  const Descent& descent_;
  StartOrder order_;
  Stage stage_ = Stage::Start;
  int starts_ = 0, patience_ = 0;
  bool found_ = false;
  DescentPoint best_, best_of_block_;
  HeldSearch held_;  // where rows are held before the others: the best of each block
};

// Follows a solution of one pose to another pose that is near. Returns whether `q` is a solution now; otherwise `q` is
// unchanged. A short descent.
bool follow_solution(const PositionIk& ik, const Pose& pose, JointVector& q) noexcept;

// The solution nearest to a configuration in travel time; see PositionIk::solve().
class NearestSearch {
 public:
  // `pose` and `near` must be finite.
  NearestSearch(const PositionIk& ik, const Pose& pose, const JointVector& near) noexcept;
  NearestSearch(const NearestSearch& other) noexcept;
  NearestSearch& operator=(const NearestSearch&) = delete;

  // One slice. Returns whether the search has ended.
  bool advance() noexcept;

  bool found() const noexcept { return found_.count() > 0; }
  // The solution, or the point with the smallest E; after the end.
  const DescentPoint& best() const noexcept { return best_; }
  // The descent that the points belong to.
  const Descent& descent() const noexcept { return search_; }

  // The arguments, and how often advance() was called: with these a search is made again as it is.
  const Pose& pose() const noexcept { return pose_; }
  const JointVector& near() const noexcept { return near_; }
  int slices() const noexcept { return slices_; }

 private:
  enum class Stage : std::int8_t { ClosedForm, Near, NearLonger, Table, First, Pull, Ended };
  double travel_time(const JointVector& q) const noexcept;
  bool rank() noexcept;
  bool pull() noexcept;

  std::shared_ptr<const PositionIk::Model> model_;
  Pose pose_;
  JointVector near_;
  Descent search_, local_;
  Branches found_;
  StartOrder order_;
  std::optional<FirstSearch> first_;
  Stage stage_ = Stage::ClosedForm;
  int starts_ = 0, pulled_ = 0, pulls_ = 0, slices_ = 0;
  double least_;
  DescentPoint point_, best_;
};

}  // namespace sigmaik::detail
