#pragma once
/// \file cart.hpp
/// The best motion of a cart that carries an arm, so that the arm stays clear of its shoulder singularity (Salvato et
/// al. 2022), computed exactly.
///
/// Frame: x along the cart, z along the first joint's axis, which stands at (x_C, 0). A point P = (x_P, y_P) of the
/// arm, whose path is given in M samples evenly spaced in time, must stay out of the circle of radius r about this
/// axis. So sample i forbids
///
///     λ∓_i = x_P ∓ √(r² − y_P²),   λ−_i < x_C < λ+_i,   where |y_P| < r                                        (6)
///
/// and the law sought has the least Σ_i (x_{i+1} − x_i)², with given ends, outside all these intervals: the paper's
/// functional (10) with its density H as a constraint.
///
/// Once the side is known on which the cart passes each connected part of the region, x_i lies in a tube lo_i ≤ x_i ≤
/// up_i, and the answer is the taut string in this tube. The taut string is the optimum: the objective is strictly
/// convex, the constraints are linear, and with μ_i = 2x_i − x_{i−1} − x_{i+1} the string satisfies the conditions of
/// Karush, Kuhn and Tucker, μ_i > 0 only where x_i = lo_i, μ_i < 0 only where x_i = up_i. The string minimises every
/// convex function of the increments, so its top speed is the least, too.

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include <sigmaik/error.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik::planning {

/// Positions (M, 2) [m]. Only arguments are of this type: results are std::vectors, whose allocator does not depend on
/// the compiler's flags as Eigen's does.
using PlanarPath = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor | Eigen::DontAlign>;

/// The reason why there is no cart motion.
enum class CartFault : std::int8_t {
  StartInside = 0,    ///< the first sample is within the radius
  EndInside = 1,      ///< the last sample is within the radius
  OppositeSides = 2,  ///< the ends are on opposite sides of a region that reaches from the first sample to the last
  Range = 3,          ///< the only way leads out of the cart's range
  Winding = 4,        ///< every way turns the first joint by another number of whole turns than asked for
  Speed = 5,          ///< every way is faster than the cart
  Acceleration = 6,   ///< no way on the sides of the shortest one keeps to the cart's acceleration
  Undecided = 7,      ///< the region has too many parts to try all sides
};

/// "start inside", "end inside", "opposite sides", "range", "winding", "speed", "acceleration", "undecided".
const char* to_string(CartFault fault) noexcept;

/// No cart motion keeps out of the region; the text says what would have to change.
class CartError : public Error {
 public:
  /// Takes the reason, the largest radius [m] that has a motion, and both in words.
  CartError(CartFault fault, double feasible_radius, const std::string& text)
      : Error(text), fault_(fault), feasible_radius_(feasible_radius) {}
  /// The reason.
  CartFault fault() const noexcept { return fault_; }
  /// [m] The largest radius (to nine digits) for which there is a motion; NaN: none, or not known.
  double feasible_radius() const noexcept { return feasible_radius_; }

 private:
  CartFault fault_;
  double feasible_radius_;
};

/// Constraints and settings of a cart motion.
struct CartOptions {
  double lower = -std::numeric_limits<double>::infinity();  ///< [m] of the cart's range
  double upper = std::numeric_limits<double>::infinity();   ///< [m] of the cart's range
  double margin = 0.0;                                      ///< [m] ≥ 0, added to the radius
  /// [rad] by which the azimuth of P, seen from the axis, turns between the ends, positive about z. Only motions that
  /// turn by this angle, within half a turn, are considered; none: all motions are.
  std::optional<double> turn = std::nullopt;
  double duration = 1.0;                                              ///< [s] between the first and the last sample
  double max_speed = std::numeric_limits<double>::infinity();         ///< [m/s] > 0
  double max_acceleration = std::numeric_limits<double>::infinity();  ///< [m/s²] > 0, second differences of the samples
  bool at_rest = false;     ///< the cart starts and stops within max_acceleration, where that is finite
  int max_strings = 20000;  ///< ≥ 1, taut strings drawn to find the best sides
};

/// A connected part of the forbidden region, in the plane of time and cart position.
struct CartRegion {
  double first;  ///< [samples] where it begins: its tip, between samples
  double last;   ///< [samples] where it ends: its tip, between samples
  int side;      ///< 1: the law passes above λ+; −1: below λ−
};

/// A law of the cart, and the region that it keeps out of.
struct CartLaw {
  std::vector<double> x;            ///< (M,) [m] at the samples
  std::vector<double> lower;        ///< (M,) [m] λ− for radius + margin; +∞ where nothing is forbidden
  std::vector<double> upper;        ///< (M,) [m] λ+ for radius + margin; −∞ where nothing is forbidden
  std::vector<double> multipliers;  ///< (M,) [m] μ: positive at an active lower bound, negative at an upper bound
  std::vector<CartRegion> regions;  ///< parts of the forbidden region, in the order of time
  /// [samples] where the string has its corners, straight between them. A corner at the tip of a region can lie between
  /// samples.
  std::vector<double> corners;
  std::vector<double> corner_x;  ///< the positions of the corners [m]
  double energy = 0.0;           ///< [m²] Σ (Δx)²; with a corner between samples Σ (Δx)²/Δi over the string's pieces
  double turn = 0.0;             ///< [rad] of P's azimuth
  int strings = 0;               ///< taut strings drawn
};

/// λ∓ (6) of every sample [m]; +∞ and −∞, the empty interval, where |y| ≥ radius.
void forbidden_intervals(const PlanarPath& path, double radius, std::vector<double>& lower, std::vector<double>& upper);

/// The shortest string through lower ≤ x ≤ upper over increasing abscissae `at`; at both ends lower = upper. Writes x,
/// and the indices of its corners, both ends among them. The funnel algorithm takes one pass, O(M).
/// \throws Error where sizes differ, an abscissa does not increase, lower > upper somewhere, or lower ≠ upper at an end
void taut_string(const std::vector<double>& at, const std::vector<double>& lower, const std::vector<double>& upper,
                 std::vector<double>& x, std::vector<int>& corners);

/// The law of the least energy from start to end [m] along `path` (M ≥ 2), outside the circle of `radius` [m] > 0.
///
/// Between samples P and the cart move on straight lines. The law keeps out of tips of regions between samples exactly.
/// On curved parts of the border the law is inside the region, between two samples, by at most max |Δ²λ|/8: the margin
/// must cover this depth.
///
/// An end decides the side of a part of the region that extends over this end. For the other parts, branch and bound
/// finds the best of all sides that agree with `turn`, the range and the speed: if a part of the region is left out,
/// energy and top speed can only decrease.
///
/// Where the string breaks the acceleration limit, or `at_rest` holds, the answer is the law of the least energy on the
/// same sides that keeps all limits, to about 1e-9 of them: the solution of a quadratic program with bounds on second
/// differences, by an interior-point method in O(M) an iteration. This law bends everywhere, so μ does not tell where
/// it touches the region.
/// \throws CartError with the reason where there is no law
/// \throws Error where an argument is out of its range
CartLaw cart_law(const PlanarPath& path, double start, double end, double radius, const CartOptions& options = {});

/// Settings of the gradient descent.
struct CartDescent {
  double alpha = 0.01;           ///< [1/mm²] > 0, weight of smoothness in (10), between samples
  double step = 20.0;            ///< [mm²] > 0, η; stable below 1/(4 alpha)
  int max_iterations = 53707;    ///< ≥ 1
  bool until_admissible = true;  ///< stop at the first law that is admissible, to `depth`
  /// [mm] ≥ 0. A law at the border oscillates, because H pushes its samples out of the region and smoothing pulls them
  /// in. Where no sample is deeper inside than `depth`, the samples inside are put on the border at the end.
  double depth = 1e-3;
};

/// Gradient descent on the paper's functional F = ΣH(x_i) + α Σ(x_{i+1} − x_i)² (10), H = max(0, 1 − |x − x_P|/h) with
/// h half the forbidden interval, lengths in mm as in the paper. The descent changes x (M,) [m], but not its ends. H
/// has a kink on the centre line, where its slope counts as zero.
/// \returns iterations done
/// \throws Error where an argument is out of its range
int cart_descent(const std::vector<double>& lower, const std::vector<double>& upper, std::vector<double>& x,
                 const CartDescent& options = {});

SIGMAIK_SAME_LAYOUT(CartLaw, CartOptions, CartRegion, CartDescent, PlanarPath);

}  // namespace sigmaik::planning
