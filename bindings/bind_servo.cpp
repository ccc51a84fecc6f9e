#include <pybind11/native_enum.h>
#include <cmath>

#include "servo_options.hpp"
#include "values.hpp"

namespace sigmaik::bindings {
namespace {

// Python gets an exception where C++ gets a status; the servo keeps its state and holds.
void require_started(const Servo& servo) {
  if (servo.q().size() == 0) throw Error("the servo has no start: call reset(q) first");
}

ServoStep checked(const ServoStep& step) {
  if (step.status == Status::BadInput) throw Error("the command is too large for floating-point numbers");
  return step;
}

// The time of a cycle. A time outside the range is an error before the servo does anything.
std::optional<double> cycle_argument(const Servo& servo, const std::optional<double>& dt) {
  const double nominal = servo.options().dt;
  constexpr double kRounding = 1e-9;
  if (!dt || *dt == nominal) return dt;
  if (servo.options().collisions && !(std::abs(*dt - nominal) <= kRounding * nominal)) {
    throw Error("dt = " + text_of(*dt) + " s: a servo with collisions has cycles of its dt, " + text_of(nominal) +
                " s");
  }
  if (*dt >= kShortestCycle * nominal * (1.0 - kRounding) && *dt <= kLongestCycle * nominal * (1.0 + kRounding))
    return dt;
  throw Error("dt = " + text_of(*dt) + " s must be from " + text_of(kShortestCycle * nominal) + " to " +
              text_of(kLongestCycle * nominal) + " s, a tenth to 20 times the servo's dt");
}

// This getter throws until the first reset: nothing stands anywhere before.
template <typename Get>
auto once_started(Get get) {
  return [get](const Servo& servo) {
    require_started(servo);
    return to_numpy(get(servo));
  };
}

void bind_guide_state(py::module_& m) {
  py::native_enum<GuideState>(m, "GuideState", "enum.IntEnum",
                              "What the guide of a Servo does for the pose target at hand (guided=True).")
      .value("OFF", GuideState::Off, "there is no guide, or no pose target")
      .value("DIRECT", GuideState::Direct, "the servo goes its own way")
      .value("SEARCHING", GuideState::Searching,
             "the servo's own way does not arrive, and the guide looks for another; the servo goes on meanwhile")
      .value("POSTURE", GuideState::Posture,
             "the tool goes its own way, and the arm's self-motion leads to another configuration")
      .value("CHANGING_BRANCH", GuideState::ChangingBranch,
             "the joints go straight to a configuration that has the tool at the target: the tool leaves its way")
      .value("UNREACHABLE", GuideState::Unreachable,
             "no configuration was found; the servo goes as near as its own way leads")
      .finalize();
}

void bind_step(py::module_& m) {
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
      .def_readonly("scale", &ServoStep::scale,
                    "In [0, 1], what limits left: of the rule's speed ('scale'), or of its twist along itself "
                    "('redistribute').")
      .def_property_readonly(
          "limiting_joints", [](const ServoStep& s) { return indices(s.limiting_joints); },
          "Indices of the joints held at a limit that the rule's answer would break.")
      .def_readonly("tool_speed_limits", &ServoStep::tool_speed_limits, "max_tool_speed has slowed the motion down.")
      .def_readonly("tool_speed", &ServoStep::tool_speed,
                    "[m/s] of the fastest checked point over the cycle; 0 without a max_tool_speed.")
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
      .def_property_readonly(
          "singular_directions", [](const ServoStep& s) { return to_numpy(s.singular_directions); },
          "(6, k) a column for each direction that is singular to the rule, in the order of `singular`.\n\n"
          "The twist [v; ω], base axes, at the tip's origin, that has u_i in the rows of the task and zero in the "
          "rows\n"
          "that the mask leaves out: |v|² + (length_scale |ω|)² = 1. The sign means nothing. None while holding.")
      .def_readonly("not_settling", &ServoStep::not_settling,
                    "The target has rested for longer than any motion takes (Servo.settling_time), and the arm still "
                    "moves.")
      .def_readonly("guide", &ServoStep::guide, "What the guide does, see GuideState.")
      .def_property_readonly(
          "guide_joints", [](const ServoStep& s) { return indices(s.guide_joints); },
          "Indices of the joints that end elsewhere by the guide's way than by the servo's own: by more than 0.5 "
          "rad, "
          "or half of the characteristic length.")
      .def_readonly("clearance", &ServoStep::clearance,
                    "[m] the least distance of all pairs of bodies after the step; inf where nothing is checked.")
      .def_property_readonly(
          "nearest",
          [](const ServoStep& s) -> std::optional<std::pair<int, int>> {
            if (s.nearest[0] < 0) return std::nullopt;
            return std::pair<int, int>(s.nearest[0], s.nearest[1]);
          },
          "The pair of this distance, by the numbers of Collisions.body_names; None: there is no pair.")
      .def_readonly("limited_by_collisions", &ServoStep::limited_by_collisions,
                    "Whether the step keeps clear of a body that the rule's answer would come too near to.")
      .def("__repr__", [](const ServoStep& s) {
        return std::string("ServoStep(status=") + to_string(s.status) +
               ", qdot=" + py::str(to_numpy(s.qdot)).cast<std::string>() + ")";
      });
  def_value(bound<ServoStep>(m, "ServoStep"));
}

void bind_setup(py::class_<Servo>& c) {
  def_init<ServoOptions>(
      c,
      std::tuple{parameter<Chain>("chain"),
                 parameter<std::optional<Method>>("method", "None: JParse(), the best that there is.")},
      1, "Warns (ModelWarning) of velocity and acceleration limits that joints lack.",
      [](const Chain& chain, const std::optional<Method>& method, const ServoOptions& options) {
        Servo servo(chain, method.value_or(JParse{}), options);
        warn(missing_limits(chain, options.limits));
        return servo;
      });
  def_options(c);
  c.def(
      "reset",
      [](Servo& s, const ArrayLike& q, const MaybeArray& qdot, const MaybeArray& qddot) {
        const int n = s.chain().dof();
        const JointVector start = joint_argument(q, "q", n);
        s.reset(start, optional_joint_argument(object_of(qdot), "qdot", n),
                optional_joint_argument(object_of(qddot), "qddot", n));
        if (s.options().limits.position) warn(s.chain().far_outside_limits(start));
      },
      py::arg("q"), py::arg("qdot") = py::none(), py::arg("qddot") = py::none(),
      "Starts, or starts again, at q (n,): forgets all history, and pins the posture there unless one was "
      "given.\n\n"
      "qdot: (n,) how the arm moves now, from which the command is faded; None: it stands.\n"
      "qddot: (n,) its acceleration, which matters to jerk limits. None: joints whose q and qdot are those of the "
      "last\n"
      "    step keep the acceleration that the servo knows; of other joints none is assumed.\n"
      "To tell a running servo where the arm is, call `measure`.\n"
      "Warns (ModelWarning) of a joint that starts more than 1 rad or 1 m outside its limits.");
}

void bind_measurement(py::class_<Servo>& c) {
  c.def(
       "measure",
       [](Servo& s, const ArrayLike& q, const MaybeArray& qdot) {
         require_started(s);
         const int n = s.chain().dof();
         s.measure(joint_argument(q, "q", n), optional_joint_argument(object_of(qdot), "qdot", n));
       },
       py::arg("q"), py::arg("qdot") = py::none(),
       "Tells the servo where the arm is, before `update`: in each cycle, or as often as the arm is measured.\n\n"
       "The pose error of `update` is then that of the arm and not that of the reference, through a low-pass filter "
       "of\n"
       "0.1 s: the tool arrives although the joints' controllers leave an error, and little of the noise enters the "
       "command.\n"
       "The command stays continuous and inside all limits, which hold for the reference.\n\n"
       "q: (n,) measured positions [rad or m].\n"
       "qdot: (n,) measured velocities, with which the filter does not lag; None: unknown.")
      .def_property_readonly(
          "following_error", [](const Servo& s) { return to_numpy(s.following_error()); },
          "(n,) measured minus commanded position [rad or m], filtered; zero before `measure`.");
}

void bind_cycle(py::class_<Servo>& c) {
  c.def(
       "update",
       [](Servo& s, const py::object& target, const MaybeArray& feedforward, std::optional<double> dt) {
         require_started(s);
         const std::optional<double> time = cycle_argument(s, dt);
         const Pose pose = s.options().strict ? pose_argument(target, "target") : target_argument(target, "target");
         const Twist twist = feedforward ? twist_argument(*feedforward, "feedforward") : Twist(Twist::Zero());
         const ServoStep step = s.update(pose, twist, time);
         const bool no_pose = step.status == Status::BadInput && !is_pose(pose.matrix());
         return no_pose ? step : checked(step);
       },
       py::arg("target"), py::arg("feedforward") = py::none(), py::arg("dt") = py::none(),
       "One cycle towards a pose (4, 4) of the tip in the base.\n\n"
       "feedforward: (6,) twist [v; ω] of a target that moves, base axes, at its origin, added to gain × error. "
       "Behind\n"
       "    a target of constant twist the tip lags by speed/gain without it, and not at all with it.\n"
       "dt: [s] the time since the last call on the robot's clock, from a tenth to 20 times the servo's dt; None: the\n"
       "    servo's dt. After a lost packet, or in a loop that is not even, the limits then hold against the clock: "
       "the\n"
       "    position command advances by q̇ dt, and q̇ changes by no more than the acceleration limit times dt.\n"
       "Raises Error, and holds, where dt is outside its range.\n"
       "A matrix that is no pose (a rotation off by more than rounding, another last row) stops the arm: BAD_INPUT. "
       "With\n"
       "    strict=True of the servo it raises Error, as arguments of a wrong shape or with NaN do in any case.")
      .def(
          "update_twist",
          [](Servo& s, const ArrayLike& twist, const Text& frame, const MaybeArray& point, std::optional<double> dt) {
            require_started(s);
            const std::optional<double> time = cycle_argument(s, dt);
            const Twist asked = twist_argument(twist, "twist");
            if (frame.value == "base" && !point) return checked(s.update_twist(asked, time));
            const Frame axes = task_argument(py::none(), frame).frame;
            const Eigen::Vector3d at = point                 ? vector_argument(*point, "point")
                                       : axes == Frame::Tool ? Eigen::Vector3d(Eigen::Vector3d::Zero())
                                                             : Eigen::Vector3d(s.tip().translation());
            return checked(s.update_twist(asked, axes, at, time));
          },
          py::arg("twist"), py::arg("frame") = "base", py::arg("point") = py::none(), py::arg("dt") = py::none(),
          "One cycle along a twist (6,) [v; ω].\n\n"
          "frame: the axes of twist and point, 'base' or 'tool'; jog devices send 'tool'.\n"
          "point: (3,) [m] that moves at v: in base, or with frame='tool' from the tip's origin. None: the tip's "
          "origin.\n"
          "dt: [s] the time since the last call, as for `update`.")
      .def_property_readonly("rough_targets", &Servo::rough_targets,
                             "Targets of update() whose rotation was off by more than rounding (up to 9e-4 in RᵀR), "
                             "and was made one.")
      .def(
          "set_tool",
          [](Servo& s, const py::object& tool) {
            if (!s.set_tool(pose_argument(tool, "tool"))) throw Error("the tool is not a pose");
          },
          py::arg("tool"),
          "Puts a tool on the tip from the next cycle on: targets, twists and poses are then those of its frame.\n\n"
          "tool: (4, 4) in the chain's tip; the identity takes the tool off. q̇ does not jump: the command is faded in\n"
          "from the last velocity over soft_start, inside all limits. For Dynamics use chain.with_tool(pose, inertia).")
      .def_property_readonly(
          "tool", [](const Servo& s) { return to_numpy(s.tool().matrix()); },
          "(4, 4) of set_tool(), in the chain's tip.")
      .def(
          "hold", [](Servo& s, std::optional<double> dt) { return s.hold(cycle_argument(s, dt)); },
          py::arg("dt") = py::none(),
          "One cycle of the fastest stop that the limits allow, or of rest: HOLDING.\n\n"
          "dt: [s] the time since the last call, as for `update`.")
      .def("continue_from", &Servo::continue_from, py::arg("other"),
           "Takes over from another servo of the same arm and dt, in the midst of its motion.\n\n"
           "Rule and options are this one's; what it commands is faded in from the other's last velocity over "
           "soft_start.");
}

void bind_state(py::class_<Servo>& c) {
  c.def_property("method", &Servo::method, &Servo::set_method, "The rule; may be changed between cycles.")
      .def_property_readonly("chain", &Servo::chain)
      .def_property_readonly(
          "collisions", [](const Servo& s) { return s.options().collisions; }, "What the arm must not touch, or None.")
      .def_property_readonly(
          "dt", [](const Servo& s) { return s.options().dt; }, "[s]")
      .def_property_readonly("length_scale", &Servo::length_scale, "[m] 1 rad weighs as much as this length.")
      .def_property_readonly("settling_time", &Servo::settling_time,
                             "[s], after which a motion towards a target that rests is called not settling.")
      .def_property_readonly("q", once_started([](const Servo& s) { return s.q(); }),
                             "(n,) where the reference stands.")
      .def_property_readonly("pose", once_started([](const Servo& s) { return s.tip().matrix(); }),
                             "(4, 4) tip in base at q.")
      .def("__repr__", [](const Servo& s) {
        return record("Servo", {{"", py::cast(s.chain())},
                                {"", method_to_python(s.method())},
                                {"dt", py::cast(s.options().dt)},
                                {"q", s.q().size() != 0 ? py::object(to_numpy(s.q())) : py::none()}});
      });
}

void bind_value(py::class_<Servo>& c) {
  def_state(
      c, 3,
      [](const Servo& s) { return py::make_tuple(s.chain(), method_to_python(s.method()), to_dict(s.options())); },
      [](const py::tuple& s) {
        return Servo(s[0].cast<const Chain&>(), s[1].cast<Method>(), from_dict<ServoOptions>(s[2].cast<py::dict>()));
      },
      [](const Servo& a, const Servo& b) {
        return same(a.chain(), b.chain()) && equal(a.method(), b.method()) && equal(a.options(), b.options());
      });
}

}  // namespace

void bind_servo(py::module_& m) {
  bind_guide_state(m);
  bind_step(m);
  py::class_<Servo> c(
      m, "Servo",
      "Drives a chain's reference configuration towards poses, or along twists, one cycle a call.\n\n"
      "It integrates its own command (q ← q + q̇ dt) and needs no measured positions (`measure`). Every command holds\n"
      "the chain's limits and leaves room to go on holding them; a start outside them comes back.");
  bind_setup(c);
  bind_measurement(c);
  bind_cycle(c);
  bind_state(c);
  bind_value(c);
}

}  // namespace sigmaik::bindings
