#pragma once
/// \file dynamics.hpp
/// Mass matrix, Coriolis and gravity torques of an arm, by KDL::ChainDynParam.

#include <memory>

#include <sigmaik/chain.hpp>

namespace sigmaik {

/// M(q) and C(q, q̇) q̇ + g(q), without heap.
struct DynamicsTerms {
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMaxJoints, kMaxJoints> mass;  ///< (n, n)
  JointVector bias;  ///< (n,) [N·m or N]: the torque that gives no acceleration
};

/// Rigid-body dynamics M(q) q̈ + C(q, q̇) q̇ + g(q) = τ. Not to be shared between threads.
class Dynamics {
 public:
  /// \param gravity [m/s²], in base axes
  /// \throws Error where a movable joint carries no link whose inertia is known
  explicit Dynamics(const Chain& chain, const Eigen::Vector3d& gravity = {0.0, 0.0, -9.80665});
  ~Dynamics();
  Dynamics(Dynamics&&) noexcept;
  Dynamics& operator=(Dynamics&&) noexcept;

  int dof() const noexcept;
  /// Both terms at q, q̇ (n,), which must have that size and be finite. Real time.
  void evaluate(const JointRef& q, const JointRef& qdot, DynamicsTerms& terms) noexcept;

  // These allocate, and are not for the loop.

  /// M (n, n) [kg·m²] at q (n,). \throws Error where a size is wrong
  Eigen::MatrixXd mass_matrix(const Eigen::VectorXd& q) const;
  /// C(q, q̇) q̇ (n,) [N·m] at q, q̇ (n,). \throws Error where a size is wrong
  Eigen::VectorXd coriolis(const Eigen::VectorXd& q, const Eigen::VectorXd& qdot) const;
  /// g (n,) [N·m] at q (n,): what holds the arm. \throws Error where a size is wrong
  Eigen::VectorXd gravity(const Eigen::VectorXd& q) const;

 private:
  struct Model;
  std::unique_ptr<Model> model_;
};

}  // namespace sigmaik
