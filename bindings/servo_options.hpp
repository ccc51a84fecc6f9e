#pragma once
// The options of a Servo, and those parts of them that a ConstrainedIk has too. fields.hpp says how a table works.

#include "fields.hpp"

namespace sigmaik::bindings {

// What set-up warns of. Who gives an assumed acceleration needs no warning of the default's.
inline std::vector<std::string> missing_limits(const Chain& chain, const LimitOptions& options) {
  const bool assumes = options.assumed_acceleration == LimitOptions{}.assumed_acceleration;
  return chain.missing_limits(options.velocity, options.acceleration && assumes);
}

template <>
struct Fields<LimitOptions> {
  static constexpr std::tuple all{
      field("position_limits", &LimitOptions::position,
            "whether the chain's position limits are held, now and so that they can be held for ever."),
      field("velocity_limits", &LimitOptions::velocity, "the same for its velocity limits."),
      field("acceleration_limits", &LimitOptions::acceleration, "the same for its acceleration limits."),
      field("jerk_limits", &LimitOptions::jerk, "the same for its jerk limits."),
      field("assumed_acceleration", &LimitOptions::assumed_acceleration,
            "[rad/s² or m/s²] > 0, the acceleration limit of joints whose model has none; inf: they have none."),
      field("recovery_speed", &LimitOptions::recovery_speed,
            "in (0, 1], of the velocity limit: the least speed at which a joint that starts outside its position "
            "limits comes back."),
  };
};

/// Points, a row each; as the columns of the struct.
template <>
struct Argument<ToolPoints> {
  static constexpr bool kNone = true;
  static std::string type() { return "numpy.typing.ArrayLike | None"; }
  static std::string text(const ToolPoints&) { return "None"; }
  static ToolPoints from(py::handle object, const char* what) {
    const auto rows = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(object);
    if (!rows) PyErr_Clear();
    constexpr py::ssize_t kMost = ToolPoints::MaxColsAtCompileTime;
    if (!rows || rows.ndim() != 2 || rows.shape(1) != 3 || rows.shape(0) > kMost) {
      refuse(what, "an array (k, 3) of at most " + std::to_string(kMost) + " points", object);
    }
    ToolPoints points(3, rows.shape(0));
    std::copy(rows.data(), rows.data() + rows.size(), points.data());
    return points;
  }
  static py::object to(const ToolPoints& value) {
    py::array_t<double> out({value.cols(), Eigen::Index{3}});
    std::copy(value.data(), value.data() + value.size(), out.mutable_data());
    return value.size() == 0 ? py::none() : py::object(out);
  }
};

template <>
struct Words<Frame> {
  static constexpr std::array all{Word<Frame>{"base", Frame::Base}, Word<Frame>{"tool", Frame::Tool}};
};

template <>
struct Fields<Task> {
  static constexpr std::tuple all{
      field("mask", &Task::mask, "(6,) truth values: the rows (vx, vy, vz, ωx, ωy, ωz) that matter; None: all."),
      field("frame", &Task::frame, "the axes of these rows, the base's or the tool's."),
  };
};

template <>
struct Words<OnLimit> {
  static constexpr std::array all{Word<OnLimit>{"redistribute", OnLimit::Redistribute},
                                  Word<OnLimit>{"scale", OnLimit::Scale}};
};

template <>
struct Words<Avoid> {
  static constexpr std::array all{Word<Avoid>{nullptr, Avoid::None},
                                  Word<Avoid>{"manipulability", Avoid::Manipulability},
                                  Word<Avoid>{"potential", Avoid::Potential}};
};

template <>
struct Fields<AvoidanceOptions> {
  static constexpr std::tuple all{
      field(
          "avoid", &AvoidanceOptions::what,
          "what keeps a redundant arm away from singularities: the gradient of the manipulability, or minus that of "
          "the potentials Σ exp(eta1 − eta2 ψ_i) around the known singular sets, is added to the posture's velocity."),
      field("avoid_gain", &AvoidanceOptions::gain, "≥ 0, by which that gradient is multiplied."),
      field("avoid_max_speed", &AvoidanceOptions::max_speed,
            "[rad/s or m/s] > 0, of the fastest joint: longer velocities are shortened to it."),
      field(
          "eta1", [](auto& o) -> auto& { return o.potential.eta1; }, "of the potentials, at most 100."),
      field(
          "eta2", [](auto& o) -> auto& { return o.potential.eta2; }, "of the potentials, > 0."),
  };
};

template <>
struct Fields<ServoOptions> {
  static constexpr std::tuple all{
      field("dt", &ServoOptions::dt, "[s] > 0, from one update to the next."),
      field("gain_linear", &ServoOptions::gain_linear,
            "[1/s] ≥ 0, from position error to velocity. (JParse's gain_linear is another thing: the paper's K.)"),
      field("gain_angular", &ServoOptions::gain_angular, "[1/s] ≥ 0, from orientation error to angular velocity."),
      field("max_linear_error", &ServoOptions::max_linear_error,
            "[m] > 0: longer position errors are shortened to it. None: half of length_scale."),
      field("max_angular_error", &ServoOptions::max_angular_error,
            "[rad] > 0: longer orientation errors are shortened to it."),
      field("soft_start", &ServoOptions::soft_start,
            "[s] ≥ 0 over which a pose target's command is faded in after reset(); twists only where reset() was told "
            "that the arm moves."),
      field("posture", &ServoOptions::posture, "(n,) nominal positions [rad or m]; None: those given to reset()."),
      field("posture_gain", &ServoOptions::posture_gain, "[1/s] ≥ 0, from the way to the posture to joint velocity."),
      field("posture_max_speed", &ServoOptions::posture_max_speed, "[rad/s or m/s] > 0, cap on each joint's."),
      nested(&ServoOptions::avoid),
      nested(&ServoOptions::limits),
      field(
          "on_limit", &ServoOptions::on_limit,
          "what gives way at a position limit. 'redistribute': other joints take over, for the nearest twist that "
          "limits allow; 'scale': the direction is kept, speed is given up. At a velocity limit the direction is kept; "
          "'redistribute' first uses the motion that does not move the tool."),
      field("exact", &ServoOptions::exact,
            "(6,) truth values: the rows (vx, vy, vz, ωx, ωy, ωz) that come before the others in every cycle."),
      field("max_tool_speed", &ServoOptions::max_tool_speed,
            "[m/s] > 0: no checked point of the arm (the tip's origin, the origin of each movable joint's link, "
            "speed_points) moves faster in any cycle; the motion slows down along its direction. 0.25 is the reduced "
            "speed of ISO 10218-1. inf: no such limit."),
      field("speed_points", &ServoOptions::speed_points,
            "(k, 3) [m] further points that max_tool_speed checks, in the tip's frame, k ≤ 8; None: none."),
      field("length_scale", &ServoOptions::length_scale,
            "[m] > 0: 1 rad/s weighs as much as length_scale m/s, as for VelocitySolver. None: "
            "chain.characteristic_length."),
      field(
          "joint_weights", &ServoOptions::joint_weights,
          "(n,) > 0, how much each joint's motion counts where there are more joints than rows: a rail with 1e4 moves "
          "only where the other joints cannot do the motion. Only ratios matter. None: all 1."),
      field("guided", &ServoOptions::guided,
            "whether the servo takes another way to a pose target that rests where its own way does not arrive: "
            "through another configuration of the arm, if need be away from the tool's straight line. `step.guide` "
            "says so. Arrives at each target that PositionIk finds."),
      field("collisions", &ServoOptions::collisions,
            "what the arm must not touch: no command brings a pair of bodies nearer than the margin. None: nothing is "
            "checked."),
      field("strict", &ServoOptions::strict,
            "whether `update` raises Error for a target that is no pose, in place of BAD_INPUT and a stop."),
      nested(&ServoOptions::task),
  };
};

}  // namespace sigmaik::bindings
