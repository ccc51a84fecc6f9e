#include <sigmaik/singularities.hpp>

#include "arguments.hpp"

namespace sigmaik::bindings {
namespace {

Potential potential_argument(const SingularSets& sets, double eta1, double eta2, const MaybeArray& weights) {
  Potential p;
  p.eta1 = eta1;
  p.eta2 = eta2;
  if (weights) {
    const std::string need = "(" + std::to_string(sets.size()) + ",), one a set";
    const Array array = array_argument(*weights, "weights", {sets.size()}, need.c_str());
    std::copy_n(array.data(), sets.size(), p.weights.data());
  }
  return p;
}

using Recording =
    py::typing::Tuple<py::typing::List<py::typing::Tuple<py::object, py::ellipsis>>, py::typing::List<py::int_>>;

// Operations ("constant", value), ("sin" or "cos", joint) or ("+", "-" or "*", a, b), and the results' indices.
Recording recording(const Tape& tape) {
  py::list operations, results;
  for (const Operation& o : tape.operations) {
    switch (o.kind) {
      case Operation::Constant: operations.append(py::make_tuple("constant", o.value)); break;
      case Operation::Sin: operations.append(py::make_tuple("sin", o.a)); break;
      case Operation::Cos: operations.append(py::make_tuple("cos", o.a)); break;
      case Operation::Add: operations.append(py::make_tuple("+", o.a, o.b)); break;
      case Operation::Subtract: operations.append(py::make_tuple("-", o.a, o.b)); break;
      case Operation::Multiply: operations.append(py::make_tuple("*", o.a, o.b)); break;
    }
  }
  for (const int i : tape.results) results.append(i);
  return py::make_tuple(operations, results);
}

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

using Integers = py::typing::Tuple<py::int_, py::ellipsis>;

Integers integers(const std::vector<int>& values) {
  py::tuple out(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) out[i] = values[i];
  return out;
}

const Potential kStandard;

void bind_sets(py::class_<SingularSets>& cls) {
  cls.def_property_readonly("name", &SingularSets::name, "Of the arm.")
      .def_property_readonly("dof", &SingularSets::dof, "Number of joints, n.")
      .def("__len__", &SingularSets::size)
      .def_property_readonly(
          "names",
          [](const SingularSets& s) -> Strings {
            py::list out;
            for (int i = 0; i < s.size(); ++i) out.append(s.set(i).name);
            return py::tuple(out);
          },
          "Of the sets, c of them.")
      .def_property_readonly(
          "conditions",
          [](const SingularSets& s) -> Strings {
            py::list out;
            for (int i = 0; i < s.size(); ++i) out.append(s.set(i).condition);
            return py::tuple(out);
          },
          "What holds on each set, in words.")
      .def_property_readonly(
          "codimensions",
          [](const SingularSets& s) -> Integers {
            std::vector<int> out;
            for (int i = 0; i < s.size(); ++i) out.push_back(s.set(i).codimension);
            return integers(out);
          },
          "Number of residuals of each set.")
      .def_property_readonly(
          "joints",
          [](const SingularSets& s) -> py::typing::Tuple<Integers, py::ellipsis> {
            py::list out;
            for (int i = 0; i < s.size(); ++i) out.append(integers(s.set(i).joints));
            return py::tuple(out);
          },
          "Indices of the joints in each condition.")
      .def(
          "residuals",
          [](const SingularSets& s, const ArrayLike& q) {
            return map_configurations(s.dof(), q, {s.size()}, [&s](const JointVector& joints, double* out) {
              std::array<double, kMaxSets> psi;
              std::copy_n(psi.begin(), s.psi(joints, psi), out);
            });
          },
          py::arg("q"), "ψ (c,) ≥ 0 of every set, zero exactly on it.")
      .def(
          "signed_residuals",
          [](const SingularSets& s, const ArrayLike& q) {
            return map_configurations(s.dof(), q, {s.residual_count()}, [&s](const JointVector& joints, double* out) {
              std::array<double, kMaxResiduals> r;
              std::copy_n(r.begin(), s.residuals(joints, r), out);
            });
          },
          py::arg("q"), "The residuals themselves, set after set: codimensions[i] numbers for set i.");
}

void bind_potential(py::class_<SingularSets>& cls) {
  cls.def(
         "potential",
         [](const SingularSets& s, const ArrayLike& q, double eta1, double eta2,
            const MaybeArray& weights) -> NumberOrArray {
           const Potential p = potential_argument(s, eta1, eta2, weights);
           return number_or_array(map_configurations(
               s.dof(), q, {}, [&](const JointVector& joints, double* out) { *out = s.potential(joints, p); }));
         },
         py::arg("q"), py::arg("eta1") = kStandard.eta1, py::arg("eta2") = kStandard.eta2,
         py::arg("weights") = py::none(), "Σ_i w_i exp(η₁ − η₂ ψ_i(q)); w (c,), by default ones.")
      .def(
          "gradient",
          [](const SingularSets& s, const ArrayLike& q, double eta1, double eta2, const MaybeArray& weights) {
            const Potential p = potential_argument(s, eta1, eta2, weights);
            JointVector gradient(s.dof());
            return map_configurations(s.dof(), q, {s.dof()}, [&](const JointVector& joints, double* out) {
              s.potential(joints, p, gradient);
              std::copy_n(gradient.data(), gradient.size(), out);
            });
          },
          py::arg("q"), py::arg("eta1") = kStandard.eta1, py::arg("eta2") = kStandard.eta2,
          py::arg("weights") = py::none(), "Gradient (n,) of the potential [1/rad].")
      .def(
          "hessian",
          [](const SingularSets& s, const ArrayLike& q, double eta1, double eta2, const MaybeArray& weights) {
            const Potential p = potential_argument(s, eta1, eta2, weights);
            const int n = s.dof();
            JointVector gradient(n);
            JointMatrix hessian(n, n);
            return map_configurations(n, q, {n, n}, [&](const JointVector& joints, double* out) {
              s.potential(joints, p, gradient, hessian);
              Eigen::Map<RowMajor>(out, n, n) = hessian;
            });
          },
          py::arg("q"), py::arg("eta1") = kStandard.eta1, py::arg("eta2") = kStandard.eta2,
          py::arg("weights") = py::none(), "Hessian (n, n) of the potential [1/rad²].");
}

void bind_manipulability(py::class_<SingularSets>& cls) {
  cls.def(
         "manipulability",
         [](const SingularSets& s, const ArrayLike& q) -> NumberOrArray {
           return number_or_array(map_configurations(
               s.dof(), q, {}, [&](const JointVector& joints, double* out) { *out = s.manipulability(joints); }));
         },
         py::arg("q"), "√det(JJᵀ) in closed form, accurate down to zero.")
      .def(
          "manipulability_gradient",
          [](const SingularSets& s, const ArrayLike& q) {
            JointVector gradient(s.dof());
            return map_configurations(s.dof(), q, {s.dof()}, [&](const JointVector& joints, double* out) {
              s.manipulability(joints, gradient);
              std::copy_n(gradient.data(), gradient.size(), out);
            });
          },
          py::arg("q"), "Gradient (n,) of the manipulability; zero on a singular set, where there is none.")
      .def(
          "manipulability_hessian",
          [](const SingularSets& s, const ArrayLike& q) {
            const int n = s.dof();
            JointVector gradient(n);
            JointMatrix hessian(n, n);
            return map_configurations(n, q, {n, n}, [&](const JointVector& joints, double* out) {
              s.manipulability(joints, gradient, hessian);
              Eigen::Map<RowMajor>(out, n, n) = hessian;
            });
          },
          py::arg("q"), "Hessian (n, n) of the manipulability; zero on a singular set, where there is none.");
}

}  // namespace

void bind_singularities(py::module_& m) {
  py::class_<SingularSets> cls(
      m, "SingularSets",
      "The known singular sets of an arm: potentials around them, and its manipulability in closed\n"
      "form (Beck et al. 2022, corrected and completed). q is (n,) in the chain's angles [rad], or\n"
      "(B, n): then every result has B rows.\n\n"
      "Set i is where ψ_i = Σ r² vanishes; its residuals r have no unit, and near the set ψ is about\n"
      "the squared distance in the joints' space. A set's codimension is the number of its residuals:\n"
      "those of codimension 1 are walls, across which r changes its sign.");
  bind_sets(cls);
  bind_potential(cls);
  bind_manipulability(cls);
  cls.def(
         "_residual_tape", [](const SingularSets& s) { return recording(s.residual_tape()); },
         "See sigmaik.singularities.symbolic_residuals.")
      .def(
          "_manipulability_tape", [](const SingularSets& s) { return recording(s.manipulability_tape()); },
          "See sigmaik.singularities.symbolic_manipulability_squared.")
      .def("__eq__",
           [](const SingularSets& a, const py::object& b) {
             return py::isinstance<SingularSets>(b) && a.name() == b.cast<const SingularSets&>().name();
           })
      .def("__hash__", [](const SingularSets& s) { return py::hash(py::str(s.name())); })
      .def("__reduce__",
           [](const py::object& self) -> py::typing::Tuple<py::object, py::typing::Tuple<py::str>> {
             const py::object load = py::module_::import("sigmaik.singularities").attr("load");
             return py::make_tuple(load, py::make_tuple(py::str(self.attr("name"))));
           })
      .def("__repr__", [](const SingularSets& s) {
        std::string text = "SingularSets('" + s.name() + "':";
        for (int i = 0; i < s.size(); ++i) text += (i ? ", " : " ") + s.set(i).name;
        return text + ")";
      });
  m.def("load_singular_sets", [](const Text& name) { return SingularSets::load(name); }, py::arg("name"));
  m.def("known_singular_sets", []() -> Strings { return py::tuple(py::cast(SingularSets::names())); });
  m.def("singular_sets_of", &SingularSets::of, py::arg("chain"));
}

}  // namespace sigmaik::bindings
