#include <sigmaik/planning/cart_plane.hpp>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "../message.hpp"
#include "band_qp.hpp"

namespace sigmaik::planning {
namespace {

using Vector2d = PlanarPoint;
using sigmaik::detail::message;
using sigmaik::detail::require;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kPi = 3.14159265358979323846;
constexpr int kCoarse = 121;     // samples where starts are compared
constexpr int kForks = 4;        // places where the straight motion is taken round either side
constexpr int kAzimuths = 32;    // places on the disc's border that dynamic programming goes through
constexpr int kSheetsAside = 3;  // turns that it counts either way
constexpr double kLeap = 0.9;    // of the radius: a step that comes nearer leaps over the disc
constexpr int kCoarsePrograms = 30;
constexpr int kPrograms = 300;
constexpr double kSettled = 1e-9;  // of the radius, by which the last program moved the cart
constexpr double kTight = 1e-9;    // of the radius: what counts as on the border
constexpr double kCopy = 1e-4;     // [rad] between tangents of the outer disc
constexpr int kNearer = 5;         // programs towards a way within limits of a longer duration
constexpr int kTightenings = 10;   // such durations
constexpr double kLongest = 1e6;   // times the duration, where limits are too tight

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }
double turn_between(const Vector2d& a, const Vector2d& b) { return std::atan2(cross(a, b), a.dot(b)); }
Vector2d polar(double length, double angle) { return {length * std::cos(angle), length * std::sin(angle)}; }

PlanarPath resampled(const PlanarPath& path, int samples) {
  PlanarPath out(samples, 2);
  const auto last = path.rows() - 1;
  for (int k = 0; k < samples; ++k) {
    const double at = static_cast<double>(k) / (samples - 1) * static_cast<double>(last);
    const auto i = std::min(static_cast<Eigen::Index>(at), last - 1);
    out.row(k) = path.row(i) + (at - static_cast<double>(i)) * (path.row(i + 1) - path.row(i));
  }
  return out;
}

double turn_of(const PlanarPath& d) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i + 1 < d.rows(); ++i) sum += turn_between(d.row(i), d.row(i + 1));
  return sum;
}

// The least distance from the origin of a step from a to b.
double step_distance(const Vector2d& a, const Vector2d& b) {
  const Vector2d step = b - a;
  const double square = step.squaredNorm();
  return (a + (square > 0.0 ? std::clamp(-a.dot(step) / square, 0.0, 1.0) : 0.0) * step).norm();
}

double energy_of(const PlanarPath& c) { return (c.bottomRows(c.rows() - 1) - c.topRows(c.rows() - 1)).squaredNorm(); }

// Tangent, arc, tangent round a disc of radius r from a to b, turning by `turn`, at constant speed.
PlanarPath shortest(const Vector2d& a, const Vector2d& b, double turn, double r, int samples) {
  const double la = std::sqrt(std::max(0.0, a.squaredNorm() - r * r)),
               lb = std::sqrt(std::max(0.0, b.squaredNorm() - r * r));
  const double ua = std::atan2(la, r), ub = std::atan2(lb, r), arc = std::abs(turn) - ua - ub;
  const double sign = turn < 0.0 ? -1.0 : 1.0, from = std::atan2(a.y(), a.x());
  const double begin = from + sign * ua, end = from + turn - sign * ub;  // azimuths where the tangents touch
  PlanarPath d(samples, 2);
  for (int i = 0; i < samples; ++i) {
    const double s = static_cast<double>(i) / (samples - 1);
    if (arc <= 0.0) {
      d.row(i) = (1.0 - s) * a + s * b;
      continue;
    }
    const double way = s * (la + r * arc + lb);
    if (way < la) {
      d.row(i) = a + way / la * (polar(r, begin) - a);
    } else if (way < la + r * arc) {
      d.row(i) = polar(r, begin + sign * (way - la) / r);
    } else {
      const double f = lb > 0.0 ? std::min(1.0, (way - la - r * arc) / lb) : 1.0;
      d.row(i) = (1.0 - f) * polar(r, end) + f * b;
    }
  }
  d.row(0) = a;
  d.row(samples - 1) = b;
  return d;
}

