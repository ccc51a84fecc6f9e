#include "servo_options.hpp"
#include "values.hpp"

namespace sigmaik::bindings {
namespace {

using Plain = py::array_t<double>;

py::array_t<bool> singular_mask(std::uint8_t bits, py::ssize_t size) {
  py::array_t<bool> out(size);
  for (py::ssize_t i = 0; i < size; ++i) out.mutable_data()[i] = (bits >> i & 1u) != 0;
  return out;
}

void bind_spectrum_value(py::class_<Spectrum> c) {
  def_equality(c, [](const Spectrum& a, const Spectrum& b) { return same(a, b); });
  c.def(py::pickle([](const Spectrum& s) { return py::make_tuple(kValuesVersion, py::bytes(save(s))); },
                   [](const py::tuple& state) {
                     check_pickle(state, 2, "Spectrum");
                     return load<Spectrum>(pickled_bytes(state, 1, "Spectrum"));
                   }));
}

void bind_value(py::class_<VelocitySolver> c) {
  def_state(
      c, 3,
      [](const VelocitySolver& s) {
        return py::make_tuple(method_to_python(s.method()), s.length_scale(), to_dict(s.task()));
      },
      [](const py::tuple& s) {
        return VelocitySolver(s[0].cast<Method>(), s[1].cast<double>(), from_dict<Task>(s[2].cast<py::dict>()));
      },
      [](const VelocitySolver& a, const VelocitySolver& b) {
        return equal(a.method(), b.method()) && a.length_scale() == b.length_scale() && equal(a.task(), b.task());
      });
}

void bind_spectrum(py::module_& m) {
  py::class_<Spectrum>(
      m, "Spectrum",
      "Singular value decomposition J = U diag(σ) Vᵀ by one-sided Jacobi rotations.\n\n"
      "Keeps the last decomposition as a warm start, and as what singular vectors continue where they\n"
      "are not unique.")
      .def(py::init<>())
      .def(
          "decompose",
          [](Spectrum& s, const ArrayLike& jacobian) -> py::typing::Tuple<Plain, Plain, Plain> {
            s.decompose(jacobian_argument(jacobian, "J"));
            const int m_rows = s.rows(), n = s.cols(), size = s.size();
            Eigen::MatrixXd u(m_rows, m_rows), v(n, size);
            Eigen::VectorXd sigma(size);
            for (int i = 0; i < m_rows; ++i) u.col(i) = s.u(i);
            for (int i = 0; i < size; ++i) {
              v.col(i) = s.v(i);
              sigma[i] = s.sigma(i);
            }
            return py::make_tuple(to_numpy(u), to_numpy(sigma), to_numpy(v));
          },
          py::arg("J"), "U (m, m), σ (min(m, n),) from large to small, V (n, min(m, n)) of J (m, n), m ≤ 6, n ≤ 16.")
      .def_property_readonly("sweeps", &Spectrum::sweeps, "Sweeps of rotations that the last call took.")
      .def("__repr__", [](const Spectrum& s) {
        py::list sigma;
        for (int i = 0; i < s.size(); ++i) sigma.append(s.sigma(i));
        return record("Spectrum", {{"rows", py::cast(s.rows())}, {"cols", py::cast(s.cols())}, {"sigma", sigma}});
      });
  bind_spectrum_value(bound<Spectrum>(m, "Spectrum"));
}

void bind_solution(py::module_& m) {
  py::class_<Solution>(m, "Solution", "Answer of VelocitySolver.solve().")
      .def_property_readonly(
          "qdot", [](const Solution& s) { return to_numpy(s.qdot); }, "(n,) [rad/s or m/s]")
      .def_readonly("status", &Solution::status, "Status.OK or Status.DAMPED.")
      .def_property_readonly(
          "singular_values", [](const Solution& s) { return to_numpy(s.singular_values); },
          "(min(m, n),) from large to small, of the weighted task Jacobian.")
      .def_property_readonly(
          "achieved_twist", [](const Solution& s) { return to_numpy(s.achieved_twist); },
          "(m,) J q̇, in the rows of the J that came in.")
      .def_property_readonly(
          "directions", [](const Solution& s) { return to_numpy(s.directions); },
          "(m', m') columns u_i in the task's rows, angular ones times length_scale.")
      .def_property_readonly(
          "singular", [](const Solution& s) { return singular_mask(s.singular, s.directions.cols()); },
          "(m',) truth values: the rule does not treat direction i as regular.")
      .def_property_readonly(
          "singular_directions",
          [](const Solution& s) {
            Eigen::MatrixXd out(s.directions.rows(), s.singular_count());
            int k = 0;
            for (int i = 0; i < s.directions.cols(); ++i) {
              if ((s.singular >> i & 1u) != 0) out.col(k++) = s.directions.col(i);
            }
            return to_numpy(out);
          },
          "(m', k) the columns of `directions` that are singular to the rule.")
      .def("__repr__", [](const Solution& s) {
        return std::string("Solution(status=") + to_string(s.status) + ", " + std::to_string(s.singular_count()) +
               " singular directions, qdot=" + py::str(to_numpy(s.qdot)).cast<std::string>() + ")";
      });
  def_value(bound<Solution>(m, "Solution"));
}

void bind_velocity_solver(py::module_& m) {
  py::class_<VelocitySolver>(m, "VelocitySolver",
                             "Resolves twists at given Jacobians by one method. Keeps only a warm start.")
      .def(py::init([](const Method& method, double length_scale, const MaybeArray& mask, const Text& frame) {
             return VelocitySolver(method, length_scale, task_argument(object_of(mask), frame));
           }),
           py::arg("method"), py::arg("length_scale") = 1.0, py::arg("mask") = py::none(), py::arg("frame") = "base",
           "length_scale: [m] > 0; 1 rad/s weighs as much as length_scale m/s. In proportion to the arm, it makes\n"
           "    answers independent of units and size.\n"
           "mask: which of the six rows (vx, vy, vz, ωx, ωy, ωz) matter; all by default.\n"
           "frame: the axes of these rows, 'base' or 'tool'.")
      .def(
          "solve",
          [](VelocitySolver& s, const ArrayLike& jacobian, const ArrayLike& twist, const MaybeArray& posture,
             const MaybeArray& rotation) {
            const TaskJacobian j = jacobian_argument(jacobian, "J");
            const auto rows = j.rows();
            const int asked = s.task().rows();
            if (rows != 6 && asked != 6 && rows != asked) {
              throw Error("J has " + std::to_string(rows) + " rows; with this mask it needs 6, or the mask's " +
                          std::to_string(asked));
            }
            const std::string need = "(" + std::to_string(rows) + ",), as J has rows";
            const Array t = array_argument(twist, "twist", {rows}, need.c_str());
            if (!rotation && rows == 6 && s.task().frame == Frame::Tool) {
              throw Error("the task is in tool axes: solve() needs rotation, the tip's (3, 3) in the base");
            }
            const Solution solution = s.solve(
                j, TaskVector(Eigen::Map<const Eigen::VectorXd>(t.data(), t.size())),
                optional_joint_argument(object_of(posture), "posture", static_cast<int>(j.cols())),
                rotation ? rotation_argument(*rotation, "rotation") : Eigen::Matrix3d(Eigen::Matrix3d::Identity()));
            if (solution.status == Status::BadInput) throw Error("the command is too large for floating-point numbers");
            return solution;
          },
          py::arg("J"), py::arg("twist"), py::arg("posture") = py::none(), py::arg("rotation") = py::none(),
          "Joint velocities for a twist.\n\n"
          "J: (m, n), 1 ≤ m ≤ 6, 1 ≤ n ≤ 16. With six rows the mask applies; with as many rows as the mask asks "
          "for "
          "it\n"
          "    is taken as masked. Without a mask, rows from the fourth on count as angular.\n"
          "twist: (m,) [m/s, rad/s].\n"
          "posture: (n,) q̇ [rad/s or m/s], goes through the method's own projector.\n"
          "rotation: (3, 3) tip in base, needed where frame is 'tool'.\n\n"
          "Raises Error where a shape is wrong or an entry is not finite.")
      .def(
          "set_joint_weights",
          [](VelocitySolver& s, const MaybeArray& weights) {
            if (!weights) return s.set_joint_weights(JointVector());
            const Array w = array_argument(*weights, "weights", {-1}, "(n,)");
            if (w.size() > kMaxJoints) throw Error("weights has more than 16 entries");
            s.set_joint_weights(JointVector(Eigen::Map<const Eigen::VectorXd>(w.data(), w.size())));
          },
          py::arg("weights"),
          "How much each joint's motion counts: of all motions that move the tip as the rule says, the answer has the\n"
          "least Σ w_j (q̇_j − posture_j)². weights: (n,) > 0, only ratios matter; None: all 1.")
      .def("reset", &VelocitySolver::reset, "Forgets the warm start.")
      .def_property("method", &VelocitySolver::method, &VelocitySolver::set_method, "The rule; may be changed.")
      .def_property_readonly("length_scale", &VelocitySolver::length_scale, "[m]")
      .def("__repr__", [](const VelocitySolver& s) {
        return record("VelocitySolver",
                      {{"", method_to_python(s.method())}, {"length_scale", py::cast(s.length_scale())}});
      });
  bind_value(bound<VelocitySolver>(m, "VelocitySolver"));
}

void bind_batch(py::module_& m) {
  m.def(
      "solve_batch",
      [](const Method& method, const ArrayLike& jacobian, const ArrayLike& twist, double length_scale, int threads) {
        const Array j = array_argument(jacobian, "J", {-1, -1, -1}, "(B, m, n)");
        const BatchShape shape{static_cast<std::size_t>(j.shape(0)), static_cast<int>(j.shape(1)),
                               static_cast<int>(j.shape(2))};
        const std::string need = "(" + std::to_string(j.shape(0)) + ", " + std::to_string(j.shape(1)) +
                                 "), as J has (B, m)";
        const Array t = array_argument(twist, "twist", {j.shape(0), j.shape(1)}, need.c_str());
        py::array_t<double> out({j.shape(0), j.shape(2)});
        double* data = out.mutable_data();
        {
          py::gil_scoped_release release;
          solve_batch(method, length_scale, shape, j.data(), t.data(), data, nullptr, threads);
        }
        return out;
      },
      py::arg("method"), py::arg("J"), py::arg("twist"), py::arg("length_scale") = 1.0, py::arg("threads") = 1,
      "Joint velocities (B, n) for B independent problems, J (B, m, n) and twist (B, m), without the GIL.\n\n"
      "Each is solved as by a fresh VelocitySolver, to 1e-9, side by side in vector lanes. Order, B and number of "
      "threads\n"
      "do not change an answer.\n"
      "Raises Error where a shape is wrong or an entry is not finite.");
}

}  // namespace

void bind_solver(py::module_& m) {
  bind_spectrum(m);
  bind_solution(m);
  bind_velocity_solver(m);
  bind_batch(m);
}

}  // namespace sigmaik::bindings
