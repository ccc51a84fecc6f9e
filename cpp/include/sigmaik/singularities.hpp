#pragma once
/// \file singularities.hpp
/// Known singular sets of three arms, potentials around them, and their manipulability in closed form
/// (Beck et al. 2022, eqs. 14, 24 to 27, 33 to 37; corrected where they do not hold, and completed).
///
/// On a singular set all its residuals r vanish. Residuals are trigonometric polynomials of the joint positions without
/// a unit, scaled so that near the set ψ = Σ r² is about the squared distance in the joints' space. The number of
/// residuals is the set's codimension: a set of codimension 1 is a wall, and r changes its sign across it; there is a
/// way round sets of higher codimension.

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sigmaik/chain.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik {

inline constexpr int kMaxSets = 4;         ///< most sets of an arm
inline constexpr int kMaxResiduals = 8;    ///< most residuals of an arm, all sets together
inline constexpr int kMaxCodimension = 2;  ///< most equations of a set

/// A singular set, described.
struct SingularSet {
  std::string name;         ///< "elbow"
  std::string condition;    ///< in the chain's joint positions: "sin q4 = 0"
  int codimension;          ///< number of residuals
  std::vector<int> joints;  ///< indices of the joints in the condition
};

/// Height and width of the potentials φ_i = exp(η₁ − η₂ ψ_i) (eq. 26), and their weights in the sum.
struct Potential {
  double eta1 = 7.783224016336037;                           ///< log of the height: log 2400 (table 2)
  double eta2 = 400.0;                                       ///< [1/rad²] inverse squared width
  std::array<double, kMaxSets> weights{1.0, 1.0, 1.0, 1.0};  ///< ≥ 0, one a set: factors of the sum
};

/// An operation of a recorded expression. Operands are indices of earlier operations.
struct Operation {
  /// What an operation computes.
  enum Kind { Constant, Sin, Cos, Add, Subtract, Multiply };
  Kind kind;           ///< what is computed
  int a = 0;           ///< first operand; of Sin and Cos, the joint
  int b = 0;           ///< second operand
  double value = 0.0;  ///< of a Constant
};
/// A recorded expression: operations, and which of them are the results.
struct Tape {
  std::vector<Operation> operations;  ///< in the order of evaluation
  std::vector<int> results;           ///< indices of the operations whose values are the results
};

/// The known singular sets of an arm. A value, cheap to copy, safe to use from many threads. q is (n,) [rad] in the
/// chain's (URDF's) angles. Calls on q are real time; a q of a wrong size is a programming error.
class SingularSets {
 public:
  /// \throws Error with the known names, where `name` is not one of them
  static SingularSets load(const std::string& name);
  /// Names that load() knows, those of the shipped arms.
  static std::vector<std::string> names();
  /// The sets of a chain with the kinematics of a known arm, whatever its base, tool and names.
  static std::optional<SingularSets> of(const Chain& chain);

  /// Name of the arm.
  const std::string& name() const noexcept;
  /// Number n of movable joints.
  int dof() const noexcept;
  /// Number of sets, c.
  int size() const noexcept;
  /// Set i.
  const SingularSet& set(int i) const noexcept;
  /// Number of residuals, the sum of all codimensions.
  int residual_count() const noexcept;

  /// Residuals with their sign, set after set; returns how many.
  int residuals(const JointRef& q, std::array<double, kMaxResiduals>& r) const noexcept;
  /// ψ_i ≥ 0, zero exactly on set i; returns how many.
  int psi(const JointRef& q, std::array<double, kMaxSets>& out) const noexcept;
  /// ψ_i with gradient (n,) and Hessian (n, n).
  double psi(int i, const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept;

  /// Σ_i w_i φ_i.
  double potential(const JointRef& q, const Potential& p = {}) const noexcept;
  /// The same, with its gradient (n,).
  double potential(const JointRef& q, const Potential& p, JointVector& gradient) const noexcept;
  /// The same, with its gradient (n,) and Hessian (n, n).
  double potential(const JointRef& q, const Potential& p, JointVector& gradient, JointMatrix& hessian) const noexcept;

  /// √det(JJᵀ) in closed form, accurate down to zero.
  double manipulability(const JointRef& q) const noexcept;
  /// The same with its gradient (n,), which is zero on a singular set, where no gradient exists.
  double manipulability(const JointRef& q, JointVector& gradient) const noexcept;
  /// The same with its gradient (n,) and Hessian (n, n), which are zero on a singular set, where neither exists.
  double manipulability(const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept;

  /// The residuals as an expression in the chain's joint positions.
  Tape residual_tape() const;
  /// The terms whose squares add up to m², as an expression in the chain's joint positions.
  Tape manipulability_tape() const;

  /// Data and formulas of one arm.
  class Model;

 private:
  explicit SingularSets(const Model* model) noexcept : model_(model) {}
  const Model* model_;  // static
};

SIGMAIK_SAME_LAYOUT(SingularSets, SingularSet, Potential, Tape);

}  // namespace sigmaik
