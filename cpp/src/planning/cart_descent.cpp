#include <algorithm>
#include <cmath>

#include <sigmaik/planning/cart.hpp>

#include "../message.hpp"

namespace sigmaik::planning {

using sigmaik::detail::require;

int cart_descent(const std::vector<double>& low_bounds, const std::vector<double>& high_bounds,
                 std::vector<double>& law, const CartDescent& o) {
  using Eigen::VectorXd;
  const auto m = static_cast<Eigen::Index>(law.size());
  const auto map = [](const std::vector<double>& values) {
    return Eigen::Map<const VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  };
  const auto lower = map(low_bounds), upper = map(high_bounds);
  Eigen::Map<VectorXd> x(law.data(), m);
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
