#include <sigmaik/planning/cart.hpp>

#include <algorithm>
#include <cmath>
#include <queue>
#include <string>

#include "../message.hpp"
#include "band_qp.hpp"

namespace sigmaik::planning {
namespace {

using sigmaik::detail::message;
using sigmaik::detail::require;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kPi = 3.14159265358979323846;
constexpr double kNear = 1e-6;    // [samples] a tip keeps away from the samples beside it
constexpr double kLongest = 1e6;  // times the duration, where limits of acceleration are too tight
constexpr int kLeap = 16;         // points inside a region that lies between two samples

struct GridPoint {
  double px, py;        // P [m]
  double lower, upper;  // λ∓ [m]; +∞, −∞ where nothing is forbidden
};

// A connected part of the forbidden region.
struct Extent {
  int first, last;   // in the grid
  double low, high;  // least λ−, largest λ+ [m]
  int winding;       // turns of P's azimuth if the cart passes above, more than if it passes below: 1, 0 or −1
};

// The samples, and between them what the region has there: its tips, and all of it where a step leaps over it.
struct Grid {
  std::vector<double> at;  // [samples], whole numbers at samples
  std::vector<GridPoint> points;
  std::vector<Extent> extents;
};

Grid make_grid(const PlanarPath& path, double r) {
  const int m = static_cast<int>(path.rows());
  Grid g;
  g.at.reserve(static_cast<std::size_t>(m + kLeap));
  g.points.reserve(static_cast<std::size_t>(m + kLeap));
  bool open = false;  // the last point is in the last extent, which may go on
  const auto add = [&](double at, double px, double py, double h) {
    const int k = static_cast<int>(g.at.size());
    g.at.push_back(at);
    g.points.push_back({px, py, h >= 0.0 ? px - h : kInfinity, h >= 0.0 ? px + h : -kInfinity});
    if (h < 0.0) {
      open = false;
      return;
    }
    if (!open) g.extents.push_back({k, k, kInfinity, -kInfinity, 0});
    open = true;
    Extent& e = g.extents.back();
    e.last = k;
    e.low = std::min(e.low, px - h);
    e.high = std::max(e.high, px + h);
    const bool from_right = g.points[static_cast<std::size_t>(e.first)].py < 0.0;
    e.winding = (py < 0.0) == from_right ? 0 : from_right ? -1 : 1;
  };
  // The point of the step from sample i where y has this value.
  const auto add_between = [&](int i, double y, double h) {
    const double f = std::clamp((y - path(i, 1)) / (path(i + 1, 1) - path(i, 1)), kNear, 1.0 - kNear);
    add(i + f, path(i, 0) + f * (path(i + 1, 0) - path(i, 0)), path(i, 1) + f * (path(i + 1, 1) - path(i, 1)), h);
  };
  for (int i = 0; i < m; ++i) {
    const double x = path(i, 0), y = path(i, 1);
    const bool in = std::abs(y) < r;
    add(i, x, y, in ? std::sqrt((r - y) * (r + y)) : -1.0);
    if (i + 1 == m) break;
    const double next = path(i + 1, 1);
    const bool next_in = std::abs(next) < r;
    if (in != next_in) {
      add_between(i, std::copysign(r, in ? next : y), 0.0);
    } else if (!in && (y > 0.0) != (next > 0.0)) {
      for (int k = 0; k <= kLeap; ++k) {
        const double angle = kPi * (static_cast<double>(k) / kLeap - 0.5), sign = y > 0.0 ? -1.0 : 1.0;
        add_between(i, sign * r * std::sin(angle), k % kLeap == 0 ? 0.0 : r * std::cos(angle));
      }
    }
  }
  return g;
}

struct Point {
  double t, x;
  int index;
};

// b is below the line from a to c; mirrored for kSign −1.
template <int kSign>
bool below(const Point& a, const Point& b, const Point& c) {
  return kSign * ((c.x - b.x) * (b.t - a.t) - (b.x - a.x) * (c.t - b.t)) > 0.0;
}

// A taut string in a tube, after the funnels of Lee and Preparata (1984). From the last corner on, the chain `low` is
// the least concave function above the lower bounds, `high` the greatest convex one below the upper bounds. A bound
// that the other chain stands in the way of pulls the string around that chain.
class Funnel {
 public:
  void draw(int n, const double* at, const double* lower, const double* upper, double* x, std::vector<int>& corners) {
    for (Chain* chain : {&low_, &high_}) chain->points.reserve(static_cast<std::size_t>(n));
    corners.reserve(static_cast<std::size_t>(n));
    value_.reserve(static_cast<std::size_t>(n));
    corners.assign(1, 0);
    value_.assign(1, lower[0]);
    low_.begin({at[0], lower[0], 0});
    high_.begin({at[0], lower[0], 0});
    for (int i = 1; i < n; ++i) {
      if (lower[i] > -kInfinity) add<1>({at[i], lower[i], i}, low_, high_, corners);
      if (upper[i] < kInfinity) add<-1>({at[i], upper[i], i}, high_, low_, corners);
    }
    corners.push_back(n - 1);
    value_.push_back(lower[n - 1]);
    for (std::size_t k = 0; k + 1 < corners.size(); ++k) {
      const int a = corners[k], b = corners[k + 1];
      const double slope = (value_[k + 1] - value_[k]) / (at[b] - at[a]);
      x[a] = value_[k];
      // Between corners the string is in the tube but for rounding.
      for (int i = a + 1; i < b; ++i) x[i] = std::clamp(value_[k] + slope * (at[i] - at[a]), lower[i], upper[i]);
    }
    x[n - 1] = lower[n - 1];
  }

