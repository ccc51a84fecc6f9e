#include <doctest/doctest.h>

#include <sigmaik/error.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/singularities.hpp>

#include "arms.hpp"
#include "heap.hpp"
#include "oracles.hpp"
#include "random.hpp"

using namespace sigmaik;
using test::Random;

namespace {

JointVector anywhere(Random& random, int n) {
  return JointVector::NullaryExpr(n, [&] { return random.uniform(-M_PI, M_PI); });
}

double sigma_ratio(const Chain& chain, const JointVector& q) {
  ChainState state;
  update(chain, q, state);
  const Eigen::VectorXd sigma = test::singular_values(Eigen::MatrixXd(state.jacobian));
  return sigma[5] / sigma[0];
}

double determinant(const Chain& chain, const JointVector& q) {
  ChainState state;
  update(chain, q, state);
  return std::sqrt(std::max(0.0, (state.jacobian * state.jacobian.transpose()).determinant()));
}

// A point of set i: Newton's method on its residuals, from anywhere, with the gradients of ψ's parts by differences.
JointVector onto(const SingularSets& sets, int i, JointVector q) {
  int first = 0;
  for (int j = 0; j < i; ++j) first += sets.set(j).codimension;
  const int m = sets.set(i).codimension, n = sets.dof();
  const auto residual = [&](const JointVector& x) {
    std::array<double, kMaxResiduals> r;
    sets.residuals(x, r);
    return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(r.data() + first, m));
  };
  for (int iteration = 0; iteration < 60; ++iteration) {
    const Eigen::VectorXd r = residual(q);
    if (r.norm() < 1e-15) break;
    Eigen::MatrixXd slope(m, n);
    for (int k = 0; k < n; ++k) {
      JointVector up = q, down = q;
      up[k] += 1e-6;
      down[k] -= 1e-6;
      slope.col(k) = (residual(up) - residual(down)) / 2e-6;
    }
    const Eigen::VectorXd step = test::least_squares(slope, r);
    q -= step * std::min(1.0, 0.5 / (step.norm() + 1e-12));
  }
  return q;
}

template <typename Value>
JointVector differences(const JointVector& q, Value value, double step) {
  JointVector out(q.size());
  for (int k = 0; k < q.size(); ++k) {
    JointVector up = q, down = q;
    up[k] += step;
    down[k] -= step;
    out[k] = (value(up) - value(down)) / (2.0 * step);
  }
  return out;
}

}  // namespace

TEST_CASE("every set is singular, on all its branches") {
  Random random(1);
  for (const std::string& name : SingularSets::names()) {
    const SingularSets sets = SingularSets::load(name);
    const Chain& chain = test::arms().at(name);
    for (int i = 0; i < sets.size(); ++i) {
      double worst = 0.0;
      int found = 0;
      for (int trial = 0; trial < 3000; ++trial) {
        const JointVector q = onto(sets, i, anywhere(random, sets.dof()));
        std::array<double, kMaxSets> psi;
        CHECK(sets.psi(q, psi) == sets.size());
        if (!(psi[static_cast<std::size_t>(i)] < 1e-26)) continue;  // Newton's method has not converged
        ++found;
        worst = std::max(worst, sigma_ratio(chain, q));
      }
      CAPTURE(name);
      CAPTURE(sets.set(i).name);
      CHECK(found > 1000);
      CHECK(worst < 1e-10);
    }
  }
}

TEST_CASE("manipulability in closed form is that of the Jacobian, down to zero") {
  Random random(2);
  for (const std::string& name : SingularSets::names()) {
    const SingularSets sets = SingularSets::load(name);
    const Chain& chain = test::arms().at(name);
    double worst = 0.0, on_sets = 0.0;
    for (int trial = 0; trial < 5000; ++trial) {
      const JointVector q = anywhere(random, sets.dof());
      worst = std::max(worst, std::abs(sets.manipulability(q) - determinant(chain, q)));
      if (trial >= 1000) continue;
      const JointVector there = onto(sets, trial % sets.size(), q);
      std::array<double, kMaxSets> psi;
      sets.psi(there, psi);
      if (psi[static_cast<std::size_t>(trial % sets.size())] < 1e-26)
        on_sets = std::max(on_sets, sets.manipulability(there));
    }
    CAPTURE(name);
    CHECK(worst < 1e-12);
    CHECK(on_sets < 1e-14);
  }
}

