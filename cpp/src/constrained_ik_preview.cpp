// The path ahead of ConstrainedIk's target: how fast it may be followed, and how the arm starts in a singularity.

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include <sigmaik/constrained_ik.hpp>
#include <sigmaik/pose.hpp>

#include "constrained_ik_parts.hpp"
#include "numbers.hpp"

namespace sigmaik {
namespace {

using detail::kInfinity;
using namespace detail::constrained;
constexpr int kExtend = 24;                // points a cycle by which the preview grows
constexpr double kPreviewStep = 0.02;      // [rad, m] of the fastest joint from one point of the preview to the next
constexpr double kPreviewWay = 2e-3;       // [m, rad] of the path, likewise
constexpr double kReserve = 0.85;          // part of the acceleration limits that the preview uses
constexpr double kBeyond = 1.02;           // part of the velocity limits, likewise: a cycle itself keeps to these
constexpr double kSame = 1e-9;             // part of a speed: a smaller difference is rounding
constexpr double kFlat = 1e-9;             // a smaller q' is zero
constexpr double kInLine = 1e-7;           // part of the largest singular value: a smaller one is zero
constexpr double kTurnStep = M_PI / 24.0;  // [rad, m] of the search for a turn

}  // namespace

// Whether ϑ alone can give way, so that it has to be known ahead.
bool ConstrainedIk::previews() const noexcept {
  return options_.gamma && tracker_.delays() && chain_.dof() == 6 && exact_.whole();
}

// In a singularity the target may ask for a direction that no joint motion makes. Where two axes are in line, the
// joints can turn about them without moving the tip, until they can make the direction: finds the nearest such turn.
void ConstrainedIk::find_turn(const Twist& direction) noexcept {
  Spectrum here;
  here.decompose(state_.jacobian);
  const int last = here.size() - 1;
  if (!(here.sigma(last) <= kInLine * here.sigma(0))) return;
  const JointVector from = tracker_.q();
  const JointVector axis = here.v(last) / here.v(last).cwiseAbs().maxCoeff();
  const double missing = here.u(last).dot(direction);
  const JointLimits& limits = chain_.limits();
  ChainState state;
  double nearest = kInfinity;
  for (const double sign : {1.0, -1.0}) {
    Spectrum spectrum = here;
    // What is missing after a turn by `angle`; NaN where the turn moves the tip or leaves the limits.
    const auto left = [&](double angle) {
      const JointVector q = from + sign * angle * axis;
      sigmaik::update(chain_, q, state);
      spectrum.decompose(state.jacobian);
      const bool inside = (q.array() >= limits.lower.array()).all() && (q.array() <= limits.upper.array()).all();
      const bool rests = pose_error(state.tip, state_.tip).cwiseAbs().maxCoeff() <= kMet;
      return (inside || !options_.limits.position) && rests ? spectrum.u(last).dot(direction) : std::nan("");
    };
    double low = 0.0, high = kTurnStep, end = left(high);
    while (end * missing > 0.0 && high < M_PI) {
      low = high;
      high += kTurnStep;
      end = left(high);
    }
    if (!(end * missing <= 0.0) || high >= nearest + kTurnStep) continue;
    for (int k = 0; k < 50; ++k) {
      const double middle = 0.5 * (low + high);
      (left(middle) * missing > 0.0 ? low : high) = middle;
    }
    if (high >= nearest - kMet) continue;
    nearest = high;
    turn_ = from + sign * high * axis;
  }
}

// A cycle of such a turn, while the target's clock stands. Returns whether there is one.
bool ConstrainedIk::turn(const Twist& motion, ConstrainedIkStep& step) noexcept {
  if (!previews()) return false;
  const bool rests = tracker_.qdot().cwiseAbs().maxCoeff() <= kMet;
  if (turn_.size() == 0 && stuck_ && rests && motion.norm() > kMet) find_turn(motion / motion.norm());
  if (turn_.size() == 0) return false;
  const JointVector way = turn_ - tracker_.q();
  if (way.cwiseAbs().maxCoeff() <= 1e-12 || motion.norm() <= kMet) {
    turn_.resize(0);
    preview_.count = 0;
    return false;
  }
  const VelocityBounds& bounds = tracker_.bounds();
  JointVector wanted = way / kSettling;
  wanted *= tracker_.arrival(wanted, 1.0 / kSettling);
  step.qdot = tracker_.approach(head(wanted));
  const JointVector once = way / options_.dt;
  if ((once.array().abs() <= kAtOnce * (bounds.upper - bounds.lower).array()).all()) step.qdot = once;
  step.qdot = step.qdot.cwiseMax(bounds.lower).cwiseMin(bounds.upper);
  step.time_scale = 1.0;
  step.exact_met = false;
  return true;
}

// Starts the preview at the reference configuration. The path goes on in `direction`, of length 1.
void ConstrainedIk::begin_preview(const Twist& direction) noexcept {
  auto& p = preview_;
  p.first = p.count = 0;
  p.way = 0.0;
  p.direction = direction;
  p.start = reference_;
  p.state = state_;
  p.q = tracker_.q();
  p.slope.setZero(chain_.dof());
}

// One more point of the preview, by a step of Newton's method from the point before. Returns whether there is one.
bool ConstrainedIk::extend_preview() noexcept {
  auto& p = preview_;
  if (p.count == Preview::kPoints) return false;
  const int n = chain_.dof();
  double ahead = 0.0, before = 0.0;
  if (p.count > 0) {
    before = p.points[static_cast<std::size_t>((p.first + p.count - 1) % Preview::kPoints)].at;
    ahead = std::min(kPreviewWay, kPreviewStep / std::max(1e-9, p.slope.cwiseAbs().maxCoeff()));
  }
  const double at = before + ahead;
  Pose pose = p.start;
  pose.translation() += at * p.direction.head<3>();
  pose.linear() = rotation_exp(at * p.direction.tail<3>()) * p.start.linear();
  JointVector q = p.q + ahead * p.slope;
  sigmaik::update(chain_, q, p.state);
  const Eigen::Matrix<double, 6, 6> J = p.state.jacobian.leftCols<6>();
  const Eigen::PartialPivLU<Eigen::Matrix<double, 6, 6>> lu(J);
  Twist correction = Twist::Zero();
  if (p.count > 0) correction = lu.solve(pose_error(p.state.tip, pose));
  Twist slope = lu.solve(p.direction);
  if (p.count == 0) {  // the start may be in a singularity: the shortest of all slopes
    Spectrum spectrum;
    spectrum.decompose(p.state.jacobian);
    slope.setZero();
    for (int i = 0; i < n; ++i) {
      const double sigma = spectrum.sigma(i);
      if (sigma > kInLine * spectrum.sigma(0)) slope += spectrum.u(i).dot(p.direction) / sigma * spectrum.v(i);
    }
    if ((J * slope - p.direction).norm() > kInLine) return false;
  }
  if (!correction.allFinite() || !slope.allFinite() || correction.cwiseAbs().maxCoeff() > 10.0 * kPreviewStep) {
    return false;
  }
  q += correction;
  Preview::Point point;
  point.at = at;
  point.most = kInfinity;
  for (int i = 0; i < n; ++i) {
    const double limit = kBeyond * tracker_.velocity_limit(i) / std::abs(slope[i]);
    if (limit * limit < point.most) point.most = limit * limit;
  }
  if (p.count > 0) {
    const Twist last = p.slope, bend = (slope - last) / ahead;
    set_limits(p.points[static_cast<std::size_t>((p.first + p.count - 1) % Preview::kPoints)], ahead,
               Twist(0.5 * (last + slope)), bend);
  }
  p.points[static_cast<std::size_t>((p.first + p.count) % Preview::kPoints)] = point;
  ++p.count;
  p.q = q;
  p.slope = slope;
  return true;
}

// The acceleration limits from a point to the next, `step` ahead; `slope` is in the middle between them.
void ConstrainedIk::set_limits(Preview::Point& point, double step, const Twist& slope,
                               const Twist& bend) const noexcept {
  if (!options_.limits.acceleration) {
    point.left.fill(0.0);
    point.brake.fill(kInfinity);
    return;
  }
  // From x at the point, x is x + u Δℓ in the middle.
  for (int i = 0; i < 6; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double limit = kReserve * tracker_.least_acceleration(i);
    double a = slope[i] + step * bend[i], b = bend[i];
    if (a < 0.0) {
      a = -a;
      b = -b;
    }
    if (!(a > kFlat)) {  // nothing but bending
      if (std::abs(b) * point.most > limit) point.most = limit / std::abs(b);
      a = kFlat;
      b = 0.0;
    }
    point.left[k] = 1.0 - 2.0 * step * b / a;
    point.brake[k] = 2.0 * step * limit / a;
  }
  // Some u has to be inside all limits: none of the least is above one of the most.
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 6; ++j) {
      const double narrows = point.left[i] - point.left[j], room = point.brake[i] + point.brake[j];
      if (narrows * point.most > room) point.most = room / narrows;
    }
    // u ≥ −x/2Δℓ: no motion backwards.
    if (-point.left[i] * point.most > point.brake[i]) point.most = -point.brake[i] / point.left[i];
  }
}

