#pragma once
// The search for a cart's motion in the plane: first guesses, and quadratic programs that improve them.

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <sigmaik/planning/cart_plane.hpp>

#include "../numbers.hpp"
#include "band_qp.hpp"
#include "plane_ways.hpp"

namespace sigmaik::planning::detail {

using sigmaik::detail::kInfinity;
constexpr double kPi = 3.14159265358979323846;
constexpr int kCoarse = 121;         // samples of the coarse grid, on which starts are compared
constexpr int kCoarsePrograms = 30;  // quadratic programs of a start on the coarse grid
constexpr int kPrograms = 300;       // quadratic programs of the best start on all samples
constexpr int kAzimuths = 32;        // places on the disc's border for dynamic programming
constexpr int kSheetsAside = 3;      // turns that dynamic programming counts either way
constexpr double kLeap = 0.9;        // of the radius: a step that comes nearer leaps over the disc
constexpr double kSettled = 1e-9;    // of the radius: a program that moves the cart less is the last
constexpr double kTight = 1e-9;      // of the radius: tolerance of being on the border
constexpr double kCopy = 1e-4;       // [rad] tangents of the outer disc closer than this are copies

inline Vector2d pair(const AxisPair& values) { return {values[0], values[1]}; }

// [m per sample], [m per sample²] of each axis.
struct Limits {
  Vector2d speed = Vector2d::Constant(kInfinity), acceleration = Vector2d::Constant(kInfinity);
};

class PlaneSearch {
 public:
  PlaneSearch(const PlanarPath& f, const Vector2d& start, const Vector2d& end, double r,
              const PlaneCartOptions& options)
      : f_(f),
        start_(start),
        end_(end),
        lower_(pair(options.lower)),
        upper_(pair(options.upper)),
        r_(r),
        options_(options) {}

  bool allowed(const Vector2d& c, const Vector2d& f) const {
    const double slack = kTight * r_, distance = (c - f).norm();
    return distance >= r_ - slack && distance <= options_.max_radius + slack &&
           (c.array() >= lower_.array() - slack).all() && (c.array() <= upper_.array() + slack).all();
  }

  // Candidates for the allowed place nearest to `wanted`. If any place is allowed, one of the candidates is allowed,
  // because the allowed places contain a corner of the range, a crossing of an edge and a circle, or a whole circle.
  std::vector<Vector2d> places(const Vector2d& f, const Vector2d& wanted) const {
    std::vector<Vector2d> out;
    const Vector2d &low = lower_, &high = upper_;
    const Vector2d d = wanted - f;
    const Vector2d n = d.norm() > 0.0 ? Vector2d(d / d.norm()) : Vector2d(1.0, 0.0);
    out.push_back(wanted);
    out.push_back(wanted.cwiseMax(low).cwiseMin(high));
    for (const double radius : {r_, options_.max_radius}) {
      if (radius == kInfinity) continue;
      out.push_back(f + radius * n);
      for (const int axis : {0, 1}) {
        for (const double edge : {low[axis], high[axis]}) {
          const double off = edge - f[axis];
          if (!(std::abs(off) <= radius)) continue;
          const double half = std::sqrt((radius - off) * (radius + off));
          for (const double sign : {-1.0, 1.0}) {
            Vector2d crossing;
            crossing[axis] = edge;
            crossing[1 - axis] = f[1 - axis] + sign * half;
            out.push_back(crossing);
          }
        }
      }
    }
    for (const double x : {low.x(), high.x()}) {
      for (const double y : {low.y(), high.y()}) {
        if (std::isfinite(x) && std::isfinite(y)) out.emplace_back(x, y);
      }
    }
    std::erase_if(out, [&](const Vector2d& c) { return !allowed(c, f); });
    return out;
  }

  // Moves c to the nearest candidate. Returns false if no place is allowed.
  bool put(const Vector2d& f, Vector2d& c) const {
    const Vector2d wanted = c;
    double nearest = kInfinity;
    for (const Vector2d& place : places(f, wanted)) {
      if ((place - wanted).norm() >= nearest) continue;
      nearest = (place - wanted).norm();
      c = place;
    }
    return nearest < kInfinity;
  }
  bool put_all(const PlanarPath& f, PlanarPath& c) const {
    for (Eigen::Index i = 1; i + 1 < c.rows(); ++i) {
      Vector2d place = c.row(i);
      if (!put(f.row(i), place)) return false;
      c.row(i) = place;
    }
    return true;
  }

