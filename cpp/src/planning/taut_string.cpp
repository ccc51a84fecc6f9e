#include "taut_string.hpp"
#include "../numbers.hpp"

#include <algorithm>
#include <cmath>

#include <sigmaik/planning/cart.hpp>

#include "../message.hpp"

namespace sigmaik::planning {
namespace detail {
namespace {

using sigmaik::detail::kInfinity;

// Whether b is below the line from a to c; for kSign −1, above it.
template <int kSign, typename Point>
bool below(const Point& a, const Point& b, const Point& c) {
  return kSign * ((c.x - b.x) * (b.t - a.t) - (b.x - a.x) * (c.t - b.t)) > 0.0;
}

}  // namespace

template <int kSign>
void Funnel::add(const Point& p, Chain& own, Chain& other, std::vector<int>& corners) {
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

void Funnel::draw(int n, const double* at, const double* lower, const double* upper, double* x,
                  std::vector<int>& corners) {
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

}  // namespace detail

void taut_string(const std::vector<double>& at, const std::vector<double>& lower, const std::vector<double>& upper,
                 std::vector<double>& x, std::vector<int>& corners) {
  using detail::kInfinity;
  using sigmaik::detail::require;
  const std::size_t n = at.size();
  require(n >= 2 && lower.size() == n && upper.size() == n, "at, lower and upper have ", n, ", ", lower.size(), " and ",
          upper.size(), " entries; they need the same number, at least 2");
  for (std::size_t i = 0; i < n; ++i) {
    require(std::isfinite(at[i]) && (i == 0 || at[i] > at[i - 1]), "at must increase; entry ", i, " is ", at[i]);
    require(lower[i] <= upper[i] && lower[i] < kInfinity && upper[i] > -kInfinity, "entry ", i,
            " leaves no room: lower is ", lower[i], ", upper ", upper[i]);
  }
  for (const std::size_t i : {std::size_t{0}, n - 1}) {
    require(lower[i] == upper[i], "at the ends lower and upper must be the same, not ", lower[i], " and ", upper[i]);
  }
  x.resize(n);
  detail::Funnel().draw(static_cast<int>(n), at.data(), lower.data(), upper.data(), x.data(), corners);
}

}  // namespace sigmaik::planning
