#include <sigmaik/planning/costs.hpp>
#include <sigmaik/planning/joint_cost.hpp>

#include "planning.hpp"

namespace sigmaik::bindings {
namespace {

using planning::JointCost;

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

void bind_class(py::module_& m) {
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
}

void bind_index_costs(py::module_& m) {
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
}

void bind_sums(py::module_& m) {
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

}  // namespace

void bind_joint_cost(py::module_& m) {
  bind_class(m);
  bind_singularity_costs(m);
  bind_index_costs(m);
  bind_sums(m);
}

}  // namespace sigmaik::bindings
