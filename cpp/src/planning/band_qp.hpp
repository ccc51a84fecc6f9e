#pragma once
// min Σ_i |x_{i+1} − x_i|² between given ends, x of one or more axes, under bounds on combinations of up to three
// entries, in O(M) a step: a primal-dual interior-point method after Mehrotra, whose normal matrix has four diagonals
// for each axis beside the main one. In long double: rows of second differences make fourth differences, whose
// condition is (M/π)⁴, 10¹³ for 5000 samples.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace sigmaik::planning {

// lower ≤ Σ_k c_k x_{first + k stride} ≤ upper, either may be infinite. It spans at most three samples.
struct BandRow {
  int first, count;
  std::array<double, 3> c;
  double lower, upper;
  int stride = 1;
};

// Samples of kAxes entries each, one after the other.
template <int kAxes>
class BandQp {
 public:
  // pinned: axes that stay where the guess has them.
  explicit BandQp(std::vector<BandRow> rows, std::array<bool, kAxes> pinned = {})
      : rows_(std::move(rows)), pinned_(pinned) {}

  // From a guess x (M ≥ 3 samples), whose ends stay. False where no x within the bounds was found; x is then of no use.
  bool solve(std::vector<double>& x) {
    const std::size_t m = x.size();
    x_.assign(x.begin(), x.end());
    Real energy = 0;
    for (std::size_t i = 0; i + kStep < m; ++i) energy += square(x_[i + kStep] - x_[i]);
    if (!(energy > 0)) energy = 1;
    weight_ = 2 / energy;  // the objective is about 1
    step_ = std::sqrt(energy / static_cast<Real>(m));
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
  static constexpr std::size_t kStep = kAxes;      // from a sample to the next
  static constexpr std::size_t kBand = 2 * kAxes;  // diagonals beside the main one

  using Band = std::array<Real, kBand + 1>;

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
      sum += static_cast<Real>(r.c[static_cast<std::size_t>(k)]) * v[static_cast<std::size_t>(r.first + k * r.stride)];
    }
    return sum;
  }

  // The ends, and axes that are pinned.
  bool fixed(std::size_t i) const { return i < kStep || i + kStep >= x_.size() || pinned_[i % kStep]; }

  void hold_fixed(std::vector<Real>& v) const {
    for (std::size_t i = 0; i < v.size(); ++i) {
      if (fixed(i)) v[i] = 0;
    }
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
    for (auto* v : {&dx_, &slope_, &right_}) v->assign(x_.size(), 0);
    band_.assign(x_.size(), {});
  }

  // Of the Lagrangian, into slope_; and what the bounds are off by.
  void gradient() {
    const std::size_t m = x_.size();
    for (std::size_t i = kStep; i + kStep < m; ++i) slope_[i] = weight_ * (2 * x_[i] - x_[i - kStep] - x_[i + kStep]);
    for (Bound& b : bounds_) {
      const BandRow& r = rows_[static_cast<std::size_t>(b.row)];
      b.residual = b.sign * b.scale * (value(r, x_) - b.limit) - b.s;
      scatter(r, -b.sign * b.scale * b.z, slope_);
    }
    hold_fixed(slope_);
  }

  static void scatter(const BandRow& r, Real factor, std::vector<Real>& to) {
    for (int k = 0; k < r.count; ++k) {
      to[static_cast<std::size_t>(r.first + k * r.stride)] += factor *
                                                              static_cast<Real>(r.c[static_cast<std::size_t>(k)]);
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
  // Relative to what makes it up; where no bound matters, to a thousandth of a step.
  Real worst_gradient() const {
    Real worst = 0, size = 1e-3L * weight_ * step_;
    for (const Real v : slope_) worst = std::max(worst, std::abs(v));
    for (const Bound& b : bounds_) {
      const BandRow& r = rows_[static_cast<std::size_t>(b.row)];
      for (int k = 0; k < r.count; ++k) {
        size = std::max(size, b.scale * b.z * std::abs(static_cast<Real>(r.c[static_cast<std::size_t>(k)])));
      }
    }
    return worst / size;
  }

  // K = LDLᵀ, with row i of the upper half in band_[i].
  bool factor() {
    const std::size_t m = x_.size();
    for (Band& b : band_) {
      b = {};
      b[0] = 2 * weight_;
      b[kStep] = -weight_;
    }
    for (const Bound& b : bounds_) {
      const BandRow& r = rows_[static_cast<std::size_t>(b.row)];
      const Real w = square(b.scale) * b.z / b.s;
      for (int k = 0; k < r.count; ++k) {
        const auto i = static_cast<std::size_t>(r.first + k * r.stride);
        const Real wc = w * static_cast<Real>(r.c[static_cast<std::size_t>(k)]);
        for (int l = k; l < r.count; ++l) {
          band_[i][static_cast<std::size_t>((l - k) * r.stride)] += wc *
                                                                    static_cast<Real>(r.c[static_cast<std::size_t>(l)]);
        }
      }
    }
    for (std::size_t i = 0; i < m; ++i) {
      for (std::size_t a = 1; a <= kBand; ++a) {
        if (fixed(i) || i + a >= m || fixed(i + a)) band_[i][a] = 0;
      }
      if (fixed(i)) band_[i][0] = 1;
    }
    for (std::size_t i = 0; i < m; ++i) {
      Band& row = band_[i];
      if (!(row[0] > 0)) return false;
      for (std::size_t a = 1; a <= kBand && i + a < m; ++a) {
        const Real l = row[a] / row[0];
        for (std::size_t b = a; b <= kBand && i + b < m; ++b) band_[i + a][b - a] -= l * row[b];
      }
      for (std::size_t a = 1; a <= kBand; ++a) row[a] /= row[0];
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
    hold_fixed(right_);
    for (std::size_t i = 0; i < m; ++i) {
      dx_[i] = right_[i];
      for (std::size_t a = 1; a <= kBand && a <= i; ++a) dx_[i] -= band_[i - a][a] * dx_[i - a];
    }
    for (std::size_t i = m; i-- > 0;) {
      dx_[i] /= band_[i][0];
      for (std::size_t a = 1; a <= kBand && i + a < m; ++a) dx_[i] -= band_[i][a] * dx_[i + a];
    }
    for (Bound& b : bounds_) {
      const Real moved = b.sign * b.scale * value(rows_[static_cast<std::size_t>(b.row)], dx_);
      b.ds = moved + b.residual;
      b.dz = (target - (corrected ? b.cross : 0)) / b.s - b.z - b.z / b.s * b.ds;
    }
  }

  // How far s or z can go before one is 0; at most a thousand.
  Real longest(Real Bound::* at, Real Bound::* by) const {
    Real far = 1000;
    for (const Bound& b : bounds_) {
      if (b.*by < 0) far = std::min<Real>(far, -(b.*at) / (b.*by));
    }
    return std::min<Real>(far, 1 / 0.995L);
  }

  std::vector<BandRow> rows_;
  std::vector<Bound> bounds_;
  std::array<bool, kAxes> pinned_;
  std::vector<Real> x_, dx_, slope_, right_;
  std::vector<Band> band_;
  Real weight_ = 1, step_ = 0;
};

}  // namespace sigmaik::planning
