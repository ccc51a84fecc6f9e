#pragma once
/// \file dynamics.hpp
/// Mass matrix, Coriolis and gravity torques of an arm with its payload, by KDL's ChainDynParam and ChainIdSolver_RNE.

#include <memory>
#include <optional>

#include <sigmaik/chain.hpp>
#include <sigmaik/layout.hpp>

namespace sigmaik {

/// M(q) and C(q, q̇) q̇ + g(q), without heap.
struct DynamicsTerms {
  JointMatrix mass;  ///< (n, n) [kg·m²]
  JointVector bias;  ///< (n,) [N·m or N]: the torque that gives no acceleration
};

/// Rigid-body dynamics M(q) q̈ + C(q, q̇) q̇ + g(q) = τ. One object serves one thread.
class Dynamics {
 public:
  /// \param gravity [m/s²], in base axes
  /// \param payload the tip's load: centre of mass in the tip's frame, tensor about this centre in the tip's axes
  /// \throws Error where a movable joint carries no link whose inertia is known, where gravity is not finite, or where
  /// the payload is no body: a mass below 0, a tensor that is not
  ///     symmetric, or a principal moment beyond the sum of the other two
  explicit Dynamics(const Chain& chain, const Eigen::Vector3d& gravity = {0.0, 0.0, -9.80665},
                    const std::optional<Inertia>& payload = std::nullopt);
  ~Dynamics();
  /// The same arm, gravity and payload.
  Dynamics(const Dynamics& other);
  /// The same arm, gravity and payload.
  Dynamics& operator=(const Dynamics& other);
  /// Takes over the model of another; the other may only be destroyed or assigned to.
  Dynamics(Dynamics&&) noexcept;
  /// Takes over the model of another; the other may only be destroyed or assigned to.
  Dynamics& operator=(Dynamics&&) noexcept;

  /// Number n of movable joints.
  int dof() const noexcept;
  /// The arm.
  const Chain& chain() const noexcept;
  /// (3,) [m/s²], in base axes, as given.
  const Eigen::Vector3d& gravity() const noexcept;
  /// The tip's load, as given.
  const std::optional<Inertia>& payload() const noexcept;

  // The next calls are real time: noexcept, no heap. Arguments (n,) must have n entries, all finite.

  /// M and C q̇ + g at q, q̇.
  void evaluate(const JointRef& q, const JointRef& qdot, DynamicsTerms& terms) noexcept;
  /// τ = M q̈ + C q̇ + g, without M: one recursion of Newton and Euler.
  void inverse_dynamics(const JointRef& q, const JointRef& qdot, const JointRef& qddot, JointVector& torque) noexcept;
  /// q̈ = M⁻¹ (τ − C q̇ − g). Returns false, with q̈ = 0, if M is not positive definite: no body has such inertias.
  bool forward_dynamics(const JointRef& q, const JointRef& qdot, const JointRef& torque, JointVector& qddot) noexcept;

  // The next calls allocate, and are not for the loop.

  /// M (n, n) [kg·m²] at q (n,). \throws Error where a size is wrong
  JointMatrix mass_matrix(const JointRef& q) const;
  /// C(q, q̇) q̇ (n,) [N·m] at q, q̇ (n,). \throws Error where a size is wrong
  JointVector coriolis(const JointRef& q, const JointRef& qdot) const;
  /// g (n,) [N·m] at q (n,): the torque that holds the arm at rest. \throws Error where a size is wrong
  JointVector gravity(const JointRef& q) const;

 private:
  struct Model;
  std::unique_ptr<Model> model_;
};

SIGMAIK_SAME_LAYOUT(Dynamics, DynamicsTerms);

}  // namespace sigmaik
