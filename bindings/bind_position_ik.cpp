#include <pybind11/native_enum.h>

#include <sigmaik/position_ik.hpp>

#include "servo_options.hpp"
#include "values.hpp"

namespace sigmaik::bindings {

/// A length and an angle, such as (1e-6, 1e-6).
template <>
struct Argument<std::array<double, 2>> {
  static constexpr bool kNone = false;
  static std::string type() { return "numpy.typing.ArrayLike"; }
  static std::string text(const std::array<double, 2>& value) {
    return "(" + text_of(value[0]) + ", " + text_of(value[1]) + ")";
  }
  static std::array<double, 2> from(py::handle object, const char* what) {
    const Array array = array_argument(object, what, {2}, "(2,): [m], [rad]");
    return {array.data()[0], array.data()[1]};
  }
  static py::object to(const std::array<double, 2>& value) { return py::make_tuple(value[0], value[1]); }
};

/// Least and largest error of each row, (6, 2), or half the width of each range, (6,). Infinite is allowed.
template <>
struct Argument<std::array<std::array<double, 2>, 6>> {
  using Ranges = std::array<std::array<double, 2>, 6>;
  static constexpr bool kNone = true;
  static std::string type() { return "numpy.typing.ArrayLike | None"; }
  static std::string text(const Ranges&) { return "None"; }
  static Ranges from(py::handle object, const char* what) {
    const Array array = Array::ensure(object);
    if (!array) PyErr_Clear();
    const bool pairs = array && array.ndim() == 2 && array.shape(0) == 6 && array.shape(1) == 2;
    if (!pairs && !(array && array.ndim() == 1 && array.shape(0) == 6)) {
      throw Error(std::string(what) + " must have shape (6,): half widths, or (6, 2): least and largest errors");
    }
    Ranges out{};
    for (std::size_t i = 0; i < 6; ++i) {
      out[i][0] = pairs ? array.data()[2 * i] : -array.data()[i];
      out[i][1] = pairs ? array.data()[2 * i + 1] : array.data()[i];
    }
    return out;
  }
  static py::object to(const Ranges& value) {
    py::array_t<double> out({6, 2});
    for (std::size_t i = 0; i < 6; ++i) std::copy(value[i].begin(), value[i].end(), out.mutable_data() + 2 * i);
    return out;
  }
};

/// An axis and an angle, such as ((0, 0, 1), 0.2).
template <>
struct Argument<ToolCone> {
  static constexpr bool kNone = false;
  static std::string type() { return "tuple[numpy.typing.ArrayLike, float]"; }
  static ToolCone from(py::handle object, const char* what) {
    if (!py::isinstance<py::sequence>(object) || py::len(object) != 2) {
      throw Error(std::string(what) + " must be a pair: an axis (3,) and an angle [rad]");
    }
    const auto pair = py::reinterpret_borrow<py::sequence>(object);
    return {vector_argument(py::object(pair[0]), "the axis of the cone"),
            Argument<double>::from(py::object(pair[1]), "the angle of the cone")};
  }
  static py::object to(const ToolCone& value) { return py::make_tuple(to_numpy(value.axis), value.angle); }
};

template <>
struct Fields<PositionIkOptions> {
  static constexpr std::tuple all{
      field("tolerance", &PositionIkOptions::tolerance,
            "(2,) [m], [rad] > 0: the largest errors of position and orientation that a solution may have, beyond "
            "those that `ranges` and `cone` allow; most solutions are exact to rounding."),
      nested(&PositionIkOptions::task),
      field("exact", &PositionIkOptions::exact,
            "(6,) truth values: the rows that are held before the others. Of a pose that is unreachable, these are met "
            "where they can be, and the others are as near as possible."),
      field(
          "ranges", &PositionIkOptions::ranges,
          "(6, 2) [m, rad]: the least and the largest error allowed in each row (target minus tip, as `error` has it), "
          "in the axes of `frame`; or (6,) ≥ 0, half the width of each range. Infinite is allowed. None: no error."),
      field("cone", &PositionIkOptions::cone,
            "(axis, angle): an axis (3,) of the tool that may point anywhere within `angle` [rad] of its direction in "
            "the target pose, free to turn about itself; in place of the rows of the orientation."),
      field("starts", &PositionIkOptions::starts,
            "1 to 2048, the most starts of a search. A pose out of reach takes all of them."),
  };
};

namespace {

void bind_answers(py::module_& m) {
  py::native_enum<PositionIkStatus>(m, "PositionIkStatus", "enum.IntEnum", "What a PositionIk found.")
      .value("OK", PositionIkStatus::Ok, "a solution, inside tolerance and limits")
      .value("UNREACHABLE", PositionIkStatus::Unreachable, "none; q is the nearest found, in the exact rows first")
      .value("BAD_INPUT", PositionIkStatus::BadInput, "in C++ alone; Python raises")
      .finalize();
  py::class_<PositionIkResult>(m, "PositionIkResult", "Answer of PositionIk.solve().")
      .def_property_readonly(
          "q", [](const PositionIkResult& r) { return to_numpy(r.q); },
          "(n,) [rad or m] inside the limits. Where the pose is unreachable: the configuration found with the\n"
          "smallest |e_p/L|² + |e_o|², L = chain.characteristic_length.")
      .def_readonly("status", &PositionIkResult::status, "See PositionIkStatus.")
      .def_property_readonly(
          "error", [](const PositionIkResult& r) { return to_numpy(r.error); },
          "(6,) [m, rad] pose_error from q to the target, base axes; zero in the rows that the task leaves out. "
          "With "
          "a\n"
          "cone, the orientation part is the rotation by which the axis misses its direction.")
      .def_readonly("solve_time", &PositionIkResult::solve_time, "[s]")
      .def("__repr__", [](const PositionIkResult& r) {
        return record("PositionIkResult", {{"q", to_numpy(r.q)},
                                           {"status", py::str(py::cast(r.status).attr("name"))},
                                           {"error", to_numpy(r.error)},
                                           {"solve_time", py::float_(r.solve_time)}});
      });
  def_value(bound<PositionIkResult>(m, "PositionIkResult"));
  py::class_<PositionIkBranch>(m, "PositionIkBranch", "One of the solutions of PositionIk.branches().")
      .def_property_readonly(
          "q", [](const PositionIkBranch& b) { return to_numpy(b.q); }, "(n,) [rad or m] inside the limits.")
      .def_readonly("sigma_min", &PositionIkBranch::sigma_min,
                    "Least singular value of the task's rows, lengths in characteristic lengths.")
      .def_readonly("margin", &PositionIkBranch::margin,
                    "[rad or m] from the nearest limit; inf where no joint has a limit.")
      .def("__repr__", [](const PositionIkBranch& b) {
        return record("PositionIkBranch",
                      {{"q", to_numpy(b.q)}, {"sigma_min", py::float_(b.sigma_min)}, {"margin", py::float_(b.margin)}});
      });
  def_value(bound<PositionIkBranch>(m, "PositionIkBranch"));
}

std::vector<PositionIkBranch> branches(const PositionIk& ik, const py::object& pose) {
  const Pose target = pose_argument(pose, "pose");
  const py::gil_scoped_release release;
  return ik.solve_all(target);
}

PositionIkResult solve(const PositionIk& ik, const py::object& pose, const MaybeArray& near) {
  const Pose target = pose_argument(pose, "pose");
  const PositionIkResult found = near ? ik.solve(target, joint_argument(*near, "near", ik.chain().dof()))
                                      : ik.solve(target);
  if (found.status == PositionIkStatus::BadInput) throw Error("pose or near is too large: beyond 1e9 rad or m");
  return found;
}

py::array_t<double> solve_batch(const PositionIk& ik, const ArrayLike& poses, int threads) {
  const Array array = array_argument(poses, "poses", {-1, 4, 4}, "(B, 4, 4)");
  const py::ssize_t count = array.shape(0);
  for (py::ssize_t b = 0; b < count; ++b) {
    const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> matrix(array.data() + 16 * b);
    if (!is_pose(matrix)) throw Error("poses[" + std::to_string(b) + "] is not a pose");
  }
  py::array_t<double> out({count, static_cast<py::ssize_t>(ik.chain().dof())});
  double* const data = out.mutable_data();
  const py::gil_scoped_release release;
  ik.solve_batch(static_cast<std::size_t>(count), array.data(), data, nullptr, threads);
  return out;
}

void bind_value(py::class_<PositionIk>& c) {
  def_pickle(
      c, 2, [](const PositionIk& ik) { return py::make_tuple(ik.chain(), to_dict(ik.options())); },
      [](const py::tuple& s) {
        return PositionIk(s[0].cast<const Chain&>(), from_dict<PositionIkOptions>(s[1].cast<py::dict>()));
      },
      [](const PositionIk& a, const PositionIk& b) {
        return same(a.chain(), b.chain()) && equal(a.options(), b.options());
      });
  def_hash_by_chain(c);
}

void bind_inverse(py::module_& m) {
  py::class_<PositionIk> c(
      m, "PositionIk",
      "Joint positions of a pose, for any chain of 1 to 16 joints, inside its position limits.\n\n"
      "    ik = sk.PositionIk(chain)\n"
      "    r = ik.solve(pose)                           # or ik.solve(pose, near=q)\n"
      "    r.q, r.status, r.error\n\n"
      "A Levenberg-Marquardt descent with an active set of limits, from the entries of a table of configurations "
      "whose\n"
      "poses are closest to the target. Six joints with a spherical wrist (AnalyticIk), or with three parallel axes "
      "as\n"
      "Universal Robots' arms have, are solved in closed form. The same call gives the same answer. Immutable, safe "
      "to\n"
      "share.");
  def_init<PositionIkOptions>(
      c, std::tuple{parameter<Chain>("chain")}, 1, "",
      [](const Chain& chain, const PositionIkOptions& options) { return PositionIk(chain, options); });
  def_options(c);
  bind_value(c);
  c.def("solve", &solve, py::arg("pose"), py::arg("near") = py::none(),
        "A solution of `pose` (4, 4), tip in base; PositionIkResult.\n\n"
        "near: (n,) [rad or m]. The answer is then the nearest solution that a bounded search finds, in travel time\n"
        "max_i |q_i − near_i| / velocity limit_i (1 where there is no limit). Joints that may turn more than once are\n"
        "on the turn nearest to `near`, and a redundant arm is moved along its self-motion towards `near`.\n"
        "Without `near` it is the first solution that is found, or of a closed form the one farthest from the limits,\n"
        "each joint on the turn nearest to 0.\n\n"
        "Raises Error where `pose` is not a pose. A pose out of reach is UNREACHABLE, with the nearest pose found.")
      .def(
          "solve_all",
          [](const PositionIk& ik, const py::object& pose) {
            const std::vector<PositionIkBranch> found = branches(ik, pose);
            py::array_t<double> out(
                {static_cast<py::ssize_t>(found.size()), static_cast<py::ssize_t>(ik.chain().dof())});
            py::ssize_t row = 0;
            for (const PositionIkBranch& branch : found) {
              Eigen::Map<Eigen::VectorXd>(out.mutable_data(row++, 0), branch.q.size()) = branch.q;
            }
            return out;
          },
          py::arg("pose"),
          "Distinct solutions (k, n) [rad or m] of `pose` (4, 4), those far from the limits first; k = 0 where none "
          "is\n"
          "found.\n\n"
          "Solutions that differ by whole turns, or by less than 0.01 rad, count once: each joint is on the turn "
          "nearest\n"
          "to the middle of its range. A redundant arm is moved along its self-motion to a local minimum of the\n"
          "distance to the middle of the ranges, and these minima are the representatives.")
      .def("branches", &branches, py::arg("pose"),
           "The solutions of solve_all() in the same order, each with its least singular value and its margin.")
      .def("solve_batch", &solve_batch, py::arg("poses"), py::arg("threads") = 1,
           "solve() of B poses (B, 4, 4), without the GIL: (B, n), a row of NaN where no solution is found.\n\n"
           "The answers do not depend on `threads`. Raises Error where an entry is not a pose.")
      .def_property_readonly("chain", &PositionIk::chain, "The arm.")
      .def("__repr__",
           [](const PositionIk& ik) { return "PositionIk('" + ik.chain().base() + "' → '" + ik.chain().tip() + "')"; });
}

}  // namespace

void bind_position_ik(py::module_& m) {
  bind_answers(m);
  bind_inverse(m);
}

}  // namespace sigmaik::bindings
