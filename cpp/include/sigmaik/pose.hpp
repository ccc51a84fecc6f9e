#pragma once
/// \file pose.hpp
/// Rotations and poses, for the servo's pose error.

#include <sigmaik/types.hpp>

namespace sigmaik {

/// Axis times angle [rad] of a rotation, angle in [0, π]. The answer is accurate from the smallest angles up to π. At π
/// two vectors are equivalent; the answer is the one whose first non-zero entry is positive.
Eigen::Vector3d rotation_log(const Eigen::Matrix3d& rotation) noexcept;

/// Rotation about `vector` by its length [rad] (Rodrigues).
Eigen::Matrix3d rotation_exp(const Eigen::Vector3d& vector) noexcept;

/// Angular velocity ω, base axes, of exp(φ(t)) whose vector φ changes at `rate`: ω = J φ̇ with SO(3)'s left Jacobian
/// J = I + (1 − cos θ)/θ² [φ]× + (θ − sin θ)/θ³ [φ]×², θ = |φ|.
Eigen::Vector3d rotation_exp_rate(const Eigen::Vector3d& vector, const Eigen::Vector3d& rate) noexcept;

/// The rate φ̇ of `vector` at which exp(φ) turns at ω, base axes: the inverse of rotation_exp_rate, for |φ| < 2π.
Eigen::Vector3d rotation_log_rate(const Eigen::Vector3d& vector, const Eigen::Vector3d& omega) noexcept;

/// [e_p; e_o] that takes `current` to `target`: e_p [m] the difference of the origins, e_o [rad] the
/// axis-angle vector of R_target R_currentᵀ; both in base axes.
Twist pose_error(const Pose& current, const Pose& target) noexcept;

/// By how much an entry of RᵀR may differ from I in a matrix that is taken for a rotation: numbers written with four
/// digits, products of many float32 rotations, and quaternions whose length is off by 1e-4 are within this tolerance
/// (up to 8e-4 by the formula 1 − 2(y² + z²)). The functions that take a pose go on with the nearest rotation.
inline constexpr double kRotationTolerance = 9e-4;

/// Whether all entries are finite, the last row is 0 0 0 1, and R is a rotation (RᵀR = I within kRotationTolerance,
/// det R > 0).
bool is_pose(const PoseMatrix& matrix) noexcept;

/// The rotation nearest to R, in the sense of Frobenius' norm: the polar factor of R, by Newton's method. R must be a
/// rotation within kRotationTolerance; a rotation within 1e-14 stays as it is, bit by bit.
Eigen::Matrix3d nearest_rotation(Eigen::Matrix3d matrix) noexcept;

/// The pose with the same origin and the nearest rotation, of a matrix that is_pose() accepts.
Pose nearest_pose(const Pose& pose) noexcept;

/// Whether nearest_pose() changes the rotation by more than 1e-9, that is by more than rounding.
bool is_rough(const Pose& pose) noexcept;

}  // namespace sigmaik
