#include <sigmaik/planning/cart_motion.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "../message.hpp"
#include "samples.hpp"

namespace sigmaik::planning {
namespace {

using detail::evenly;
using sigmaik::detail::require;

constexpr double kTolerance = 1e-12;  // relative to lengths: a point within this tolerance is on the border, not inside

// Σ of `count` terms by halves: the rounding error grows with log(count) only.
template <typename Term>
double sum(std::size_t first, std::size_t count, const Term& term) {
  if (count > 128) {
    const std::size_t half = count / 2;
    return sum(first, half, term) + sum(first + half, count - half, term);
  }
  double out = 0.0;
  for (std::size_t i = first; i < first + count; ++i) out += term(i);
  return out;
}

// Values at increasing abscissae, linear between them and held at the ends; asked for at abscissae in any order.
class Line {
 public:
  Line(const std::vector<double>& at, const std::vector<double>& value) : at_(at), value_(value) {}

  double operator()(double where) const {
    if (!(where > at_.front())) return value_.front();
    if (!(where < at_.back())) return value_.back();
    const auto k = static_cast<std::size_t>(std::upper_bound(at_.begin(), at_.end(), where) - at_.begin()) - 1;
    if (at_[k] == where) return value_[k];
    return (value_[k + 1] - value_[k]) / (at_[k + 1] - at_[k]) * (where - at_[k]) + value_[k];
  }

 private:
  const std::vector<double>&at_, &value_;
};

struct Seen {  // the point, seen from the first joint's axis
  std::vector<double> x, y;
};

// The least distance from the origin to a polygon line.
double least_distance(const Seen& seen) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i + 1 < seen.x.size(); ++i) {
    const double dx = seen.x[i + 1] - seen.x[i], dy = seen.y[i + 1] - seen.y[i], length = dx * dx + dy * dy;
    const double along = -(seen.x[i] * dx + seen.y[i] * dy) / (length > 0.0 ? length : 1.0);
    const double part = std::clamp(along, 0.0, 1.0);
    least = std::min(least, std::hypot(seen.x[i] + part * dx, seen.y[i] + part * dy));
  }
  return least;
}

double azimuth_turn(const Seen& seen) {
  return sum(0, seen.x.size() - 1, [&](std::size_t i) {
    const double cross = seen.x[i] * seen.y[i + 1] - seen.y[i] * seen.x[i + 1];
    return std::atan2(cross, seen.x[i] * seen.x[i + 1] + seen.y[i] * seen.y[i + 1]);
  });
}

void check(const PlanarPath& path, double radius, double margin, double duration) {
  require(path.rows() >= 2 && path.allFinite(), "the path must be finite and have at least 2 samples, not ",
          path.rows());
  require(std::isfinite(radius) && radius > 0.0, "radius = ", radius, " must be finite and greater than 0");
  require(std::isfinite(margin) && margin >= 0.0, "margin = ", margin, " m must be finite and not negative");
  require(std::isfinite(duration) && duration > 0.0, "duration = ", duration, " must be finite and greater than 0");
}

