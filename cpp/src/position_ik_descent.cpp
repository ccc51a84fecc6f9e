#include "position_ik_descent.hpp"
#include "mimic.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <sigmaik/pose.hpp>

#include "numbers.hpp"

namespace sigmaik::detail {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kDamping = 1e-2, kLeast = 1e-5, kMost = 1e6;  // of the damping over E: at the start, least, most
constexpr double kGrowth = 8.0;     // of the damping after a step that is not accepted; then twice, four times, … this
constexpr double kNothing = 1e-15;  // a step that promises to take less than this part of E away is none
constexpr double kLeastDamping = 1e-13;  // part of the trace: keeps the factorisation positive at a singularity

// Solves A x = b for a symmetric positive definite A, by A = L D Lᵀ. A's lower triangle becomes L and D.
inline void solve_positive(Matrix6& a, Row6& b) noexcept {
  double inverse[6];
  for (int j = 0; j < 6; ++j) {
    inverse[j] = 1.0 / a(j, j);
    for (int i = j + 1; i < 6; ++i) {
      const double factor = a(i, j) * inverse[j];
      for (int k = i; k < 6; ++k) a(k, i) -= factor * a(k, j);
    }
  }
  for (int j = 0; j < 6; ++j) {
    b[j] *= inverse[j];
    for (int i = j + 1; i < 6; ++i) b[i] -= a(i, j) * b[j];
  }
  for (int j = 5; j >= 0; --j) {
    double sum = 0.0;
    for (int i = j + 1; i < 6; ++i) sum += a(i, j) * b[i];
    b[j] -= sum * inverse[j];
  }
}

inline void add_column(Matrix6& a, const Row6& column, double weight) noexcept {
  for (int j = 0; j < 6; ++j) a.col(j) += (weight * column[j]) * column;
}

}  // namespace

DescentProblem::DescentProblem(const Chain& arm, const PositionIkOptions& options, bool turns, double hold)
    : chain(arm),
      length(arm.characteristic_length()),
      rows(options, length, hold),
      tolerance(options.tolerance),
      lower(arm.limits().lower),
      upper(arm.limits().upper),
      reach(JointVector::Ones(arm.dof())) {
  for (int i = 0; i < arm.dof(); ++i) {
    if (arm.joint_types()[static_cast<std::size_t>(i)] == JointType::Prismatic) {
      reach[i] = length * length;
      continue;
    }
    if (!repeats(arm, i)) continue;
    const bool endless = std::isinf(lower[i]) && std::isinf(upper[i]);
    if (endless || (turns && upper[i] - lower[i] >= kTurn)) {
      turning |= 1u << i;
      lower[i] = -kInfinity;
      upper[i] = kInfinity;
    }
  }
}

bool DescentProblem::place(const JointRef& near, JointVector& q, double rounding) const noexcept {
  const JointLimits& limits = chain.limits();
  bool inside = true;
  for (int i = 0; i < q.size(); ++i) {
    if (repeats(chain, static_cast<int>(i))) {
      double turns = std::round((near[i] - q[i]) / kTurn);
      turns += std::max(0.0, std::ceil((limits.lower[i] - rounding - q[i]) / kTurn - turns));
      turns -= std::max(0.0, std::ceil((q[i] - limits.upper[i] - rounding) / kTurn + turns));
      if (turns != 0.0) q[i] += kTurn * turns;
    }
    inside = inside && q[i] >= limits.lower[i] - rounding && q[i] <= limits.upper[i] + rounding;
    q[i] = std::clamp(q[i], limits.lower[i], limits.upper[i]);
  }
  return inside;
}

JointVector DescentProblem::difference(const JointVector& q, const JointVector& from) const noexcept {
  JointVector d = q - from;
  for (int i = 0; i < d.size(); ++i) {
    if ((turning >> i & 1u) != 0) d[i] -= kTurn * std::round(d[i] / kTurn);
  }
  return d;
}

