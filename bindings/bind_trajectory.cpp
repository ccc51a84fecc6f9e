#include <algorithm>
#include <cmath>

#include <sigmaik/planning/clearance.hpp>
#include <sigmaik/planning/play.hpp>
#include <sigmaik/planning/trajectory.hpp>

#include "planning.hpp"

namespace sigmaik::bindings {
namespace {

/// A file's name.
class PathLike : public py::object {
 public:
  PYBIND11_OBJECT_DEFAULT(PathLike, py::object, any)

 private:
  static bool any(PyObject* /*object*/) { return true; }
};
/// pathlib.Path.
class Path : public py::object {
 public:
  PYBIND11_OBJECT_DEFAULT(Path, py::object, any)

 private:
  static bool any(PyObject* /*object*/) { return true; }
};
/// sigmaik.planning.PlanStatus, which is a str.
class StatusObject : public py::object {
 public:
  PYBIND11_OBJECT_DEFAULT(StatusObject, py::object, any)

 private:
  static bool any(PyObject* /*object*/) { return true; }
};

}  // namespace
}  // namespace sigmaik::bindings

template <>
struct pybind11::detail::handle_type_name<sigmaik::bindings::PathLike> {
  static constexpr auto name = const_name("str | os.PathLike[str]");
};
template <>
struct pybind11::detail::handle_type_name<sigmaik::bindings::Path> {
  static constexpr auto name = const_name("pathlib.Path");
};
template <>
struct pybind11::detail::handle_type_name<sigmaik::bindings::StatusObject> {
  static constexpr auto name = const_name("sigmaik.planning.status.PlanStatus");
};

