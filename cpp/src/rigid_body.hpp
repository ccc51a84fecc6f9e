#pragma once
// What a mass distribution must satisfy to belong to a rigid body.

#include <algorithm>
#include <cmath>
#include <string>

#include <sigmaik/chain.hpp>

#include "message.hpp"
#include "symmetric_eigen.hpp"

namespace sigmaik::detail {

/// The reason why no rigid body has this mass distribution; empty where a body can have it. A body's principal moments
/// are ∫ (y² + z²) dm and the like, so that none is negative, and none is more than the sum of the other two.
inline std::string inertia_defect(const Inertia& inertia) {
  const Eigen::Matrix3d& t = inertia.tensor;
  if (!(std::isfinite(inertia.mass) && inertia.mass >= 0.0)) {
    return message("mass = ", inertia.mass, " must be finite and not negative");
  }
  if (!inertia.center_of_mass.allFinite() || !t.allFinite()) return "an entry is not finite";
  const double slack = 1e-9 * t.cwiseAbs().maxCoeff();  // rounding of a data sheet's numbers
  if ((t - t.transpose()).cwiseAbs().maxCoeff() > slack) return "the tensor is not symmetric";
  const JointVector moments = symmetric_eigen(t).values;
  if (moments[0] < -slack || moments[2] > moments[0] + moments[1] + slack) {
    return message("principal moments ", moments[0], ", ", moments[1], ", ", moments[2],
                   " are no body's: none is negative, nor more than the sum of the other two");
  }
  if (inertia.mass == 0.0 && !t.isZero(0.0)) return "a tensor without mass";
  return {};
}

/// [kg m²] The least principal moment; zero where it is negative by no more than rounding.
inline double least_moment(const Inertia& inertia) {
  const Eigen::Matrix3d symmetric = 0.5 * (inertia.tensor + inertia.tensor.transpose());
  const double least = symmetric_eigen(symmetric).values[0];
  return least < -1e-12 - 1e-9 * symmetric.cwiseAbs().maxCoeff() ? least : std::max(least, 0.0);
}

}  // namespace sigmaik::detail
