#include "mimic.hpp"

#include <algorithm>
#include <cmath>

#include "message.hpp"
#include "numbers.hpp"

namespace sigmaik::detail {
namespace {

std::string label(const Segment& segment) { return "joint '" + segment.joint_name + "'"; }

// The segment whose joint has this name, and moves.
std::size_t find(const Segment& mimicking, const std::vector<Segment>& segments) {
  const std::string& name = mimicking.mimic->joint;
  const auto at = std::find_if(segments.begin(), segments.end(),
                               [&name](const Segment& s) { return s.joint_name == name; });
  require(at != segments.end(), label(mimicking), " mimics joint '", name, "', which is not in the chain");
  require(at->type != JointType::Fixed, label(mimicking), " mimics joint '", name, "', which does not move");
  return static_cast<std::size_t>(at - segments.begin());
}

Coupling follow(std::size_t segment, const std::vector<Segment>& segments) {
  Coupling whole{static_cast<int>(segment), 1.0, 0.0};
  std::size_t steps = 0;
  while (const auto& mimic = segments[static_cast<std::size_t>(whole.joint)].mimic) {
    const Segment& at = segments[static_cast<std::size_t>(whole.joint)];
    require(std::isfinite(mimic->multiplier) && mimic->multiplier != 0.0 && std::isfinite(mimic->offset), label(at),
            ": multiplier = ", mimic->multiplier, " and offset = ", mimic->offset,
            " of its mimic must be finite, and the multiplier not 0");
    require(++steps <= segments.size(), label(segments[segment]), " mimics itself in the end");
    whole.joint = static_cast<int>(find(at, segments));
    whole.offset += whole.multiplier * mimic->offset;
    whole.multiplier *= mimic->multiplier;
  }
  return whole;
}

double braking(const Segment& s) { return s.deceleration < kInfinity ? s.deceleration : s.acceleration; }

void fold(const Coupling& coupling, const Segment& from, Segment& to) {
  const double m = coupling.multiplier, size = std::abs(m);
  const double a = (from.lower - coupling.offset) / m, b = (from.upper - coupling.offset) / m;
  to.lower = std::max(to.lower, std::min(a, b));
  to.upper = std::min(to.upper, std::max(a, b));
  require(to.lower <= to.upper, label(from), " mimics ", label(to), " = q, at ", m, " q + ", coupling.offset,
          ": its limits [", from.lower, ", ", from.upper, "] leave no position");
  if (to.type == JointType::Continuous && (std::isfinite(to.lower) || std::isfinite(to.upper))) {
    to.type = JointType::Revolute;
  }
  if (from.deceleration < kInfinity || to.deceleration < kInfinity) {
    to.deceleration = std::min(braking(to), braking(from) / size);
  }
  // The positions of such a joint are not the same modulo 2π.
  const bool whole = from.type != JointType::Prismatic && std::trunc(m) == m;
  if (to.type == JointType::Continuous && !whole) to.type = JointType::Revolute;
  to.velocity = std::min(to.velocity, from.velocity / size);
  to.acceleration = std::min(to.acceleration, from.acceleration / size);
  to.jerk = std::min(to.jerk, from.jerk / size);
}

}  // namespace

std::vector<Coupling> couplings_of(const std::vector<Segment>& segments) {
  std::vector<Coupling> couplings;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    require(!segments[i].mimic || segments[i].type != JointType::Fixed, label(segments[i]),
            " does not move, and cannot mimic a joint");
    couplings.push_back(follow(i, segments));
  }
  return couplings;
}

void fold_limits(const std::vector<Coupling>& couplings, std::vector<Segment>& segments) {
  for (std::size_t i = 0; i < segments.size(); ++i) {
    Segment& from = segments[i];
    if (!from.mimic) continue;
    fold(couplings[i], from, segments[static_cast<std::size_t>(couplings[i].joint)]);
    from.lower = -kInfinity;
    from.upper = from.velocity = from.acceleration = from.deceleration = from.jerk = kInfinity;
  }
}

bool repeats(const Chain& chain, int i) noexcept {
  for (std::size_t k = 0; k < static_cast<std::size_t>(chain.moving()); ++k) {
    const Coupling& c = chain.couplings()[k];
    if (c.joint == i && (chain.constants()[k].prismatic || std::trunc(c.multiplier) != c.multiplier)) return false;
  }
  return true;
}

}  // namespace sigmaik::detail
