#pragma once
// The public types of types.hpp are unaligned. Eigen 3.4's SelfAdjointEigenSolver does not compile for an unaligned
// matrix of variable size, so the solver gets the same type with Eigen's own alignment.

#include <Eigen/Core>

namespace sigmaik::detail {

template <typename M>
using Aligned = Eigen::Matrix<typename M::Scalar, M::RowsAtCompileTime, M::ColsAtCompileTime, Eigen::ColMajor,
                              M::MaxRowsAtCompileTime, M::MaxColsAtCompileTime>;

}  // namespace sigmaik::detail
