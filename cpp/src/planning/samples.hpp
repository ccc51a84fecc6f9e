#pragma once
// Rows of (N, n) arrays in C order as joint vectors, evenly spaced times, and how densely motions are looked at.

#include <cstddef>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include <sigmaik/chain.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik::planning::detail {

/// Samples of a step where a motion is looked at between its nodes.
inline constexpr std::size_t kDense = 10;

inline Eigen::Map<const JointVector> joints(const std::vector<double>& rows, std::size_t k, std::size_t n) {
  return {rows.data() + k * n, static_cast<Eigen::Index>(n)};
}
inline Eigen::Map<JointVector> joints(std::vector<double>& rows, std::size_t k, std::size_t n) {
  return {rows.data() + k * n, static_cast<Eigen::Index>(n)};
}

/// The chain with the smaller of the acceleration and the deceleration limit for both: a plan's acceleration has one
/// bound for each joint.
inline Chain with_even_acceleration(const Chain& chain) {
  JointLimits limits = chain.limits();
  if ((limits.deceleration.array() == std::numeric_limits<double>::infinity()).all()) return chain;
  limits.acceleration = limits.acceleration.cwiseMin(limits.braking());
  limits.deceleration.resize(0);
  return chain.with_limits(limits);
}

/// `count` ≥ 2 numbers from `first` to `last`, both of them exact.
inline std::vector<double> evenly(double first, double last, std::size_t count) {
  const double step = (last - first) / static_cast<double>(count - 1);
  std::vector<double> out(count);
  for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<double>(i) * step + first;
  out.back() = last;
  return out;
}

}  // namespace sigmaik::planning::detail
