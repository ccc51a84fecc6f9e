#include <sigmaik/planning/support_states.hpp>

#include "planner_options.hpp"
#include "planning.hpp"
#include "python_cost.hpp"

namespace sigmaik::bindings {
namespace {

using planning::ArmSpheres;
using planning::DistanceField;
using planning::GradientOptions;
using planning::JointCost;
using planning::StochasticOptions;
using planning::SupportPlanner;

using MaybeCost = std::optional<std::shared_ptr<JointCost>>;
using MaybeSpheres = std::optional<ArmSpheres>;
using MaybeField = std::optional<DistanceField>;

/// \throws Error where there is no cost, or a cost is not one of this chain's joints
SupportPlanner planner(const Chain& chain, const MaybeCost& cost, const std::vector<py::object>& python_costs,
                       int states, const MaybeSpheres& spheres, const MaybeField& field) {
  return SupportPlanner(chain, with_python_costs(cost.value_or(nullptr), chain.dof(), python_costs), states,
                        check_of(spheres, field));
}

constexpr const char* kCosts = "added up to `cost`, each with value(q: (B, n)) -> (B,), and a gradient or not.";

template <typename Options>
planning::Trajectory plan(const Chain& chain, const ArrayLike& start, const ArrayLike& goal,
                          const std::vector<py::object>& python_costs, const MaybeCost& cost,
                          const MaybeSpheres& spheres, const MaybeField& field, const Options& options) {
  const JointVector from = joint_argument(start, "start", chain.dof()), to = joint_argument(goal, "goal", chain.dof());
  SupportPlanner p = planner(chain, cost, python_costs, options.states, spheres, field);
  py::gil_scoped_release release;
  return p.plan(from, to, options);
}

}  // namespace

void bind_support_states(py::module_& m) {
  const std::tuple problem{parameter<Chain>("chain"),     parameter<ArrayLike>("start"),
                           parameter<ArrayLike>("goal"),  parameter<std::vector<py::object>>("python_costs", kCosts),
                           parameter<MaybeCost>("cost"),  parameter<MaybeSpheres>("spheres"),
                           parameter<MaybeField>("field")};
  def_function<GradientOptions>(m, "plan_gradient", problem, 0, "`sigmaik.planning.gradient` is what to call.",
                                &plan<GradientOptions>);
  def_function<StochasticOptions>(
      m, "plan_stochastic", std::tuple_cat(problem, std::tuple{parameter<std::optional<std::uint64_t>>("seed")}), 0,
      "`sigmaik.planning.stochastic` is what to call.",
      [](const Chain& chain, const ArrayLike& start, const ArrayLike& goal, const std::vector<py::object>& python_costs,
         const MaybeCost& cost, const MaybeSpheres& spheres, const MaybeField& field,
         const std::optional<std::uint64_t>& seed, StochasticOptions options) {
        options.seed = seed.value_or(options.seed);
        return plan(chain, start, goal, python_costs, cost, spheres, field, options);
      });
  m.def(
      "draw_from_prior",
      [](const Chain& chain, const std::shared_ptr<JointCost>& cost, int states, const ArrayLike& start,
         const ArrayLike& goal, double deviation, std::uint64_t seed) {
        const int n = chain.dof();
        return nodes(planner(chain, cost, {}, states, {}, {})
                         .draw(joint_argument(start, "start", n), joint_argument(goal, "goal", n), deviation, seed)
                         .q,
                     n);
      },
      py::arg("chain"), py::arg("cost"), py::arg("states"), py::arg("start"), py::arg("goal"), py::kw_only(),
      py::arg("deviation"), py::arg("seed"),
      "q (states, n) of a motion from the prior about the straight line: a first guess of the planner with this cost.");
  m.def(
      "spline_velocities",
      [](const ArrayLike& q) {
        const Array states = array_argument(q, "q", {-1, -1}, "(states, n)");
        const int n = static_cast<int>(states.shape(1));
        return nodes(planning::spline_velocities({states.data(), states.data() + states.size()},
                                                 static_cast<int>(states.shape(0)), n),
                     n);
      },
      py::arg("q"), "Velocities (states, n) of the natural cubic spline through q (states, n), in unit time.");
}

}  // namespace sigmaik::bindings
