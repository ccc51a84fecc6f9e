#include <cmath>
#include <locale>
#include <map>
#include <sstream>
#include <tuple>
#include <utility>
#include <vector>

#include "values.hpp"

namespace sigmaik::bindings {
namespace {

template <int kRows>
using RowMajor = Eigen::Matrix<double, kRows, Eigen::Dynamic, Eigen::RowMajor>;

JointVector limit_argument(const MaybeArray& object, const char* what, const JointVector& otherwise) {
  if (!object) return otherwise;
  // Infinite entries are what "no limit" looks like, so finiteness is Chain's business here.
  Array array = Array::ensure(*object);
  if (!array) {
    PyErr_Clear();
    throw Error(std::string(what) + " is not an array of numbers");
  }
  if (array.ndim() == 0) return JointVector::Constant(otherwise.size(), *array.data());
  if (array.ndim() != 1 || array.size() != otherwise.size()) {
    throw Error(std::string(what) + " has shape " + shape_text(array) + ", needs (" + std::to_string(otherwise.size()) +
                ",) or one number");
  }
  return Eigen::Map<const Eigen::VectorXd>(array.data(), array.size());
}

void bind_limits(py::module_& m) {
  py::class_<JointLimits>(m, "JointLimits",
                          "Limits of a chain's movable joints, (n,) each, infinite where there is none.")
      .def_property_readonly(
          "lower", [](const JointLimits& l) { return to_numpy(l.lower); }, "(n,) [rad or m]")
      .def_property_readonly(
          "upper", [](const JointLimits& l) { return to_numpy(l.upper); }, "(n,) [rad or m]")
      .def_property_readonly(
          "velocity", [](const JointLimits& l) { return to_numpy(l.velocity); }, "(n,) [rad/s or m/s]")
      .def_property_readonly(
          "acceleration", [](const JointLimits& l) { return to_numpy(l.acceleration); }, "(n,) [rad/s² or m/s²]")
      .def_property_readonly(
          "deceleration", [](const JointLimits& l) { return to_numpy(l.braking()); },
          "(n,) [rad/s² or m/s²], of a joint that becomes slower: the acceleration where none is given.")
      .def_property_readonly(
          "jerk", [](const JointLimits& l) { return to_numpy(l.jerk); }, "(n,) [rad/s³ or m/s³]")
      .def_property_readonly(
          "effort", [](const JointLimits& l) { return to_numpy(l.effort); }, "(n,) [N·m or N]")
      .def("__repr__", [](const JointLimits& l) {
        std::ostringstream text;
        text.imbue(std::locale::classic());
        text.precision(4);
        text << "JointLimits(";
        const char* separator = "";
        for (const auto& [name, values] :
             {std::pair{"lower", &l.lower}, std::pair{"upper", &l.upper}, std::pair{"velocity", &l.velocity},
              std::pair{"acceleration", &l.acceleration}, std::pair{"jerk", &l.jerk}, std::pair{"effort", &l.effort}}) {
          text << separator << name << "=[";
          for (int i = 0; i < values->size(); ++i) text << (i > 0 ? ", " : "") << (*values)[i];
          text << "]";
          separator = ",\n            ";
        }
        return text.str() + ")";
      });
  def_value(bound<JointLimits>(m, "JointLimits"));
}

void bind_inertia(py::module_& m) {
  py::class_<Inertia>(m, "Inertia", "Mass distribution of a link, or of what the tip carries. Immutable.")
      .def(py::init([](double mass, const ArrayLike& center_of_mass, const MaybeArray& tensor) {
             Inertia inertia;
             inertia.mass = mass;
             inertia.center_of_mass = vector_argument(center_of_mass, "center_of_mass");
             if (tensor) {
               const Array array = array_argument(*tensor, "tensor", {3, 3}, "(3, 3)");
               inertia.tensor = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(array.data());
             }
             return inertia;
           }),
           py::arg("mass"), py::arg("center_of_mass") = py::make_tuple(0.0, 0.0, 0.0), py::arg("tensor") = py::none(),
           "mass: [kg].\n"
           "center_of_mass: (3,) [m], in the link's frame.\n"
           "tensor: (3, 3) [kg·m²], about the centre of mass, in the link's axes; None: a point mass.\n\n"
           "Chains and Dynamics check the values.")
      .def_readonly("mass", &Inertia::mass, "[kg]")
      .def_property_readonly(
          "center_of_mass", [](const Inertia& i) { return to_numpy(i.center_of_mass); },
          "(3,) [m], in the link's frame")
      .def_property_readonly(
          "tensor", [](const Inertia& i) { return to_numpy(i.tensor); },
          "(3, 3) [kg·m²], about the centre of mass, in the link's axes")
      .def("__repr__",
           [](const Inertia& i) { return "Inertia(" + py::repr(py::float_(i.mass)).cast<std::string>() + " kg)"; });
  def_value(bound<Inertia>(m, "Inertia"));
}

void bind_segment(py::module_& m) {
  py::class_<Segment>(
      m, "Segment",
      "A joint, fixed or movable, and the link that it carries. The link's frame is the joint's after the "
      "motion: parent ← origin · motion(axis, q).")
      .def_readonly("joint_name", &Segment::joint_name, "Name of the joint.")
      .def_readonly("link_name", &Segment::link_name, "Name of the link.")
      .def_property_readonly(
          "type", [](const Segment& s) { return to_string(s.type); },
          "'fixed', 'revolute', 'continuous' or 'prismatic'.")
      .def_property_readonly(
          "origin", [](const Segment& s) { return to_numpy(s.origin.matrix()); },
          "(4, 4) the joint's frame in the parent link, at q = 0")
      .def_property_readonly(
          "axis", [](const Segment& s) { return to_numpy(s.axis); }, "(3,) unit vector in the joint's frame")
      .def_readonly("inertia", &Segment::inertia, "Of the link, None where it is not known.")
      .def_property_readonly(
          "mimic",
          [](const Segment& s) -> std::optional<std::tuple<std::string, double, double>> {
            if (!s.mimic) return std::nullopt;
            return std::tuple{s.mimic->joint, s.mimic->multiplier, s.mimic->offset};
          },
          "(joint, multiplier, offset) of a joint that moves with another: multiplier · (its position) + offset; else "
          "None.")
      .def("__repr__", [](const Segment& s) {
        return "Segment('" + s.joint_name + "' carries '" + s.link_name + "', " + to_string(s.type) + ")";
      });
  def_value(bound<Segment>(m, "Segment"));
}

void bind_from_urdf(py::class_<Chain>& cls) {
  cls.def_static(
      "from_urdf",
      [](const py::object& source, const std::optional<Text>& base, const std::optional<Text>& tip,
         const MaybeArray& acceleration) {
        const std::string text = source_argument(source);
        std::vector<double> limits;
        if (acceleration) {
          const Array array = Array::ensure(*acceleration);
          if (!array || array.ndim() != 1) {
            PyErr_Clear();
            throw Error("acceleration must be a list of numbers, one a movable joint");
          }
          limits.assign(array.data(), array.data() + array.size());
        }
        const Chain chain = Chain::from_urdf(text, base.value_or(Text{}), tip.value_or(Text{}), limits);
        warn(chain.warnings());
        return chain;
      },
      py::arg("source"), py::arg("base") = py::none(), py::arg("tip") = py::none(),
      py::arg("acceleration") = py::none(),
      "Reads a URDF.\n\n"
      "source: a file's path, or the XML text.\n"
      "base, tip: link names; by default the root, and the only leaf.\n"
      "acceleration: (n,) limits [rad/s² or m/s²]; by default those of the file (URDF 1.2), else infinite.\n\n"
      "Raises Error with the facts for anything that is not a usable serial arm of 1 to 16 movable joints, and warns\n"
      "(ModelWarning) of velocity limits of zero, which count as none, of joints that mimic a joint beside the arm, "
      "which\n"
      "move by themselves, and of inertias that no rigid body has.");
}

void bind_parts(py::class_<Chain>& cls) {
  cls.def_property_readonly("dof", &Chain::dof, "Number of movable joints, n.")
      .def_property_readonly("characteristic_length", &Chain::characteristic_length,
                             "[m] the lever arm of the joints that turn: the root mean square of the distance from a "
                             "joint's axis\nto the tip, over these joints and over all turns of the joints after each "
                             "(Angeles).")
      .def_property_readonly("base", &Chain::base, "Name of the base link.")
      .def_property_readonly("tip", &Chain::tip, "Name of the tip link.")
      .def_property_readonly(
          "joint_names", [](const Chain& c) -> Strings { return py::tuple(py::cast(c.joint_names())); },
          "Names of the movable joints, base to tip.")
      .def_property_readonly(
          "joint_types",
          [](const Chain& c) -> Strings {
            py::list types;
            for (const JointType type : c.joint_types()) types.append(to_string(type));
            return py::tuple(types);
          },
          "'revolute', 'continuous' or 'prismatic' for every movable joint, base to tip.")
      .def_property_readonly(
          "segments",
          [](const Chain& c) -> py::typing::Tuple<Segment, py::ellipsis> { return py::tuple(py::cast(c.segments())); },
          "Everything between base and tip, fixed joints included.")
      .def_property_readonly("limits", &Chain::limits, "Limits of the movable joints.")
      .def_property_readonly(
          "warnings", [](const Chain& c) -> Strings { return py::tuple(py::cast(c.warnings())); },
          "What is wrong with the model and does not keep the arm from moving, one sentence each.")
      .def(
          "missing_limits",
          [](const Chain& c, bool velocity, bool acceleration) -> Strings {
            return py::tuple(py::cast(c.missing_limits(velocity, acceleration)));
          },
          py::kw_only(), py::arg("velocity") = true, py::arg("acceleration") = true,
          "Velocity and acceleration limits that joints lack, one sentence a kind: a servo cannot hold these.")
      .def(
          "with_limits",
          [](const Chain& c, const MaybeArray& lower, const MaybeArray& upper, const MaybeArray& velocity,
             const MaybeArray& acceleration, const MaybeArray& deceleration, const MaybeArray& jerk,
             const MaybeArray& effort) {
            const JointLimits& old = c.limits();
            return c.with_limits({limit_argument(lower, "lower", old.lower), limit_argument(upper, "upper", old.upper),
                                  limit_argument(velocity, "velocity", old.velocity),
                                  limit_argument(acceleration, "acceleration", old.acceleration),
                                  limit_argument(jerk, "jerk", old.jerk), limit_argument(effort, "effort", old.effort),
                                  limit_argument(deceleration, "deceleration", old.deceleration)});
          },
          py::kw_only(), py::arg("lower") = py::none(), py::arg("upper") = py::none(), py::arg("velocity") = py::none(),
          py::arg("acceleration") = py::none(), py::arg("deceleration") = py::none(), py::arg("jerk") = py::none(),
          py::arg("effort") = py::none(),
          "The same arm with other limits: (n,) or one number each, infinite for none; None keeps what there is.\n\n"
          "A continuous joint with a position limit (a cable) becomes a revolute joint. deceleration: of a joint that\n"
          "becomes slower; infinite: as the acceleration.")
      .def(
          "with_tool",
          [](const Chain& c, const py::object& pose, const std::optional<Inertia>& inertia) {
            return c.with_tool(pose_argument(pose, "pose"), inertia);
          },
          py::arg("pose"), py::arg("inertia") = py::none(),
          "The same arm with a tool, whose frame is the new tip.\n\n"
          "pose: (4, 4), the tool's frame in the tip.\n"
          "inertia: Inertia of the tool, in the tool's frame; Dynamics uses it. None: not known.")
      .def(
          "lock",
          [](const Chain& c, const std::map<Text, double>& positions) {
            return c.lock({positions.begin(), positions.end()});
          },
          py::arg("positions"),
          "The same arm with joints that do not move any more: {name: position [rad or m]}. q has fewer entries.\n\n"
          "Links and inertias stay. Raises Error where a name is not in joint_names, a position is outside its "
          "limits,\n"
          "or no joint is left.");
}

void bind_kinematics(py::class_<Chain>& cls) {
  cls.def(
         "pose",
         [](const Chain& c, const ArrayLike& q) {
           return map_configurations(c.dof(), q, {4, 4}, [&c](const JointVector& joints, double* out) {
             Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> result(out);
             result = pose(c, joints).matrix();
           });
         },
         py::arg("q"), "Pose (4, 4) of the tip in the base at q (n,) [rad or m]; (B, 4, 4) at q (B, n).")
      .def(
          "jacobian",
          [](const Chain& c, const ArrayLike& q) {
            ChainState state;
            return map_configurations(c.dof(), q, {6, c.dof()}, [&c, &state](const JointVector& joints, double* out) {
              update(c, joints, state);
              Eigen::Map<RowMajor<6>>(out, 6, c.dof()) = state.jacobian;
            });
          },
          py::arg("q"),
          "Jacobian (6, n) at q (n,): rows [v; ω] in base axes at the tip's origin; (B, 6, n) at q (B, n).")
      .def(
          "jacobian_gradient",
          [](const Chain& c, const ArrayLike& q) {
            ChainState state;
            JacobianGradient gradient;
            const int n = c.dof();
            return map_configurations(c.dof(), q, {n, 6, n}, [&](const JointVector& joints, double* out) {
              update(c, joints, state);
              jacobian_gradient(c, joints, state.jacobian, gradient);
              for (int k = 0; k < n; ++k) {
                Eigen::Map<RowMajor<6>>(out + k * 6 * n, 6, n) = gradient[static_cast<std::size_t>(k)];
              }
            });
          },
          py::arg("q"), "∂J/∂q_k (n, 6, n) at q (n,), k first; (B, n, 6, n) at q (B, n).")
      .def(
          "random_configuration",
          [](const Chain& c, const py::object& seed) {
            const JointVector lower = c.limits().lower.unaryExpr([](double x) { return std::isfinite(x) ? x : -M_PI; });
            const JointVector upper = c.limits().upper.unaryExpr([](double x) { return std::isfinite(x) ? x : M_PI; });
            const py::object generator = py::module_::import("numpy.random").attr("default_rng")(seed);
            return generator.attr("uniform")(to_numpy(lower), to_numpy(upper));
          },
          py::arg("seed") = py::none(),
          "Positions (n,) drawn uniformly within the limits, within ±π where there are none.\n\n"
          "seed: what numpy.random.default_rng takes, a Generator included.");
}

}  // namespace

void bind_chain(py::module_& m) {
  bind_limits(m);
  bind_inertia(m);
  bind_segment(m);
  py::class_<Chain> cls(
      m, "Chain",
      "A serial arm: joints, limits and inertias between a base and a tip. Immutable, safe to share.\n\n"
      "Twists and Jacobians are [v; ω], in the axes of the base, at the tip's origin\n"
      "(Pinocchio's LOCAL_WORLD_ALIGNED). Poses are 4×4, tip in base.");
  bind_from_urdf(cls);
  bind_parts(cls);
  bind_kinematics(cls);
  def_value(cls);
  cls.def("__repr__", [](const Chain& c) {
    return "Chain('" + c.base() + "' → '" + c.tip() + "', " + std::to_string(c.dof()) + " joints)";
  });
}

}  // namespace sigmaik::bindings
