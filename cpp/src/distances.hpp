#pragma once
// Exact distances of capsules. A capsule's distance is that of its segment less its radius, and the distance of a
// convex shape is a convex function along a segment: its derivative grows, and has one zero.

#include <algorithm>
#include <cmath>

#include <sigmaik/collisions.hpp>

namespace sigmaik::detail {

using Vector3 = Eigen::Vector3d;

// Signed distance of a point from a shape, negative inside, and its gradient.
struct PointDistance {
  double distance;
  Vector3 gradient;
};

// An obstacle, where it is now.
struct PlacedShape {
  Obstacle::Shape shape = Obstacle::Shape::Sphere;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Vector3 center = Vector3::Zero();
  Vector3 size = Vector3::Zero();
};

// Of a segment and a shape, or of two segments: the nearest points on the axes, less no radius.
struct Nearest {
  double distance = 0.0;
  Vector3 normal = Vector3::UnitZ();  // from the other body to the body
  Vector3 point = Vector3::Zero();    // on the body's segment
};

// The gradient of |x|, any direction where x = 0.
inline Vector3 direction_of(const Vector3& x, double length) noexcept {
  return length > 1e-300 ? Vector3(x / length) : Vector3::UnitZ();
}

// From distances to the faces of a pair of perpendicular walls (or three), negative between them: outside the norm of
// the positive ones, inside the largest.
inline PointDistance of_box(const Vector3& local, const Vector3& half) noexcept {
  const Vector3 beside = local.cwiseAbs() - half;
  const Vector3 outside = beside.cwiseMax(0.0);
  const double length = outside.norm();
  Vector3 gradient = Vector3::Zero();
  double distance = length;
  if (length > 0.0) {
    gradient = outside / length;
  } else {
    Eigen::Index axis = 0;
    distance = beside.maxCoeff(&axis);
    gradient[axis] = 1.0;
  }
  for (int i = 0; i < 3; ++i) gradient[i] = std::copysign(gradient[i], local[i]);
  return {distance, gradient};
}

inline PointDistance of_cylinder(const Vector3& local, double radius, double half) noexcept {
  const double around = std::hypot(local[0], local[1]);
  const double beside = around - radius, above = std::abs(local[2]) - half;
  const Vector3 out = around > 1e-300 ? Vector3(local[0] / around, local[1] / around, 0.0) : Vector3::UnitX();
  const Vector3 up(0.0, 0.0, std::copysign(1.0, local[2]));
  const double x = std::max(beside, 0.0), z = std::max(above, 0.0), length = std::hypot(x, z);
  if (length > 0.0) return {length, (x * out + z * up) / length};
  return beside > above ? PointDistance{beside, out} : PointDistance{above, up};
}

inline PointDistance point_distance(const PlacedShape& s, const Vector3& point) noexcept {
  const Vector3 from = point - s.center;
  switch (s.shape) {
    case Obstacle::Shape::Sphere: {
      const double length = from.norm();
      return {length - s.size[0], direction_of(from, length)};
    }
    case Obstacle::Shape::HalfSpace: return {from.dot(s.rotation.col(2)), s.rotation.col(2)};
    case Obstacle::Shape::Capsule: {
      const Vector3 axis = s.rotation.col(2);
      const double half = 0.5 * s.size[1];
      const Vector3 off = from - std::clamp(from.dot(axis), -half, half) * axis;
      const double length = off.norm();
      return {length - s.size[0], direction_of(off, length)};
    }
    case Obstacle::Shape::Box: {
      const PointDistance local = of_box(s.rotation.transpose() * from, 0.5 * s.size);
      return {local.distance, s.rotation * local.gradient};
    }
    case Obstacle::Shape::Cylinder: break;
  }
  const PointDistance local = of_cylinder(s.rotation.transpose() * from, s.size[0], 0.5 * s.size[1]);
  return {local.distance, s.rotation * local.gradient};
}

// The nearest parameters in [0, 1] of two segments (Ericson, Real-Time Collision Detection, 5.1.9).
inline void nearest_of_segments(const Vector3& a, const Vector3& along_a, const Vector3& b, const Vector3& along_b,
                                double& s, double& t) noexcept {
  const Vector3 r = a - b;
  const double aa = along_a.squaredNorm(), bb = along_b.squaredNorm(), f = along_b.dot(r), c = along_a.dot(r);
  constexpr double kPoint = 1e-24;  // [m²] a shorter segment is a point
  if (aa <= kPoint) {
    s = 0.0;
    t = bb <= kPoint ? 0.0 : std::clamp(f / bb, 0.0, 1.0);
    return;
  }
  if (bb <= kPoint) {
    t = 0.0;
    s = std::clamp(-c / aa, 0.0, 1.0);
    return;
  }
  const double ab = along_a.dot(along_b), denominator = aa * bb - ab * ab;
  s = denominator > 1e-14 * aa * bb ? std::clamp((ab * f - c * bb) / denominator, 0.0, 1.0) : 0.5;
  t = (ab * s + f) / bb;
  if (t < 0.0 || t > 1.0) {
    t = std::clamp(t, 0.0, 1.0);
    s = std::clamp((ab * t - c) / aa, 0.0, 1.0);
  } else if (denominator <= 1e-14 * aa * bb) {  // parallel: any s whose t is inside
    s = std::clamp((ab * t - c) / aa, 0.0, 1.0);
  }
}

inline Nearest segment_to_segment(const Vector3& a, const Vector3& a_end, const Vector3& b,
                                  const Vector3& b_end) noexcept {
  double s = 0.0, t = 0.0;
  nearest_of_segments(a, a_end - a, b, b_end - b, s, t);
  Nearest out;
  out.point = a + s * (a_end - a);
  const Vector3 way = out.point - (b + t * (b_end - b));
  out.distance = way.norm();
  out.normal = direction_of(way, out.distance);
  if (!(out.distance > 1e-12)) {  // the segments cross: apart at right angles to both
    Vector3 apart = (a_end - a).cross(b_end - b);
    if (!(apart.squaredNorm() > 1e-24)) apart = (a_end - a).unitOrthogonal();
    if (apart.dot(a + a_end - b - b_end) < 0.0) apart = -apart;
    out.normal = apart.normalized();
  }
  return out;
}

// Where the distance of a convex shape is least along a segment: a zero of its derivative, by bisection.
inline double least_along(const PlacedShape& shape, const Vector3& a, const Vector3& along) noexcept {
  const auto slope = [&](double t) { return point_distance(shape, a + t * along).gradient.dot(along); };
  if (!(slope(0.0) < 0.0)) return 0.0;
  if (!(slope(1.0) > 0.0)) return 1.0;
  double low = 0.0, high = 1.0;
  for (int i = 0; i < 44; ++i) {
    const double middle = 0.5 * (low + high);
    (slope(middle) < 0.0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

inline Nearest segment_to_shape(const Vector3& a, const Vector3& b, const PlacedShape& shape) noexcept {
  const Vector3 along = b - a;
  double t = 0.0;
  switch (shape.shape) {
    case Obstacle::Shape::Capsule: {
      const Vector3 half = 0.5 * shape.size[1] * shape.rotation.col(2);
      Nearest out = segment_to_segment(a, b, shape.center - half, shape.center + half);
      out.distance -= shape.size[0];
      return out;
    }
    case Obstacle::Shape::Sphere: {
      const double square = along.squaredNorm();
      if (square > 1e-24) t = std::clamp(along.dot(shape.center - a) / square, 0.0, 1.0);
      break;
    }
    case Obstacle::Shape::HalfSpace: t = along.dot(shape.rotation.col(2)) < 0.0 ? 1.0 : 0.0; break;
    case Obstacle::Shape::Box:
    case Obstacle::Shape::Cylinder: t = least_along(shape, a, along); break;
  }
  const Vector3 point = a + t * along;
  const PointDistance found = point_distance(shape, point);
  return {found.distance, found.gradient, point};
}

}  // namespace sigmaik::detail