TEST_CASE("derivatives") {
  Random random(3);
  for (const std::string& name : SingularSets::names()) {
    const SingularSets sets = SingularSets::load(name);
    const int n = sets.dof();
    CAPTURE(name);
    for (int trial = 0; trial < 2000; ++trial) {
      // Every other point is near a set, where the potential is high.
      JointVector q = anywhere(random, n);
      if (trial % 2) q = onto(sets, trial / 2 % sets.size(), q) + 0.03 * random.vector(n);
      const auto check = [&](const JointVector& got, const JointVector& expected, double scale) {
        CHECK((got - expected).cwiseAbs().maxCoeff() < 1e-6 * scale);
      };
      JointVector g(n), g2(n), moved(n);
      JointMatrix h(n, n), h2(n, n);
      for (int i = 0; i < sets.size(); ++i) {
        const auto value = [&](const JointVector& x) {
          std::array<double, kMaxSets> psi;
          sets.psi(x, psi);
          return psi[static_cast<std::size_t>(i)];
        };
        CHECK(sets.psi(i, q, g, h) == doctest::Approx(value(q)).epsilon(1e-13));
        check(g, differences(q, value, 1e-6), 10.0);
        for (int k = 0; k < n; ++k) {
          check(h.col(k),
                differences(
                    q,
                    [&](const JointVector& x) {
                      sets.psi(i, x, g2, h2);
                      return g2[k];
                    },
                    1e-6),
                10.0);
        }
      }
      const Potential p{.weights = {1.0, 0.5, 2.0, 0.25}};
      const auto potential = [&](const JointVector& x) { return sets.potential(x, p); };
      const double value = sets.potential(q, p, g, h);
      CHECK(value == doctest::Approx(potential(q)).epsilon(1e-12));
      CHECK(sets.potential(q, p, g2) == doctest::Approx(value).epsilon(1e-12));
      CHECK((g - g2).cwiseAbs().maxCoeff() <= 1e-12 * (1.0 + g.cwiseAbs().maxCoeff()));
      check(g, differences(q, potential, 1e-7), 10.0 * (1.0 + 40.0 * value + g.cwiseAbs().maxCoeff()));
      for (int k = 0; k < n; ++k) {
        check(h.col(k),
              differences(
                  q,
                  [&](const JointVector& x) {
                    sets.potential(x, p, moved);
                    return moved[k];
                  },
                  1e-7),
              10.0 * (1.0 + 1600.0 * value + h.cwiseAbs().maxCoeff()));
      }
      const double m = sets.manipulability(q, g, h);
      CHECK(m == doctest::Approx(sets.manipulability(q)).epsilon(1e-12));
      CHECK(sets.manipulability(q, g2) == doctest::Approx(m).epsilon(1e-12));
      CHECK((g - g2).cwiseAbs().maxCoeff() < 1e-12);
      if (m < 1e-3) continue;
      check(g, differences(q, [&](const JointVector& x) { return sets.manipulability(x); }, 1e-6), 1.0);
      for (int k = 0; k < n; ++k) {
        check(h.col(k),
              differences(
                  q,
                  [&](const JointVector& x) {
                    sets.manipulability(x, moved);
                    return moved[k];
                  },
                  1e-6),
              1.0 / m);
      }
    }
  }
}

TEST_CASE("on a set: no force, the potential's full height, and a hill that bends down") {
  Random random(4);
  for (const std::string& name : SingularSets::names()) {
    const SingularSets sets = SingularSets::load(name);
    const int n = sets.dof();
    for (int i = 0; i < sets.size(); ++i) {
      Potential only{.eta2 = 400.0, .weights = {}};
      only.weights[static_cast<std::size_t>(i)] = 1.0;
      for (int trial = 0; trial < 100; ++trial) {
        const JointVector q = onto(sets, i, anywhere(random, n));
        std::array<double, kMaxSets> psi;
        sets.psi(q, psi);
        if (!(psi[static_cast<std::size_t>(i)] < 1e-26)) continue;
        JointVector g(n);
        JointMatrix h(n, n);
        CHECK(sets.potential(q, only, g, h) == doctest::Approx(2400.0).epsilon(1e-12));
        CHECK(g.cwiseAbs().maxCoeff() < 1e-5);
        CHECK(h.diagonal().maxCoeff() < 1e-5);
        CHECK(sets.manipulability(q, g, h) < 1e-14);
        CHECK(g.allFinite());
        CHECK(h.allFinite());
      }
    }
  }
}

