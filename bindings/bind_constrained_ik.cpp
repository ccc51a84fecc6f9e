#include <sigmaik/constrained_ik.hpp>

#include "arguments.hpp"

namespace sigmaik::bindings {
namespace {

// A number for all rows, or six.
Twist weights_argument(const py::object& value, const char* what) {
  const Array array = Array::ensure(value);
  if (!array) PyErr_Clear();
  if (array && array.ndim() == 0) return Twist::Constant(*array.data());
  if (!array || array.ndim() != 1 || array.shape(0) != 6) {
    throw Error(std::string(what) + " must be a number or have shape (6,)");
  }
  return Eigen::Map<const Twist>(array.data());
}

void require_started(const ConstrainedIk& ik) {
  if (ik.q().size() == 0) throw Error("there is no start: call reset(q) first");
}

}  // namespace

void bind_constrained_ik(py::module_& m) {
  py::class_<ConstrainedIkStep>(m, "ConstrainedIkStep", "Answer of one step of a ConstrainedIk.")
      .def_property_readonly(
          "q", [](const ConstrainedIkStep& s) { return to_numpy(s.q); }, "(n,) position command [rad or m]")
      .def_property_readonly(
          "qdot", [](const ConstrainedIkStep& s) { return to_numpy(s.qdot); },
          "(n,) velocity command over the last dt [rad/s or m/s]")
      .def_readonly("status", &ConstrainedIkStep::status,
                    "OK: the target is met. DAMPED: not met, and no limit is to blame. LIMITED: a limit holds the step "
                    "back.")
      .def_property_readonly(
          "error", [](const ConstrainedIkStep& s) { return to_numpy(s.error); },
          "(6,) [m, rad] tip minus target after the step, base axes")
      .def_property_readonly(
          "path_error", [](const ConstrainedIkStep& s) { return to_numpy(s.path_error); },
          "(6,) [m, rad] the same, of the target slowed down by time_scale")
      .def_readonly("time_scale", &ConstrainedIkStep::time_scale,
                    "ϑ in [0, 1]: 0 as asked, 1 a complete stop; how hard the step is within the limits.")
      .def_property_readonly(
          "active", [](const ConstrainedIkStep& s) { return indices(s.active); },
          "Indices of the joints of which a limit is active.")
      .def_readonly("torque_active", &ConstrainedIkStep::torque_active, "A torque limit is active, or cannot be met.")
      .def_readonly("error_active", &ConstrainedIkStep::error_active, "max_error is active, or has been let go.")
      .def_readonly("exact_met", &ConstrainedIkStep::exact_met, "The exact part's equations hold.")
      .def_property_readonly(
          "used", [](const ConstrainedIkStep& s) { return std::string(to_string(s.used)); },
          "'analytic' or 'optimised'")
      .def("__repr__", [](const ConstrainedIkStep& s) {
        return std::string("ConstrainedIkStep(status=") + to_string(s.status) + ", used=" + to_string(s.used) +
               ", qdot=" + py::str(to_numpy(s.qdot)).cast<std::string>() + ")";
      });

  const ConstrainedIkOptions defaults;
  py::class_<ConstrainedIk>(
      m, "ConstrainedIk",
      "Follows a target pose inside every joint limit: an exact part, and the rest as well as the\n"
      "limits allow (Schreiber, Otter and Hirzinger 1999).")
      .def(
          py::init([](const Chain& chain, double dt, const ArrayLike& exact, const py::object& alpha,
                      const py::object& beta, const std::optional<double>& gamma, const py::object& max_error,
                      int iterations, bool torque_limits, bool analytic, const MaybeArray& mask,
                      const std::string& frame, const MaybeArray& gravity, bool position_limits, bool velocity_limits,
                      bool acceleration_limits, bool jerk_limits, double recovery_speed) {
            ConstrainedIkOptions options;
            options.dt = dt;
            options.task = task_argument(object_of(mask), frame);
            options.exact = rows_argument(exact, "exact");
            options.alpha = weights_argument(alpha, "alpha");
            options.beta = weights_argument(beta, "beta");
            options.gamma = gamma;
            if (!max_error.is_none()) options.max_error = weights_argument(max_error, "max_error");
            options.iterations = iterations;
            options.torque_limits = torque_limits;
            options.analytic = analytic;
            if (gravity) {
              const Array array = array_argument(*gravity, "gravity", {3}, "(3,)");
              options.gravity = Eigen::Map<const Eigen::Vector3d>(array.data());
            }
            options.position_limits = position_limits;
            options.velocity_limits = velocity_limits;
            options.acceleration_limits = acceleration_limits;
            options.jerk_limits = jerk_limits;
            options.recovery_speed = recovery_speed;
            return ConstrainedIk(chain, options);
          }),
          py::arg("chain"), py::arg("dt") = defaults.dt, py::kw_only(),
          py::arg_v("exact", py::make_tuple(true, true, true, false, false, false), "(1, 1, 1, 0, 0, 0)"),
          py::arg_v("alpha", py::object(py::float_(1.0)), "1.0"), py::arg_v("beta", py::object(py::float_(5.0)), "5.0"),
          py::arg("gamma") = py::none(), py::arg_v("max_error", py::object(py::none()), "None"),
          py::arg("iterations") = defaults.iterations, py::arg("torque_limits") = defaults.torque_limits,
          py::arg("analytic") = defaults.analytic, py::arg("mask") = py::none(), py::arg("frame") = "base",
          py::arg("gravity") = py::none(), py::arg("position_limits") = true, py::arg("velocity_limits") = true,
          py::arg("acceleration_limits") = true, py::arg("jerk_limits") = true,
          py::arg("recovery_speed") = defaults.recovery_speed,
          "dt: [s] from one step to the next.\n"
          "exact: (6,) truth values: rows (vx, vy, vz, ωx, ωy, ωz) met exactly; the others as well as limits allow.\n"
          "alpha, beta: a number or (6,): weights of the error and of its change in a cycle. Free of limits an error\n"
          "    decays by the factor β²/(α²+β²) a cycle (5 √(1 ms/dt) makes that 25 ms at any dt); with β = 0 the "
          "joints\n"
          "    may oscillate.\n"
          "gamma: weight of the time scaling ϑ; None: the target is not slowed down.\n"
          "max_error: a number or (6,) [m, rad], largest error of the approximate rows, each for itself; let go where\n"
          "    it cannot be had together with the exact part; None: any.\n"
          "iterations: linearisations a step. torque_limits: hold the chain's efforts, with its inertias and\n"
          "`gravity` (3,) [m/s²]; the closed form is not used then.\n"
          "analytic: use the closed form where the chain has one and its answer is inside the limits.\n"
          "mask, frame: rows that matter at all, in 'base' or 'tool' axes.\n"
          "position_limits, …: which limits are held. recovery_speed: in (0, 1], of the velocity limit, least speed\n"
          "    of a joint that starts outside its position limits on its way back.")
      .def(
          "reset",
          [](ConstrainedIk& ik, const ArrayLike& q, const MaybeArray& qdot) {
            const int n = ik.chain().dof();
            ik.reset(joint_argument(q, "q", n), optional_joint_argument(object_of(qdot), "qdot", n));
          },
          py::arg("q"), py::arg("qdot") = py::none(), "Starts, or starts again, at q (n,), moving with qdot (n,).")
      .def(
          "step",
          [](ConstrainedIk& ik, const py::object& target) {
            require_started(ik);
            return ik.step(pose_argument(target, "target"));
          },
          py::arg("target"), "One cycle towards a pose (4, 4) of the tip in the base. Raises Error where it is none.")
      .def_property_readonly("chain", &ConstrainedIk::chain)
      .def_property_readonly(
          "dt", [](const ConstrainedIk& ik) { return ik.options().dt; }, "[s]")
      .def_property_readonly("has_analytic", &ConstrainedIk::has_analytic, "Whether the closed form is at hand.")
      .def_property_readonly(
          "q",
          [](const ConstrainedIk& ik) {
            require_started(ik);
            return to_numpy(ik.q());
          },
          "(n,) where the reference stands.")
      .def_property_readonly(
          "pose",
          [](const ConstrainedIk& ik) {
            require_started(ik);
            return to_numpy(ik.tip().matrix());
          },
          "(4, 4) tip in base at q.")
      .def_property_readonly(
          "reference",
          [](const ConstrainedIk& ik) {
            require_started(ik);
            return to_numpy(ik.reference().matrix());
          },
          "(4, 4) the pose that the last step aimed at: its target, slowed down by ϑ.");
}

}  // namespace sigmaik::bindings
