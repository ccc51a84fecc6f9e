#include "position_ik_descent.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <sigmaik/pose.hpp>

#include "numbers.hpp"

namespace sigmaik::detail {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr double kRounding = 1e-10;  // [rad] of an angle
constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kDamping = 1e-2, kLeast = 1e-5, kMost = 1e6;  // of the damping over E: at the start, least, most
constexpr double kGrowth = 8.0;  // of the damping after a step that is not accepted; then twice, four times, … this
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

Eigen::Matrix3d skew(const Eigen::Vector3d& x) noexcept {
  Eigen::Matrix3d out;
  out << 0.0, -x[2], x[1], x[2], 0.0, -x[0], -x[1], x[0], 0.0;
  return out;
}

}  // namespace

DescentProblem::DescentProblem(const Chain& arm, const Task& rows, const std::array<double, 2>& tolerances, bool turns)
    : chain(arm),
      task(rows),
      whole(rows.whole()),
      tolerance(tolerances),
      length(arm.characteristic_length()),
      lower(arm.limits().lower),
      upper(arm.limits().upper),
      reach(JointVector::Ones(arm.dof())) {
  for (int i = 0; i < arm.dof(); ++i) {
    if (arm.joint_types()[static_cast<std::size_t>(i)] == JointType::Prismatic) {
      reach[i] = length * length;
      continue;
    }
    const bool endless = std::isinf(lower[i]) && std::isinf(upper[i]);
    if (endless || (turns && upper[i] - lower[i] >= kTurn)) {
      turning |= 1u << i;
      lower[i] = -kInfinity;
      upper[i] = kInfinity;
    }
  }
}

void DescentProblem::place(const JointRef& near, JointVector& q) const noexcept {
  const JointLimits& limits = chain.limits();
  for (int i = 0; i < q.size(); ++i) {
    if ((turning >> i & 1u) != 0) {
      q[i] += kTurn * std::round((near[i] - q[i]) / kTurn);
      // Rounding beyond a limit is no reason for a turn.
      const double below = limits.lower[i] - kRounding - q[i], above = q[i] - limits.upper[i] - kRounding;
      if (below > 0.0) q[i] += kTurn * std::ceil(below / kTurn);
      if (above > 0.0) q[i] -= kTurn * std::ceil(above / kTurn);
    }
    q[i] = std::clamp(q[i], limits.lower[i], limits.upper[i]);
  }
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
  Twist rows = point.error;
  if (!problem_.whole) {
    const Eigen::Matrix3d rotation = point.state.tip.linear();
    if (problem_.task.frame == Frame::Tool) {
      rows.head<3>() = rotation.transpose() * point.error.head<3>();
      rows.tail<3>() = rotation.transpose() * point.error.tail<3>();
    }
    for (int i = 0; i < 6; ++i) {
      if (!problem_.task.mask[static_cast<std::size_t>(i)]) rows[i] = 0.0;
    }
  }
  point.residual = rows;
  point.residual.head<3>() /= problem_.length;
  point.cost = point.residual.squaredNorm();
}

bool Descent::reached(const DescentPoint& point) const noexcept {
  return point.residual.head<3>().norm() * problem_.length <= problem_.tolerance[0] &&
         point.residual.tail<3>().norm() <= problem_.tolerance[1];
}

// For a whole pose J is the Jacobian itself. The exact derivative of the orientation error φ has the factor J_r⁻¹(φ),
// the inverse of SO(3)'s right Jacobian, which neither moves the minimum nor changes the gradient, because φᵀJ_r⁻¹(φ) =
// φᵀ. With a part of the rows the factor matters, and so does the turn of the tool's axes.
void Descent::derivative(const DescentPoint& point, Columns& columns) const noexcept {
  const double inverse = 1.0 / problem_.length;
  columns = point.state.jacobian;
  if (!problem_.whole) {
    const Eigen::Vector3d position = point.error.head<3>(), angle = point.error.tail<3>();
    const bool tool = problem_.task.frame == Frame::Tool;
    // ė_o = −J_r⁻¹(φ) ω = −J_l⁻¹(−φ) ω; in the tool's axes, d(Rᵀe) = Rᵀ(ė − ω × e).
    Eigen::Matrix3d rate;
    for (int i = 0; i < 3; ++i) rate.col(i) = rotation_log_rate(-angle, Eigen::Vector3d::Unit(i));
    const Eigen::Matrix3d axes = tool ? Eigen::Matrix3d(point.state.tip.linear().transpose())
                                      : Eigen::Matrix3d::Identity();
    if (tool) rate -= skew(angle);
    const Eigen::Matrix3d turn = axes * rate,
                          swing = tool ? Eigen::Matrix3d(-axes * skew(position)) : Eigen::Matrix3d::Zero();
    for (Eigen::Index j = 0; j < columns.cols(); ++j) {
      const Eigen::Vector3d v = columns.col(j).head<3>(), omega = columns.col(j).tail<3>();
      columns.col(j).head<3>() = axes * v + swing * omega;
      columns.col(j).tail<3>() = turn * omega;
    }
    for (int i = 0; i < 6; ++i) {
      if (!problem_.task.mask[static_cast<std::size_t>(i)]) columns.row(i).setZero();
    }
  }
  columns.topRows<3>() *= inverse;
}

// Minimises |r − J Δq|² + λ Σ (Δq_i − wish_i)²/w_i inside the limits, through
//   Δq = wish + W Jᵀ (J W Jᵀ + λ I)⁻¹ (r − J wish)
// of the joints that are free. A joint that this takes beyond a limit is fixed at the limit, and the others are
// computed again. The result is q + Δq; `expected` is E there if the arm were linear, as r − J Δq = λ (J W Jᵀ + λ I)⁻¹
// r.
JointVector Descent::step(const DescentPoint& point, double damping, const JointVector* wish,
                          const JointVector& inverse_weight, double& expected) const noexcept {
  const int n = static_cast<int>(point.q.size());
  Columns columns(6, n);
  derivative(point, columns);
  Matrix6 a = Matrix6::Zero();
  Row6 rest = point.residual;
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
      next[i] = point.q[i] + ahead + inverse_weight[i] * columns.col(i).dot(y);
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
      rest += ((wish != nullptr ? (*wish)[i] : 0.0) - (next[i] - point.q[i])) * column;
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
    evaluate(next);
    const double allowed = effort.always_lower ? point.cost : std::max({point.cost, earlier[0], earlier[1]});
    if (next.cost < allowed) {
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
