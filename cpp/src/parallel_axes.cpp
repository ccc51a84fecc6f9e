#include "parallel_axes.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace sigmaik::detail {
namespace {

using Eigen::Vector3d;

constexpr double kMeet = 1e-9;    // axes that must be parallel, or meet: rad, or part of the arm's size
constexpr double kApart = 1e-3;   // what must not vanish: rad, or part of the arm's size
constexpr double kClose = 1e-6;   // solutions are almost one, or a joint is almost free
constexpr double kBeyond = 1e-9;  // a cosine beyond 1 by less is 1

Vector3d turn(const Vector3d& axis, double angle, const Vector3d& v) noexcept {
  const double c = std::cos(angle);
  return c * v + std::sin(angle) * axis.cross(v) + (1.0 - c) * axis.dot(v) * axis;
}

// Both solutions of hᵀ R(k, q) p = value (Paden's and Kahan's subproblem of a cone and a plane), or none. `singular`:
// the two are almost one, or q is free.
struct TwoAngles {
  int count = 0;
  double q[2];
};
TwoAngles cone_and_plane(const Vector3d& h, const Vector3d& k, const Vector3d& p, double value, double size,
                         bool& singular) noexcept {
  const double c = h.dot(p) - h.dot(k) * k.dot(p), s = h.dot(k.cross(p)), along = value - h.dot(k) * k.dot(p);
  const double radius = std::hypot(c, s);
  if (radius < kClose * size) singular = true;
  const double cosine = along / std::max(radius, 1e-300);
  if (!(std::abs(cosine) <= 1.0 + kBeyond)) return {};
  if (std::abs(cosine) > 1.0 - kClose) singular = true;
  const double middle = std::atan2(s, c), half = std::acos(std::clamp(cosine, -1.0, 1.0));
  return {2, {middle + half, middle - half}};
}

}  // namespace

std::optional<ParallelAxes> ParallelAxes::of(const Chain& chain) {
  if (chain.dof() != 6 || chain.has_mimics()) return std::nullopt;
  ParallelAxes arm;
  Pose frame = Pose::Identity();
  double size = 0.0;
  for (std::size_t i = 0; i < 6; ++i) {
    const JointConstants& c = chain.constants()[i];
    if (c.prismatic) return std::nullopt;
    frame.translation() += frame.linear() * c.translation;
    frame.linear() = frame.linear() * c.rotation;
    if (i > 0) size += c.translation.norm();
    arm.h_[i] = frame.linear().col(2);
    arm.o_[i] = frame.translation();
  }
  const Pose tip = frame * chain.tool();
  size += chain.tool().translation().norm();
  arm.zero_inverse_ = tip.inverse(Eigen::Isometry);

  const auto& h = arm.h_;
  const auto sine = [&](std::size_t i, std::size_t j) { return h[i].cross(h[j]).norm(); };
  if (sine(1, 2) > kMeet || sine(1, 3) > kMeet) return std::nullopt;
  if (sine(0, 1) < kApart || sine(3, 4) < kApart || sine(4, 5) < kApart) return std::nullopt;
  const Vector3d normal = h[4].cross(h[5]), from = arm.o_[5] - arm.o_[4];
  if (std::abs(normal.dot(from)) > kMeet * size * normal.norm()) return std::nullopt;
  arm.meet_ = arm.o_[4] + h[4] * from.cross(h[5]).dot(normal) / normal.squaredNorm();

  arm.x_ = h[1].unitOrthogonal();
  arm.y_ = h[1].cross(arm.x_);
  arm.sign3_ = h[1].dot(h[2]) > 0.0 ? 1.0 : -1.0;
  arm.sign4_ = h[1].dot(h[3]) > 0.0 ? 1.0 : -1.0;
  arm.upper_ = arm.in_plane(arm.o_[2] - arm.o_[1]);
  arm.fore_ = arm.in_plane(arm.o_[3] - arm.o_[2]);
  arm.hand_ = arm.in_plane(arm.meet_ - arm.o_[3]);
  if (std::min(std::abs(arm.upper_), std::abs(arm.fore_)) < kApart * size) return std::nullopt;
  return arm;
}

ParallelAxes::Solutions ParallelAxes::solve(const Pose& pose, double free6) const noexcept {
  Solutions out;
  const Eigen::Matrix3d rotation = pose.linear() * zero_inverse_.linear();
  const Vector3d place = pose.linear() * (zero_inverse_.linear() * meet_ + zero_inverse_.translation()) +
                         pose.translation() - o_[0];  // E W, from joint 1
  const Vector3d& h = h_[1];
  // hᵀ R₁ᵀ place: the cone and the plane of the angle −q1.
  const double size = std::abs(upper_) + std::abs(fore_);
  const TwoAngles shoulders = cone_and_plane(h, h_[0], place, h.dot(meet_ - o_[0]), size, out.singular);
  for (int i = 0; i < shoulders.count; ++i) {
    const double q1 = -shoulders.q[i];
    const Vector3d seen = turn(h_[0], -q1, place) + o_[0];  // e₁⁻¹ E W
    const Vector3d hand = turn(h_[0], -q1, rotation * h_[5]);
    const Vector3d wish = rotation.transpose() * turn(h_[0], q1, h);  // R_Eᵀ R₁ h
    const TwoAngles wrists = cone_and_plane(h, h_[4], h_[5], h.dot(hand), 1.0, out.singular);
    for (int j = 0; j < wrists.count; ++j) {
      const double q5 = wrists.q[j];
      const Vector3d back = turn(h_[4], -q5, h);
      const Vector3d a = back - h_[5].dot(back) * h_[5], b = wish - h_[5].dot(wish) * h_[5];
      double q6 = free6;
      if (std::min(a.norm(), b.norm()) < kClose) {
        out.singular = true;
      } else {
        q6 = -std::atan2(h_[5].dot(a.cross(b)), a.dot(b));
      }
      // Where R₁ᵀ R_E R₆ᵀ R₅ᵀ takes the plane's x axis.
      const Vector3d x = turn(h_[0], -q1, rotation * turn(h_[5], -q6, turn(h_[4], -q5, x_)));
      elbows(seen, std::arg(in_plane(x)), q1, q5, q6, out);
    }
  }
  return out;
}

// Joints 2, 3, 4 as complex numbers: place − o₂ − e^{iθ} hand = e^{iα} (upper + e^{iβ} fore), where θ = α + β + γ.
void ParallelAxes::elbows(const Vector3d& place, double theta, double q1, double q5, double q6,
                          Solutions& out) const noexcept {
  const std::complex<double> end = in_plane(place - o_[1]) - std::polar(1.0, theta) * hand_;
  const double upper = std::abs(upper_), fore = std::abs(fore_);
  const double cosine = (std::norm(end) - upper * upper - fore * fore) / (2.0 * upper * fore);
  if (!(std::abs(cosine) <= 1.0 + kBeyond)) return;
  if (std::abs(cosine) > 1.0 - kClose) out.singular = true;
  const double bend = std::acos(std::clamp(cosine, -1.0, 1.0)), zero = std::arg(fore_ / upper_);
  for (const double side : {1.0, -1.0}) {
    const double beta = side * bend - zero;
    const double alpha = std::arg(end / (upper_ + std::polar(1.0, beta) * fore_));
    JointVector& q = out.q[static_cast<std::size_t>(out.count++)];
    q.resize(6);
    q << q1, alpha, sign3_ * beta, sign4_ * (theta - alpha - beta), q5, q6;
  }
}

}  // namespace sigmaik::detail
