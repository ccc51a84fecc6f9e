#include <doctest/doctest.h>

#include <cmath>

#include <sigmaik/error.hpp>
#include <sigmaik/indices.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/planning/costs.hpp>
#include <sigmaik/planning/costs/collision.hpp>
#include <sigmaik/planning/costs/geometry_aware.hpp>
#include <sigmaik/planning/costs/manipulability.hpp>
#include <sigmaik/planning/costs/potential.hpp>
#include <sigmaik/planning/plan.hpp>

#include "arms.hpp"
#include "random.hpp"

using namespace sigmaik;
using namespace sigmaik::planning;
using test::Random;

namespace {

JointVector inside(Random& random, const Chain& chain) {
  JointVector q(chain.dof());
  for (int i = 0; i < q.size(); ++i) {
    const double low = std::max(chain.limits().lower[i], -M_PI), high = std::min(chain.limits().upper[i], M_PI);
    q[i] = low + (high - low) * random.uniform(0.1, 0.9);
  }
  return q;
}

// A cost of a user's own, with no more than such a cost needs.
struct NearHome {
  double weight = 1.0;

  JointCostPtr bind(const Chain& chain) const {
    class Bowl final : public JointCost {
     public:
      Bowl(int dof, double weight) : dof_(dof), weight_(weight) {}
      int dof() const noexcept override { return dof_; }
      double value(const JointRef& q) const noexcept override { return 0.5 * weight_ * q.squaredNorm(); }
      double model(const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept override {
        gradient = weight_ * q;
        hessian = weight_ * JointMatrix::Identity(dof_, dof_);
        return value(q);
      }

     private:
      int dof_;
      double weight_;
    };
    return std::make_shared<Bowl>(chain.dof(), weight);
  }
};

// A cost that has no Hessian, because it is evaluated for all states at once.
class Linear final : public BatchCost {
 public:
  explicit Linear(int dof) : dof_(dof) {}
  int dof() const noexcept override { return dof_; }
  void evaluate(std::size_t count, const double* q, double* value, double* gradient) const override {
    const auto n = static_cast<std::size_t>(dof_);
    for (std::size_t k = 0; k < count; ++k) {
      value[k] = 0.0;
      for (std::size_t j = 0; j < n; ++j) value[k] += q[k * n + j];
    }
    if (gradient != nullptr) std::fill(gradient, gradient + count * n, 1.0);
  }

