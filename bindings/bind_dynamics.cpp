#include <sigmaik/dynamics.hpp>

#include "arguments.hpp"

namespace sigmaik::bindings {

void bind_dynamics(py::module_& m) {
  py::class_<Dynamics>(m, "Dynamics",
                       "Rigid-body dynamics M(q) q̈ + C(q, q̇) q̇ + g(q) = τ of a chain, by KDL's ChainDynParam.")
      .def(py::init([](const Chain& chain, const MaybeArray& gravity) {
             if (!gravity) return Dynamics(chain);
             const Array array = array_argument(*gravity, "gravity", {3}, "(3,)");
             return Dynamics(chain, Eigen::Map<const Eigen::Vector3d>(array.data()));
           }),
           py::arg("chain"), py::arg("gravity") = py::none(),
           "gravity: (3,) [m/s²] in base axes; by default 9.80665 m/s² along −z.\n\n"
           "Raises Error where a movable joint carries no link whose inertia is known.")
      .def(
          "mass_matrix",
          [](const Dynamics& d, const ArrayLike& q) { return to_numpy(d.mass_matrix(joint_argument(q, "q", d.dof()))); },
          py::arg("q"), "M (n, n) [kg·m²] at q (n,).")
      .def(
          "coriolis",
          [](const Dynamics& d, const ArrayLike& q, const ArrayLike& qdot) {
            return to_numpy(d.coriolis(joint_argument(q, "q", d.dof()), joint_argument(qdot, "qdot", d.dof())));
          },
          py::arg("q"), py::arg("qdot"), "C(q, q̇) q̇ (n,) [N·m] at q and q̇ (n,).")
      .def(
          "gravity",
          [](const Dynamics& d, const ArrayLike& q) { return to_numpy(d.gravity(joint_argument(q, "q", d.dof()))); },
          py::arg("q"), "g (n,) [N·m] at q (n,): the torques that hold the arm.");
}

}  // namespace sigmaik::bindings
