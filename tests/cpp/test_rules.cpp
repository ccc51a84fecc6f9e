// The rules against their formulas, their bounds, their continuity, and all kinds of degenerate input.
// tests/python/test_rules.py compares the rules with the papers' matrix forms, on decompositions of LAPACK's.

#include <doctest/doctest.h>

#include <string>

#include <sigmaik/error.hpp>
#include <sigmaik/rules.hpp>

#include "methods.hpp"
#include "numbers.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::kInfinity;
using test::kNan;
using test::MatrixXd;
using test::Random;
using test::VectorXd;

constexpr std::uint8_t kAngular = 0b111000;

// The library's methods, and many more parameters.
std::vector<Method> all_methods() {
  std::vector<Method> out = test::library_methods();
  for (const Method& method : std::initializer_list<Method>{
           PseudoInverse{0.01}, DampedLeastSquares{0.8}, SelectivelyDampedLeastSquares{10.0},
           JParse{0.3, 2.0, 0.5, true}, JParse{0.3, 2.0, 0.5, false}, JParse{0.3, 2.0, 0.5, true, true},
           JParse{1.0, 0.0, 3.0, true}, JacobianSafetyProjection{0.2}}) {
    out.push_back(method);
  }
  for (const DampingRule rule :
       {DampingRule::NumericalFiltering, DampingRule::Manipulability, DampingRule::SmallestSingularValue}) {
    for (const bool relative : {true, false}) {
      out.push_back(AdaptiveDampedLeastSquares{rule, 0.1, 0.0, relative});
      out.push_back(AdaptiveDampedLeastSquares{rule, 0.03, 0.5, relative});
    }
  }
  return out;
}

std::string label(const Method& m) {
  std::string text = name(m);
  if (const auto* a = std::get_if<AdaptiveDampedLeastSquares>(&m)) {
    text += " rule " + std::to_string(static_cast<int>(a->rule)) + (a->relative ? " relative" : " absolute");
  }
  if (const auto* j = std::get_if<JParse>(&m)) {
    text += " gamma " + std::to_string(j->gamma) + (j->continuous ? " continuous" : " published");
    if (j->singular_posture) text += " posture";
  }
  return text;
}

VectorXd qdot(const Spectrum& s, const Resolution& r) {
  VectorXd out = VectorXd::Zero(s.cols());
  for (int i = 0; i < s.size(); ++i) out += r.speed[static_cast<std::size_t>(i)] * s.v(i);
  return out;
}

// g_i and p_i as the table of rules.hpp and the papers have them, written as directly as can be.
struct Expected {
  double g, p;
  double gain;  // of g per u_iᵀẋ, or per u_iᵀKẋ
};

double most_gain(const Method& method) {
  const auto* r = std::get_if<JParse>(&method);
  return r != nullptr ? std::max(r->gain_linear, r->gain_angular) : 1.0;
}

