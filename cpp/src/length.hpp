#pragma once
// The length of a vector of three, for any finite entries, and a cap on it.

#include <cmath>

#include <Eigen/Core>

namespace sigmaik::detail {

inline double length(const Eigen::Vector3d& x) noexcept {
  const double square = x.squaredNorm();
  // Squares of far targets overflow, those of the smallest angles vanish.
  if (square > 1e-200 && square < 1e200) return std::sqrt(square);
  return std::hypot(x[0], x[1], x[2]);
}

inline void shorten(Eigen::Ref<Eigen::Vector3d> x, double longest) noexcept {
  const double now = length(x);
  if (now > longest) x *= longest / now;
}

}  // namespace sigmaik::detail
