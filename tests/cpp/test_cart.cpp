#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <sigmaik/planning/cart.hpp>
#include <sigmaik/planning/cart_motion.hpp>

#include "numbers.hpp"
#include "random.hpp"

using namespace sigmaik;
using namespace sigmaik::planning;
using Eigen::VectorXd;
using test::kInfinity;
using test::Random;

namespace {

constexpr double kPi = 3.14159265358979323846;

PlanarPath line(double x0, double y0, double x1, double y1, int samples) {
  PlanarPath path(samples, 2);
  for (int i = 0; i < samples; ++i) {
    const double s = static_cast<double>(i) / (samples - 1);
    path.row(i) << x0 + s * (x1 - x0), y0 + s * (y1 - y0);
  }
  return path;
}

// A smooth path that goes to and fro over the cart's line.
PlanarPath wave(Random& random, int samples, double waves, double size) {
  PlanarPath path(samples, 2);
  const double a = random.uniform(0, 6), b = random.uniform(0, 6), drift = random.uniform(-1, 1);
  const double f = random.uniform(0.5, 1.5) * waves, g = random.uniform(0, 1) * waves;
  for (int i = 0; i < samples; ++i) {
    const double s = static_cast<double>(i) / (samples - 1);
    path.row(i) << size * (0.4 * std::sin(6.28 * g * s + b) + drift * s), size * std::cos(6.28 * f * s + a);
  }
  return path;
}

// Wrappers of the library's functions, which take and give std::vectors, for Eigen's vectors.
VectorXd vector_of(const std::vector<double>& v) {
  return Eigen::Map<const VectorXd>(v.data(), static_cast<Eigen::Index>(v.size()));
}
std::vector<double> list_of(const VectorXd& v) { return {v.begin(), v.end()}; }

struct Law : CartLaw {
  VectorXd x, lower, upper, multipliers;
};

Law law_of(const PlanarPath& path, double start, double end, double radius, const CartOptions& options = {}) {
  const CartLaw law = cart_law(path, start, end, radius, options);
  return {law, vector_of(law.x), vector_of(law.lower), vector_of(law.upper), vector_of(law.multipliers)};
}

void intervals_of(const PlanarPath& path, double radius, VectorXd& lower, VectorXd& upper) {
  std::vector<double> low, high;
  forbidden_intervals(path, radius, low, high);
  lower = vector_of(low);
  upper = vector_of(high);
}

void string_of(const VectorXd& at, const VectorXd& lower, const VectorXd& upper, VectorXd& x,
               std::vector<int>& corners) {
  std::vector<double> out;
  taut_string(list_of(at), list_of(lower), list_of(upper), out, corners);
  x = vector_of(out);
}

int descent_of(const VectorXd& lower, const VectorXd& upper, VectorXd& x, const CartDescent& options) {
  std::vector<double> law = list_of(x);
  const int iterations = cart_descent(list_of(lower), list_of(upper), law, options);
  x = vector_of(law);
  return iterations;
}

double second_difference(const VectorXd& x, Eigen::Index i) { return 2.0 * x[i] - x[i - 1] - x[i + 1]; }

double turn_of(const PlanarPath& path, const VectorXd& x) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i + 1 < x.size(); ++i) {
    const Eigen::Vector2d a(path(i, 0) - x[i], path(i, 1)), b(path(i + 1, 0) - x[i + 1], path(i + 1, 1));
    sum += std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
  }
  return sum;
}

}  // namespace

