#pragma once
/// \file position_ik.hpp
/// Joint positions of a pose, for any chain, inside its position limits.
///
/// A solution is a minimum, with the value zero, of
///
///     E(q) = |e_p(q)/L|² + |e_o(q)|²   where   lower ≤ q ≤ upper
///
/// over the rows of the task, where [e_p; e_o] is pose_error and L is the chain's characteristic length. Where errors
/// are allowed (ranges, a cone), the distance from the allowed errors takes the place of the error: E is zero inside,
/// and has a continuous gradient, as the allowed errors are convex sets. The descent is
/// the method of Levenberg and Marquardt with a damping that is proportional to E (Sugihara, "Solvability-unconcerned
/// inverse kinematics by the Levenberg–Marquardt method", IEEE Trans. Robotics 27(5), 2011):
///
///     min |r − J Δq|² + λ |Δq|²_W   where   lower ≤ q + Δq ≤ upper,   λ = c E
///
/// As the damping goes to zero with the error, the convergence is quadratic at a regular solution, and the descent
/// converges at a singular solution, too. A joint that a step would take beyond a limit stays at the limit exactly, and
/// the other joints take over (an active set; Bertsekas, "Projected Newton methods for optimization problems with
/// simple constraints", SIAM Journal on Control and Optimization 20(2), 1982). Orientations are compared by the
/// logarithm of the rotation between them, which is accurate up to a half turn.
///
/// A descent ends in a local minimum for a part of the starts, mostly at a limit. Hence the constructor makes a table
/// of configurations that are spread evenly over the joint ranges (an additive recurrence), with their poses. A search
/// starts from the entries whose poses are closest to the target, one after the other. The order depends on nothing but
/// the chain and the target: the same call gives the same answer.
///
/// Two kinds of arms with six joints have a closed form, which gives all solutions at once: those with a spherical
/// wrist (analytic_ik.hpp), and those whose axes 2, 3, 4 are parallel and whose axes 5 and 6 meet, such as Universal
/// Robots' (Elias and Wen, "IK-Geo: Unified robot inverse kinematics using subproblem decomposition", Mechanism and
/// Machine Theory 209, 2025). The search follows only where none of these solutions is inside the limits.
///
/// Close to a singularity, and out of reach, these descents are slow. The best of each block of starts therefore goes
/// on with the second derivatives of the pose, which move the tip along a lost direction. The nearest pose of one that
/// is out of reach is a minimum of E by Newton's method. Rows that are held before the others have a larger weight in
/// E, and are then met exactly by the method of multipliers (Rockafellar, "The multiplier method of Hestenes and Powell
/// applied to convex programming", Journal of Optimization Theory and Applications 12(6), 1973).

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <sigmaik/chain.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/task.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik {

class PositionIk;

namespace detail {
class FirstSearch;
class HeldSearch;
class NearestSearch;
bool follow_solution(const PositionIk& ik, const Pose& pose, JointVector& q) noexcept;
}  // namespace detail

/// An axis of the tool that may point anywhere within an angle of its direction in the target pose. The turn about the
/// axis is free.
struct ToolCone {
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  ///< in tool axes, not zero
  double angle = 0.0;                               ///< [rad] in [0, π]
};

/// Settings of a PositionIk. Arrays of six have an entry for each row (x, y, z, rotations about x, y, z), in the task's
/// axes.
struct PositionIkOptions {
  std::array<double, 2> tolerance{1e-6, 1e-6};  ///< [m], [rad] > 0: largest errors, beyond those allowed below
  Task task{};                                  ///< rows of the pose error that matter
  /// Of these, the rows that are held before the others: of a pose that is unreachable, the exact rows are met (where
  /// they can be), and the others are as near as possible.
  std::array<bool, 6> exact{};
  /// [m, rad] least and largest error allowed, target minus tip, as in PositionIkResult::error; least ≤ largest, and
  /// either may be infinite. An orientation's error is the rotation vector from tip to target.
  std::array<std::array<double, 2>, 6> ranges{};
  std::optional<ToolCone> cone{};  ///< in place of the rows of the orientation, which the task must ask for
  int starts = 256;                ///< in [1, 2048]: the most starts of a search
};

/// Result of PositionIk.
enum class PositionIkStatus : std::int8_t {
  Ok = 0,           ///< a solution, inside tolerance and limits
  Unreachable = 1,  ///< none was found; q is the nearest that was found: the smallest E, after that of the exact rows
  BadInput = 2,     ///< NaN, beyond 1e9 rad or m, not a rotation, or a wrong size
};

/// "ok", "unreachable", "bad input".
const char* to_string(PositionIkStatus status) noexcept;

/// Answer of PositionIk::solve(). By value, no heap.
struct PositionIkResult {
  JointVector q;                                         ///< (n,) [rad or m] inside the limits; empty after bad input
  PositionIkStatus status = PositionIkStatus::BadInput;  ///< what was found
  /// pose_error from q to the target, base axes; zero in the rows that the task leaves out. With a cone, the
  /// orientation part is the rotation by which the axis misses its direction.
  Twist error = Twist::Zero();
  double solve_time = 0.0;  ///< [s]
};

/// One of the solutions of PositionIk::solve_all().
struct PositionIkBranch {
  JointVector q;           ///< (n,) [rad or m] inside the limits
  double sigma_min = 0.0;  ///< least singular value of the task's rows, lengths in characteristic lengths
  double margin = 0.0;     ///< [rad or m] from the nearest limit; infinite where no joint has a limit
};

/// Position inverse kinematics: tip pose in, joint positions out. A value: cheap to copy, safe to use from many
/// threads.
class PositionIk {
 public:
  /// Takes about a millisecond.
  /// \throws Error where an option is out of its range
  explicit PositionIk(const Chain& chain, const PositionIkOptions& options = {});

  /// A solution of `pose` (tip in base): the first that the search finds, or of a closed form the one that is farthest
  /// from the limits. Joints that may turn more than once are on the turn nearest to 0. noexcept, no heap, bounded.
  PositionIkResult solve(const Pose& pose) const noexcept;

  /// The solution nearest to `near` (n,) in travel time, max_i |q_i − near_i| / velocity limit_i (1 rad/s or m/s where
  /// there is no limit), of those that a bounded search finds: from `near` first, then from the closest entries of the
  /// table. Each joint is on the turn nearest to `near` within its limits, so that a continuous joint turns the short
  /// way round. A redundant arm is then moved along its self-motion towards `near`, to a local minimum of the travel
  /// time. noexcept, no heap, bounded: microseconds with a closed form, about half a millisecond
  /// without.
  PositionIkResult solve(const Pose& pose, const JointRef& near) const noexcept;

  /// The distinct solutions that `starts` descents or a closed form find, those far from the limits first; empty where
  /// there is none. Each joint is on the turn within its limits that is nearest to the middle of its range (0 where
  /// there is none), so that solutions which differ by whole turns count once; solutions within 0.01 rad count once,
  /// too. For a redundant arm, each solution is moved along its self-motion to a local minimum of the distance to the
  /// middle of the ranges; these minima, where 0.1 rad apart, are the representatives. At most 64.
  /// \throws Error where `pose` is not a pose
  std::vector<PositionIkBranch> solve_all(const Pose& pose) const;

  /// solve(pose) for `count` poses.
  /// \param pose (B, 4, 4) in C order
  /// \param q out: (B, n); NaN where the status is not Ok
  /// \param status out: (B,); may be null
  /// \param threads ≥ 1, the most that work at once; the answers do not depend on it
  /// \throws Error where threads < 1
  void solve_batch(std::size_t count, const double* pose, double* q, PositionIkStatus* status = nullptr,
                   int threads = 1) const;

  /// The arm.
  const Chain& chain() const noexcept;
  /// The settings, as given.
  const PositionIkOptions& options() const noexcept;

 private:
  friend class detail::FirstSearch;
  friend class detail::HeldSearch;
  friend class detail::NearestSearch;
  friend bool detail::follow_solution(const PositionIk& ik, const Pose& pose, JointVector& q) noexcept;
  struct Model;
  std::shared_ptr<const Model> model_;
};

SIGMAIK_SAME_LAYOUT(PositionIk, ToolCone, PositionIkOptions, PositionIkResult, PositionIkBranch);

}  // namespace sigmaik