bool finite(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

void require_times(const std::vector<double>& times) { require(finite(times), "t must be finite"); }

// A motion with everything but the measures of the point.
template <typename Motion>
Motion begin(const PlanarPath& path, double radius, double margin, double duration) {
  check(path, radius, margin, duration);
  Motion out;
  out.flange_xy.assign(path.data(), path.data() + path.size());
  out.radius = radius;
  out.margin = margin;
  out.duration = duration;
  return out;
}

CartMotion measured(const PlanarPath& path, std::vector<double> x, std::vector<double> corners,
                    std::vector<double> corner_x, double radius, double margin, double duration) {
  auto out = begin<CartMotion>(path, radius, margin, duration);
  const auto m = static_cast<std::size_t>(path.rows());
  require(x.size() == m && finite(x), "x must be finite and of ", m, " samples, not ", x.size());
  forbidden_intervals(path, radius + margin, out.lower, out.upper);
  std::vector<double> samples(m), px(m), py(m);
  out.sides.resize(m);
  for (std::size_t i = 0; i < m; ++i) {
    samples[i] = static_cast<double>(i);
    px[i] = path(static_cast<Eigen::Index>(i), 0);
    py[i] = path(static_cast<Eigen::Index>(i), 1);
    const double distance = std::hypot(px[i] - x[i], py[i]);
    if (distance < radius - kTolerance * (radius + std::abs(px[i]) + std::abs(x[i]))) ++out.inside;
    if (out.lower[i] <= out.upper[i]) {
      out.sides[i] = static_cast<std::int8_t>(x[i] >= out.upper[i] ? 1 : x[i] <= out.lower[i] ? -1 : 0);
    }
  }
  if (corners.empty()) {
    corners = samples;
    corner_x = x;
  }
  // Tips between samples are corners of the law: they count as samples here.
  std::vector<double> every;
  std::set_union(samples.begin(), samples.end(), corners.begin(), corners.end(), std::back_inserter(every));
  const Line law(corners, corner_x), point_x(samples, px), point_y(samples, py);
  Seen seen;
  for (const double at : every) {
    seen.x.push_back(point_x(at) - law(at));
    seen.y.push_back(point_y(at));
  }
  out.admissible = out.inside == 0;
  out.clearance = least_distance(seen);
  out.turn = azimuth_turn(seen);
  out.energy = sum(0, corners.size() - 1, [&](std::size_t i) {
    const double rise = corner_x[i + 1] - corner_x[i];
    return rise * rise / (corners[i + 1] - corners[i]);
  });
  out.x = std::move(x);
  out.corners = std::move(corners);
  out.corner_x = std::move(corner_x);
  return out;
}

}  // namespace

std::vector<double> CartMeasures::t() const { return evenly(0.0, duration, static_cast<std::size_t>(samples())); }

double CartMotion::max_speed() const noexcept {
  double top = 0.0;
  for (std::size_t k = 0; k + 1 < corners.size(); ++k) {
    top = std::max(top, std::abs((corner_x[k + 1] - corner_x[k]) / (corners[k + 1] - corners[k])));
  }
  return top * (samples() - 1) / duration;
}

double CartMotion::max_acceleration() const noexcept {
  const double step = duration / (samples() - 1);
  double top = 0.0;
  for (std::size_t i = 1; i + 1 < x.size(); ++i) {
    top = std::max(top, std::abs((x[i + 1] - x[i]) - (x[i] - x[i - 1])));
  }
  return top / (step * step);
}

std::vector<double> CartMotion::sample(const std::vector<double>& times) const {
  require_times(times);
  const Line law(corners, corner_x);
  std::vector<double> out(times.size());
  for (std::size_t i = 0; i < times.size(); ++i) out[i] = law(times[i] * ((samples() - 1) / duration));
  return out;
}

AxisPair PlaneCartMotion::max_speed() const noexcept {
  AxisPair top{0.0, 0.0};
  for (std::size_t i = 2; i < xy.size(); ++i) top[i % 2] = std::max(top[i % 2], std::abs(xy[i] - xy[i - 2]));
  for (double& value : top) value *= (samples() - 1) / duration;
  return top;
}

AxisPair PlaneCartMotion::max_acceleration() const noexcept {
  AxisPair top{0.0, 0.0};
  for (std::size_t i = 4; i < xy.size(); ++i) {
    top[i % 2] = std::max(top[i % 2], std::abs((xy[i] - xy[i - 2]) - (xy[i - 2] - xy[i - 4])));
  }
  const double rate = (samples() - 1) / duration;
  for (double& value : top) value *= rate * rate;
  return top;
}

std::vector<double> PlaneCartMotion::sample(const std::vector<double>& times) const {
  require_times(times);
  const std::vector<double> at = t();
  std::vector<double> column(at.size()), out(2 * times.size());
  for (const std::size_t axis : {0, 1}) {
    for (std::size_t i = 0; i < at.size(); ++i) column[i] = xy[2 * i + axis];
    const Line line(at, column);
    for (std::size_t i = 0; i < times.size(); ++i) out[2 * i + axis] = line(times[i]);
  }
  return out;
}

CartMotion cart_motion(const PlanarPath& path, double start, double end, double radius, const CartOptions& options) {
  CartLaw law = cart_law(path, start, end, radius, options);
  CartMotion out = measured(path, std::move(law.x), std::move(law.corners), std::move(law.corner_x), radius,
                            options.margin, options.duration);
  out.method = "exact";
  out.iterations = law.strings;
  out.regions = std::move(law.regions);
  out.multipliers = std::move(law.multipliers);
  return out;
}