Expected expected(const Method& method, const Spectrum& s, int i, const VectorXd& x, std::uint8_t angular) {
  const double sigma = s.sigma(i), largest = s.sigma(0), c = s.u(i).dot(x);
  const auto damped = [&](double square) -> Expected {
    if (sigma == 0.0) return {0.0, 0.0, 0.0};
    const double gain = sigma / (sigma * sigma + square);
    return {gain * c, sigma * gain, gain};
  };
  const auto kept = [&](double divisor, double p) -> Expected { return {c / divisor, p, 1.0 / divisor}; };
  if (const auto* r = std::get_if<PseudoInverse>(&method)) {
    return sigma > r->tolerance * largest ? kept(sigma, 1.0) : Expected{0.0, 0.0, 0.0};
  }
  if (const auto* r = std::get_if<DampedLeastSquares>(&method)) return damped(r->damping * r->damping);
  if (const auto* r = std::get_if<AdaptiveDampedLeastSquares>(&method)) {
    const double unit = r->relative ? largest : 1.0, lambda = r->damping * unit;
    if (r->rule == DampingRule::Manipulability) {
      const double w0 = (r->threshold > 0.0 ? r->threshold : 1e-3) * std::pow(unit, s.size());
      double w = 1.0;
      for (int l = 0; l < s.size(); ++l) w *= s.sigma(l);
      return damped(w < w0 ? lambda * lambda * (1.0 - w / w0) * (1.0 - w / w0) : 0.0);
    }
    const double epsilon = (r->threshold > 0.0 ? r->threshold : 0.1) * unit;
    const double watched = r->rule == DampingRule::NumericalFiltering ? sigma : s.sigma(s.size() - 1);
    return damped(watched < epsilon ? (1.0 - (watched / epsilon) * (watched / epsilon)) * lambda * lambda : 0.0);
  }
  if (const auto* r = std::get_if<JParse>(&method)) {
    const double threshold = r->gamma * largest;
    if (sigma > threshold) return kept(sigma, 1.0);
    double amplified = 0.0;
    for (int row = 0; row < s.rows(); ++row) {
      double gain = (angular >> row & 1u) != 0 ? r->gain_angular : r->gain_linear;
      if (r->continuous) gain += sigma / threshold * (1.0 - gain);
      amplified += s.u(i)[row] * gain * x[row];
    }
    const double gain = sigma / (threshold * threshold);
    return {gain * amplified, r->singular_posture ? sigma * gain : 1.0, gain};
  }
  if (const auto* r = std::get_if<JacobianProjection>(&method)) {
    return sigma > r->gamma * largest ? kept(sigma, 1.0) : Expected{0.0, 0.0, 0.0};
  }
  if (const auto* r = std::get_if<JacobianSafety>(&method)) return kept(std::max(sigma, r->gamma * largest), 1.0);
  if (const auto* r = std::get_if<JacobianSafetyProjection>(&method)) {
    return sigma > r->gamma * largest ? kept(sigma, 1.0) : Expected{0.0, 1.0, 0.0};
  }
  return {kNan, kNan, kNan};
}

// Buss and Kim 2005, one end effector: clamp each direction, then the sum.
VectorXd buss_and_kim(const MatrixXd& j, const Spectrum& s, const VectorXd& x, double max_speed) {
  VectorXd total = VectorXd::Zero(j.cols());
  for (int i = 0; i < s.size(); ++i) {
    if (s.sigma(i) <= 1e-12 * s.sigma(0)) continue;
    double moved = 0.0;
    for (int k = 0; k < j.cols(); ++k) moved += std::abs(s.v(i)[k]) * j.col(k).norm();
    const double bound = max_speed * std::min(1.0, s.sigma(i) / moved);
    VectorXd phi = s.u(i).dot(x) / s.sigma(i) * s.v(i);
    const double size = phi.cwiseAbs().maxCoeff();
    if (size > bound) phi *= bound / size;
    total += phi;
  }
  const double size = total.cwiseAbs().maxCoeff();
  if (size > max_speed) total *= max_speed / size;
  return total;
}

}  // namespace