  // Adds the exact laws of one axis as guesses, where the other axis can stand.
  void along_one_axis(const PlanarPath& f, std::vector<PlanarPath>& guesses) const {
    for (const int axis : {0, 1}) {
      const int other = 1 - axis;
      if (pinned(axis) || start_[other] != end_[other]) continue;
      // The frame of cart_law(): x along the axis, y to the left of the axis.
      const double sign = axis == 0 ? 1.0 : -1.0;
      PlanarPath path(f.rows(), 2);
      path.col(0) = f.col(axis);
      path.col(1) = sign * (f.col(other).array() - start_[other]);
      CartOptions options{.lower = options_.lower[axis], .upper = options_.upper[axis]};
      options.turn = options_.turn;
      try {
        const CartLaw law = cart_law(path, start_[axis], end_[axis], r_, options);
        PlanarPath c(f.rows(), 2);
        c.col(axis) = Eigen::Map<const Eigen::VectorXd>(law.x.data(), f.rows());
        c.col(other).setConstant(start_[other]);
        guesses.push_back(std::move(c));
      } catch (const CartError&) {  // this axis gives no guess
      }
    }
  }

  // Dynamic programming over candidate places of each sample: for each number of turns, the motion of the least energy
  // that does not leap over the disc.
  std::vector<PlanarPath> walked(const PlanarPath& f, const std::vector<PlanarPath>& guesses) const {
    const auto m = static_cast<std::size_t>(f.rows());
    std::vector<std::vector<Vector2d>> at(m);
    at.front() = {start_};
    at.back() = {end_};
    for (std::size_t i = 1; i + 1 < m; ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      const Vector2d here = f.row(row);
      for (const PlanarPath& guess : guesses) {
        const std::vector<Vector2d> some = places(here, guess.row(row));
        at[i].insert(at[i].end(), some.begin(), some.end());
      }
      for (int k = 0; k < kAzimuths; ++k) {
        const Vector2d place = here + polar(r_, 2.0 * kPi * k / kAzimuths);
        if (allowed(place, here)) at[i].push_back(place);
      }
      // Guesses often agree, so duplicates are removed.
      std::sort(at[i].begin(), at[i].end(),
                [](const Vector2d& a, const Vector2d& b) { return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y(); });
      at[i].erase(std::unique(at[i].begin(), at[i].end()), at[i].end());
    }
    // A turn is counted where the azimuth crosses π.
    struct State {
      double energy = kInfinity;
      std::size_t from = 0;
    };
    constexpr std::size_t kSheets = 2 * kSheetsAside + 1;
    std::vector<std::vector<State>> states(m);
    for (std::size_t i = 0; i < m; ++i) states[i].resize(at[i].size() * kSheets);
    states[0][kSheetsAside].energy = 0.0;
    for (std::size_t i = 0; i + 1 < m; ++i) {
      for (std::size_t j = 0; j < at[i].size(); ++j) {
        const Vector2d a = at[i][j] - f.row(static_cast<Eigen::Index>(i)).transpose();
        for (std::size_t k = 0; k < at[i + 1].size(); ++k) {
          const Vector2d b = at[i + 1][k] - f.row(static_cast<Eigen::Index>(i + 1)).transpose();
          if (step_distance(a, b) < kLeap * r_) continue;
          const double energy = (at[i + 1][k] - at[i][j]).squaredNorm();
          const double turned = std::atan2(a.y(), a.x()) + turn_between(a, b);
          const int over = turned > kPi ? 1 : turned <= -kPi ? -1 : 0;
          for (std::size_t sheet = 0; sheet < kSheets; ++sheet) {
            const auto next = static_cast<std::size_t>(static_cast<int>(sheet) + over);
            if (next >= kSheets) continue;
            State& to = states[i + 1][k * kSheets + next];
            const double sum = states[i][j * kSheets + sheet].energy + energy;
            if (sum < to.energy) to = {sum, j * kSheets + sheet};
          }
        }
      }
    }
    std::vector<PlanarPath> out;
    for (std::size_t sheet = 0; sheet < kSheets; ++sheet) {
      if (states[m - 1][sheet].energy == kInfinity) continue;
      PlanarPath c(f.rows(), 2);
      std::size_t state = sheet;
      for (std::size_t i = m; i-- > 0; state = states[i][state].from)
        c.row(static_cast<Eigen::Index>(i)) = at[i][state / kSheets];
      out.push_back(std::move(c));
    }
    return out;
  }

