#include <sigmaik/spectrum.hpp>

#include <algorithm>
#include <cmath>
#include <functional>

#include "jacobi.hpp"
#include "work.hpp"

namespace sigmaik {
namespace {

using detail::JacobiWork;

constexpr int kMaxSweeps = 30;     // five are usual from a cold start; the bound is for the proof
constexpr int kRefreshPeriod = 8;  // cycles between clean-ups of the warm start's orthogonality

// The entry of the kernel for one width of vectors.
template <int length>
using Run = int (*)(JacobiWork<length>&, int, const double*, std::ptrdiff_t, std::ptrdiff_t, int, double);

template <int length>
int run_baseline(JacobiWork<length>& work, int k, const double* a, std::ptrdiff_t inner, std::ptrdiff_t outer,
                 int count, double factor) noexcept {
  return detail::jacobi<2>(work, k, a, inner, outer, count, factor, kMaxSweeps);
}

#if defined(__x86_64__) && !defined(SIGMAIK_NO_DISPATCH)
template <int length>
__attribute__((target("avx2,fma"))) int run_avx2(JacobiWork<length>& work, int k, const double* a, std::ptrdiff_t inner,
                                                 std::ptrdiff_t outer, int count, double factor) noexcept {
  return detail::jacobi<4>(work, k, a, inner, outer, count, factor, kMaxSweeps);
}

// Set when the library is loaded, so that the loop has nothing to test; usable, if slower, even before.
template <int length>
Run<length> run = run_baseline<length>;

[[maybe_unused]] const bool chosen = [] {
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    run<8> = run_avx2<8>;
    run<kMaxJoints> = run_avx2<kMaxJoints>;
  }
  return true;
}();
#else
template <int length>
constexpr Run<length> run = run_baseline<length>;
#endif

// Fills column i of a basis whose columns in `given` are orthonormal with a unit vector of R^dimension orthogonal to
// them: what stands there if that still points somewhere new, else the coordinate axis that does most.
template <typename Basis>
void complete(Basis basis, int i, int dimension, unsigned given) noexcept {
  using Vector = Eigen::Matrix<double, Basis::RowsAtCompileTime, 1>;
  const auto reject = [&](Vector x) {
    for (int pass = 0; pass < 2; ++pass) {  // twice is enough (Kahan and Parlett)
      for (int j = 0; j < basis.cols(); ++j) {
        if (given >> j & 1u) x -= basis.col(j).dot(x) * basis.col(j);
      }
    }
    return x;
  };
  Vector best = reject(basis.col(i));
  double length = best.norm();
  if (!(length > 0.5)) {
    length = 0.0;
    for (int axis = 0; axis < dimension; ++axis) {
      const Vector candidate = reject(Vector::Unit(axis));
      const double norm = candidate.norm();
      if (norm > 1.001 * length) {  // ties, up to rounding, go to the first
        length = norm;
        best = candidate;
      }
    }
  }
  basis.col(i) = best / length;
}

// The steps of decompose_padded(). They are inlined, as they run in every control cycle.

// One Newton step towards the nearest orthogonal matrix, which squares the defect that rounding has left.
SIGMAIK_INLINE void refresh(double* rotated, int stride) noexcept {
  using Square = Eigen::Matrix<double, kMaxTask, kMaxTask>;
  Eigen::Map<Square, 0, Eigen::OuterStride<>> r(rotated, Eigen::OuterStride<>(stride));
  Square gram = r.transpose() * r;
  r = (r * (1.5 * Square::Identity() - 0.5 * gram)).eval();
}

// Returns the number of sweeps. `factor` is what scales the Jacobian so that its squares neither overflow nor vanish.
template <int length>
SIGMAIK_INLINE int run_scaled(JacobiWork<length>& work, int k, const TaskJacobianRef& jacobian, std::ptrdiff_t inner,
                              std::ptrdiff_t outer, int count, double& factor) noexcept {
  factor = 1.0;
  const int sweeps = run<length>(work, k, jacobian.data(), inner, outer, count, factor);
  if (sweeps != 0) return sweeps;
  const double peak = jacobian.cwiseAbs().maxCoeff();
  if (!(peak > 0.0)) return 0;
  factor = std::ldexp(1.0, std::clamp(-std::ilogb(peak), -1000, 1000));
  return run<length>(work, k, jacobian.data(), inner, outer, count, factor);
}

// Below this a column is mostly rounding: neither its direction nor its place among its like means anything.
SIGMAIK_INLINE double noise_square(const double* square, int k) noexcept {
  double peak = 0.0;
  for (int i = 0; i < k; ++i) peak = std::max(peak, square[i]);
  return peak * (detail::kNoise * detail::kNoise);
}

// Insertion sort, from large to small; what is equal keeps the last cycle's order.
SIGMAIK_INLINE void sort_squares(const double* square, int k, double noise, std::array<int, kMaxTask>& order) noexcept {
  for (int i = 0; i < k; ++i) {
    int at = i;
    for (const double more = square[i] * (1.0 - detail::kNoise);
         at > 0 && more > noise && square[order[static_cast<std::size_t>(at - 1)]] < more; --at) {
      order[static_cast<std::size_t>(at)] = order[static_cast<std::size_t>(at - 1)];
    }
    order[static_cast<std::size_t>(at)] = i;
  }
}

// Where there is noise, both vectors go on from the last cycle's: the rotations have stirred them as they liked.
template <typename U, typename V>
SIGMAIK_INLINE void complete_both(const U& u, int m, const V& v, int n, unsigned given) noexcept {
  for (int i = 0; i < m; ++i) {
    if (given >> i & 1u) continue;
    complete(u, i, m, given);
    if (i < std::min(m, n)) complete(v, i, n, given);
    given |= 1u << i;
  }
}

}  // namespace

