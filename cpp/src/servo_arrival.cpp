// How fast the rule's answer may be done: so that the arm can stop at its target, and within the velocity limits.

#include <algorithm>
#include <cmath>
#include <limits>

#include <sigmaik/servo.hpp>

#include "numbers.hpp"

namespace sigmaik {

using detail::kInfinity;

// Pose targets: the part of q̇ that closes the error becomes no faster than the joints can stop within what is left of
// the way, q̇/gain, and calm. The part that follows the target's own motion stays. Returns whether q̇ changed.
bool Servo::arrive(const Twist& feedforward, JointVector& qdot) noexcept {
  const double gain = std::max(options_.gain_linear, options_.gain_angular);
  if (gain == 0.0) return false;
  if (feedforward.isZero(0.0)) {
    double part = calm() * tracker_.arrival(qdot, gain);
    if (rested_ > settling_time()) {  // the fade starts from no more than the velocity limits
      part /= std::max(1.0, qdot.cwiseProduct(solver_.pace().slowness).cwiseAbs().maxCoeff());
    }
    if (part < 1.0) qdot *= part;
    return part < 1.0;
  }
  VelocitySolver solver = solver_;  // the decomposition of this cycle is the warm start
  const JointVector follow = solver.solve(state_.jacobian, feedforward, JointVector(), state_.tip.linear()).qdot;
  const JointVector close = qdot - follow;
  const double part = calm() * tracker_.arrival(close, gain);
  if (part < 1.0) qdot = follow + part * close;
  return part < 1.0;
}

// In (0, 1], the factor on the motion towards a target that rests; see Servo, Rest.
double Servo::calm() const noexcept {
  constexpr int kFree = 2;       // reversals that a path takes now and then, where it bends
  constexpr double kLess = 0.7;  // of the gain stays at each further reversal
  constexpr double kFade = 1.0;  // [s] time constant after the settling time
  double part = 1.0;
  if (reversals_ > kFree) part = std::pow(kLess, std::min(reversals_ - kFree, 20));
  if (rested_ > settling_time()) part *= std::exp(std::max(-50.0, (settling_time() - rested_) / kFade));
  return part;
}

// What is expected of a target that rests starts anew: its settling time, and the count of reversals.
void Servo::expect_motion() noexcept {
  rested_ = 0.0;
  reversals_ = 0;
  last_way_ = JointVector::Zero(chain_.dof());
}

// A reversal: q̇, in parts of the velocity limits, points against the fastest q̇ since the last reversal.
void Servo::count_reversals(const JointVector& qdot) noexcept {
  constexpr double kSlow = 1e-4;  // of the velocity limits: a slower motion is at rest
  double along = 0.0, now = 0.0, then = 0.0;
  for (int i = 0; i < chain_.dof(); ++i) {
    const double v = tracker_.part_of_limit(i, qdot[i]), w = tracker_.part_of_limit(i, last_way_[i]);
    along += v * w;
    now += v * v;
    then += w * w;
  }
  if (now < kSlow * kSlow) return;
  if (along < 0.0) ++reversals_;
  if (along < 0.0 || now > then) last_way_ = qdot;
}

// Velocity limits: the motion keeps its direction, and gives up speed. Where the arm can move without moving the tool,
// this motion takes part first (Flacco, De Luca and Khatib 2015): of all velocities inside the limits whose twist is a
// part s of the rule's, the answer has the largest s, and of these the answer is the nearest to the rule's. Exact rows
// have a part s of their own, which comes before that of the other rows.
void Servo::slow_down(ServoStep& step) noexcept {
  const VelocityScale scale = tracker_.velocity_scale(step.qdot);
  if (scale.joint < 0) return;
  const JointVector asked = step.qdot, scaled = scale.part * asked;
  const bool by_priority = has_exact() && lost_ < 1.0, together = !has_exact() || lost_ > 0.0;
  JointVector first = scaled, second = scaled;
  bool by_rows = false;
  if (options_.on_limit != OnLimit::Scale) {
    if (by_priority) by_rows = slow_down_by_rows(asked, true, first, step);
    const bool whole = solver_.spectrum().size() >= chain_.dof();
    if (together && !whole) by_rows = slow_down_by_rows(asked, false, second, step) || by_rows;
  }
  if (!by_rows) step.limiting_joints |= static_cast<std::uint16_t>(1u << scale.joint);
  step.qdot = has_exact() ? mixed(first, second) : second;
}

// Joints with weights have x_j = √w_j (q̇_j − q̇_rule,j).
// In x = q̇ − q̇_rule and t = (1 − s)/k: min |x|² + |t|² + |z|² where the rows' parts of x + k t q̇_rule are zero. In the
// coordinates of the singular vectors the rows are v_iᵀ, so that a singular direction of J weighs as much as another.
// With exact rows there are two groups of rows, and the second group consists of the other rows' part that leaves the
// exact rows as they are. Singular directions of this part may be missed, by z: the row is (σ_i/w_i) v_iᵀ, and z_i has
// the weight 1 − σ_i/w_i. Returns false where the numbers are too far apart.
bool Servo::slow_down_by_rows(const JointVector& asked, bool by_priority, JointVector& qdot, ServoStep& step) noexcept {
  constexpr double kSlower = 1e-3;      // k: slower motion costs 1/k² times as much as another motion of the joints
  constexpr double kSlowerRest = 3e-2;  // of the rows that are not exact: a thousand times less
  const int n = chain_.dof();
  const Spectrum& spectrum = by_priority ? exact_spectrum_ : solver_.spectrum();
  const int first = static_cast<int>(spectrum.size());
  const int second = by_priority && rest_.rows() != 0 ? static_cast<int>(rest_spectrum_.size()) : 0;
  const int groups = second > 0 ? 2 : 1, unknowns = n + groups + second;
  const double largest = asked.cwiseAbs().maxCoeff();
  problem_.C.setZero(first + second, unknowns);
  problem_.d.setZero(first + second);
  problem_.G.resize(0, 0);
  problem_.h.resize(0);
  problem_.lower.setConstant(unknowns, -kInfinity);
  problem_.upper.setConstant(unknowns, kInfinity);
  for (int i = 0; i < first; ++i) {
    problem_.C.row(i).head(n) = spectrum.v(i).transpose();
    problem_.C(i, n) = kSlower * spectrum.v(i).dot(asked) / largest;
  }
  for (int i = 0; i < second; ++i) {
    const double weight = rest_resolution_.weight[static_cast<std::size_t>(i)];
    const double regular = weight > 0.0 ? std::min(1.0, rest_spectrum_.sigma(i) / weight) : 0.0;
    problem_.C.row(first + i).head(n) = regular * rest_spectrum_.v(i).transpose();
    problem_.C(first + i, n + 1) = regular * kSlowerRest * rest_spectrum_.v(i).dot(asked) / largest;
    problem_.C(first + i, n + groups + i) = 1.0 - regular;
  }
  for (int i = 0; i < n; ++i) {
    const double limit = tracker_.velocity_limit(i), heavy = heaviness(i);
    problem_.lower[i] = heavy * (-limit - asked[i]) / largest;
    problem_.upper[i] = heavy * (limit - asked[i]) / largest;
    if (heavy != 1.0) problem_.C.col(i) /= heavy;
  }
  problem_.lower.segment(n, groups).setZero();
  problem_.upper[n] = 1.0 / kSlower;
  if (groups > 1) problem_.upper[n + 1] = 1.0 / kSlowerRest;
  const LeastSquaresSolution solution = slowing_.solve(problem_);
  if (solution.status != LeastSquaresStatus::Optimal) return false;
  qdot = asked;
  for (int i = 0; i < n; ++i) qdot[i] += largest * solution.x[i] / heaviness(i);
  step.limiting_joints |= static_cast<std::uint16_t>((solution.at_lower | solution.at_upper) & ((1u << n) - 1u));
  for (int i = 0; i < n; ++i) {
    const double limit = tracker_.velocity_limit(i);
    qdot[i] = std::clamp(qdot[i], -limit, limit);
  }
  return true;
}

}  // namespace sigmaik
