#include <sigmaik/planning/costs.hpp>
#include <sigmaik/planning/support_states.hpp>
#include <sigmaik/planning/time_optimal.hpp>

#include "arguments.hpp"
#include "planning.hpp"
#include "python_cost.hpp"

namespace sigmaik::bindings {
namespace {

using planning::ArmSpheres;
using planning::CollisionCheck;
using planning::DistanceField;
using planning::GradientOptions;
using planning::JointCost;
using planning::StochasticOptions;
using planning::TimeOptimal;
using planning::TimeOptimalOptions;
using planning::TimeOptimalProblem;
using planning::TimeOptimalResult;

// (N, n) from C order.
py::array_t<double> nodes(const std::vector<double>& values, int n) {
  py::array_t<double> out({static_cast<py::ssize_t>(values.size()) / n, static_cast<py::ssize_t>(n)});
  std::copy(values.begin(), values.end(), out.mutable_data());
  return out;
}

// q (B, n) → (B,), and (B, n) where gradients are asked for.
py::array_t<double> evaluate_all(const JointCost& cost, const ArrayLike& q, int threads, bool gradients) {
  const py::ssize_t n = cost.dof();
  const Array all = array_argument(q, "q", {-1, n}, ("(B, " + std::to_string(n) + ")").c_str());
  const py::ssize_t count = all.shape(0);
  py::array_t<double> value(count), gradient({gradients ? count : 0, n});
  double* const to = value.mutable_data();
  double* const slope = gradients ? gradient.mutable_data() : nullptr;
  {
    py::gil_scoped_release release;
    planning::evaluate(cost, static_cast<std::size_t>(count), all.data(), to, slope, threads);
  }
  return gradients ? gradient : value;
}

std::optional<CollisionCheck> check_of(const std::optional<ArmSpheres>& spheres,
                                       const std::optional<DistanceField>& field) {
  if (!spheres || !field) return std::nullopt;
  return CollisionCheck(*spheres, *field);
}

TimeOptimalProblem problem_argument(const TimeOptimal& t, const ArrayLike& start, const ArrayLike& goal,
                                    const MaybeArray& start_velocity, const MaybeArray& goal_velocity,
                                    const MaybeArray& bend) {
  const int n = t.chain().dof();
  return {joint_argument(start, "start", n), joint_argument(goal, "goal", n),
          optional_joint_argument(object_of(start_velocity), "start_velocity", n),
          optional_joint_argument(object_of(goal_velocity), "goal_velocity", n),
          optional_joint_argument(object_of(bend), "bend", n)};
}

}  // namespace

void bind_joint_cost(py::module_& m) {
  py::class_<JointCost, std::shared_ptr<JointCost>>(m, "JointCost",
                                                    "A smooth cost of joint positions, with its derivatives.")
      .def_property_readonly("dof", &JointCost::dof, "Number of joints, n.")
      .def(
          "value", [](const JointCost& c, const ArrayLike& q) { return c.value(joint_argument(q, "q", c.dof())); },
          py::arg("q"), "Cost at q (n,).")
      .def(
          "model",
          [](const JointCost& c,
             const ArrayLike& q) -> py::typing::Tuple<py::float_, py::array_t<double>, py::array_t<double>> {
            JointVector gradient(c.dof());
            JointMatrix hessian(c.dof(), c.dof());
            const double value = c.model(joint_argument(q, "q", c.dof()), gradient, hessian);
            return py::make_tuple(value, to_numpy(gradient), to_numpy(hessian));
          },
          py::arg("q"), "Cost, gradient (n,) and Hessian (n, n) at q (n,).")
      .def(
          "values",
          [](const JointCost& c, const ArrayLike& q, int threads) { return evaluate_all(c, q, threads, false); },
          py::arg("q"), py::arg("threads") = 1, "Costs (B,) at q (B, n), without the GIL.")
      .def(
          "gradients",
          [](const JointCost& c, const ArrayLike& q, int threads) { return evaluate_all(c, q, threads, true); },
          py::arg("q"), py::arg("threads") = 1, "Gradients (B, n) at q (B, n), without the GIL.");
}

namespace {

void bind_singularity_costs(py::module_& m) {
  m.def(
      "potential_cost",
      [](const SingularSets& sets, double weight, double eta1, double eta2) {
        return std::const_pointer_cast<JointCost>(planning::potential_cost(sets, {.eta1 = eta1, .eta2 = eta2}, weight));
      },
      py::arg("sets"), py::arg("weight"), py::arg("eta1"), py::arg("eta2"), "weight · Σ_i exp(η₁ − η₂ ψ_i(q)).");
  m.def(
      "manipulability_cost",
      [](const SingularSets& sets, double weight, double epsilon) {
        return std::const_pointer_cast<JointCost>(planning::manipulability_cost(sets, weight, epsilon));
      },
      py::arg("sets"), py::arg("weight"), py::arg("epsilon"), "weight/(m(q) + ε), m in closed form.");
  m.def(
      "manipulability_cost",
      [](const Chain& chain, double weight, double epsilon) {
        return std::const_pointer_cast<JointCost>(planning::manipulability_cost(chain, weight, epsilon));
      },
      py::arg("chain"), py::arg("weight"), py::arg("epsilon"), "weight/(m(q) + ε), m from the Jacobian.");

  m.def(
      "geometry_aware_cost",
      [](const Chain& chain, double k, double weight) {
        return std::const_pointer_cast<JointCost>(planning::geometry_aware_cost(chain, k, weight));
      },
      py::arg("chain"), py::arg("k"), py::arg("weight"), "weight · ξ(q), the geometry-aware index, cut off at 2000.");
  m.def(
      "log_manipulability_cost",
      [](const Chain& chain, double weight) {
        return std::const_pointer_cast<JointCost>(planning::log_manipulability_cost(chain, weight));
      },
      py::arg("chain"), py::arg("weight"), "−weight · log m(q), m no less than 1e-9.");
  m.def(
      "scaled_cost",
      [](double factor, const std::shared_ptr<JointCost>& cost) {
        return std::const_pointer_cast<JointCost>(planning::scaled_cost(factor, cost));
      },
      py::arg("factor"), py::arg("cost"), "factor · cost.");
  m.def(
      "sum_of_costs",
      [](const std::vector<std::shared_ptr<JointCost>>& costs) {
        return std::const_pointer_cast<JointCost>(planning::sum_of_costs({costs.begin(), costs.end()}));
      },
      py::arg("costs"), "Σ of costs for the same joints.");
}

void bind_support_planner(py::module_& m) {
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

  using planning::SupportPlanner;
  using planning::SupportStates;
  py::class_<SupportStates>(m, "SupportStates", "Answer of SupportPlanner.")
      .def_readonly("cost", &SupportStates::cost, "Σ of the states' cost, but for the ends'.")
      .def_readonly("distance", &SupportStates::distance, "‖q − μ‖² in the inverse of the prior's covariance.")
      .def_readonly("iterations", &SupportStates::iterations)
      .def_readonly("converged", &SupportStates::converged, "Whether it stopped by its own rule.")
      .def("states", [](const SupportStates& s, int n) { return nodes(s.q, n); }, py::arg("dof"), "q (states, n).");
  py::class_<SupportPlanner>(m, "SupportPlanner",
                             "Motions as support states under a Gaussian-process prior (Petrović et al.).\n"
                             "`sigmaik.planning.stochastic` and `gradient` are what to call.")
      .def(py::init([](const Chain& chain, const std::optional<std::shared_ptr<JointCost>>& cost, int states,
                       const std::vector<py::object>& python_costs, const std::optional<ArmSpheres>& spheres,
                       const std::optional<DistanceField>& field) {
             return SupportPlanner(chain, with_python_costs(cost.value_or(nullptr), chain.dof(), python_costs), states,
                                   check_of(spheres, field));
           }),
           py::arg("chain"), py::arg("cost"), py::arg("states"), py::arg("python_costs") = std::vector<py::object>{},
           py::arg("spheres") = py::none(), py::arg("field") = py::none(),
           "`cost` and those of `python_costs` (value(q: (B, n)) -> (B,), gradient or not) are added up.\n\n"
           "Raises Error where there is none, or one is not a cost of this chain's joints.")
      .def(
          "gradient",
          [](SupportPlanner& p, const ArrayLike& start, const ArrayLike& goal, double prior_weight, int max_iterations,
             double tolerance, const std::optional<SupportStates>& guess) {
            const int n = p.chain().dof();
            const JointVector from = joint_argument(start, "start", n), to = joint_argument(goal, "goal", n);
            py::gil_scoped_release release;
            return p.gradient(from, to, {p.states(), prior_weight, max_iterations, tolerance},
                              guess ? guess->q : std::vector<double>{});
          },
          py::arg("start"), py::arg("goal"), py::kw_only(), py::arg("prior_weight"), py::arg("max_iterations"),
          py::arg("tolerance"), py::arg("guess") = py::none())
      .def(
          "stochastic",
          [](SupportPlanner& p, const ArrayLike& start, const ArrayLike& goal, int samples, int max_iterations,
             double deviation, double decay, double temperature, double prior_weight, double tolerance,
             std::uint64_t seed) {
            const int n = p.chain().dof();
            const JointVector from = joint_argument(start, "start", n), to = joint_argument(goal, "goal", n);
            py::gil_scoped_release release;
            return p.stochastic(from, to,
                                StochasticOptions{p.states(), samples, max_iterations, deviation, decay, temperature,
                                                  prior_weight, tolerance, seed});
          },
          py::arg("start"), py::arg("goal"), py::kw_only(), py::arg("samples"), py::arg("max_iterations"),
          py::arg("deviation"), py::arg("decay"), py::arg("temperature"), py::arg("prior_weight"), py::arg("tolerance"),
          py::arg("seed"))
      .def(
          "plan_gradient",
          [](SupportPlanner& p, const ArrayLike& start, const ArrayLike& goal, double prior_weight, int max_iterations,
             double tolerance, int restarts, std::optional<double> duration) {
            const int n = p.chain().dof();
            const JointVector from = joint_argument(start, "start", n), to = joint_argument(goal, "goal", n);
            py::gil_scoped_release release;
            return p.plan(from, to,
                          GradientOptions{p.states(), prior_weight, max_iterations, tolerance, restarts, duration});
          },
          py::arg("start"), py::arg("goal"), py::kw_only(), py::arg("prior_weight") = GradientOptions{}.prior_weight,
          py::arg("max_iterations") = GradientOptions{}.max_iterations,
          py::arg("tolerance") = GradientOptions{}.tolerance, py::arg("restarts") = GradientOptions{}.restarts,
          py::arg("duration") = GradientOptions{}.duration)
      .def(
          "plan_stochastic",
          [](SupportPlanner& p, const ArrayLike& start, const ArrayLike& goal, int samples, int max_iterations,
             double deviation, double decay, double temperature, double prior_weight, double tolerance,
             std::uint64_t seed, bool refine, std::optional<double> duration) {
            const int n = p.chain().dof();
            const JointVector from = joint_argument(start, "start", n), to = joint_argument(goal, "goal", n);
            py::gil_scoped_release release;
            return p.plan(from, to,
                          StochasticOptions{p.states(), samples, max_iterations, deviation, decay, temperature,
                                            prior_weight, tolerance, seed, refine, duration});
          },
          py::arg("start"), py::arg("goal"), py::kw_only(), py::arg("samples") = StochasticOptions{}.samples,
          py::arg("max_iterations") = StochasticOptions{}.max_iterations,
          py::arg("deviation") = StochasticOptions{}.deviation, py::arg("decay") = StochasticOptions{}.decay,
          py::arg("temperature") = StochasticOptions{}.temperature,
          py::arg("prior_weight") = StochasticOptions{}.prior_weight,
          py::arg("tolerance") = StochasticOptions{}.tolerance, py::arg("seed") = StochasticOptions{}.seed,
          py::arg("refine") = StochasticOptions{}.refine, py::arg("duration") = StochasticOptions{}.duration)
      .def(
          "draw",
          [](SupportPlanner& p, const ArrayLike& start, const ArrayLike& goal, double deviation, std::uint64_t seed) {
            const int n = p.chain().dof();
            const JointVector from = joint_argument(start, "start", n), to = joint_argument(goal, "goal", n);
            py::gil_scoped_release release;
            return p.draw(from, to, deviation, seed);
          },
          py::arg("start"), py::arg("goal"), py::kw_only(), py::arg("deviation"), py::arg("seed"),
          "A motion from the prior about the straight line: a first guess.");
}

void bind_time_optimal(py::module_& m) {
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

  py::class_<TimeOptimal>(
      m, "TimeOptimal",
      "Time-optimal motions of one arm with one cost, after Beck et al. (2022), by an interior-point\n"
      "method made for double integrators. `sigmaik.planning.time_optimal` is what to call.")
      .def(py::init([](const Chain& chain, const std::optional<std::shared_ptr<JointCost>>& cost, int node_count,
                       double time_weight, double effort_weight, double tolerance, int max_iterations,
                       bool between_nodes, bool restarts, double clearance_width,
                       const std::optional<SingularSets>& sets, const std::optional<ArmSpheres>& spheres,
                       const std::optional<DistanceField>& field) {
             const TimeOptimalOptions options{node_count,     time_weight,   effort_weight, tolerance,
                                              max_iterations, between_nodes, restarts,      clearance_width};
             return TimeOptimal(chain, cost.value_or(nullptr), options, sets ? sets : SingularSets::of(chain),
                                check_of(spheres, field));
           }),
           py::arg("chain"), py::arg("cost"), py::kw_only(), py::arg("nodes") = TimeOptimalOptions{}.nodes,
           py::arg("time_weight") = TimeOptimalOptions{}.time_weight,
           py::arg("effort_weight") = TimeOptimalOptions{}.effort_weight,
           py::arg("tolerance") = TimeOptimalOptions{}.tolerance,
           py::arg("max_iterations") = TimeOptimalOptions{}.max_iterations,
           py::arg("between_nodes") = TimeOptimalOptions{}.between_nodes,
           py::arg("restarts") = TimeOptimalOptions{}.restarts,
           py::arg("clearance_width") = TimeOptimalOptions{}.clearance_width, py::arg("sets") = py::none(),
           py::arg("spheres") = py::none(), py::arg("field") = py::none(),
           "Raises Error where an option is out of its range.")
      .def(
          "plan",
          [](TimeOptimal& t, const ArrayLike& start, const ArrayLike& goal, const MaybeArray& start_velocity,
             const MaybeArray& goal_velocity) {
            const TimeOptimalProblem problem = problem_argument(t, start, goal, start_velocity, goal_velocity, {});
            py::gil_scoped_release release;
            return t.plan(problem);
          },
          py::arg("start"), py::arg("goal"), py::arg("start_velocity") = py::none(),
          py::arg("goal_velocity") = py::none(),
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

void bind_planning(py::module_& m) {
  bind_singularity_costs(m);
  bind_support_planner(m);
  bind_time_optimal(m);
}

}  // namespace sigmaik::bindings
