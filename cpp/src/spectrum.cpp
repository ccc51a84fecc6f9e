#include <sigmaik/spectrum.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace sigmaik {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr int kMaxSweeps = 30;     // five are usual from a cold start; the bound is for the proof
constexpr int kRefreshPeriod = 16;  // cycles between clean-ups of the warm start's orthogonality

// Round robin: every round pairs all columns once, and the pairs of a round are independent of each other.
struct Pair {
  int p, q;
};
template <int k>
struct Order;
// clang-format off
template <> struct Order<1> { static constexpr std::array<Pair, 0> pairs{}; };
template <> struct Order<2> { static constexpr std::array<Pair, 1> pairs{{{0,1}}}; };
template <> struct Order<3> { static constexpr std::array<Pair, 3> pairs{{{0,1},{0,2},{1,2}}}; };
template <> struct Order<4> { static constexpr std::array<Pair, 6> pairs{{{0,1},{2,3}, {0,2},{1,3}, {0,3},{1,2}}}; };
template <> struct Order<5> { static constexpr std::array<Pair, 10> pairs{{
    {0,1},{2,4}, {0,3},{1,2}, {3,4},{0,2}, {1,4},{2,3}, {0,4},{1,3}}}; };
template <> struct Order<6> { static constexpr std::array<Pair, 15> pairs{{
    {0,1},{2,5},{3,4}, {0,5},{1,4},{2,3}, {0,4},{3,5},{1,2}, {0,3},{2,4},{1,5}, {0,2},{1,3},{4,5}}}; };
// clang-format on

template <int kPadded>
using Columns = Eigen::Matrix<double, kPadded, kMaxTask>;
using Rotation = Eigen::Matrix<double, kMaxTask, kMaxTask>;

// Rotates pairs of the first k columns of w (and of r with them) until all are orthogonal. Returns the sweeps.
template <int k, int kPadded>
int orthogonalise(Columns<kPadded>& w, Rotation& r) noexcept {
  std::array<double, kMaxTask> square{};
  for (int sweep = 1; sweep <= kMaxSweeps; ++sweep) {
    double largest = 0.0;
    for (int i = 0; i < k; ++i) {
      square[static_cast<std::size_t>(i)] = w.col(i).squaredNorm();
      largest = std::max(largest, square[static_cast<std::size_t>(i)]);
    }
    // A column this short is rounding noise of the others; there is nothing in it to make orthogonal.
    const double noise = largest * (kEpsilon * kEpsilon);
    double worst_cosine = 0.0, worst_tangent = 0.0;  // the cosine is squared
    for (const auto [p, q] : Order<k>::pairs) {
      double& a = square[static_cast<std::size_t>(p)];
      double& b = square[static_cast<std::size_t>(q)];
      const double c = w.col(p).dot(w.col(q));
      const double cc = c * c, ab = a * b;
      if (!(cc > 16.0 * kEpsilon * kEpsilon * ab) || std::min(a, b) <= noise) continue;
      const double difference = b - a;
      const double denominator = std::abs(difference) + std::sqrt(difference * difference + 4.0 * cc);
      const double t = std::copysign(2.0, difference) * c / denominator;  // tan of the smaller angle
      const double cosine = 1.0 / std::sqrt(1.0 + t * t), sine = cosine * t;
      const Eigen::Matrix<double, kPadded, 1> wp = w.col(p);
      w.col(p) = cosine * wp - sine * w.col(q);
      w.col(q) = sine * wp + cosine * w.col(q);
      const Eigen::Matrix<double, kMaxTask, 1> rp = r.col(p);
      r.col(p) = cosine * rp - sine * r.col(q);
      r.col(q) = sine * rp + cosine * r.col(q);
      a -= t * c;
      b += t * c;
      worst_cosine = std::max(worst_cosine, cc / ab);
      worst_tangent = std::max(worst_tangent, std::abs(t));
    }
    // What a sweep leaves behind is of second order: an inner product that was zeroed early meets the rotations that
    // come later, and becomes at most (cosine of the one) × (cosine, or tangent, of the other).
    worst_cosine = std::sqrt(worst_cosine);
    if (worst_cosine * std::max(worst_cosine, worst_tangent) <= kEpsilon) return sweep;
  }
  return kMaxSweeps;
}

