#include <doctest/doctest.h>

#include <stdexcept>

#include <sigmaik/error.hpp>
#include <sigmaik/planning/costs.hpp>
#include <sigmaik/planning/support_states.hpp>

#include "arms.hpp"
#include "random.hpp"

using namespace sigmaik;
using namespace sigmaik::planning;
using test::Random;

namespace {

JointVector inside(Random& random, const Chain& chain) {
  JointVector q(chain.dof());
  for (int i = 0; i < q.size(); ++i) {
    q[i] = random.uniform(std::max(chain.limits().lower[i], -M_PI), std::min(chain.limits().upper[i], M_PI));
  }
  return q;
}

// ½ |q − c|²: with this cost the optimum is a linear system.
class Bowl final : public JointCost {
 public:
  explicit Bowl(JointVector center) : center_(std::move(center)) {}
  int dof() const noexcept override { return static_cast<int>(center_.size()); }
  double value(const JointRef& q) const noexcept override { return 0.5 * (q - center_).squaredNorm(); }
  double model(const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept override {
    gradient = q - center_;
    hessian.setIdentity(dof(), dof());
    return value(q);
  }

 private:
  JointVector center_;
};

// A bowl about zero that throws at its last call.
class Throws final : public BatchCost {
 public:
  explicit Throws(int calls) : left_(calls) {}
  int dof() const noexcept override { return 6; }
  void evaluate(std::size_t count, const double* q, double* value, double* gradient) const override {
    if (--left_ == 0) throw std::range_error("the last call");
    bowl_.evaluate(count, q, value, gradient);
  }

