#pragma once

#include <sigmaik/types.hpp>

namespace sigmaik::detail {

/// a = vectors · diag(values) · vectorsᵀ, with values from small to large.
struct SymmetricEigen {
  JointVector values;
  JointMatrix vectors;
};

/// Of a symmetric `a`, by Eigen. One place compiles Eigen's solver, which takes a compiler seconds.
SymmetricEigen symmetric_eigen(const JointMatrix& a) noexcept;

}  // namespace sigmaik::detail