 private:
  struct Chain {
    std::vector<Point> points;
    std::size_t head = 0;

    void begin(const Point& p) {
      points.assign(1, p);
      head = 0;
    }
    std::size_t size() const { return points.size() - head; }
  };

  // kSign 1: p is a lower bound, `own` the concave chain, `other` the convex one; −1: mirrored.
  template <int kSign>
  void add(const Point& p, Chain& own, Chain& other, std::vector<int>& corners) {
    while (own.size() > 1 && !below<-kSign>(own.points[own.points.size() - 2], own.points.back(), p)) {
      own.points.pop_back();
    }
    while (own.size() == 1 && other.size() > 1 &&
           below<kSign>(other.points[other.head], other.points[other.head + 1], p)) {
      const Point& corner = other.points[++other.head];
      own.begin(corner);
      corners.push_back(corner.index);
      value_.push_back(corner.x);
    }
    own.points.push_back(p);
  }

  Chain low_, high_;
  std::vector<double> value_;  // of the string at its corners
};

struct Outcome {
  std::optional<CartFault> fault;
  std::string facts;
  CartLaw law;
};

// The best sides by branch and bound: a node has some regions' sides fixed and leaves out the others.
class Search {
 public:
  Search(const PlanarPath& path, double start, double end, double r, const CartOptions& options)
      : grid_(make_grid(path, r)),
        start_(start),
        end_(end),
        r_(r),
        options_(options),
        top_slope_(options.max_speed * options.duration / static_cast<double>(path.rows() - 1)) {
    if (options.turn) turns_ = static_cast<int>(std::lround((*options.turn - ends_turn()) / (2.0 * kPi)));
  }

  Outcome run() {
    Outcome out;
    std::vector<signed char> sides;
    if (!fix_sides(sides, out)) return out;
    std::priority_queue<Node> open;
    push(open, std::move(sides));
    while (!open.empty()) {
      const Node node = open.top();
      open.pop();
      if (node.branch < 0) {
        if (node.sides != drawn_) draw(node.sides);
        finish(out.law);
        return out;
      }
      if (strings_ + 2 > options_.max_strings) {
        out.fault = CartFault::Undecided;
        out.facts = message("the forbidden region has ", grid_.extents.size(), " parts, and after ", strings_,
                            " strings it is still open on which sides of them to pass");
        return out;
      }
      for (const signed char side : {1, -1}) {
        if (!room(node.branch, side)) continue;
        std::vector<signed char> child = node.sides;
        child[static_cast<std::size_t>(node.branch)] = side;
        push(open, std::move(child));
      }
    }
    out.fault = CartFault::Winding;  // or speed: the caller tells them apart
    return out;
  }