void Spectrum::decompose(const TaskJacobianRef& jacobian) noexcept {
  const int m = static_cast<int>(jacobian.rows()), n = static_cast<int>(jacobian.cols());
  if (m != m_ || n != n_) {
    *this = Spectrum{};
    m_ = m;
    n_ = n;
  }
  if (std::max(m, n) <= 8) {
    decompose_padded<8>(jacobian);
  } else {
    decompose_padded<kMaxJoints>(jacobian);
  }
}

// Products with whole, padded blocks, whose size the compiler knows: what lies beyond m, n and size() is zero.

std::array<double, kMaxTask> Spectrum::along_u(const TaskVector& x) const noexcept {
  Eigen::Matrix<double, kPaddedTask, 1> padded = Eigen::Matrix<double, kPaddedTask, 1>::Zero();
  std::copy_n(x.data(), x.size(), padded.data());
  std::array<double, kMaxTask> out;
  Eigen::Map<Eigen::Matrix<double, kMaxTask, 1>>(out.data()) = u_.transpose().lazyProduct(padded);
  return out;
}

std::array<double, kMaxTask> Spectrum::along_v(const JointRef& x) const noexcept {
  std::array<double, kMaxTask> out;
  Eigen::Map<Eigen::Matrix<double, kMaxTask, 1>> result(out.data());
  Eigen::Matrix<double, kMaxJoints, 1> padded = Eigen::Matrix<double, kMaxJoints, 1>::Zero();
  std::copy_n(x.data(), x.size(), padded.data());
  if (n_ <= 8) {
    result = v_.topRows<8>().transpose().lazyProduct(padded.head<8>());
  } else {
    result = v_.transpose().lazyProduct(padded);
  }
  return out;
}

JointVector Spectrum::combine_v(const std::array<double, kMaxTask>& x) const noexcept {
  const Eigen::Map<const Eigen::Matrix<double, kMaxTask, 1>> factors(x.data());
  if (n_ <= 8) {
    const Eigen::Matrix<double, 8, 1> sum = v_.topRows<8>().lazyProduct(factors);
    return sum.head(n_);
  }
  const Eigen::Matrix<double, kMaxJoints, 1> sum = v_.lazyProduct(factors);
  return sum.head(n_);
}

template <int kPadded>
void Spectrum::decompose_padded(const TaskJacobianRef& jacobian) noexcept {
  // The k columns to make orthogonal are those of Jᵀ, rotated by U, or those of J, rotated by V, whichever are fewer.
  const bool wide = m_ <= n_;
  const int k = size(), length = std::max(m_, n_);
  const std::ptrdiff_t inner = wide ? jacobian.outerStride() : 1, outer = wide ? 1 : jacobian.outerStride();
  double* const rotated = wide ? u_.data() : v_.data();
  const int rotated_stride = wide ? kPaddedTask : kMaxJoints;
  double* const divided = wide ? v_.data() : u_.data();
  const int divided_stride = wide ? kMaxJoints : kPaddedTask;

  JacobiWork<kPadded> work;
  if (cycle_ == 0) {
    for (int i = 0; i < k; ++i) rotated[i * rotated_stride + i] = 1.0;
  } else if (cycle_ % kRefreshPeriod == 0) {
    refresh(rotated, rotated_stride);
  }
  ++cycle_;
  for (int i = 0; i < k; ++i) std::copy_n(rotated + i * rotated_stride, kPaddedTask, work.r[i]);

  double factor;
  sweeps_ = run_scaled(work, k, jacobian, inner, outer, length, factor);
  detail::count_work(&detail::Work::sweeps, sweeps_);
  const double noise = noise_square(work.square, k);
  std::array<int, kMaxTask> order{};
  sort_squares(work.square, k, noise, order);

  unsigned given = 0;
  for (int i = 0; i < k; ++i) {
    const int from = order[static_cast<std::size_t>(i)];
    const double sigma = std::sqrt(work.square[from]);
    sigma_[static_cast<std::size_t>(i)] = sigma / factor;
    if (!(work.square[from] > noise)) continue;
    given |= 1u << i;
    std::copy_n(work.r[from], kPaddedTask, rotated + i * rotated_stride);
    const double inverse = 1.0 / sigma;
    const int count = wide ? kPadded : kPaddedTask;
    for (int j = 0; j < count; ++j) divided[i * divided_stride + j] = inverse * work.w[from][j];
  }
  std::sort(sigma_.begin(), sigma_.begin() + k, std::greater<>{});  // what is equal but for rounding, too
  const Eigen::Map<Eigen::Matrix<double, kPaddedTask, kMaxTask>> u(u_.data());
  const Eigen::Map<Eigen::Matrix<double, kMaxJoints, kMaxTask>> v(v_.data());
  complete_both(u, m_, v, n_, given);
}

}  // namespace sigmaik
