#pragma once
/// \file joint_cost.hpp
/// What a plan pays for where it is: a smooth function of joint positions, added up over a trajectory's nodes.

#include <memory>

#include <sigmaik/types.hpp>

namespace sigmaik::planning {

/// A cost of joint positions with its derivatives. Immutable, safe to use from many threads.
class JointCost {
 public:
  virtual ~JointCost() = default;

  /// Number of joints, n.
  virtual int dof() const noexcept = 0;

  /// Cost at q (n,), finite for finite q. Real time.
  virtual double value(const JointRef& q) const noexcept = 0;

  /// Cost, with gradient (n,). Real time.
  virtual double slope(const JointRef& q, JointVector& gradient) const noexcept {
    JointMatrix hessian(dof(), dof());
    return model(q, gradient, hessian);
  }

  /// Cost, with gradient (n,) and Hessian (n, n), symmetric. Real time.
  virtual double model(const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept = 0;
};

/// Shared by the plans that use it; null costs nothing.
using JointCostPtr = std::shared_ptr<const JointCost>;

}  // namespace sigmaik::planning
