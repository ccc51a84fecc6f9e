#pragma once
/// \file cart_plane.hpp
/// Where to drive a cart with two linear axes, so that a point of the arm on it stays clear of the first joint's axis:
/// the case that Salvato et al. (2022) leave open.
///
/// The cart is at c_i, the point at f_i, both in the plane, in M samples evenly spaced in time. Wanted is the least
/// Σ_i |c_{i+1} − c_i|² between given ends with |c_i − f_i| ≥ r. Seen from the point the obstacle is a disc at rest,
/// and d = c − f goes round it one way or the other: what is combinatorial is how often d winds about the disc.
///
/// Where f moves on a straight line at constant speed, Σ|Δc|² is Σ|Δd|² but for a constant, and the plane outside a
/// disc, with its turns counted, has one shortest way between two points: tangent, arc, tangent. Other paths f pull d
/// with −f̈, and may have several local minima of the same winding; the best of a bounded number of starts is returned.

#include <array>
#include <limits>
#include <optional>
#include <vector>

#include <sigmaik/layout.hpp>
#include <sigmaik/planning/cart.hpp>

namespace sigmaik::planning {

/// A number for each axis of the cart.
using AxisPair = std::array<double, 2>;
/// No limit.
inline constexpr double kUnlimited = std::numeric_limits<double>::infinity();

/// What a motion in the plane must keep to.
struct PlaneCartOptions {
  AxisPair lower{-kUnlimited, -kUnlimited};  ///< [m] of each axis
  AxisPair upper{kUnlimited, kUnlimited};    ///< [m]; equal: the axis stands
  double margin = 0.0;                       ///< [m] ≥ 0, added to the radius
  double max_radius = kUnlimited;            ///< [m] > radius + margin, the farthest that the point may be
  /// [rad] by which the point's azimuth turns seen from the axis, positive about z, to within half a turn; none: any.
  std::optional<double> turn = std::nullopt;
  double duration = 1.0;                       ///< [s] between the first and the last sample
  AxisPair max_speed{kUnlimited, kUnlimited};  ///< [m/s] > 0 of each axis
  /// [m/s²] > 0 of each axis, second differences of the samples
  AxisPair max_acceleration{kUnlimited, kUnlimited};
  bool at_rest = false;  ///< starts and stops within max_acceleration, where that is finite
};

/// A motion of the cart.
struct PlaneCartLaw {
  std::vector<double> c;  ///< (M, 2) in C order [m]
  std::vector<double>
      push;             ///< (M,) [m] ≥ 0: (2c_i − c_{i−1} − c_{i+1}) along c_i − f_i, where it touches the disc, else 0
  double energy = 0.0;  ///< [m²] Σ |Δc|²
  double turn = 0.0;    ///< [rad] of the point's azimuth
  int starts = 0;       ///< first guesses tried
  int programs = 0;     ///< quadratic programs solved, of all starts
};

/// The motion of the least energy from start to end [m] along `path` (M ≥ 3), outside the disc of `radius` [m] > 0.
///
/// Starts: the straight motion, taken round the disc on either side wherever it runs into it, and tangent, arc,
/// tangent; with as many turns as asked for, or any. Each is improved on a coarse grid of times: |d_i| ≥ r is replaced
/// by d_i·n_i ≥ r with n_i = d_i/|d_i|, a quadratic program whose answer keeps out of the disc, and costs no more than
/// the guess did; and again from there. Where that stops the conditions of Karush, Kuhn and Tucker of the problem
/// itself hold. The best is refined on all samples. Limits of speed and acceleration are held on the way that is the
/// best without them.
/// \throws CartError with the reason where none was found
/// \throws Error where an argument is out of its range
PlaneCartLaw plane_cart_law(const PlanarPath& path, const AxisPair& start, const AxisPair& end, double radius,
                            const PlaneCartOptions& options = {});

SIGMAIK_SAME_LAYOUT(PlaneCartLaw, PlaneCartOptions);

}  // namespace sigmaik::planning
