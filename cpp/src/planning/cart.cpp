#include <sigmaik/planning/cart.hpp>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "../message.hpp"
#include "../numbers.hpp"
#include "band_qp.hpp"
#include "cart_grid.hpp"
#include "cart_sides.hpp"

namespace sigmaik::planning {
namespace {

using sigmaik::detail::message;
using sigmaik::detail::require;

using sigmaik::detail::kInfinity;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kLongest = 1e6;  // times the duration: the search for a duration with a law ends here

double top_speed(const CartLaw& law, double dt) {
  double top = 0.0;
  for (std::size_t c = 0; c + 1 < law.corners.size(); ++c) {
    top = std::max(top, std::abs(law.corner_x[c + 1] - law.corner_x[c]) / (law.corners[c + 1] - law.corners[c]));
  }
  return top / dt;
}

// The largest acceleration between samples; with at_rest, also at the start from rest and at the stop.
double top_acceleration(const std::vector<double>& x, double dt, bool at_rest) {
  const std::size_t m = x.size();
  double top = at_rest ? std::max(std::abs(x[1] - x[0]), std::abs(x[m - 1] - x[m - 2])) : 0.0;
  for (std::size_t i = 1; i + 1 < m; ++i) top = std::max(top, std::abs(x[i + 1] - 2.0 * x[i] + x[i - 1]));
  return top / (dt * dt);
}

// The law of the least energy on the sides of `law`, within speed and acceleration [m per sample, m per sample²].
// Returns false if no such law exists.
bool accelerate(const PlanarPath& path, double r, const CartOptions& options, double speed, double acceleration,
                CartLaw& law) {
  const detail::Grid grid = detail::make_grid(path, r);
  const int m = static_cast<int>(law.x.size());
  if (m < 3) return false;
  std::vector<BandRow> rows;
  std::size_t j = 0;
  for (std::size_t k = 0; k < grid.at.size(); ++k) {
    while (j < grid.extents.size() && grid.extents[j].last < static_cast<int>(k)) ++j;
    double lower = options.lower, upper = options.upper;
    if (j < grid.extents.size() && grid.extents[j].first <= static_cast<int>(k)) {
      if (law.regions[j].side > 0) lower = std::max(lower, grid.points[k].upper);
      if (law.regions[j].side < 0) upper = std::min(upper, grid.points[k].lower);
    }
    const double at = std::floor(grid.at[k]), f = grid.at[k] - at;
    const int i = static_cast<int>(at);
    if (f > 0.0) {
      rows.push_back({i, 2, {1.0 - f, f, 0.0}, lower, upper});
    } else if (i > 0 && i + 1 < m) {
      rows.push_back({i, 1, {1.0, 0.0, 0.0}, lower, upper});
    }
  }
  for (int i = 0; i + 2 < m; ++i) rows.push_back({i, 3, {1.0, -2.0, 1.0}, -acceleration, acceleration});
  for (int i = 0; i + 1 < m; ++i) {
    double most = speed;
    if (options.at_rest && (i == 0 || i + 2 == m)) most = std::min(most, acceleration);
    if (most < kInfinity) rows.push_back({i, 2, {-1.0, 1.0, 0.0}, -most, most});
  }
  std::vector<double> x = law.x;
  if (!BandQp<1>(std::move(rows)).solve(x)) return false;
  const Eigen::Map<const Eigen::VectorXd> solved(x.data(), m);
  law.energy = (solved.tail(m - 1) - solved.head(m - 1)).squaredNorm();
  for (std::size_t i = 1; i + 1 < x.size(); ++i) law.multipliers[i] = 2.0 * x[i] - x[i - 1] - x[i + 1];
  law.x = x;
  law.corners.resize(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) law.corners[i] = static_cast<double>(i);
  law.corner_x = std::move(x);
  return true;
}

// Finds the limit that excludes every motion: the first limit without which there is a motion.
void explain(const PlanarPath& path, double start, double end, double r, const CartOptions& options,
             detail::Outcome& out) {
  CartOptions o = options;
  o.max_speed = kInfinity;
  detail::Outcome without = detail::best_sides(path, start, end, r, o);
  if (!without.fault) {
    const double speed = top_speed(without.law, options.duration / static_cast<double>(path.rows() - 1));
    out.fault = CartFault::Speed;
    out.facts = message("every way is faster than the cart's ", options.max_speed, " m/s: the shortest needs ", speed,
                        " m/s, or a duration of ", options.duration * speed / options.max_speed, " s");
    return;
  }
  if (*without.fault == CartFault::Undecided) {
    out = std::move(without);
    return;
  }
  o = options;
  o.lower = -kInfinity;
  o.upper = kInfinity;
  without = detail::best_sides(path, start, end, r, o);
  if (!without.fault) {
    out.fault = CartFault::Range;
    out.facts = message("a turn of ", options.turn.value_or(kNaN), " rad needs the cart from ",
                        *std::min_element(without.law.x.begin(), without.law.x.end()), " to ",
                        *std::max_element(without.law.x.begin(), without.law.x.end()), " m, out of its range [",
                        options.lower, ", ", options.upper, "] m");
    return;
  }
  out.fault = CartFault::Winding;
  out.facts = message("no way turns the point about the first joint's axis by ", options.turn.value_or(kNaN),
                      " rad, to within half a turn");
  o = options;
  o.turn.reset();
  without = detail::best_sides(path, start, end, r, o);
  if (!without.fault) out.facts += message("; the shortest turns it by ", without.law.turn, " rad");
}

// The largest radius with a law: a smaller circle forbids less. NaN if 1e-9 of the radius is still too much.
double feasible_radius(const PlanarPath& path, double start, double end, double radius, const CartOptions& options) {
  const auto feasible = [&](double r) {
    return !detail::best_sides(path, start, end, r + options.margin, options).fault;
  };
  double good = 1e-9 * radius, bad = radius;
  if (!feasible(good)) return kNaN;
  for (int i = 0; i < 60 && bad - good > 1e-10 * radius; ++i) {
    const double middle = 0.5 * (good + bad);
    (feasible(middle) ? good : bad) = middle;
  }
  return good;
}

void check(const PlanarPath& path, double start, double end, double radius, const CartOptions& o) {
  require(path.rows() >= 2, "the path has ", path.rows(), " samples; it needs at least 2");
  require(path.allFinite(), "the path must be finite");
  require(std::isfinite(radius) && radius > 0.0, "radius = ", radius, " m must be finite and greater than 0");
  require(std::isfinite(o.margin) && o.margin >= 0.0, "margin = ", o.margin, " m must be finite and not negative");
  require(o.lower < o.upper, "the cart's range [", o.lower, ", ", o.upper, "] m is empty");
  for (const auto& [name, value] : {std::pair{"start", start}, std::pair{"end", end}}) {
    require(std::isfinite(value), name, " = ", value, " must be finite");
    require(value >= o.lower && value <= o.upper, name, " = ", value, " m is out of the cart's range [", o.lower, ", ",
            o.upper, "] m");
  }
  require(!o.turn || std::abs(*o.turn) <= 1e6, "turn = ", o.turn.value_or(kNaN), " rad must be within a million");
  require(std::isfinite(o.duration) && o.duration > 0.0, "duration = ", o.duration,
          " s must be finite and greater than 0");
  require(o.max_speed > 0.0, "max_speed = ", o.max_speed, " m/s must be greater than 0");
  require(o.max_acceleration > 0.0, "max_acceleration = ", o.max_acceleration, " m/s² must be greater than 0");
  require(o.max_strings >= 1, "max_strings = ", o.max_strings, " must be at least 1");
}

}  // namespace

const char* to_string(CartFault fault) noexcept {
  switch (fault) {
    case CartFault::StartInside: return "start inside";
    case CartFault::EndInside: return "end inside";
    case CartFault::OppositeSides: return "opposite sides";
    case CartFault::Range: return "range";
    case CartFault::Winding: return "winding";
    case CartFault::Speed: return "speed";
    case CartFault::Acceleration: return "acceleration";
    case CartFault::Undecided: return "undecided";
  }
  return "?";
}

CartLaw cart_law(const PlanarPath& path, double start, double end, double radius, const CartOptions& options) {
  check(path, start, end, radius, options);
  const double r = radius + options.margin, dt = options.duration / static_cast<double>(path.rows() - 1);
  detail::Outcome out = detail::best_sides(path, start, end, r, options);
  if (!out.fault) {
    if (top_acceleration(out.law.x, dt, options.at_rest) <= options.max_acceleration) return std::move(out.law);
    // A longer duration only widens the limits per sample.
    const auto within = [&](double longer) {
      constexpr double kInside = 1.0 - 1e-9;
      const double step = longer * dt;
      return accelerate(path, r, options, kInside * options.max_speed * step,
                        kInside * options.max_acceleration * step * step, out.law);
    };
    if (within(1.0)) return std::move(out.law);
    double good = 2.0, bad = 1.0;
    while (good < kLongest && !within(good)) {
      bad = good;
      good *= 2.0;
    }
    for (int i = 0; i < 5 && good < kLongest; ++i) {
      const double middle = 0.5 * (good + bad);
      (within(middle) ? good : bad) = middle;
    }
    throw CartError(
        CartFault::Acceleration, kNaN,
        message("no cart motion (acceleration): on the sides of the shortest way none keeps to ",
                options.max_acceleration, " m/s²", options.at_rest ? " from rest to rest" : "",
                good < kLongest ? message("; a duration of ", good * options.duration, " s would do") : ""));
  }
  if (*out.fault == CartFault::Winding) explain(path, start, end, r, options, out);
  const double feasible = *out.fault == CartFault::Undecided ? kNaN
                                                             : feasible_radius(path, start, end, radius, options);
  std::string text = message("no cart motion (", to_string(*out.fault), "): ", out.facts);
  if (std::isfinite(feasible)) {
    text += message("; with a radius up to ", feasible, " m there is one");
  } else if (*out.fault != CartFault::Undecided) {
    text += "; no smaller radius helps";
  }
  throw CartError(*out.fault, feasible, text);
}

}  // namespace sigmaik::planning
