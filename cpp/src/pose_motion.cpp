#include "pose_motion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <sigmaik/pose.hpp>

#include "length.hpp"

namespace sigmaik::detail {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// [s] up to here squares and quotients of rates and accelerations keep their digits
constexpr double kLongestTime = 1e6;

// A vector that changes with time, and its first two derivatives.
struct Curve {
  Vector3d x = Vector3d::Zero(), rate = Vector3d::Zero(), acceleration = Vector3d::Zero();
};

// Quintic Hermite polynomial at u in [0, 1], from 0 to `end.x`, with the rates and accelerations of both ends.
Curve hermite(const Vector3d& rate, const Vector3d& acceleration, const Curve& end, double u) noexcept {
  const Vector3d p = end.x - rate - 0.5 * acceleration, q = end.rate - rate - acceleration;
  const Vector3d s = end.acceleration - acceleration;
  const Vector3d c3 = 10.0 * p - 4.0 * q + 0.5 * s, c4 = -15.0 * p + 7.0 * q - s, c5 = 6.0 * p - 3.0 * q + 0.5 * s;
  Curve at;
  at.x = u * (rate + u * (0.5 * acceleration + u * (c3 + u * (c4 + u * c5))));
  at.rate = rate + u * (acceleration + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)));
  at.acceleration = acceleration + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5));
  return at;
}

// dJ/dt φ̇ for SO(3)'s left Jacobian J(φ) of rotation_exp_rate: the part of ω̇ that does not come from φ̈.
Vector3d jacobian_rate(const Vector3d& phi, const Vector3d& rate) noexcept {
  const double square = phi.squaredNorm(), angle = std::sqrt(square);
  double b, da, db;  // J = I + a [φ]× + b [φ]×²; da and db are the derivatives of a and b in θ, per θ
  if (angle < 0.05) {
    b = 1.0 / 6.0 - square / 120.0 + square * square / 5040.0;
    da = -1.0 / 12.0 + square / 180.0 - square * square / 6720.0;
    db = -1.0 / 60.0 + square / 1260.0 - square * square / 60480.0;
  } else {
    const double sine = std::sin(0.5 * angle), a = 2.0 * sine * sine / square;
    b = (angle - std::sin(angle)) / (square * angle);
    da = (1.0 - square * b - 2.0 * a) / square;
    db = (a - 3.0 * b) / square;
  }
  const Vector3d once = phi.cross(rate);
  return phi.dot(rate) * (da * once + db * phi.cross(once)) + b * rate.cross(once);
}

// Angular velocity and acceleration of exp(φ(t)), base axes, and the inverse.
Curve exp_curve(const Curve& phi) noexcept {
  return {phi.x, rotation_exp_rate(phi.x, phi.rate),
          rotation_exp_rate(phi.x, phi.acceleration) + jacobian_rate(phi.x, phi.rate)};
}
Curve log_curve(const Vector3d& phi, const Vector3d& omega, const Vector3d& alpha) noexcept {
  const Vector3d rate = rotation_log_rate(phi, omega);
  return {phi, rate, rotation_log_rate(phi, alpha - jacobian_rate(phi, rate))};
}

// See the header: k τ, and the largest jerk per largest speed, times τ².
constexpr double kRate = 0.5 * std::numbers::e;
constexpr double kJerk = 0.5 * (std::numbers::e * std::numbers::e + 1.0);

// The offset after dt: d(t) = (d + c₁t + c₂t²/2) e^(−kt), a triple pole; zero if τ = 0.
Curve decayed(const Curve& from, double dt, double smoothing) noexcept {
  const double k = kRate / smoothing, x = k * dt;
  if (!(x < 700.0)) return {};  // e^(−700) is no normal number
  const double decay = std::exp(-x);
  const Vector3d c1 = from.rate + k * from.x, c2 = from.acceleration + k * (2.0 * from.rate + k * from.x);
  Curve to;
  to.x = decay * (from.x + dt * (c1 + 0.5 * dt * c2));
  to.rate = decay * (from.rate + dt * (c2 - k * c1) - 0.5 * x * dt * c2);
  to.acceleration = decay * (from.acceleration + x * (k * c1 - 2.0 * c2) + 0.5 * x * x * c2);
  return to;
}

// Whether a motion within the largest speed, acceleration and jerk makes the step of dt between two states. The
// coordinates `x` are from the first state. A constant jerk makes the change of acceleration; a second jerk, which
// changes its sign after dt/2, makes the rest of the change of twist.
bool within(const Curve& from, const Curve& to, double dt, double speed, double smoothing) noexcept {
  const double lag = smoothing / kRate, jerk = kJerk * speed / smoothing / smoothing;
  const Vector3d change = to.acceleration - from.acceleration;
  const Vector3d bend = to.rate - from.rate - 0.5 * dt * (from.acceleration + to.acceleration);
  return detail::length(to.x) <= speed * dt && detail::length(to.rate) <= speed &&
         detail::length(to.rate + lag * to.acceleration) <= speed &&
         smoothing * detail::length(to.acceleration) <= speed &&
         detail::length(to.x + 2.0 * lag * (to.rate - from.rate) + lag * lag * change) <= speed * dt &&
         detail::length(change) + 4.0 / dt * detail::length(bend) <= jerk * dt &&
         12.0 * detail::length(to.x - 0.5 * dt * (from.rate + to.rate)) <= jerk * dt * dt * dt;
}