TEST_CASE("every rule against its formula") {
  Random random(1);
  const auto methods = all_methods();
  for (int repeat = 0; repeat < 4000; ++repeat) {
    const int m = random.integer(1, 6), n = random.integer(1, 16);
    const MatrixXd j = random.with_singular_values(
        m, n, test::random_singular_values(random, std::min(m, n), random.decades(-2.0, 2.0)));
    Spectrum s;
    s.decompose(j);
    const VectorXd x = random.vector(m) * random.decades(-3.0, 3.0);
    const auto angular = static_cast<std::uint8_t>(random.chance(0.5) ? kAngular : random.integer(0, 63));
    for (const Method& method : methods) {
      CAPTURE(repeat);
      CAPTURE(label(method));
      const Resolution r = resolve(method, s, x, angular);
      if (const auto* selective = std::get_if<SelectivelyDampedLeastSquares>(&method)) {
        const VectorXd reference = buss_and_kim(j, s, x, selective->max_speed);
        CHECK((qdot(s, r) - reference).norm() <= 1e-9 * (1.0 + reference.norm()));
        for (int i = 0; i < s.size(); ++i) {
          CHECK(r.projector[static_cast<std::size_t>(i)] == (s.sigma(i) > 1e-12 * s.sigma(0) ? 1.0 : 0.0));
        }
        continue;
      }
      for (int i = 0; i < 6; ++i) {
        const auto at = static_cast<std::size_t>(i);
        if (i >= s.size()) {
          CHECK(r.speed[at] == 0.0);
          CHECK(r.projector[at] == 0.0);
          continue;
        }
        const Expected e = expected(method, s, i, x, angular);
        // u_iᵀẋ and u_iᵀKẋ cancel: what is left of them is only as good as |Kẋ|.
        const double gain = e.gain * std::max({1.0, most_gain(method)});
        CHECK(std::abs(r.speed[at] - e.g) <= 1e-12 * std::abs(e.g) + 1e-14 * gain * x.norm());
        CHECK(std::abs(r.projector[at] - e.p) <= 1e-12);
      }
    }
  }
}

TEST_CASE("which directions are singular to the rule") {
  Random random(2);
  const auto methods = all_methods();
  for (int repeat = 0; repeat < 1000; ++repeat) {
    const int m = random.integer(1, 6), n = random.integer(1, 16);
    Spectrum s;
    s.decompose(random.with_singular_values(m, n, test::random_singular_values(random, std::min(m, n), 2.0)));
    const VectorXd x = random.vector(m);
    for (const Method& method : methods) {
      CAPTURE(label(method));
      const Resolution r = resolve(method, s, x, kAngular);
      for (int i = 0; i < m; ++i) {
        const bool singular = (r.singular >> i & 1u) != 0;
        if (i >= s.size()) {
          CHECK(singular);
          continue;
        }
        const double ratio = s.sigma(i) / s.sigma(0);
        const auto against = [&](double gamma) {
          if (std::abs(ratio - gamma) > 1e-14) CHECK(singular == (ratio <= gamma));
        };
        if (const auto* p = std::get_if<PseudoInverse>(&method)) against(p->tolerance);
        if (const auto* p = std::get_if<JParse>(&method)) against(p->gamma);
        if (const auto* p = std::get_if<JacobianProjection>(&method)) against(p->gamma);
        if (const auto* p = std::get_if<JacobianSafety>(&method)) against(p->gamma);
        if (const auto* p = std::get_if<JacobianSafetyProjection>(&method)) against(p->gamma);
        if (std::holds_alternative<DampedLeastSquares>(method)) against(1e-12);
        // A direction that is done in full is not singular, and the other way round.
        if (std::holds_alternative<AdaptiveDampedLeastSquares>(method)) {
          const double p = expected(method, s, i, x, 0).p;
          CHECK((singular ? p <= 1.0 : p > 1.0 - 1e-12));
          if (std::abs(1.0 - p) > 1e-12) CHECK(singular);
        }
      }
      CHECK((r.singular >> m) == 0);
    }
  }
}

TEST_CASE("exact: says whether J q̇ is the command") {
  Random random(3);
  const auto methods = all_methods();
  int exact = 0, inexact = 0;
  for (int repeat = 0; repeat < 3000; ++repeat) {
    const int m = random.integer(1, 6), n = random.integer(1, 16), k = std::min(m, n);
    VectorXd sigma(k);  // well away from values at which rounding decides
    for (int i = 0; i < k; ++i) {
      sigma[i] = random.chance(0.2) ? 0.0 : random.chance(0.2) ? random.decades(-6.0, -1.0) : random.uniform(0.3, 1.0);
    }
    sigma[0] = 1.0;
    const MatrixXd j = random.with_singular_values(m, n, sigma);
    Spectrum s;
    s.decompose(j);
    // Commands in general, and commands that avoid the singular directions.
    VectorXd x = random.chance(0.3) ? random.vector(m) : VectorXd(j * random.vector(n));
    if (random.chance(0.3)) x = s.u(random.integer(0, m - 1));
    if (random.chance(0.05)) x.setZero();
    x *= random.decades(-6.0, 6.0);
    for (const Method& method : methods) {
      CAPTURE(label(method));
      CAPTURE(repeat);
      const Resolution r = resolve(method, s, x, kAngular);
      const double missed = (j * qdot(s, r) - x).norm();
      if (r.exact) {
        CHECK(missed <= 3e-9 * x.norm());
        ++exact;
      } else {
        CHECK(missed > 0.3e-9 * x.norm());
        ++inexact;
      }
    }
  }
  CHECK(exact > 10000);
  CHECK(inexact > 10000);
}

