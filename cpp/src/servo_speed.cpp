// The largest speed of the tool and of the elbow, as a limit of the servo; servo.hpp has the derivation.

#include <algorithm>
#include <array>
#include <cmath>

#include <sigmaik/servo.hpp>

#include "bracket.hpp"
#include "numbers.hpp"
#include "walk.hpp"

namespace sigmaik {
namespace {

using detail::kInfinity;
using Eigen::Vector3d;

constexpr double kReserve = 1e-8;  // relative: positions are rounded to 1e-12 m, and a cycle's way may be 1e-4 m
constexpr int kEvaluations = 24;   // of a search along a line: every one is a pass over the arm

// The checked points at a configuration: where they are, their velocity, and their acceleration at constant q̇.
struct CheckedPoints {
  static constexpr std::size_t kMost = kMaxJoints + 2 + 8;
  std::array<Vector3d, kMost> place, velocity, acceleration;
  std::size_t count = 0;
};

// A rigid link that moves: its origin, and how it turns.
struct Link {
  Vector3d place = Vector3d::Zero(), velocity = Vector3d::Zero(), acceleration = Vector3d::Zero();
  Vector3d omega = Vector3d::Zero(), alpha = Vector3d::Zero();

  void move_to(const Vector3d& point) noexcept {
    const Vector3d arm = point - place, turn = omega.cross(arm);
    velocity += turn;
    acceleration += alpha.cross(arm) + omega.cross(turn);
    place = point;
  }
};

void put(const Link& link, CheckedPoints& to) noexcept {
  to.place[to.count] = link.place;
  to.velocity[to.count] = link.velocity;
  to.acceleration[to.count++] = link.acceleration;
}

// Velocities from link to link, as in the first pass of the recursive Newton-Euler algorithm.
void move(const Chain& chain, const JointVector& q, const JointVector& qdot, const Vector3d& tool,
          const ToolPoints& points, CheckedPoints& out) noexcept {
  out.count = 0;
  Link link;
  detail::FrameColumns frame = detail::walk(chain, q, [&](int i, const detail::FrameColumns& f) {
    const Coupling coupling = chain.has_mimics() ? chain.couplings()[static_cast<std::size_t>(i)]
                                                 : Coupling{i, 1.0, 0.0};
    const Vector3d axis = f.z.head<3>(), along = coupling.multiplier * qdot[coupling.joint] * axis;
    link.move_to(f.p.head<3>());
    if (chain.constants()[static_cast<std::size_t>(i)].prismatic) {
      link.velocity += along;
      link.acceleration += 2.0 * link.omega.cross(along);
    } else {
      link.alpha += link.omega.cross(along);
      link.omega += along;
    }
    put(link, out);
  });
  frame.append(chain.tool().linear(), chain.tool().translation());
  link.move_to(frame.p.head<3>());
  put(link, out);
  const auto put_at = [&](const Vector3d& point) {
    Link at = link;
    at.move_to(Vector3d(frame.at(point).head<3>()));
    put(at, out);
  };
  put_at(tool);
  for (Eigen::Index k = 0; k < points.cols(); ++k) put_at(points.col(k));
}

// M of servo.hpp: the largest speed while a point brakes in `time`.
double highest_speed(double speed, double curvature, double time) noexcept {
  const double growth = curvature * time;
  if (growth <= speed) return speed;
  return growth < kInfinity ? (speed + growth) * ((speed + growth) / (4.0 * growth)) : growth;
}

}  // namespace

// [m/s] of the fastest checked point, over a cycle with q̇.
double Servo::tool_speed(const JointVector& qdot) const noexcept {
  CheckedPoints from, to;
  move(chain_, tracker_.q(), qdot, tool_.translation(), options_.speed_points, from);
  move(chain_, tracker_.q() + cycle() * qdot, qdot, tool_.translation(), options_.speed_points, to);
  double fastest = 0.0;
  for (std::size_t k = 0; k < to.count; ++k) {
    fastest = std::max(fastest, (to.place[k] - from.place[k]).norm() / cycle());
  }
  return fastest;
}

// In parts of max_tool_speed: the speed over a cycle with q̇, and the highest speed of a stop in proportion after it.
// At most 1: the limit is held. NaN where numbers are too large.
double Servo::tool_speed_part(const JointVector& qdot) const noexcept {
  CheckedPoints from, to;
  move(chain_, tracker_.q(), qdot, tool_.translation(), options_.speed_points, from);
  move(chain_, tracker_.q() + cycle() * qdot, qdot, tool_.translation(), options_.speed_points, to);
  double time = 0.0, delay = 0.0;
  for (int i = 0; i < chain_.dof(); ++i) {
    const double a = tracker_.least_acceleration(i) * (tracker_.uneven() ? 0.5 : 1.0);
    if (qdot[i] != 0.0) time = std::max(time, std::abs(qdot[i]) / a);
    if (tracker_.has_jerk() && qdot[i] != 0.0) {
      delay = std::max(delay,
                       std::min(a / tracker_.jerk_limit(i), std::sqrt(std::abs(qdot[i]) / tracker_.jerk_limit(i))));
    }
  }
  double fastest = 0.0;
  for (std::size_t k = 0; k < to.count; ++k) {
    const double curvature = to.acceleration[k].norm(), speed = to.velocity[k].norm() + delay * curvature;
    const double now = (to.place[k] - from.place[k]).norm() / cycle(), later = highest_speed(speed, curvature, time);
    if (!(now <= fastest)) fastest = now;  // NaN, too
    if (!(later <= fastest)) fastest = later;
  }
  return fastest / (options_.max_tool_speed * (1.0 - kReserve));
}

// From `slow`, which holds the limit, as far as possible to `fast`, which does not.
JointVector Servo::nearest_slow(const JointVector& slow, const JointVector& fast) const noexcept {
  constexpr double kNear = 1e-9;
  detail::Bracket bracket{0.0, tool_speed_part(slow) - 1.0, 1.0, tool_speed_part(fast) - 1.0};
  JointVector best = slow;
  for (int k = 0; k < kEvaluations && bracket.width() > kNear && bracket.fa < -kNear; ++k) {
    const double root = bracket.root();
    const bool on_line = bracket.fb < kInfinity && root > bracket.a;
    const double x = on_line ? bracket.inside(root - 0.5 * kNear) : 0.5 * (bracket.a + bracket.b);
    const JointVector at = slow + x * (fast - slow);
    if (bracket.take(x, tool_speed_part(at) - 1.0)) best = at;
  }
  return best;
}

// The velocity to head for: slower, in the same direction.
void Servo::slow_tool(ServoStep& step) noexcept {
  const double size = step.qdot.cwiseAbs().maxCoeff();
  if (!(size > 0.0)) return;
  // To first order the speed is in proportion to q̇.
  CheckedPoints points;
  move(chain_, tracker_.q(), step.qdot / size, tool_.translation(), options_.speed_points, points);
  double fastest = 0.0;
  for (std::size_t k = 0; k < points.count; ++k) fastest = std::max(fastest, points.velocity[k].norm());
  const double most = options_.max_tool_speed * (1.0 - kReserve);
  JointVector slower = step.qdot;
  if (fastest * size > most) slower = (most / fastest) * (step.qdot / size);
  if (!(tool_speed_part(slower) <= 1.0)) slower = nearest_slow(JointVector::Zero(chain_.dof()), slower);
  if (slower == step.qdot) return;
  step.qdot = slower;
  step.tool_speed_limits = true;
}

// The command of this cycle, inside the bounds of the joints: as near to `step.qdot` as the limit allows.
void Servo::hold_tool_speed(ServoStep& step) noexcept {
  double least = tool_speed_part(step.qdot);
  if (least <= 1.0) return;
  step.tool_speed_limits = true;
  const VelocityBounds& bounds = tracker_.bounds();
  const JointVector &last = tracker_.qdot(), asked = step.qdot;
  double time = 0.0;
  for (int i = 0; i < chain_.dof(); ++i) {
    if (last[i] != 0.0) time = std::max(time, std::abs(last[i]) / tracker_.least_acceleration(i));
  }
  const double left = time > cycle() ? 1.0 - cycle() / time : 0.0;
  const JointVector in_proportion = (left * last).cwiseMax(bounds.lower).cwiseMin(bounds.upper);
  JointVector best = asked;
  for (int way = 0; way < 3; ++way) {
    const JointVector stop = way == 0 ? in_proportion : way == 1 ? tracker_.stop() : slowest(in_proportion, bounds);
    const double part = tool_speed_part(stop);
    if (part <= 1.0) {
      best = nearest_slow(stop, asked);
      break;
    }
    if (part < least) {
      least = part;
      best = stop;
    }
  }
  step.qdot = best.cwiseMax(bounds.lower).cwiseMin(bounds.upper);
}

// Inside the bounds, from q̇: a velocity with which the fastest point is slow, by descent over one joint after another.
JointVector Servo::slowest(JointVector qdot, const VelocityBounds& bounds) const noexcept {
  constexpr int kSweeps = 4;
  const int n = chain_.dof();
  CheckedPoints points;
  std::array<Vector3d, kMaxJoints> column;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    move(chain_, tracker_.q(), qdot, tool_.translation(), options_.speed_points, points);
    std::size_t worst = 0;
    for (std::size_t k = 1; k < points.count; ++k) {
      if (points.velocity[k].norm() > points.velocity[worst].norm()) worst = k;
    }
    Vector3d velocity = points.velocity[worst];
    for (int i = 0; i < n; ++i) {
      move(chain_, tracker_.q(), JointVector(JointVector::Unit(n, i)), tool_.translation(), options_.speed_points,
           points);
      column[static_cast<std::size_t>(i)] = points.velocity[worst];
    }
    for (int i = 0; i < n; ++i) {
      const Vector3d& c = column[static_cast<std::size_t>(i)];
      const double square = c.squaredNorm();
      if (!(square > 1e-12)) continue;
      const double to = std::clamp(qdot[i] - c.dot(velocity) / square, bounds.lower[i], bounds.upper[i]);
      velocity += (to - qdot[i]) * c;
      qdot[i] = to;
    }
  }
  return qdot;
}

}  // namespace sigmaik
