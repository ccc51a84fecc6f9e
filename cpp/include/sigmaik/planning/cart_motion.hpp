#pragma once
/// \file cart_motion.hpp
/// Motions of a cart under an arm, with the measures by which they are compared: cart_law() and plane_cart_law(), the
/// paper's gradient descent, or any given motion.

#include <cstdint>
#include <string>
#include <vector>

#include <sigmaik/layout.hpp>
#include <sigmaik/planning/cart.hpp>
#include <sigmaik/planning/cart_plane.hpp>

namespace sigmaik::planning {

/// Measures of motions with one axis and with two axes, of M samples, evenly spaced in time.
struct CartMeasures {
  std::vector<double> flange_xy;  ///< (M, 2) in C order [m], the path that was given
  double radius = 0.0;            ///< [m] of the forbidden cylinder, without the margin
  double margin = 0.0;            ///< [m] added to the radius in planning
  double duration = 1.0;          ///< [s] from the first to the last sample
  /// [m²] Σ |Δ|² of the cart. A corner between samples divides a step, and each part counts |Δ|² over its part of a
  /// sample.
  double energy = 0.0;
  bool admissible = false;  ///< no sample is within the radius
  double clearance = 0.0;   ///< [m] the point's least distance from the first joint's axis, between the samples too
  int inside = 0;           ///< samples within the radius
  double turn = 0.0;        ///< [rad] by which the point's azimuth turns, seen from the axis

  /// Number M of samples.
  int samples() const noexcept { return static_cast<int>(flange_xy.size() / 2); }
  /// (M,) [s] of the samples.
  std::vector<double> t() const;
  /// [s] of the samples within the radius.
  double time_inside() const noexcept { return inside * duration / (samples() - 1); }
};

/// Motion of a cart with one axis, straight between samples. Only a corner between two samples, at the tip of a
/// forbidden region, bends a step: see `corners`.
struct CartMotion : CartMeasures {
  std::vector<double> x;            ///< (M,) [m] of the cart
  std::vector<double> lower;        ///< (M,) [m] λ− at radius + margin; +∞ where the cart is free
  std::vector<double> upper;        ///< (M,) [m] λ+ at radius + margin; −∞ where the cart is free
  std::vector<std::int8_t> sides;   ///< (M,) 1 above a forbidden interval, −1 below, 0 where there is none, or inside
  std::vector<CartRegion> regions;  ///< of an exact law
  std::vector<double> corners;      ///< (K,) [samples] where the law bends, and its ends
  std::vector<double> corner_x;     ///< (K,) [m] positions of the corners
  std::vector<double> multipliers;  ///< (M,) [m] of an exact law, see CartLaw; else empty
  std::string method = "given";     ///< "exact", "gradient", or "given" for a law that was only evaluated
  int iterations = 0;               ///< steps of the gradient descent, or taut strings drawn

  double max_speed() const noexcept;         ///< [m/s]
  double max_acceleration() const noexcept;  ///< [m/s²], the largest second difference over the samples
  /// x [m] at times [s], held at the ends.
  /// \throws Error where a time is not finite
  std::vector<double> sample(const std::vector<double>& times) const;
};

/// Motion of a cart with two axes, straight between its samples.
struct PlaneCartMotion : CartMeasures {
  std::vector<double> xy;    ///< (M, 2) in C order [m] of the cart
  std::vector<double> push;  ///< (M,) [m], see PlaneCartLaw; empty for a motion that was only evaluated
  double farthest = 0.0;     ///< [m] the point's largest distance from the first joint's axis
  int starts = 0;            ///< first guesses tried
  int programs = 0;          ///< quadratic programs solved

  AxisPair max_speed() const noexcept;         ///< [m/s] of each axis
  AxisPair max_acceleration() const noexcept;  ///< [m/s²] of each axis, the largest second differences
  /// (K, 2) in C order [m] at times (K,) [s], held at the ends.
  /// \throws Error where a time is not finite
  std::vector<double> sample(const std::vector<double>& times) const;
};

/// The motion of cart_law() with its measures.
/// \throws Error as cart_law()
CartMotion cart_motion(const PlanarPath& path, double start, double end, double radius,
                       const CartOptions& options = {});

/// The motion of cart_descent() from `guess` (M,) with its measures; the default guess is the straight line from start
/// to end. From an inadmissible guess the descent stops at the first admissible law; from an admissible guess it goes
/// on smoothing. Only the options margin and duration count.
/// \throws Error where an argument is out of its range, or the guess does not go from start to end
CartMotion cart_motion_by_descent(const PlanarPath& path, double start, double end, double radius,
                                  const CartOptions& options = {}, const CartDescent& descent = {},
                                  std::vector<double> guess = {});

/// A first guess for the descent that passes all forbidden intervals, on the sides of the exact law: a jump to the
/// cart's range, or past the whole region where the range is infinite, and back at the end (Salvato et al. 2022, figure
/// 9).
/// \throws Error as cart_law()
std::vector<double> admissible_guess(const PlanarPath& path, double start, double end, double radius,
                                     const CartOptions& options = {});

/// Measures of any law x (M,) [m].
/// \throws Error where an argument is out of its range
CartMotion evaluate_cart_motion(const PlanarPath& path, std::vector<double> x, double radius, double margin = 0.0,
                                double duration = 1.0);

/// The motion of plane_cart_law() with its measures.
/// \throws Error as plane_cart_law()
PlaneCartMotion plane_cart_motion(const PlanarPath& path, const AxisPair& start, const AxisPair& end, double radius,
                                  const PlaneCartOptions& options = {});

/// Measures of any motion xy (M, 2) in C order [m].
/// \throws Error where an argument is out of its range
PlaneCartMotion evaluate_plane_cart_motion(const PlanarPath& path, std::vector<double> xy, double radius,
                                           double margin = 0.0, double duration = 1.0);

SIGMAIK_SAME_LAYOUT(CartMeasures, CartMotion, PlaneCartMotion);

}  // namespace sigmaik::planning
