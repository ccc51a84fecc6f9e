#include "position_ik_held.hpp"

#include <algorithm>

#include "position_ik_search.hpp"

namespace sigmaik::detail {
namespace {

constexpr int kRounds = 12;         // of the method of multipliers
constexpr double kSettled = 1e-11;  // [m, rad] errors of rows that are held, which are none

// Rows that are held come first, and then the others.
bool nearer(const Descent& descent, const DescentPoint& one, const DescentPoint& other) noexcept {
  const PoseRows& rows = descent.problem().rows;
  const bool met = descent.reached_held(one);
  if (met != descent.reached_held(other)) return met;
  if (met) return one.cost < other.cost;
  return rows.weighted(rows.held(one.rows)).squaredNorm() < rows.weighted(rows.held(other.rows)).squaredNorm();
}

}  // namespace

// The method of multipliers: each round takes the errors that are left in the rows that are held into the shift, and
// leaves about a millionth of them.
void HeldSearch::settle(const PositionIk::Model& model, const Descent& descent, DescentPoint& point) noexcept {
  Row6 shift = Row6::Zero();
  for (int i = 0; i < kRounds; ++i) {
    const Descent shifted(model.strict, descent.target(), shift);
    shifted.run(point, kPatient);
    const Row6 next = model.strict.rows.held(point.rows);
    const bool still = (next - shift).cwiseAbs().maxCoeff() <= kSettled;
    shift = next;
    if (still) break;
  }
  descent.evaluate(point);
}

void HeldSearch::add(const DescentPoint& point) noexcept {
  std::size_t at = std::min(count_, kMost - 1);
  if (count_ == kMost && point.cost >= costs_[at]) return;
  for (; at > 0 && point.cost < costs_[at - 1]; --at) {
    q_[at] = q_[at - 1];
    costs_[at] = costs_[at - 1];
  }
  q_[at] = point.q;
  costs_[at] = point.cost;
  count_ = std::min(count_ + 1, kMost);
}

DescentPoint HeldSearch::nearest(const PositionIk::Model& model, const Descent& descent) const noexcept {
  DescentPoint best, point;
  for (std::size_t i = 0; i < count_; ++i) {
    point.q = q_[i];
    settle(model, descent, point);
    if (i == 0 || nearer(descent, point, best)) best = point;
  }
  if (descent.reached_held(best)) return best;
  const Descent alone(model.held->problem, descent.target());
  FirstSearch search(*model.held, alone, descent.target());
  while (!search.advance()) {
  }
  point = search.best();
  descent.evaluate(point);
  for (int i = 0; i < 2; ++i) {  // as found, and then as near in the other rows as the method leads
    if (nearer(descent, point, best)) best = point;
    if (i == 0) settle(model, descent, point);
  }
  return best;
}

}  // namespace sigmaik::detail