// The least ϑ with which the arm can still slow down for the path ahead, if the target goes on in its direction.
double ConstrainedIk::look_ahead(const Twist& motion) noexcept {
  if (!previews()) return 0.0;
  auto& p = preview_;
  const double size = motion.norm();
  if (size <= kMet) return 0.0;
  const Twist direction = motion / size;
  if (p.count == 0 || (direction - p.direction).norm() > 1e-3) begin_preview(direction);
  const auto point = [&](int k) -> const Preview::Point& {
    return p.points[static_cast<std::size_t>((p.first + k) % Preview::kPoints)];
  };
  while (p.count > 1 && point(1).at <= p.way) {
    p.first = (p.first + 1) % Preview::kPoints;
    --p.count;
  }
  for (int k = 0; k < kExtend && extend_preview(); ++k) {
  }
  const double way = point(0).at + (p.count > 1 ? std::max(0.0, p.way - point(0).at) : 0.0);
  // ϑ makes no target faster. The target is taken to slow down as it does now, as far as half of the brakes can follow.
  const double per_dt = 1.0 / options_.dt, before = last_motion_.norm();
  double asked = size * per_dt * size * per_dt, rate = 0.0;
  if (last_way_ > kMet) rate = std::min(0.0, (size - before) * (size + before) * per_dt * per_dt / last_way_);
  for (int k = 0; k + 1 < p.count; ++k) {
    const Preview::Point& here = point(k);
    p.asked[static_cast<std::size_t>(k)] = asked;
    p.fastest[static_cast<std::size_t>(k)] = std::min(here.most, asked);
    const double brake = 0.5 * *std::min_element(here.brake.begin(), here.brake.end());
    const double step = point(k + 1).at - std::max(here.at, way);
    asked = std::max(0.0, asked - std::min(brake, -rate * step));
  }
  // Backwards from the end of the preview, where the arm has to be able to stand.
  double after = 0.0;
  for (int k = p.count - 2; k >= 0; --k) {
    const Preview::Point& here = point(k);
    double& most = p.fastest[static_cast<std::size_t>(k)];
    for (std::size_t i = 0; i < 6; ++i) {
      if (here.left[i] * most > after + here.brake[i]) most = (after + here.brake[i]) / here.left[i];
    }
    after = most;
  }
  // The part of the asked x that is possible at a place.
  const auto possible = [&](double where) {
    int k = 0;
    while (k + 1 < p.count && point(k + 1).at <= where) ++k;
    if (k + 1 >= p.count) return 0.0;
    const double share = (where - point(k).at) / (point(k + 1).at - point(k).at);
    const auto here = static_cast<std::size_t>(k), next = here + 1;
    const bool end = k + 2 >= p.count;
    const double fastest = (1.0 - share) * p.fastest[here] + (end ? 0.0 : share * p.fastest[next]);
    const double most = end ? p.asked[here] : (1.0 - share) * p.asked[here] + share * p.asked[next];
    return fastest < (1.0 - kSame) * most ? fastest / most : 1.0;
  };
  const double now = possible(way), later = possible(way + std::sqrt(now) * size);  // and a cycle later
  return 1.0 - std::sqrt(std::min(now, later));
}

}  // namespace sigmaik
