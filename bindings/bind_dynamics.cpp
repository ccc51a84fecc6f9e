#include <sigmaik/computed_torque.hpp>

#include "values.hpp"

namespace sigmaik::bindings {

template <>
struct Fields<ComputedTorqueOptions> {
  static constexpr std::tuple all{
      field("frequency", &ComputedTorqueOptions::frequency,
            "ω [rad/s] > 0 of the error's dynamics; the loop's rate should be 10 ω and more."),
      field("damping_ratio", &ComputedTorqueOptions::damping_ratio, "ζ > 0; 1 is critical."),
      field("gravity", &ComputedTorqueOptions::gravity, "(3,) [m/s²] in base axes, as the controller knows it."),
      field("payload", &ComputedTorqueOptions::payload,
            "what the controller knows of the tip's load, in the tip's frame, as for Dynamics."),
  };
};

namespace {

Eigen::Vector3d gravity_argument(const MaybeArray& gravity, const Eigen::Vector3d& otherwise) {
  return gravity ? vector_argument(*gravity, "gravity") : otherwise;
}

void bind_value(py::class_<Dynamics> c) {
  def_pickle(
      c, 3,
      [](const Dynamics& d) {
        return py::make_tuple(d.chain(), to_numpy(d.gravity()), Argument<std::optional<Inertia>>::to(d.payload()));
      },
      [](const py::tuple& s) {
        return Dynamics(s[0].cast<const Chain&>(), vector_argument(py::object(s[1]), "gravity"),
                        s[2].cast<std::optional<Inertia>>());
      },
      [](const Dynamics& a, const Dynamics& b) {
        return same(a.chain(), b.chain()) && equal(a.gravity(), b.gravity()) && equal(a.payload(), b.payload());
      });
  def_hash_by_chain(c);
}

void bind_value(py::class_<ComputedTorque> c) {
  def_pickle(
      c, 2, [](const ComputedTorque& t) { return py::make_tuple(t.chain(), to_dict(t.options())); },
      [](const py::tuple& s) {
        return ComputedTorque(s[0].cast<const Chain&>(), from_dict<ComputedTorqueOptions>(s[1].cast<py::dict>()));
      },
      [](const ComputedTorque& a, const ComputedTorque& b) {
        return same(a.chain(), b.chain()) && equal(a.options(), b.options());
      });
  def_hash_by_chain(c);
}

void bind_rigid_body(py::module_& m) {
  py::class_<Dynamics>(m, "Dynamics",
                       "Rigid-body dynamics M(q) q̈ + C(q, q̇) q̇ + g(q) = τ of a chain with what it carries, by KDL.")
      .def(py::init([](const Chain& chain, const MaybeArray& gravity, const std::optional<Inertia>& payload) {
             return Dynamics(chain, gravity_argument(gravity, {0.0, 0.0, -9.80665}), payload);
           }),
           py::arg("chain"), py::arg("gravity") = py::none(), py::arg("payload") = py::none(),
           "gravity: (3,) [m/s²] in base axes; by default 9.80665 m/s² along −z.\n"
           "payload: what the tip carries, in the tip's frame.\n\n"
           "Raises Error where a movable joint carries no link whose inertia is known, and where the payload is no "
           "body:\n"
           "a mass below 0, a tensor that is not symmetric, a principal moment beyond the sum of the other two.")
      .def_property_readonly("dof", &Dynamics::dof, "Number of movable joints, n.")
      .def(
          "mass_matrix",
          [](const Dynamics& d, const ArrayLike& q) {
            return to_numpy(d.mass_matrix(joint_argument(q, "q", d.dof())));
          },
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
          py::arg("q"), "g (n,) [N·m] at q (n,): the torques that hold the arm.")
      .def(
          "inverse_dynamics",
          [](Dynamics& d, const ArrayLike& q, const ArrayLike& qdot, const ArrayLike& qddot) {
            JointVector torque;
            d.inverse_dynamics(joint_argument(q, "q", d.dof()), joint_argument(qdot, "qdot", d.dof()),
                               joint_argument(qddot, "qddot", d.dof()), torque);
            return to_numpy(torque);
          },
          py::arg("q"), py::arg("qdot"), py::arg("qddot"),
          "τ = M q̈ + C q̇ + g (n,) [N·m] at q, q̇, q̈ (n,), by one recursion of Newton and Euler.")
      .def(
          "forward_dynamics",
          [](Dynamics& d, const ArrayLike& q, const ArrayLike& qdot, const ArrayLike& torque) {
            JointVector qddot;
            if (!d.forward_dynamics(joint_argument(q, "q", d.dof()), joint_argument(qdot, "qdot", d.dof()),
                                    joint_argument(torque, "torque", d.dof()), qddot)) {
              throw Error("the mass matrix is not positive definite at this q: the arm's inertias are no bodies'");
            }
            return to_numpy(qddot);
          },
          py::arg("q"), py::arg("qdot"), py::arg("torque"),
          "q̈ = M⁻¹ (τ − C q̇ − g) (n,) [rad/s² or m/s²] at q, q̇ (n,) under τ (n,) [N·m].\n\n"
          "Raises Error where M is not positive definite.")
      .def("__repr__", [](const Dynamics& d) { return record("Dynamics", {{"dof", py::cast(d.dof())}}); });
  bind_value(bound<Dynamics>(m, "Dynamics"));
}

void bind_computed_torque(py::module_& m) {
  py::class_<ComputedTorqueStep>(m, "ComputedTorqueStep", "Answer of one cycle of a ComputedTorque.")
      .def_property_readonly(
          "torque", [](const ComputedTorqueStep& s) { return to_numpy(s.torque); },
          "(n,) [N·m or N], within the chain's effort limits")
      .def_readonly("status", &ComputedTorqueStep::status, "OK, or LIMITED where an effort limit would be broken.")
      .def_readonly("scale", &ComputedTorqueStep::scale, "In [0, 1], the part of v that effort limits leave.")
      .def_property_readonly(
          "limiting_joints", [](const ComputedTorqueStep& s) { return indices(s.limiting_joints); },
          "Indices of the joints whose torque would break its limit.")
      .def("__repr__", [](const ComputedTorqueStep& s) {
        return std::string("ComputedTorqueStep(status=") + to_string(s.status) +
               ", torque=" + py::str(to_numpy(s.torque)).cast<std::string>() + ")";
      });
  def_value(bound<ComputedTorqueStep>(m, "ComputedTorqueStep"));

  py::class_<ComputedTorque> c(
      m, "ComputedTorque",
      "Computed torque control: τ = M(q) v + C(q, q̇) q̇ + g(q), v = q̈_d + 2ζω ė + ω² e, e = q_d − q.\n\n"
      "With the true model every joint's error obeys ë + 2ζω ė + ω² e = 0 by itself (Beck et al. 2022,\n"
      "eqs. 18 to 20). Where an effort limit of the chain would be broken, v is scaled down in all joints alike.");
  def_init<ComputedTorqueOptions>(
      c, std::tuple{parameter<Chain>("chain")}, 0,
      "Raises Error where an option is out of its range, and where Dynamics does.",
      [](const Chain& chain, const ComputedTorqueOptions& options) { return ComputedTorque(chain, options); });
  def_options(c);
  bind_value(c);
  c.def_property_readonly("dof", &ComputedTorque::dof, "Number of movable joints, n.")
      .def(
          "update",
          [](ComputedTorque& control, const ArrayLike& q, const ArrayLike& qdot, const ArrayLike& q_desired,
             const ArrayLike& qdot_desired, const ArrayLike& qddot_desired) {
            const int n = control.dof();
            const ComputedTorqueStep step = control.update(
                joint_argument(q, "q", n), joint_argument(qdot, "qdot", n), joint_argument(q_desired, "q_desired", n),
                joint_argument(qdot_desired, "qdot_desired", n), joint_argument(qddot_desired, "qddot_desired", n));
            if (step.status == Status::BadInput) throw Error("the torque is too large for floating-point numbers");
            return step;
          },
          py::arg("q"), py::arg("qdot"), py::arg("q_desired"), py::arg("qdot_desired"), py::arg("qddot_desired"),
          "One cycle: the arm is at q, q̇ (n,), and should be at q_d, q̇_d, accelerating by q̈_d.")
      .def("__repr__",
           [](const ComputedTorque& control) { return record("ComputedTorque", {{"dof", py::cast(control.dof())}}); });
}

}  // namespace

void bind_dynamics(py::module_& m) {
  bind_rigid_body(m);
  bind_computed_torque(m);
}

}  // namespace sigmaik::bindings
