#pragma once
// The bindings of planning/, in the order in which their types need each other.

#include <sigmaik/planning/collision_check.hpp>

#include "arguments.hpp"

namespace sigmaik::bindings {

/// (N, n) from C order.
inline py::array_t<double> nodes(const std::vector<double>& values, int n) {
  py::array_t<double> out({static_cast<py::ssize_t>(values.size()) / n, static_cast<py::ssize_t>(n)});
  std::copy(values.begin(), values.end(), out.mutable_data());
  return out;
}

/// What a motion must not touch; nothing where either is missing.
inline std::optional<planning::CollisionCheck> check_of(const std::optional<planning::ArmSpheres>& spheres,
                                                        const std::optional<planning::DistanceField>& field) {
  if (!spheres || !field) return std::nullopt;
  return planning::CollisionCheck(*spheres, *field);
}

void bind_trajectory(py::module_& m);
void bind_joint_cost(py::module_& m);
void bind_obstacles(py::module_& m);
void bind_support_states(py::module_& m);
void bind_time_optimal(py::module_& m);
void bind_cart(py::module_& m);

}  // namespace sigmaik::bindings
