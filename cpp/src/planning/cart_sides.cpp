#include "cart_sides.hpp"
#include "../numbers.hpp"

#include <algorithm>
#include <cmath>
#include <queue>
#include <utility>
#include <vector>

#include "../message.hpp"
#include "cart_grid.hpp"
#include "taut_string.hpp"

namespace sigmaik::planning::detail {
namespace {

using sigmaik::detail::message;

using sigmaik::detail::kInfinity;
constexpr double kPi = 3.14159265358979323846;

// The best sides by branch and bound: a node fixes the sides of some regions and leaves out the other regions.
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
    out.fault = CartFault::Winding;  // or Speed: the caller distinguishes the two
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

  // Fixes the sides that the ends or the range decide. Returns false, with the fault, if no side is possible.
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

  // Draws the taut string for these sides into x_ and corners_.
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

  // Draws the string, and adds a node if the string can lead to a law.
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
    // Branch on the region in which the string is deepest.
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

  // The side on which the string passes a part of the region.
  int passes(std::size_t j) const {
    const Extent& e = grid_.extents[j];
    auto k = static_cast<std::size_t>(e.first + (e.last - e.first) / 2);
    if (grid_.points[k].lower == grid_.points[k].upper) k = static_cast<std::size_t>(e.last);  // a tip has no sides
    return x_[k] > grid_.points[k].px ? 1 : -1;
  }

  // Whether the sides that are still open allow the turn asked for. P's azimuth crosses π where the cart passes above a
  // part of the region in which y changes its sign, and nowhere else.
  bool can_turn(const std::vector<signed char>& sides) const {
    int least = 0, most = 0;
    for (std::size_t j = 0; j < sides.size(); ++j) {
      const int w = grid_.extents[j].winding;
      if (sides[j] >= 0) (w > 0 ? most : least) += w;
      if (sides[j] > 0) (w > 0 ? least : most) += w;
    }
    return least <= turns_ && turns_ <= most;
  }

  // The part to branch on if the string is in no part, but does not turn as asked: the part whose other side is nearest
  // to the string.
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

  // Distance [m] by which the string would have to move to be completely on one side of a region; 0 if it is.
  double depth_in(const Extent& e) const {
    double above = 0.0, under = 0.0;
    for (auto k = static_cast<std::size_t>(e.first); k <= static_cast<std::size_t>(e.last); ++k) {
      above = std::max(above, grid_.points[k].upper - x_[k]);
      under = std::max(under, x_[k] - grid_.points[k].lower);
    }
    return std::min(above, under);
  }

  // Turn [rad] from P's azimuth at the start to the azimuth at the end, both in (−π, π].
  double ends_turn() const {
    const auto azimuth = [](const GridPoint& p, double x) { return std::atan2(p.py + 0.0, p.px - x); };
    return azimuth(grid_.points.back(), end_) - azimuth(grid_.points.front(), start_);
  }

  // Turn [rad] of P's azimuth along x_: from its ends, and from the number of times that it crosses π.
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

  // Writes the law of the last string drawn.
  void finish(CartLaw& law) const {
    const auto m = static_cast<std::size_t>(grid_.at.back()) + 1;
    law.x.resize(m);
    law.lower.resize(m);
    law.upper.resize(m);
    for (std::size_t k = 0, i = 0; k < grid_.at.size(); ++k) {
      if (grid_.at[k] != static_cast<double>(i)) continue;
      const std::size_t at = i++;
      law.x[at] = x_[k];
      law.lower[at] = grid_.points[k].lower;
      law.upper[at] = grid_.points[k].upper;
    }
    // The string bends only at its corners: all other multipliers are zero.
    law.multipliers.assign(m, 0.0);
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
      if (c > 0 && at == std::floor(at)) law.multipliers[static_cast<std::size_t>(at)] = before - slope;
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
  int turns_ = 0;     // asked for: how often P's azimuth crosses π
  std::vector<double> low_, high_, x_;
  std::vector<int> corners_;
  Funnel funnel_;
  std::vector<signed char> drawn_;  // sides of the string in x_
  int strings_ = 0;
};

}  // namespace

Outcome best_sides(const PlanarPath& path, double start, double end, double r, const CartOptions& options) {
  return Search(path, start, end, r, options).run();
}

}  // namespace sigmaik::planning::detail