CartMotion cart_motion_by_descent(const PlanarPath& path, double start, double end, double radius,
                                  const CartOptions& options, const CartDescent& descent, std::vector<double> guess) {
  check(path, radius, options.margin, options.duration);
  const auto m = static_cast<std::size_t>(path.rows());
  if (guess.empty()) guess = evenly(start, end, m);
  require(guess.size() == m && finite(guess), "first_guess must be finite and of ", m, " samples, not ", guess.size());
  require(guess.front() == start && guess.back() == end, "first_guess must go from start = ", start, " to end = ", end);
  std::vector<double> lower, upper;
  forbidden_intervals(path, radius + options.margin, lower, upper);
  CartDescent stop = descent;
  stop.until_admissible = false;
  for (std::size_t i = 0; i < m; ++i) {
    stop.until_admissible = stop.until_admissible || (guess[i] > lower[i] && guess[i] < upper[i]);
  }
  const int iterations = cart_descent(lower, upper, guess, stop);
  CartMotion out = measured(path, std::move(guess), {}, {}, radius, options.margin, options.duration);
  out.method = "gradient";
  out.iterations = iterations;
  return out;
}

std::vector<double> admissible_guess(const PlanarPath& path, double start, double end, double radius,
                                     const CartOptions& options) {
  const CartLaw law = cart_law(path, start, end, radius, options);
  const auto m = static_cast<std::size_t>(path.rows());
  std::vector<double> guess = evenly(start, end, m);
  std::vector<std::size_t> known;
  double top = -std::numeric_limits<double>::infinity(), bottom = -top;
  for (std::size_t i = 0; i < m; ++i) {
    if (!(law.lower[i] < law.upper[i])) continue;
    known.push_back(i);
    top = std::max(top, law.upper[i]);
    bottom = std::min(bottom, law.lower[i]);
  }
  if (known.empty()) return guess;
  if (std::isfinite(options.upper)) top = options.upper;
  if (std::isfinite(options.lower)) bottom = options.lower;
  // Free samples take the position that the next part of the region needs.
  for (std::size_t i = 1, next = 0; i + 1 < m; ++i) {
    while (next + 1 < known.size() && known[next] < i) ++next;
    guess[i] = law.x[known[next]] >= law.upper[known[next]] ? top : bottom;
  }
  return guess;
}

CartMotion evaluate_cart_motion(const PlanarPath& path, std::vector<double> x, double radius, double margin,
                                double duration) {
  return measured(path, std::move(x), {}, {}, radius, margin, duration);
}

PlaneCartMotion plane_cart_motion(const PlanarPath& path, const AxisPair& start, const AxisPair& end, double radius,
                                  const PlaneCartOptions& options) {
  PlaneCartLaw law = plane_cart_law(path, start, end, radius, options);
  PlaneCartMotion out = evaluate_plane_cart_motion(path, std::move(law.c), radius, options.margin, options.duration);
  out.push = std::move(law.push);
  out.starts = law.starts;
  out.programs = law.programs;
  return out;
}

PlaneCartMotion evaluate_plane_cart_motion(const PlanarPath& path, std::vector<double> xy, double radius, double margin,
                                           double duration) {
  auto out = begin<PlaneCartMotion>(path, radius, margin, duration);
  require(xy.size() == out.flange_xy.size() && finite(xy), "xy must be finite and of ", path.rows(), " samples, not ",
          xy.size() / 2);
  Seen seen;
  for (std::size_t i = 0; i < xy.size(); i += 2) {
    seen.x.push_back(out.flange_xy[i] - xy[i]);
    seen.y.push_back(out.flange_xy[i + 1] - xy[i + 1]);
    const double distance = std::hypot(seen.x.back(), seen.y.back());
    // A program's answer is on the border to about 1e-9 of the radius.
    if (distance < radius * (1.0 - 1e3 * kTolerance)) ++out.inside;
    out.farthest = std::max(out.farthest, distance);
  }
  out.admissible = out.inside == 0;
  out.clearance = least_distance(seen);
  out.turn = azimuth_turn(seen);
  out.energy = sum(0, xy.size() / 2 - 1, [&](std::size_t i) {
    const double dx = xy[2 * i + 2] - xy[2 * i], dy = xy[2 * i + 3] - xy[2 * i + 1];
    return dx * dx + dy * dy;
  });
  out.xy = std::move(xy);
  return out;
}

}  // namespace sigmaik::planning
