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
constexpr double kStrict = 1e3;                      // factor of rows that are held before the others
constexpr double kRounding = 1e-6;                   // [rad] of a closed form's solution close to a singularity

std::optional<AnalyticIk> closed_form(const Chain& chain) {
  try {
    return AnalyticIk(chain);
  } catch (const Error&) {  // the arm is of another kind
    return std::nullopt;
  }
}

// Whether the six errors are all that is asked for, so that a closed form has the solutions.
bool pose_alone(const PositionIkOptions& options) {
  const bool zero = std::all_of(options.ranges.begin(), options.ranges.end(),
                                [](const auto& range) { return range[0] == 0.0 && range[1] == 0.0; });
  return options.task.whole() && zero && !options.cone;
}

// The exact rows, and no others.
PositionIkOptions exact_alone(PositionIkOptions options) {
  for (std::size_t i = 0; i < 6; ++i) options.task.mask[i] = options.task.mask[i] && options.exact[i];
  if (!options.exact[3]) options.cone.reset();
  options.exact = {};
  return options;
}

void check_ranges(const PositionIkOptions& options) {
  for (std::size_t i = 0; i < 6; ++i) {
    const auto [least, largest] = options.ranges[i];
    require(least <= largest && least < detail::kInfinity && largest > -detail::kInfinity, "ranges[", i, "] = (", least,
            ", ", largest, ") must be the least and the largest error allowed");
  }
}

void check_cone(const PositionIkOptions& options) {
  const ToolCone& cone = *options.cone;
  require(cone.axis.allFinite() && cone.axis.norm() > 1e-6 && cone.axis.norm() < 1e6, "cone: the axis (", cone.axis[0],
          ", ", cone.axis[1], ", ", cone.axis[2], ") must be a direction");
  require(cone.angle >= 0.0 && cone.angle <= std::numbers::pi, "cone: the angle ", cone.angle, " must be from 0 to π");
  const auto& mask = options.task.mask;
  require(mask[3] && mask[4] && mask[5],
          "a cone takes the place of the orientation's rows: the mask must have all three");
  const auto& exact = options.exact;
  require(exact[3] == exact[4] && exact[4] == exact[5],
          "with a cone, the orientation's rows are exact or not together");
  for (std::size_t i = 3; i < 6; ++i) {
    require(options.ranges[i][0] == 0.0 && options.ranges[i][1] == 0.0,
            "a cone takes the place of the orientation's rows: ranges[", i, "] must be 0");
  }
}

PositionIkOptions checked(const PositionIkOptions& options) {
  for (const double tolerance : options.tolerance) {
    require(std::isfinite(tolerance) && tolerance > 0.0, "tolerance = (", options.tolerance[0], ", ",
            options.tolerance[1], ") must be finite and above 0");
  }
  options.task.validate();
  check_ranges(options);
  if (options.cone) check_cone(options);
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
      problem(arm, options, true),
      on_turn(arm, options, false),
      strict(arm, options, true, kStrict),
      held(problem.rows.some_held() ? std::make_unique<const Model>(arm, exact_alone(options)) : nullptr),
      middle(middle_of(arm.limits())),
      zero(JointVector::Zero(arm.dof()).cwiseMax(arm.limits().lower).cwiseMin(arm.limits().upper)),
      speed(speed_of(arm.limits())),
      half(half_of(arm.limits())),
      table(problem),
      analytic(pose_alone(options) ? closed_form(arm) : std::nullopt),
      parallel(pose_alone(options) ? detail::ParallelAxes::of(arm) : std::nullopt) {}

double PositionIk::Model::margin(const JointVector& q) const noexcept {
  return std::min((q - chain.limits().lower).minCoeff(), (chain.limits().upper - q).minCoeff());
}

double PositionIk::Model::least_sigma(const Descent& search, const JointVector& q) const noexcept {
  DescentPoint point;
  point.q = q;
  search.evaluate(point);
  Spectrum spectrum;
  spectrum.decompose(problem.rows.jacobian(point.state.tip, point.state.jacobian));
  return spectrum.sigma(spectrum.size() - 1);
}

PositionIkResult PositionIk::Model::result(const Descent& search, DescentPoint& point, const JointVector& near,
                                           Clock::time_point start) const noexcept {
  problem.place(near, point.q);
  search.evaluate(point);
  PositionIkResult out;
  out.q = point.q;
  out.status = search.reached(point) ? PositionIkStatus::Ok : PositionIkStatus::Unreachable;
  out.error = search.counted(point);
  out.solve_time = std::chrono::duration<double>(Clock::now() - start).count();
  return out;
}

bool PositionIk::Model::closed_form_branches(const Descent& search, const Pose& pose, const JointVector* near,
                                             Branches& out) const noexcept {
  if (parallel) {
    const detail::ParallelAxes::Solutions found = parallel->solve(pose, near != nullptr ? (*near)[5] : zero[5]);
    DescentPoint point;
    for (int i = 0; i < found.count; ++i) {
      point.q = found.q[static_cast<std::size_t>(i)];
      if (problem.place(middle, point.q, kRounding) && search.run(point, kLastDigits)) out.add(point.q);
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

void PositionIk::Model::search_all(const Descent& search, const Pose& pose, int starts, Branches& out) const noexcept {
  StartOrder order(table, pose);
  DescentPoint point;
  for (int i = 0; i < starts; ++i) {
    point.q = table.configuration(order.next());
    if (search.run(point, kQuick)) out.add(point.q);
  }
}

}  // namespace sigmaik