// The state after dt where the input w = x + 2ẋ/k + ẍ/k² moves from its place at `from` to that at `to`, steadily and
// not faster than `speed`.
Curve bounded(const Curve& from, const Curve& to, double dt, double speed, double smoothing) noexcept {
  const double lag = smoothing / kRate;
  Vector3d way = to.x + 2.0 * lag * (to.rate - from.rate) + lag * lag * (to.acceleration - from.acceleration);
  detail::shorten(way, speed * dt);
  const Vector3d u = way / dt;
  const Vector3d slow = from.rate - u, fast = slow + lag * from.acceleration;
  Curve out;
  const double x = dt / lag;
  if (x < 700.0) {
    const double decay = std::exp(-x), part = -std::expm1(-x);
    out.x = way + lag * (part * slow + (part - x * decay) * fast);
    out.rate = u + decay * (slow + x * fast);
    out.acceleration = decay * (from.acceleration - x / lag * fast);
  } else {
    out.x = way + lag * (slow + fast);
    out.rate = u;
  }
  detail::shorten(out.rate, speed);
  return out;
}

}  // namespace

PoseMotion between(const PoseMotion& a, const PoseMotion& b, double dt, double u) noexcept {
  const Twist way = pose_error(a.pose, b.pose), begin = dt * a.twist, bend = dt * dt * a.acceleration;
  const Twist end = dt * b.twist, end_bend = dt * dt * b.acceleration;
  const Curve place = hermite(begin.head<3>(), bend.head<3>(), {way.head<3>(), end.head<3>(), end_bend.head<3>()}, u);
  const Curve chart = hermite(begin.tail<3>(), bend.tail<3>(),
                              log_curve(way.tail<3>(), end.tail<3>(), end_bend.tail<3>()), u);
  const Curve turn = exp_curve(chart);
  PoseMotion out;
  out.pose.translation() = a.pose.translation() + place.x;
  out.pose.linear() = rotation_exp(chart.x) * a.pose.linear();
  out.twist << place.rate / dt, turn.rate / dt;
  out.acceleration << place.acceleration / (dt * dt), turn.acceleration / (dt * dt);
  return out;
}

PoseMotion extrapolated(const PoseMotion& from, double seconds) noexcept {
  const Vector3d omega = from.twist.tail<3>(), alpha = from.acceleration.tail<3>();
  const Curve chart{seconds * (omega + 0.5 * seconds * alpha), omega + seconds * alpha, alpha};
  const Curve turn = exp_curve(chart);
  PoseMotion out;
  out.pose.translation() = from.pose.translation() +
                           seconds * (from.twist.head<3>() + 0.5 * seconds * from.acceleration.head<3>());
  out.pose.linear() = rotation_exp(chart.x) * from.pose.linear();
  out.twist << from.twist.head<3>() + seconds * from.acceleration.head<3>(), turn.rate;
  out.acceleration << from.acceleration.head<3>(), turn.acceleration;
  return out;
}

// The target's pose is exp(d) R, where R is the motion's pose and d is the offset. The target's ω is the sum of the
// rate of exp(d) and exp(d) ω_R.
void follow(const PoseMotion& then, const PoseMotion& now, double dt, const FollowLimits& limits,
            PoseMotion& target) noexcept {
  const double smoothing = limits.smoothing < kShortest ? 0.0 : std::min(limits.smoothing, kLongestTime);
  Twist way = pose_error(then.pose, target.pose);
  const Matrix3d turn = rotation_exp(way.tail<3>());
  const Vector3d carried = turn * then.twist.tail<3>(), spin = target.twist.tail<3>() - carried;
  const Curve place{way.head<3>(), target.twist.head<3>() - then.twist.head<3>(),
                    target.acceleration.head<3>() - then.acceleration.head<3>()};
  const Curve chart = log_curve(
      way.tail<3>(), spin, target.acceleration.tail<3>() - spin.cross(carried) - turn * then.acceleration.tail<3>());

  const Curve place_left = decayed(place, dt, smoothing), chart_left = decayed(chart, dt, smoothing);
  const Matrix3d turned = rotation_exp(chart_left.x);
  const Curve turn_left = exp_curve(chart_left);
  const Vector3d carried_now = turned * now.twist.tail<3>();
  Pose next;
  next.translation() = now.pose.translation() + place_left.x;
  next.linear() = turned * now.pose.linear();
  way = pose_error(target.pose, next);

  const auto move = [&](const auto& part, Curve to, double speed) {
    const Curve from{Vector3d::Zero(), part(target.twist), part(target.acceleration)};
    const bool free = within(from, to, dt, speed, smoothing);
    if (!free) to = bounded(from, to, dt, speed, smoothing);
    part(way) = to.x;
    part(target.twist) = to.rate;
    part(target.acceleration) = to.acceleration;
    return free;
  };
  const auto linear = [](Twist& twist) { return twist.head<3>(); };
  const auto angular = [](Twist& twist) { return twist.tail<3>(); };
  const Curve shift{way.head<3>(), now.twist.head<3>() + place_left.rate,
                    now.acceleration.head<3>() + place_left.acceleration};
  const Curve swing{way.tail<3>(), carried_now + turn_left.rate,
                    turn_left.acceleration + turn_left.rate.cross(carried_now) + turned * now.acceleration.tail<3>()};
  if (!move(linear, shift, limits.speed)) next.translation() = target.pose.translation() + way.head<3>();
  if (!move(angular, swing, limits.angular_speed)) {
    next.linear() = nearest_rotation(rotation_exp(way.tail<3>()) * target.pose.linear());
  }
  target.pose = next;
}

}  // namespace sigmaik::detail
