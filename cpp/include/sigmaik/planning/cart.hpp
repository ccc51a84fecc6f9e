#pragma once
/// \file cart.hpp
/// Where to drive the cart of a cart-mounted arm so that the arm stays clear of its shoulder singularity
/// (Salvato et al. 2022), exactly.
///
/// Frame: x along the cart, z along the first joint's axis, which stands at (x_C, 0). A point P = (x_P, y_P) of the
/// arm, whose path is given in M samples evenly spaced in time, must stay out of the circle of radius r about it. So
/// sample i forbids
///
///     λ∓_i = x_P ∓ √(r² − y_P²),   λ−_i < x_C < λ+_i,   where |y_P| < r                                        (6)
///
/// and the law sought is that of the least Σ_i (x_{i+1} − x_i)², with given ends, outside all of these: the paper's
/// functional (10) where its density H is a constraint.
///
/// Once it is known on which side of each connected part of the region the cart passes, x_i lies in a tube lo_i ≤ x_i ≤
/// up_i, and the answer is the taut string in it. That is the optimum: the objective is strictly convex, the
/// constraints linear, and with μ_i = 2x_i − x_{i−1} − x_{i+1} the string satisfies the conditions of Karush, Kuhn and
/// Tucker, μ_i > 0 only where x_i = lo_i, μ_i < 0 only where x_i = up_i. It minimises every convex function of the
/// increments, so it has the least top speed too.

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

/// Why there is no cart motion.
enum class CartFault : std::int8_t {
  StartInside = 0,    ///< the first sample is within the radius
  EndInside = 1,      ///< the last sample is within the radius
  OppositeSides = 2,  ///< the ends are on opposite sides of a region that reaches from the first sample to the last
  Range = 3,          ///< the only way leads out of the cart's range
  Winding = 4,        ///< every way turns the first joint by another number of whole turns than asked for
  Speed = 5,          ///< every way is faster than the cart
  Acceleration = 6,   ///< no way on the sides of the shortest one keeps to the cart's acceleration
  Undecided = 7,      ///< too many parts of the region to go through all sides
};

/// "start inside", "end inside", "opposite sides", "range", "winding", "speed", "acceleration", "undecided".
const char* to_string(CartFault fault) noexcept;

/// No cart motion keeps out of the region, with what would have to change.
class CartError : public Error {
 public:
  /// What is wrong, the largest radius [m] that would do, and both in words.
  CartError(CartFault fault, double feasible_radius, const std::string& text)
      : Error(text), fault_(fault), feasible_radius_(feasible_radius) {}
  /// What is wrong.
  CartFault fault() const noexcept { return fault_; }
  /// [m] The largest radius (to nine digits) for which there is a motion; NaN: none, or not known.
  double feasible_radius() const noexcept { return feasible_radius_; }

 private:
  CartFault fault_;
  double feasible_radius_;
};

/// What a cart motion must keep to.
struct CartOptions {
  double lower = -std::numeric_limits<double>::infinity();  ///< [m] of the cart's range
  double upper = std::numeric_limits<double>::infinity();   ///< [m] of the cart's range
  double margin = 0.0;                                      ///< [m] ≥ 0, added to the radius
  /// [rad] by which the azimuth of P seen from the axis turns between the ends, positive about z. Ways that turn by it
  /// to half a turn are taken; none: all are.
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

/// A law of the cart, and what it had to keep out of.
struct CartLaw {
  std::vector<double> x;            ///< (M,) [m] at the samples
  std::vector<double> lower;        ///< (M,) [m] λ− for radius + margin; +∞ where nothing is forbidden
  std::vector<double> upper;        ///< (M,) [m] λ+ for radius + margin; −∞ where nothing is forbidden
  std::vector<double> multipliers;  ///< (M,) [m] μ: positive where the law is held up, negative where it is held down
  std::vector<CartRegion> regions;  ///< parts of the forbidden region, in the order of time
  /// The string's corners: where [samples], and at which position [m]; straight between them. A corner at the tip of a
  /// region can lie between samples.
  std::vector<double> corners;
  std::vector<double> corner_x;  ///< the positions of the corners [m]
  double energy = 0.0;           ///< [m²] Σ (Δx)²; where a corner lies between samples Σ (Δx)²/Δi, the string's own
  double turn = 0.0;             ///< [rad] of P's azimuth
  int strings = 0;               ///< taut strings drawn
};

/// λ∓ (6) of every sample [m]; +∞ and −∞, the empty interval, where |y| ≥ radius.
void forbidden_intervals(const PlanarPath& path, double radius, std::vector<double>& lower, std::vector<double>& upper);

/// The shortest string through lower ≤ x ≤ upper over increasing abscissae `at`; the ends are where both are equal.
/// Writes x, and the indices of its corners, both ends among them. One pass of a funnel, O(M).
/// \throws Error where sizes differ, an abscissa does not increase, lower > upper somewhere, or an end is not given
void taut_string(const std::vector<double>& at, const std::vector<double>& lower, const std::vector<double>& upper,
                 std::vector<double>& x, std::vector<int>& corners);

/// The law of the least energy from start to end [m] along `path` (M ≥ 2), outside the circle of `radius` [m] > 0.
///
/// Between samples P and the cart move on straight lines. Tips of regions between samples are kept out of exactly; on
/// curved parts of the border the law is below it, between two samples, by at most max |Δ²λ|/8: the margin's business.
///
/// A part of the region that holds an end has its side from there. For the others, the best of all sides that agree
/// with `turn`, the range and the speed is found by branch and bound: leaving a part of the region out can only lower
/// energy and top speed.
///
/// Where the string accelerates more than it may, or `at_rest` holds, a quadratic program with bounds on second
/// differences takes its place, on the same sides: the law of the least energy that keeps all limits, to about 1e-9 of
/// them, by an interior-point method in O(M) an iteration. It bends everywhere, so that μ does not tell where it
/// touches.
/// \throws CartError with the reason where there is none
/// \throws Error where an argument is out of its range
CartLaw cart_law(const PlanarPath& path, double start, double end, double radius, const CartOptions& options = {});

/// Settings of the gradient descent.
struct CartDescent {
  double alpha = 0.01;           ///< [1/mm²] > 0, weight of smoothness in (10), between samples
  double step = 20.0;            ///< [mm²] > 0, η; stable below 1/(4 alpha)
  int max_iterations = 53707;    ///< ≥ 1
  bool until_admissible = true;  ///< stop at the first law that is admissible, to `depth`
  /// [mm] ≥ 0. Kicks out of the region and creep into it keep a law at the border hopping: where no sample is deeper
  /// inside than this, those inside are put on the border at the end.
  double depth = 1e-3;
};

/// Gradient descent on the paper's functional F = ΣH(x_i) + α Σ(x_{i+1} − x_i)² (10), H = max(0, 1 − |x − x_P|/h) with
/// h half the forbidden interval, lengths in mm as there. Works on x (M,) [m], whose ends stay. H has a kink on the
/// centre line, where its slope counts as zero.
/// \returns iterations done
/// \throws Error where an argument is out of its range
int cart_descent(const std::vector<double>& lower, const std::vector<double>& upper, std::vector<double>& x,
                 const CartDescent& options = {});

SIGMAIK_SAME_LAYOUT(CartLaw, CartOptions, CartRegion, CartDescent, PlanarPath);

}  // namespace sigmaik::planning