namespace sigmaik::bindings {
namespace {

using planning::Clearance;
using planning::Crossing;
using planning::JointSamples;
using planning::Playback;
using planning::Trajectory;

using Doubles = py::array_t<double>;
using Samples = py::typing::Tuple<Doubles, Doubles, Doubles>;

// An array on a C++ object's own numbers, which the array keeps alive. (count, columns), or (count,) for no columns.
template <typename Class>
Doubles view(const py::object& owner, std::vector<double> Class::* member, py::ssize_t columns = -1) {
  std::vector<double>& values = owner.cast<Class&>().*member;
  const auto size = static_cast<py::ssize_t>(values.size());
  if (columns < 0) return Doubles(std::vector<py::ssize_t>{size}, values.data(), owner);
  return Doubles({columns > 0 ? size / columns : 0, columns}, values.data(), owner);
}

template <typename Class>
auto rows(std::vector<double> Class::* member) {
  return [member](const py::object& self) { return view(self, member, self.cast<const Class&>().dof); };
}
template <typename Class>
auto column(std::vector<double> Class::* member) {
  return [member](const py::object& self) { return view(self, member); };
}

std::vector<double> numbers(const ArrayLike& array, const char* name, std::initializer_list<py::ssize_t> shape,
                            const char* shape_name) {
  const Array values = array_argument(array, name, shape, shape_name);
  return {values.data(), values.data() + values.size()};
}

// A new array of rows.
Doubles rows_of(const std::vector<double>& values, int columns) {
  Doubles out({static_cast<py::ssize_t>(values.size()) / columns, static_cast<py::ssize_t>(columns)});
  std::copy(values.begin(), values.end(), out.mutable_data());
  return out;
}

Trajectory make_trajectory(const ArrayLike& t, const ArrayLike& q, const ArrayLike& qdot, const ArrayLike& qddot,
                           double duration, const std::string& status, double cost, double solve_time, int iterations,
                           int starts, bool cubic, const std::optional<Clearance>& clearance) {
  Trajectory out;
  const Array positions = array_argument(q, "q", {-1, -1}, "(N, n)");
  const py::ssize_t count = positions.shape(0), n = positions.shape(1);
  if (n < 1 || n > kMaxJoints) throw Error("q is of " + std::to_string(n) + " joints, a chain has 1 to 16");
  out.dof = static_cast<int>(n);
  out.q = {positions.data(), positions.data() + positions.size()};
  out.qdot = numbers(qdot, "qdot", {count, n}, shape_text(positions).c_str());
  out.qddot = numbers(qddot, "qddot", {count, n}, shape_text(positions).c_str());
  if (count > 0) out.t = numbers(t, "t", {count}, ("(" + std::to_string(count) + ",)").c_str());
  if (!std::is_sorted(out.t.begin(), out.t.end())) throw Error("t must increase");
  out.duration = duration;
  out.status = planning::plan_status(status);
  out.cost = cost;
  out.solve_time = solve_time;
  out.iterations = iterations;
  out.starts = starts;
  out.cubic = cubic;
  out.clearance = clearance;
  return out;
}

Strings texts(const std::vector<std::string>& names) { return Strings(py::tuple(py::cast(names))); }

using Crossings = py::typing::Tuple<Crossing, py::ellipsis>;

// All crossings, or those that are avoidable or not.
Crossings crossings_of(const Clearance& c, std::optional<bool> avoidable) {
  py::list out;
  for (const Crossing& crossing : c.crossings) {
    if (!avoidable || crossing.avoidable == *avoidable) out.append(crossing);
  }
  return Crossings(py::tuple(out));
}

StatusObject status_object(planning::PlanStatus status) {
  const py::object type = py::module_::import("sigmaik.planning.status").attr("PlanStatus");
  return py::reinterpret_borrow<StatusObject>(type(to_string(status)));
}

std::string number_text(double value) { return py::str("{:.4g}").format(value).cast<std::string>(); }

// NaN is the same as NaN: the duration and the cost of a plan that failed.
bool equal(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }
bool equal(const std::vector<double>& a, const std::vector<double>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](double x, double y) { return equal(x, y); });
}
bool equal(const Clearance& a, const Clearance& b) {
  return equal(a.t, b.t) && equal(a.manipulability, b.manipulability) && a.names == b.names && equal(a.psi, b.psi) &&
         a.crossings == b.crossings;
}
bool equal(const Trajectory& a, const Trajectory& b) {
  const bool same_clearance = a.clearance.has_value() == b.clearance.has_value() &&
                              (!a.clearance || equal(*a.clearance, *b.clearance));
  return a.dof == b.dof && equal(a.t, b.t) && equal(a.q, b.q) && equal(a.qdot, b.qdot) && equal(a.qddot, b.qddot) &&
         equal(a.duration, b.duration) && a.status == b.status && equal(a.cost, b.cost) &&
         a.solve_time == b.solve_time && a.iterations == b.iterations && a.starts == b.starts && a.cubic == b.cubic &&
         same_clearance;
}

void bind_crossing(py::module_& m) {
  py::class_<Crossing>(m, "Crossing",
                       "A motion goes through a singular set here, or so near to it that the set's potential does not\n"
                       "tell the difference.")
      .def(py::init([](const std::string& name, double t, const ArrayLike& q, double psi, bool avoidable) {
             return Crossing{name, t, numbers(q, "q", {-1}, "(n,)"), psi, avoidable};
           }),
           py::arg("name"), py::arg("t"), py::arg("q"), py::arg("psi"), py::arg("avoidable"))
      .def_readonly("name", &Crossing::name, "Name of the set.")
      .def_readonly("t", &Crossing::t, "[s]")
      .def_property_readonly("q", column(&Crossing::q), "(n,) [rad or m] there.")
      .def_readonly("psi", &Crossing::psi, "ψ there: 0 on the set.")
      .def_readonly("avoidable", &Crossing::avoidable, "Whether a path from start to goal can do without.")
      .def(
          "__eq__",
          [](const Crossing& a, const py::object& b) {
            return py::isinstance<Crossing>(b) && a == b.cast<const Crossing&>();
          },
          py::arg("other"))
      .def("__repr__",
           [](const Crossing& c) {
             return "Crossing(" + c.name + " at " + number_text(c.t) + " s, " +
                    (c.avoidable ? "avoidable)" : "unavoidable)");
           })
      .def(py::pickle([](const Crossing& c) { return py::make_tuple(c.name, c.t, c.q, c.psi, c.avoidable); },
                      [](const py::tuple& s) {
                        return Crossing{s[0].cast<std::string>(), s[1].cast<double>(), s[2].cast<std::vector<double>>(),
                                        s[3].cast<double>(), s[4].cast<bool>()};
                      }));
}

