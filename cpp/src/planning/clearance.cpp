#include <sigmaik/planning/clearance.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <sigmaik/indices.hpp>

#include "../message.hpp"
#include "samples.hpp"

namespace sigmaik::planning {
namespace {

using detail::joints;
using sigmaik::detail::require;

// Adds the crossings of a wall. If their number is odd, one is unavoidable: which one is arbitrary, the first is taken.
void add_wall(const std::string& name, const std::vector<double>& t, const std::vector<double>& q,
              const std::vector<double>& r, std::vector<Crossing>& out) {
  const std::size_t n = q.size() / t.size();
  const bool needed = (r.front() >= 0.0) != (r.back() >= 0.0);
  bool first = true;
  for (std::size_t k = 0; k + 1 < t.size(); ++k) {
    if ((r[k] >= 0.0) == (r[k + 1] >= 0.0)) continue;
    const double s = r[k] / (r[k] - r[k + 1]);
    Crossing crossing{name, t[k] + s * (t[k + 1] - t[k]), std::vector<double>(n), 0.0, !(needed && first)};
    for (std::size_t j = 0; j < n; ++j) {
      crossing.q[j] = q[k * n + j] + s * (q[(k + 1) * n + j] - q[k * n + j]);
    }
    out.push_back(std::move(crossing));
    first = false;
  }
}

// Adds the passages through the tube ψ < within about a set of higher codimension, except passages that contain an end.
void add_tube(const std::string& name, const std::vector<double>& t, const std::vector<double>& q,
              const std::vector<double>& psi, double within, std::vector<Crossing>& out) {
  const std::size_t n = q.size() / t.size(), count = t.size();
  for (std::size_t begin = 0; begin < count;) {
    if (!(psi[begin] < within)) {
      ++begin;
      continue;
    }
    std::size_t end = begin;
    while (end < count && psi[end] < within) ++end;
    if (begin > 0 && end < count) {
      const auto k = static_cast<std::size_t>(std::min_element(psi.begin() + static_cast<std::ptrdiff_t>(begin),
                                                               psi.begin() + static_cast<std::ptrdiff_t>(end)) -
                                              psi.begin());
      const auto row = q.begin() + static_cast<std::ptrdiff_t>(k * n);
      out.push_back({name, t[k], {row, row + static_cast<std::ptrdiff_t>(n)}, psi[k], true});
    }
    begin = end;
  }
}

}  // namespace

double Clearance::min_manipulability() const noexcept {
  return manipulability.empty() ? std::numeric_limits<double>::quiet_NaN()
                                : *std::min_element(manipulability.begin(), manipulability.end());
}

double Clearance::min_psi() const noexcept {
  return psi.empty() ? std::numeric_limits<double>::infinity() : *std::min_element(psi.begin(), psi.end());
}

int Clearance::nearest_set() const noexcept {
  if (psi.empty()) return -1;
  const auto sets = static_cast<std::ptrdiff_t>(names.size());
  // Of equal values the set with the lower index counts.
  std::vector<double>::const_iterator least = psi.begin();
  for (std::ptrdiff_t i = 0; i < sets; ++i) {
    for (auto k = psi.begin() + i; k < psi.end(); k += std::min<std::ptrdiff_t>(sets, psi.end() - k)) {
      if (*k < *least) least = k;
    }
  }
  return static_cast<int>((least - psi.begin()) % sets);
}

Clearance clearance(const Chain& chain, const std::optional<SingularSets>& sets, std::vector<double> t,
                    const std::vector<double>& q, double width) {
  const auto n = static_cast<std::size_t>(chain.dof()), count = t.size();
  require(count > 0 && q.size() == count * n, "a motion of ", count, " samples has ", q.size(), " positions, needs ",
          count, " × ", n);
  require(width > 0.0, "width = ", width, " must be greater than 0");
  require(!sets || sets->dof() == chain.dof(), "the singular sets are for ", sets ? sets->dof() : 0,
          " joints, the chain has ", n);
  Clearance out;
  out.manipulability.resize(count);
  if (!sets) {
    evaluate(chain, IndexFunction(Index::Manipulability), count, q.data(), out.manipulability.data());
    out.t = std::move(t);
    return out;
  }
  const auto c = static_cast<std::size_t>(sets->size()), r = static_cast<std::size_t>(sets->residual_count());
  std::vector<std::vector<double>> residuals(r, std::vector<double>(count)), psi(c, std::vector<double>(count));
  out.psi.resize(count * c);
  for (std::size_t k = 0; k < count; ++k) {
    const auto at = joints(q, k, n);
    std::array<double, kMaxResiduals> signed_residuals;
    std::array<double, kMaxSets> squares;
    sets->residuals(at, signed_residuals);
    sets->psi(at, squares);
    for (std::size_t i = 0; i < r; ++i) residuals[i][k] = signed_residuals[i];
    for (std::size_t i = 0; i < c; ++i) out.psi[k * c + i] = psi[i][k] = squares[i];
    out.manipulability[k] = sets->manipulability(at);
  }
  for (std::size_t i = 0, first = 0; i < c; ++i) {
    const SingularSet& set = sets->set(static_cast<int>(i));
    out.names.push_back(set.name);
    if (set.codimension == 1) {
      add_wall(set.name, t, q, residuals[first], out.crossings);
    } else {
      add_tube(set.name, t, q, psi[i], 0.5 / width, out.crossings);
    }
    first += static_cast<std::size_t>(set.codimension);
  }
  std::stable_sort(out.crossings.begin(), out.crossings.end(),
                   [](const Crossing& a, const Crossing& b) { return a.t < b.t; });
  out.t = std::move(t);
  return out;
}

}  // namespace sigmaik::planning
