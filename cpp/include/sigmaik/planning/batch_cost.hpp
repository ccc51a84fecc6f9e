#pragma once
/// \file batch_cost.hpp
/// A cost of all states of a motion with support states at once: a JointCost, or a user's own cost, which may be slow
/// to call and may throw.

#include <cstddef>
#include <memory>

#include <sigmaik/layout.hpp>

namespace sigmaik::planning {

/// A cost of joint positions with its gradient.
class BatchCost {
 public:
  virtual ~BatchCost() = default;

  /// Number of joints, n.
  virtual int dof() const noexcept = 0;

  /// Values, and gradients where `gradient` is not null, at `count` configurations. An exception ends the plan and
  /// reaches the caller of the planner.
  /// \param q (count, n) in C order, finite
  /// \param value out: (count,), finite   \param gradient out: (count, n), finite, or null
  virtual void evaluate(std::size_t count, const double* q, double* value, double* gradient) const = 0;
};

/// Shared by the planners that use it.
using BatchCostPtr = std::shared_ptr<const BatchCost>;

SIGMAIK_SAME_LAYOUT(BatchCost);

}  // namespace sigmaik::planning
