#include <sigmaik/indices.hpp>

#include "arguments.hpp"

namespace sigmaik::bindings {
namespace {

Index index_argument(const std::string& text) {
  std::string names;
  for (const Index index :
       {Index::Manipulability, Index::ConditionNumber, Index::MinSingularValue, Index::GeometryAware}) {
    if (text == to_string(index)) return index;
    names += std::string(names.empty() ? "'" : "', '") + to_string(index);
  }
  throw Error("index = '" + text + "' must be one of " + names + "'");
}

// k: a number, or a symmetric positive definite Σ (m, m).
IndexFunction function_argument(const std::string& index, const ArrayLike& k, double length_scale) {
  IndexOptions options;
  options.length_scale = length_scale;
  const Array array = Array::ensure(k);
  if (!array) {
    PyErr_Clear();
    throw Error("k must be a number or a matrix Σ (m, m)");
  }
  require_finite(array, "k");
  if (array.ndim() == 0) {
    options.k = *array.data();
  } else {
    const auto m = array.ndim() == 2 ? array.shape(0) : 0;
    if (m < 1 || m > kMaxTask || array.shape(1) != m) {
      throw Error("k has shape " + shape_text(array) + "; it must be a number or a matrix Σ (m, m), m at most 6");
    }
    options.sigma = Eigen::Map<const Eigen::MatrixXd>(array.data(), m, m).transpose();
  }
  return IndexFunction(index_argument(index), options);
}

// An index of J (m, n), or of every J of J (B, m, n).
NumberOrArray index_of_jacobian(const ArrayLike& jacobian, const Text& index, const ArrayLike& k, double length_scale) {
  const IndexFunction function = function_argument(index, k, length_scale);
  const auto of = [&function](const TaskJacobian& j) {
    if (function.rows() != 0 && function.rows() != j.rows()) {
      throw Error("Σ is for " + std::to_string(function.rows()) + " rows, J has " + std::to_string(j.rows()));
    }
    return function.value(j);
  };
  py::array any = py::array::ensure(jacobian);
  if (!any) PyErr_Clear();
  if (!any || any.ndim() != 3) return NumberOrArray(py::float_(of(jacobian_argument(jacobian, "J"))));
  const Array all = array_argument(any, "J", {-1, -1, -1}, "(m, n) or (B, m, n)");
  const auto count = all.shape(0), rows = all.shape(1), cols = all.shape(2);
  if (rows < 1 || rows > kMaxTask || cols < 1 || cols > kMaxJoints) {
    throw Error("J has shape " + shape_text(all) + ", needs (B, m, n) with 1 ≤ m ≤ 6 and 1 ≤ n ≤ 16");
  }
  py::array_t<double> out(count);
  double* data = out.mutable_data();
  if (count > 0) of(TaskJacobian::Zero(rows, cols));  // refuses before the GIL is let go
  {
    py::gil_scoped_release release;
    for (py::ssize_t b = 0; b < count; ++b) {
      data[b] = function.value(
          TaskJacobian(Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
              all.data() + b * rows * cols, rows, cols)));
    }
  }
  return NumberOrArray(out);
}

// Values and gradients of an index at q (n,), or (B, n).
py::typing::Tuple<py::array_t<double>, py::array_t<double>> evaluate_index(const Chain& chain, const ArrayLike& q,
                                                                           const Text& index, const ArrayLike& k,
                                                                           double length_scale, int threads,
                                                                           bool gradients) {
  const IndexFunction function = function_argument(index, k, length_scale);
  if (function.rows() != 0 && function.rows() != 6) throw Error("Σ must be (6, 6) for a chain");
  const int n = chain.dof();
  const Batch batch = batch_argument(q, n);
  const py::ssize_t count = batch.count();
  py::array_t<double> value(batch.many ? std::vector<py::ssize_t>{count} : std::vector<py::ssize_t>{});
  const py::ssize_t columns = gradients ? n : 0;
  py::array_t<double> gradient(batch.many ? std::vector<py::ssize_t>{count, columns}
                                          : std::vector<py::ssize_t>{columns});
  double* to = value.mutable_data();
  double* slope = gradients ? gradient.mutable_data() : nullptr;
  {
    py::gil_scoped_release release;
    evaluate(chain, function, static_cast<std::size_t>(count), batch.q.data(), to, slope, threads);
  }
  return py::make_tuple(value, gradient);
}

}  // namespace

void bind_indices(py::module_& m) {
  m.attr("DEFAULT_SCALE") = kDefaultScale;
  m.def("index_of_jacobian", &index_of_jacobian, py::arg("J"), py::arg("index"), py::arg("k") = kDefaultScale,
        py::arg("length_scale") = 1.0, "An index of J (m, n), or (B,) of J (B, m, n).");
  m.def("evaluate_index", &evaluate_index, py::arg("chain"), py::arg("q"), py::arg("index"),
        py::arg("k") = kDefaultScale, py::arg("length_scale") = 1.0, py::arg("threads") = 1,
        py::arg("gradients") = true,
        "Values () or (B,) and, where asked for, gradients (n,) or (B, n) at q (n,) or (B, n).");
  m.def(
      "reference_scale", &reference_scale, py::arg("chain"), py::arg("length_scale") = 1.0,
      "k of a chain: 6 where the largest eigenvalue of JJᵀ over its joint ranges stays below that by a tenth, else "
      "1.1\n"
      "times that eigenvalue, so that the sphere kI holds every ellipsoid. The same on every machine; takes a few ms.");
}

}  // namespace sigmaik::bindings
