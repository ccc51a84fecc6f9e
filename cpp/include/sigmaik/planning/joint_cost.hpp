#pragma once
/// \file joint_cost.hpp
/// A smooth cost of joint positions, added up over a trajectory's nodes.

#include <cstddef>
#include <memory>

#include <sigmaik/layout.hpp>
#include <sigmaik/planning/batch_cost.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik::planning {

/// A cost of joint positions with its derivatives. Immutable, safe to use from many threads.
class JointCost : public BatchCost {
 public:
  /// Cost at q (n,), finite for finite q. Real time.
  virtual double value(const JointRef& q) const noexcept = 0;

  /// Cost, with gradient (n,) and Hessian (n, n), symmetric. Real time.
  virtual double model(const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept = 0;

  /// Cost, with gradient (n,). Real time; the default calls model().
  virtual double gradient(const JointRef& q, JointVector& gradient) const noexcept;

  /// Evaluates one configuration after another. Real time.
  void evaluate(std::size_t count, const double* q, double* value, double* gradient) const noexcept final;
};

/// Shared by the plans that use it; null costs nothing.
using JointCostPtr = std::shared_ptr<const JointCost>;

/// Values, and gradients where `gradient` is not null, at `count` configurations. The answers depend neither on their
/// order nor on `threads`.
/// \param q (count, n) in C order, finite
/// \param value out: (count,)   \param gradient out: (count, n), or null
/// \param threads ≥ 1, the most that work at once; never more than the machine has cores
/// \throws Error where threads is below 1
void evaluate(const JointCost& cost, std::size_t count, const double* q, double* value, double* gradient = nullptr,
              int threads = 1);

SIGMAIK_SAME_LAYOUT(JointCost);

}  // namespace sigmaik::planning