Clearance make_clearance(const ArrayLike& t, const ArrayLike& manipulability, const std::vector<std::string>& names,
                         const ArrayLike& psi, const std::vector<Crossing>& crossings) {
  Clearance out;
  out.t = numbers(t, "t", {-1}, "(M,)");
  const auto count = static_cast<py::ssize_t>(out.t.size()), sets = static_cast<py::ssize_t>(names.size());
  out.manipulability = numbers(manipulability, "manipulability", {count}, "(M,)");
  out.names = names;
  out.psi = numbers(psi, "psi", {count, sets}, "(M, c)");
  out.crossings = crossings;
  return out;
}

void bind_clearance_samples(py::class_<Clearance>& cls) {
  cls.def(py::init(&make_clearance), py::arg("t"), py::arg("manipulability"), py::arg("names"), py::arg("psi"),
          py::arg("crossings"))
      .def_property_readonly("t", column(&Clearance::t), "(M,) [s]")
      .def_property_readonly("manipulability", column(&Clearance::manipulability), "(M,) √det(JJᵀ)")
      .def_property_readonly(
          "names", [](const Clearance& c) { return texts(c.names); },
          "Names of the singular sets that are known; empty where none are.")
      .def_property_readonly(
          "psi",
          [](const py::object& self) {
            const auto& c = self.cast<const Clearance&>();
            if (c.names.empty()) return Doubles(std::vector<py::ssize_t>{static_cast<py::ssize_t>(c.t.size()), 0});
            return view(self, &Clearance::psi, static_cast<py::ssize_t>(c.names.size()));
          },
          "(M, c) ψ of every set: 0 on it.");
}

void bind_clearance_summary(py::class_<Clearance>& cls) {
  cls.def_property_readonly(
         "crossings", [](const Clearance& c) { return crossings_of(c, std::nullopt); }, "In the order of time.")
      .def_property_readonly(
          "avoidable", [](const Clearance& c) { return crossings_of(c, true); },
          "Crossings that a path from start to goal can do without.")
      .def_property_readonly(
          "unavoidable", [](const Clearance& c) { return crossings_of(c, false); }, "The other crossings.")
      .def_property_readonly("min_manipulability", &Clearance::min_manipulability,
                             "The smallest √det(JJᵀ) of all samples.")
      .def_property_readonly("min_psi", &Clearance::min_psi,
                             "The smallest ψ of all sets and samples; inf where no sets are known.")
      .def_property_readonly(
          "nearest_set",
          [](const Clearance& c) -> std::optional<std::string> {
            const int i = c.nearest_set();
            if (i < 0) return std::nullopt;
            return c.names[static_cast<std::size_t>(i)];
          },
          "The set with the smallest ψ; None where no sets are known.")
      .def("__repr__", [](const Clearance& c) {
        return "Clearance(min_manipulability=" + number_text(c.min_manipulability()) + ", " +
               std::to_string(c.crossings.size()) + " crossings)";
      });
}

void bind_clearance(py::module_& m) {
  py::class_<Clearance> cls(m, "Clearance", "Singularity along a motion that is sampled densely, M samples.");
  bind_clearance_samples(cls);
  bind_clearance_summary(cls);
  cls.def("__eq__", [](const Clearance& a, const py::object& b) {
    return py::isinstance<Clearance>(b) && equal(a, b.cast<const Clearance&>());
  });
  cls.def(
      py::pickle([](const Clearance& c) { return py::make_tuple(c.t, c.manipulability, c.names, c.psi, c.crossings); },
                 [](const py::tuple& s) {
                   return Clearance{s[0].cast<std::vector<double>>(), s[1].cast<std::vector<double>>(),
                                    s[2].cast<std::vector<std::string>>(), s[3].cast<std::vector<double>>(),
                                    s[4].cast<std::vector<Crossing>>()};
                 }));
}

