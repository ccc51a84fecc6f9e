// The threshold of J-PARSE that grows with the command: bounded speeds, no jumps, and no motion away from the target.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include <sigmaik/rules.hpp>
#include <sigmaik/velocity_solver.hpp>

#include "jump.hpp"
#include "numbers.hpp"
#include "oracles.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::MatrixXd;
using test::Random;
using test::VectorXd;

struct Case {
  MatrixXd u, v;  // with orthonormal columns
  VectorXd sigma, command;
  Pace pace;
  JParse rule;
};

Case draw(Random& random) {
  Case out;
  const int m = random.integer(1, 6), n = random.integer(1, 9), k = std::min(m, n);
  out.u = random.orthonormal(m, k);
  out.v = random.orthonormal(n, k);
  out.sigma = test::random_singular_values(random, k, random.decades(-2.0, 1.0));
  if (k > 1 && random.chance(0.3)) out.sigma[k - 1] = 0.0;
  const double size = random.decades(-4.0, 2.0);
  out.command = size * random.vector(m);
  if (random.chance(0.2)) out.command = out.u.col(k - 1) * out.command.norm();
  out.pace.slowness.resize(n);
  for (double& x : out.pace.slowness) x = random.chance(0.1) ? 0.0 : random.decades(-1.0, 1.0);
  out.pace.lag = random.decades(-3.0, 0.0);
  out.rule.gamma = random.chance(0.5) ? 0.1 : random.decades(-2.0, 0.0);
  return out;
}

Resolution answer(const Case& c, Spectrum& spectrum) {
  spectrum = Spectrum{};
  spectrum.decompose(TaskJacobian(c.u * c.sigma.asDiagonal() * c.v.transpose()));
  return resolve(c.rule, spectrum, TaskVector(c.command), 0, c.pace);
}

JointVector velocity(const Case& c) {
  Spectrum spectrum;
  const Resolution resolution = answer(c, spectrum);
  return spectrum.combine_v(resolution.speed);
}

}  // namespace

TEST_CASE("along each direction the answer has the sign of the command, for any threshold and at σ = 0") {
  Random random(1);
  for (int run = 0; run < 5000; ++run) {
    const Case c = draw(random);
    Spectrum spectrum;
    const Resolution resolution = answer(c, spectrum);
    double rate = 0.0;
    for (int i = 0; i < spectrum.size(); ++i) {
      const auto at = static_cast<std::size_t>(i);
      const double part = spectrum.u(i).dot(c.command), sigma = spectrum.sigma(i);
      CAPTURE(run);
      REQUIRE(std::isfinite(resolution.speed[at]));
      // g_i = σ_i c_i/w_i², w_i the larger of σ_i and a threshold no larger than γσ_max.
      const double w = resolution.weight[at];
      CHECK(w >= sigma);
      CHECK(w <= std::max(sigma, c.rule.gamma * spectrum.sigma(0)) * (1.0 + 1e-12));
      if (w > 0.0) CHECK(resolution.speed[at] == doctest::Approx(sigma / w * part / w).epsilon(1e-9));
      rate -= part * sigma * resolution.speed[at];
      CHECK(part * resolution.speed[at] >= 0.0);
    }
    CHECK(rate <= 0.0);
    const VectorXd moved = c.u * c.sigma.asDiagonal() * c.v.transpose() *
                           VectorXd(spectrum.combine_v(resolution.speed));
    CHECK(c.command.dot(moved) >= -1e-12 * c.command.squaredNorm());
  }
}