template <int kPadded>
int orthogonalise(int k, Columns<kPadded>& w, Rotation& r) noexcept {
  switch (k) {
    case 1: return orthogonalise<1>(w, r);
    case 2: return orthogonalise<2>(w, r);
    case 3: return orthogonalise<3>(w, r);
    case 4: return orthogonalise<4>(w, r);
    case 5: return orthogonalise<5>(w, r);
    default: return orthogonalise<6>(w, r);
  }
}

// Fills column i of an otherwise orthonormal basis (columns < i, and those of `given` beyond it) of R^dimension with a
// unit vector orthogonal to the rest: the last cycle's if that still points somewhere new, else the coordinate axis
// that does most.
template <typename Basis>
void complete(Basis& basis, int i, int dimension, unsigned given) noexcept {
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

// One Newton step towards the nearest orthogonal matrix: squares the defect.
void refresh(Rotation& r) noexcept {
  const Rotation gram = r.transpose() * r;
  r = r * (1.5 * Rotation::Identity() - 0.5 * gram);
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

template <int kPadded>
void Spectrum::decompose_padded(const TaskJacobianRef& jacobian) noexcept {
  const bool wide = m_ <= n_;
  const int k = size();

  // Fourth powers of the entries must neither overflow nor vanish: an exact factor, for extreme matrices only.
  const double peak = jacobian.cwiseAbs().maxCoeff();
  const double factor = peak > 1e60 || (peak < 1e-60 && peak > 0.0)
                            ? std::ldexp(1.0, std::clamp(-std::ilogb(peak), -1000, 1000))
                            : 1.0;

  Rotation r = Rotation::Identity();
  if (cycle_ > 0) {
    if (wide) {
      r.topLeftCorner(k, k) = u_.topLeftCorner(k, k);
    } else {
      r.topLeftCorner(k, k) = v_.topLeftCorner(k, k);
    }
    if (cycle_ % kRefreshPeriod == 0) refresh(r);
  }
  ++cycle_;

  Columns<kPadded> w = Columns<kPadded>::Zero();
  const bool cold = cycle_ == 1;
  for (int i = 0; i < k; ++i) {
    auto column = w.col(i);
    if (cold) {
      if (wide) {
        column.head(n_) = factor * jacobian.row(i).transpose();
      } else {
        column.head(m_) = factor * jacobian.col(i);
      }
      continue;
    }
    for (int j = 0; j < k; ++j) {
      if (wide) {
        column.head(n_) += (factor * r(j, i)) * jacobian.row(j).transpose();
      } else {
        column.head(m_) += (factor * r(j, i)) * jacobian.col(j);
      }
    }
  }

  sweeps_ = orthogonalise<kPadded>(k, w, r);

  std::array<double, kMaxTask> length{};
  std::array<int, kMaxTask> order{};
  for (int i = 0; i < k; ++i) {
    length[static_cast<std::size_t>(i)] = w.col(i).norm();
    int at = i;  // insertion sort, from large to small, stable
    for (; at > 0 && length[static_cast<std::size_t>(order[static_cast<std::size_t>(at - 1)])] <
                         length[static_cast<std::size_t>(i)];
         --at) {
      order[static_cast<std::size_t>(at)] = order[static_cast<std::size_t>(at - 1)];
    }
    order[static_cast<std::size_t>(at)] = i;
  }

  // Below this a column is mostly rounding, and its direction means nothing.
  const double noise = 16.0 * kEpsilon * length[static_cast<std::size_t>(order[0])];
  unsigned given = 0;
  sigma_.fill(0.0);
  for (int i = 0; i < k; ++i) {
    const int from = order[static_cast<std::size_t>(i)];
    const double l = length[static_cast<std::size_t>(from)];
    sigma_[static_cast<std::size_t>(i)] = l / factor;
    if (wide) {
      u_.col(i) = r.col(from);
      if (l > noise) v_.col(i).template head<kPadded>() = w.col(from) / l;
    } else {
      v_.col(i).template head<kMaxTask>() = r.col(from);
      if (l > noise) u_.col(i) = w.col(from).template head<kMaxTask>() / l;
    }
    if (l > noise) given |= 1u << i;
  }
  if (wide) {
    for (int i = 0; i < k; ++i) {
      if (given >> i & 1u) continue;
      complete(v_, i, n_, given);
      given |= 1u << i;
    }
  } else {
    for (int i = 0; i < m_; ++i) {
      if (given >> i & 1u) continue;
      complete(u_, i, m_, given);
      given |= 1u << i;
    }
  }
}

}  // namespace sigmaik
