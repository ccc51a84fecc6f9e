#include <pybind11/native_enum.h>

#include "fields.hpp"
#include "planner_options.hpp"
#include "planning.hpp"

namespace sigmaik::bindings {

void bind_status(py::module_& m) {
  py::register_exception<Error>(m, "Error", PyExc_ValueError)
      .attr("__doc__") = "What set-up and checked calls refuse. The text carries the facts.";
  py::register_exception<ArgumentError>(m, "ArgumentError",
                                        py::make_tuple(m.attr("Error"), py::handle(PyExc_TypeError)))
      .attr("__doc__") = "An argument that a call does not have, or lacks, or that is of a wrong type.";
  // Made by hand: register_exception() makes exceptions that C++ throws, and a warning is none.
  m.attr("ModelWarning") = py::reinterpret_steal<py::object>(PyErr_NewExceptionWithDoc(
      "sigmaik._core.ModelWarning", "What set-up finds odd in a model or a start, and takes all the same.",
      PyExc_UserWarning, nullptr));
  py::native_enum<Status>(m, "Status", "enum.IntEnum",
                          "What a call did, ordered from the best to the worst. Degraded is not failed: everything "
                          "below BAD_INPUT is finite, inside the stated bound, and may be sent to the arm.")
      .value("OK", Status::Ok, "done as asked")
      .value("DAMPED", Status::Damped, "near a singularity: part of the command is damped, or cannot be done")
      .value("LIMITED", Status::Limited, "a joint limit holds part of the command back")
      .value("HOLDING", Status::Holding, "no motion: there is no target, or none is allowed")
      .value("BAD_INPUT", Status::BadInput,
             "NaN, infinite, not a rotation, or a wrong size: the arm stops as fast as its limits allow")
      .finalize();

  m.def(
      "pose_error",
      [](const py::object& current, const py::object& target) {
        return to_numpy(pose_error(pose_argument(current, "current"), pose_argument(target, "target")));
      },
      py::arg("current"), py::arg("target"),
      "[e_p; e_o] (6,) that takes `current` to `target` (4×4 poses in one frame).\n\n"
      "e_p [m] is the difference of the origins, e_o [rad] the axis-angle vector of R_target R_currentᵀ, both in the\n"
      "axes of that frame. Right up to and at a half turn.");
  m.def(
      "rotation_log",
      [](const ArrayLike& rotation) { return to_numpy(rotation_log(rotation_argument(rotation, "rotation"))); },
      py::arg("rotation"), "Axis times angle [rad] (3,) of a 3×3 rotation, angle in [0, π].");
  m.def(
      "rotation_exp", [](const ArrayLike& vector) { return to_numpy(rotation_exp(vector_argument(vector, "vector"))); },
      py::arg("vector"), "Rotation (3, 3) about `vector` by its length [rad].");
}

// For tools/stubs.sh, which writes Python's keywords of the planners from these tables.
void bind_tables(py::module_& m) {
  m.def(
      "planner_options",
      [] {
        py::typing::Dict<py::str, py::object> out;
        out["TimeOptimalOptions"] = table_of<planning::TimeOptimalOptions>();
        out["GradientOptions"] = table_of<planning::GradientOptions>();
        out["StochasticOptions"] = table_of<planning::StochasticOptions>();
        out["CartOptions"] = table_of<planning::CartOptions>();
        out["PlaneCartOptions"] = table_of<planning::PlaneCartOptions>();
        return out;
      },
      "The planners' options by the name of their struct: a tuple (name, type, default, doc) for each keyword.");
}

}  // namespace sigmaik::bindings

PYBIND11_MODULE(_core, m) {
  using namespace sigmaik::bindings;
  m.doc() = "The compiled part of sigmaik. Import sigmaik instead.";
  m.attr("__version__") = SIGMAIK_VERSION;
  bind_status(m);
  bind_chain(m);
  bind_analytic_ik(m);
  bind_methods(m);
  bind_solver(m);
  bind_collisions(m);
  bind_servo(m);
  bind_servo_batch(m);
  bind_servo_loop(m);
  bind_target_stream(m);
  bind_action_chunks(m);
  bind_dynamics(m);
  bind_least_squares(m);
  bind_constrained_ik(m);
  bind_position_ik(m);
  bind_indices(m);
  bind_singularities(m);
  bind_trajectory(m);
  bind_joint_cost(m);
  bind_obstacles(m);
  bind_support_states(m);
  bind_time_optimal(m);
  bind_cart(m);
  bind_tables(m);
}