TEST_CASE("the two experiments: energy, contact, speed") {
  struct Reference {
    PlanarPath path;
    double energy, top, first, last, region, speed;
  };
  const Reference references[] = {
      {line(0.2607, 0.1354, 0.8531, -0.2549, 5068), 36.072246e-6, 0.8297348, 2378, 4177, 0.859339, 2.48162e-3},
      {line(0.26036729999, 0.19588536, 0.81570562, -0.30245277, 5068), 24.359793e-6, 0.7781139, 2362, 3605, 0.794411,
       2.31573e-3}};
  for (const Reference& r : references) {
    const Law law = law_of(r.path, 0.5, 0.75, 0.2, {.lower = 0.0, .upper = 1.0, .turn = 2.47, .duration = 200.0});
    CHECK(law.energy == doctest::Approx(r.energy).epsilon(2e-8));
    CHECK((law.x.tail(5067) - law.x.head(5067)).squaredNorm() == doctest::Approx(law.energy).epsilon(1e-12));
    CHECK(law.x.maxCoeff() == doctest::Approx(r.top).epsilon(1e-7));
    CHECK(law.corners[1] == r.first);
    CHECK(law.corners[law.corners.size() - 2] == r.last);
    REQUIRE(law.regions.size() == 1);
    CHECK(law.regions[0].side == 1);
    CHECK(law.regions[0].first == 0.0);
    CHECK(law.regions[0].last / 5067.0 == doctest::Approx(r.region).epsilon(1e-6));
    CHECK(law.turn == doctest::Approx(2.47).epsilon(1e-3));
    CHECK(law.strings == 1);
    double speed = 0.0;
    for (Eigen::Index i = 0; i + 1 < law.x.size(); ++i)
      speed = std::max(speed, std::abs(law.x[i + 1] - law.x[i]) * 5067 / 200.0);
    CHECK(speed == doctest::Approx(r.speed).epsilon(1e-5));
  }
}

TEST_CASE("a taut string satisfies the conditions of optimality in random tubes") {
  Random random(1);
  for (int trial = 0; trial < 3000; ++trial) {
    const int n = random.integer(2, 120);
    VectorXd at(n), lower(n), upper(n), x;
    double t = random.uniform(-3, 3), middle = 0.0;
    for (int i = 0; i < n; ++i) {
      t += random.chance(0.1) ? 1e-3 : random.uniform(0.1, 2.0);
      at[i] = t;
      middle += random.normal();
      const double width = random.chance(0.05) ? 0.0 : random.uniform(0.0, 4.0);
      lower[i] = random.chance(0.3) ? -kInfinity : middle - width;
      upper[i] = random.chance(0.3) ? kInfinity : middle + width;
    }
    lower[0] = upper[0] = random.normal();
    lower[n - 1] = upper[n - 1] = middle;
    std::vector<int> corners;
    string_of(at, lower, upper, x, corners);
    CHECK(corners.front() == 0);
    CHECK(corners.back() == n - 1);
    CHECK((x.array() >= lower.array()).all());
    CHECK((x.array() <= upper.array()).all());
    double worst = 0.0;
    for (int i = 1; i + 1 < n; ++i) {
      const double mu = (x[i] - x[i - 1]) / (at[i] - at[i - 1]) - (x[i + 1] - x[i]) / (at[i + 1] - at[i]);
      if (x[i] > lower[i]) worst = std::max(worst, mu);   // nothing holds it up
      if (x[i] < upper[i]) worst = std::max(worst, -mu);  // nothing holds it down
    }
    const double steepest = 1e3 * (1.0 + x.cwiseAbs().maxCoeff());
    CHECK(worst <= 1e-12 * steepest);
  }
}

TEST_CASE("a taut string is what a solver of quadratic programs finds") {
  // In the increments d: min ‖d‖² with Σd given and bounds on the partial sums.
  Random random(2);
  for (int trial = 0; trial < 200; ++trial) {
    const int n = random.integer(4, 16);
    VectorXd lower(n), upper(n), x;
    double middle = 0.0;
    for (int i = 0; i < n; ++i) {
      middle += random.normal();
      lower[i] = middle - random.uniform(0, 1.5);
      upper[i] = middle + random.uniform(0, 1.5);
    }
    lower[0] = upper[0] = 0.0;
    lower[n - 1] = upper[n - 1] = middle;
    std::vector<int> corners;
    string_of(VectorXd::LinSpaced(n, 0, n - 1), lower, upper, x, corners);
    // Gauss-Seidel with projection: slow, simple, and convergent for this problem.
    VectorXd y = 0.5 * (lower + upper);
    for (int sweep = 0; sweep < 20000; ++sweep) {
      double change = 0.0;
      for (int i = 1; i + 1 < n; ++i) {
        const double next = std::clamp(0.5 * (y[i - 1] + y[i + 1]), lower[i], upper[i]);
        change = std::max(change, std::abs(next - y[i]));
        y[i] = next;
      }
      if (change < 1e-15) break;
    }
    CHECK((x - y).cwiseAbs().maxCoeff() < 1e-11);
  }
}