 private:
  mutable int left_;
  Bowl bowl_{JointVector::Zero(6)};
};

}  // namespace

TEST_CASE("a quadratic cost has the optimum of its linear system") {
  // Σ ½ (q_i − c)² + w (q − μ)ᵀ K̄⁻¹ (q − μ): (I + 2 w K̄⁻¹)(q − μ) = c − μ, joint by joint.
  Random random(1);
  JointLimits limits = test::arms().at("franka_panda").limits();  // none, because the linear system has no limits
  limits.lower.setConstant(-std::numeric_limits<double>::infinity());
  limits.upper.setConstant(std::numeric_limits<double>::infinity());
  const Chain chain = test::arms().at("franka_panda").with_limits(limits);
  for (int trial = 0; trial < 20; ++trial) {
    const int states = random.integer(3, 40);
    const double w = random.decades(-2, 2);
    const JointVector center = inside(random, chain), from = inside(random, chain), to = inside(random, chain);
    SupportPlanner planner(chain, std::make_shared<Bowl>(center), states);
    const SupportStates found = planner.gradient(from, to, {states, w, 500, 1e-14});
    const int m = states - 2;
    Eigen::MatrixXd k(m, m);
    for (int i = 0; i < m; ++i) {
      for (int j = 0; j < m; ++j) {
        const double s = (std::min(i, j) + 1.0) / (states - 1.0), u = (std::max(i, j) + 1.0) / (states - 1.0);
        k(i, j) = s * (1.0 - u) * (2.0 * u - s * s - u * u) / 6.0;
      }
    }
    k /= k.diagonal().maxCoeff();
    const Eigen::MatrixXd system = Eigen::MatrixXd::Identity(m, m) + 2.0 * w * k.inverse();
    double worst = 0.0;
    for (int j = 0; j < 7; ++j) {
      Eigen::VectorXd line(m);
      for (int i = 0; i < m; ++i) line[i] = from[j] + (i + 1.0) / (states - 1.0) * (to[j] - from[j]);
      const Eigen::VectorXd q = line + system.lu().solve(Eigen::VectorXd::Constant(m, center[j]) - line);
      for (int i = 0; i < m; ++i) {
        worst = std::max(worst, std::abs(q[i] - found.q[static_cast<std::size_t>((i + 1) * 7 + j)]));
      }
    }
    CHECK(worst < 1e-5);
  }
}

TEST_CASE("samples find the optimum too, and the same seed gives the same motion") {
  Random random(2);
  const Chain& chain = test::arms().at("ur10");
  const JointVector start = inside(random, chain), goal = inside(random, chain);
  SupportPlanner planner(chain, geometry_aware_cost(chain, 6.0), 21);
  const SupportStates exact = planner.gradient(start, goal, {.prior_weight = 10.0, .tolerance = 1e-9});
  const SupportStates sampled = planner.stochastic(start, goal, {.samples = 20, .max_iterations = 200, .seed = 7});
  const SupportStates again = planner.stochastic(start, goal, {.samples = 20, .max_iterations = 200, .seed = 7});
  CHECK(sampled.q == again.q);
  CHECK(sampled.cost + 10.0 * sampled.distance < 1.1 * (exact.cost + 10.0 * exact.distance));
  for (const SupportStates* s : {&exact, &sampled}) {
    for (int i = 0; i < 6; ++i) {
      CHECK(s->q[static_cast<std::size_t>(i)] == start[i]);
      CHECK(s->q[s->q.size() - 6 + static_cast<std::size_t>(i)] == goal[i]);
    }
  }
}

TEST_CASE("states stay within the limits") {
  Random random(3);
  const Chain& chain = test::arms().at("franka_panda");
  JointVector outside = chain.limits().upper;
  outside.array() += 1.0;
  SupportPlanner planner(chain, std::make_shared<Bowl>(outside), 15);
  for (int trial = 0; trial < 20; ++trial) {
    const JointVector start = inside(random, chain), goal = inside(random, chain);
    for (const SupportStates& s : {planner.gradient(start, goal, {.states = 15, .prior_weight = 1e-3}),
                                   planner.stochastic(start, goal, {.states = 15, .prior_weight = 0.0})}) {
      for (std::size_t at = 0; at < s.q.size(); ++at) {
        const auto joint = static_cast<Eigen::Index>(at % 7);
        CHECK(s.q[at] >= chain.limits().lower[joint]);
        CHECK(s.q[at] <= chain.limits().upper[joint]);
      }
    }
  }
}

TEST_CASE("an exception of a cost reaches the caller, and the planner works afterwards") {
  const Chain& chain = test::arms().at("ur10");
  Random random(4);
  const JointVector start = inside(random, chain), goal = inside(random, chain);
  SupportPlanner other(chain, std::make_shared<Bowl>(JointVector::Zero(6)), 21);
  for (const int calls : {1, 2, 4}) {
    SupportPlanner planner(chain, std::make_shared<Throws>(calls), 21);
    CHECK_THROWS_AS(planner.gradient(start, goal, {}), std::range_error);
    CHECK(planner.gradient(start, goal, {}).q == other.gradient(start, goal, {}).q);
    SupportPlanner samples(chain, std::make_shared<Throws>(calls), 21);
    CHECK_THROWS_AS(samples.stochastic(start, goal, {}), std::range_error);
    CHECK(samples.stochastic(start, goal, {}).q == other.stochastic(start, goal, {}).q);
  }
}

TEST_CASE("what is refused") {
  const Chain& chain = test::arms().at("ur10");
  const JointCostPtr cost = log_manipulability_cost(chain);
  CHECK_THROWS_AS(SupportPlanner(chain, nullptr, 21), Error);
  CHECK_THROWS_AS(SupportPlanner(chain, cost, 2), Error);
  CHECK_THROWS_AS(SupportPlanner(test::arms().at("franka_panda"), cost, 21), Error);
  CHECK_THROWS_AS(geometry_aware_cost(chain, -1.0), Error);
  CHECK_THROWS_AS(log_manipulability_cost(chain, 0.0), Error);
  CHECK_THROWS_AS(sum_of_costs({}), Error);
  CHECK_THROWS_AS(sum_of_costs({cost, nullptr}), Error);
  SupportPlanner planner(chain, cost, 21);
  const JointVector zero = JointVector::Zero(6);
  CHECK_THROWS_AS(planner.gradient(JointVector::Zero(5), zero, {}), Error);
  CHECK_THROWS_AS(planner.gradient(zero, JointVector::Constant(6, 99.0), {}), Error);
  CHECK_THROWS_AS(planner.gradient(zero, zero, {}, {1.0, 2.0}), Error);
  CHECK_THROWS_AS(planner.stochastic(zero, zero, {.samples = 1}), Error);
}
