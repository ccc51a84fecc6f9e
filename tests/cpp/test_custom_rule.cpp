// An application's own rule runs through the same solver and servo as the library's rules, with the same answers.
#include <doctest/doctest.h>

#include <string>
#include <type_traits>

#include <sigmaik/error.hpp>
#include <sigmaik/servo.hpp>
#include <sigmaik/velocity_solver.hpp>

#include "arms.hpp"
#include "heap.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::Random;

// Damped least squares as an application would write it, from the formula.
struct OwnDls {
  double lambda = 0.1;

  static constexpr const char* kName = "OwnDls";
  double relative_threshold() const noexcept { return 0.1; }
  Direction at(double sigma, const SpectrumSummary& spectrum) const noexcept {
    const double square = sigma * sigma + lambda * lambda;
    return {sigma / square, sigma * sigma / square, sigma > 1e-12 * spectrum.largest};
  }
  void check() const {
    if (!(lambda > 0.0)) throw Error("OwnDls: lambda must be above 0");
  }
};

// Copies of rules that amplify and clamp.
struct OwnJParse : JParse {
  static constexpr const char* kName = "OwnJParse";
};
struct OwnSdls : SelectivelyDampedLeastSquares {
  static constexpr const char* kName = "OwnSdls";
};

struct NoThreshold {
  double value;
  static constexpr const char* kName = "NoThreshold";
  double relative_threshold() const noexcept { return value; }
  Direction at(double, const SpectrumSummary&) const noexcept { return {}; }
};

static_assert(Rule<OwnDls> && !AmplifyingRule<OwnDls> && !ClampingRule<OwnDls>);
static_assert(AmplifyingRule<OwnJParse> && ClampingRule<OwnSdls>);
struct Incomplete {
  static constexpr const char* kName = "Incomplete";
};
static_assert(!Rule<Incomplete> && !std::is_convertible_v<Incomplete, Method>);
static_assert(std::is_convertible_v<OwnDls, Method>);

double difference(const Solution& a, const Solution& b) {
  return (a.qdot - b.qdot).cwiseAbs().maxCoeff() / (1.0 + b.qdot.cwiseAbs().maxCoeff());
}

}  // namespace

TEST_CASE("an application's rule answers as the library's, for every size, with and without a posture") {
  Random random(1);
  for (int repeat = 0; repeat < 3000; ++repeat) {
    const int m = random.integer(1, 6), n = random.integer(1, 16);
    const double damping = random.decades(-2.0, 1.0);
    const JParse jparse{0.3, 2.0, 0.5, random.chance(0.5)};
    const SelectivelyDampedLeastSquares sdls{random.decades(-1.0, 1.0)};
    const auto compare = [&](const Method& own, const Method& library, double tolerance) {
      VelocitySolver a(own, 0.5), b(library, 0.5);
      for (int cycle = 0; cycle < 3; ++cycle) {
        const Eigen::MatrixXd j = random.matrix(m, n);
        const Eigen::VectorXd x = random.vector(m), posture = random.vector(cycle == 0 ? 0 : n);
        const Solution own_answer = a.solve(j, x, posture), library_answer = b.solve(j, x, posture);
        CHECK(difference(own_answer, library_answer) <= tolerance);
        CHECK(own_answer.singular == library_answer.singular);
        CHECK(own_answer.status == library_answer.status);
      }
    };
    CAPTURE(repeat);
    compare(CustomRule(OwnDls{damping}), DampedLeastSquares{damping}, 1e-14);
    compare(CustomRule(OwnJParse{jparse}), jparse, 1e-15);
    compare(CustomRule(OwnSdls{sdls}), sdls, 1e-15);
  }
}

TEST_CASE("a servo drives by an application's rule, inside limits, to the library's configurations") {
  for (const auto& [name, chain] : test::arms()) {
    const std::string& arm = name;  // for CAPTURE, which is a lambda
    Servo own(chain, OwnDls{0.1}), library(chain, DampedLeastSquares{0.1});
    const JointVector start = JointVector::Constant(chain.dof(), 0.4);
    own.reset(start);
    library.reset(start);
    Pose far = own.tip();
    far.translation() *= 3.0;  // out of reach: past the limits, through singularities
    int limited = 0;
    for (int cycle = 0; cycle < 3000; ++cycle) {
      const ServoStep a = own.update(far), b = library.update(far);
      limited += b.status == Status::Limited;
      CAPTURE(arm);
      CAPTURE(cycle);
      REQUIRE((a.q - b.q).cwiseAbs().maxCoeff() < 1e-9);
      REQUIRE(a.status == b.status);
    }
    CHECK(limited > 0);
  }
}

TEST_CASE("an application's rule is checked when a solver, a servo or a change of method receives it") {
  const auto refuses = [](const Method& method, const char* what) {
    try {
      const VelocitySolver solver(method);
      FAIL("accepted");
    } catch (const Error& error) {
      CAPTURE(std::string(error.what()));
      CHECK(std::string(error.what()).find(what) != std::string::npos);
    }
  };
  refuses(OwnDls{0.0}, "OwnDls: lambda must be above 0");
  // Named CustomRule, because a rule that derives from a rule of the library would be taken as the library's rule.
  refuses(CustomRule(OwnJParse{JParse{2.0}}), "OwnJParse: gamma = 2 must be finite and above 0 and at most 1");
  for (const double bad : {0.0, -0.1, 1.1}) refuses(NoThreshold{bad}, "NoThreshold: relative_threshold() = ");
  VelocitySolver solver(OwnDls{});
  CHECK_THROWS_AS(solver.set_method(OwnDls{-1.0}), Error);
  CHECK(std::get<CustomRule>(solver.method()).get_if<OwnDls>()->lambda == 0.1);
  CHECK(std::get<CustomRule>(solver.method()).get_if<OwnSdls>() == nullptr);
  CHECK(std::string(name(solver.method())) == "OwnDls");
  CHECK(relative_threshold(OwnJParse{JParse{0.3}}) == 0.3);
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("an application's rule leaves the heap alone") {
  Random random(2);
  const Eigen::MatrixXd j = random.matrix(6, 7);
  const Eigen::VectorXd x = random.vector(6), posture = random.vector(7);
  const test::HeapWatch watch;
  VelocitySolver solver(OwnJParse{JParse{0.3, 2.0, 0.5}});
  for (int cycle = 0; cycle < 10; ++cycle) CHECK(solver.solve(j, x, posture).status != Status::BadInput);
  solver.set_method(OwnSdls{});
  CHECK(solver.solve(j, x, posture).status != Status::BadInput);
  CHECK(watch.calls() == 0);
}
#endif
