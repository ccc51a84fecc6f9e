#pragma once
/// \file kinematics.hpp
/// Pose, Jacobian and its derivative, in one pass over constant transforms.

#include <array>

#include <sigmaik/chain.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik {

/// Memory and result of update(), one object for each thread; no heap.
struct ChainState {
  Pose tip = Pose::Identity();  ///< tip in base
  Jacobian jacobian;            ///< 6×n, [v; ω] in base axes at the tip's origin
};

/// ∂J/∂q_k, k = 0 … n−1.
using JacobianGradient = std::array<Jacobian, kMaxJoints>;

/// Fills `state` for joint positions q (n,). Real time.
/// \return false, with `state` unchanged, where q has a wrong size or is not finite
bool update(const Chain& chain, const JointRef& q, ChainState& state) noexcept;

/// Pose alone. Real time; q must have chain.dof() finite entries.
Pose pose(const Chain& chain, const JointRef& q) noexcept;

/// ∂J/∂q_k from J alone, in the first dof() entries of `gradient`. With J_i = [v_i; ω_i]:
///   k ≤ i: ∂J_i/∂q_k = [ω_k × v_i; ω_k × ω_i],   k > i: ∂J_i/∂q_k = [ω_i × v_k; 0]
/// (a prismatic joint has ω = 0). Real time.
void jacobian_gradient(const Jacobian& jacobian, JacobianGradient& gradient) noexcept;

/// The same for a chain whose joints may mimic others, where J alone does not tell: with the Jacobian J_θ of all joints
/// that move, θ = A q + b, J = J_θ A and ∂J/∂q_k = Σ_b A_bk (∂J_θ/∂θ_b) A.
/// \param q (n,) at which `jacobian` was taken
void jacobian_gradient(const Chain& chain, const JointRef& q, const Jacobian& jacobian,
                       JacobianGradient& gradient) noexcept;

SIGMAIK_SAME_LAYOUT(ChainState);

}  // namespace sigmaik