 private:
  struct Node {
    double energy;
    int branch;  // the region to choose a side of; −1: the string is a law
    std::vector<signed char> sides;
    bool operator<(const Node& other) const { return energy > other.energy; }  // the least first
  };
  bool room(int region, int side) const {
    const Extent& e = grid_.extents[static_cast<std::size_t>(region)];
    return side > 0 ? e.high <= options_.upper : e.low >= options_.lower;
  }

  // Sides that the ends decide. False, with the fault, where they cannot be.
  bool fix_sides(std::vector<signed char>& sides, Outcome& out) {
    const int n = static_cast<int>(grid_.at.size());
    const GridPoint &head = grid_.points.front(), &tail = grid_.points.back();
    const double start_distance = std::hypot(head.px - start_, head.py);
    const double end_distance = std::hypot(tail.px - end_, tail.py);
    const auto inside = [&](CartFault fault, const char* which, double distance) {
      out.fault = fault;
      out.facts = message("the ", which, " is in the forbidden region: the point is ", distance,
                          " m from the first joint's axis, which has to be more than ", r_, " m");
    };
    if (start_distance <= r_) return inside(CartFault::StartInside, "start", start_distance), false;
    if (end_distance <= r_) return inside(CartFault::EndInside, "end", end_distance), false;

    const int regions = static_cast<int>(grid_.extents.size());
    sides.assign(grid_.extents.size(), 0);
    for (int j = 0; j < regions; ++j) {
      const Extent& e = grid_.extents[static_cast<std::size_t>(j)];
      const int at_start = e.first > 0 ? 0 : start_ > head.px ? 1 : -1;
      const int at_end = e.last + 1 < n ? 0 : end_ > tail.px ? 1 : -1;
      if (at_start * at_end < 0) {
        out.fault = CartFault::OppositeSides;
        out.facts = message("the cart starts ", at_start > 0 ? "above" : "below", " the forbidden region and ends ",
                            at_end > 0 ? "above" : "below",
                            " it, but the region has no gap from the first to the last sample");
        return false;
      }
      const int side = at_start != 0 ? at_start : at_end;
      if (side != 0 ? !room(j, side) : !room(j, 1) && !room(j, -1)) {
        out.fault = CartFault::Range;
        out.facts = message("between samples ", grid_.at[static_cast<std::size_t>(e.first)], " and ",
                            grid_.at[static_cast<std::size_t>(e.last)], " the cart would have to be ");
        if (side >= 0) out.facts += message("at ", e.high, " m");
        if (side == 0) out.facts += " or ";
        if (side <= 0) out.facts += message("at ", e.low, " m");
        out.facts += message(", out of its range [", options_.lower, ", ", options_.upper, "] m");
        return false;
      }
      const int only = room(j, 1) == room(j, -1) ? 0 : room(j, 1) ? 1 : -1;
      sides[static_cast<std::size_t>(j)] = static_cast<signed char>(side != 0 ? side : only);
    }
    return true;
  }

  // The taut string for these sides into x_, corners_.
  void draw(const std::vector<signed char>& sides) {
    const std::size_t n = grid_.at.size();
    low_.assign(n, options_.lower);
    high_.assign(n, options_.upper);
    x_.resize(n);
    for (std::size_t j = 0; j < sides.size(); ++j) {
      const auto first = static_cast<std::size_t>(grid_.extents[j].first);
      const auto last = static_cast<std::size_t>(grid_.extents[j].last);
      if (sides[j] > 0) {
        for (std::size_t k = first; k <= last; ++k) low_[k] = std::max(low_[k], grid_.points[k].upper);
      } else if (sides[j] < 0) {
        for (std::size_t k = first; k <= last; ++k) high_[k] = std::min(high_[k], grid_.points[k].lower);
      }
    }
    low_.front() = high_.front() = start_;
    low_.back() = high_.back() = end_;
    funnel_.draw(static_cast<int>(n), grid_.at.data(), low_.data(), high_.data(), x_.data(), corners_);
    drawn_ = sides;
    ++strings_;
  }

