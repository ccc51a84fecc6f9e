#pragma once
/// \file analytic_ik.hpp
/// Closed-form inverse kinematics of six-joint arms with a spherical wrist: every posture of a pose.

#include <array>
#include <cstdint>

#include <sigmaik/chain.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik {

/// Postures of a six-joint arm [rad].
using SixJoints = Eigen::Matrix<double, 6, 1, kLayout>;

/// Result of AnalyticIk.
enum class AnalyticStatus : std::int8_t {
  Ok = 0,           ///< at least one posture
  Unreachable = 1,  ///< the pose is out of reach, by position or (where the wrist is not perpendicular) by orientation
  BadInput = 2,     ///< NaN, infinite, not a rotation, or a wrong size
};

/// "ok", "unreachable", "bad input".
const char* to_string(AnalyticStatus status) noexcept;

/// Bits of AnalyticBranch::singular: the singularities at which two branches coincide.
enum AnalyticSingularity : std::uint8_t {
  kShoulderSingular = 1,  ///< wrist centre in the plane through axis 1 along axis 2; on axis 1 itself, q1 is free
  kElbowSingular = 2,     ///< stretched or folded; folded onto axis 2 (links of one length), q2 is free
  kWristSingular = 4,     ///< axes 4, 5, 6 in one plane; where 4 and 6 are one line, only a sum of q4 and q6 is given
};

/// One posture of a pose.
struct AnalyticBranch {
  SixJoints q;                 ///< [rad]
  bool within_limits = false;  ///< every joint within the chain's limits
  std::uint8_t singular = 0;   ///< AnalyticSingularity bits
};

/// Answer of AnalyticIk::solve(). By value, no heap.
struct AnalyticSolutions {
  AnalyticStatus status = AnalyticStatus::BadInput;  ///< what was found
  int count = 0;                                     ///< 0 to 8
  std::array<AnalyticBranch, 8> branches;            ///< the first `count`

  /// The postures found, for range-based loops.
  const AnalyticBranch* begin() const noexcept { return branches.data(); }
  /// One past the last posture found.
  const AnalyticBranch* end() const noexcept { return branches.data() + count; }
};

/// Answer of AnalyticIk::nearest(). By value, no heap.
struct AnalyticNearest {
  AnalyticStatus status = AnalyticStatus::BadInput;  ///< what was found
  AnalyticBranch branch;                             ///< meaningful where status is Ok
};

/// Inverse kinematics by subproblems with closed-form solutions: the wrist centre gives joint 1, then joints 2 and 3 as
/// a planar arm; the remaining orientation gives joints 4, 5, 6. After
///   D. Pieper, "The kinematics of manipulators under computer control", PhD thesis, Stanford, 1968;
///   B. Paden, "Kinematics and control of robot manipulators", PhD thesis, UC Berkeley, 1985 (after W. Kahan);
///   R. Murray, Z. Li, S. Sastry, "A Mathematical Introduction to Robotic Manipulation", CRC Press, 1994, section 3.3.
///
/// The class covers every chain of six revolute or continuous joints, with any frames, signs and zeros, where
///   - axes 4, 5, 6 meet in one point, the wrist centre; axis 5 is parallel to neither 4 nor 6;
///   - axes 2 and 3 are parallel and apart, and the wrist centre is off axis 3;
///   - axis 1 is not parallel to axis 2; the two axes need neither be perpendicular nor meet.
/// Axes that must meet or be parallel do so within 1e-9: rad, or part of the arm's size, which is the sum of the
/// distances between the joints' frames from joint 1 to the tip. Directions and axes 2 and 3, which must differ, differ
/// by more than 1e-3: rad, or part of the planar arm's length. The answers of an arm that only just meets the tolerance
/// are only as exact as the tolerance.
///
/// Answers reproduce the pose to rounding. A pose within 1e-12 (rad, or part of size and mounting distance) of a
/// singularity counts as singular, and the answers reproduce it to 1e-12; a pose that is out of reach by no more than
/// 1e-12 counts as reached by the stretched arm. A rotation matrix of single precision is replaced by the nearest
/// rotation. One weakness: where the axes of the wrist are not at right angles, a pose within 1e-6 of all three
/// singularities at once may count as unreachable.
///
/// A value: cheap to copy, safe to use from many threads.
class AnalyticIk {
 public:
  /// \throws Error with the facts where the arm is not of this kind
  explicit AnalyticIk(const Chain& chain);