void bind_playback(py::module_& m) {
  using Statuses = py::typing::Tuple<Status, py::ellipsis>;
  py::class_<Playback>(
      m, "Playback",
      "What a servo made of a planned motion: M samples, one at the begin of each cycle, and one at the\n"
      "last cycle's end.")
      .def_property_readonly("t", column(&Playback::t),
                             "(M,) [s] times of the trajectory, and those for which its end is held.")
      .def_property_readonly("planned", rows(&Playback::planned), "(M, n) the trajectory's positions [rad or m].")
      .def_property_readonly("q", rows(&Playback::q), "(M, n) the servo's positions [rad or m].")
      .def_property_readonly("qdot", rows(&Playback::qdot),
                             "(M, n) command of the cycle that begins at the sample [rad/s or m/s]; the last row\n"
                             "repeats the one before.")
      .def_property_readonly(
          "pose_error", [](const py::object& self) { return view(self, &Playback::pose_error, 6); },
          "(M, 6) planned pose minus the servo's, [position; rotation vector], base axes [m, rad].")
      .def_property_readonly(
          "status", [](const Playback& p) { return Statuses(py::tuple(py::cast(p.status))); },
          "M − 1, one for each cycle.")
      .def_property_readonly(
          "joint_difference",
          [](const Playback& p) {
            Doubles out({static_cast<py::ssize_t>(p.size()), static_cast<py::ssize_t>(p.dof)});
            for (std::size_t i = 0; i < p.q.size(); ++i) out.mutable_data()[i] = p.planned[i] - p.q[i];
            return out;
          },
          "(M, n) planned minus the servo's [rad or m]: poses do not say where a redundant arm's elbow is.")
      .def_property_readonly("max_position_error", &Playback::max_position_error,
                             "The tip's largest distance from its plan [m].")
      .def_property_readonly("max_orientation_error", &Playback::max_orientation_error,
                             "The largest angle between the tip and its plan [rad].")
      .def_property_readonly("max_joint_difference", &Playback::max_joint_difference,
                             "The largest |planned minus the servo's| of all joints [rad or m].")
      .def("__repr__", [](const Playback& p) {
        return "Playback(" + std::to_string(p.status.size()) +
               " cycles, max_position_error=" + number_text(p.max_position_error()) + ")";
      });
  m.def(
      "play", &planning::play, py::arg("trajectory"), py::arg("servo"), py::kw_only(), py::arg("settle") = 0.5,
      "Plays a planned motion through a servo that stands at its start, as poses with feed-forward twists, at the\n"
      "servo's dt.\n\n"
      "In the cycle from t to t + dt the target is the pose planned for t, and the feed-forward twist is J(q) q̇ of\n"
      "the plan in the middle of the cycle. A cycle of constant q̇ leaves the error ½ dt² J̇ q̇, and the gains keep\n"
      "the sum of these errors to ½ dt |J̇ q̇| / gain: micrometres at 1 kHz. The soft start costs more. The servo\n"
      "holds its limits and treats singularities by its own rule, so it may leave the plan; its gains bring it back.\n"
      "The servo's history goes on: call `servo.reset` before.\n\n"
      "settle: [s] for which the last pose is held.\n\n"
      "Raises Error where the trajectory is empty or has other joints, the servo stands elsewhere (1e-6 rad or m), or\n"
      "settle is not finite or negative.");
}

