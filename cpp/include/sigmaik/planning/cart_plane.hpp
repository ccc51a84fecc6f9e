#pragma once
/// \file cart_plane.hpp
/// Motions of a cart with two linear axes, so that a point of the arm on the cart stays clear of the first joint's
/// axis: the case that Salvato et al. (2022) leave open.
///
/// The cart is at c_i, the point at f_i, both in the plane, in M samples evenly spaced in time. The motion sought has
/// the least Σ_i |c_{i+1} − c_i|² between given ends with |c_i − f_i| ≥ r. Seen from the point the obstacle is a disc
/// at rest, and d = c − f goes round this disc one way or the other: the combinatorial part of the problem is how often
/// d winds about the disc.
///
/// Where f moves on a straight line at constant speed, Σ|Δc|² equals Σ|Δd|² up to a constant, and outside a disc there
/// is one shortest way between two points for each number of turns: tangent, arc, tangent. On other paths f, the term
/// −f̈ acts on d like a force, and there may be several local minima of the same winding; the answer is the best of a
/// bounded number of starts.

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

/// Constraints and settings of a motion in the plane.
struct PlaneCartOptions {
  AxisPair lower{-kUnlimited, -kUnlimited};  ///< [m] of each axis
  AxisPair upper{kUnlimited, kUnlimited};    ///< [m]; equal to lower: the axis stands
  double margin = 0.0;                       ///< [m] ≥ 0, added to the radius
  double max_radius = kUnlimited;            ///< [m] > radius + margin, largest distance of the point
  /// [rad] by which the point's azimuth, seen from the axis, turns, positive about z, within half a turn; none: any
  /// angle.
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
/// The starts are the straight motion, taken round the disc on either side wherever the motion runs into the disc, and
/// tangent, arc, tangent; with as many turns as asked for, or any. Each start is improved on a coarse grid of times: a
/// quadratic program has d_i·n_i ≥ r, n_i = d_i/|d_i|, in place of |d_i| ≥ r, so that its answer keeps out of the disc
/// and costs no more than the guess did. The answer is the guess of the next program. Where this iteration stops, the
/// conditions of Karush, Kuhn and Tucker of the original problem hold. The best motion is refined on all samples.
/// Limits of speed and acceleration are added afterwards, along the motion that is the best without them.
/// \throws CartError with the reason where no motion was found
/// \throws Error where an argument is out of its range
PlaneCartLaw plane_cart_law(const PlanarPath& path, const AxisPair& start, const AxisPair& end, double radius,
                            const PlaneCartOptions& options = {});

SIGMAIK_SAME_LAYOUT(PlaneCartLaw, PlaneCartOptions);

}  // namespace sigmaik::planning
