#include <sigmaik/least_squares.hpp>

#include "values.hpp"

namespace sigmaik::bindings {
namespace {

// A (rows, n) matrix with its (rows,) right-hand side, both or neither.
void rows_argument(const MaybeArray& matrix, const MaybeArray& right, const char* matrix_name, const char* right_name,
                   py::ssize_t most, bool infinite, py::ssize_t& n, RowMatrix& to, RowVector& to_right) {
  if (!matrix && !right) return;
  if (!matrix || !right) throw Error(std::string(matrix_name) + " and " + right_name + " must be given together");
  const Array m = array_argument(*matrix, matrix_name, {-1, n}, "(rows, n)");
  if (n < 0) n = m.shape(1);
  if (m.shape(0) > most || n < 1 || n > kMaxUnknowns) {
    throw Error(std::string(matrix_name) + " has shape " + shape_text(m) + "; at most " + std::to_string(most) +
                " rows and 1 to " + std::to_string(kMaxUnknowns) + " columns");
  }
  to = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(m.data(), m.shape(0),
                                                                                                n);
  Array r = Array::ensure(*right);
  if (!r) {
    PyErr_Clear();
    throw Error(std::string(right_name) + " is not an array of numbers");
  }
  if (!infinite) r = array_argument(*right, right_name, {m.shape(0)}, "(rows,)");
  if (r.ndim() != 1 || r.shape(0) != m.shape(0)) {
    throw Error(std::string(right_name) + " has shape " + shape_text(r) + ", " + matrix_name + " " + shape_text(m));
  }
  to_right = Eigen::Map<const Eigen::VectorXd>(r.data(), r.shape(0));
}

void bound_argument(const MaybeArray& bound, const char* name, py::ssize_t& n, UnknownVector& to) {
  if (!bound) return;
  const Array b = Array::ensure(*bound);
  if (!b || b.ndim() != 1 || (n >= 0 && b.shape(0) != n) || b.shape(0) < 1 || b.shape(0) > kMaxUnknowns) {
    PyErr_Clear();
    throw Error(std::string(name) + " must have shape (n,)" + (n >= 0 ? " = (" + std::to_string(n) + ",)" : "") +
                (b ? ", not " + shape_text(b) : std::string()));
  }
  n = b.shape(0);
  to = Eigen::Map<const Eigen::VectorXd>(b.data(), n);
}

LeastSquaresSolution solve(LeastSquares& solver, const MaybeArray& A, const MaybeArray& b, const MaybeArray& C,
                           const MaybeArray& d, const MaybeArray& lower, const MaybeArray& upper, const MaybeArray& G,
                           const MaybeArray& h) {
  LeastSquaresProblem p;
  py::ssize_t n = -1;
  rows_argument(A, b, "A", "b", kMaxObjectives, false, n, p.A, p.b);
  rows_argument(C, d, "C", "d", kMaxEqualities, false, n, p.C, p.d);
  rows_argument(G, h, "G", "h", kMaxInequalities, true, n, p.G, p.h);
  bound_argument(lower, "lower", n, p.lower);
  bound_argument(upper, "upper", n, p.upper);
  if (n < 1) throw Error("there is nothing to solve: give A and b");
  for (py::ssize_t i = 0; i < n; ++i) {
    const double low = p.lower.size() != 0 ? p.lower[i] : -INFINITY, high = p.upper.size() != 0 ? p.upper[i] : INFINITY;
    if (!(low <= high)) {
      throw Error("lower[" + std::to_string(i) + "] = " + std::to_string(low) + " must not be above upper[" +
                  std::to_string(i) + "] = " + std::to_string(high));
    }
  }
  const LeastSquaresSolution s = solver.solve(p);
  if (s.status == LeastSquaresStatus::BadInput) throw Error("an entry is NaN, infinite, or too large for numbers");
  return s;
}

}  // namespace

void bind_least_squares(py::module_& m) {
  py::class_<LeastSquaresSolution>(m, "LeastSquaresSolution", "Answer of least_squares().")
      .def_property_readonly(
          "x", [](const LeastSquaresSolution& s) { return to_numpy(s.x); }, "(n,) inside the bounds exactly")
      .def_property_readonly(
          "status", [](const LeastSquaresSolution& s) { return std::string(to_string(s.status)); },
          "'optimal'; 'infeasible': G x ≤ h or C x = d cannot be met, and is met as well as possible;\n"
          "'step limit': not converged.")
      .def_readonly("steps", &LeastSquaresSolution::steps, "Factorisations taken.")
      .def_property_readonly(
          "at_lower", [](const LeastSquaresSolution& s) { return indices(s.at_lower); },
          "Indices of the unknowns held at their lower bound.")
      .def_property_readonly(
          "at_upper", [](const LeastSquaresSolution& s) { return indices(s.at_upper); },
          "Indices of the unknowns held at their upper bound.")
      .def_property_readonly(
          "active", [](const LeastSquaresSolution& s) { return indices(s.active); },
          "Indices of the rows of G that hold the answer, or are violated.")
      .def_readonly("violation", &LeastSquaresSolution::violation, "|max(0, G x − h)|")
      .def_readonly("equality_error", &LeastSquaresSolution::equality_error, "|C x − d|")
      .def("__repr__", [](const LeastSquaresSolution& s) {
        return record("LeastSquaresSolution",
                      {{"status", py::cast(std::string(to_string(s.status)))}, {"x", to_numpy(s.x)}});
      });
  def_value(bound<LeastSquaresSolution>(m, "LeastSquaresSolution"));

  m.def(
      "least_squares",
      [](const MaybeArray& A, const MaybeArray& b, const MaybeArray& C, const MaybeArray& d, const MaybeArray& lower,
         const MaybeArray& upper, const MaybeArray& G, const MaybeArray& h) {
        LeastSquares solver;
        return solve(solver, A, b, C, d, lower, upper, G, h);
      },
      py::arg("A") = py::none(), py::arg("b") = py::none(), py::kw_only(), py::arg("C") = py::none(),
      py::arg("d") = py::none(), py::arg("lower") = py::none(), py::arg("upper") = py::none(),
      py::arg("G") = py::none(), py::arg("h") = py::none(),
      "min |A x − b|² where C x = d, lower ≤ x ≤ upper, G x ≤ h; of these the shortest x.\n\n"
      "A (m, n), b (m,), C (p, n), d (p,), lower, upper (n,), G (k, n), h (k,); n ≤ 24, m ≤ 32, p ≤ 8, k ≤ 32.\n"
      "Bounds and h may be infinite.\n\n"
      "There is always an answer: the bounds hold, then G x ≤ h as well as possible, then C x = d, then A x ≈ b.");
}

}  // namespace sigmaik::bindings