TEST_CASE("the law keeps out of the region and is optimal for its sides, over thousands of random paths") {
  Random random(3);
  int planned = 0, both = 0, refused = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const int m = random.integer(20, 400);
    const PlanarPath path = wave(random, m, random.uniform(0.2, 3.0), random.uniform(0.1, 1.0));
    const double start = random.uniform(-1, 1), end = random.uniform(-1, 1), r = random.uniform(0.02, 0.3);
    CartOptions options;
    if (random.chance(0.5)) options.lower = -1.0, options.upper = 1.0;
    if (random.chance(0.3)) options.margin = 0.01;
    try {
      const Law law = law_of(path, start, end, r, options);
      ++planned;
      const double keep = r + options.margin;
      CHECK(law.x[0] == start);
      CHECK(law.x[m - 1] == end);
      CHECK(law.x.minCoeff() >= options.lower);
      CHECK(law.x.maxCoeff() <= options.upper);
      bool tip = false;
      for (const double at : law.corners) tip = tip || at != std::floor(at);
      int above = 0, below = 0;
      for (Eigen::Index i = 0; i < m; ++i) {
        CHECK(std::hypot(path(i, 0) - law.x[i], path(i, 1)) >= keep * (1.0 - 1e-12));
        const bool free = law.lower[i] > law.upper[i];
        if (!free) (law.x[i] >= law.upper[i] ? above : below) += 1;
        if (i == 0 || i + 1 == m || tip) continue;
        const double mu = second_difference(law.x, i);
        CHECK(std::abs(mu - law.multipliers[i]) < 1e-13);
        if (mu > 1e-13) CHECK((law.x[i] == law.upper[i] || law.x[i] == options.lower));
        if (mu < -1e-13) CHECK((law.x[i] == law.lower[i] || law.x[i] == options.upper));
      }
      both += above > 0 && below > 0;
      // The law is straight between corners: its polygon has the turn that the law reports.
      CHECK(law.turn == doctest::Approx(turn_of(path, law.x)).epsilon(tip ? 1e3 : 1e-9));
      for (std::size_t j = 0; j < law.regions.size(); ++j) {
        const CartRegion& region = law.regions[j];
        for (auto i = static_cast<Eigen::Index>(std::ceil(region.first)); i <= region.last; ++i) {
          CHECK((region.side > 0 ? law.x[i] >= law.upper[i] : law.x[i] <= law.lower[i]));
        }
      }
    } catch (const CartError& e) {
      ++refused;
      if (std::isnan(e.feasible_radius())) continue;
      CHECK(e.feasible_radius() < r);
      CHECK_NOTHROW(law_of(path, start, end, e.feasible_radius(), options));
      CHECK_THROWS_AS(law_of(path, start, end, e.feasible_radius() + 1e-9, options), CartError);
    }
  }
  CHECK(planned > 500);
  CHECK(both > 100);
  CHECK(refused > 100);
}

