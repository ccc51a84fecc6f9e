#include <sigmaik/planning/cart_plane.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "../message.hpp"
#include "plane_search.hpp"

namespace sigmaik::planning {
namespace {

using detail::energy_of;
using detail::kInfinity;
using detail::kPrograms;
using detail::kSettled;
using detail::Limits;
using detail::turn_of;
using Eigen::Vector2d;
using sigmaik::detail::message;
using sigmaik::detail::require;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr int kNearer = 5;        // programs for the limits of one longer duration
constexpr int kTightenings = 10;  // longer durations that are tried
constexpr double kLongest = 1e6;  // times the duration: the search for a duration with a motion ends here

// Whether speed and acceleration [per sample] are within limits.
bool keeps(const PlanarPath& c, const Limits& limits, bool at_rest) {
  const auto m = c.rows();
  const PlanarPath step = c.bottomRows(m - 1) - c.topRows(m - 1);
  const PlanarPath bend = step.bottomRows(m - 2) - step.topRows(m - 2);
  for (const int axis : {0, 1}) {
    if (step.col(axis).cwiseAbs().maxCoeff() > limits.speed[axis] * (1.0 + 1e-12)) return false;
    if (bend.col(axis).cwiseAbs().maxCoeff() > limits.acceleration[axis]) return false;
    if (at_rest && std::max(std::abs(step(0, axis)), std::abs(step(m - 2, axis))) > limits.acceleration[axis])
      return false;
  }
  return true;
}

void check(const PlanarPath& path, const AxisPair& start, const AxisPair& end, double radius,
           const PlaneCartOptions& o) {
  require(path.rows() >= 3, "the path has ", path.rows(), " samples; it needs at least 3");
  require(path.allFinite(), "the path must be finite");
  require(std::isfinite(radius) && radius > 0.0, "radius = ", radius, " m must be finite and greater than 0");
  require(std::isfinite(o.margin) && o.margin >= 0.0, "margin = ", o.margin, " m must be finite and not negative");
  require(o.max_radius > radius + o.margin, "max_radius = ", o.max_radius,
          " m must be greater than radius + margin = ", radius + o.margin, " m");
  for (const int axis : {0, 1}) {
    const char name = axis == 0 ? 'x' : 'y';
    require(o.lower[axis] <= o.upper[axis], "the cart's range of ", name, " [", o.lower[axis], ", ", o.upper[axis],
            "] m is empty");
    for (const auto& [end_name, value] : {std::pair{"start", start[axis]}, std::pair{"end", end[axis]}}) {
      require(std::isfinite(value), end_name, ": ", name, " = ", value, " must be finite");
      require(value >= o.lower[axis] && value <= o.upper[axis], end_name, ": ", name, " = ", value,
              " m is out of the cart's range [", o.lower[axis], ", ", o.upper[axis], "] m");
    }
    require(o.max_speed[axis] > 0.0, "max_speed of ", name, " = ", o.max_speed[axis], " m/s must be greater than 0");
    require(o.max_acceleration[axis] > 0.0, "max_acceleration of ", name, " = ", o.max_acceleration[axis],
            " m/s² must be greater than 0");
  }
  require(!o.turn || std::abs(*o.turn) <= 100.0, "turn = ", o.turn.value_or(kNaN), " rad must be within 100");
  require(std::isfinite(o.duration) && o.duration > 0.0, "duration = ", o.duration,
          " s must be finite and greater than 0");
}

[[noreturn]] void refuse(CartFault fault, double feasible_radius, const std::string& facts) {
  throw CartError(fault, feasible_radius, message("no cart motion (", to_string(fault), "): ", facts));
}

void check_ends(const PlanarPath& path, const Vector2d& start, const Vector2d& end, double r,
                const PlaneCartOptions& options) {
  for (const bool at_end : {false, true}) {
    const double distance = ((at_end ? end : start) - path.row(at_end ? path.rows() - 1 : 0).transpose()).norm();
    const char* which = at_end ? "end" : "start";
    if (distance <= r) {
      refuse(at_end ? CartFault::EndInside : CartFault::StartInside,
             distance > options.margin ? distance - options.margin : kNaN,
             message("at the ", which, " the point is ", distance,
                     " m from the first joint's axis, which has to be more than ", r, " m"));
    }
    if (distance > options.max_radius) {
      refuse(CartFault::Range, kNaN,
             message("at the ", which, " the point is ", distance, " m from the first joint's axis, farther than ",
                     options.max_radius, " m"));
    }
  }
}

void check_samples(const PlanarPath& path, const detail::PlaneSearch& planner) {
  for (Eigen::Index i = 1; i + 1 < path.rows(); ++i) {
    Vector2d place = path.row(i);
    if (!planner.put(path.row(i), place)) {
      refuse(CartFault::Range, kNaN,
             message("at sample ", i, " no place in the cart's range keeps the point, at (", path(i, 0), ", ",
                     path(i, 1), ") m, within its radii"));
    }
  }
}

// The best motion without limits of speed and acceleration.
PlanarPath free_way(detail::PlaneSearch& planner, const PlaneCartOptions& options) {
  PlanarPath c;
  if (planner.search(c)) return c;
  const char* hint = planner.leapt() ? "; some leap over the disc between samples: more samples may help" : "";
  if (options.turn) {
    refuse(CartFault::Winding, kNaN,
           message("within the cart's range no way was found that turns the point about the first joint's axis by ",
                   *options.turn, " rad, to within half a turn", hint));
  }
  refuse(CartFault::Range, kNaN, message("within the cart's range no way round the point was found", hint));
}

// The limits [per sample] of a duration that is `longer` times the options'.
Limits limits_of(const PlaneCartOptions& options, Eigen::Index samples, double longer) {
  const double dt = longer * options.duration / static_cast<double>(samples - 1);
  return {dt * detail::pair(options.max_speed), dt * dt * detail::pair(options.max_acceleration)};
}

// A motion within the limits of speed and acceleration, found from the best motion without them.
PlanarPath limited_way(detail::PlaneSearch& planner, const PlanarPath& path, const PlanarPath& best,
                       const PlaneCartOptions& options) {
  PlanarPath c = best;
  // Sets c to a motion within the limits of a duration that is `longer` times as long, starting from the motion `from`.
  const auto within = [&](double longer, const PlanarPath& from, int programs) {
    c = from;
    Limits inside = limits_of(options, path.rows(), longer);
    inside.speed *= 1.0 - 1e-9;
    inside.acceleration *= 1.0 - 1e-9;
    return planner.improve(path, c, programs, kSettled, inside);
  };
  PlanarPath way = best;
  if (within(1.0, way, kPrograms)) return c;
  // The half-planes of a motion that takes limits into account leave more room, so a motion for a longer duration leads
  // to one within the limits.
  double good = 2.0, bad = 1.0;
  while (good < kLongest && !within(good, way, kNearer)) {
    bad = good;
    good *= 2.0;
  }
  for (int k = 0; k < kTightenings && good < kLongest; ++k) {
    if (k > 0 || bad > 1.0) {
      const double middle = 0.5 * (bad + good);
      if (!within(middle, way, kNearer)) {
        bad = middle;
        continue;
      }
      good = middle;
    }
    way = c;
    if (within(1.0, way, kPrograms)) return c;
  }
  const bool slow = !keeps(best, {limits_of(options, path.rows(), 1.0).speed}, false);
  refuse(slow ? CartFault::Speed : CartFault::Acceleration, kNaN,
         message("along the best way without limits none was found that keeps to them",
                 good < kLongest ? message("; a duration of ", good * options.duration, " s would do") : ""));
}

PlaneCartLaw law_of(const PlanarPath& c, const PlanarPath& path, double r, const detail::PlaneSearch& planner) {
  const PlanarPath d = c - path;
  PlaneCartLaw law;
  law.c.assign(c.data(), c.data() + c.size());
  law.energy = energy_of(c);
  law.turn = turn_of(d);
  law.starts = planner.starts();
  law.programs = planner.programs();
  law.push.assign(static_cast<std::size_t>(c.rows()), 0.0);
  for (Eigen::Index i = 1; i + 1 < c.rows(); ++i) {
    const double distance = d.row(i).norm();
    if (distance > r * (1.0 + 1e-6)) continue;
    law.push[static_cast<std::size_t>(i)] = std::max(
        0.0, (2.0 * c.row(i) - c.row(i - 1) - c.row(i + 1)).dot(d.row(i)) / distance);
  }
  return law;
}

}  // namespace

PlaneCartLaw plane_cart_law(const PlanarPath& path, const AxisPair& first, const AxisPair& last, double radius,
                            const PlaneCartOptions& options) {
  check(path, first, last, radius, options);
  const Vector2d start = detail::pair(first), end = detail::pair(last);
  const double r = radius + options.margin;
  check_ends(path, start, end, r, options);
  detail::PlaneSearch planner(path, start, end, r, options);
  check_samples(path, planner);
  const PlanarPath best = free_way(planner, options);
  const bool fits = keeps(best, limits_of(options, path.rows(), 1.0), options.at_rest);
  return law_of(fits ? best : limited_way(planner, path, best, options), path, r, planner);
}

}  // namespace sigmaik::planning
