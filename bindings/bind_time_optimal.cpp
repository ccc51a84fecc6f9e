#include <sigmaik/planning/time_optimal.hpp>

#include "planner_options.hpp"
#include "planning.hpp"

namespace sigmaik::bindings {
namespace {

using planning::ArmSpheres;
using planning::DistanceField;
using planning::JointCost;
using planning::TimeOptimal;
using planning::TimeOptimalOptions;
using planning::TimeOptimalProblem;
using planning::TimeOptimalResult;

TimeOptimalProblem problem_argument(const TimeOptimal& t, const ArrayLike& start, const ArrayLike& goal,
                                    const MaybeArray& start_velocity, const MaybeArray& goal_velocity,
                                    const MaybeArray& bend) {
  const int n = t.chain().dof();
  return {joint_argument(start, "start", n), joint_argument(goal, "goal", n),
          optional_joint_argument(object_of(start_velocity), "start_velocity", n),
          optional_joint_argument(object_of(goal_velocity), "goal_velocity", n),
          optional_joint_argument(object_of(bend), "bend", n)};
}

void bind_result(py::module_& m) {
  py::class_<TimeOptimalResult>(m, "TimeOptimalResult", "Answer of TimeOptimal.solve().")
      .def_property_readonly(
          "status", [](const TimeOptimalResult& r) { return std::string(to_string(r.status)); },
          "'optimal', 'feasible' (within all constraints, but there is something to gain) or 'failed'.")
      .def_readonly("duration", &TimeOptimalResult::duration, "[s] t_F = N h.")
      .def_readonly("cost", &TimeOptimalResult::cost, "The objective.")
      .def_readonly("gap", &TimeOptimalResult::gap, "Estimate of what is left to gain.")
      .def_readonly("iterations", &TimeOptimalResult::iterations, "Newton steps, of all starts.")
      .def_readonly("starts", &TimeOptimalResult::starts, "First guesses tried.")
      .def(
          "nodes",
          [](const TimeOptimalResult& r,
             int n) -> py::typing::Tuple<py::array_t<double>, py::array_t<double>, py::array_t<double>> {
            return py::make_tuple(nodes(r.q, n), nodes(r.qdot, n), nodes(r.qddot, n));
          },
          py::arg("dof"), "q, q̇, q̈ (N, n), or (0, n) where failed.");
}

void bind_planner(py::module_& m) {
  py::class_<TimeOptimal> c(
      m, "TimeOptimal",
      "Time-optimal motions of one arm with one cost, after Beck et al. (2022), by an interior-point\n"
      "method made for double integrators. `sigmaik.planning.time_optimal` is what to call.");
  def_init<TimeOptimalOptions>(
      c,
      std::tuple{parameter<Chain>("chain"), parameter<std::optional<std::shared_ptr<JointCost>>>("cost"),
                 parameter<std::optional<SingularSets>>("sets"), parameter<std::optional<ArmSpheres>>("spheres"),
                 parameter<std::optional<DistanceField>>("field")},
      0, "Raises Error where an option is out of its range.",
      [](const Chain& chain, const std::optional<std::shared_ptr<JointCost>>& cost,
         const std::optional<SingularSets>& sets, const std::optional<ArmSpheres>& spheres,
         const std::optional<DistanceField>& field, const TimeOptimalOptions& options) {
        return TimeOptimal(chain, cost.value_or(nullptr), options, sets ? sets : SingularSets::of(chain),
                           check_of(spheres, field));
      });
  c.def(
       "plan",
       [](TimeOptimal& t, const ArrayLike& start, const ArrayLike& goal, const MaybeArray& start_velocity,
          const MaybeArray& goal_velocity) {
         const TimeOptimalProblem problem = problem_argument(t, start, goal, start_velocity, goal_velocity, {});
         py::gil_scoped_release release;
         return t.plan(problem);
       },
       py::arg("start"), py::arg("goal"), py::arg("start_velocity") = py::none(), py::arg("goal_velocity") = py::none(),
       "A motion with its clearance, and, where it crosses a singular set that it need not, the better of it and "
       "of\n"
       "one from the other side.")
      .def(
          "solve",
          [](TimeOptimal& t, const ArrayLike& start, const ArrayLike& goal, const MaybeArray& start_velocity,
             const MaybeArray& goal_velocity, const MaybeArray& bend) {
            const TimeOptimalProblem problem = problem_argument(t, start, goal, start_velocity, goal_velocity, bend);
            py::gil_scoped_release release;
            return t.solve(problem);
          },
          py::arg("start"), py::arg("goal"), py::arg("start_velocity") = py::none(),
          py::arg("goal_velocity") = py::none(), py::arg("bend") = py::none(),
          "A motion between (n,) positions and velocities; `bend` (n,) is added to the first guess half-way.\n\n"
          "Raises Error where an end is outside its limits. One call at a time for each object.");
}

}  // namespace

void bind_time_optimal(py::module_& m) {
  bind_result(m);
  bind_planner(m);
}

}  // namespace sigmaik::bindings
