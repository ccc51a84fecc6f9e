#pragma once
// Rotations in a plane as pairs of cosine and sine.

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Core>

namespace sigmaik::detail {

// Cosine and angle of the nodes, whose sines are k/16.
inline constexpr double kNodes[12][2] = {{1.0, 0.0},
                                         {0.998044963916957, 0.06254076179649139},
                                         {0.9921567416492215, 0.1253278311680654},
                                         {0.982264602843857, 0.1886163861754041},
                                         {0.9682458365518543, 0.25268025514207865},
                                         {0.9499177595981665, 0.31782370392788073},
                                         {0.9270248108869579, 0.3843967744956391},
                                         {0.899218410621135, 0.4528165947449256},
                                         {0.8660254037844386, 0.5235987755982989},
                                         {0.8267972847076845, 0.5974064166453502},
                                         {0.7806247497997998, 0.6751315329370317},
                                         {0.7261843774138906, 0.758040765426236}};

// The angle in the half turn is offset + sign · (angle in the first octant): a table instead of branches, which the
// processor could not predict.
inline constexpr double kOctants[4][2] = {
    {0.0, 1.0}, {0.5 * std::numbers::pi, -1.0}, {std::numbers::pi, -1.0}, {0.5 * std::numbers::pi, 1.0}};

// Angle in [−π, π] of a unit vector (c, s), to one or two units in the last place. An answer of the inverse kinematics
// contains two dozen angles, and atan2, which accepts vectors of any length, would take a quarter longer. The angle
// from the nearest node is small, so the arcsine's series converges quickly.
inline double angle_of(double c, double s) noexcept {
  const double x = std::abs(c), y = std::abs(s);
  const double large = std::max(x, y), small = std::min(x, y);
  const int k = small < 0.71 ? static_cast<int>(16.0 * small + 0.5) : 11;
  const double d = small * kNodes[k][0] - large * (0.0625 * k), t = d * d;
  const double series = t * (1.0 / 6.0 +
                             t * (3.0 / 40.0 + t * (15.0 / 336.0 + t * (105.0 / 3456.0 + t * (945.0 / 42240.0)))));
  const auto& octant = kOctants[static_cast<int>(y > x) + 2 * static_cast<int>(c < 0.0)];
  return std::copysign(octant[0] + octant[1] * (kNodes[k][1] + (d + d * series)), s);
}

// A rotation in a plane. A product adds two angles without trigonometry.
struct Turn {
  double c = 1.0, s = 0.0;

  static Turn of(double angle) noexcept { return {std::cos(angle), std::sin(angle)}; }
  double angle() const noexcept { return angle_of(c, s); }
  Turn inverse() const noexcept { return {c, -s}; }
};

inline Turn operator*(const Turn& a, const Turn& b) noexcept { return {a.c * b.c - a.s * b.s, a.s * b.c + a.c * b.s}; }

// The rotation from the direction of (x, y) to the direction of (u, v).
inline Turn between(double x, double y, double u, double v) noexcept {
  const double c = x * u + y * v, s = x * v - y * u;
  const double scale = 1.0 / std::sqrt(c * c + s * s);
  return {c * scale, s * scale};
}

// A rotation by half an angle, from the squares of the cosine and the sine of this half, up to a common factor.
inline Turn half_turn(double cosine, double sine) noexcept {
  const double scale = 1.0 / (cosine + sine);
  return {std::sqrt(cosine * scale), std::sqrt(sine * scale)};
}

// Rz(turn)ᵀ v.
inline Eigen::Vector3d back_z(const Turn& turn, const Eigen::Vector3d& v) noexcept {
  return {turn.c * v[0] + turn.s * v[1], turn.c * v[1] - turn.s * v[0], v[2]};
}

// Ry(angle)ᵀ v, with c and s the cosine and the sine of the angle.
inline Eigen::Vector3d back_y(double c, double s, const Eigen::Vector3d& v) noexcept {
  return {c * v[0] - s * v[2], v[1], s * v[0] + c * v[2]};
}

}  // namespace sigmaik::detail