  /// Every posture of `pose` (tip in base), also those outside the limits. Real time.
  ///
  /// Each joint is on the turn nearest to 0 within its limits; if no turn is within the limits, in (−π, π]. Branches
  /// are ordered by shoulder, elbow and wrist, so that a branch keeps its place among the eight of a regular pose.
  /// Branches that coincide at a singularity are given once; a free angle is as close to 0 as limits allow (if an
  /// oblique wrist then cannot reach the orientation, the free angle is the next of 32 around the circle at which the
  /// wrist can).
  AnalyticSolutions solve(const Pose& pose) const noexcept;

  /// The posture of `pose` nearest to q (6,) [rad], by the Euclidean norm of the joint differences. If any posture is
  /// within the limits, only such postures count. Real time.
  ///
  /// Each joint is on the turn nearest to q within its limits; if no turn is within the limits, on the turn nearest to
  /// q. An angle that the pose leaves free stays as in q, or at the limit that q is beyond.
  AnalyticNearest nearest(const Pose& pose, const JointRef& q) const noexcept;

  /// The arm.
  const Chain& chain() const noexcept { return chain_; }

 private:
  friend struct AnalyticSetup;
  friend struct AnalyticWalk;

  // Frames. Each z axis lies along the axis of a joint; αij is the angle from axis i to axis j.
  //
  //     {s}  shoulder: z along axis 1, axis 2 in the plane of x and z, on the side of x
  //     {p}  planar arm: {p} = {s} Ry(α12), so that z lies along axis 2
  //     {4}  z along axis 4, axis 5 in the plane of x and z, on the side of x
  //     {5a} {5a} = {4} Ry(α45): z along axis 5, and axis 4 in the plane of x and z
  //     {5b} {5b} = {5a} Rz(q5 + zero5): z along axis 5, and axis 6 in the plane of x and z, on the side of x
  //     {6}  hand: {6} = {5b} Ry(α56), so that z lies along axis 6
  //
  //        axis 4   axis 5   axis 6
  //             \  α45 | α56  /
  //               \    |    /            q5 turns the plane of axes 5 and 6, {5b}, against the plane of axes 4 and 5,
  //                 \  |  /              {5a}; both planes contain axis 5 and the wrist centre W.
  //                   \|/
  //                    W
  struct Shoulder {
    Eigen::Matrix3d from_base;  // axes of the base to those of {s}
    Eigen::Vector3d origin;     // of joint 1, in the base [m]
    double c12, s12;            // cosine and sine of α12
    double height;              // of the wrist centre along axis 2, from the origin of joint 1 [m]
    double x, y;                // axis 2 in {p}, from the origin of joint 1 [m]
  };
  struct Elbow {
    double upper, fore;   // lengths of the planar arm's links [m]
    double zero2, zero3;  // angles of the planar arm at q = 0
    double sign3;         // +1 if axis 3 points along axis 2, else −1
  };
  struct Wrist {
    Eigen::Matrix3d from_fore;            // axes of the forearm (x along the forearm, z along axis 2) to those of {4}
    double c45, s45, c56, s56;            // cosines and sines of α45 and α56
    double c_sum, s_sum, c_diff, s_diff;  // of half of α45 + α56, and half of α45 − α56
    double zero5;                         // from x of {5a} to x of {5b} about axis 5, at q = 0
    bool perpendicular;                   // axis 5 is perpendicular to axes 4 and 6
  };

  Chain chain_;
  Shoulder shoulder_;
  Elbow elbow_;
  Wrist wrist_;
  Eigen::Matrix3d tip_;  // in the tip's frame: the wrist centre [m], then x and z of {6}
  double reach_;         // largest distance of the wrist centre from the origin of joint 1 [m]
  double tolerance_;     // a distance below the tolerance counts as zero [m]
  SixJoints lower_, upper_;
};

SIGMAIK_SAME_LAYOUT(AnalyticIk, AnalyticBranch, AnalyticSolutions, AnalyticNearest);

}  // namespace sigmaik
