#include <sigmaik/planning/cart.hpp>
#include <sigmaik/planning/cart_plane.hpp>

#include "arguments.hpp"

namespace sigmaik::bindings {
namespace {

using planning::CartError;
using planning::CartLaw;
using planning::CartOptions;
using planning::CartRegion;
using planning::PlanarPath;
using planning::PlaneCartLaw;
using planning::PlaneCartOptions;

using Vectors = py::typing::Tuple<py::array_t<double>, py::array_t<double>>;

PlanarPath path_argument(py::handle object) {
  const Array array = array_argument(object, "flange_xy", {-1, 2}, "(M, 2)");
  return Eigen::Map<const PlanarPath>(array.data(), array.shape(0), 2);
}

// (N,) with infinities where a bound may be.
Eigen::VectorXd bounds_argument(py::handle object, const char* what) {
  const Array array = Array::ensure(object);
  if (!array) PyErr_Clear();
  if (!array || array.ndim() != 1) throw Error(std::string(what) + " must be numbers of shape (N,)");
  return Eigen::Map<const Eigen::VectorXd>(array.data(), array.shape(0));
}

// (2,) of the two axes, with infinities where a limit may be.
Eigen::Vector2d axes_argument(py::handle object, const char* what) {
  const Eigen::VectorXd values = bounds_argument(object, what);
  if (values.size() != 2) throw Error(std::string(what) + " must be numbers of shape (2,)");
  return values;
}

}  // namespace

void bind_cart(py::module_& m) {
  static const py::handle error = py::exception<CartError>(m, "CartError", m.attr("Error")).release();
  error.attr("__doc__") = "No cart motion keeps out of the forbidden region. The text carries the facts.";
  error.attr("reason") = "";
  error.attr("feasible_radius") = std::numeric_limits<double>::quiet_NaN();
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const CartError& e) {
      const py::object value = error(e.what());
      value.attr("reason") = to_string(e.fault());
      value.attr("feasible_radius") = e.feasible_radius();
      PyErr_SetObject(error.ptr(), value.ptr());
    }
  });

  py::class_<CartRegion>(m, "CartRegion",
                         "A connected part of the forbidden region, in the plane of time and cart position.")
      .def_readonly("first", &CartRegion::first, "[samples] where it begins: its tip, between samples.")
      .def_readonly("last", &CartRegion::last, "[samples] where it ends.")
      .def_readonly("side", &CartRegion::side, "1: the law passes above λ+; −1: below λ−.");

  py::class_<CartLaw>(m, "CartLaw", "Answer of cart_law().")
      .def_property_readonly(
          "x", [](const CartLaw& c) { return to_numpy(c.x); }, "(M,) [m]")
      .def_property_readonly(
          "lower", [](const CartLaw& c) { return to_numpy(c.lower); }, "(M,) [m] λ−, ∞ where nothing is forbidden.")
      .def_property_readonly(
          "upper", [](const CartLaw& c) { return to_numpy(c.upper); }, "(M,) [m] λ+, −∞ where nothing is forbidden.")
      .def_property_readonly(
          "multipliers", [](const CartLaw& c) { return to_numpy(c.multipliers); }, "(M,) [m] μ.")
      .def_readonly("regions", &CartLaw::regions, "Connected parts of the forbidden region.")
      .def_readonly("corners", &CartLaw::corners, "[samples] where the string bends, and its ends.")
      .def_readonly("corner_x", &CartLaw::corner_x, "[m] there.")
      .def_readonly("energy", &CartLaw::energy, "[m²] Σ (Δx)².")
      .def_readonly("turn", &CartLaw::turn, "[rad] of the point's azimuth.")
      .def_readonly("strings", &CartLaw::strings, "Taut strings drawn.");

  m.def(
      "cart_law",
      [](const ArrayLike& flange_xy, double start, double end, double radius, double lower, double upper, double margin,
         std::optional<double> turn, double duration, double max_speed, double max_acceleration, bool at_rest) {
        const PlanarPath path = path_argument(flange_xy);
        const CartOptions options{lower, upper, margin, turn, duration, max_speed, max_acceleration, at_rest};
        py::gil_scoped_release release;
        return planning::cart_law(path, start, end, radius, options);
      },
      py::arg("flange_xy"), py::arg("start"), py::arg("end"), py::arg("radius"), py::kw_only(), py::arg("lower"),
      py::arg("upper"), py::arg("margin"), py::arg("turn"), py::arg("duration"), py::arg("max_speed"),
      py::arg("max_acceleration"), py::arg("at_rest"),
      "The cart's law of the least energy. `sigmaik.planning.cart_motion` is what to call.");
  py::class_<PlaneCartLaw>(m, "PlaneCartLaw", "Answer of plane_cart_law().")
      .def_property_readonly(
          "c", [](const PlaneCartLaw& law) { return to_numpy(law.c); }, "(M, 2) [m]")
      .def_property_readonly(
          "push", [](const PlaneCartLaw& law) { return to_numpy(law.push); }, "(M,) [m]")
      .def_readonly("energy", &PlaneCartLaw::energy, "[m²] Σ |Δc|².")
      .def_readonly("turn", &PlaneCartLaw::turn, "[rad] of the point's azimuth.")
      .def_readonly("starts", &PlaneCartLaw::starts, "First guesses tried.")
      .def_readonly("programs", &PlaneCartLaw::programs, "Quadratic programs solved.");

  m.def(
      "plane_cart_law",
      [](const ArrayLike& flange_xy, const ArrayLike& start, const ArrayLike& end, double radius,
         const ArrayLike& lower, const ArrayLike& upper, double margin, double max_radius, std::optional<double> turn,
         double duration, const ArrayLike& max_speed, const ArrayLike& max_acceleration, bool at_rest) {
        const PlanarPath path = path_argument(flange_xy);
        const Eigen::Vector2d from = axes_argument(start, "start"), to = axes_argument(end, "end");
        PlaneCartOptions options;
        options.lower = axes_argument(lower, "lower");
        options.upper = axes_argument(upper, "upper");
        options.margin = margin;
        options.max_radius = max_radius;
        options.turn = turn;
        options.duration = duration;
        options.max_speed = axes_argument(max_speed, "max_speed");
        options.max_acceleration = axes_argument(max_acceleration, "max_acceleration");
        options.at_rest = at_rest;
        py::gil_scoped_release release;
        return planning::plane_cart_law(path, from, to, radius, options);
      },
      py::arg("flange_xy"), py::arg("start"), py::arg("end"), py::arg("radius"), py::kw_only(), py::arg("lower"),
      py::arg("upper"), py::arg("margin"), py::arg("max_radius"), py::arg("turn"), py::arg("duration"),
      py::arg("max_speed"), py::arg("max_acceleration"), py::arg("at_rest"),
      "The motion of a cart with two axes. `sigmaik.planning.cart_motion_plane` is what to call.");
  m.def(
      "forbidden_intervals",
      [](const ArrayLike& flange_xy, double radius) -> Vectors {
        planning::VectorXd lower, upper;
        planning::forbidden_intervals(path_argument(flange_xy), radius, lower, upper);
        return py::make_tuple(to_numpy(lower), to_numpy(upper));
      },
      py::arg("flange_xy"), py::arg("radius"), "λ−, λ+ (M,) [m]; ∞ and −∞ where nothing is forbidden.");
  m.def(
      "taut_string",
      [](const ArrayLike& at, const ArrayLike& lower,
         const ArrayLike& upper) -> py::typing::Tuple<py::array_t<double>, py::typing::List<py::int_>> {
        planning::VectorXd x;
        std::vector<int> corners;
        planning::taut_string(bounds_argument(at, "at"), bounds_argument(lower, "lower"),
                              bounds_argument(upper, "upper"), x, corners);
        return py::make_tuple(to_numpy(x), corners);
      },
      py::arg("at"), py::arg("lower"), py::arg("upper"),
      "The shortest string x (N,) through lower ≤ x ≤ upper over increasing `at`, and the indices of its corners.");
  m.def(
      "cart_descent",
      [](const ArrayLike& lower, const ArrayLike& upper, const ArrayLike& guess, double alpha, double step,
         int max_iterations, bool until_admissible) -> py::typing::Tuple<py::array_t<double>, py::int_> {
        const Eigen::VectorXd low = bounds_argument(lower, "lower"), high = bounds_argument(upper, "upper");
        planning::VectorXd x = bounds_argument(guess, "guess");
        int iterations = 0;
        {
          py::gil_scoped_release release;
          iterations = planning::cart_descent(
              low, high, x,
              {.alpha = alpha, .step = step, .max_iterations = max_iterations, .until_admissible = until_admissible});
        }
        return py::make_tuple(to_numpy(x), iterations);
      },
      py::arg("lower"), py::arg("upper"), py::arg("guess"), py::arg("alpha"), py::arg("step"),
      py::arg("max_iterations"), py::arg("until_admissible"),
      "Gradient descent (10) from a guess (M,) [m]: the law and the number of iterations.");
}

}  // namespace sigmaik::bindings
