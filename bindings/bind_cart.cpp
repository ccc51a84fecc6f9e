#include <sigmaik/planning/cart.hpp>
#include <sigmaik/planning/cart_motion.hpp>
#include <sigmaik/planning/cart_plane.hpp>

#include "planner_options.hpp"
#include "planning.hpp"

namespace sigmaik::bindings {
namespace {

using planning::AxisPair;
using planning::CartDescent;
using planning::CartError;
using planning::CartMeasures;
using planning::CartMotion;
using planning::CartOptions;
using planning::CartRegion;
using planning::PlanarPath;
using planning::PlaneCartMotion;
using planning::PlaneCartOptions;

using Doubles = py::array_t<double>;
using Vectors = py::typing::Tuple<Doubles, Doubles>;

PlanarPath path_argument(py::handle object) {
  const Array array = array_argument(object, "flange_xy", {-1, 2}, "(M, 2)");
  return Eigen::Map<const PlanarPath>(array.data(), array.shape(0), 2);
}

// (N,) with infinities where a bound may be.
std::vector<double> bounds_argument(py::handle object, const char* what) {
  const Array array = Array::ensure(object);
  if (!array) PyErr_Clear();
  if (!array || array.ndim() != 1) throw Error(std::string(what) + " must be numbers of shape (N,)");
  return {array.data(), array.data() + array.size()};
}

// (2,) of the two axes, with infinities where a bound may be.
AxisPair pair_argument(py::handle object, const char* what) {
  const std::vector<double> pair = bounds_argument(object, what);
  if (pair.size() != 2) throw Error(std::string(what) + " must be numbers of shape (2,)");
  return {pair[0], pair[1]};
}

std::vector<double> finite_argument(py::handle object, const char* what, std::initializer_list<py::ssize_t> shape,
                                    const char* shape_name) {
  const Array array = array_argument(object, what, shape, shape_name);
  return {array.data(), array.data() + array.size()};
}

template <typename Number>
py::array_t<Number> array_of(const std::vector<Number>& values) {
  return py::array_t<Number>(static_cast<py::ssize_t>(values.size()), values.data());
}
Doubles pairs_of(const std::vector<double>& values) {
  return Doubles({static_cast<py::ssize_t>(values.size() / 2), py::ssize_t{2}}, values.data());
}
Doubles pair_of(const AxisPair& values) { return Doubles(py::ssize_t{2}, values.data()); }

void bind_error(py::module_& m) {
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
}

// x, or xy, at times of any shape.
template <typename Motion>
Doubles sampled(const Motion& motion, const ArrayLike& t, py::ssize_t columns) {
  const Array times = Array::ensure(t);
  if (!times) {
    PyErr_Clear();
    throw Error("t must be numbers");
  }
  const std::vector<double> values = motion.sample({times.data(), times.data() + times.size()});
  std::vector<py::ssize_t> shape(times.shape(), times.shape() + times.ndim());
  if (columns > 1) shape.push_back(columns);
  return Doubles(shape, values.data());
}

std::string summary(const CartMeasures& m) {
  return py::str("{} samples, energy {:.4g} m², {}")
      .format(m.samples(), m.energy, m.admissible ? "admissible" : "not admissible")
      .cast<std::string>();
}

void bind_measures(py::module_& m) {
  py::class_<CartRegion>(m, "CartRegion",
                         "A connected part of the forbidden region, in the plane of time and cart position.")
      .def_readonly("first", &CartRegion::first, "[samples] where it begins: its tip, between samples.")
      .def_readonly("last", &CartRegion::last, "[samples] where it ends.")
      .def_readonly("side", &CartRegion::side, "1: the law passes above λ+; −1: below λ−.");
  py::class_<CartMeasures>(
      m, "CartMeasures",
      "What motions of a cart with one axis and with two have in common: M samples, evenly spaced\n"
      "in time.")
      .def_property_readonly(
          "flange_xy", [](const CartMeasures& c) { return pairs_of(c.flange_xy); },
          "(M, 2) [m] the path that was given.")
      .def_readonly("radius", &CartMeasures::radius, "[m] of the forbidden cylinder, without the margin.")
      .def_readonly("margin", &CartMeasures::margin, "[m] that was added to the radius in planning.")
      .def_readonly("duration", &CartMeasures::duration, "[s] from the first to the last sample.")
      .def_readonly(
          "energy", &CartMeasures::energy,
          "[m²] Σ |Δ|² of the cart; with a corner between samples, of the steps that it makes, each over its\n"
          "part of a sample.")
      .def_readonly("admissible", &CartMeasures::admissible, "No sample is within the radius.")
      .def_readonly("clearance", &CartMeasures::clearance,
                    "[m] the point's least distance from the first joint's axis, between the samples too.")
      .def_readonly("inside", &CartMeasures::inside, "Samples within the radius.")
      .def_readonly("turn", &CartMeasures::turn,
                    "[rad] by which the point's azimuth turns, seen from the axis: which way round, and how often.")
      .def_property_readonly(
          "t", [](const CartMeasures& c) { return array_of(c.t()); }, "(M,) [s] of the samples.")
      .def_property_readonly("time_inside", &CartMeasures::time_inside, "[s] of the samples within the radius.");
}

void bind_motion(py::module_& m) {
  py::class_<CartMotion, CartMeasures>(
      m, "CartMotion",
      "Where the cart is at each of M samples evenly spaced in time, and what it had to keep out of. Straight between\n"
      "samples, but where `corners` has one between two of them: at the tip of a forbidden region.")
      .def_property_readonly(
          "x", [](const CartMotion& c) { return array_of(c.x); }, "(M,) [m] of the cart.")
      .def_property_readonly(
          "lower", [](const CartMotion& c) { return array_of(c.lower); },
          "(M,) [m] λ−: between it and `upper` the cart is not allowed, at radius + margin; inf where it is free.")
      .def_property_readonly(
          "upper", [](const CartMotion& c) { return array_of(c.upper); }, "(M,) [m] λ+; −inf where the cart is free.")
      .def_property_readonly(
          "sides", [](const CartMotion& c) { return array_of(c.sides); },
          "(M,) 1 where the cart is above a forbidden interval, −1 below, 0 where there is none, or it is inside.")
      .def_property_readonly(
          "regions",
          [](const CartMotion& c) {
            return py::typing::Tuple<CartRegion, py::ellipsis>(py::tuple(py::cast(c.regions)));
          },
          "Connected parts of the forbidden region, with their sides; empty where `method` is not 'exact'.")
      .def_property_readonly(
          "corners", [](const CartMotion& c) { return array_of(c.corners); },
          "(K,) [samples] where the law bends, and its ends.")
      .def_property_readonly(
          "corner_x", [](const CartMotion& c) { return array_of(c.corner_x); }, "(K,) [m] there.")
      .def_property_readonly(
          "multipliers",
          [](const CartMotion& c) -> std::optional<Doubles> {
            if (c.multipliers.empty()) return std::nullopt;
            return array_of(c.multipliers);
          },
          "(M,) [m] μ_i = 2x_i − x_{i−1} − x_{i+1} of the exact law: > 0 only where it is held up by λ+ or the cart's\n"
          "range, < 0 only where it is held down, 0 elsewhere (not where the acceleration is limited); else None.")
      .def_readonly("method", &CartMotion::method, "'exact' or 'gradient'; 'given' for a law that was only looked at.")
      .def_readonly("iterations", &CartMotion::iterations, "Steps of the gradient descent, or taut strings drawn.")
      .def_property_readonly("max_speed", &CartMotion::max_speed, "[m/s]")
      .def_property_readonly("max_acceleration", &CartMotion::max_acceleration,
                             "[m/s²], the largest second difference over the samples.")
      .def(
          "sample", [](const CartMotion& c, const ArrayLike& t) { return sampled(c, t, 1); }, py::arg("t"),
          "x (…) [m] at times t (…) [s], held at the ends.")
      .def("__repr__", [](const CartMotion& c) { return "CartMotion(" + c.method + ", " + summary(c) + ")"; });
}

void bind_plane_motion(py::module_& m) {
  py::class_<PlaneCartMotion, CartMeasures>(
      m, "PlaneCartMotion",
      "Where a cart with two axes is at each of M samples evenly spaced in time, straight between them.")
      .def_property_readonly(
          "xy", [](const PlaneCartMotion& c) { return pairs_of(c.xy); }, "(M, 2) [m] of the cart.")
      .def_property_readonly(
          "push",
          [](const PlaneCartMotion& c) -> std::optional<Doubles> {
            if (c.push.empty()) return std::nullopt;
            return array_of(c.push);
          },
          "(M,) [m] ≥ 0, |2c_i − c_{i−1} − c_{i+1}| where the cart c touches the disc about the point, away from it,\n"
          "else 0. At an optimum without limits the cart bends nowhere else. None for a motion that was only looked "
          "at.")
      .def_readonly("farthest", &PlaneCartMotion::farthest, "[m] the point's largest distance from the axis.")
      .def_readonly("starts", &PlaneCartMotion::starts, "First guesses tried.")
      .def_readonly("programs", &PlaneCartMotion::programs, "Quadratic programs solved.")
      .def_property_readonly(
          "max_speed", [](const PlaneCartMotion& c) { return pair_of(c.max_speed()); }, "(2,) [m/s] of each axis.")
      .def_property_readonly(
          "max_acceleration", [](const PlaneCartMotion& c) { return pair_of(c.max_acceleration()); },
          "(2,) [m/s²] of each axis, the largest second differences over the samples.")
      .def(
          "sample", [](const PlaneCartMotion& c, const ArrayLike& t) { return sampled(c, t, 2); }, py::arg("t"),
          "xy (…, 2) [m] at times t (…) [s], held at the ends.")
      .def("__repr__", [](const PlaneCartMotion& c) { return "PlaneCartMotion(" + summary(c) + ")"; });
}

constexpr std::tuple kLine{parameter<ArrayLike>("flange_xy"),
                           parameter<double>("start"),
                           parameter<double>("end"),
                           parameter<double>("radius"),
                           parameter<double>("lower", "[m] of the cart's range."),
                           parameter<double>("upper", "[m] of the cart's range.")};

void bind_line_laws(py::module_& m) {
  def_function<CartOptions>(m, "cart_motion", kLine, 0,
                            "The exact law. `sigmaik.planning.cart_motion` is what to call.",
                            [](const ArrayLike& flange_xy, double start, double end, double radius_, double lower,
                               double upper, CartOptions options) {
                              const PlanarPath path = path_argument(flange_xy);
                              options.lower = lower, options.upper = upper;
                              py::gil_scoped_release release;
                              return planning::cart_motion(path, start, end, radius_, options);
                            });
  def_function<CartOptions>(
      m, "admissible_guess", kLine, 0,
      "A first guess (M,) of the descent that jumps past the forbidden region, on the sides of the exact law.",
      [](const ArrayLike& flange_xy, double start, double end, double radius_, double lower, double upper,
         CartOptions options) {
        options.lower = lower, options.upper = upper;
        return array_of(planning::admissible_guess(path_argument(flange_xy), start, end, radius_, options));
      });
  m.def(
      "cart_motion_by_descent",
      [](const ArrayLike& flange_xy, double start, double end, double radius_, double alpha, double step,
         int max_iterations, const std::optional<ArrayLike>& guess, double margin, double duration) {
        const PlanarPath path = path_argument(flange_xy);
        std::vector<double> from;
        if (guess) from = finite_argument(*guess, "first_guess", {path.rows()}, "(M,)");
        const CartOptions options{.margin = margin, .duration = duration};
        const CartDescent descent{.alpha = alpha, .step = step, .max_iterations = max_iterations};
        py::gil_scoped_release release;
        return planning::cart_motion_by_descent(path, start, end, radius_, options, descent, std::move(from));
      },
      py::arg("flange_xy"), py::arg("start"), py::arg("end"), py::arg("radius"), py::kw_only(), py::arg("alpha"),
      py::arg("step"), py::arg("max_iterations"), py::arg("guess") = py::none(),
      py::arg("margin") = CartOptions{}.margin, py::arg("duration") = CartOptions{}.duration,
      "The law of the gradient descent. `sigmaik.planning.cart_motion` is what to call.");
}

void bind_plane_laws(py::module_& m) {
  def_function<PlaneCartOptions>(
      m, "plane_cart_motion",
      std::tuple{parameter<ArrayLike>("flange_xy"), parameter<ArrayLike>("start"), parameter<ArrayLike>("end"),
                 parameter<double>("radius"), parameter<ArrayLike>("lower", "(2,) [m] of the axes' ranges."),
                 parameter<ArrayLike>("upper", "(2,) [m] of the axes' ranges.")},
      0, "The motion with two axes. `sigmaik.planning.cart_motion_plane` is what to call.",
      [](const ArrayLike& flange_xy, const ArrayLike& start, const ArrayLike& end, double radius_,
         const ArrayLike& lower, const ArrayLike& upper, PlaneCartOptions options) {
        const PlanarPath path = path_argument(flange_xy);
        const AxisPair from = pair_argument(start, "start"), to = pair_argument(end, "end");
        options.lower = pair_argument(lower, "lower"), options.upper = pair_argument(upper, "upper");
        py::gil_scoped_release release;
        return planning::plane_cart_motion(path, from, to, radius_, options);
      });
}

void bind_evaluation(py::module_& m) {
  m.def(
      "evaluate_cart_motion",
      [](const ArrayLike& flange_xy, const ArrayLike& x, double radius_, double margin, double duration) {
        const PlanarPath samples = path_argument(flange_xy);
        return planning::evaluate_cart_motion(samples, finite_argument(x, "x", {samples.rows()}, "(M,)"), radius_,
                                              margin, duration);
      },
      py::arg("flange_xy"), py::arg("x"), py::arg("radius"), py::kw_only(), py::arg("margin") = 0.0,
      py::arg("duration") = 1.0,
      "Any law x (M,) [m] of the cart, such as the linear one, looked at as `cart_motion` does.");
  m.def(
      "evaluate_cart_motion_plane",
      [](const ArrayLike& flange_xy, const ArrayLike& xy, double radius_, double margin, double duration) {
        const PlanarPath samples = path_argument(flange_xy);
        return planning::evaluate_plane_cart_motion(samples, finite_argument(xy, "xy", {samples.rows(), 2}, "(M, 2)"),
                                                    radius_, margin, duration);
      },
      py::arg("flange_xy"), py::arg("xy"), py::arg("radius"), py::kw_only(), py::arg("margin") = 0.0,
      py::arg("duration") = 1.0,
      "Any motion xy (M, 2) [m] of the cart, such as the straight one, looked at as `cart_motion_plane` does.");
}

void bind_parts(py::module_& m) {
  m.def(
      "forbidden_intervals",
      [](const ArrayLike& flange_xy, double radius_) -> Vectors {
        std::vector<double> lower, upper;
        planning::forbidden_intervals(path_argument(flange_xy), radius_, lower, upper);
        return py::make_tuple(array_of(lower), array_of(upper));
      },
      py::arg("flange_xy"), py::arg("radius"), "λ−, λ+ (M,) [m]; ∞ and −∞ where nothing is forbidden.");
  m.def(
      "taut_string",
      [](const ArrayLike& at, const ArrayLike& lower,
         const ArrayLike& upper) -> py::typing::Tuple<Doubles, py::typing::List<py::int_>> {
        std::vector<double> x;
        std::vector<int> corners;
        planning::taut_string(bounds_argument(at, "at"), bounds_argument(lower, "lower"),
                              bounds_argument(upper, "upper"), x, corners);
        return py::make_tuple(array_of(x), corners);
      },
      py::arg("at"), py::arg("lower"), py::arg("upper"),
      "The shortest string x (N,) through lower ≤ x ≤ upper over increasing `at`, and the indices of its corners.");
  m.def(
      "cart_descent",
      [](const ArrayLike& lower, const ArrayLike& upper, const ArrayLike& guess, double alpha, double step,
         int max_iterations, bool until_admissible) -> py::typing::Tuple<Doubles, py::int_> {
        const std::vector<double> low = bounds_argument(lower, "lower"), high = bounds_argument(upper, "upper");
        std::vector<double> x = bounds_argument(guess, "guess");
        int iterations = 0;
        {
          py::gil_scoped_release release;
          iterations = planning::cart_descent(
              low, high, x,
              {.alpha = alpha, .step = step, .max_iterations = max_iterations, .until_admissible = until_admissible});
        }
        return py::make_tuple(array_of(x), iterations);
      },
      py::arg("lower"), py::arg("upper"), py::arg("guess"), py::arg("alpha"), py::arg("step"),
      py::arg("max_iterations"), py::arg("until_admissible"),
      "Gradient descent (10) from a guess (M,) [m]: the law and the number of iterations.");
}

}  // namespace

void bind_cart(py::module_& m) {
  bind_error(m);
  bind_measures(m);
  bind_motion(m);
  bind_plane_motion(m);
  bind_line_laws(m);
  bind_plane_laws(m);
  bind_evaluation(m);
  bind_parts(m);
}

}  // namespace sigmaik::bindings
