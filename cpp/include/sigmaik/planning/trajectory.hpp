#pragma once
/// \file trajectory.hpp
/// Answer of the planners: a motion of the joints over time, and how the planning went.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <sigmaik/chain.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/planning/clearance.hpp>

namespace sigmaik::planning {

/// How a plan ended, ordered from the best to the worst.
enum class PlanStatus : std::int8_t {
  Optimal = 0,   ///< a local minimum, to the tolerance
  Feasible = 1,  ///< within all constraints, but there is something left to gain
  Failed = 2,    ///< no motion within the constraints was found, and none is returned
};

/// "optimal", "feasible", "failed".
const char* to_string(PlanStatus status) noexcept;
/// The status with this text: the inverse of to_string().
/// \throws Error for any other text
PlanStatus plan_status(const std::string& text);

/// Positions, velocities and accelerations, (M, n) in C order.
struct JointSamples {
  std::vector<double> q;      ///< positions [rad or m]
  std::vector<double> qdot;   ///< velocities [rad/s or m/s]
  std::vector<double> qddot;  ///< accelerations [rad/s² or m/s²]
};

/// Joint positions over time, N samples of n joints. Between samples the acceleration is constant, or, where `cubic`,
/// changes evenly: sample() is exact. A failed plan has no samples: its vectors are empty.
struct Trajectory {
  int dof = 0;               ///< n
  std::vector<double> t;     ///< (N,) [s], increasing
  std::vector<double> q;     ///< (N, n) in C order [rad or m]
  std::vector<double> qdot;  ///< (N, n) [rad/s or m/s]
  /// (N, n) [rad/s² or m/s²] of the step that begins at the sample, zero in the last row; where `cubic`, at the sample
  std::vector<double> qddot;
  double duration = std::numeric_limits<double>::quiet_NaN();  ///< [s] NaN where failed; the planner says what counts
  PlanStatus status = PlanStatus::Failed;                      ///< what the planner did
  double cost = std::numeric_limits<double>::quiet_NaN();      ///< the planner's objective; NaN where failed
  double solve_time = 0.0;                                     ///< [s] of wall-clock time, of the optimiser alone
  int iterations = 0;                                          ///< steps of the optimiser, of all starts
  int starts = 1;                                              ///< first guesses tried
  bool cubic = false;  ///< positions are cubic between samples, as under a Gaussian-process prior; else quadratic
  std::optional<Clearance> clearance;  ///< from singularities, between the samples too; none where failed

  /// Number N of samples.
  std::size_t size() const noexcept { return t.size(); }

  /// Samples at times (M,) [s]; before the first and after the last sample the motion is held at this sample.
  /// \throws Error where there is nothing to sample or a time is not finite
  JointSamples sample(const std::vector<double>& times) const;

  /// The same path in another duration [s], faster or slower everywhere by the same factor.
  /// \throws Error where there are no samples, or the duration is not finite and positive
  Trajectory retimed(double duration) const;

  /// Writes a text file: lines "# name value" with what is known of the plan, a line of column names, and a line for
  /// each sample, comma-separated, with every digit. The file appears whole or not at all. The dense samples of
  /// `clearance` are not part of it.
  /// \throws Error where the file cannot be written
  void save(const std::string& file) const;
  /// Reads a file of save(); the trajectory has no `clearance`.
  /// \throws Error where the file cannot be read, or is not that of a trajectory
  static Trajectory load(const std::string& file);
};

/// The goal (n,) with each continuous joint on the turn nearest to the start: at most π away. Poses stay the same;
/// other joints stay as they are.
/// \throws Error where a size is wrong
JointVector nearest_turn(const Chain& chain, const JointRef& start, const JointRef& goal);

SIGMAIK_SAME_LAYOUT(Trajectory, JointSamples, Clearance, Crossing);

}  // namespace sigmaik::planning