TEST_CASE("branch and bound finds the same law as trying all sides") {
  Random random(4);
  int several = 0, turned = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const int m = random.integer(40, 200);
    const PlanarPath path = wave(random, m, random.uniform(1.0, 3.0), random.uniform(0.3, 1.0));
    const double r = random.uniform(0.05, 0.25), start = random.uniform(-1, 1), end = random.uniform(-1, 1);
    if (std::hypot(path(0, 0) - start, path(0, 1)) <= r || std::hypot(path(m - 1, 0) - end, path(m - 1, 1)) <= r)
      continue;
    // Parts of the region over the samples, and the least energy over all their sides: tubes of samples alone, so only
    // paths whose best string touches no tip can be compared.
    VectorXd low, high;
    intervals_of(path, r, low, high);
    std::vector<std::pair<int, int>> parts;
    for (int i = 0; i < m; ++i) {
      if (low[i] > high[i]) continue;
      if (parts.empty() || parts.back().second != i - 1) parts.push_back({i, i});
      parts.back().second = i;
    }
    if (parts.size() > 8 || parts.size() < 2) continue;
    const double turn = random.chance(0.5) ? 1e9 : random.uniform(-9, 9);
    double best = kInfinity;
    for (unsigned bits = 0; bits < 1u << parts.size(); ++bits) {
      VectorXd lower = VectorXd::Constant(m, -kInfinity), upper = VectorXd::Constant(m, kInfinity), x;
      bool possible = true;
      for (std::size_t j = 0; j < parts.size(); ++j) {
        const bool above = (bits >> j & 1u) != 0;
        for (int i = parts[j].first; i <= parts[j].second; ++i)
          (above ? lower[i] : upper[i]) = above ? high[i] : low[i];
        if (parts[j].first == 0) possible = possible && above == (start > path(0, 0));
        if (parts[j].second == m - 1) possible = possible && above == (end > path(m - 1, 0));
      }
      if (!possible) continue;
      lower[0] = upper[0] = start;
      lower[m - 1] = upper[m - 1] = end;
      std::vector<int> corners;
      string_of(VectorXd::LinSpaced(m, 0, m - 1), lower, upper, x, corners);
      if (turn < 1e8 && std::abs(turn_of(path, x) - turn) > kPi) continue;
      best = std::min(best, (x.tail(m - 1) - x.head(m - 1)).squaredNorm());
    }
    CartOptions options;
    if (turn < 1e8) options.turn = turn;
    try {
      const Law law = law_of(path, start, end, r, options);
      bool tip = false;
      for (const double at : law.corners) tip = tip || at != std::floor(at);
      if (law.regions.size() != parts.size()) continue;  // one lies between samples
      CHECK(law.energy >= best * (1.0 - 1e-12));         // tips only take room away
      if (tip) continue;
      ++several;
      turned += turn < 1e8;
      CHECK(law.energy == doctest::Approx(best).epsilon(1e-9));
    } catch (const CartError& e) {
      CHECK(e.fault() == (turn < 1e8 ? CartFault::Winding : CartFault::OppositeSides));
      CHECK(best == kInfinity);
    }
  }
  CHECK(several > 60);
  CHECK(turned > 15);
}

TEST_CASE("lengths have no unit, and the path may be run backwards or mirrored") {
  Random random(5);
  int compared = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const int m = random.integer(20, 300);
    const PlanarPath path = wave(random, m, random.uniform(0.2, 2.0), random.uniform(0.2, 1.0));
    const double start = random.uniform(-1, 1), end = random.uniform(-1, 1), r = random.uniform(0.02, 0.2);
    try {
      const Law law = law_of(path, start, end, r);
      ++compared;
      const double scale = random.decades(-3, 3), size = law.x.cwiseAbs().maxCoeff() + r;
      const Law scaled = law_of(scale * path, scale * start, scale * end, scale * r);
      CHECK((scaled.x - scale * law.x).cwiseAbs().maxCoeff() < 1e-11 * scale * size);
      const Law reversed = law_of(path.colwise().reverse(), end, start, r);
      CHECK((reversed.x.reverse() - law.x).cwiseAbs().maxCoeff() < 1e-11 * size);
      CHECK(reversed.turn == doctest::Approx(-law.turn).epsilon(1e-9));
      const Law mirrored = law_of(-path, -start, -end, r);
      CHECK((mirrored.x + law.x).cwiseAbs().maxCoeff() < 1e-11 * size);
      PlanarPath flipped = path;
      flipped.col(1) *= -1.0;
      CHECK((law_of(flipped, start, end, r).x - law.x).cwiseAbs().maxCoeff() < 1e-11 * size);
    } catch (const CartError&) {
    }
  }
  CHECK(compared > 80);
}

