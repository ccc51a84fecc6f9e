#include <sigmaik/position_ik.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include <sigmaik/analytic_ik.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/spectrum.hpp>

#include "message.hpp"
#include "numbers.hpp"
#include "position_ik_branches.hpp"
#include "position_ik_descent.hpp"
#include "position_ik_starts.hpp"
#include "ranges.hpp"

namespace sigmaik {
namespace {

using Clock = std::chrono::steady_clock;
using detail::Branches;
using detail::Descent;
using detail::DescentPoint;
using detail::Effort;
using detail::require;
using detail::StartOrder;

constexpr Effort kQuick{24, 0.5, false, false};      // of a start
constexpr Effort kLong{80, 0.95, false, true};       // of the best start of a block
constexpr Effort kPatient{200, 0.9999, true, true};  // of the last descent, to the nearest pose
constexpr Effort kNear{60, 0.95, false, false};      // of the start from `near`
constexpr int kBlock = 16;                           // starts
constexpr int kNearStarts = 48;  // starts of the table with which a search near a configuration looks for branches
constexpr int kPulled = 8;       // solutions of a redundant arm that are moved towards `near`
constexpr int kPulls = 40;       // steps of this
constexpr int kPullsToMiddle = 100;
constexpr double kApart = 1e-2;          // solutions differ by more than this in a joint [rad, or L]
constexpr double kApartRedundant = 0.1;  // the same of a redundant arm's representatives
constexpr double kLargest = 1e9;         // of `near`: above, rounding exceeds 1e-7 rad

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

bool acceptable(const Pose& pose) noexcept {
  return is_pose(pose.matrix()) && pose.translation().cwiseAbs().maxCoeff() <= kLargest;
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

const char* to_string(PositionIkStatus status) noexcept {
  switch (status) {
    case PositionIkStatus::Ok: return "ok";
    case PositionIkStatus::Unreachable: return "unreachable";
    case PositionIkStatus::BadInput: return "bad input";
  }
  return "unknown";
}

struct PositionIk::Model {
  Model(const Chain& arm, const PositionIkOptions& given)
      : chain(arm),
        options(checked(given)),
        problem(arm, options.task, options.tolerance, true),
        on_turn(arm, options.task, options.tolerance, false),
        middle(middle_of(arm.limits())),
        zero(JointVector::Zero(arm.dof()).cwiseMax(arm.limits().lower).cwiseMin(arm.limits().upper)),
        speed(speed_of(arm.limits())),
        half(half_of(arm.limits())),
        table(problem),
        analytic(options.task.whole() ? closed_form(arm) : std::nullopt) {}

  Chain chain;
  PositionIkOptions options;
  detail::DescentProblem problem;  // of a search for any solution
  detail::DescentProblem on_turn;  // of a search near a configuration: every joint stays on its turn
  JointVector middle, zero;        // of the joint ranges; 0, or the limit nearest to 0
  JointVector speed, half;         // velocity limits; half of the ranges, π or 1 m where there is none
  detail::StartTable table;
  std::optional<AnalyticIk> analytic;

  // The distance to the nearest limit.
  double margin(const JointVector& q) const noexcept {
    return std::min((q - chain.limits().lower).minCoeff(), (chain.limits().upper - q).minCoeff());
  }

  // The least singular value of the task's rows.
  double least_sigma(const Descent& search, const JointVector& q) const noexcept {
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

  bool redundant() const noexcept { return chain.dof() > options.task.rows(); }

  PositionIkResult result(const Descent& search, DescentPoint& point, const JointVector& near,
                          Clock::time_point start) const noexcept;
  void closed_form_branches(const Pose& pose, const JointVector* near, Branches& out) const noexcept;
  void search_all(const Descent& search, const Pose& pose, int starts, Branches& out) const noexcept;
  bool search_first(const Descent& search, const Pose& pose, DescentPoint& best) const noexcept;
  double travel_time(const JointVector& q, const JointVector& near) const noexcept;
  bool nearest(const Descent& local, Branches& found, const JointVector& near, DescentPoint& best) const noexcept;
};

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

// The closed form's solutions inside the limits. At a singularity, where an angle is free, the one nearest to `near` is
// not among those of solve().
void PositionIk::Model::closed_form_branches(const Pose& pose, const JointVector* near, Branches& out) const noexcept {
  if (!analytic) return;
  if (near != nullptr) {
    const AnalyticNearest nearest = analytic->nearest(pose, *near);
    if (nearest.status == AnalyticStatus::Ok && nearest.branch.within_limits) out.add(nearest.branch.q);
  }
  for (const AnalyticBranch& branch : analytic->solve(pose)) {
    if (branch.within_limits) out.add(branch.q);
  }
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

// The first solution that a descent finds, or the best point of all descents. Most descents that give up are in a local
// minimum at a limit; some were on the way to a solution, but slow. Hence the best of each block goes on for longer.
bool PositionIk::Model::search_first(const Descent& search, const Pose& pose, DescentPoint& best) const noexcept {
  StartOrder order(table, pose);
  DescentPoint point, best_of_block;
  best.cost = best_of_block.cost = detail::kInfinity;
  for (int i = 1; i <= options.starts; ++i) {
    point.q = table.configuration(order.next());
    const bool found = search.run(point, kQuick);
    if (found || point.cost < best_of_block.cost) best_of_block = point;
    if (!found && i % kBlock != 0 && i != options.starts) continue;
    const bool reached = found || search.run(best_of_block, kLong);
    if (reached || best_of_block.cost < best.cost) best = best_of_block;
    if (reached) return true;
    best_of_block.cost = detail::kInfinity;
  }
  return search.run(best, kPatient);
}

double PositionIk::Model::travel_time(const JointVector& q, const JointVector& near) const noexcept {
  return (q - near).cwiseQuotient(speed).cwiseAbs().maxCoeff();
}

// The solution with the least travel time. Only the nearest few are moved along their self-motion: the others have too
// far to go.
bool PositionIk::Model::nearest(const Descent& local, Branches& found, const JointVector& near,
                                DescentPoint& best) const noexcept {
  if (found.count() == 0) return false;
  for (JointVector& q : found) problem.place(near, q);
  std::sort(found.begin(), found.end(),
            [&](const JointVector& a, const JointVector& b) { return travel_time(a, near) < travel_time(b, near); });
  best.q = *found.begin();
  if (!redundant()) return true;
  double least = detail::kInfinity;
  for (int i = 0; i < std::min(found.count(), kPulled); ++i) {
    DescentPoint point;
    point.q = found.begin()[i];
    local.evaluate(point);
    detail::pull(local, {near, speed, true, 1e-4, kPulls}, point);
    problem.place(near, point.q);
    if (const double time = travel_time(point.q, near); time < least) {
      least = time;
      best = point;
    }
  }
  return true;
}

PositionIk::PositionIk(const Chain& chain, const PositionIkOptions& options)
    : model_(std::make_shared<const Model>(chain, options)) {}

const Chain& PositionIk::chain() const noexcept { return model_->chain; }
const PositionIkOptions& PositionIk::options() const noexcept { return model_->options; }

PositionIkResult PositionIk::solve(const Pose& pose) const noexcept {
  const Clock::time_point start = Clock::now();
  const Model& m = *model_;
  if (!acceptable(pose)) return {};
  const Descent search(m.problem, pose);
  Branches found(m.problem, kApart);
  m.closed_form_branches(pose, nullptr, found);
  DescentPoint point;
  if (found.count() > 0) {
    point.q = *std::max_element(found.begin(), found.end(),
                                [&](const JointVector& a, const JointVector& b) { return m.margin(a) < m.margin(b); });
  } else {
    m.search_first(search, pose, point);
  }
  return m.result(search, point, m.zero, start);
}

PositionIkResult PositionIk::solve(const Pose& pose, const JointRef& near) const noexcept {
  const Clock::time_point start = Clock::now();
  const Model& m = *model_;
  if (!acceptable(pose) || near.size() != m.chain.dof() || !near.allFinite()) return {};
  if (near.cwiseAbs().maxCoeff() > kLargest) return {};
  const JointVector from = near;
  const Descent search(m.problem, pose), local(m.on_turn, pose);
  Branches found(m.problem, kApart);
  m.closed_form_branches(pose, &from, found);
  DescentPoint point;
  if (found.count() == 0) {
    point.q = from.cwiseMax(m.on_turn.lower).cwiseMin(m.on_turn.upper);
    if (local.run(point, kNear) || local.run(point, kLong)) found.add(point.q);
    m.search_all(search, pose, std::min(kNearStarts, m.options.starts), found);
  }
  if (!m.nearest(local, found, from, point) && m.search_first(search, pose, point)) {
    found.add(point.q);
    m.nearest(local, found, from, point);
  }
  return m.result(search, point, from, start);
}

std::vector<PositionIkBranch> PositionIk::solve_all(const Pose& pose) const {
  const Model& m = *model_;
  require(acceptable(pose), "solve_all: the pose is not finite, is farther away than ", kLargest,
          " m, or has a rotation that is none");
  const Descent search(m.problem, pose), local(m.on_turn, pose);
  Branches found(m.problem, kApart), distinct(m.problem, m.redundant() ? kApartRedundant : kApart);
  m.closed_form_branches(pose, nullptr, found);
  if (found.count() == 0) m.search_all(search, pose, m.options.starts, found);
  std::vector<PositionIkBranch> out;
  for (const JointVector& q : found) {
    DescentPoint point;
    point.q = q;
    m.problem.place(m.middle, point.q);
    local.evaluate(point);
    if (m.redundant()) detail::pull(local, {m.middle, m.half, false, 1e-7, kPullsToMiddle}, point);
    m.problem.place(m.middle, point.q);
    distinct.add(point.q);
  }
  for (const JointVector& q : distinct) out.push_back({q, m.least_sigma(search, q), m.margin(q)});
  std::stable_sort(out.begin(), out.end(),
                   [](const PositionIkBranch& a, const PositionIkBranch& b) { return a.margin > b.margin; });
  return out;
}

void PositionIk::solve_batch(std::size_t count, const double* pose, double* q, PositionIkStatus* status,
                             int threads) const {
  require(threads >= 1, "threads = ", threads, " must be at least 1");
  using RowMajor = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
  const int n = chain().dof();
  detail::split_range(count, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      Pose target;
      target.matrix() = Eigen::Map<const RowMajor>(pose + 16 * b);
      const PositionIkResult found = solve(target);
      Eigen::Map<Eigen::VectorXd> out(q + b * static_cast<std::size_t>(n), n);
      if (found.status == PositionIkStatus::Ok) {
        out = found.q;
      } else {
        out.setConstant(std::numeric_limits<double>::quiet_NaN());
      }
      if (status != nullptr) status[b] = found.status;
    }
  });
}

}  // namespace sigmaik