TEST_CASE("no rule exceeds its bound, at the threshold, below it or at a singularity") {
  Random random(4);
  for (int repeat = 0; repeat < 20000; ++repeat) {
    const int m = random.integer(1, 6), n = random.integer(1, 16), k = std::min(m, n);
    const double scale = random.decades(-4.0, 4.0), gamma = random.chance(0.1) ? 1.0 : random.decades(-4.0, 0.0);
    VectorXd sigma(k);
    for (int i = 0; i < k; ++i) {
      sigma[i] = scale * (random.chance(0.3)   ? gamma * (1.0 + random.decades(-16.0, -1.0) * random.integer(-1, 1))
                          : random.chance(0.2) ? 0.0
                                               : random.decades(-9.0, 0.0));
    }
    sigma[0] = scale;
    Spectrum s;
    s.decompose(random.with_singular_values(m, n, sigma));
    const double largest = s.sigma(0), k_linear = random.uniform(0.0, 3.0), k_angular = random.uniform(0.0, 3.0);
    VectorXd x = random.vector(m);
    if (random.chance(0.5)) x = s.u(random.integer(0, m - 1));  // the worst command for a rule
    constexpr double kRounding = 1.0 + 1e-13;
    const auto norm = [&](const Method& method) { return qdot(s, resolve(method, s, x, kAngular)).norm() / x.norm(); };
    const auto largest_speed = [&](const Method& method) {
      return qdot(s, resolve(method, s, x, kAngular)).cwiseAbs().maxCoeff();
    };
    const double lambda = random.decades(-3.0, 1.0), gain = std::hypot(1.0, std::max(k_linear, k_angular));
    CAPTURE(repeat);
    CAPTURE(gamma);
    CHECK(norm(PseudoInverse{gamma}) <= kRounding / (gamma * largest));
    CHECK(norm(DampedLeastSquares{lambda}) <= kRounding / (2.0 * lambda));
    CHECK(norm(JParse{gamma}) <= kRounding / (gamma * largest));
    CHECK(norm(JParse{gamma, 1.0, 1.0, false}) <= kRounding / (gamma * largest));
    CHECK(norm(JParse{gamma, k_linear, k_angular, false}) <= gain * kRounding / (gamma * largest));
    CHECK(norm(JParse{gamma, k_linear, k_angular, true}) <= gain * kRounding / (gamma * largest));
    CHECK(norm(JacobianProjection{gamma}) <= kRounding / (gamma * largest));
    CHECK(norm(JacobianSafety{gamma}) <= kRounding / (gamma * largest));
    CHECK(norm(JacobianSafetyProjection{gamma}) <= kRounding / (gamma * largest));
    CHECK(largest_speed(SelectivelyDampedLeastSquares{lambda}) <= lambda * kRounding);
    // Numerical filtering with λ ≥ ε/√2 never exceeds 1/ε; with less, it peaks at 1/(2λ √(1 − (λ/ε)²)).
    const double damping = random.decades(-2.0, 0.0), epsilon = random.decades(-2.0, -0.1), d = damping / epsilon;
    const double peak = d < std::sqrt(0.5) ? 1.0 / (2.0 * damping * std::sqrt(1.0 - d * d)) : 1.0 / epsilon;
    CHECK(norm(AdaptiveDampedLeastSquares{DampingRule::NumericalFiltering, damping, epsilon, true}) <=
          std::max(peak, 1.0 / epsilon) * kRounding / largest);
  }
}