 private:
  int dof_;
};

DistanceField ball(const Eigen::Vector3d& center, double radius) {
  constexpr int kNodes = 50;
  constexpr double kCell = 0.05, kHalf = 0.5 * kCell * (kNodes - 1);
  std::vector<double> distances;
  for (int i = 0; i < kNodes; ++i) {
    for (int j = 0; j < kNodes; ++j) {
      for (int k = 0; k < kNodes; ++k) {
        distances.push_back((kCell * Eigen::Vector3d(i, j, k) - Eigen::Vector3d::Constant(kHalf)).norm() - radius);
      }
    }
  }
  return {distances, {kNodes, kNodes, kNodes}, center - Eigen::Vector3d::Constant(kHalf), kCell};
}

}  // namespace

TEST_CASE("terms add up, with their factors, gradients and Hessians") {
  Random random(1);
  const Chain& chain = test::arms().at("kuka_lbr_iiwa_14_r820");
  const Cost cost = costs::Potential{} + 2.0 * costs::Manipulability{.weight = 3.0} + NearHome{} * 0.5;
  const JointCostPtr bound = cost.bind_smooth(chain);
  const SingularSets sets = *SingularSets::of(chain);
  const JointCostPtr parts[] = {potential_cost(sets), manipulability_cost(sets, 3.0), NearHome{}.bind(chain)};
  const double factors[] = {1.0, 2.0, 0.5};
  for (int trial = 0; trial < 50; ++trial) {
    const JointVector q = inside(random, chain);
    double value = 0.0;
    JointVector slope = JointVector::Zero(7), g(7), got(7), alone(7);
    JointMatrix bend = JointMatrix::Zero(7, 7), h(7, 7), got_bend(7, 7);
    for (int i = 0; i < 3; ++i) {
      value += factors[i] * parts[i]->model(q, g, h);
      slope += factors[i] * g;
      bend += factors[i] * h;
    }
    CHECK(bound->value(q) == doctest::Approx(value).epsilon(1e-12));
    CHECK(bound->model(q, got, got_bend) == doctest::Approx(value).epsilon(1e-12));
    CHECK((got - slope).norm() <= 1e-12 * (1.0 + slope.norm()));
    CHECK((got_bend - bend).norm() <= 1e-12 * (1.0 + bend.norm()));
    bound->gradient(q, alone);
    CHECK((alone - slope).norm() <= 1e-12 * (1.0 + slope.norm()));
  }
  CHECK(Cost().bind(chain) == nullptr);
  CHECK(Cost().empty());
  CHECK_THROWS_AS(-1.0 * Cost(NearHome{}), Error);
  CHECK_THROWS_AS(NAN * Cost(NearHome{}), Error);
}

TEST_CASE("costs without Hessians are for smooth motions alone") {
  const Chain& chain = test::arms().at("kuka_lbr_iiwa_14_r820");
  const Cost cost = NearHome{} + 3.0 * Cost(std::make_shared<Linear>(7));
  const BatchCostPtr bound = cost.bind(chain);
  const std::vector<double> q{0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0, 0, 0, 0, 0, 0, 1.0};
  std::vector<double> value(2), gradient(14);
  bound->evaluate(2, q.data(), value.data(), gradient.data());
  CHECK(value[0] == doctest::Approx(0.5 * 1.4 + 3.0 * 2.8));
  CHECK(value[1] == doctest::Approx(0.5 + 3.0));
  CHECK(gradient[2] == doctest::Approx(0.3 + 3.0));
  bound->evaluate(2, q.data(), value.data(), nullptr);
  CHECK(value[1] == doctest::Approx(0.5 + 3.0));
  CHECK_THROWS_WITH_AS(cost.bind_smooth(chain), doctest::Contains("Hessian"), Error);
  CHECK_THROWS_WITH_AS(Cost(std::make_shared<Linear>(6)).bind(chain), "the cost is for 6 joints, the chain has 7",
                       Error);
  CHECK_THROWS_WITH_AS(costs::Potential{}.bind(test::arms().at("ur10")), doctest::Contains("are not known"), Error);
  CHECK_THROWS_AS(costs::Collision{}.bind(chain), Error);
}

TEST_CASE("the planners in one call are the planners") {
  Random random(4);
  const Chain& chain = test::arms().at("kuka_lbr_iiwa_14_r820");
  const double k = reference_scale(chain);
  CHECK(costs::cached_reference_scale(chain) == k);
  CHECK(costs::cached_reference_scale(chain) == k);
  for (int trial = 0; trial < 5; ++trial) {
    const JointVector start = inside(random, chain), goal = inside(random, chain);
    const TimeOptimalProblem problem{start, goal, {}, {}, {}};
    TimeOptimal planner(chain, potential_cost(*SingularSets::of(chain)), {.time_weight = 600.0});
    CHECK(time_optimal(chain, problem, costs::Potential{}, {.time_weight = 600.0}).q == planner.plan(problem).q);
    SupportPlanner smooth(chain, geometry_aware_cost(chain, k), 21);
    CHECK(gradient(chain, start, goal, costs::GeometryAware{}).q == smooth.plan(start, goal, GradientOptions{}).q);
    CHECK(stochastic(chain, start, goal, costs::GeometryAware{}).q == smooth.plan(start, goal, StochasticOptions{}).q);
  }
  CHECK_THROWS_WITH_AS(gradient(chain, inside(random, chain), inside(random, chain), {}), "there is no cost", Error);
}

TEST_CASE("motions go to where a user's own cost is low") {
  Random random(6);
  const Chain& chain = test::arms().at("kuka_lbr_iiwa_14_r820");
  const JointVector start = inside(random, chain), goal = inside(random, chain);
  const auto length = [](const Trajectory& plan) {
    double sum = 0.0;
    for (const double q : plan.q) sum += q * q;
    return sum;
  };
  const Trajectory plain = gradient(chain, start, goal, costs::GeometryAware{});
  const Trajectory near = gradient(chain, start, goal, costs::GeometryAware{} + 100.0 * NearHome{});
  CHECK(length(near) < 0.8 * length(plain));
}

TEST_CASE("a time-optimal motion keeps clear of obstacles, or has failed") {
  Random random(8);
  const Chain& chain = test::arms().at("kuka_lbr_iiwa_14_r820");
  const ArmSpheres spheres = ArmSpheres::along_links(chain);
  int blocked = 0, round = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const JointVector start = inside(random, chain), goal = inside(random, chain);
    const DistanceField field = ball(pose(chain, 0.5 * (start + goal)).translation(), 0.12);
    const CollisionCheck check(spheres, field);
    const TimeOptimalProblem problem{start, goal, {}, {}, {}};
    if (std::min(min_distance(spheres, field, start), min_distance(spheres, field, goal)) < 0.02) continue;
    const Trajectory straight = time_optimal(chain, problem, {}, {.time_weight = 10.0});
    if (straight.status == PlanStatus::Failed || check.free(straight)) continue;
    ++blocked;
    const Trajectory plan = time_optimal(chain, problem, {}, {.time_weight = 10.0}, KeepClear{field, spheres});
    if (plan.status == PlanStatus::Failed) {
      CHECK(plan.t.empty());
      CHECK(plan.dof == 7);
      continue;
    }
    ++round;
    CHECK(check.free(plan));
  }
  CHECK(blocked > 10);
  CHECK(round > blocked / 3);
  const JointVector q = inside(random, chain);
  const DistanceField everywhere(std::vector<double>(8, -1.0), {2, 2, 2}, {-3.0, -3.0, -3.0}, 6.0);
  CHECK_THROWS_WITH_AS(time_optimal(chain, {q, q, {}, {}, {}}, {}, {}, KeepClear{everywhere, spheres}),
                       doctest::Contains("the start is in collision"), Error);
}
