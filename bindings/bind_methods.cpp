#include <optional>

#include "arguments.hpp"

namespace sigmaik::bindings {
namespace {

const char* to_string(DampingRule rule) {
  switch (rule) {
    case DampingRule::NumericalFiltering: return "numerical_filtering";
    case DampingRule::Manipulability: return "manipulability";
    case DampingRule::SmallestSingularValue: return "smallest_singular_value";
  }
  return "unknown";
}

DampingRule damping_rule(const std::string& text) {
  for (const DampingRule rule :
       {DampingRule::NumericalFiltering, DampingRule::Manipulability, DampingRule::SmallestSingularValue}) {
    if (text == to_string(rule)) return rule;
  }
  throw Error("AdaptiveDampedLeastSquares: rule = '" + text +
              "' must be 'numerical_filtering', 'manipulability' or 'smallest_singular_value'");
}

template <typename Rule>
Rule checked(const Rule& rule) {
  validate(rule);
  return rule;
}

// repr, equality and pickling, from the constructor's arguments by name.
template <typename Rule, typename Arguments>
void finish(py::class_<Rule>& c, Arguments arguments) {
  c.def("__repr__", [arguments](const py::object& self) {
    std::string text = py::type::of(self).attr("__name__").cast<std::string>() + "(";
    bool first = true;
    for (const auto& [key, value] : py::dict(arguments(self.cast<const Rule&>()))) {
      text += (first ? "" : ", ") + key.template cast<std::string>() + "=" +
              py::repr(value).template cast<std::string>();
      first = false;
    }
    return text + ")";
  });
  c.def("__eq__", [arguments](const Rule& a, const py::object& b) {
    return py::isinstance<Rule>(b) && arguments(a).equal(arguments(b.cast<const Rule&>()));
  });
  c.def("__hash__", [arguments](const Rule& self) {  // by the values, as equality: −0.0 is 0.0
    return py::hash(py::make_tuple(py::type::of<Rule>(), py::tuple(arguments(self).attr("values")())));
  });
  using Recipe = py::typing::Tuple<py::object, py::typing::Tuple<py::object, py::ellipsis>>;
  c.def("__reduce__", [arguments](const py::object& self) -> Recipe {
    const auto partial = py::module_::import("functools").attr("partial");
    return py::make_tuple(partial(py::type::of(self), **arguments(self.cast<const Rule&>())), py::tuple());
  });
}

template <typename Rule>
void bind_gamma_only(py::module_& m, const char* name, const char* doc) {
  auto c = py::class_<Rule>(m, name, doc);
  c.def(py::init([](double gamma) { return checked(Rule{gamma}); }), py::arg("gamma") = 0.1,
        "gamma: threshold in (0, 1] on σ_i/σ_max.");
  c.def_readonly("gamma", &Rule::gamma, "Threshold on σ_i/σ_max.");
  finish(c, [](const Rule& r) {
    py::dict d;
    d["gamma"] = r.gamma;
    return d;
  });
}

}  // namespace

void bind_methods(py::module_& m) {
  {
    auto c = py::class_<PseudoInverse>(
        m, "PseudoInverse",
        "Moore and Penrose's inverse, truncated: u_iᵀẋ/σ_i, and 0 where σ_i ≤ tolerance·σ_max.\n\n"
        "Exact, but joint speeds grow as 1/σ_i towards a singularity.");
    c.def(py::init([](double tolerance) { return checked(PseudoInverse{tolerance}); }), py::arg("tolerance") = 1e-12,
          "tolerance: fraction of σ_max in (0, 1] at and below which directions are dropped.");
    c.def_readonly("tolerance", &PseudoInverse::tolerance);
    finish(c, [](const PseudoInverse& r) {
      py::dict d;
      d["tolerance"] = r.tolerance;
      return d;
    });
  }
  {
    auto c = py::class_<DampedLeastSquares>(
        m, "DampedLeastSquares",
        "Constant damping: σ_i/(σ_i²+λ²) u_iᵀẋ (Wampler 1986; Nakamura and Hanafusa 1986).\n\n"
        "Smooth, and inexact everywhere by λ²/(σ_i²+λ²). |q̇| ≤ |ẋ|/(2λ).");
    c.def(py::init([](double damping) { return checked(DampedLeastSquares{damping}); }), py::arg("damping") = 0.1,
          "damping: λ > 0, in the units of σ.");
    c.def_readonly("damping", &DampedLeastSquares::damping);
    finish(c, [](const DampedLeastSquares& r) {
      py::dict d;
      d["damping"] = r.damping;
      return d;
    });
  }
  {
    auto c = py::class_<AdaptiveDampedLeastSquares>(
        m, "AdaptiveDampedLeastSquares",
        "Damping that grows towards a singularity and vanishes away from it. λ is `damping`, ε or w₀ `threshold`.\n\n"
        "rule 'numerical_filtering': only directions with σ_i < ε, λ_i² = (1 − (σ_i/ε)²) λ² (Maciejewski and Klein\n"
        "    1988, as in Chiaverini 1997; continuous too where several directions are small)\n"
        "rule 'manipulability': all directions, λ² (1 − w/w₀)² where w = Π σ_i < w₀ (Nakamura and Hanafusa 1986)\n"
        "rule 'smallest_singular_value': all directions, (1 − (σ_min/ε)²) λ² where σ_min < ε (Chiaverini 1997)");
    c.def(py::init([](const std::string& rule, double damping, const std::optional<double>& threshold, bool relative) {
            if (threshold && !(*threshold > 0.0)) {
              throw Error("AdaptiveDampedLeastSquares: threshold = " +
                          py::str(py::float_(*threshold)).cast<std::string>() + " must be above 0");
            }
            return checked(AdaptiveDampedLeastSquares{damping_rule(rule), damping, threshold.value_or(0.0), relative});
          }),
          py::arg("rule") = "numerical_filtering", py::arg("damping") = 0.1, py::arg("threshold") = py::none(),
          py::arg("relative") = true,
          "damping: λ > 0 at the singularity. threshold: > 0; by default 0.1, or 1e-3 for 'manipulability'.\n"
          "relative: λ and ε are fractions of σ_max, w₀ of σ_max to the number of directions, so that units and size\n"
          "of the arm do not matter; False: absolute values, as in the papers.");
    c.def_property_readonly("rule", [](const AdaptiveDampedLeastSquares& r) { return to_string(r.rule); });
    c.def_readonly("damping", &AdaptiveDampedLeastSquares::damping);
    c.def_property_readonly("threshold", [](const AdaptiveDampedLeastSquares& r) -> std::optional<double> {
      return r.threshold > 0.0 ? std::optional(r.threshold) : std::nullopt;
    });
    c.def_readonly("relative", &AdaptiveDampedLeastSquares::relative);
    finish(c, [](const AdaptiveDampedLeastSquares& r) {
      py::dict d;
      d["rule"] = to_string(r.rule);
      d["damping"] = r.damping;
      d["threshold"] = r.threshold > 0.0 ? py::object(py::float_(r.threshold)) : py::none();
      d["relative"] = r.relative;
      return d;
    });
  }
  {
    auto c = py::class_<SelectivelyDampedLeastSquares>(
        m, "SelectivelyDampedLeastSquares",
        "Each direction clamped by what it moves the joints for what it moves the tip (Buss and Kim 2005).\n\n"
        "Their angle limit per update is a joint speed here. |q̇_j| ≤ max_speed.");
    c.def(py::init([](double max_speed) { return checked(SelectivelyDampedLeastSquares{max_speed}); }),
          py::arg("max_speed") = 0.7853981633974483, "max_speed: [rad/s] > 0 (the paper's γ_max).");
    c.def_readonly("max_speed", &SelectivelyDampedLeastSquares::max_speed);
    finish(c, [](const SelectivelyDampedLeastSquares& r) {
      py::dict d;
      d["max_speed"] = r.max_speed;
      return d;
    });
  }
  {
    auto c = py::class_<JParse>(
        m, "JParse",
        "J-PARSE (Guptasarma et al.): u_iᵀẋ/σ_i where σ_i > γσ_max, else σ_i/(γσ_max)² u_iᵀKẋ.\n\n"
        "Regular directions are exact; along a singular one motion fades out at the singularity and can leave it\n"
        "again. |q̇| ≤ |ẋ|/(γσ_max) for unit gains.");
    c.def(py::init([](double gamma, double gain_linear, double gain_angular, bool continuous, bool singular_posture) {
            return checked(JParse{gamma, gain_linear, gain_angular, continuous, singular_posture});
          }),
          py::arg("gamma") = 0.1, py::arg("gain_linear") = 1.0, py::arg("gain_angular") = 1.0,
          py::arg("continuous") = true, py::arg("singular_posture") = false,
          "gamma: threshold in (0, 1] on σ_i/σ_max.\n"
          "gain_linear, gain_angular: the paper's K ≥ 0, for the command's linear and angular rows.\n"
          "continuous: the gain is K at σ_i = 0 and goes linearly to 1 at the threshold; False: K throughout, as\n"
          "published, which jumps at the threshold where K ≠ 1.\n"
          "singular_posture: the posture acts along singular directions, as far as J-PARSE's own inverse does not, by "
          "its\n"
          "I − J⁺J: an arm that was stretched out folds back to the side of its posture. False: it does not, as "
          "published.");
    c.def_readonly("gamma", &JParse::gamma);
    c.def_readonly("gain_linear", &JParse::gain_linear);
    c.def_readonly("gain_angular", &JParse::gain_angular);
    c.def_readonly("continuous", &JParse::continuous);
    c.def_readonly("singular_posture", &JParse::singular_posture);
    finish(c, [](const JParse& r) {
      py::dict d;
      d["gamma"] = r.gamma;
      d["gain_linear"] = r.gain_linear;
      d["gain_angular"] = r.gain_angular;
      d["continuous"] = r.continuous;
      d["singular_posture"] = r.singular_posture;
      return d;
    });
  }
  bind_gamma_only<JacobianProjection>(m, "JacobianProjection",
                                      "Ablation of J-PARSE (eq. 62): u_iᵀẋ/σ_i where σ_i > γσ_max, else 0; the posture "
                                      "acts in the directions that are left out.");
  bind_gamma_only<JacobianSafety>(m, "JacobianSafety", "Ablation of J-PARSE (eq. 63): u_iᵀẋ/max(σ_i, γσ_max).");
  bind_gamma_only<JacobianSafetyProjection>(m, "JacobianSafetyProjection",
                                            "Ablation of J-PARSE (eq. 64): like JacobianProjection, but the posture "
                                            "does not act in the directions that are left out.");
}

}  // namespace sigmaik::bindings