TEST_CASE("a larger circle costs more, and any other law is faster") {
  Random random(6);
  for (int trial = 0; trial < 100; ++trial) {
    const PlanarPath path = line(random.uniform(-1, 1), random.uniform(0.3, 1), random.uniform(-1, 1),
                                 -random.uniform(0.3, 1), 200);
    const double start = path(0, 0) + random.uniform(-1, 1), end = path(199, 0) + random.uniform(-1, 1);
    double energy = 0.0;
    for (const double r : {0.02, 0.05, 0.1, 0.2, 0.25}) {
      const Law law = law_of(path, start, end, r);
      CHECK(law.energy >= energy * (1.0 - 1e-12));
      energy = law.energy;
      // The least top speed: no law on this side has a lower one.
      double top = 0.0;
      for (std::size_t c = 0; c + 1 < law.corners.size(); ++c) {
        top = std::max(top, std::abs(law.corner_x[c + 1] - law.corner_x[c]) / (law.corners[c + 1] - law.corners[c]));
      }
      CartOptions slow{.duration = 199.0, .max_speed = top * (1.0 + 1e-9)};
      CHECK(law_of(path, start, end, r, slow).energy == doctest::Approx(law.energy).epsilon(1e-9));
      slow.max_speed = top * (1.0 - 1e-6);
      try {
        CHECK(law_of(path, start, end, r, slow).regions[0].side == -law.regions[0].side);
      } catch (const CartError& e) {
        CHECK(e.fault() == CartFault::Speed);
      }
    }
  }
}

TEST_CASE("limits of speed and acceleration are kept, at tips between samples too") {
  Random random(9);
  int limited = 0, tips = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const int m = random.integer(20, 300);
    const PlanarPath path = wave(random, m, random.uniform(0.2, 1.5), random.uniform(0.2, 1.0));
    const double start = random.uniform(-1, 1), end = random.uniform(-1, 1), r = random.uniform(0.02, 0.2);
    const double duration = m - 1;
    CartOptions options{.duration = duration};
    try {
      const Law free = law_of(path, start, end, r, options);
      double top = 0.0;
      for (Eigen::Index i = 1; i + 1 < m; ++i) top = std::max(top, std::abs(second_difference(free.x, i)));
      options.max_acceleration = top * random.uniform(0.2, 1.0) + 1e-9;
      options.max_speed = random.chance(0.5) ? kInfinity
                                             : 3.0 * (free.x.tail(m - 1) - free.x.head(m - 1)).cwiseAbs().maxCoeff();
      options.at_rest = random.chance(0.5);
      const Law law = law_of(path, start, end, r, options);
      ++limited;
      CHECK(law.x[0] == start);
      CHECK(law.x[m - 1] == end);
      for (Eigen::Index i = 0; i + 1 < m; ++i) {
        CHECK(std::abs(law.x[i + 1] - law.x[i]) <= options.max_speed);
        CHECK(std::hypot(path(i, 0) - law.x[i], path(i, 1)) >= r * (1.0 - 1e-10));
        if (i > 0) CHECK(std::abs(second_difference(law.x, i)) <= options.max_acceleration * (1.0 + 1e-9));
      }
      if (options.at_rest) {
        CHECK(std::abs(law.x[1] - law.x[0]) <= options.max_acceleration);
        CHECK(std::abs(law.x[m - 1] - law.x[m - 2]) <= options.max_acceleration);
      }
      CHECK(law.energy >= free.energy * (1.0 - 1e-9));
      CHECK(law.turn == doctest::Approx(turn_of(path, law.x)).epsilon(1e-9));
      // P and the cart move on straight lines between samples: at a tip their positions along x tell the side.
      for (const CartRegion& region : law.regions) {
        for (const double tip : {region.first, region.last}) {
          const double at = std::floor(tip), f = tip - at;
          const auto i = static_cast<Eigen::Index>(at);
          if (f == 0.0) continue;
          ++tips;
          const double seen = (1.0 - f) * (law.x[i] - path(i, 0)) + f * (law.x[i + 1] - path(i + 1, 0));
          CHECK(region.side * seen >= -1e-10);
        }
      }
    } catch (const CartError&) {
    }
  }
  CHECK(limited > 100);
  CHECK(tips > 100);
}