// The straight motion, d = c − f, and as many variants as it has ways round the disc: where it is within the radius its
// azimuth goes evenly from that before to that after, on either side.
std::vector<PlanarPath> forked(const PlanarPath& straight, double r) {
  struct Dip {
    Eigen::Index before, after;
    double turn;
  };
  std::vector<Dip> dips;
  for (Eigen::Index i = 1; i + 1 < straight.rows(); ++i) {
    if (straight.row(i).norm() >= r) continue;
    Eigen::Index after = i;
    while (after + 1 < straight.rows() && straight.row(after).norm() < r) ++after;
    dips.push_back({i - 1, after, turn_between(straight.row(i - 1), straight.row(after))});
    i = after;
  }
  std::vector<std::size_t> longest(dips.size());
  for (std::size_t k = 0; k < dips.size(); ++k) longest[k] = k;
  std::stable_sort(longest.begin(), longest.end(), [&](std::size_t a, std::size_t b) {
    return dips[a].after - dips[a].before > dips[b].after - dips[b].before;
  });
  longest.resize(std::min<std::size_t>(longest.size(), kForks));

  std::vector<PlanarPath> out;
  for (unsigned choice = 0; choice < 1U << longest.size(); ++choice) {
    PlanarPath d = straight;
    for (std::size_t k = 0; k < dips.size(); ++k) {
      const Dip& dip = dips[k];
      const auto at = std::find(longest.begin(), longest.end(), k);
      const bool other = at != longest.end() && (choice >> (at - longest.begin()) & 1U) != 0;
      const double turn = other ? dip.turn - std::copysign(2.0 * kPi, dip.turn) : dip.turn;
      const Vector2d first = straight.row(dip.before);
      const double from = std::atan2(first.y(), first.x());
      for (Eigen::Index i = dip.before + 1; i < dip.after; ++i) {
        const double f = static_cast<double>(i - dip.before) / static_cast<double>(dip.after - dip.before);
        d.row(i) = polar(r, from + f * turn);
      }
    }
    out.push_back(std::move(d));
  }
  return out;
}

// [m per sample], [m per sample²] of each axis.
struct Limits {
  Vector2d speed = Vector2d::Constant(kInfinity), acceleration = Vector2d::Constant(kInfinity);
};

class Planner {
 public:
  Planner(const PlanarPath& f, const Vector2d& start, const Vector2d& end, double r, const PlaneCartOptions& options)
      : f_(f), start_(start), end_(end), r_(r), options_(options) {}

  bool allowed(const Vector2d& c, const Vector2d& f) const {
    const double slack = kTight * r_, distance = (c - f).norm();
    return distance >= r_ - slack && distance <= options_.max_radius + slack &&
           (c.array() >= options_.lower.array() - slack).all() && (c.array() <= options_.upper.array() + slack).all();
  }

  // Places that come into question for `wanted`. Where any place is allowed, one of these is: what is allowed has a
  // corner of the range, a crossing of an edge and a circle, or all of a circle.
  std::vector<Vector2d> places(const Vector2d& f, const Vector2d& wanted) const {
    std::vector<Vector2d> out;
    const Vector2d &low = options_.lower, &high = options_.upper;
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

  // The place nearest to c. False where none is allowed.
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

  // The exact laws of one axis, where the other can stand.
  void along_one_axis(const PlanarPath& f, std::vector<PlanarPath>& guesses) const {
    for (const int axis : {0, 1}) {
      const int other = 1 - axis;
      if (pinned(axis) || start_[other] != end_[other]) continue;
      // Seen with x along the axis, y to its left.
      const double sign = axis == 0 ? 1.0 : -1.0;
      PlanarPath path(f.rows(), 2);
      path.col(0) = f.col(axis);
      path.col(1) = sign * (f.col(other).array() - start_[other]);
      CartOptions options{.lower = options_.lower[axis], .upper = options_.upper[axis]};
      options.turn = options_.turn;
      try {
        const CartLaw law = cart_law(path, start_[axis], end_[axis], r_, options);
        PlanarPath c(f.rows(), 2);
        c.col(axis) = law.x;
        c.col(other).setConstant(start_[other]);
        guesses.push_back(std::move(c));
      } catch (const CartError&) {  // then it is no guess
      }
    }
  }

  // Dynamic programming over places where each sample could be: the way of the least energy that leaps over no disc,
  // for each number of turns.
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
      // Guesses often agree.
      std::sort(at[i].begin(), at[i].end(),
                [](const Vector2d& a, const Vector2d& b) { return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y(); });
      at[i].erase(std::unique(at[i].begin(), at[i].end()), at[i].end());
    }
    // Turns are counted where the azimuth goes over the half-line of π.
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