TEST_CASE("nothing moves where nothing can") {
  Random random(5);
  for (const Method& method : all_methods()) {
    for (int m = 1; m <= 6; ++m) {
      for (int n = 1; n <= 16; ++n) {
        CAPTURE(label(method));
        Spectrum s;
        s.decompose(MatrixXd::Zero(m, n));
        const Resolution r = resolve(method, s, random.vector(m), kAngular);
        CHECK(qdot(s, r).isZero(0.0));
        CHECK(r.singular == (1u << m) - 1u);
        CHECK_FALSE(r.exact);
        CHECK(resolve(method, s, VectorXd::Zero(m), kAngular).exact);
      }
    }
  }
}

TEST_CASE("extreme Jacobians and commands: finite wherever the answer is a number") {
  Random random(6);
  for (const Method& method : all_methods()) {
    for (int repeat = 0; repeat < 2000; ++repeat) {
      const int m = random.integer(1, 6), n = random.integer(1, 16), k = std::min(m, n);
      const double size = random.decades(-320.0, 305.0);
      Spectrum s;
      s.decompose(MatrixXd(random.with_singular_values(m, n, test::random_singular_values(random, k, 1.0)) * size));
      // The command is in proportion, so that q̇ is a finite number; and one direction is lost.
      const VectorXd x = random.vector(m) * std::min(size, 1.0) * random.decades(-3.0, 3.0);
      const Resolution r = resolve(method, s, x, kAngular);
      CAPTURE(label(method));
      CAPTURE(size);
      for (int i = 0; i < k; ++i) {
        const auto at = static_cast<std::size_t>(i);
        CHECK(std::isfinite(r.speed[at]));
        CHECK(r.projector[at] >= 0.0);
        CHECK(r.projector[at] <= 1.0);
      }
    }
  }
}

TEST_CASE("a damped answer says so however large or small the command") {
  Random random(7);
  for (int repeat = 0; repeat < 2000; ++repeat) {
    const double size = random.decades(-300.0, 300.0);
    VectorXd sigma(6);
    sigma << 1.0, 0.9, 0.7, 0.5, 0.4, 0.05;
    Spectrum s;
    s.decompose(random.with_singular_values(6, 7, sigma));
    CAPTURE(size);
    CHECK_FALSE(resolve(JParse{}, s, size * s.u(5), kAngular).exact);
    CHECK_FALSE(resolve(JParse{}, s, size * random.unit(6), kAngular).exact);
    CHECK(resolve(JParse{}, s, size * (s.u(0) + s.u(3)), kAngular).exact);
    CHECK(resolve(PseudoInverse{}, s, size * random.unit(6), kAngular).exact);
    CHECK_FALSE(resolve(DampedLeastSquares{}, s, size * random.unit(6), kAngular).exact);
  }
}

