#include "arguments.hpp"

#include <cmath>

namespace sigmaik::bindings {
namespace {

[[noreturn]] void refuse_shape(const char* what, const std::string& have, const char* need) {
  throw Error(std::string(what) + " has shape " + have + ", needs " + need);
}

Array to_array(py::handle object, const char* what) {
  if (!py::isinstance<py::array>(object) || !py::isinstance<Array>(object)) {
    const py::array any = py::array::ensure(object);
    if (!any) {
      PyErr_Clear();
      throw Error(std::string(what) + " is not an array of numbers");
    }
    const char kind = any.dtype().kind();
    if (kind != 'f' && kind != 'i' && kind != 'u' && kind != 'b') {
      throw Error(std::string(what) + " holds " + py::str(any.dtype()).cast<std::string>() + ", needs real numbers");
    }
  }
  Array array = Array::ensure(object);
  if (!array) {
    PyErr_Clear();
    throw Error(std::string(what) + " is not an array of numbers");
  }
  return array;
}

}  // namespace

std::string shape_text(const py::array& array) {
  std::string text = "(";
  for (py::ssize_t i = 0; i < array.ndim(); ++i) {
    text += std::to_string(array.shape(i)) + (i + 1 < array.ndim() ? ", " : array.ndim() == 1 ? "," : "");
  }
  return text + ")";
}

void require_finite(const Array& array, const char* what) {
  const double* data = array.data();
  for (py::ssize_t i = 0; i < array.size(); ++i) {
    if (std::isfinite(data[i])) continue;
    std::string index;
    py::ssize_t rest = i;
    for (py::ssize_t axis = array.ndim() - 1; axis >= 0; --axis) {
      index = std::to_string(rest % array.shape(axis)) + (index.empty() ? "" : ", ") + index;
      rest /= array.shape(axis);
    }
    throw Error(std::string(what) + "[" + index + "] = " + py::str(py::float_(data[i])).cast<std::string>() +
                " is not finite");
  }
}

Array array_argument(py::handle object, const char* what, std::initializer_list<py::ssize_t> shape,
                     const char* shape_name) {
  Array array = to_array(object, what);
  bool fits = array.ndim() == static_cast<py::ssize_t>(shape.size());
  py::ssize_t axis = 0;
  for (const py::ssize_t length : shape) {
    fits = fits && (length < 0 || array.shape(axis) == length);
    ++axis;
  }
  if (!fits) refuse_shape(what, shape_text(array), shape_name);
  require_finite(array, what);
  return array;
}

JointVector joint_argument(py::handle object, const char* what, int n) {
  const std::string need = n < 0 ? "(n,) with 1 ≤ n ≤ 16" : "(" + std::to_string(n) + ",)";
  const Array array = array_argument(object, what, {n}, need.c_str());
  if (array.size() < 1 || array.size() > kMaxJoints) refuse_shape(what, shape_text(array), need.c_str());
  return Eigen::Map<const Eigen::VectorXd>(array.data(), array.size());
}

JointVector optional_joint_argument(py::handle object, const char* what, int n) {
  return object.is_none() ? JointVector{} : joint_argument(object, what, n);
}

Twist twist_argument(py::handle object, const char* what) {
  return Eigen::Map<const Twist>(array_argument(object, what, {6}, "(6,): [v; ω]").data());
}

Eigen::Vector3d vector_argument(py::handle object, const char* what) {
  return Eigen::Map<const Eigen::Vector3d>(array_argument(object, what, {3}, "(3,)").data());
}

Pose target_argument(py::handle object, const char* what) {
  py::object matrix = py::reinterpret_borrow<py::object>(object);
  if (!py::isinstance<py::array>(object)) {
    if (py::hasattr(object, "homogeneous")) {
      matrix = object.attr("homogeneous");
    } else if (py::hasattr(object, "as_matrix")) {
      matrix = object.attr("as_matrix")();
    } else if (py::hasattr(object, "A")) {
      matrix = object.attr("A");
    }
  }
  const Array array = array_argument(matrix, what, {4, 4}, "(4, 4)");
  Pose pose;
  pose.matrix() = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(array.data());
  return pose;
}

Pose pose_argument(py::handle object, const char* what) {
  const Pose pose = target_argument(object, what);
  const Eigen::Matrix4d m = pose.matrix();
  if (!is_pose(m)) {
    if (m.row(3) != Eigen::RowVector4d(0.0, 0.0, 0.0, 1.0)) {
      throw Error(std::string(what) + " is not a pose: its last row must be 0 0 0 1");
    }
    const Eigen::Matrix3d r = m.topLeftCorner<3, 3>();
    const double defect = (r.transpose() * r - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
    throw Error(std::string(what) + " is not a pose: its 3×3 part is not a rotation (RᵀR − I up to " +
                py::str(py::float_(defect)).cast<std::string>() + ", determinant " +
                py::str(py::float_(r.determinant())).cast<std::string>() + ")");
  }
  return pose;
}

Eigen::Matrix3d rotation_argument(py::handle object, const char* what) {
  const Array array = array_argument(object, what, {3, 3}, "(3, 3)");
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(array.data());
  if (!is_pose(m)) throw Error(std::string(what) + " is not a rotation");
  return m.topLeftCorner<3, 3>();
}

TaskJacobian jacobian_argument(py::handle object, const char* what) {
  constexpr const char* kNeed = "(m, n) with 1 ≤ m ≤ 6 and 1 ≤ n ≤ 16";
  const Array array = array_argument(object, what, {-1, -1}, kNeed);
  const auto m = array.shape(0), n = array.shape(1);
  if (m < 1 || m > kMaxTask || n < 1 || n > kMaxJoints) refuse_shape(what, shape_text(array), kNeed);
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(array.data(), m, n);
}

std::array<bool, 6> rows_argument(py::handle rows, const char* what) {
  const Array array = array_argument(rows, what, {6}, "(6,): vx vy vz ωx ωy ωz");
  std::array<bool, 6> out{};
  for (py::ssize_t i = 0; i < 6; ++i) {
    const double entry = array.data()[i];
    if (entry != 0.0 && entry != 1.0) {
      throw Error(std::string(what) + "[" + std::to_string(i) +
                  "] = " + py::str(py::float_(entry)).cast<std::string>() + " must be 0 or 1");
    }
    out[static_cast<std::size_t>(i)] = entry == 1.0;
  }
  return out;
}

Batch batch_argument(py::handle object, int n) {
  const std::string need = "(" + std::to_string(n) + ",) or (B, " + std::to_string(n) + ")";
  const py::array any = py::array::ensure(object);
  if (!any) PyErr_Clear();
  const bool many = any && any.ndim() == 2;
  return {many ? array_argument(any, "q", {-1, n}, need.c_str()) : array_argument(object, "q", {n}, need.c_str()),
          many};
}

std::string text_argument(py::handle object, const char* what) {
  Py_ssize_t size = 0;
  const char* const text = PyUnicode_AsUTF8AndSize(object.ptr(), &size);
  if (text != nullptr) return {text, static_cast<std::size_t>(size)};
  PyErr_Clear();
  throw Error(std::string(what) + " " +
              py::str(py::module_::import("builtins").attr("ascii")(object)).cast<std::string>() +
              " has a character that UTF-8 cannot encode (a lone surrogate)");
}

std::string source_argument(const py::object& object) {
  const py::object source = py::module_::import("os").attr("fspath")(object);
  return py::isinstance<py::str>(source) ? text_argument(source, "source") : source.cast<std::string>();
}

Task task_argument(py::handle mask, const std::string& frame) {
  Task task;
  if (!mask.is_none()) task.mask = rows_argument(mask, "mask");
  if (frame != "base" && frame != "tool") throw Error("frame = '" + frame + "' must be 'base' or 'tool'");
  task.frame = frame == "tool" ? Frame::Tool : Frame::Base;
  task.validate();
  return task;
}

Indices indices(std::uint32_t bits) {
  py::list out;
  for (int i = 0; i < 32; ++i) {
    if ((bits >> i & 1u) != 0) out.append(i);
  }
  return py::tuple(out);
}

std::string record(const char* name, std::initializer_list<std::pair<const char*, py::object>> values) {
  std::string text = std::string(name) + "(";
  const char* separator = "";
  for (const auto& [key, value] : values) {
    if (value.is_none()) continue;
    const bool array = py::isinstance<py::array>(value);  // str: without the word array
    text += std::string(separator) + key + (*key != '\0' ? "=" : "") +
            (array ? py::str(value) : py::repr(value)).cast<std::string>();
    separator = ", ";
  }
  return text + ")";
}

void warn(const std::vector<std::string>& sentences) {
  if (sentences.empty()) return;
  const py::object category = py::module_::import("sigmaik._core").attr("ModelWarning");
  for (const std::string& sentence : sentences) {
    if (PyErr_WarnEx(category.ptr(), sentence.c_str(), 1) != 0) throw py::error_already_set();
  }
}

}  // namespace sigmaik::bindings
