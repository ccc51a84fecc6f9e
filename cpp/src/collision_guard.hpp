#pragma once
// The part of a servo that keeps an arm clear: distances of this cycle, the rows that bound the heading, and the check
// of a command by its stop. collisions.hpp has the derivation.

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include <sigmaik/collisions.hpp>
#include <sigmaik/least_squares.hpp>
#include <sigmaik/limits.hpp>

#include "collision_model.hpp"
#include "numbers.hpp"
#include "stop_path.hpp"

namespace sigmaik::detail {

class CollisionGuard {
 public:
  // `gain` [1/s]: the largest ratio of approach speed and distance.
  CollisionGuard(std::shared_ptr<CollisionModel> model, double gain);

  // The arm is at q (n,), and the obstacles have moved on for dt.
  void look(const JointVector& q, double dt) noexcept;
  // Forgets what was verified: the arm may be anywhere.
  void restart() noexcept { sure_ = false; }
  // Looks once more where the scene has changed, and begins a new set of rows.
  void begin() noexcept;

  // [m], the least distance now, and its pair (-1: none).
  double clearance() const noexcept { return clearance_; }
  int nearest() const noexcept { return nearest_; }
  Proximity proximity() noexcept;
  const CollisionModel& model() const noexcept { return *model_; }

  // Whether q̇ keeps the bounds on all approach speeds. Appends the rows of the bounds that q̇ breaks.
  bool allows(const JointVector& qdot, const LimitTracker& tracker) noexcept;
  // The rows of this cycle: row·q̇ ≤ bound.
  int rows() const noexcept { return rows_; }
  const JointVector& row(int i) const noexcept { return row_[static_cast<std::size_t>(i)]; }
  double bound(int i) const noexcept { return bound_[static_cast<std::size_t>(i)]; }

  // Moves q̇, inside the tracker's bounds, towards the tracker's stop, as far as the stop after q̇ needs. Returns whether
  // q̇ changed.
  bool shield(const LimitTracker& tracker, JointVector& qdot) noexcept;

 private:
  static constexpr double kRounding = 1e-10;  // [m] a distance that is missed by less is kept
  static constexpr int kListed = 64;          // pairs that are verified together
  static constexpr int kLooks = 32;           // most configurations of one verification
  static constexpr int kBisections = 4;       // of the way from the stop to the command

  // How fast a motion is braked: see collisions.hpp.
  struct Braking {
    double a = 0.0, j = 0.0;  // [1/s], [1/s²], with the reserve
    double time = 0.0;        // [s] a pair that is further away than speed × time needs no row
  };
  // Distances of the listed pairs after k cycles.
  struct Look {
    int k = 0;
    JointVector q;
    std::array<double, kListed> distance;
  };
  // Sums Σ R_j u_j of the joints [first, joints) of each body.
  using Travel = std::array<std::array<double, kMaxJoints + 1>, kMaxBodies>;

  int pair_count() const noexcept;
  bool present(const BodyPair& pair) const noexcept;
  double radius(int body) const noexcept;
  const BodyPair& pair(int k) const noexcept { return model_->pairs[static_cast<std::size_t>(k)]; }
  void place_obstacles() noexcept;
  void reach_now(const StopPath* path) noexcept;
  double coarse(const BodyPair& pair) const noexcept;
  double exact(int k) noexcept;
  Nearest nearest_of(const BodyPair& pair) const noexcept;
  double distance(const BodyPair& pair, const BodyState& state, double time) const noexcept;
  void travels(const JointVector& of_joint, Travel& travel) const noexcept;

  Braking braking(const JointVector& qdot, const LimitTracker& tracker) const noexcept;
  bool add_rows(int k, const JointVector& qdot, const LimitTracker& tracker, const Braking& braking) noexcept;
  bool add_row(int key, const BodyPair& pair, const Nearest& at, const JointVector& qdot, const LimitTracker& tracker,
               const Braking& braking) noexcept;

  bool clear(const StopPath& path, double dt) noexcept;
  bool clear_listed(const StopPath& path, double dt, int count) noexcept;
  enum class Between : std::int8_t { Clear, Unknown, Broken };
  Between between(const StopPath& path, double dt, const Look& from, const Look& to, int count) const noexcept;
  double dip(const BodyPair& pair, const JointVector& change, const JointVector& bend, double time) const noexcept;
  void look_ahead(const StopPath& path, double dt, int k, int count, Look& look) const noexcept;
  void find_floors(const LimitTracker& tracker, int least_cycles) noexcept;

  std::shared_ptr<CollisionModel> model_;
  double gain_;
  SceneState scene_;
  std::uint64_t version_ = 0;
  double scene_age_ = 0.0;  // [s] since the scene was read
  bool moving_ = false;     // an obstacle moves
  JointVector q_;
  BodyState state_;
  std::array<PlacedShape, kMaxObstacles> obstacles_;
  std::array<double, kMaxObstacles> speed_{}, spin_{};  // [m/s] of the fastest point; [m/s²] of its turn
  std::array<std::array<double, kMaxJoints>, kMaxBodies> reach_{};
  std::vector<double> lower_;  // a lower bound of each pair's distance, or the distance
  std::vector<char> is_exact_;
  std::vector<double> floor_;  // what each pair's stop leaves, at most the margin
  double clearance_ = kInfinity;
  int nearest_ = -1;
  bool sure_ = false;          // the stop was verified, and nothing has changed since
  bool floors_found_ = false;  // a floor is not the margin

  int rows_ = 0;
  std::array<JointVector, kMaxInequalities> row_;
  std::array<double, kMaxInequalities> bound_{};
  std::array<int, kMaxInequalities> key_{};
  std::array<int, kListed> listed_{};
};

}  // namespace sigmaik::detail
