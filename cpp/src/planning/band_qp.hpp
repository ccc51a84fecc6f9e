#pragma once
// min Σ_i (x_{i+1} − x_i)² between given ends, under bounds on combinations of up to three neighbours, in O(M) a step: a
// primal-dual interior-point method after Mehrotra, whose normal matrix has five diagonals. In long double: rows of second
// differences make fourth differences, whose condition is (M/π)⁴, 10¹³ for 5000 samples.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace sigmaik::planning {

// lower ≤ Σ_k c_k x_{first + k} ≤ upper, either may be infinite.
struct BandRow {
  int first, count;
  std::array<double, 3> c;
  double lower, upper;
};

class BandQp {
 public:
  explicit BandQp(std::vector<BandRow> rows) : rows_(std::move(rows)) {}

  // From a guess x (M ≥ 3), whose ends stay. False where no x within the bounds was found; x is then of no use.
  bool solve(std::vector<double>& x) {
    const std::size_t m = x.size();
    x_.assign(x.begin(), x.end());
    Real energy = 0;
    for (std::size_t i = 0; i + 1 < m; ++i) energy += square(x_[i + 1] - x_[i]);
    if (!(energy > 0)) energy = 1;
    weight_ = 2 / energy;  // the objective is about 1
    start();
    if (bounds_.empty()) return true;
    int stuck = 0;
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      gradient();
      const Real mu = complementarity();
      if (worst_bound() < 1e-11L && worst_gradient() < 1e-9L && mu * static_cast<Real>(bounds_.size()) < 1e-10L) {
        for (std::size_t i = 0; i < m; ++i) x[i] = static_cast<double>(x_[i]);
        return true;
      }
      if (!factor()) return false;
      step(0, false);
      const Real affine_primal = longest(&Bound::s, &Bound::ds), affine_dual = longest(&Bound::z, &Bound::dz);
      Real affine = 0;
      for (const Bound& b : bounds_) affine += (b.s + affine_primal * b.ds) * (b.z + affine_dual * b.dz);
      affine /= static_cast<Real>(bounds_.size());
      const Real sigma = affine / mu;
      for (Bound& b : bounds_) b.cross = b.ds * b.dz;
      step(sigma * sigma * sigma * mu, true);
      const Real primal = std::min<Real>(1, 0.995L * longest(&Bound::s, &Bound::ds));
      const Real dual = std::min<Real>(1, 0.995L * longest(&Bound::z, &Bound::dz));
      stuck = primal < 1e-3L ? stuck + 1 : 0;
      if (stuck == 3) return false;  // multipliers without end: there is no such x
      for (std::size_t i = 0; i < m; ++i) x_[i] += primal * dx_[i];
      for (Bound& b : bounds_) {
        b.s += primal * b.ds;
        b.z += dual * b.dz;
      }
    }
    return false;
  }

 private:
  using Real = long double;
  static constexpr int kIterations = 60;

  // sign · (row − limit) = s > 0, times `scale`.
  struct Bound {
    int row;
    Real sign, limit, scale;
    Real s, z, ds, dz, cross, residual;
  };

  static Real square(Real v) { return v * v; }

  Real value(const BandRow& r, const std::vector<Real>& v) const {
    Real sum = 0;
    for (int k = 0; k < r.count; ++k) {
      sum += static_cast<Real>(r.c[static_cast<std::size_t>(k)]) * v[static_cast<std::size_t>(r.first + k)];
    }
    return sum;
  }

  // Bounds scaled so that what they allow, or what is there, is about 1; slacks away from 0.
  void start() {
    bounds_.clear();
    for (std::size_t j = 0; j < rows_.size(); ++j) {
      const BandRow& r = rows_[j];
      const double width = r.upper - r.lower;
      const Real now = value(r, x_);
      const auto add = [&](Real sign, double limit) {
        const Real length = std::max<Real>(std::abs(static_cast<Real>(limit)), std::abs(now));
        const Real size = std::isfinite(width) && width > 0.0 ? static_cast<Real>(width) : length;
        const Real scale = size > 0 ? 1 / size : 1;
        const Real s = std::max<Real>(sign * (now - limit) * scale, 0.1L);
        const Real z = 1 / (s * static_cast<Real>(2 * rows_.size()));
        bounds_.push_back({static_cast<int>(j), sign, limit, scale, s, z, 0, 0, 0, 0});
      };
      if (std::isfinite(r.lower)) add(1, r.lower);
      if (std::isfinite(r.upper)) add(-1, r.upper);
    }
    for (auto* v : {&dx_, &slope_, &right_, &d0_, &d1_, &d2_}) v->assign(x_.size(), 0);
  }

  // Of the Lagrangian, into slope_; and what the bounds are off by.
  void gradient() {
    const std::size_t m = x_.size();
    for (std::size_t i = 1; i + 1 < m; ++i) slope_[i] = weight_ * (2 * x_[i] - x_[i - 1] - x_[i + 1]);
    for (Bound& b : bounds_) {
      const BandRow& r = rows_[static_cast<std::size_t>(b.row)];
      b.residual = b.sign * b.scale * (value(r, x_) - b.limit) - b.s;
      scatter(r, -b.sign * b.scale * b.z, slope_);
    }
    slope_.front() = slope_.back() = 0;
  }

  static void scatter(const BandRow& r, Real factor, std::vector<Real>& to) {
    for (int k = 0; k < r.count; ++k) {
      to[static_cast<std::size_t>(r.first + k)] += factor * static_cast<Real>(r.c[static_cast<std::size_t>(k)]);
    }
  }

  Real complementarity() const {
    Real sum = 0;
    for (const Bound& b : bounds_) sum += b.s * b.z;
    return sum / static_cast<Real>(bounds_.size());
  }
  Real worst_bound() const {
    Real worst = 0;
    for (const Bound& b : bounds_) worst = std::max(worst, std::abs(b.residual));
    return worst;
  }
  // Relative to what makes it up.
  Real worst_gradient() const {
    Real worst = 0, size = weight_ * 1e-12L;
    for (const Real v : slope_) worst = std::max(worst, std::abs(v));
    for (const Bound& b : bounds_) {
      const BandRow& r = rows_[static_cast<std::size_t>(b.row)];
      size = std::max(size, b.scale * b.z * std::abs(static_cast<Real>(r.c[0])));
    }
    return worst / size;
  }

  // K = LDLᵀ with the diagonals d0_, d1_, d2_; the ends are fixed.
  bool factor() {
    const std::size_t m = x_.size();
    for (std::size_t i = 0; i < m; ++i) {
      d0_[i] = 2 * weight_;
      d1_[i] = -weight_;
      d2_[i] = 0;
    }
    for (const Bound& b : bounds_) {
      const BandRow& r = rows_[static_cast<std::size_t>(b.row)];
      const Real w = square(b.scale) * b.z / b.s;
      for (int k = 0; k < r.count; ++k) {
        const auto i = static_cast<std::size_t>(r.first + k);
        const Real wc = w * static_cast<Real>(r.c[static_cast<std::size_t>(k)]);
        d0_[i] += wc * static_cast<Real>(r.c[static_cast<std::size_t>(k)]);
        if (k + 1 < r.count) d1_[i] += wc * static_cast<Real>(r.c[static_cast<std::size_t>(k + 1)]);
        if (k + 2 < r.count) d2_[i] += wc * static_cast<Real>(r.c[static_cast<std::size_t>(k + 2)]);
      }
    }
    d0_[0] = d0_[m - 1] = 1;
    d1_[0] = d2_[0] = d1_[m - 2] = d2_[m - 3] = 0;
    for (std::size_t i = 0; i < m; ++i) {
      if (!(d0_[i] > 0)) return false;
      if (i + 1 < m) {
        const Real l1 = d1_[i] / d0_[i], l2 = i + 2 < m ? d2_[i] / d0_[i] : 0;
        d0_[i + 1] -= l1 * d1_[i];
        if (i + 2 < m) {
          d1_[i + 1] -= l1 * d2_[i];
          d0_[i + 2] -= l2 * d2_[i];
        }
        d1_[i] = l1;
        d2_[i] = l2;
      }
    }
    return true;
  }

  // dx_, and ds, dz of the bounds, towards s z = target, with the products of the last step where `corrected`.
  void step(Real target, bool corrected) {
    const std::size_t m = x_.size();
    for (std::size_t i = 0; i < m; ++i) right_[i] = -slope_[i];
    for (const Bound& b : bounds_) {
      const Real push = (target - (corrected ? b.cross : 0)) / b.s - b.z - b.z / b.s * b.residual;
      scatter(rows_[static_cast<std::size_t>(b.row)], b.sign * b.scale * push, right_);
    }
    right_.front() = right_.back() = 0;
    for (std::size_t i = 0; i < m; ++i) {
      dx_[i] = right_[i];
      if (i > 0) dx_[i] -= d1_[i - 1] * dx_[i - 1];
      if (i > 1) dx_[i] -= d2_[i - 2] * dx_[i - 2];
    }
    for (std::size_t i = m; i-- > 0;) {
      dx_[i] /= d0_[i];
      if (i + 1 < m) dx_[i] -= d1_[i] * dx_[i + 1];
      if (i + 2 < m) dx_[i] -= d2_[i] * dx_[i + 2];
    }
    for (Bound& b : bounds_) {
      const Real moved = b.sign * b.scale * value(rows_[static_cast<std::size_t>(b.row)], dx_);
      b.ds = moved + b.residual;
      b.dz = (target - (corrected ? b.cross : 0)) / b.s - b.z - b.z / b.s * b.ds;
    }
  }

  // How far s or z can go before one is 0; at most a thousand.
  Real longest(Real Bound::*at, Real Bound::*by) const {
    Real far = 1000;
    for (const Bound& b : bounds_) {
      if (b.*by < 0) far = std::min<Real>(far, -(b.*at) / (b.*by));
    }
    return std::min<Real>(far, 1 / 0.995L);
  }

  std::vector<BandRow> rows_;
  std::vector<Bound> bounds_;
  std::vector<Real> x_, dx_, slope_, right_, d0_, d1_, d2_;
  Real weight_ = 1;
};

}  // namespace sigmaik::planning
