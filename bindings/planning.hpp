#pragma once
// The bindings of planning/, in the order in which their types need each other.

#include "arguments.hpp"

namespace sigmaik::bindings {

void bind_trajectory(py::module_& m);
void bind_joint_cost(py::module_& m);
void bind_obstacles(py::module_& m);
void bind_planning(py::module_& m);
void bind_cart(py::module_& m);

}  // namespace sigmaik::bindings