void Descent::evaluate(DescentPoint& point) const noexcept {
  update(problem_.chain, point.q, point.state);
  point.error = pose_error(point.state.tip, target_);
  const PoseRows& rows = problem_.rows;
  if (rows.plain()) {
    point.residual = point.error;
    point.residual.head<3>() /= problem_.length;
  } else {
    point.rows = rows.errors(point.state.tip, target_, point.error) + shift_;
    point.residual = rows.weighted(rows.outside(point.rows));
  }
  point.cost = point.residual.squaredNorm();
}

bool Descent::reached(const DescentPoint& point) const noexcept {
  if (shifted_) return false;
  return problem_.tolerates(problem_.rows.plain() ? Row6(point.error) : problem_.rows.outside(point.rows));
}

bool Descent::reached_held(const DescentPoint& point) const noexcept {
  return problem_.tolerates(problem_.rows.held(Row6(point.rows - shift_)));
}

// A step of the rows that are outside their ranges. Rows that the step would take outside are held at the end of their
// range, and the step is computed again.
//
// Of a plain problem J is the Jacobian itself. The exact derivative of the orientation error φ has the factor J_r⁻¹(φ),
// the inverse of SO(3)'s right Jacobian, which neither moves the minimum nor changes the gradient, because φᵀJ_r⁻¹(φ) =
// φᵀ. With a part of the rows the factor matters, and so does the turn of the tool's axes.
JointVector Descent::step(const DescentPoint& point, double damping, const JointVector* wish,
                          const JointVector& inverse_weight, double& expected) const noexcept {
  constexpr int kTries = 7;  // one for each row that may be added
  Columns columns = point.state.jacobian;
  const PoseRows& rows = problem_.rows;
  if (rows.plain()) {
    columns.topRows<3>() /= problem_.length;
    return bounded_step(point.q, columns, point.residual, damping, wish, inverse_weight, expected);
  }
  RowErrors errors = rows.rates(point.state.tip, target_, point.error);
  errors.y = point.rows;
  PoseRows::Ends ends = rows.beyond(errors.y);
  JointVector next;
  for (int i = 0; i < kTries; ++i) {
    Row6 residual;
    Matrix6 matrix;
    rows.linear(errors, ends, residual, matrix);
    columns = matrix * point.state.jacobian;
    next = bounded_step(point.q, columns, residual, damping, wish, inverse_weight, expected);
    const Row6 ahead = errors.y - errors.rate * (point.state.jacobian * (next - point.q));
    expected = rows.weighted(rows.outside(ahead)).squaredNorm();
    if (!rows.add_beyond(ahead, ends)) break;
  }
  return next;
}

// Minimises |r − J Δq|² + λ Σ (Δq_i − wish_i)²/w_i inside the limits, through
//   Δq = wish + W Jᵀ (J W Jᵀ + λ I)⁻¹ (r − J wish)
// of the joints that are free. A joint that this takes beyond a limit is fixed at the limit, and the others are
// computed again. The result is q + Δq; `expected` is E there if the arm were linear, as r − J Δq = λ (J W Jᵀ + λ I)⁻¹
// r.
JointVector Descent::bounded_step(const JointVector& q, const Columns& columns, const Row6& residual, double damping,
                                  const JointVector* wish, const JointVector& inverse_weight,
                                  double& expected) const noexcept {
  const int n = static_cast<int>(q.size());
  Matrix6 a = Matrix6::Zero();
  Row6 rest = residual;
  for (int i = 0; i < n; ++i) {
    const Row6 column = columns.col(i);
    add_column(a, column, inverse_weight[i]);
    if (wish != nullptr) rest -= (*wish)[i] * column;
  }
  const double lambda = damping + kLeastDamping * a.trace() + 1e-300;
  a.diagonal().array() += lambda;

  JointVector next(n);
  std::uint32_t fixed = 0;
  for (;;) {
    Matrix6 factor = a;
    Row6 y = rest;
    solve_positive(factor, y);
    std::uint32_t beyond = 0;
    for (int i = 0; i < n; ++i) {
      if ((fixed >> i & 1u) != 0) continue;
      const double ahead = wish != nullptr ? (*wish)[i] : 0.0;
      next[i] = q[i] + ahead + inverse_weight[i] * columns.col(i).dot(y);
      if (next[i] >= problem_.lower[i] && next[i] <= problem_.upper[i]) continue;
      beyond |= 1u << i;
      next[i] = next[i] < problem_.lower[i] ? problem_.lower[i] : problem_.upper[i];
    }
    if (beyond == 0) {
      expected = lambda * lambda * y.squaredNorm();
      return next;
    }
    fixed |= beyond;
    for (int i = 0; i < n; ++i) {
      if ((beyond >> i & 1u) == 0) continue;
      const Row6 column = columns.col(i);
      add_column(a, column, -inverse_weight[i]);
      rest += ((wish != nullptr ? (*wish)[i] : 0.0) - (next[i] - q[i])) * column;
    }
  }
}