TEST_CASE("rules that promise it are continuous across the threshold, the others jump as documented") {
  Random random(8);
  for (int repeat = 0; repeat < 2000; ++repeat) {
    const int m = random.integer(2, 6), n = random.integer(m, 12), k = m;
    const double gamma = random.uniform(0.05, 0.6), scale = random.decades(-2.0, 2.0);
    const MatrixXd left = random.orthonormal(m, k), right = random.orthonormal(n, k);
    VectorXd sigma(k);
    for (int i = 0; i < k; ++i) sigma[i] = scale * (1.0 - 0.3 * i / k);
    const double k_linear = random.uniform(0.0, 3.0), k_angular = random.uniform(0.0, 3.0);
    const VectorXd x = random.unit(m);
    const auto at = [&](const Method& method, double ratio) -> VectorXd {
      VectorXd values = sigma;
      values[k - 1] = ratio * values[0];
      Spectrum s;
      s.decompose(MatrixXd(left * values.asDiagonal() * right.transpose()));
      return qdot(s, resolve(method, s, x, kAngular));
    };
    const double step = 1e-7, bound = 1.0 / (gamma * scale);
    const auto jump = [&](const Method& method) {
      return (at(method, gamma * (1.0 + step)) - at(method, gamma * (1.0 - step))).norm();
    };
    CAPTURE(repeat);
    CAPTURE(gamma);
    const double smooth = 20.0 * step * bound;
    CHECK(jump(JParse{gamma}) < smooth);
    CHECK(jump(JParse{gamma, k_linear, k_angular, true}) < smooth);
    CHECK(jump(JacobianSafety{gamma}) < smooth);
    CHECK(jump(AdaptiveDampedLeastSquares{DampingRule::NumericalFiltering, gamma, gamma, true}) < smooth);
    CHECK(jump(AdaptiveDampedLeastSquares{DampingRule::SmallestSingularValue, gamma, gamma, true}) < smooth);
    double w0 = gamma;
    for (int i = 1; i < k - 1; ++i) w0 *= sigma[i] / sigma[0];
    CHECK(jump(AdaptiveDampedLeastSquares{DampingRule::Manipulability, gamma, w0, true}) < smooth);

    const VectorXd last = left.col(k - 1);
    const double c = std::abs(last.dot(x));
    // The published rule with equal gains jumps by |k − 1|/(γσ_max)·|u_iᵀẋ|.
    CHECK(jump(JParse{gamma, k_linear, k_linear, false}) ==
          doctest::Approx(std::abs(k_linear - 1.0) * bound * c).epsilon(1e-4));
    VectorXd amplified = x;
    for (int row = 0; row < m; ++row) amplified[row] *= (kAngular >> row & 1) != 0 ? k_angular : k_linear;
    CHECK(jump(JParse{gamma, k_linear, k_angular, false}) ==
          doctest::Approx(std::abs(last.dot(amplified) - last.dot(x)) * bound).epsilon(1e-4));
    CHECK(jump(JacobianProjection{gamma}) == doctest::Approx(bound * c).epsilon(1e-4));
    CHECK(jump(JacobianSafetyProjection{gamma}) == doctest::Approx(bound * c).epsilon(1e-4));
  }
}

TEST_CASE("continuous rules follow a moving Jacobian, repeated and crossing singular values included") {
  Random random(9);
  struct Case {
    Method method;
    double gain;  // the largest g_i/c_i, times σ_max where the rule is relative
    bool relative;
    double slack;  // the rule's slope in units of gain²
  };
  const std::vector<Case> cases{
      {DampedLeastSquares{0.1}, 10.0, false, 4.0},
      {JParse{}, 10.0, true, 4.0},
      {JParse{0.3, 2.0, 0.5, true}, 1.0 / 0.3, true, 12.0},
      // Not JacobianSafety: through σ_i = 0 its answer changes sign, by its formula.
      {AdaptiveDampedLeastSquares{DampingRule::NumericalFiltering, 0.2, 0.2, true}, 5.0, true, 6.0},
      {AdaptiveDampedLeastSquares{DampingRule::SmallestSingularValue, 0.2, 0.2, true}, 5.0, true, 12.0},
      {AdaptiveDampedLeastSquares{DampingRule::Manipulability, 0.2, 0.2, true}, 5.0, true, 60.0}};
  for (int repeat = 0; repeat < 30; ++repeat) {
    const int m = random.integer(2, 6), n = random.integer(m, 9);
    const MatrixXd a = random.matrix(m, n), left = random.orthonormal(m, m), right = random.orthonormal(n, m);
    const VectorXd x = random.unit(m);
    // Singular values move linearly and cross each other and zero; in half of the cases a small rest turns everything.
    const VectorXd from = VectorXd::NullaryExpr(m, [&] { return random.uniform(-1.0, 1.0); });
    const VectorXd to = VectorXd::NullaryExpr(m, [&] { return random.uniform(-1.0, 1.0); });
    const double rest = repeat % 2 == 0 ? 0.1 : 0.0;
    constexpr int kSteps = 4000;
    std::vector<VectorXd> last(cases.size());
    MatrixXd last_j;
    Spectrum s;
    for (int step = 0; step <= kSteps; ++step) {
      const double t = static_cast<double>(step) / kSteps;
      const MatrixXd j = left * ((1.0 - t) * from + t * to).asDiagonal() * right.transpose() + rest * t * a;
      s.decompose(j);
      for (std::size_t i = 0; i < cases.size(); ++i) {
        const VectorXd now = qdot(s, resolve(cases[i].method, s, x, kAngular));
        if (step > 0) {
          const double gain = cases[i].relative ? cases[i].gain / s.sigma(0) : cases[i].gain;
          CAPTURE(repeat);
          CAPTURE(step);
          CAPTURE(label(cases[i].method));
          CHECK((now - last[i]).norm() < cases[i].slack * gain * gain * (j - last_j).norm());
        }
        last[i] = now;
      }
      last_j = j;
    }
  }
}

