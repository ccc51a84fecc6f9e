#pragma once
// The options of the planners. `make stubs` writes python/sigmaik/planning/_options.py from these tables; fields.hpp
// says how a table works.

#include <sigmaik/planning/cart.hpp>
#include <sigmaik/planning/cart_plane.hpp>
#include <sigmaik/planning/support_states.hpp>
#include <sigmaik/planning/time_optimal.hpp>

#include "fields.hpp"

namespace sigmaik::bindings {

template <>
struct Fields<planning::TimeOptimalOptions> {
  using Options = planning::TimeOptimalOptions;
  static constexpr std::tuple all{
      field("nodes", &Options::nodes, "N, 5 to 10 000."),
      field("time_weight", &Options::time_weight, "[1/s] > 0."),
      field("effort_weight", &Options::effort_weight,
            "[s⁴/rad²] ≥ 0, and > 0 where a joint has no acceleration limit."),
      field("tolerance", &Options::tolerance,
            "in [1e-12, 1e-2], what is left to gain, as a part of the objective between the ends."),
      field("max_iterations", &Options::max_iterations, "≥ 1, Newton steps of a start."),
      field("between_nodes", &Options::between_nodes,
            "whether the motion keeps the position limits between the nodes too, where a parabola can overshoot. "
            "False: at the nodes alone, as in the paper."),
      field("restarts", &Options::restarts,
            "whether the planner also searches on the other sides, where the motion found still leads through what the "
            "cost marks."),
      field("clearance_width", &Options::clearance_width,
            "[1/rad²] > 0: sets of codimension above 1 count as crossed where ψ < 1/(2 clearance_width). Where a call "
            "has eta2, its default is eta2."),
      field("whole_turns", &Options::whole_turns,
            "whether goals count whole turns. False: continuous joints take the shorter way, of at most half a turn."),
  };
};

template <>
struct Fields<planning::GradientOptions> {
  using Options = planning::GradientOptions;
  static constexpr std::tuple all{
      field("states", &Options::states, "N + 1, 3 to 1000 support states, ends included."),
      field("prior_weight", &Options::prior_weight, "> 0, of ‖q − μ‖² against the cost."),
      field("max_iterations", &Options::max_iterations, "≥ 1."),
      field("tolerance", &Options::tolerance,
            "≥ 0: the search stops where an iteration gains less than this part of the objective."),
      field("restarts", &Options::restarts,
            "≥ 0. Where the motion found from the straight line touches an obstacle, so many other motions are found "
            "from first guesses drawn from the prior, the same each time, with a standard deviation of 0.5 rad or m "
            "half-way. The motion of least cost that touches no obstacle is the answer."),
      field("duration", &Options::duration,
            "[s] > 0. None: the shortest that keeps the limits of velocity and acceleration, 1 s where there are "
            "none."),
      field("whole_turns", &Options::whole_turns,
            "whether goals count whole turns. False: continuous joints take the shorter way, of at most half a turn."),
  };
};

template <>
struct Fields<planning::StochasticOptions> {
  using Options = planning::StochasticOptions;
  static constexpr std::tuple all{
      field("states", &Options::states, "N + 1, 3 to 1000 support states, ends included."),
      field("samples", &Options::samples, "≥ 2, motions drawn in an iteration."),
      field("max_iterations", &Options::max_iterations, "≥ 1."),
      field("deviation", &Options::deviation, "[rad or m] > 0, standard deviation of the samples half-way."),
      field("decay", &Options::decay, "in (0, 1], of the deviation from one iteration to the next."),
      field("temperature", &Options::temperature,
            "> 0: a sample weighs exp(−(G − G_min)/(temperature (G_max − G_min)))."),
      field("prior_weight", &Options::prior_weight, "≥ 0, of ‖q − μ‖² against the cost."),
      field("tolerance", &Options::tolerance,
            "≥ 0: the search stops where eight iterations together gain less than this part of the objective."),
      field("refine", &Options::refine, "whether `gradient` finishes the motion that the samples found."),
      field("duration", &Options::duration, "[s] as for `gradient`."),
      field("whole_turns", &Options::whole_turns,
            "whether goals count whole turns. False: continuous joints take the shorter way, of at most half a turn."),
  };
};

template <>
struct Fields<planning::CartOptions> {
  using Options = planning::CartOptions;
  static constexpr std::tuple all{
      field("turn", &Options::turn,
            "[rad] that joint 1 turns through from the first to the last sample. Laws that turn the point's azimuth by "
            "another number of whole turns are left out: they would bring the arm to its last pose, but not to its "
            "taught joints. None: the winding is not checked."),
      field("margin", &Options::margin,
            "[m] ≥ 0, added to the radius in planning. Between samples the law can be nearer than radius + margin by "
            "max|Δ²λ|/8."),
      field("duration", &Options::duration, "[s] > 0 from the first to the last sample. The limits count in it."),
      field("max_speed", &Options::max_speed,
            "[m/s] > 0 of the cart. A law within the speed limit is found if there is one."),
      field("max_acceleration", &Options::max_acceleration,
            "[m/s²] > 0 of the cart, second differences over the samples. Where the law of the least energy "
            "accelerates too much, the law of the least energy that does not takes its place, on the same sides, by an "
            "interior-point method; other sides are not tried."),
      field("at_rest", &Options::at_rest,
            "whether the cart starts and stops within max_acceleration, where max_acceleration is finite."),
  };
};

/// A number for both axes, or (2,); infinite where there is no limit.
template <>
struct Argument<planning::AxisPair> {
  static constexpr bool kNone = false;
  static std::string type() { return "numpy.typing.ArrayLike"; }
  static std::string text(const planning::AxisPair& value) {
    return value[0] == value[1] ? text_of(value[0]) : "(" + text_of(value[0]) + ", " + text_of(value[1]) + ")";
  }
  static planning::AxisPair from(py::handle object, const char* what) {
    const Array array = Array::ensure(object);
    if (!array) PyErr_Clear();
    if (array && array.ndim() == 0) return {*array.data(), *array.data()};
    if (!array || array.ndim() != 1 || array.size() != 2) {
      throw Error(std::string(what) + " must be a number, or of shape (2,)");
    }
    return {array.at(0), array.at(1)};
  }
};

template <>
struct Fields<planning::PlaneCartOptions> {
  using Options = planning::PlaneCartOptions;
  static constexpr std::tuple all{
      field("turn", &Options::turn,
            "[rad] that joint 1 turns through. Motions that turn the point's azimuth by another number of whole turns "
            "are left out: they would not bring the arm to its taught joints. None: the winding is free."),
      field("max_radius", &Options::max_radius,
            "[m] > radius + margin: the arm's reach, the farthest that the point may be from axis 1."),
      field("margin", &Options::margin,
            "[m] ≥ 0, added to the radius in planning. Between samples the point can be nearer than radius + margin by "
            "(r/8) of the square of the angle by which a step turns the point; `clearance` tells."),
      field("duration", &Options::duration, "[s] > 0 from the first to the last sample. The limits count in it."),
      field("max_speed", &Options::max_speed, "[m/s] > 0 of each axis, one number for both or (2,)."),
      field("max_acceleration", &Options::max_acceleration,
            "[m/s²] > 0 of each axis, second differences over the samples. Where the best motion does not keep to the "
            "limits, the motion of the least energy that does takes its place, along the same way."),
      field("at_rest", &Options::at_rest,
            "whether the cart starts and stops within max_acceleration, where max_acceleration is finite."),
  };
};

}  // namespace sigmaik::bindings