  // Draws the string, and keeps it where it can lead to a law.
  void push(std::priority_queue<Node>& open, std::vector<signed char> sides) {
    if (options_.turn && !can_turn(sides)) return;
    draw(sides);
    Node node{0.0, -1, {}};
    for (std::size_t k = 0; k + 1 < corners_.size(); ++k) {
      const auto a = static_cast<std::size_t>(corners_[k]), b = static_cast<std::size_t>(corners_[k + 1]);
      const double length = grid_.at[b] - grid_.at[a], rise = x_[b] - x_[a];
      if (std::abs(rise) > top_slope_ * length * (1.0 + 1e-12)) return;
      node.energy += rise * rise / length;
    }
    // The region that the string is deepest in.
    double deepest = 0.0;
    for (std::size_t j = 0; j < sides.size(); ++j) {
      if (sides[j] != 0) continue;
      const double depth = depth_in(grid_.extents[j]);
      if (depth > deepest) {
        deepest = depth;
        node.branch = static_cast<int>(j);
      }
    }
    if (node.branch < 0 && options_.turn) node.branch = to_turn(sides);
    node.sides = std::move(sides);
    open.push(std::move(node));
  }

  // Side of a part of the region that the string passes.
  int passes(std::size_t j) const {
    const Extent& e = grid_.extents[j];
    auto k = static_cast<std::size_t>(e.first + (e.last - e.first) / 2);
    if (grid_.points[k].lower == grid_.points[k].upper) k = static_cast<std::size_t>(e.last);  // a tip tells no side
    return x_[k] > grid_.points[k].px ? 1 : -1;
  }

  // Whether the sides still open leave room for the turn asked for. P's azimuth goes over the half-line of π where the
  // cart passes above a part in which y changes its sign, and nowhere else.
  bool can_turn(const std::vector<signed char>& sides) const {
    int least = 0, most = 0;
    for (std::size_t j = 0; j < sides.size(); ++j) {
      const int w = grid_.extents[j].winding;
      if (sides[j] >= 0) (w > 0 ? most : least) += w;
      if (sides[j] > 0) (w > 0 ? least : most) += w;
    }
    return least <= turns_ && turns_ <= most;
  }

  // The part to branch on where the string is in none, but does not turn as asked: that with the least way to its other
  // side.
  int to_turn(const std::vector<signed char>& sides) const {
    int missing = turns_, nearest = -1;
    for (std::size_t j = 0; j < sides.size(); ++j) missing -= passes(j) > 0 ? grid_.extents[j].winding : 0;
    double least = kInfinity;
    for (std::size_t j = 0; j < sides.size() && missing != 0; ++j) {
      const Extent& e = grid_.extents[j];
      const int side = passes(j);
      if (sides[j] != 0 || -side * e.winding * missing <= 0) continue;
      double way = 0.0;
      for (auto k = static_cast<std::size_t>(e.first); k <= static_cast<std::size_t>(e.last); ++k) {
        way = std::max(way, side > 0 ? x_[k] - grid_.points[k].lower : grid_.points[k].upper - x_[k]);
      }
      if (way < least) {
        least = way;
        nearest = static_cast<int>(j);
      }
    }
    return nearest;
  }

  // [m] by which the string would have to be moved to be on one side of a region altogether; 0 where it is.
  double depth_in(const Extent& e) const {
    double above = 0.0, under = 0.0;
    for (auto k = static_cast<std::size_t>(e.first); k <= static_cast<std::size_t>(e.last); ++k) {
      above = std::max(above, grid_.points[k].upper - x_[k]);
      under = std::max(under, x_[k] - grid_.points[k].lower);
    }
    return std::min(above, under);
  }

  // [rad] from P's azimuth at the start to that at the end, both in (−π, π].
  double ends_turn() const {
    const auto azimuth = [](const GridPoint& p, double x) { return std::atan2(p.py + 0.0, p.px - x); };
    return azimuth(grid_.points.back(), end_) - azimuth(grid_.points.front(), start_);
  }

  // [rad] of P's azimuth along x_: its ends, and how often it goes over the half-line of π.
  double turn() const {
    int turns = 0;
    const std::size_t n = x_.size();
    for (std::size_t k = 0; k + 1 < n; ++k) {
      const double y0 = grid_.points[k].py, y1 = grid_.points[k + 1].py;
      if ((y0 < 0.0) == (y1 < 0.0)) continue;
      const double u0 = grid_.points[k].px - x_[k], u1 = grid_.points[k + 1].px - x_[k + 1];
      if (u0 + (u1 - u0) * (y0 / (y0 - y1)) < 0.0) turns += y1 < 0.0 ? 1 : -1;
    }
    return ends_turn() + 2.0 * kPi * turns;
  }