  // Solves one program after the other; the first takes its normals from c. Returns false if no program leads to an
  // answer.
  bool improve(const PlanarPath& f, PlanarPath& c, int programs, double settled, const Limits& limits = {}) {
    const auto m = static_cast<int>(c.rows());
    std::vector<BandRow> fixed, rows, cuts;
    for (int i = 1; i + 1 < m; ++i) {
      for (const int axis : {0, 1}) {
        if (pinned(axis)) continue;
        const double low = options_.lower[axis], high = options_.upper[axis];
        if (std::isfinite(low) || std::isfinite(high)) {
          fixed.push_back({2 * i + axis, 1, {1.0, 0.0, 0.0}, low - start_[axis], high - start_[axis]});
        }
      }
    }
    for (const int axis : {0, 1}) {
      const double a = limits.acceleration[axis];
      if (pinned(axis)) continue;
      for (int i = 0; i + 2 < m && a < kInfinity; ++i) fixed.push_back({2 * i + axis, 3, {1.0, -2.0, 1.0}, -a, a, 2});
      for (int i = 0; i + 1 < m; ++i) {
        double most = limits.speed[axis];
        if (options_.at_rest && (i == 0 || i + 2 == m)) most = std::min(most, a);
        if (most < kInfinity) fixed.push_back({2 * i + axis, 2, {-1.0, 1.0, 0.0}, -most, most, 2});
      }
    }
    std::vector<std::size_t> last_cut(static_cast<std::size_t>(m), std::numeric_limits<std::size_t>::max());
    std::vector<double> x(static_cast<std::size_t>(2 * m));
    for (int k = 0; k < programs; ++k) {
      rows = fixed;
      for (int i = 1; i + 1 < m; ++i) {
        const Vector2d d = c.row(i) - f.row(i);
        const double distance = d.norm();
        const Vector2d n = distance > 0.0 ? Vector2d(d / distance) : Vector2d(1.0, 0.0);
        const double offset = n.dot(f.row(i).transpose() - start_);
        rows.push_back({2 * i, 2, {n.x(), n.y(), 0.0}, r_ + offset, kInfinity});
        // Tangents bound the outer disc from outside: tangents of earlier programs stay, except near copies.
        if (distance > options_.max_radius * (1.0 - kTight)) {
          const BandRow cut{2 * i, 2, {n.x(), n.y(), 0.0}, -kInfinity, options_.max_radius + offset};
          std::size_t& last = last_cut[static_cast<std::size_t>(i)];
          if (last < cuts.size() && std::abs(cuts[last].c[0] * n.y() - cuts[last].c[1] * n.x()) < kCopy) {
            cuts[last] = cut;
          } else {
            last = cuts.size();
            cuts.push_back(cut);
          }
        }
      }
      rows.insert(rows.end(), cuts.begin(), cuts.end());
      Eigen::Map<PlanarPath> moved(x.data(), m, 2);
      moved = c.rowwise() - start_.transpose();
      ++programs_;
      // The answer of an earlier program keeps all constraints; only the remaining decrease of the energy is lost.
      if (!BandQp<2>(rows, {pinned(0), pinned(1)}).solve(x)) return k > 0 && reaches(f, c);
      moved.rowwise() += start_.transpose();
      const double step = (moved - c).cwiseAbs().maxCoeff();
      c = moved;
      c.row(0) = start_;
      c.row(m - 1) = end_;
      if (step < settled * r_ && reaches(f, c)) break;
    }
    return true;
  }