  // Programs one after the other from c, whose normals are the first to be used. False where a program has no answer.
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
        // Tangents hold the outer disc in from outside: those that were needed stay, but for near copies.
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
      // Once one is solved its answer keeps everything, and all that is lost is the rest of the way down.
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

  // The best of all starts on a coarse grid, or on all samples where there are few.
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
    // Onto all samples in polar coordinates, which keep out of the disc between samples.
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

  // Whether a step leaps over the disc, which fewer samples allow; remembered, to tell.
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
  Vector2d start_, end_;
  double r_;
  const PlaneCartOptions& options_;
  int starts_ = 0, programs_ = 0;
  bool leapt_ = false;
};

// Whether speed and acceleration [per sample] are within limits.
bool keeps(const PlanarPath& c, const Limits& limits, bool at_rest) {
  const auto m = c.rows();
  const PlanarPath step = c.bottomRows(m - 1) - c.topRows(m - 1);
  const PlanarPath bend = step.bottomRows(m - 2) - step.topRows(m - 2);
  for (const int axis : {0, 1}) {
    if (step.col(axis).cwiseAbs().maxCoeff() > limits.speed[axis] * (1.0 + 1e-12)) return false;
    if (bend.col(axis).cwiseAbs().maxCoeff() > limits.acceleration[axis]) return false;
    if (at_rest && std::max(std::abs(step(0, axis)), std::abs(step(m - 2, axis))) > limits.acceleration[axis])
      return false;
  }
  return true;
}

void check(const PlanarPath& path, const Vector2d& start, const Vector2d& end, double radius,
           const PlaneCartOptions& o) {
  require(path.rows() >= 3, "the path has ", path.rows(), " samples; it needs at least 3");
  require(path.allFinite(), "the path must be finite");
  require(std::isfinite(radius) && radius > 0.0, "radius = ", radius, " m must be finite and greater than 0");
  require(std::isfinite(o.margin) && o.margin >= 0.0, "margin = ", o.margin, " m must be finite and not negative");
  require(o.max_radius > radius + o.margin, "max_radius = ", o.max_radius,
          " m must be greater than radius + margin = ", radius + o.margin, " m");
  for (const int axis : {0, 1}) {
    const char name = axis == 0 ? 'x' : 'y';
    require(o.lower[axis] <= o.upper[axis], "the cart's range of ", name, " [", o.lower[axis], ", ", o.upper[axis],
            "] m is empty");
    for (const auto& [end_name, value] : {std::pair{"start", start[axis]}, std::pair{"end", end[axis]}}) {
      require(std::isfinite(value), end_name, ": ", name, " = ", value, " must be finite");
      require(value >= o.lower[axis] && value <= o.upper[axis], end_name, ": ", name, " = ", value,
              " m is out of the cart's range [", o.lower[axis], ", ", o.upper[axis], "] m");
    }
    require(o.max_speed[axis] > 0.0, "max_speed of ", name, " = ", o.max_speed[axis], " m/s must be greater than 0");
    require(o.max_acceleration[axis] > 0.0, "max_acceleration of ", name, " = ", o.max_acceleration[axis],
            " m/s² must be greater than 0");
  }
  require(!o.turn || std::abs(*o.turn) <= 100.0, "turn = ", o.turn.value_or(kNaN), " rad must be within 100");
  require(std::isfinite(o.duration) && o.duration > 0.0, "duration = ", o.duration,
          " s must be finite and greater than 0");
}

[[noreturn]] void refuse(CartFault fault, double feasible_radius, const std::string& facts) {
  throw CartError(fault, feasible_radius, message("no cart motion (", to_string(fault), "): ", facts));
}

}  // namespace

