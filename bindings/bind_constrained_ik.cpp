#include <sigmaik/constrained_ik.hpp>

#include "servo_options.hpp"
#include "values.hpp"

namespace sigmaik::bindings {

template <>
struct Fields<ConstrainedIkOptions> {
  static constexpr std::tuple all{
      field("dt", &ConstrainedIkOptions::dt, "[s] > 0, from one update to the next."),
      field("exact", &ConstrainedIkOptions::exact,
            "(6,) truth values: the rows (vx, vy, vz, ωx, ωy, ωz) met exactly; the others as well as limits allow."),
      field("alpha", &ConstrainedIkOptions::alpha,
            "≥ 0, a number or (6,) [1/m, 1/rad]: weights of the error of the rows that are not exact."),
      field("beta", &ConstrainedIkOptions::beta,
            "≥ 0, a number or (6,) [1/m, 1/rad]: weights of that error's change in a cycle. Free of limits an error "
            "decays by the factor β²/(α²+β²) a cycle (5 √(1 ms/dt) makes that 25 ms at any dt); with β = 0 the joints "
            "may oscillate."),
      field("gamma", &ConstrainedIkOptions::gamma,
            "> 0, weight of the time scaling ϑ; None: the target is not slowed down."),
      field("max_error", &ConstrainedIkOptions::max_error,
            "> 0, a number or (6,) [m, rad]: the largest error of the rows that are not exact, each for itself; let go "
            "where it cannot be had together with the exact part."),
      field("iterations", &ConstrainedIkOptions::iterations, "1 to 100 linearisations a cycle."),
      field("torque_limits", &ConstrainedIkOptions::torque_limits,
            "whether the chain's effort limits are held, with its inertias; the closed form is not used then."),
      field("analytic", &ConstrainedIkOptions::analytic,
            "whether the closed form is used where the chain has one and its answer is inside the limits."),
      nested(&ConstrainedIkOptions::task),
      field("gravity", &ConstrainedIkOptions::gravity, "(3,) [m/s²] in base axes, for torque_limits."),
      nested(&ConstrainedIkOptions::limits),
      field("strict", &ConstrainedIkOptions::strict,
            "whether `update` raises Error for a target that is no pose, in place of BAD_INPUT and a stop."),
  };
};

namespace {

void require_started(const ConstrainedIk& ik) {
  if (ik.q().size() == 0) throw Error("there is no start: call reset(q) first");
}

ConstrainedIkStep update(ConstrainedIk& ik, const py::object& target) {
  require_started(ik);
  return ik.update(ik.options().strict ? pose_argument(target, "target") : target_argument(target, "target"));
}

// This getter throws until the first reset: nothing stands anywhere before.
template <typename Get>
auto once_started(Get get) {
  return [get](const ConstrainedIk& ik) {
    require_started(ik);
    return to_numpy(get(ik));
  };
}

void bind_step(py::module_& m) {
  py::class_<ConstrainedIkStep>(m, "ConstrainedIkStep", "Answer of one cycle of a ConstrainedIk.")
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
      .def_readonly("not_settling", &ConstrainedIkStep::not_settling,
                    "The target has rested for longer than any motion takes (ConstrainedIk.settling_time), and the arm "
                    "still moves.")
      .def_property_readonly(
          "used", [](const ConstrainedIkStep& s) { return std::string(to_string(s.used)); },
          "'analytic' or 'optimised'")
      .def("__repr__", [](const ConstrainedIkStep& s) {
        return std::string("ConstrainedIkStep(status=") + to_string(s.status) + ", used=" + to_string(s.used) +
               ", qdot=" + py::str(to_numpy(s.qdot)).cast<std::string>() + ")";
      });
  def_value(bound<ConstrainedIkStep>(m, "ConstrainedIkStep"));
}

void bind_setup(py::class_<ConstrainedIk>& c) {
  def_init<ConstrainedIkOptions>(c, std::tuple{parameter<Chain>("chain")}, 1,
                                 "Warns (ModelWarning) of velocity and acceleration limits that joints lack.",
                                 [](const Chain& chain, const ConstrainedIkOptions& options) {
                                   ConstrainedIk ik(chain, options);
                                   warn(missing_limits(chain, options.limits));
                                   return ik;
                                 });
  def_options(c);
  c.def(
      "reset",
      [](ConstrainedIk& ik, const ArrayLike& q, const MaybeArray& qdot) {
        const int n = ik.chain().dof();
        const JointVector start = joint_argument(q, "q", n);
        ik.reset(start, optional_joint_argument(object_of(qdot), "qdot", n));
        if (ik.options().limits.position) warn(ik.chain().far_outside_limits(start));
      },
      py::arg("q"), py::arg("qdot") = py::none(),
      "Starts, or starts again, at q (n,), moving with qdot (n,).\n\n"
      "Warns (ModelWarning) of a joint that starts more than 1 rad or 1 m outside its limits.");
}

void bind_cycle(py::class_<ConstrainedIk>& c) {
  c.def("update", &update, py::arg("target"),
        "One cycle towards a pose (4, 4) of the tip in the base. Raises Error where the target is no pose.")
      .def("step", &update, py::arg("target"), "The same as update().");
}

void bind_state(py::class_<ConstrainedIk>& c) {
  c.def_property_readonly("chain", &ConstrainedIk::chain)
      .def_property_readonly(
          "dt", [](const ConstrainedIk& ik) { return ik.options().dt; }, "[s]")
      .def_property_readonly("settling_time", &ConstrainedIk::settling_time,
                             "[s], after which a motion towards a target that rests is faded out.")
      .def_property_readonly("has_analytic", &ConstrainedIk::has_analytic, "Whether the closed form is at hand.")
      .def_property_readonly("q", once_started([](const ConstrainedIk& ik) { return ik.q(); }),
                             "(n,) where the reference stands.")
      .def_property_readonly("pose", once_started([](const ConstrainedIk& ik) { return ik.tip().matrix(); }),
                             "(4, 4) tip in base at q.")
      .def_property_readonly("reference", once_started([](const ConstrainedIk& ik) { return ik.reference().matrix(); }),
                             "(4, 4) the pose that the last step aimed at: its target, slowed down by ϑ.")
      .def("__repr__", [](const ConstrainedIk& ik) {
        return record("ConstrainedIk", {{"", py::cast(ik.chain())},
                                        {"dt", py::cast(ik.options().dt)},
                                        {"has_analytic", py::cast(ik.has_analytic())},
                                        {"q", ik.q().size() != 0 ? py::object(to_numpy(ik.q())) : py::none()}});
      });
}

void bind_value(py::class_<ConstrainedIk>& c) {
  def_state(
      c, 2, [](const ConstrainedIk& ik) { return py::make_tuple(ik.chain(), to_dict(ik.options())); },
      [](const py::tuple& s) {
        return ConstrainedIk(s[0].cast<const Chain&>(), from_dict<ConstrainedIkOptions>(s[1].cast<py::dict>()));
      },
      [](const ConstrainedIk& a, const ConstrainedIk& b) {
        return same(a.chain(), b.chain()) && equal(a.options(), b.options());
      });
}

}  // namespace

void bind_constrained_ik(py::module_& m) {
  bind_step(m);
  py::class_<ConstrainedIk> c(
      m, "ConstrainedIk",
      "Follows a target pose inside every joint limit: an exact part, and the rest as well as the\n"
      "limits allow (Schreiber, Otter and Hirzinger 1999).");
  bind_setup(c);
  bind_cycle(c);
  bind_state(c);
  bind_value(c);
}

}  // namespace sigmaik::bindings
