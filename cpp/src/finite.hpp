#pragma once
// Whether all entries are finite. x·0 is 0 for finite x only, and a sum of these products needs a fraction of the tests
// that Eigen's allFinite() makes.

#include <Eigen/Core>

namespace sigmaik::detail {

template <typename Derived>
bool finite(const Eigen::MatrixBase<Derived>& x) noexcept {
  return (x.array() * 0.0).sum() == 0.0;
}

}  // namespace sigmaik::detail
