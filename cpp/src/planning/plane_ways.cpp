#include "plane_ways.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sigmaik::planning::detail {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kForks = 4;  // places where the straight motion is taken round either side

}  // namespace

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

double step_distance(const Vector2d& a, const Vector2d& b) {
  const Vector2d step = b - a;
  const double square = step.squaredNorm();
  return (a + (square > 0.0 ? std::clamp(-a.dot(step) / square, 0.0, 1.0) : 0.0) * step).norm();
}

double energy_of(const PlanarPath& c) { return (c.bottomRows(c.rows() - 1) - c.topRows(c.rows() - 1)).squaredNorm(); }

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

}  // namespace sigmaik::planning::detail
