#pragma once
// Ways round a disc at the origin, as positions d = c − f (M, 2) of a cart seen from the point, evenly spaced in time.

#include <cmath>
#include <vector>

#include <Eigen/Core>

#include <sigmaik/planning/cart.hpp>

namespace sigmaik::planning::detail {

using Eigen::Vector2d;

inline double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }
inline double turn_between(const Vector2d& a, const Vector2d& b) { return std::atan2(cross(a, b), a.dot(b)); }
inline Vector2d polar(double length, double angle) { return {length * std::cos(angle), length * std::sin(angle)}; }

/// The path at `samples` samples, by linear interpolation.
PlanarPath resampled(const PlanarPath& path, int samples);

/// Turn [rad] of the azimuth along d.
double turn_of(const PlanarPath& d);

/// The least distance from the origin of a step from a to b.
double step_distance(const Vector2d& a, const Vector2d& b);

/// Σ |Δc|².
double energy_of(const PlanarPath& c);

/// Tangent, arc, tangent round a disc of radius r from a to b, turning by `turn`, at constant speed.
PlanarPath shortest(const Vector2d& a, const Vector2d& b, double turn, double r, int samples);

/// The straight motion, in a variant for each way round the disc: where the motion is within the radius, its azimuth
/// goes evenly from the sample before to the sample after, on either side.
std::vector<PlanarPath> forked(const PlanarPath& straight, double r);

}  // namespace sigmaik::planning::detail
