#pragma once
/// \file types.hpp
/// Vocabulary types. Units are m, rad, s, N·m throughout. Every type is bounded, so none touches the heap.
///
/// Frames: a twist is [v; ω], expressed in the axes of the chain's base, for the point at the tip's origin
/// (Pinocchio's LOCAL_WORLD_ALIGNED). Jacobians have the same row order.

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <sigmaik/layout.hpp>

namespace sigmaik {

inline constexpr int kMaxJoints = 16;  ///< most movable joints of a chain
inline constexpr int kMaxTask = 6;     ///< most task rows

/// Every matrix here is unaligned and column-major, so that its layout does not depend on the vector instructions that
/// a user's compiler flags allow (-mavx2, -march=native, EIGEN_MAX_ALIGN_BYTES).
inline constexpr int kLayout = Eigen::ColMajor | Eigen::DontAlign;

/// One number a joint: position [rad or m], velocity, … of up to 16 joints.
using JointVector = Eigen::Matrix<double, Eigen::Dynamic, 1, kLayout, kMaxJoints, 1>;
/// Square in the joints, up to 16×16: a Hessian in q.
using JointMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, kLayout, kMaxJoints, kMaxJoints>;
/// One number a task row, up to 6.
using TaskVector = Eigen::Matrix<double, Eigen::Dynamic, 1, kLayout, kMaxTask, 1>;
/// Square in the task's rows, up to 6×6.
using TaskMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, kLayout, kMaxTask, kMaxTask>;
/// [v; ω], 6×n: row i is m/s or rad/s per unit joint speed.
using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic, kLayout, 6, kMaxJoints>;
/// Any m×n with 1 ≤ m ≤ 6 and 1 ≤ n ≤ 16, for tasks that are not a whole twist.
using TaskJacobian = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, kLayout, kMaxTask, kMaxJoints>;
/// [v; ω] in m/s and rad/s.
using Twist = Eigen::Matrix<double, 6, 1, kLayout>;
/// Homogeneous transformation, 4×4.
using PoseMatrix = Eigen::Matrix<double, 4, 4, kLayout>;
/// Tip in base.
using Pose = Eigen::Transform<double, 3, Eigen::Isometry, Eigen::DontAlign>;

/// Arguments of real-time calls. A Ref to a bounded type takes vectors, blocks and rows without a heap copy.
using JointRef = Eigen::Ref<const JointVector>;
/// Argument: one number a task row.
using TaskRef = Eigen::Ref<const TaskVector>;
/// Argument: an m×n Jacobian, 1 ≤ m ≤ 6 and 1 ≤ n ≤ 16; a block of a larger matrix too.
using TaskJacobianRef = Eigen::Ref<const TaskJacobian, 0, Eigen::OuterStride<>>;

namespace detail {
/// The Eigen that a program is compiled with, and whether its own matrices are row-major.
template <int world, int major, bool row_major>
struct EigenOf {};
}  // namespace detail

SIGMAIK_SAME_LAYOUT(JointVector, JointMatrix, TaskVector, TaskMatrix, Jacobian, TaskJacobian, Twist, Pose, JointRef,
                    TaskRef, TaskJacobianRef,
                    detail::EigenOf<EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, Eigen::Matrix3d::IsRowMajor>);

}  // namespace sigmaik
