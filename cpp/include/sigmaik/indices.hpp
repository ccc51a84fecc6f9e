#pragma once
/// \file indices.hpp
/// How far from singular: indices of a Jacobian and their gradients in the joints.
///
/// All indices are functions of the singular values σ_1 ≥ … ≥ σ_m of an m×n Jacobian J. Where n < m the missing values
/// are zero, because the arm cannot do all rows of such a task. "Infinite at a singularity" means infinite where σ_m ≤
/// 1e-14 σ_1, because rounding leaves this much of a zero. Lengths and angles mix in J: `length_scale` [m] is the
/// length that weighs as much as one radian, as in VelocitySolver.

#include <cstddef>
#include <string>

#include <sigmaik/chain.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik {

/// An index of a Jacobian: how far from singular it is.
enum class Index {
  Manipulability,    ///< √det(JJᵀ) = Π σ_i (Yoshikawa 1985)
  ConditionNumber,   ///< σ_1/σ_m, 1 at best, +inf at a singularity (the dexterity index of Petrović et al., eq. 5)
  MinSingularValue,  ///< σ_m
  /// ‖log(Σ^{-1/2} JJᵀ Σ^{-1/2})‖_F², squared distance between ellipsoids in the affine-invariant metric, Σ = kI where
  /// no other is given (Petrović et al., eqs. 8 to 12): 0 where JJᵀ = Σ, +inf at a singularity.
  GeometryAware,
};

/// "manipulability", "condition_number", "min_singular_value", "geometry_aware".
const char* to_string(Index index) noexcept;

/// The default of k: an upper bound of the largest eigenvalue σ² of JJᵀ for an arm of about one metre.
inline constexpr double kDefaultScale = 6.0;

/// Settings of IndexFunction.
struct IndexOptions {
  double k = kDefaultScale;  ///< > 0, of the geometry-aware index: Σ = kI
  /// (m, m) symmetric positive definite, Σ instead of kI; empty: kI.
  TaskMatrix sigma{};
  double length_scale = 1.0;  ///< [m] > 0
};

/// An index with its options checked and prepared.
class IndexFunction {
 public:
  /// \throws Error where an option is out of its range or Σ is not positive definite
  explicit IndexFunction(Index index, const IndexOptions& options = {});

  /// Which index.
  Index index() const noexcept { return index_; }
  /// Number of rows that a Jacobian must have; 0: any number.
  int rows() const noexcept { return static_cast<int>(whiten_.rows()); }

  /// The index of an m×n Jacobian with finite entries; rows from the fourth on are angular. Real time.
  double value(const TaskJacobianRef& jacobian) const noexcept;

  /// The index of a chain at q (n,), with the gradient (n,) [per rad or m]. Real time.
  ///
  /// Closed form through ∂J/∂q: ∂σ_i/∂q_k = u_iᵀ ∂_kJ v_i. The gradient is always finite. Where an index is not
  /// differentiable, the gradient is the slope along the u_i, v_i that the decomposition chose: at a repeated σ_min,
  /// and at σ_min = 0, where the slope of |σ| has either sign. Where the index is +inf (condition number,
  /// geometry-aware, at a singularity), no direction leads out, and the gradient is zero.
  double value(const Chain& chain, const JointRef& q, JointVector& gradient) const noexcept;
  /// The same from the Jacobian of a chain alone.
  double gradient(const Jacobian& jacobian, JointVector& gradient) const noexcept;

 private:
  // The index, and its slope in the entries of J: the sum of ∂index/∂σ_i u_i v_iᵀ.
  double slope(const Jacobian& jacobian, Jacobian& slope) const noexcept;

  Index index_;
  double angular_, inverse_k_;
  TaskMatrix whiten_;  // Σ^{-1/2}, or empty
};

/// Π σ_i of an m×n Jacobian. Real time, as the next three functions.
double manipulability(const TaskJacobianRef& jacobian) noexcept;
/// σ_1/σ_m, +inf where σ_m = 0.
double condition_number(const TaskJacobianRef& jacobian) noexcept;
/// σ_m.
double min_singular_value(const TaskJacobianRef& jacobian) noexcept;
/// Σ log²(σ_i²/k), +inf where a σ_i = 0.
double geometry_aware(const TaskJacobianRef& jacobian, double k = kDefaultScale) noexcept;

/// k of a chain: kDefaultScale, or the largest eigenvalue of JJᵀ over the joint ranges times 1.1 if this is larger, so
/// that the sphere Σ = kI contains every ellipsoid. The search takes 1000 quasi-random configurations and an ascent
/// from the best one. The result is the same on every machine, and takes a few ms.
double reference_scale(const Chain& chain, double length_scale = 1.0);

/// Values, and gradients where `gradient` is not null, at `count` configurations.
/// \param q (count, n) in C order, finite
/// \param value out: (count,)   \param gradient out: (count, n), or null
/// \param threads ≥ 1, the most that work at once
void evaluate(const Chain& chain, const IndexFunction& index, std::size_t count, const double* q, double* value,
              double* gradient = nullptr, int threads = 1);

SIGMAIK_SAME_LAYOUT(IndexFunction, IndexOptions);

}  // namespace sigmaik