  // Finds the best of all starts on a coarse grid (on all samples if there are few), and refines it on all samples.
  bool search(PlanarPath& best) {
    const int m = std::min(static_cast<int>(f_.rows()), kCoarse);
    const PlanarPath f = m == f_.rows() ? f_ : resampled(f_, m);
    PlanarPath straight(m, 2);
    for (int i = 0; i < m; ++i) {
      const double s = static_cast<double>(i) / (m - 1);
      straight.row(i) = (1.0 - s) * start_ + s * end_;
    }
    std::vector<PlanarPath> guesses;
    for (PlanarPath& d : forked(straight - f, r_)) guesses.push_back(d + f);
    const Vector2d a = start_ - f.row(0).transpose(), b = end_ - f.row(m - 1).transpose();
    const double nearest = turn_between(a, b), asked = options_.turn.value_or(turn_of(guesses.front() - f));
    const double whole = 2.0 * kPi * std::round((asked - nearest) / (2.0 * kPi));
    for (const int more : {0, -1, 1}) {
      if (more != 0 && options_.turn) break;
      guesses.push_back(shortest(a, b, nearest + whole + 2.0 * kPi * more, r_, m) + f);
    }
    double least = kInfinity;
    along_one_axis(f, guesses);
    for (PlanarPath& c : walked(f, guesses)) guesses.push_back(std::move(c));
    for (PlanarPath& c : guesses) {
      if (!turns_as_asked(c - f) || !put_all(f, c) || leap(c - f) || !turns_as_asked(c - f)) continue;
      ++starts_;
      if (!improve(f, c, kCoarsePrograms, 1e-4) || leap(c - f) || !turns_as_asked(c - f)) continue;
      const double energy = energy_of(c);
      if (energy < least) {
        least = energy;
        best = c;
      }
    }
    if (least == kInfinity) return false;
    // Interpolation in polar coordinates keeps out of the disc between samples.
    const PlanarPath d = best - f;
    const auto last = f_.rows() - 1;
    if (m <= last) {
      PlanarPath fine(f_.rows(), 2);
      for (Eigen::Index i = 0; i <= last; ++i) {
        const double at = static_cast<double>(i) / static_cast<double>(last) * (m - 1);
        const auto k = std::min(static_cast<Eigen::Index>(at), static_cast<Eigen::Index>(m - 2));
        const double part = at - static_cast<double>(k), from = std::atan2(d(k, 1), d(k, 0));
        const double length = (1.0 - part) * d.row(k).norm() + part * d.row(k + 1).norm();
        fine.row(i) = f_.row(i) + polar(length, from + part * turn_between(d.row(k), d.row(k + 1))).transpose();
      }
      best = std::move(fine);
    }
    best.row(0) = start_;
    best.row(last) = end_;
    return put_all(f_, best) && improve(f_, best, kPrograms, kSettled) && !leap(best - f_) && turns_as_asked(best - f_);
  }

  bool turns_as_asked(const PlanarPath& d) const {
    return !options_.turn || std::abs(turn_of(d) - *options_.turn) <= kPi * (1.0 + 1e-9);
  }

  // Whether a step leaps over the disc, which a coarse grid allows. leapt_ remembers a leap for the text of an error.
  bool leap(const PlanarPath& d) {
    for (Eigen::Index i = 0; i + 1 < d.rows(); ++i) {
      if (step_distance(d.row(i), d.row(i + 1)) < kLeap * r_) return leapt_ = true;
    }
    return false;
  }
  bool leapt() const { return leapt_; }

  int starts() const { return starts_; }
  int programs() const { return programs_; }

 private:
  bool pinned(int axis) const { return options_.lower[axis] == options_.upper[axis]; }

  bool reaches(const PlanarPath& f, const PlanarPath& c) const {
    return options_.max_radius == kInfinity ||
           ((c - f).rowwise().norm().array() <= options_.max_radius + kTight * r_).all();
  }

  const PlanarPath& f_;
  Vector2d start_, end_, lower_, upper_;
  double r_;
  const PlaneCartOptions& options_;
  int starts_ = 0, programs_ = 0;
  bool leapt_ = false;
};

}  // namespace sigmaik::planning::detail