JointVector Descent::self_motion(const DescentPoint& point, const JointVector& wish,
                                 const JointVector& inverse_weight) const noexcept {
  double expected;
  return step(point, 1e-9, &wish, inverse_weight, expected);
}

// The last step is cheap, and quadratic: from 1e-6 to rounding.
void Descent::polish(DescentPoint& point) const noexcept {
  DescentPoint next;
  double expected;
  for (int i = 0; i < 3 && point.cost > 1e-24; ++i) {
    next.q = step(point, 0.0, nullptr, problem_.reach, expected);
    evaluate(next);
    if (!(next.cost < 0.25 * point.cost) || !reached(next)) return;  // a tolerance may hold at the one error's expense
    point = next;
  }
}

// In a curved valley, such as beside a singularity, a whole step leaves the valley's ground, and the next one comes
// back far ahead. A descent that must be lower after every step creeps along the ground instead. Hence a step may be
// worse than the last point, but not than all of the last three (Grippo, Lampariello and Lucidi, "A nonmonotone line
// search technique for Newton's method", SIAM Journal on Numerical Analysis 23(4), 1986).
bool Descent::run(DescentPoint& point, const Effort& effort) const noexcept {
  evaluate(point);
  DescentPoint next;
  double damping = kDamping, growth = kGrowth;  // λ = damping · E
  double earlier[2] = {point.cost, point.cost};
  double before = point.cost;
  int since = 0;
  for (int i = 0; i < effort.steps; ++i) {
    if (reached(point)) {
      polish(point);
      return true;
    }
    double expected;
    next.q = effort.curved ? curved_step(point, damping * point.cost, expected)
                           : step(point, damping * point.cost, nullptr, problem_.reach, expected);
    if (effort.always_lower && std::abs(point.cost - expected) <= kNothing * point.cost) break;
    // Joints that are fixed at limits on the way may leave a step that promises nothing, if the damping is small.
    const bool hopeless = effort.always_lower && expected > point.cost;
    if (!hopeless) evaluate(next);
    const double allowed = effort.always_lower ? point.cost : std::max({point.cost, earlier[0], earlier[1]});
    if (!hopeless && next.cost < allowed) {
      if (point.cost - next.cost > 0.75 * (point.cost - expected)) damping = std::max(0.2 * damping, kLeast);
      growth = kGrowth;
      earlier[0] = earlier[1];
      earlier[1] = point.cost;
      point = next;
    } else {
      if (damping > kMost || next.q == point.q) break;
      damping *= growth;
      growth *= 2.0;
    }
    if (++since == 4) {
      if (point.cost > effort.progress * before) break;
      before = point.cost;
      since = 0;
    }
  }
  return reached(point);
}

}  // namespace sigmaik::detail
