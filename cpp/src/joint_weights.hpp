#pragma once
// Joint weights: which joints move where an arm has more joints than its task has rows.
//
// A rule says how fast the joints move along each singular direction: Vᵀ(q̇ − q̇_posture) = y, V = (v_1 … v_m). The
// joint motion that is left, orthogonal to all v_i, does not move the tool. Unweighted, none of it is added to the
// posture's: this is the least |q̇ − q̇_posture|. With weights W = diag(w) > 0 the least Σ w_j (q̇_j − q̇_posture,j)² is
//
//     q̇ = q̇_posture + W⁻¹ V λ,   (Vᵀ W⁻¹ V) λ = y.
//
// Singular values, thresholds and the twist that the rule does are those without weights: V is orthonormal, so the
// system has no condition but that of W. Near a singularity, though, v_i of a singular direction turns quickly while
// y_i vanishes, and the constraint v_iᵀ q̇ = y_i alone would shake the joints. So the constraint of a singular direction
// is released as the direction is lost. With t_i = σ_i/w_i in [0, 1] (Resolution::weight; 1 where regular) and T =
// diag(t), M = T Vᵀ W⁻¹ V T + I − T², M z = T y, the motion is
//
//     q̇ = q̇_rule + (W⁻¹ V T z − V T z₀),   z and z₀ with W and with I,
//
// the weighted least squares min Σ w_j q̇_j² + Σ_i t_i²/(1 − t_i²) (v_iᵀq̇ − y_i)², corrected so that W = I gives the
// rule's answer. Regular directions are done exactly; direction i is missed by a part that vanishes with 1 − t_i, and
// moves the tool by σ_i times as much.

#include <sigmaik/rules.hpp>
#include <sigmaik/spectrum.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik::detail {

// Directions V of the joints and their t_i, of one spectrum or of several.
class WeightedDirections {
 public:
  void add(const Spectrum& spectrum, const Resolution& resolution) noexcept;
  // q̇ (n,) with the motion that the weights prefer. `lightness` (n,): min_j w_j / w_j; `posture`: empty, or (n,).
  JointVector prefer(const JointVector& qdot, const JointRef& posture, const JointVector& lightness) const noexcept;

 private:
  TaskVector solve(const JointVector& lightness, const TaskVector& y) const noexcept;

  int count_ = 0;
  Eigen::Matrix<double, kMaxJoints, kMaxTask, kLayout> v_;
  std::array<double, kMaxTask> part_{};  // t_i
};

}  // namespace sigmaik::detail
