#pragma once
/// \file spectrum.hpp
/// The singular value decomposition under every rule: J = Σ σ_i u_i v_iᵀ.
///
/// One-sided Jacobi (Hestenes 1958): plane rotations U make the columns of Jᵀ U orthogonal; their lengths are the
/// singular values and their directions the v_i. The method does not square the condition number, and finds small σ_i
/// as accurately as the entries of J allow. A start from the last cycle's U leaves little to rotate when J has moved
/// little.

#include <array>
#include <cstdint>

#include <sigmaik/layout.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik::detail {

struct SpectrumParts;  // writes a decomposition that was found elsewhere (solve_batch)

}  // namespace sigmaik::detail

namespace sigmaik {

/// Result and warm start of decompose(). No heap. Start afresh by assigning Spectrum{}.
class Spectrum {
 public:
  /// Decomposes an m×n matrix of finite entries. Real time: at most 30 sweeps, where a cold start takes about 5 and a
  /// warm start 3.
  ///
  /// Singular vectors of a zero singular value are not unique: they continue the last cycle's where there
  /// is one, and are otherwise the same on every machine and run. Signs continue too.
  void decompose(const TaskJacobianRef& jacobian) noexcept;

  /// Number m of rows.
  int rows() const noexcept { return m_; }
  /// Number n of columns.
  int cols() const noexcept { return n_; }
  /// Number of singular values, min(m, n).
  int size() const noexcept { return m_ < n_ ? m_ : n_; }
  /// σ_i ≥ 0, from large to small; 0 beyond size().
  double sigma(int i) const noexcept { return sigma_[static_cast<std::size_t>(i)]; }
  /// u_i (m,), i < m: an orthonormal basis of the task's rows.
  auto u(int i) const noexcept { return u_.col(i).head(m_); }
  /// u_0 … as columns, for rows() == kRows known at compile time.
  template <int kRows>
  auto basis() const noexcept {
    return u_.template topLeftCorner<kRows, kRows>();
  }
  /// v_i (n,), i < size(): orthonormal directions of the joints.
  auto v(int i) const noexcept { return v_.col(i).head(n_); }
  /// u_iᵀ x for x (m,), i < m; 0 beyond.
  std::array<double, kMaxTask> along_u(const TaskVector& x) const noexcept;
  /// v_iᵀ x for x (n,), i < size(); 0 beyond.
  std::array<double, kMaxTask> along_v(const JointRef& x) const noexcept;
  /// Σ x_i v_i (n,), over i < size().
  JointVector combine_v(const std::array<double, kMaxTask>& x) const noexcept;
  /// Sweeps that the last call took.
  int sweeps() const noexcept { return sweeps_; }

 private:
  friend struct detail::SpectrumParts;
  friend struct detail::Members<Spectrum>;
  template <int kPadded>
  void decompose_padded(const TaskJacobianRef& jacobian) noexcept;

  int m_ = 0, n_ = 0, sweeps_ = 0;
  std::uint32_t cycle_ = 0;  // since the start
  std::array<double, kMaxTask> sigma_{};
  // Entries beyond m and n stay zero: sums over them change nothing.
  static constexpr int kPaddedTask = 8;
  using PaddedU = Eigen::Matrix<double, kPaddedTask, kMaxTask, kLayout>;
  using PaddedV = Eigen::Matrix<double, kMaxJoints, kMaxTask, kLayout>;
  PaddedU u_ = PaddedU::Zero();
  PaddedV v_ = PaddedV::Zero();
};

SIGMAIK_SAME_LAYOUT(Spectrum);

}  // namespace sigmaik