TEST_CASE("the law keeps out of tips and whole regions between samples") {
  // The law would hook around the end of the region, which lies between two samples.
  int hooks = 0;
  for (int k = 0; k < 50; ++k) {
    const double y1 = -0.2002 - 1e-4 * k;
    const PlanarPath path = line(0.0, 0.1, 0.0, y1, 60);
    const Law law = law_of(path, 0.3, -0.6, 0.2);
    REQUIRE(law.regions.size() == 1);
    const double tip = law.regions[0].last;
    std::size_t after = 0;
    while (law.corners[after] < tip) ++after;
    const double t0 = law.corners[after - 1], t1 = law.corners[after];
    const double x0 = law.corner_x[after - 1], x1 = law.corner_x[after];
    CHECK(x0 + (x1 - x0) * (tip - t0) / (t1 - t0) >= -1e-12);  // at the tip the cart passes above P's x, 0
    hooks += t1 == tip;
  }
  CHECK(hooks > 10);

  // From y = 1 to y = −1 in one step.
  PlanarPath leap(4, 2);
  leap << 0, 1, 0, 1, 0, -1, 0, -1;
  const Law law = law_of(leap, 0.05, 0.05, 0.2);
  REQUIRE(law.regions.size() == 1);
  CHECK(law.regions[0].side == 1);
  CHECK(law.regions[0].first == doctest::Approx(1.4));
  CHECK(*std::max_element(law.corner_x.begin(), law.corner_x.end()) == doctest::Approx(0.2));
  CHECK(law.turn == doctest::Approx(2.0 * kPi - 2.0 * std::atan2(1.0, -0.05)).epsilon(1e-9));
}

TEST_CASE("the fault tells why there is no law") {
  const auto fault = [](const PlanarPath& path, double start, double end, double r, const CartOptions& options = {}) {
    try {
      law_of(path, start, end, r, options);
    } catch (const CartError& e) {
      CHECK(std::string(e.what()).find(to_string(e.fault())) != std::string::npos);
      return std::pair{e.fault(), e.feasible_radius()};
    }
    FAIL("there is a law");
    return std::pair{CartFault::Undecided, 0.0};
  };
  const PlanarPath over = line(0.0, 0.15, 0.0, -0.15, 101), through = line(0.0, 0.5, 0.0, -0.5, 101);
  auto [why, radius] = fault(over, 0.1, 0.5, 0.2);
  CHECK(why == CartFault::StartInside);
  CHECK(radius == doctest::Approx(std::hypot(0.1, 0.15)).epsilon(1e-8));
  std::tie(why, radius) = fault(over, 0.5, -0.1, 0.2);
  CHECK(why == CartFault::EndInside);
  CHECK(radius == doctest::Approx(0.15).epsilon(1e-8));  // above this radius the ends are also on opposite sides
  std::tie(why, radius) = fault(over, 0.5, -0.5, 0.2);
  CHECK(why == CartFault::OppositeSides);
  CHECK(radius == doctest::Approx(0.15).epsilon(1e-8));
  std::tie(why, radius) = fault(through, 0.02, 0.02, 0.2, {.lower = -0.1, .upper = 0.12});
  CHECK(why == CartFault::Range);
  CHECK(radius == doctest::Approx(0.12).epsilon(1e-8));
  // Above the region P is seen to turn over π, from +y to −y: the turn is positive.
  std::tie(why, radius) = fault(through, 0.02, 0.02, 0.2, {.turn = 9.0});
  CHECK(why == CartFault::Winding);
  CHECK(std::isnan(radius));
  CHECK(law_of(through, 0.02, 0.02, 0.2, {.turn = kPi}).regions[0].side == 1);
  CHECK(law_of(through, 0.02, 0.02, 0.2, {.turn = -kPi}).regions[0].side == -1);
  std::tie(why, radius) = fault(through, 0.02, 0.02, 0.2, {.upper = 0.12, .turn = kPi});
  CHECK(why == CartFault::Range);
  std::tie(why, radius) = fault(through, 0.0, 0.0, 0.2, {.duration = 1.0, .max_speed = 0.2});
  CHECK(why == CartFault::Speed);
  CHECK(radius < 0.2);
  CHECK(radius > 0.08);
  std::tie(why, radius) = fault(through, 0.0, 0.0, 0.2, {.duration = 1.0, .max_acceleration = 0.2});
  CHECK(why == CartFault::Acceleration);
  std::tie(why, radius) = fault(line(0.0, 0.5, 0.0, 0.5, 2), 0.0, 1.0, 0.2, {.max_acceleration = 0.2, .at_rest = true});
  CHECK(why == CartFault::Acceleration);
  // A part of the region begins at a tip between the last two samples: the end tells on which side the cart passes it.
  CHECK(law_of(line(0.0, 0.5, 0.0, 0.15, 8), -0.9, 0.16, 0.2).regions[0].side == 1);
  CHECK(law_of(line(0.0, 0.5, 0.0, 0.15, 8), 0.9, -0.16, 0.2).regions[0].side == -1);

  Random random(8);
  const PlanarPath many = wave(random, 2000, 30.0, 1.0);
  const double natural = law_of(many, 1.5, -1.5, 0.3).turn;
  std::tie(why, radius) = fault(many, 1.5, -1.5, 0.3, {.turn = natural + 8.0 * kPi, .max_strings = 100});
  CHECK(why == CartFault::Undecided);

  CHECK_THROWS_AS(law_of(over, 0.5, 0.5, 0.0), Error);
  CHECK_THROWS_AS(law_of(over, 0.5, 2.0, 0.2, {.upper = 1.0}), Error);
  CHECK_THROWS_AS(law_of(over.topRows(1), 0.5, 0.5, 0.2), Error);
  CHECK_THROWS_AS(law_of(over, 0.5, std::nan(""), 0.2), Error);
  CHECK_THROWS_AS(law_of(over, 0.5, 0.5, 0.2, {.margin = -1.0}), Error);
}