PlaneCartLaw plane_cart_law(const PlanarPath& path, const Vector2d& start, const Vector2d& end, double radius,
                            const PlaneCartOptions& options) {
  check(path, start, end, radius, options);
  const auto m = path.rows();
  const double r = radius + options.margin;
  for (const bool last : {false, true}) {
    const double distance = ((last ? end : start) - path.row(last ? m - 1 : 0).transpose()).norm();
    const char* which = last ? "end" : "start";
    if (distance <= r) {
      refuse(last ? CartFault::EndInside : CartFault::StartInside,
             distance > options.margin ? distance - options.margin : kNaN,
             message("at the ", which, " the point is ", distance,
                     " m from the first joint's axis, which has to be more than ", r, " m"));
    }
    if (distance > options.max_radius) {
      refuse(CartFault::Range, kNaN,
             message("at the ", which, " the point is ", distance, " m from the first joint's axis, farther than ",
                     options.max_radius, " m"));
    }
  }
  Planner planner(path, start, end, r, options);
  for (Eigen::Index i = 1; i + 1 < m; ++i) {
    Vector2d place = path.row(i);
    if (!planner.put(path.row(i), place)) {
      refuse(CartFault::Range, kNaN,
             message("at sample ", i, " no place in the cart's range keeps the point, at (", path(i, 0), ", ",
                     path(i, 1), ") m, within its radii"));
    }
  }
  PlaneCartLaw law;
  if (!planner.search(law.c)) {
    const char* hint = planner.leapt() ? "; some leap over the disc between samples: more samples may help" : "";
    if (options.turn) {
      refuse(CartFault::Winding, kNaN,
             message("within the cart's range no way was found that turns the point about the first joint's axis by ",
                     *options.turn, " rad, to within half a turn", hint));
    }
    refuse(CartFault::Range, kNaN, message("within the cart's range no way round the point was found", hint));
  }
  const double dt = options.duration / static_cast<double>(m - 1);
  const auto limits = [&](double longer) {
    return Limits{longer * dt * options.max_speed, longer * dt * longer * dt * options.max_acceleration};
  };
  if (!keeps(law.c, limits(1.0), options.at_rest)) {
    // Into law.c: within the limits of a duration so many times as long, by way of `from`.
    const auto within = [&](double longer, const PlanarPath& from, int programs) {
      law.c = from;
      Limits inside = limits(longer);
      inside.speed *= 1.0 - 1e-9;
      inside.acceleration *= 1.0 - 1e-9;
      return planner.improve(path, law.c, programs, kSettled, inside);
    };
    PlanarPath way = law.c;
    const bool slow = !keeps(way, {limits(1.0).speed}, false);
    bool done = within(1.0, way, kPrograms);
    if (!done) {
      // The half-planes of a way that takes its limits into account leave more room: down to them from a longer
      // duration.
      double good = 2.0, bad = 1.0;
      while (good < kLongest && !within(good, way, kNearer)) {
        bad = good;
        good *= 2.0;
      }
      for (int k = 0; k < kTightenings && good < kLongest && !done; ++k) {
        if (k > 0 || bad > 1.0) {
          const double middle = 0.5 * (bad + good);
          if (!within(middle, way, kNearer)) {
            bad = middle;
            continue;
          }
          good = middle;
        }
        way = law.c;
        done = within(1.0, way, kPrograms);
      }
      if (!done) {
        refuse(slow ? CartFault::Speed : CartFault::Acceleration, kNaN,
               message("along the best way without limits none was found that keeps to them",
                       good < kLongest ? message("; a duration of ", good * options.duration, " s would do") : ""));
      }
    }
  }
  const PlanarPath d = law.c - path;
  law.energy = energy_of(law.c);
  law.turn = turn_of(d);
  law.starts = planner.starts();
  law.programs = planner.programs();
  law.push = VectorXd::Zero(m);
  for (Eigen::Index i = 1; i + 1 < m; ++i) {
    const double distance = d.row(i).norm();
    if (distance > r * (1.0 + 1e-6)) continue;
    law.push[i] = std::max(0.0, (2.0 * law.c.row(i) - law.c.row(i - 1) - law.c.row(i + 1)).dot(d.row(i)) / distance);
  }
  return law;
}

}  // namespace sigmaik::planning
