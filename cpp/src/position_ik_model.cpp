#include "position_ik_model.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <sigmaik/error.hpp>
#include <sigmaik/spectrum.hpp>

#include "message.hpp"
#include "numbers.hpp"

namespace sigmaik {
namespace {

using Clock = std::chrono::steady_clock;
using detail::Branches;
using detail::Descent;
using detail::DescentPoint;
using detail::Effort;
using detail::kQuick;
using detail::require;
using detail::StartOrder;

constexpr Effort kLastDigits{8, 0.5, false, false};  // of a closed form's solution
constexpr double kRounding = 1e-6;                   // [rad] of a closed form's solution close to a singularity

std::optional<AnalyticIk> closed_form(const Chain& chain) {
  try {
    return AnalyticIk(chain);
  } catch (const Error&) {  // the arm is of another kind
    return std::nullopt;
  }
}

PositionIkOptions checked(const PositionIkOptions& options) {
  for (const double tolerance : options.tolerance) {
    require(std::isfinite(tolerance) && tolerance > 0.0, "tolerance = (", options.tolerance[0], ", ",
            options.tolerance[1], ") must be finite and above 0");
  }
  options.task.validate();
  require(options.starts >= 1 && options.starts <= detail::StartTable::kEntries, "starts = ", options.starts,
          " must be from 1 to ", detail::StartTable::kEntries);
  return options;
}

JointVector middle_of(const JointLimits& limits) {
  JointVector middle = 0.5 * (limits.lower + limits.upper);
  for (int i = 0; i < middle.size(); ++i) {
    if (!std::isfinite(middle[i])) middle[i] = std::clamp(0.0, limits.lower[i], limits.upper[i]);
  }
  return middle;
}

JointVector speed_of(const JointLimits& limits) {
  return limits.velocity.unaryExpr([](double v) { return std::isfinite(v) ? v : 1.0; });
}

JointVector half_of(const JointLimits& limits) {
  return (0.5 * (limits.upper - limits.lower)).unaryExpr([](double range) {
    return std::isfinite(range) ? std::max(range, 1e-6) : std::numbers::pi;
  });
}

}  // namespace

PositionIk::Model::Model(const Chain& arm, const PositionIkOptions& given)
    : chain(arm),
      options(checked(given)),
      problem(arm, options.task, options.tolerance, true),
      on_turn(arm, options.task, options.tolerance, false),
      middle(middle_of(arm.limits())),
      zero(JointVector::Zero(arm.dof()).cwiseMax(arm.limits().lower).cwiseMin(arm.limits().upper)),
      speed(speed_of(arm.limits())),
      half(half_of(arm.limits())),
      table(problem),
      analytic(options.task.whole() ? closed_form(arm) : std::nullopt),
      parallel(options.task.whole() ? detail::ParallelAxes::of(arm) : std::nullopt) {}

// The distance to the nearest limit.
double PositionIk::Model::margin(const JointVector& q) const noexcept {
  return std::min((q - chain.limits().lower).minCoeff(), (chain.limits().upper - q).minCoeff());
}

// The least singular value of the task's rows.
double PositionIk::Model::least_sigma(const Descent& search, const JointVector& q) const noexcept {
  DescentPoint point;
  point.q = q;
  search.evaluate(point);
  TaskJacobian rows = select_rows(options.task, point.state.tip.linear(), point.state.jacobian);
  int linear = 0;
  for (std::size_t i = 0; i < 3; ++i) linear += options.task.mask[i] ? 1 : 0;
  rows.topRows(linear) /= problem.length;
  Spectrum spectrum;
  spectrum.decompose(rows);
  return spectrum.sigma(spectrum.size() - 1);
}

// The answer at a point, on the turns nearest to `near`.
PositionIkResult PositionIk::Model::result(const Descent& search, DescentPoint& point, const JointVector& near,
                                           Clock::time_point start) const noexcept {
  problem.place(near, point.q);
  search.evaluate(point);
  PositionIkResult out;
  out.q = point.q;
  out.status = search.reached(point) ? PositionIkStatus::Ok : PositionIkStatus::Unreachable;
  const Eigen::Matrix3d rotation = point.state.tip.linear();
  out.error = problem.whole ? point.error
                            : expand_rows(options.task, rotation, select_rows(options.task, rotation, point.error));
  out.solve_time = std::chrono::duration<double>(Clock::now() - start).count();
  return out;
}

// Puts each joint on the turn nearest to the middle of its range. Returns whether the limits hold then; what rounding
// takes beyond a limit is put onto the limit.
bool PositionIk::Model::within(JointVector& q) const noexcept {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const JointLimits& limits = chain.limits();
  for (int i = 0; i < q.size(); ++i) {
    q[i] += kTurn * std::round((middle[i] - q[i]) / kTurn);
    if (q[i] < limits.lower[i] - kRounding || q[i] > limits.upper[i] + kRounding) return false;
    q[i] = std::clamp(q[i], limits.lower[i], limits.upper[i]);
  }
  return true;
}

// The solutions of a closed form inside the limits. Returns whether these are all; where two solutions are almost one
// or a joint is free, there may be more.
bool PositionIk::Model::closed_form_branches(const Descent& search, const Pose& pose, const JointVector* near,
                                             Branches& out) const noexcept {
  if (parallel) {
    const detail::ParallelAxes::Solutions found = parallel->solve(pose, near != nullptr ? (*near)[5] : zero[5]);
    DescentPoint point;
    for (int i = 0; i < found.count; ++i) {
      point.q = found.q[static_cast<std::size_t>(i)];
      if (within(point.q) && search.run(point, kLastDigits)) out.add(point.q);
    }
    return out.count() > 0 && !found.singular;
  }
  if (!analytic) return false;
  if (near != nullptr) {  // at a singularity, where an angle is free, this one is not among those of solve()
    const AnalyticNearest nearest = analytic->nearest(pose, *near);
    if (nearest.status == AnalyticStatus::Ok && nearest.branch.within_limits) out.add(nearest.branch.q);
  }
  for (const AnalyticBranch& branch : analytic->solve(pose)) {
    if (branch.within_limits) out.add(branch.q);
  }
  return out.count() > 0;
}

// The solutions that descents from the first entries of the table find.
void PositionIk::Model::search_all(const Descent& search, const Pose& pose, int starts, Branches& out) const noexcept {
  StartOrder order(table, pose);
  DescentPoint point;
  for (int i = 0; i < starts; ++i) {
    point.q = table.configuration(order.next());
    if (search.run(point, kQuick)) out.add(point.q);
  }
}

}  // namespace sigmaik