TEST_CASE("the threshold is what the command needs: the joints' speeds and the bandwidth are bounded") {
  Random random(2);
  int adapted = 0, published = 0;
  for (int run = 0; run < 5000; ++run) {
    const Case c = draw(random);
    Spectrum spectrum;
    const Resolution resolution = answer(c, spectrum);
    CAPTURE(run);
    // The part of the command that velocity limits leave of J-PARSE's own answer.
    const double most = c.rule.gamma * spectrum.sigma(0);
    const VectorXd slowness = c.pace.slowness;
    VectorXd by_paper = VectorXd::Zero(spectrum.cols());
    VectorXd share = VectorXd::Zero(spectrum.size()), parts = share;
    for (int i = 0; i < spectrum.size(); ++i) {
      const double w = std::max(spectrum.sigma(i), most);
      parts[i] = spectrum.u(i).dot(c.command);
      share[i] = std::clamp(4.0 * (1.0 - spectrum.sigma(i) / most), 0.0, 1.0);
      by_paper += spectrum.sigma(i) * parts[i] / (w * w) * spectrum.v(i);
    }
    const double within = 1.0 / std::max(1.0, by_paper.cwiseAbs().cwiseProduct(slowness).maxCoeff());
    // A direction of σ = 0 is any one of the null spaces.
    VectorXd known = VectorXd::Zero(spectrum.size());
    for (int i = 0; i < spectrum.size(); ++i) {
      known[i] = std::clamp((spectrum.sigma(i) / spectrum.sigma(0) - 1e-9) / (1e-6 - 1e-9), 0.0, 1.0);
    }
    const double unknown = 1.0 - known.minCoeff();
    const double lost = std::max(0.0, c.command.squaredNorm() - parts.squaredNorm());
    const double size = within * std::sqrt(share.cwiseProduct(parts).squaredNorm() + unknown * lost);
    double fastest = 0.0;
    for (int j = 0; j < spectrum.cols(); ++j) {
      double square = unknown;
      for (int i = 0; i < spectrum.size(); ++i) {
        square += known[i] * (share[i] * share[i] - unknown) * std::pow(spectrum.v(i)[j], 2);
      }
      fastest = std::max(fastest, slowness[j] * std::sqrt(std::max(0.0, square)));
    }
    const double needed = std::max(size * fastest, std::sqrt(c.pace.lag * size));
    const double threshold = std::min(most, std::max(needed, 1e-12 * spectrum.sigma(0)));
    (threshold < most ? adapted : published) += 1;
    VectorXd together = VectorXd::Zero(spectrum.cols());
    for (int i = 0; i < spectrum.size(); ++i) {
      const auto at = static_cast<std::size_t>(i);
      CAPTURE(i);
      CHECK(resolution.weight[at] == doctest::Approx(std::max(spectrum.sigma(i), threshold)).epsilon(1e-9));
      if (share[i] < 1.0) continue;
      const double speed = within * std::abs(resolution.speed[at]);
      together += within * resolution.speed[at] * spectrum.v(i);
      if (threshold == most) CHECK(speed * most <= within * std::abs(parts[i]) + 1e-12 * c.command.norm());
      // The loop through σ_i stays within its bandwidth.
      if (threshold < most) CHECK(speed * speed * c.pace.lag <= size * (1.0 + 1e-9) + 1e-20 * c.command.squaredNorm());
    }
    // Each joint stays within its velocity limit.
    if (threshold < most) CHECK(together.cwiseAbs().cwiseProduct(slowness).maxCoeff() <= 1.0 + 1e-9);
  }
  CHECK(adapted > 1000);
  CHECK(published > 300);
}

TEST_CASE("the answer has no jumps as a singular value passes zero and the threshold, or as the command grows") {
  Random random(3);
  for (int run = 0; run < 3000; ++run) {
    Case c = draw(random);
    const auto k = c.sigma.size();
    if (k < 2) continue;
    // The one that moves meets others on its way.
    const double largest = random.decades(-2.0, 1.0), size = c.command.norm();
    c.rule.gamma = std::min(c.rule.gamma, 0.3);
    for (double& x : c.sigma) x = largest * random.uniform(0.0, 1.0);
    c.sigma[0] = largest;
    const double last = c.sigma[k - 1] = 0.5 * c.rule.gamma * largest * random.uniform(0.0, 1.0);
    for (const bool by_sigma : {false, true}) {
      const auto at = [&](double t) -> VectorXd {
        Case moved = c;
        if (by_sigma) {
          moved.sigma[k - 1] = (2.0 * t - 1.0) * 2.0 * c.rule.gamma * largest;  // the sign turns u round
        } else {
          moved.command = 2.0 * t * c.command;
          moved.sigma[k - 1] = last;
        }
        return velocity(moved);
      };
      // The interval that changes most.
      constexpr int kSteps = 64;
      int where = 0;
      double worst = -1.0;
      VectorXd before = at(0.0);
      double scale = before.norm();
      for (int step = 1; step <= kSteps; ++step) {
        const VectorXd now = at(static_cast<double>(step) / kSteps);
        scale = std::max(scale, now.norm());
        if ((now - before).norm() > worst) {
          worst = (now - before).norm();
          where = step;
        }
        before = now;
      }
      const double a = static_cast<double>(where - 1) / kSteps, b = static_cast<double>(where) / kSteps;
      CAPTURE(run);
      CAPTURE(by_sigma);
      CHECK(test::jump_within(at, a, b, 40) <= 1e-4 * (scale + size / largest));
    }
  }
}

TEST_CASE("without a pace, and with adaptive = false, the threshold is the published one") {
  Random random(4);
  for (int run = 0; run < 500; ++run) {
    Case c = draw(random);
    Case fixed = c, bare = c;
    fixed.rule.adaptive = false;
    bare.pace = Pace{};
    Spectrum spectrum;
    const Resolution a = answer(fixed, spectrum), b = answer(bare, spectrum);
    for (int i = 0; i < spectrum.size(); ++i) {
      const auto at = static_cast<std::size_t>(i);
      const double w = std::max(spectrum.sigma(i), c.rule.gamma * spectrum.sigma(0));
      const double expected = spectrum.sigma(i) / w * spectrum.u(i).dot(c.command) / w;
      CHECK(a.speed[at] == doctest::Approx(expected).epsilon(1e-9));
      CHECK(b.speed[at] == doctest::Approx(expected).epsilon(1e-9));
    }
  }
}
