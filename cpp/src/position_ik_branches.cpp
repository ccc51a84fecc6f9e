#include "position_ik_branches.hpp"

#include <algorithm>

namespace sigmaik::detail {
namespace {

constexpr Effort kBack{8, 0.5, false, false};  // steps back to the pose after a step along the self-motion
constexpr double kLongest = 1.0;               // of a step [rad]
constexpr double kShortest = 1e-3;             // a step that is shorter than this, and no progress: the minimum [rad]

// Inverse weights of the joints, for min Σ (Δq_i − wish_i)²/w_i. For the largest distance these are the weights of
// iteratively reweighted least squares for the sixth power: joints that have a shorter way give way to the others.
JointVector inverse_weights(const Pull& aim, const JointVector& d) noexcept {
  JointVector out = aim.unit.cwiseAbs2();
  if (!aim.largest) return out;
  const double most = aim.distance(d);
  for (int i = 0; i < out.size(); ++i) {
    const double part = std::abs(d[i]) / (aim.unit[i] * most), square = part * part;
    out[i] /= 1e-3 + square * square;
  }
  return out;
}

}  // namespace

void pull(const Descent& search, const Pull& aim, DescentPoint& point) noexcept {
  const DescentProblem& problem = search.problem();
  JointVector d = problem.difference(aim.to, point.q);
  double distance = aim.distance(d), longest = kLongest;
  DescentPoint next;
  for (int i = 0; i < aim.steps && distance > 0.0; ++i) {
    const double length = d.cwiseAbs2().cwiseQuotient(problem.reach).cwiseSqrt().maxCoeff();
    const JointVector wish = std::min(1.0, longest / length) * d;
    next.q = search.self_motion(point, wish, inverse_weights(aim, d));
    const bool back = search.run(next, kBack);
    const JointVector left = problem.difference(aim.to, next.q);
    const double now = aim.distance(left);
    if (back && now < (1.0 - aim.progress) * distance) {
      point = next;
      d = left;
      distance = now;
      longest = std::min(2.0 * longest, kLongest);
    } else {
      longest = 0.25 * std::min(longest, length);
      if (longest < kShortest) return;
    }
  }
}

}  // namespace sigmaik::detail