TEST_CASE("parameters out of their range are refused with the facts") {
  const auto refuses = [](const Method& method, const char* what) {
    CAPTURE(what);
    try {
      validate(method);
      FAIL("accepted");
    } catch (const Error& error) {
      CHECK(std::string(error.what()).find(name(method)) != std::string::npos);
      CHECK(std::string(error.what()).find(what) != std::string::npos);
    }
  };
  for (const double bad : {0.0, -0.1, kNan, kInfinity, -kInfinity}) {
    refuses(PseudoInverse{bad}, "tolerance");
    refuses(DampedLeastSquares{bad}, "damping");
    refuses(AdaptiveDampedLeastSquares{DampingRule::NumericalFiltering, bad}, "damping");
    refuses(SelectivelyDampedLeastSquares{bad}, "max_speed");
    refuses(JParse{bad}, "gamma");
    refuses(JacobianProjection{bad}, "gamma");
    refuses(JacobianSafety{bad}, "gamma");
    refuses(JacobianSafetyProjection{bad}, "gamma");
  }
  for (const double bad : {-0.1, kNan, kInfinity, -kInfinity}) {
    refuses(AdaptiveDampedLeastSquares{DampingRule::Manipulability, 0.1, bad}, "threshold");
    refuses(JParse{0.1, bad, 1.0}, "gain_linear");
    refuses(JParse{0.1, 1.0, bad}, "gain_angular");
  }
  for (const double bad : {1.0 + 1e-15, 2.0, 1e300}) {
    refuses(JParse{bad}, "gamma");
    refuses(JacobianProjection{bad}, "gamma");
    refuses(JacobianSafety{bad}, "gamma");
    refuses(JacobianSafetyProjection{bad}, "gamma");
  }
  refuses(PseudoInverse{1.0 + 1e-15}, "tolerance");
  for (const Method& method : all_methods()) CHECK_NOTHROW(validate(method));
  CHECK_NOTHROW(validate(JParse{1.0, 0.0, 0.0}));
}

TEST_CASE("names") {
  CHECK(std::string(name(PseudoInverse{})) == "PseudoInverse");
  CHECK(std::string(name(DampedLeastSquares{})) == "DampedLeastSquares");
  CHECK(std::string(name(AdaptiveDampedLeastSquares{})) == "AdaptiveDampedLeastSquares");
  CHECK(std::string(name(SelectivelyDampedLeastSquares{})) == "SelectivelyDampedLeastSquares");
  CHECK(std::string(name(JParse{})) == "JParse");
  CHECK(std::string(name(JacobianProjection{})) == "JacobianProjection");
  CHECK(std::string(name(JacobianSafety{})) == "JacobianSafety");
  CHECK(std::string(name(JacobianSafetyProjection{})) == "JacobianSafetyProjection");
}
