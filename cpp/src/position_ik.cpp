#include <sigmaik/position_ik.hpp>

#include <algorithm>
#include <chrono>
#include <limits>

#include <sigmaik/pose.hpp>

#include "message.hpp"
#include "position_ik_model.hpp"
#include "position_ik_search.hpp"
#include "ranges.hpp"

namespace sigmaik {
namespace {

using Clock = std::chrono::steady_clock;
using detail::Branches;
using detail::Descent;
using detail::DescentPoint;
using detail::kLargest;
using detail::require;

constexpr int kPullsToMiddle = 100;
constexpr double kApart = 1e-2;          // solutions differ by more than this in a joint [rad, or L]
constexpr double kApartRedundant = 0.1;  // representatives of a redundant arm differ by more than this [rad, or L]

bool acceptable(const Pose& pose) noexcept {
  return is_pose(pose.matrix()) && pose.translation().cwiseAbs().maxCoeff() <= kLargest;
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

PositionIk::PositionIk(const Chain& chain, const PositionIkOptions& options)
    : model_(std::make_shared<const Model>(chain, options)) {}

const Chain& PositionIk::chain() const noexcept { return model_->chain; }
const PositionIkOptions& PositionIk::options() const noexcept { return model_->options; }

PositionIkResult PositionIk::solve(const Pose& asked) const noexcept {
  const Clock::time_point start = Clock::now();
  const Model& m = *model_;
  if (!acceptable(asked)) return {};
  const Pose pose = nearest_pose(asked);
  const Descent search(m.problem, pose);
  Branches found(m.problem, kApart);
  m.closed_form_branches(search, pose, nullptr, found);
  DescentPoint point;
  if (found.count() > 0) {
    point.q = *std::max_element(found.begin(), found.end(),
                                [&](const JointVector& a, const JointVector& b) { return m.margin(a) < m.margin(b); });
  } else {
    detail::FirstSearch first(m, search, pose);
    while (!first.advance()) {
    }
    point = first.best();
  }
  return m.result(search, point, m.zero, start);
}

PositionIkResult PositionIk::solve(const Pose& pose, const JointRef& near) const noexcept {
  const Clock::time_point start = Clock::now();
  const Model& m = *model_;
  if (!acceptable(pose) || near.size() != m.chain.dof() || !near.allFinite()) return {};
  if (near.cwiseAbs().maxCoeff() > kLargest) return {};
  const JointVector from = near;
  detail::NearestSearch search(*this, nearest_pose(pose), from);
  while (!search.advance()) {
  }
  DescentPoint point = search.best();
  return m.result(search.descent(), point, from, start);
}

std::vector<PositionIkBranch> PositionIk::solve_all(const Pose& asked) const {
  const Model& m = *model_;
  require(acceptable(asked), "solve_all: the pose is not finite, is farther away than ", kLargest,
          " m, or has a rotation that is none");
  const Pose pose = nearest_pose(asked);
  const Descent search(m.problem, pose), local(m.on_turn, pose);
  Branches found(m.problem, kApart), distinct(m.problem, m.redundant() ? kApartRedundant : kApart);
  if (!m.closed_form_branches(search, pose, nullptr, found)) m.search_all(search, pose, m.options.starts, found);
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