TEST_CASE("arms are recognised by their axes") {
  Random random(5);
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    CAPTURE(name);
    const std::optional<SingularSets> found = SingularSets::of(arm);
    const std::vector<std::string> names = SingularSets::names();
    const bool known = std::find(names.begin(), names.end(), name) != names.end();
    REQUIRE(found.has_value() == known);
    if (!known) continue;
    CHECK(found->name() == name);
    // On another base, with another tool; but not with another length.
    std::vector<Segment> segments = arm.segments();
    segments.front().origin = random.pose() * segments.front().origin;
    Segment tool;
    tool.joint_name = "tool";
    tool.link_name = "cup";
    tool.origin = random.pose();
    segments.push_back(tool);
    CHECK(SingularSets::of(Chain("table", segments)).has_value());
    segments[3].origin.translation().x() += 0.01;
    CHECK(!SingularSets::of(Chain("table", segments)).has_value());
  }
  CHECK(!SingularSets::of(random.chain(7)).has_value());
  CHECK_THROWS_WITH_AS(SingularSets::load("nobody"),
                       "no singular sets are known of 'nobody'; there are those of comau_racer_7_1_4, franka_panda, "
                       "kuka_lbr_iiwa_14_r820",
                       Error);
}

TEST_CASE("recorded expressions give the same numbers") {
  Random random(6);
  const auto run = [](const Tape& tape, const JointVector& q) {
    std::vector<double> x;
    for (const Operation& o : tape.operations) {
      switch (o.kind) {
        case Operation::Constant: x.push_back(o.value); break;
        case Operation::Sin: x.push_back(std::sin(q[o.a])); break;
        case Operation::Cos: x.push_back(std::cos(q[o.a])); break;
        case Operation::Add:
          x.push_back(x.at(static_cast<std::size_t>(o.a)) + x.at(static_cast<std::size_t>(o.b)));
          break;
        case Operation::Subtract:
          x.push_back(x.at(static_cast<std::size_t>(o.a)) - x.at(static_cast<std::size_t>(o.b)));
          break;
        case Operation::Multiply:
          x.push_back(x.at(static_cast<std::size_t>(o.a)) * x.at(static_cast<std::size_t>(o.b)));
          break;
      }
    }
    std::vector<double> out;
    for (const int i : tape.results) out.push_back(x.at(static_cast<std::size_t>(i)));
    return out;
  };
  for (const std::string& name : SingularSets::names()) {
    const SingularSets sets = SingularSets::load(name);
    for (int trial = 0; trial < 200; ++trial) {
      const JointVector q = anywhere(random, sets.dof());
      std::array<double, kMaxResiduals> r;
      const int count = sets.residuals(q, r);
      const std::vector<double> got = run(sets.residual_tape(), q), minors = run(sets.manipulability_tape(), q);
      REQUIRE(static_cast<int>(got.size()) == count);
      for (int i = 0; i < count; ++i)
        CHECK(std::abs(got[static_cast<std::size_t>(i)] - r[static_cast<std::size_t>(i)]) < 1e-15);
      // Many turns away, and so many turns that the library's sine takes over.
      JointVector far = q;
      for (int i = 0; i < far.size(); ++i) far[i] += random.uniform(-1.0, 1.0) * (trial % 2 ? 9e4 : 1e9);
      sets.residuals(far, r);
      const std::vector<double> there = run(sets.residual_tape(), far);
      for (int i = 0; i < count; ++i)
        CHECK(std::abs(there[static_cast<std::size_t>(i)] - r[static_cast<std::size_t>(i)]) < 1e-14);
      double square = 0.0;
      for (const double m : minors) square += m * m;
      CHECK(std::abs(std::sqrt(square) - sets.manipulability(q)) < 1e-15);
    }
  }
}

TEST_CASE("potentials of any height") {
  Random random(8);
  const SingularSets sets = SingularSets::load("kuka_lbr_iiwa_14_r820");
  for (int trial = 0; trial < 2000; ++trial) {
    const JointVector q = anywhere(random, 7);
    const Potential p{.eta1 = random.uniform(-800.0, 705.0), .eta2 = random.decades(-2, 4)};
    std::array<double, kMaxSets> psi;
    sets.psi(q, psi);
    double expected = 0.0;
    for (int i = 0; i < 4; ++i) expected += std::exp(p.eta1 - p.eta2 * psi[static_cast<std::size_t>(i)]);
    const double got = sets.potential(q, p);
    CHECK(std::abs(got - expected) <= 1e-12 * expected + 1e-300);
  }
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("no heap") {
  Random random(7);
  const SingularSets sets = SingularSets::load("franka_panda");
  const JointVector q = anywhere(random, 7);
  JointVector g(7);
  JointMatrix h(7, 7);
  std::array<double, kMaxResiduals> r;
  std::array<double, kMaxSets> psi;
  const test::HeapWatch heap;
  sets.residuals(q, r);
  sets.psi(q, psi);
  sets.psi(2, q, g, h);
  double sum = sets.potential(q) + sets.potential(q, {}, g) + sets.potential(q, {}, g, h);
  sum += sets.manipulability(q) + sets.manipulability(q, g) + sets.manipulability(q, g, h);
  CHECK(heap.calls() == 0);
  CHECK(sum > 0.0);
}
#endif
