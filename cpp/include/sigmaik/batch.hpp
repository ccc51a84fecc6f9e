#pragma once
/// \file batch.hpp
/// Many independent problems at once.

#include <cstddef>
#include <cstdint>

#include <sigmaik/layout.hpp>
#include <sigmaik/rules.hpp>

namespace sigmaik {

/// Shape and options of solve_batch().
struct BatchShape {
  std::size_t count = 0;  ///< B
  int rows = 0;           ///< m, 1 … 6
  int cols = 0;           ///< n, 1 … 16
};

/// Solves `count` problems, each as a fresh VelocitySolver would, to 1e-9 of the largest entry of q̇. Problems lie side
/// by side in vector lanes: one-sided Jacobi of all lanes at once, with ẋ rotated in place of U. An answer depends, to
/// the last bit, on its own problem alone: neither on other problems nor on place, `count` or `threads`. Problems whose
/// directions rounding decides (σ_min < 1e-5 σ_max, a σ_i at the rule's threshold) go to a VelocitySolver. Only the
/// start of the threads uses the heap.
/// \param jacobian (B, m, n) in C order
/// \param twist (B, m)
/// \param qdot out: (B, n); zero where the problem is not finite
/// \param status out: (B,); may be null
/// \param threads ≥ 1, the most that work at once; never more than the machine has cores
/// \throws Error where a shape or parameter is out of its range
void solve_batch(const Method& method, double length_scale, const BatchShape& shape, const double* jacobian,
                 const double* twist, double* qdot, std::int8_t* status = nullptr, int threads = 1);

SIGMAIK_SAME_LAYOUT(BatchShape);

}  // namespace sigmaik
