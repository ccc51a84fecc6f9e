#pragma once
/// \file clearance.hpp
/// How near a motion comes to singularities, between its nodes too: a grid can step over a singular set unseen.
///
/// A set of codimension 1, a wall in the joints' space, has a signed residual. Where this residual has different signs
/// at start and goal, every path crosses the wall, so one crossing is unavoidable. The other crossings of a wall, and
/// all those of sets of higher codimension, are avoidable: there is a way round.

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <sigmaik/chain.hpp>
#include <sigmaik/singularities.hpp>

namespace sigmaik::planning {

/// A motion goes through a singular set here, or so near to it that the set's potential does not tell the difference.
struct Crossing {
  std::string name;       ///< of the set
  double t = 0.0;         ///< [s]
  std::vector<double> q;  ///< (n,) [rad or m] there
  double psi = 0.0;       ///< ψ there: 0 on the set
  bool avoidable = true;  ///< a path from start to goal can do without this crossing

  /// Whether all members are equal.
  bool operator==(const Crossing&) const = default;
};

/// Singularity along a motion that is sampled densely, M samples.
struct Clearance {
  std::vector<double> t;               ///< (M,) [s]
  std::vector<double> manipulability;  ///< (M,) √det(JJᵀ)
  std::vector<std::string> names;      ///< of the c singular sets that are known; empty where none are
  std::vector<double> psi;             ///< (M, c) in C order: ψ of every set, 0 on it
  std::vector<Crossing> crossings;     ///< in the order of time

  /// The smallest √det(JJᵀ) of all samples.
  double min_manipulability() const noexcept;
  /// The smallest ψ of all sets and samples; +inf where no sets are known.
  double min_psi() const noexcept;
  /// Index into `names` of the set with the smallest ψ; −1 where no sets are known.
  int nearest_set() const noexcept;
};

/// Clearance of the configurations q at increasing times t.
/// \param sets the arm's singular sets; none: only the manipulability is measured
/// \param t (M,) [s]   \param q (M, n) in C order [rad or m]
/// \param width η₂ [1/rad²]: sets of codimension above 1 count as crossed where ψ < 1/(2 width) between ends that are
///     both outside. Nearer than this inflection a potential does not push outwards reliably.
/// \throws Error where sizes do not fit, or `width` is not positive
Clearance clearance(const Chain& chain, const std::optional<SingularSets>& sets, std::vector<double> t,
                    const std::vector<double>& q, double width = 400.0);

}  // namespace sigmaik::planning