void bind_samples(py::class_<Trajectory>& c) {
  c.def(py::init(&make_trajectory), py::arg("t"), py::arg("q"), py::arg("qdot"), py::arg("qddot"), py::arg("duration"),
        py::arg("status"), py::arg("cost"), py::arg("solve_time"), py::arg("iterations") = 0, py::arg("starts") = 1,
        py::arg("cubic") = false, py::arg("clearance") = py::none())
      .def(py::init<const Trajectory&>(), py::arg("other"), "A copy.")
      .def_property_readonly("t", column(&Trajectory::t), "(N,) [s]")
      .def_property_readonly("q", rows(&Trajectory::q), "(N, n) [rad or m]")
      .def_property_readonly("qdot", rows(&Trajectory::qdot), "(N, n) [rad/s or m/s]")
      .def_property_readonly("qddot", rows(&Trajectory::qddot),
                             "(N, n) [rad/s² or m/s²], of the step that begins at the sample, zero in the last row;\n"
                             "where `cubic`, at the sample.");
}

void bind_outcome(py::class_<Trajectory>& c) {
  c.def_readonly("duration", &Trajectory::duration,
                 "[s]; nan where the plan failed. See the planner for what it counts.")
      .def_property_readonly(
          "status", [](const Trajectory& p) { return status_object(p.status); },
          "'optimal', a local minimum; 'feasible', within all constraints, but with something left to gain; 'failed'.")
      .def_readonly("cost", &Trajectory::cost, "The planner's objective; nan where the plan failed.")
      .def_readonly("solve_time", &Trajectory::solve_time, "[s] of wall-clock time, of the optimiser alone.")
      .def_readonly("iterations", &Trajectory::iterations, "Steps of the optimiser, of all starts.")
      .def_readonly("starts", &Trajectory::starts, "First guesses tried.")
      .def_readonly("cubic", &Trajectory::cubic,
                    "Whether positions are cubic between samples, as under a Gaussian-process prior, or quadratic.")
      .def_property_readonly(
          "clearance", [](const Trajectory& p) -> const Clearance* { return p.clearance ? &*p.clearance : nullptr; },
          py::return_value_policy::reference_internal,
          "How near to singularities the motion comes, between the samples too; None where the plan failed.");
}

void bind_times(py::class_<Trajectory>& c) {
  c.def(
       "sample",
       [](const Trajectory& p, const ArrayLike& t) -> Samples {
         const JointSamples samples = p.sample(numbers(t, "t", {-1}, "(M,)"));
         return py::make_tuple(rows_of(samples.q, p.dof), rows_of(samples.qdot, p.dof), rows_of(samples.qddot, p.dof));
       },
       py::arg("t"),
       "q, q̇, q̈ (M, n) at times t (M,) [s], held at the ends. Raises Error where there is nothing to sample.")
      .def("retimed", &Trajectory::retimed, py::arg("duration"),
           "The same path in another duration [s], faster or slower everywhere by the same factor.");
}

void bind_pickle(py::class_<Trajectory>& c) {
  c.def("__eq__", [](const Trajectory& a, const py::object& b) {
    return py::isinstance<Trajectory>(b) && equal(a, b.cast<const Trajectory&>());
  });
  c.def(py::pickle(
      [](const Trajectory& p) {
        return py::make_tuple(p.dof, p.t, p.q, p.qdot, p.qddot, p.duration, to_string(p.status), p.cost, p.solve_time,
                              p.iterations, p.starts, p.cubic, p.clearance);
      },
      [](const py::tuple& s) {
        using Numbers = std::vector<double>;
        return Trajectory{s[0].cast<int>(),
                          s[1].cast<Numbers>(),
                          s[2].cast<Numbers>(),
                          s[3].cast<Numbers>(),
                          s[4].cast<Numbers>(),
                          s[5].cast<double>(),
                          planning::plan_status(s[6].cast<std::string>()),
                          s[7].cast<double>(),
                          s[8].cast<double>(),
                          s[9].cast<int>(),
                          s[10].cast<int>(),
                          s[11].cast<bool>(),
                          s[12].cast<std::optional<Clearance>>()};
      }));
}