TEST_CASE("gradient descent: a step is down the slope of (10), and ends where H is zero") {
  Random random(7);
  const PlanarPath path = wave(random, 40, 1.0, 0.3);
  VectorXd low, high;
  intervals_of(path, 0.25, low, high);
  const double alpha = 0.01, step = 1e-3;
  const auto cost = [&](const VectorXd& x) {  // lengths in mm
    double sum = 0.0;
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      const double c = 500.0 * (low[i] + high[i]), h = 500.0 * (high[i] - low[i]);
      if (low[i] < high[i]) sum += std::max(0.0, 1.0 - std::abs(x[i] - c) / h);
    }
    return sum + alpha * (x.tail(x.size() - 1) - x.head(x.size() - 1)).squaredNorm();
  };
  const VectorXd x = 0.2 * random.vector(40);
  VectorXd moved = x;
  CHECK(descent_of(low, high, moved, {.alpha = alpha, .step = step, .max_iterations = 1, .until_admissible = false}) ==
        1);
  for (Eigen::Index i = 1; i + 1 < 40; ++i) {
    VectorXd up = 1e3 * x, down = 1e3 * x;
    up[i] += 1e-4;
    down[i] -= 1e-4;
    CHECK(1e3 * (x[i] - moved[i]) == doctest::Approx(step * (cost(up) - cost(down)) / 2e-4).epsilon(1e-4));
  }
  CHECK(moved[0] == x[0]);

  const PlanarPath straight = line(0.0, 0.5, 0.0, -0.5, 3000);
  intervals_of(straight, 0.2, low, high);
  VectorXd law = VectorXd::LinSpaced(3000, 0.1, 0.15);
  const int done = descent_of(low, high, law, {});
  CHECK(done < 53707);
  CHECK(((law.array() >= high.array()) || (law.array() <= low.array())).all());
}