  // The law of the string last drawn.
  void finish(CartLaw& law) const {
    const auto m = static_cast<Eigen::Index>(grid_.at.back()) + 1;
    law.x.resize(m);
    law.lower.resize(m);
    law.upper.resize(m);
    for (std::size_t k = 0, i = 0; k < grid_.at.size(); ++k) {
      if (grid_.at[k] != static_cast<double>(i)) continue;
      const auto at = static_cast<Eigen::Index>(i++);
      law.x[at] = x_[k];
      law.lower[at] = grid_.points[k].lower;
      law.upper[at] = grid_.points[k].upper;
    }
    // The string bends at its corners alone.
    law.multipliers = VectorXd::Zero(m);
    law.corners.reserve(corners_.size());
    law.corner_x.reserve(corners_.size());
    double before = 0.0;
    for (std::size_t c = 0; c < corners_.size(); ++c) {
      const auto a = static_cast<std::size_t>(corners_[c]);
      law.corners.push_back(grid_.at[a]);
      law.corner_x.push_back(x_[a]);
      if (c + 1 == corners_.size()) break;
      const auto b = static_cast<std::size_t>(corners_[c + 1]);
      const double slope = (x_[b] - x_[a]) / (grid_.at[b] - grid_.at[a]);
      law.energy += slope * (x_[b] - x_[a]);
      const double at = grid_.at[a];
      if (c > 0 && at == std::floor(at)) law.multipliers[static_cast<Eigen::Index>(at)] = before - slope;
      before = slope;
    }
    for (std::size_t j = 0; j < grid_.extents.size(); ++j) {
      const Extent& e = grid_.extents[j];
      law.regions.push_back(
          {grid_.at[static_cast<std::size_t>(e.first)], grid_.at[static_cast<std::size_t>(e.last)], passes(j)});
    }
    law.turn = turn();
    law.strings = strings_;
  }

