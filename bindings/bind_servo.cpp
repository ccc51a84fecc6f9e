#include "arguments.hpp"

namespace sigmaik::bindings {
namespace {

OnLimit on_limit_argument(const std::string& text) {
  if (text == "redistribute") return OnLimit::Redistribute;
  if (text == "scale") return OnLimit::Scale;
  throw Error("on_limit = '" + text + "' must be 'redistribute' or 'scale'");
}

Avoid avoid_argument(const std::optional<std::string>& text) {
  if (!text) return Avoid::None;
  if (*text == "manipulability") return Avoid::Manipulability;
  if (*text == "potential") return Avoid::Potential;
  throw Error("avoid = '" + *text + "' must be None, 'manipulability' or 'potential'");
}

// Python gets an exception where C++ gets a status; the servo keeps its state and holds.
void require_started(const Servo& servo) {
  if (servo.q().size() == 0) throw Error("the servo has no start: call reset(q) first");
}

ServoStep checked(const ServoStep& step) {
  if (step.status == Status::BadInput) throw Error("the command is too large for floating-point numbers");
  return step;
}

}  // namespace

void bind_servo(py::module_& m) {
  py::class_<ServoStep>(m, "ServoStep", "Answer of one cycle of a Servo.")
      .def_property_readonly(
          "q", [](const ServoStep& s) { return to_numpy(s.q); }, "(n,) position command [rad or m]")
      .def_property_readonly(
          "qdot", [](const ServoStep& s) { return to_numpy(s.qdot); },
          "(n,) velocity command over the last dt [rad/s or m/s]")
      .def_readonly("status", &ServoStep::status, "What the cycle did, see Status.")
      .def_property_readonly(
          "pose_error", [](const ServoStep& s) { return to_numpy(s.pose_error); },
          "(6,) [m, rad] target minus tip before the step, unshortened; zero for twist commands")
      .def_property_readonly(
          "asked_twist", [](const ServoStep& s) { return to_numpy(s.asked_twist); },
          "(6,) what the rule was given: the twist command, or the pose error's [m/s, rad/s]")
      .def_property_readonly(
          "achieved_twist", [](const ServoStep& s) { return to_numpy(s.achieved_twist); }, "(6,) J q̇ [m/s, rad/s]")
      .def_readonly(
          "scale", &ServoStep::scale,
          "In [0, 1], what limits left: of the rule's speed ('scale'), or of its twist along itself ('redistribute').")
      .def_property_readonly(
          "limiting_joints", [](const ServoStep& s) { return indices(s.limiting_joints); },
          "Indices of the joints held at a limit that the rule's answer would break.")
      .def_property_readonly(
          "singular_values", [](const ServoStep& s) { return to_numpy(s.singular_values); },
          "Singular values of the weighted task Jacobian, from large to small.")
      .def_property_readonly(
          "singular",
          [](const ServoStep& s) {
            py::array_t<bool> out(s.task_rows);
            for (py::ssize_t i = 0; i < out.size(); ++i) out.mutable_data()[i] = (s.singular >> i & 1u) != 0;
            return out;
          },
          "(m',) truth values, one a row of the task: the rule does not treat direction i as regular.")
      .def("__repr__", [](const ServoStep& s) {
        return std::string("ServoStep(status=") + to_string(s.status) +
               ", qdot=" + py::str(to_numpy(s.qdot)).cast<std::string>() + ")";
      });

  py::class_<Servo>(
      m, "Servo",
      "Drives a chain's reference configuration towards poses, or along twists, one cycle a call.\n\n"
      "It integrates its own command (q ← q + q̇ dt) and reads no measured positions. Every command holds\n"
      "the chain's limits and leaves room to go on holding them; a start outside them comes back.")
      .def(
          py::init([](const Chain& chain, const Method& method, double dt, double gain_linear, double gain_angular,
                      double max_linear_error, double max_angular_error, double soft_start, const MaybeArray& posture,
                      double posture_gain, double posture_max_speed, const std::optional<std::string>& avoid,
                      double avoid_gain, double avoid_max_speed, double eta1, double eta2, bool position_limits,
                      bool velocity_limits, bool acceleration_limits, bool jerk_limits, double recovery_speed,
                      const std::string& on_limit, const MaybeArray& exact, double length_scale, const MaybeArray& mask,
                      const std::string& frame) {
            ServoOptions options;
            options.dt = dt;
            options.gain_linear = gain_linear;
            options.gain_angular = gain_angular;
            options.max_linear_error = max_linear_error;
            options.max_angular_error = max_angular_error;
            options.soft_start = soft_start;
            options.posture = optional_joint_argument(object_of(posture), "posture", chain.dof());
            options.posture_gain = posture_gain;
            options.posture_max_speed = posture_max_speed;
            options.avoid.what = avoid_argument(avoid);
            options.avoid.gain = avoid_gain;
            options.avoid.max_speed = avoid_max_speed;
            options.avoid.potential.eta1 = eta1;
            options.avoid.potential.eta2 = eta2;
            options.position_limits = position_limits;
            options.velocity_limits = velocity_limits;
            options.acceleration_limits = acceleration_limits;
            options.jerk_limits = jerk_limits;
            options.recovery_speed = recovery_speed;
            if (exact) options.exact = rows_argument(*exact, "exact");
            options.on_limit = on_limit_argument(on_limit);
            options.length_scale = length_scale;
            options.task = task_argument(object_of(mask), frame);
            return Servo(chain, method, options);
          }),
          py::arg("chain"), py::arg("method"), py::arg("dt") = 1e-3, py::kw_only(),
          py::arg("gain_linear") = ServoOptions{}.gain_linear, py::arg("gain_angular") = ServoOptions{}.gain_angular,
          py::arg("max_linear_error") = ServoOptions{}.max_linear_error,
          py::arg("max_angular_error") = ServoOptions{}.max_angular_error,
          py::arg("soft_start") = ServoOptions{}.soft_start, py::arg("posture") = py::none(),
          py::arg("posture_gain") = ServoOptions{}.posture_gain,
          py::arg("posture_max_speed") = ServoOptions{}.posture_max_speed, py::arg("avoid") = py::none(),
          py::arg("avoid_gain") = AvoidanceOptions{}.gain, py::arg("avoid_max_speed") = AvoidanceOptions{}.max_speed,
          py::arg("eta1") = AvoidanceOptions{}.potential.eta1, py::arg("eta2") = AvoidanceOptions{}.potential.eta2,
          py::arg("position_limits") = true, py::arg("velocity_limits") = true, py::arg("acceleration_limits") = true,
          py::arg("jerk_limits") = true, py::arg("recovery_speed") = ServoOptions{}.recovery_speed,
          py::arg("on_limit") = "redistribute", py::arg("exact") = py::none(), py::arg("length_scale") = 1.0,
          py::arg("mask") = py::none(), py::arg("frame") = "base",
          "dt: [s] from one update to the next.\n"
          "gain_linear, gain_angular: [1/s] from pose error to twist.\n"
          "max_linear_error [m], max_angular_error [rad]: longer errors are shortened to it.\n"
          "soft_start: [s] over which a pose target's command is faded in after reset(); twists only where reset()\n"
          "    was told that the arm moves.\n"
          "posture: (n,) nominal positions, by default those given to reset(); posture_gain [1/s];\n"
          "posture_max_speed [rad/s or m/s] caps each joint.\n"
          "avoid: adds avoid_gain times the gradient of the manipulability ('manipulability'), or minus that of the\n"
          "    potentials Σ exp(eta1 − eta2 ψ_i) around the known singular sets ('potential'), to the posture's "
          "velocity,\n"
          "    shortened to avoid_max_speed of the fastest joint: a redundant arm keeps away from singularities.\n"
          "position_limits, …: which of the chain's limits are held, now and so that they can be held for ever.\n"
          "recovery_speed: in (0, 1], of the velocity limit, least speed of a joint that starts outside its position\n"
          "    limits on its way back.\n"
          "on_limit: what gives way. 'redistribute': other joints take over, for the nearest twist that limits allow;\n"
          "    'scale': direction kept, speed given up.\n"
          "exact: (6,) truth values: rows (vx, vy, vz, ωx, ωy, ωz) that come before the others when redistributing.\n"
          "length_scale, mask, frame: as for VelocitySolver.")
      .def(
          "reset",
          [](Servo& s, const ArrayLike& q, const MaybeArray& qdot) {
            s.reset(joint_argument(q, "q", s.chain().dof()),
                    optional_joint_argument(object_of(qdot), "qdot", s.chain().dof()));
          },
          py::arg("q"), py::arg("qdot") = py::none(),
          "Starts, or starts again, at q (n,): forgets all history, and pins the posture there unless one was "
          "given.\n\n"
          "qdot: (n,) how the arm moves now, from which the command is faded; None: it stands.")
      .def(
          "update",
          [](Servo& s, const py::object& target, const MaybeArray& feedforward) {
            require_started(s);
            const Pose pose = pose_argument(target, "target");
            const Twist twist = feedforward ? twist_argument(*feedforward, "feedforward") : Twist(Twist::Zero());
            return checked(s.update(pose, twist));
          },
          py::arg("target"), py::arg("feedforward") = py::none(),
          "One cycle towards a pose (4, 4) of the tip in the base.\n\n"
          "feedforward: (6,) twist [v; ω] of a target that moves, base axes, at its origin, added to gain × error. "
          "Behind\n"
          "    a target of constant twist the tip lags by speed/gain without it, and not at all with it.\n"
          "Raises Error, and holds, where the target is not a pose.")
      .def(
          "update_twist",
          [](Servo& s, const ArrayLike& twist) {
            require_started(s);
            return checked(s.update_twist(twist_argument(twist, "twist")));
          },
          py::arg("twist"), "One cycle along a twist (6,) [v; ω], base axes, at the tip's origin.")
      .def("hold", &Servo::hold, "One cycle of the fastest stop that the limits allow, or of rest: HOLDING.")
      .def("continue_from", &Servo::continue_from, py::arg("other"),
           "Takes over from another servo of the same arm and dt, in the midst of its motion.\n\n"
           "Rule and options are this one's; what it commands is faded in from the other's last velocity over "
           "soft_start.")
      .def_property("method", &Servo::method, &Servo::set_method, "The rule; may be changed between cycles.")
      .def_property_readonly("chain", &Servo::chain)
      .def_property_readonly(
          "dt", [](const Servo& s) { return s.options().dt; }, "[s]")
      .def_property_readonly(
          "q",
          [](const Servo& s) {
            require_started(s);
            return to_numpy(s.q());
          },
          "(n,) where the reference stands.")
      .def_property_readonly(
          "pose",
          [](const Servo& s) {
            require_started(s);
            return to_numpy(s.tip().matrix());
          },
          "(4, 4) tip in base at q.");
}

}  // namespace sigmaik::bindings
