#pragma once
// Costs written in Python, called from planners that have released the GIL.

#include <memory>
#include <vector>

#include <sigmaik/planning/joint_cost.hpp>

#include "arguments.hpp"

namespace sigmaik::bindings {

/// What `cost` says, null for nothing, and Python objects with `value(q: (B, n)) -> (B,)` and, unless differences are
/// to do, `gradient(q: (B, n)) -> (B, n)`, added up. evaluate() holds the GIL while it calls them; it throws what they
/// raise, and Error where an answer has another shape or is not finite.
std::shared_ptr<const planning::BatchCost> with_python_costs(planning::JointCostPtr cost, int dof,
                                                             const std::vector<py::object>& python);

}  // namespace sigmaik::bindings