  Grid grid_;
  double start_, end_, r_;
  const CartOptions& options_;
  double top_slope_;  // [m per sample]
  int turns_ = 0;     // asked for, of P's azimuth over the half-line of π
  std::vector<double> low_, high_, x_;
  std::vector<int> corners_;
  Funnel funnel_;
  std::vector<signed char> drawn_;  // of the string in x_
  int strings_ = 0;
};

double top_speed(const CartLaw& law, double dt) {
  double top = 0.0;
  for (std::size_t c = 0; c + 1 < law.corners.size(); ++c) {
    top = std::max(top, std::abs(law.corner_x[c + 1] - law.corner_x[c]) / (law.corners[c + 1] - law.corners[c]));
  }
  return top / dt;
}

// Between samples; from and to rest too, where asked for.
double top_acceleration(const VectorXd& x, double dt, bool at_rest) {
  const Eigen::Index m = x.size();
  double top = at_rest ? std::max(std::abs(x[1] - x[0]), std::abs(x[m - 1] - x[m - 2])) : 0.0;
  for (Eigen::Index i = 1; i + 1 < m; ++i) top = std::max(top, std::abs(x[i + 1] - 2.0 * x[i] + x[i - 1]));
  return top / (dt * dt);
}

// The law of the least energy on the sides of `law`, within speed and acceleration [m per sample, m per sample²]. False
// where there is none.
bool accelerate(const PlanarPath& path, double r, const CartOptions& options, double speed, double acceleration,
                CartLaw& law) {
  const Grid grid = make_grid(path, r);
  const int m = static_cast<int>(law.x.size());
  if (m < 3) return false;
  std::vector<BandRow> rows;
  std::size_t j = 0;
  for (std::size_t k = 0; k < grid.at.size(); ++k) {
    while (j < grid.extents.size() && grid.extents[j].last < static_cast<int>(k)) ++j;
    double lower = options.lower, upper = options.upper;
    if (j < grid.extents.size() && grid.extents[j].first <= static_cast<int>(k)) {
      if (law.regions[j].side > 0) lower = std::max(lower, grid.points[k].upper);
      if (law.regions[j].side < 0) upper = std::min(upper, grid.points[k].lower);
    }
    const double at = std::floor(grid.at[k]), f = grid.at[k] - at;
    const int i = static_cast<int>(at);
    if (f > 0.0) {
      rows.push_back({i, 2, {1.0 - f, f, 0.0}, lower, upper});
    } else if (i > 0 && i + 1 < m) {
      rows.push_back({i, 1, {1.0, 0.0, 0.0}, lower, upper});
    }
  }
  for (int i = 0; i + 2 < m; ++i) rows.push_back({i, 3, {1.0, -2.0, 1.0}, -acceleration, acceleration});
  for (int i = 0; i + 1 < m; ++i) {
    double most = speed;
    if (options.at_rest && (i == 0 || i + 2 == m)) most = std::min(most, acceleration);
    if (most < kInfinity) rows.push_back({i, 2, {-1.0, 1.0, 0.0}, -most, most});
  }
  std::vector<double> x(law.x.data(), law.x.data() + m);
  if (!BandQp<1>(std::move(rows)).solve(x)) return false;
  law.x = Eigen::Map<const VectorXd>(x.data(), m);
  law.energy = (law.x.tail(m - 1) - law.x.head(m - 1)).squaredNorm();
  law.multipliers.segment(1, m - 2) = 2.0 * law.x.segment(1, m - 2) - law.x.head(m - 2) - law.x.tail(m - 2);
  law.corners.resize(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) law.corners[i] = static_cast<double>(i);
  law.corner_x = std::move(x);
  return true;
}

Outcome solve(const PlanarPath& path, double start, double end, double r, const CartOptions& options) {
  return Search(path, start, end, r, options).run();
}

// Which limit it is that leaves no way: the first one without which there is one.
void explain(const PlanarPath& path, double start, double end, double r, const CartOptions& options, Outcome& out) {
  CartOptions o = options;
  o.max_speed = kInfinity;
  Outcome without = solve(path, start, end, r, o);
  if (!without.fault) {
    const double speed = top_speed(without.law, options.duration / static_cast<double>(path.rows() - 1));
    out.fault = CartFault::Speed;
    out.facts = message("every way is faster than the cart's ", options.max_speed, " m/s: the shortest needs ", speed,
                        " m/s, or a duration of ", options.duration * speed / options.max_speed, " s");
    return;
  }
  if (*without.fault == CartFault::Undecided) {
    out = std::move(without);
    return;
  }
  o = options;
  o.lower = -kInfinity;
  o.upper = kInfinity;
  without = solve(path, start, end, r, o);
  if (!without.fault) {
    out.fault = CartFault::Range;
    out.facts = message("a turn of ", options.turn.value_or(kNaN), " rad needs the cart from ",
                        without.law.x.minCoeff(), " to ", without.law.x.maxCoeff(), " m, out of its range [",
                        options.lower, ", ", options.upper, "] m");
    return;
  }
  out.fault = CartFault::Winding;
  out.facts = message("no way turns the point about the first joint's axis by ", options.turn.value_or(kNaN),
                      " rad, to within half a turn");
  o = options;
  o.turn.reset();
  without = solve(path, start, end, r, o);
  if (!without.fault) out.facts += message("; the shortest turns it by ", without.law.turn, " rad");
}

// The largest radius with a law: a smaller circle forbids less. NaN where a thousand millionth of it is still too much.
double feasible_radius(const PlanarPath& path, double start, double end, double radius, const CartOptions& options) {
  const auto feasible = [&](double r) { return !solve(path, start, end, r + options.margin, options).fault; };
  double good = 1e-9 * radius, bad = radius;
  if (!feasible(good)) return kNaN;
  for (int i = 0; i < 60 && bad - good > 1e-10 * radius; ++i) {
    const double middle = 0.5 * (good + bad);
    (feasible(middle) ? good : bad) = middle;
  }
  return good;
}

void check(const PlanarPath& path, double start, double end, double radius, const CartOptions& o) {
  require(path.rows() >= 2, "the path has ", path.rows(), " samples; it needs at least 2");
  require(path.allFinite(), "the path must be finite");
  require(std::isfinite(radius) && radius > 0.0, "radius = ", radius, " m must be finite and greater than 0");
  require(std::isfinite(o.margin) && o.margin >= 0.0, "margin = ", o.margin, " m must be finite and not negative");
  require(o.lower < o.upper, "the cart's range [", o.lower, ", ", o.upper, "] m is empty");
  for (const auto& [name, value] : {std::pair{"start", start}, std::pair{"end", end}}) {
    require(std::isfinite(value), name, " = ", value, " must be finite");
    require(value >= o.lower && value <= o.upper, name, " = ", value, " m is out of the cart's range [", o.lower, ", ",
            o.upper, "] m");
  }
  require(!o.turn || std::abs(*o.turn) <= 1e6, "turn = ", o.turn.value_or(kNaN), " rad must be within a million");
  require(std::isfinite(o.duration) && o.duration > 0.0, "duration = ", o.duration,
          " s must be finite and greater than 0");
  require(o.max_speed > 0.0, "max_speed = ", o.max_speed, " m/s must be greater than 0");
  require(o.max_acceleration > 0.0, "max_acceleration = ", o.max_acceleration, " m/s² must be greater than 0");
  require(o.max_strings >= 1, "max_strings = ", o.max_strings, " must be at least 1");
}

}  // namespace

const char* to_string(CartFault fault) noexcept {
  switch (fault) {
    case CartFault::StartInside: return "start inside";
    case CartFault::EndInside: return "end inside";
    case CartFault::OppositeSides: return "opposite sides";
    case CartFault::Range: return "range";
    case CartFault::Winding: return "winding";
    case CartFault::Speed: return "speed";
    case CartFault::Acceleration: return "acceleration";
    case CartFault::Undecided: return "undecided";
  }
  return "?";
}

void forbidden_intervals(const PlanarPath& path, double radius, VectorXd& lower, VectorXd& upper) {
  lower.setConstant(path.rows(), kInfinity);
  upper.setConstant(path.rows(), -kInfinity);
  for (Eigen::Index i = 0; i < path.rows(); ++i) {
    const double y = path(i, 1);
    if (std::abs(y) >= radius) continue;
    const double h = std::sqrt((radius - y) * (radius + y));
    lower[i] = path(i, 0) - h;
    upper[i] = path(i, 0) + h;
  }
}

void taut_string(const VectorRef& at, const VectorRef& lower, const VectorRef& upper, VectorXd& x,
                 std::vector<int>& corners) {
  const Eigen::Index n = at.size();
  require(n >= 2 && lower.size() == n && upper.size() == n, "at, lower and upper have ", n, ", ", lower.size(), " and ",
          upper.size(), " entries; they need the same number, at least 2");
  for (Eigen::Index i = 0; i < n; ++i) {
    require(std::isfinite(at[i]) && (i == 0 || at[i] > at[i - 1]), "at must increase; entry ", i, " is ", at[i]);
    require(lower[i] <= upper[i] && lower[i] < kInfinity && upper[i] > -kInfinity, "entry ", i,
            " leaves no room: lower is ", lower[i], ", upper ", upper[i]);
  }
  for (const Eigen::Index i : {Eigen::Index{0}, n - 1}) {
    require(lower[i] == upper[i], "at the ends lower and upper must be the same, not ", lower[i], " and ", upper[i]);
  }
  x.resize(n);
  Funnel().draw(static_cast<int>(n), at.data(), lower.data(), upper.data(), x.data(), corners);
}

CartLaw cart_law(const PlanarPath& path, double start, double end, double radius, const CartOptions& options) {
  check(path, start, end, radius, options);
  const double r = radius + options.margin, dt = options.duration / static_cast<double>(path.rows() - 1);
  Outcome out = solve(path, start, end, r, options);
  if (!out.fault) {
    if (top_acceleration(out.law.x, dt, options.at_rest) <= options.max_acceleration) return std::move(out.law);
    // A longer duration only makes limits, counted in samples, wider.
    const auto within = [&](double longer) {
      constexpr double kInside = 1.0 - 1e-9;
      const double step = longer * dt;
      return accelerate(path, r, options, kInside * options.max_speed * step,
                        kInside * options.max_acceleration * step * step, out.law);
    };
    if (within(1.0)) return std::move(out.law);
    double good = 2.0, bad = 1.0;
    while (good < kLongest && !within(good)) {
      bad = good;
      good *= 2.0;
    }
    for (int i = 0; i < 5 && good < kLongest; ++i) {
      const double middle = 0.5 * (good + bad);
      (within(middle) ? good : bad) = middle;
    }
    throw CartError(
        CartFault::Acceleration, kNaN,
        message("no cart motion (acceleration): on the sides of the shortest way none keeps to ",
                options.max_acceleration, " m/s²", options.at_rest ? " from rest to rest" : "",
                good < kLongest ? message("; a duration of ", good * options.duration, " s would do") : ""));
  }
  if (*out.fault == CartFault::Winding) explain(path, start, end, r, options, out);
  const double feasible = *out.fault == CartFault::Undecided ? kNaN
                                                             : feasible_radius(path, start, end, radius, options);
  std::string text = message("no cart motion (", to_string(*out.fault), "): ", out.facts);
  if (std::isfinite(feasible)) {
    text += message("; with a radius up to ", feasible, " m there is one");
  } else if (*out.fault != CartFault::Undecided) {
    text += "; no smaller radius helps";
  }
  throw CartError(*out.fault, feasible, text);
}

int cart_descent(const VectorRef& lower, const VectorRef& upper, VectorXd& x, const CartDescent& o) {
  const Eigen::Index m = x.size();
  require(m >= 2 && lower.size() == m && upper.size() == m, "lower, upper and x have ", lower.size(), ", ",
          upper.size(), " and ", m, " entries; they need the same number, at least 2");
  require(x.allFinite(), "the first guess must be finite");
  require(std::isfinite(o.alpha) && o.alpha > 0.0, "alpha = ", o.alpha, " must be finite and greater than 0");
  require(std::isfinite(o.step) && o.step > 0.0, "step = ", o.step, " must be finite and greater than 0");
  require(o.max_iterations >= 1, "max_iterations = ", o.max_iterations, " must be at least 1");
  require(std::isfinite(o.depth) && o.depth >= 0.0, "depth = ", o.depth, " mm must be finite and not negative");
  constexpr double kMillimetres = 1e3;
  // Centre, half width and slope of H; a half width of −1 where nothing is forbidden.
  VectorXd centre(m), half(m), kick(m);
  for (Eigen::Index i = 0; i < m; ++i) {
    const bool any = lower[i] < upper[i];
    centre[i] = any ? 0.5 * kMillimetres * (lower[i] + upper[i]) : 0.0;
    half[i] = any ? 0.5 * kMillimetres * (upper[i] - lower[i]) : -1.0;
    kick[i] = any ? o.step / half[i] : 0.0;
  }
  const double smooth = 2.0 * o.alpha * o.step;
  VectorXd now = kMillimetres * x, next = now;
  int done = 0;
  while (done < o.max_iterations) {
    double deepest = 0.0;
    for (Eigen::Index i = 1; i + 1 < m; ++i) {
      const double d = now[i] - centre[i], depth = half[i] - std::abs(d);
      const double push = depth <= 0.0 || d == 0.0 ? 0.0 : d > 0.0 ? kick[i] : -kick[i];
      deepest = std::max(deepest, depth);
      next[i] = now[i] + push - smooth * (2.0 * now[i] - now[i - 1] - now[i + 1]);
    }
    if (o.until_admissible && deepest <= o.depth) break;
    now.swap(next);
    ++done;
  }
  const auto put = [&](Eigen::Index i) {
    return now[i] > centre[i] ? std::max(now[i] / kMillimetres, upper[i]) : std::min(now[i] / kMillimetres, lower[i]);
  };
  const bool shallow = ((half - (now - centre).cwiseAbs()).segment(1, m - 2).array() <= o.depth).all();
  for (Eigen::Index i = 1; i + 1 < m; ++i) x[i] = shallow && half[i] > 0.0 ? put(i) : now[i] / kMillimetres;
  return done;
}

}  // namespace sigmaik::planning