// Python writes the files. The import waits for a call, as that module imports this one.
template <typename... Arguments>
py::object call_files(const char* function, const Arguments&... arguments) {
  return py::module_::import("sigmaik.planning.files").attr(function)(arguments...);
}

void bind_files(py::class_<Trajectory>& c) {
  c.def(
       "plot",
       [](const py::object& self, const PathLike& file, const std::optional<Chain>& chain) {
         return Path(call_files("plot", self, file, chain));
       },
       py::arg("file"), py::arg("chain") = py::none(),
       "Writes a picture, `planning.figure.trajectory_figure`, as PNG, whole or not at all. Returns its path.\n\n"
       "Raises Error where there is nothing to draw, the chain has other joints, or the file's name does not end "
       "in\n"
       ".png, and MissingPackage where matplotlib is not installed.")
      .def(
          "save", [](const py::object& self, const PathLike& file) { return Path(call_files("save", self, file)); },
          py::arg("file"),
          "Writes a file, whole or not at all, and returns its path. A name that ends in .csv gives the text that C++\n"
          "reads too (planning/trajectory.hpp), without the clearance; any other name an npz file that numpy.load "
          "reads\n"
          "without pickles.")
      .def_static(
          "load", [](const PathLike& file) { return call_files("load", file).cast<Trajectory>(); }, py::arg("file"),
          "What `save` has written. Raises Error where the file is something else.")
      .def("_save_text", &Trajectory::save, py::arg("file"))
      .def_static("_load_text", &Trajectory::load, py::arg("file"));
}

std::string trajectory_text(const Trajectory& p) {
  const std::string what = to_string(p.status);
  if (p.t.empty()) return "Trajectory(" + what + ")";
  return "Trajectory(" + what + ", " + std::to_string(p.size()) + " samples of " + std::to_string(p.dof) + " joints, " +
         number_text(p.duration) + " s, cost " + number_text(p.cost) + ")";
}

void bind_clearance_function(py::module_& m) {
  m.def(
      "clearance",
      [](const Chain& chain, const std::optional<SingularSets>& sets, const ArrayLike& t, const ArrayLike& q,
         double width) {
        const std::vector<double> times = numbers(t, "t", {-1}, "(M,)");
        const py::ssize_t count = static_cast<py::ssize_t>(times.size()), n = chain.dof();
        return planning::clearance(chain, sets, times, numbers(q, "q", {count, n}, "(M, n)"), width);
      },
      py::arg("chain"), py::arg("sets"), py::arg("t"), py::arg("q"), py::kw_only(), py::arg("width") = 400.0,
      "Clearance of the configurations q (M, n) at increasing times t (M,) [s].\n\n"
      "sets: the arm's singular sets, or None.\n"
      "width: η₂ [1/rad²]: sets of codimension above 1 count as crossed where ψ < 1/(2 width) between ends that are\n"
      "    both outside.");
}

}  // namespace

void bind_trajectory(py::module_& m) {
  bind_crossing(m);
  bind_clearance(m);
  py::class_<Trajectory> c(
      m, "Trajectory",
      "Joint positions over time, N samples of n joints, and how they were found.\n\n"
      "Between samples the acceleration is constant, or, where `cubic`, changes evenly: `sample` is\n"
      "exact. A failed plan has no samples: its arrays are empty.");
  bind_samples(c);
  bind_outcome(c);
  bind_times(c);
  bind_pickle(c);
  bind_files(c);
  c.def("__len__", &Trajectory::size).def("__repr__", &trajectory_text);
  bind_playback(m);
  bind_clearance_function(m);
  m.def(
      "nearest_turn",
      [](const Chain& chain, const ArrayLike& start, const ArrayLike& goal) {
        const int n = chain.dof();
        return to_numpy(
            planning::nearest_turn(chain, joint_argument(start, "start", n), joint_argument(goal, "goal", n)));
      },
      py::arg("chain"), py::arg("start"), py::arg("goal"),
      "The goal (n,) with each continuous joint on the turn nearest to the start, at most π away.");
}

}  // namespace sigmaik::bindings
