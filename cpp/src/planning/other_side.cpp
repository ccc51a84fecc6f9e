#include "other_side.hpp"

#include <algorithm>
#include <array>

#include <sigmaik/spectrum.hpp>

namespace sigmaik::planning::detail {

TimeOptimalProblem bent(const Chain& chain, const TimeOptimalProblem& problem, const JointVector& direction) {
  constexpr double kBend = 0.6;  // [rad or m]
  const JointLimits& limits = chain.limits();
  TimeOptimalProblem out = problem;
  out.bend = kBend * direction;
  if (problem.bend.size() != 0) out.bend += problem.bend;
  for (int i = 0; i < chain.dof(); ++i) {
    const double low = limits.lower[i] - std::min(problem.start[i], problem.goal[i]);
    const double high = limits.upper[i] - std::max(problem.start[i], problem.goal[i]);
    out.bend[i] = std::clamp(out.bend[i], 0.4 * low, 0.4 * high);
  }
  return out;
}

JointVector other_side(const SingularSets& sets, const Crossing& crossing, const JointVector& start) {
  constexpr double kStep = 1e-6;  // [rad]
  int index = 0, first = 0;
  while (sets.set(index).name != crossing.name) first += sets.set(index++).codimension;
  const int codimension = sets.set(index).codimension, n = sets.dof();
  using Residuals = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxCodimension, 1>;
  const auto residuals = [&](const JointVector& q) -> Residuals {
    std::array<double, kMaxResiduals> all;
    sets.residuals(q, all);
    return Eigen::Map<const Eigen::VectorXd>(all.data() + first, codimension);
  };

  const JointVector at = Eigen::Map<const Eigen::VectorXd>(crossing.q.data(), n);
  TaskJacobian slope(codimension, n);
  for (int j = 0; j < n; ++j) {
    JointVector up = at, down = at;
    up[j] += kStep;
    down[j] -= kStep;
    slope.col(j) = (residuals(up) - residuals(down)) / (2.0 * kStep);
  }
  Residuals aim;
  if (codimension == 1) {
    aim = residuals(start).cwiseSign();
  } else {
    aim = -residuals(at);
    if (!(aim.norm() > 1e-9)) aim = Residuals::Unit(codimension, 0);
  }
  // The shortest direction along which the residuals change by `aim`.
  Spectrum spectrum;
  spectrum.decompose(slope);
  JointVector direction = JointVector::Zero(n);
  for (int i = 0; i < codimension; ++i) {
    const double sigma = spectrum.sigma(i);
    if (sigma > 1e-15 * spectrum.sigma(0)) direction += spectrum.u(i).dot(aim) / sigma * spectrum.v(i);
  }
  const double length = direction.norm();
  if (length > 0.0) direction /= length;
  return direction;
}

}  // namespace sigmaik::planning::detail
