#include "values.hpp"

namespace sigmaik::bindings {
namespace {

using Names = py::typing::Tuple<py::str, py::ellipsis>;

Names singular_names(unsigned bits) {
  py::list names;
  if ((bits & kShoulderSingular) != 0) names.append("shoulder");
  if ((bits & kElbowSingular) != 0) names.append("elbow");
  if ((bits & kWristSingular) != 0) names.append("wrist");
  return py::tuple(names);
}

AnalyticSolutions solutions(const AnalyticIk& ik, const py::object& pose, bool within_limits) {
  AnalyticSolutions found = ik.solve(pose_argument(pose, "pose"));
  if (!within_limits) return found;
  const int count = found.count;
  found.count = 0;
  for (int i = 0; i < count; ++i) {
    const AnalyticBranch& branch = found.branches[static_cast<std::size_t>(i)];
    if (branch.within_limits) found.branches[static_cast<std::size_t>(found.count++)] = branch;
  }
  return found;
}

std::optional<py::array_t<double>> nearest(const AnalyticIk& ik, const py::object& pose, const ArrayLike& q,
                                           bool within_limits) {
  const JointVector near = joint_argument(q, "q", 6);
  const AnalyticNearest found = ik.nearest(pose_argument(pose, "pose"), near);
  if (found.status == AnalyticStatus::BadInput) throw Error("q is too large: beyond 1e9 rad");
  if (found.status != AnalyticStatus::Ok) return std::nullopt;
  if (within_limits && !found.branch.within_limits) return std::nullopt;
  return to_numpy(found.branch.q);
}

void bind_branch(py::module_& m) {
  py::class_<AnalyticBranch>(m, "AnalyticBranch", "One posture of a pose, from AnalyticIk.branches().")
      .def_property_readonly(
          "q", [](const AnalyticBranch& b) { return to_numpy(b.q); }, "(6,) [rad]")
      .def_readonly("within_limits", &AnalyticBranch::within_limits, "Every joint is within the chain's limits.")
      .def_property_readonly(
          "singular", [](const AnalyticBranch& b) { return singular_names(b.singular); },
          "Those of 'shoulder', 'elbow', 'wrist' where this branch and another have become one.")
      .def("__repr__", [](const AnalyticBranch& b) {
        return "AnalyticBranch(q=" + py::str(to_numpy(b.q)).cast<std::string>() +
               ", within_limits=" + (b.within_limits ? "True" : "False") +
               ", singular=" + py::str(singular_names(b.singular)).cast<std::string>() + ")";
      });
  def_value(bound<AnalyticBranch>(m, "AnalyticBranch"));
}

void bind_value(py::class_<AnalyticIk> c) {
  def_pickle(
      c, 1, [](const AnalyticIk& ik) { return py::make_tuple(ik.chain()); },
      [](const py::tuple& s) { return AnalyticIk(s[0].cast<const Chain&>()); },
      [](const AnalyticIk& a, const AnalyticIk& b) { return same(a.chain(), b.chain()); });
  def_hash_by_chain(c);
}

void bind_inverse(py::module_& m) {
  py::class_<AnalyticIk>(m, "AnalyticIk",
                         "Closed-form inverse kinematics of six revolute joints with a spherical wrist.\n\n"
                         "Covers arms whose axes 4, 5, 6 meet in one point and whose axes 2 and 3 are parallel, to\n"
                         "1e-9 [rad, or of the arm's size], however frames, signs and zeros are laid: offsets, and\n"
                         "angles other than right ones, included. Immutable, safe to share.")
      .def(py::init<const Chain&>(), py::arg("chain"), "Raises Error with the facts where the arm is not of this kind.")
      .def(
          "solve",
          [](const AnalyticIk& ik, const py::object& pose, bool within_limits) {
            const AnalyticSolutions found = solutions(ik, pose, within_limits);
            py::array_t<double> out({found.count, 6});
            for (int i = 0; i < found.count; ++i) {
              Eigen::Map<SixJoints>(out.mutable_data(i, 0)) = found.branches[static_cast<std::size_t>(i)].q;
            }
            return out;
          },
          py::arg("pose"), py::kw_only(), py::arg("within_limits") = false,
          "Every posture (k, 6) [rad] of `pose` (4, 4), tip in base: k ≤ 8, and 0 where it is out of reach.\n\n"
          "within_limits: leave out postures beyond a joint limit.\n\n"
          "Each joint is on the turn nearest to 0 within its limits, in (−π, π] where there is none. Branches "
          "that\n"
          "are one at a singularity are given once; an angle that is free there is as close to 0 as limits allow.")
      .def(
          "branches",
          [](const AnalyticIk& ik, const py::object& pose, bool within_limits) {
            const AnalyticSolutions found = solutions(ik, pose, within_limits);
            return std::vector<AnalyticBranch>(found.begin(), found.end());
          },
          py::arg("pose"), py::kw_only(), py::arg("within_limits") = false,
          "The postures of solve() in the same order, each with its limits and singularities.")
      .def("nearest", &nearest, py::arg("pose"), py::arg("q"), py::kw_only(), py::arg("within_limits") = false,
           "The posture (6,) [rad] of `pose` (4, 4) nearest to q (6,) by Euclidean norm; None where out of "
           "reach.\n\n"
           "One within the joint limits where there is one. within_limits: None where there is not.\n\n"
           "Each joint is on the turn nearest to q within its limits. An angle that is free at a singularity stays "
           "as\n"
           "in q, so that a path straight through is followed.")
      .def(
          "singular",
          [](const AnalyticIk& ik, const py::object& pose) {
            const AnalyticSolutions found = solutions(ik, pose, false);
            unsigned bits = 0;
            for (const AnalyticBranch& branch : found) bits |= branch.singular;
            return singular_names(bits);
          },
          py::arg("pose"),
          "Those of 'shoulder', 'elbow', 'wrist' that any posture of `pose` (4, 4) is singular by; branches() "
          "tells\n"
          "which posture.")
      .def_property_readonly("chain", &AnalyticIk::chain, "The arm.")
      .def("__repr__",
           [](const AnalyticIk& ik) { return "AnalyticIk('" + ik.chain().base() + "' → '" + ik.chain().tip() + "')"; });
  bind_value(bound<AnalyticIk>(m, "AnalyticIk"));
}

}  // namespace

void bind_analytic_ik(py::module_& m) {
  bind_branch(m);
  bind_inverse(m);
}

}  // namespace sigmaik::bindings
