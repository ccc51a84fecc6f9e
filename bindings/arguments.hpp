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
#include <utility>
#include <vector>

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

/// The text of a str. Throws where UTF-8 cannot encode a character: Python's texts can hold lone surrogates.
std::string text_argument(py::handle object, const char* what);

/// The path, or the text, that a str or an os.PathLike holds.
std::string source_argument(const py::object& object);

/// An argument that is a str, without lone surrogates.
struct Text {
  std::string value;
  operator const std::string&() const noexcept { return value; }
  bool operator<(const Text& other) const noexcept { return value < other.value; }
};

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

/// (3,)
Eigen::Vector3d vector_argument(py::handle object, const char* what);

/// 4×4, or what carries one: pinocchio's SE3 (.homogeneous), spatialmath's SE3 (.A), jaxlie's and mink's SE3
/// (.as_matrix()).
Pose pose_argument(py::handle object, const char* what);

/// The same, but a finite 4×4 matrix that is no pose is taken as it is: the cycle refuses it with a status.
Pose target_argument(py::handle object, const char* what);

/// 3×3, checked to be a rotation.
Eigen::Matrix3d rotation_argument(py::handle object, const char* what);

/// m×n, 1 ≤ m ≤ 6, 1 ≤ n ≤ 16.
TaskJacobian jacobian_argument(py::handle object, const char* what);

/// Six truth values, one a row of a twist.
std::array<bool, 6> rows_argument(py::handle rows, const char* what);

/// Mask (six truth values, None for all) and frame ("base" or "tool").
Task task_argument(py::handle mask, const std::string& frame);

/// Finite joint positions: one (n,), or many (B, n).
struct SIGMAIK_HIDDEN Batch {
  Array q;
  bool many;
  py::ssize_t count() const { return many ? q.shape(0) : 1; }
};
Batch batch_argument(py::handle object, int n);

/// A new numpy array, in C order.
template <typename Derived>
py::array_t<double> to_numpy(const Eigen::MatrixBase<Derived>& values) {
  if constexpr (Derived::ColsAtCompileTime == 1) {
    py::array_t<double> out(values.rows());
    Eigen::Map<Eigen::VectorXd>(out.mutable_data(), values.rows()) = values;
    return out;
  } else {
    py::array_t<double> out({values.rows(), values.cols()});
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
        out.mutable_data(), values.rows(), values.cols()) = values;
    return out;
  }
}

/// Calls fill(q, out) for q (n,), or for every row of q (B, n) without the GIL; `shape` is that of one result.
template <typename Fill>
py::array_t<double> map_configurations(int n, const py::object& object, std::vector<py::ssize_t> shape, Fill fill) {
  const Batch batch = batch_argument(object, n);
  const py::ssize_t count = batch.count();
  py::ssize_t size = 1;
  for (const py::ssize_t length : shape) size *= length;
  if (batch.many) shape.insert(shape.begin(), count);
  py::array_t<double> out(shape);
  double* data = out.mutable_data();
  const double* from = batch.q.data();
  {
    py::gil_scoped_release release;
    for (py::ssize_t b = 0; b < count; ++b) {
      fill(JointVector(Eigen::Map<const Eigen::VectorXd>(from + b * n, n)), data + b * size);
    }
  }
  return out;
}

/// A number for an array of no dimensions, else the array.
using NumberOrArray = py::typing::Union<py::float_, py::array_t<double>>;
inline NumberOrArray number_or_array(const py::array_t<double>& array) {
  if (array.ndim() == 0) return NumberOrArray(py::float_(*array.data()));
  return NumberOrArray(array);
}

/// Texts.
using Strings = py::typing::Tuple<py::str, py::ellipsis>;

/// Positions of the bits that are set.
using Indices = py::typing::Tuple<py::int_, py::ellipsis>;
Indices indices(std::uint32_t bits);

/// sigmaik.Method: the base class of every rule in Python. It has no C++ type: a rule is a plain struct.
class SIGMAIK_HIDDEN MethodClass {};

/// A rule, or the name of one with its parameters: "jparse:gamma=0.1".
/// \throws Error with the names, where there is no such method or parameter, and where the object is neither
bool load_method(py::handle object, Method& method);

py::object method_to_python(const Method& method);

/// "NAME(KEY=VALUE, …)" for __repr__; an empty key gives the value alone, and None is left out.
std::string record(const char* name, std::initializer_list<std::pair<const char*, py::object>> values);

/// Python's warnings, of the category sigmaik.ModelWarning, at the line that called us. Throws where the user made
/// errors of them.
void warn(const std::vector<std::string>& sentences);

void bind_status(py::module_& m);
void bind_chain(py::module_& m);
void bind_methods(py::module_& m);
void bind_solver(py::module_& m);
void bind_collisions(py::module_& m);
void bind_servo(py::module_& m);
void bind_servo_batch(py::module_& m);
void bind_servo_loop(py::module_& m);
void bind_target_stream(py::module_& m);
void bind_action_chunks(py::module_& m);
void bind_dynamics(py::module_& m);
void bind_least_squares(py::module_& m);
void bind_constrained_ik(py::module_& m);
void bind_analytic_ik(py::module_& m);
void bind_position_ik(py::module_& m);
void bind_indices(py::module_& m);
void bind_singularities(py::module_& m);

}  // namespace sigmaik::bindings

template <>
struct pybind11::detail::handle_type_name<sigmaik::bindings::ArrayLike> {
  static constexpr auto name = const_name("numpy.typing.ArrayLike");
};

/// Wherever a method is an argument, its name is accepted.
template <>
struct pybind11::detail::type_caster<sigmaik::Method> {
  PYBIND11_TYPE_CASTER(sigmaik::Method, io_name("sigmaik._core.Method | str", "sigmaik._core.Method"));

  bool load(handle object, bool /*convert*/) { return sigmaik::bindings::load_method(object, value); }
  static handle cast(const sigmaik::Method& method, return_value_policy /*policy*/, handle /*parent*/) {
    return sigmaik::bindings::method_to_python(method).release();
  }
};

namespace pybind11::detail {

template <>
struct type_caster<sigmaik::bindings::Text> {
  PYBIND11_TYPE_CASTER(sigmaik::bindings::Text, const_name("str"));

  bool load(handle object, bool /*convert*/) {
    if (!isinstance<str>(object)) return false;
    value.value = sigmaik::bindings::text_argument(object, "the text");
    return true;
  }
};

}  // namespace pybind11::detail
