#pragma once
// From Python's arguments to bounded vectors and back. Every refusal is a sigmaik.Error that names the argument, the
// shape it has and the shape it needs. Sizes are checked before anything is copied into a bounded type.

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include <array>
#include <optional>
#include <string>

#include <sigmaik/sigmaik.hpp>

#define SIGMAIK_HIDDEN __attribute__((visibility("hidden")))

namespace sigmaik::bindings {

namespace py = pybind11;

using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// What numpy can make an array of; the functions below check it. In the stubs: numpy.typing.ArrayLike.
class SIGMAIK_HIDDEN ArrayLike : public py::object {
 public:
  PYBIND11_OBJECT_DEFAULT(ArrayLike, py::object, any_object)

 private:
  static bool any_object(PyObject* /*object*/) { return true; }
};
using MaybeArray = std::optional<ArrayLike>;

inline py::object object_of(const MaybeArray& array) { return array ? py::object(*array) : py::none(); }

/// "(6, 7)".
std::string shape_text(const py::array& array);

/// Throws unless every entry is finite.
void require_finite(const Array& array, const char* what);

/// A finite array of the given shape; −1 matches any length.
Array array_argument(py::handle object, const char* what, std::initializer_list<py::ssize_t> shape,
                     const char* shape_name);

/// (n,) for a chain of n joints, or any size from 1 to 16 where n < 0.
JointVector joint_argument(py::handle object, const char* what, int n);

/// Like joint_argument, empty for None.
JointVector optional_joint_argument(py::handle object, const char* what, int n);

Twist twist_argument(py::handle object, const char* what);

/// 4×4, or what carries one: pinocchio's SE3 (.homogeneous), spatialmath's SE3 (.A), jaxlie's and mink's SE3
/// (.as_matrix()).
Pose pose_argument(py::handle object, const char* what);

/// 3×3, checked to be a rotation.
Eigen::Matrix3d rotation_argument(py::handle object, const char* what);

/// m×n, 1 ≤ m ≤ 6, 1 ≤ n ≤ 16.
TaskJacobian jacobian_argument(py::handle object, const char* what);

/// Six truth values, one a row of a twist.
std::array<bool, 6> rows_argument(py::handle rows, const char* what);

/// Mask (six truth values, None for all) and frame ("base" or "tool").
Task task_argument(py::handle mask, const std::string& frame);

/// A new numpy array, in C order.
template <typename Derived>
py::array_t<double> to_numpy(const Eigen::MatrixBase<Derived>& values) {
  if constexpr (Derived::ColsAtCompileTime == 1) {
    py::array_t<double> out(values.rows());
    Eigen::Map<Eigen::VectorXd>(out.mutable_data(), values.rows()) = values;
    return out;
  } else {
    py::array_t<double> out({values.rows(), values.cols()});
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(out.mutable_data(), values.rows(),
                                                                                      values.cols()) = values;
    return out;
  }
}

/// Positions of the bits that are set.
using Indices = py::typing::Tuple<py::int_, py::ellipsis>;
Indices indices(std::uint32_t bits);

void bind_status(py::module_& m);
void bind_chain(py::module_& m);
void bind_methods(py::module_& m);
void bind_solver(py::module_& m);
void bind_servo(py::module_& m);
void bind_dynamics(py::module_& m);
void bind_least_squares(py::module_& m);
void bind_constrained_ik(py::module_& m);
void bind_analytic_ik(py::module_& m);
void bind_planning(py::module_& m);

}  // namespace sigmaik::bindings

template <>
struct pybind11::detail::handle_type_name<sigmaik::bindings::ArrayLike> {
  static constexpr auto name = const_name("numpy.typing.ArrayLike");
};