TEST_CASE("motions of the cart are measured: energy, clearance, turn, limits, times") {
  const PlanarPath path = line(0.0, 0.5, 0.0, -0.5, 101);
  const CartOptions options{.margin = 0.05, .duration = 4.0};
  const CartMotion motion = cart_motion(path, 0.1, 0.15, 0.2, options);
  const Law law = law_of(path, 0.1, 0.15, 0.2, options);
  CHECK(motion.method == "exact");
  CHECK(motion.x == list_of(law.x));
  CHECK(motion.energy == doctest::Approx(law.energy).epsilon(1e-12));
  CHECK(motion.turn == doctest::Approx(law.turn).epsilon(1e-9));
  CHECK(motion.admissible);
  CHECK(motion.inside == 0);
  CHECK(motion.clearance >= 0.25 - 1e-4);
  CHECK(motion.clearance < 0.2501);
  CHECK(motion.samples() == 101);
  CHECK(motion.t().back() == 4.0);
  double fastest = 0.0, hardest = 0.0;
  for (Eigen::Index i = 0; i < 100; ++i) fastest = std::max(fastest, std::abs(law.x[i + 1] - law.x[i]) * 25.0);
  for (Eigen::Index i = 1; i < 100; ++i) hardest = std::max(hardest, std::abs(second_difference(law.x, i)) * 625.0);
  CHECK(motion.max_speed() >= fastest * (1.0 - 1e-12));
  CHECK(motion.max_acceleration() == doctest::Approx(hardest));
  CHECK(motion.sample({-1.0, 4.0 / 100.0, 9.0}) ==
        std::vector<double>{motion.x.front(), motion.sample({0.04})[0], motion.x.back()});
  for (std::size_t i = 0; i < motion.x.size(); ++i) {
    const bool free = motion.lower[i] > motion.upper[i];
    CHECK(motion.sides[i] == (free ? 0 : motion.x[i] >= motion.upper[i] ? 1 : -1));
  }

  // Straight through the cylinder.
  std::vector<double> straight(101, 0.1);
  const CartMotion through = evaluate_cart_motion(path, straight, 0.2, 0.0, 2.0);
  CHECK(!through.admissible);
  CHECK(through.energy == 0.0);
  CHECK(through.clearance == doctest::Approx(0.1));
  CHECK(through.inside == 35);  // |y| < √(0.2² − 0.1²) = 0.1732, every 0.01
  CHECK(through.time_inside() == doctest::Approx(0.7));
  CHECK(through.method == "given");

  const CartMotion down = cart_motion_by_descent(path, 0.1, 0.15, 0.2, {}, {.max_iterations = 2000});
  CHECK(down.method == "gradient");
  VectorXd low, high, descended = VectorXd::LinSpaced(101, 0.1, 0.15);
  intervals_of(path, 0.2, low, high);
  CHECK(down.iterations == descent_of(low, high, descended, {.max_iterations = 2000}));
  CHECK((vector_of(down.x) - descended).cwiseAbs().maxCoeff() < 1e-9);
  CHECK(down.clearance > 0.1);
  const std::vector<double> guess = admissible_guess(path, 0.1, 0.15, 0.2, {.lower = -1.0, .upper = 1.0});
  CHECK(guess.front() == 0.1);
  CHECK(guess.back() == 0.15);
  CHECK(guess[50] == motion.sides[50]);  // at the end of the cart's range
  CHECK(evaluate_cart_motion(path, guess, 0.2).admissible);
  CHECK_THROWS_AS(evaluate_cart_motion(path, {0.0, 1.0}, 0.2), Error);
  CHECK_THROWS_AS(evaluate_cart_motion(path, straight, 0.2, -1.0), Error);
  CHECK_THROWS_AS(motion.sample({std::nan("")}), Error);
}

TEST_CASE("motions with two axes are measured alike") {
  const PlanarPath path = line(0.0, 0.5, 0.0, -0.5, 101);
  const PlaneCartMotion motion = plane_cart_motion(path, {0.05, 0.0}, {0.05, 0.0}, 0.2,
                                                   {.margin = 0.01, .duration = 2.0});
  const PlaneCartLaw law = plane_cart_law(path, {0.05, 0.0}, {0.05, 0.0}, 0.2, {.margin = 0.01, .duration = 2.0});
  CHECK(motion.xy == law.c);
  CHECK(motion.push == law.push);
  CHECK(motion.energy == doctest::Approx(law.energy).epsilon(1e-12));
  CHECK(motion.turn == doctest::Approx(law.turn).epsilon(1e-12));
  CHECK(motion.admissible);
  CHECK(motion.clearance > 0.2);
  CHECK(motion.farthest < 0.52);
  CHECK(motion.sample({0.02}) == std::vector<double>{motion.xy[2], motion.xy[3]});
  CHECK(motion.max_speed()[1] > 0.0);
  CHECK(motion.max_acceleration()[0] > 0.0);
  const PlaneCartMotion stays = evaluate_plane_cart_motion(path, std::vector<double>(202, 0.0), 0.2);
  CHECK(!stays.admissible);
  CHECK(stays.clearance == doctest::Approx(0.0));
  CHECK(stays.farthest == doctest::Approx(0.5));
  CHECK(stays.max_speed() == AxisPair{0.0, 0.0});
  CHECK_THROWS_AS(evaluate_plane_cart_motion(path, std::vector<double>(4, 0.0), 0.2), Error);
}
