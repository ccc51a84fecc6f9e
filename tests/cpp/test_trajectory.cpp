#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <string>

#include <sigmaik/error.hpp>
#include <sigmaik/indices.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/planning/collision_costs.hpp>
#include <sigmaik/planning/costs.hpp>
#include <sigmaik/planning/play.hpp>
#include <sigmaik/planning/support_states.hpp>
#include <sigmaik/planning/time_optimal.hpp>
#include <sigmaik/planning/trajectory.hpp>
#include <sigmaik/pose.hpp>

#include "arms.hpp"
#include "random.hpp"

using namespace sigmaik;
using namespace sigmaik::planning;
using test::Random;

namespace {

JointVector inside(Random& random, const Chain& chain, double share = 0.8) {
  JointVector q(chain.dof());
  for (int i = 0; i < q.size(); ++i) {
    const double low = std::max(chain.limits().lower[i], -M_PI), high = std::min(chain.limits().upper[i], M_PI);
    q[i] = low + (0.5 + share * random.uniform(-0.5, 0.5)) * (high - low);
  }
  return q;
}

Chain arm(const std::string& name) {
  const Chain& chain = test::arms().at(name);
  JointLimits limits = chain.limits();
  for (double& a : limits.acceleration) a = std::min(a, 10.0);
  return chain.with_limits(limits);
}

// A smooth cubic between these two positions, whose position, velocity and acceleration are known anywhere.
Trajectory cubic(double from, double to, double duration, int samples) {
  Trajectory out;
  out.dof = 1;
  out.cubic = true;
  out.duration = duration;
  out.status = PlanStatus::Feasible;
  out.cost = 1.0;
  for (int k = 0; k < samples; ++k) {
    const double t = duration * k / (samples - 1), s = t / duration, d = to - from;
    out.t.push_back(t);
    out.q.push_back(from + d * s * s * (3.0 - 2.0 * s));
    out.qdot.push_back(6.0 * d * s * (1.0 - s) / duration);
    out.qddot.push_back(6.0 * d * (1.0 - 2.0 * s) / (duration * duration));
  }
  return out;
}

JointVector row(const std::vector<double>& rows, std::size_t k, int n) {
  return Eigen::Map<const Eigen::VectorXd>(rows.data() + k * static_cast<std::size_t>(n), n);
}

}  // namespace

TEST_CASE("samples between the nodes are exact, and the ends are held") {
  const Trajectory plan = cubic(-1.0, 2.0, 4.0, 5), fine = cubic(-1.0, 2.0, 4.0, 401);
  const JointSamples got = plan.sample(fine.t);
  for (std::size_t k = 0; k < fine.size(); ++k) {
    CHECK(got.q[k] == doctest::Approx(fine.q[k]).epsilon(1e-12));
    CHECK(got.qdot[k] == doctest::Approx(fine.qdot[k]).epsilon(1e-12));
    CHECK(got.qddot[k] == doctest::Approx(fine.qddot[k]).epsilon(1e-12));
  }
  CHECK(plan.sample({-3.0, 9.0}).q == std::vector<double>{plan.q.front(), plan.q.back()});

  Trajectory steps;  // q̈ = 2, then −2
  steps.dof = 1;
  steps.t = {0.0, 1.0, 2.0};
  steps.q = {0.0, 1.0, 2.0};
  steps.qdot = {0.0, 2.0, 0.0};
  steps.qddot = {2.0, -2.0, 0.0};
  const JointSamples half = steps.sample({0.5, 1.5});
  CHECK(half.q == std::vector<double>{0.25, 1.75});
  CHECK(half.qdot == std::vector<double>{1.0, 1.0});
  CHECK(half.qddot == std::vector<double>{2.0, -2.0});
}

TEST_CASE("the same path in another time") {
  const Trajectory plan = cubic(0.0, 1.0, 2.0, 7), slow = plan.retimed(6.0);
  CHECK(slow.duration == 6.0);
  CHECK(slow.q == plan.q);
  const JointSamples a = plan.sample({0.3}), b = slow.sample({0.9});
  CHECK(b.q[0] == doctest::Approx(a.q[0]));
  CHECK(b.qdot[0] == doctest::Approx(a.qdot[0] / 3.0));
  CHECK(b.qddot[0] == doctest::Approx(a.qddot[0] / 9.0));
  CHECK_THROWS_AS(plan.retimed(0.0), Error);
  CHECK_THROWS_AS(plan.retimed(std::numeric_limits<double>::infinity()), Error);
  CHECK_THROWS_WITH_AS(Trajectory().sample({0.0}), "this trajectory is empty: its plan failed", Error);
  CHECK_THROWS_AS(plan.sample({NAN}), Error);
  Trajectory odd = plan;
  odd.qdot.pop_back();
  CHECK_THROWS_AS(odd.sample({0.0}), Error);
}

TEST_CASE("a file has every digit, and anything else is refused") {
  Random random(3);
  const Chain chain = arm("franka_panda");
  TimeOptimal planner(chain, nullptr, {.nodes = 8});
  const Trajectory plan = planner.plan({inside(random, chain), inside(random, chain), {}, {}, {}});
  REQUIRE(plan.status == PlanStatus::Optimal);
  const std::string file = "test_trajectory.csv";
  plan.save(file);
  const Trajectory again = Trajectory::load(file);
  CHECK(again.t == plan.t);
  CHECK(again.q == plan.q);
  CHECK(again.qdot == plan.qdot);
  CHECK(again.qddot == plan.qddot);
  CHECK(again.duration == plan.duration);
  CHECK(again.cost == plan.cost);
  CHECK(again.iterations == plan.iterations);
  CHECK(again.status == plan.status);
  CHECK(again.cubic == plan.cubic);

  Trajectory failed;
  failed.dof = 7;
  failed.save(file);
  CHECK(Trajectory::load(file).t.empty());
  CHECK(std::isnan(Trajectory::load(file).cost));

  for (const char* text : {"", "t,q1\n", "# sigmaik trajectory 1\n# dof 1\nt,q1,qdot1,qddot1\n0,1,2\n",
                           "# sigmaik trajectory 1\n# dof 1\nt,q1,qdot1,qddot1\n0,1,2,x\n",
                           "# sigmaik trajectory 1\n# dof x\n", "# sigmaik trajectory 1\nt,q1\n"}) {
    std::ofstream(file) << text;
    CHECK_THROWS_AS(Trajectory::load(file), Error);
  }
  std::remove(file.c_str());
  CHECK_THROWS_AS(Trajectory::load(file), Error);
  CHECK_THROWS_AS(plan.save("no/such/folder/plan.csv"), Error);
  CHECK(!std::ifstream("no/such/folder/plan.csv.part"));
}

TEST_CASE("clearance finds the walls that a path has to cross, and those that it need not") {
  const Chain chain = arm("kuka_lbr_iiwa_14_r820");
  const std::optional<SingularSets> sets = SingularSets::of(chain);
  REQUIRE(sets);
  int elbow = 0;
  while (sets->set(elbow).name != "elbow") ++elbow;
  REQUIRE(sets->set(elbow).codimension == 1);
  JointVector bent(7);
  bent << 0.1, 0.5, 0.1, 1.2, 0.1, 0.8, 0.1;
  JointVector other = bent;
  other[3] = -1.2;
  const auto path = [&](const std::vector<JointVector>& corners) {
    std::vector<double> q;
    for (std::size_t c = 0; c + 1 < corners.size(); ++c) {
      for (int i = 0; i < 20; ++i) {
        const JointVector at = corners[c] + i / 19.0 * (corners[c + 1] - corners[c]);
        q.insert(q.end(), at.data(), at.data() + 7);
      }
    }
    std::vector<double> t;
    for (std::size_t k = 0; k < q.size() / 7; ++k) t.push_back(static_cast<double>(k));
    return clearance(chain, sets, t, q);
  };
  const Clearance once = path({bent, other});
  REQUIRE(once.crossings.size() == 1);
  CHECK(once.crossings[0].name == "elbow");
  CHECK(!once.crossings[0].avoidable);
  CHECK(once.crossings[0].t == doctest::Approx(9.5));
  CHECK(std::abs(once.crossings[0].q[3]) < 1e-12);
  const Clearance there_and_back = path({bent, other, bent});
  REQUIRE(there_and_back.crossings.size() == 2);
  CHECK(there_and_back.crossings[0].avoidable);
  CHECK(there_and_back.crossings[1].avoidable);
  CHECK(there_and_back.min_psi() < 0.01);
  CHECK(there_and_back.names[static_cast<std::size_t>(there_and_back.nearest_set())] == "elbow");
  CHECK(there_and_back.min_manipulability() ==
        *std::min_element(there_and_back.manipulability.begin(), there_and_back.manipulability.end()));

  // An arm whose sets are not known has the manipulability alone.
  const Chain& plain = test::arms().at("ufactory_xarm7");
  const Clearance bare = clearance(plain, SingularSets::of(plain), {0.0}, std::vector<double>(7, 0.3));
  CHECK(bare.names.empty());
  CHECK(bare.nearest_set() == -1);
  ChainState state;
  update(plain, JointVector::Constant(7, 0.3), state);
  CHECK(bare.manipulability[0] == doctest::Approx(manipulability(state.jacobian)));
  CHECK_THROWS_AS(clearance(chain, sets, {0.0, 1.0}, std::vector<double>(7, 0.0)), Error);
}

TEST_CASE("a plan with an avoidable crossing is tried from the other side") {
  Random random(11);
  int entered = 0, better = 0;
  for (const char* name : {"kuka_lbr_iiwa_14_r820", "franka_panda", "comau_racer_7_1_4"}) {
    const Chain chain = arm(name);
    TimeOptimal planner(chain, potential_cost(*SingularSets::of(chain)), {.time_weight = 600.0});
    for (int trial = 0; trial < 300; ++trial) {
      const TimeOptimalProblem problem{inside(random, chain, 1.0), inside(random, chain, 1.0), {}, {}, {}};
      const TimeOptimalResult nodes = planner.solve(problem);
      const Trajectory best = planner.plan(problem);
      REQUIRE(best.status != PlanStatus::Failed);
      REQUIRE(best.clearance);
      if (best.starts == nodes.starts) {
        CHECK(best.q == nodes.q);
        CHECK(std::none_of(best.clearance->crossings.begin(), best.clearance->crossings.end(),
                           [](const Crossing& c) { return c.avoidable; }));
        continue;
      }
      ++entered;
      if (best.q != nodes.q) ++better;
    }
  }
  CHECK(entered > 0);
  CHECK(better > 0);
}

TEST_CASE("a smooth motion keeps the limits between its states, in the shortest time") {
  Random random(5);
  for (const char* name : {"franka_panda", "ur10"}) {
    const Chain chain = arm(name);
    SupportPlanner planner(chain, log_manipulability_cost(chain), 21);
    for (int trial = 0; trial < 10; ++trial) {
      const JointVector start = inside(random, chain, 1.0), goal = inside(random, chain, 1.0);
      const Trajectory plan = planner.plan(start, goal, GradientOptions{});
      REQUIRE(plan.status != PlanStatus::Failed);
      CHECK(plan.cubic);
      CHECK(plan.clearance);
      std::vector<double> t;
      for (int k = 0; k <= 4000; ++k) t.push_back(plan.duration * k / 4000.0);
      const JointSamples samples = plan.sample(t);
      double used = 0.0;
      for (std::size_t k = 0; k < t.size(); ++k) {
        const JointVector q = row(samples.q, k, chain.dof());
        CHECK((q.array() >= chain.limits().lower.array() - 1e-9).all());
        CHECK((q.array() <= chain.limits().upper.array() + 1e-9).all());
        used = std::max(
            {used, (row(samples.qdot, k, chain.dof()).cwiseAbs().array() / chain.limits().velocity.array()).maxCoeff(),
             (row(samples.qddot, k, chain.dof()).cwiseAbs().array() / chain.limits().acceleration.array()).maxCoeff()});
      }
      CHECK(used <= 1.0 + 1e-9);
      CHECK(used > 1.0 - 1e-3);  // a limit is reached: it is the shortest
      GradientOptions slow;
      slow.duration = 7.0;
      CHECK(planner.plan(start, goal, slow).duration == 7.0);
    }
    GradientOptions bad;
    bad.duration = -1.0;
    CHECK_THROWS_AS(planner.plan(inside(random, chain), inside(random, chain), bad), Error);
    bad = {};
    bad.restarts = -1;
    CHECK_THROWS_AS(planner.plan(inside(random, chain), inside(random, chain), bad), Error);
  }
}

TEST_CASE("a motion round an obstacle touches nothing, by restarts where it must") {
  // A ball at the place to which the straight line leads the tip, with margins at both ends.
  Random random(2);
  const Chain chain = arm("kuka_lbr_iiwa_14_r820");
  const ArmSpheres spheres = ArmSpheres::along_links(chain);
  int blocked = 0, found = 0, restarted = 0;
  for (int trial = 0; trial < 120; ++trial) {
    const JointVector start = inside(random, chain), goal = inside(random, chain);
    const Eigen::Vector3d center = pose(chain, 0.5 * (start + goal)).translation();
    std::vector<double> distances;
    const int nodes = 60;
    const double cell = 0.04, half = 0.5 * cell * (nodes - 1);
    for (int i = 0; i < nodes; ++i) {
      for (int j = 0; j < nodes; ++j) {
        for (int k = 0; k < nodes; ++k) {
          distances.push_back((Eigen::Vector3d(i, j, k) * cell - Eigen::Vector3d::Constant(half)).norm() - 0.22);
        }
      }
    }
    const DistanceField field(distances, {nodes, nodes, nodes}, center - Eigen::Vector3d::Constant(half), cell);
    const CollisionCheck check(spheres, field);
    if (std::min(min_distance(spheres, field, start), min_distance(spheres, field, goal)) < 0.02) continue;
    ++blocked;
    SupportPlanner planner(
        chain, sum_of_costs({log_manipulability_cost(chain), collision_cost(spheres, field, 0.05, 1e4)}), 21, check);
    GradientOptions once;
    once.restarts = 0;
    const Trajectory first = planner.plan(start, goal, once), best = planner.plan(start, goal, GradientOptions{});
    if (first.status != PlanStatus::Failed) CHECK(best.q == first.q);
    restarted += first.status == PlanStatus::Failed && best.status != PlanStatus::Failed ? 1 : 0;
    if (best.status == PlanStatus::Failed) {
      CHECK(best.t.empty());
      CHECK(!best.clearance);
      continue;
    }
    ++found;
    std::vector<double> t;
    for (int k = 0; k <= 1000; ++k) t.push_back(best.duration * k / 1000.0);
    CHECK(check.least_distance(t.size(), best.sample(t).q.data()) > -1e-3);
  }
  CHECK(blocked > 10);
  CHECK(found > blocked / 2);
  CHECK(restarted > 0);

  const DistanceField everywhere(std::vector<double>(8, -1.0), {2, 2, 2}, {-3.0, -3.0, -3.0}, 6.0);
  SupportPlanner stuck(chain, log_manipulability_cost(chain), 21, CollisionCheck(spheres, everywhere));
  const JointVector q = inside(random, chain);
  CHECK_THROWS_WITH_AS(stuck.plan(q, q, GradientOptions{}), doctest::Contains("the start is in collision"), Error);
}

TEST_CASE("the samples' motion is no worse after refinement") {
  Random random(9);
  const Chain chain = arm("franka_panda");
  SupportPlanner planner(chain, log_manipulability_cost(chain), 21);
  const JointVector start = inside(random, chain), goal = inside(random, chain);
  StochasticOptions options;
  const Trajectory rough = planner.plan(start, goal, options), same = planner.plan(start, goal, options);
  CHECK(rough.status == PlanStatus::Feasible);
  CHECK(rough.q == same.q);
  options.refine = true;
  const Trajectory fine = planner.plan(start, goal, options);
  CHECK(fine.cost <= rough.cost);
  CHECK(fine.status == PlanStatus::Optimal);
}

TEST_CASE("a plan played through a servo") {
  const Chain chain = arm("franka_panda");
  JointVector start(7), goal(7);
  start << 0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785;
  goal = start;
  goal.array() += 0.2;
  TimeOptimal planner(chain, nullptr, {.time_weight = 10.0});
  const Trajectory plan = planner.plan({start, goal, {}, {}, {}});
  Servo servo(chain, JParse{}, {.soft_start = 0.0});
  CHECK_THROWS_WITH_AS(play(plan, servo), "the servo has no start: call reset(q) first", Error);
  servo.reset(start);
  const Playback done = play(plan, servo, 1.0);
  CHECK(done.size() == done.status.size() + 1);
  CHECK(done.t.back() >= plan.t.back() + 1.0 - 1e-9);
  CHECK(done.q.size() == done.planned.size());
  CHECK(done.qdot.size() == done.planned.size());
  CHECK(done.pose_error.size() == 6 * done.size());
  CHECK(done.planned == plan.sample(done.t).q);
  CHECK(row(done.q, done.size() - 1, 7) == servo.q());
  CHECK(std::all_of(done.status.begin(), done.status.end(), [](Status s) { return s == Status::Ok; }));
  CHECK(done.max_position_error() < 5e-4);
  CHECK(done.max_orientation_error() < 2e-3);
  double difference = 0.0;
  for (std::size_t i = 0; i < done.q.size(); ++i)
    difference = std::max(difference, std::abs(done.planned[i] - done.q[i]));
  CHECK(done.max_joint_difference() == difference);
  // Each error is the planned pose minus the servo's at that time.
  const std::size_t k = done.size() / 2;
  const Twist error = pose_error(pose(chain, row(done.q, k, 7)), pose(chain, row(done.planned, k, 7)));
  for (std::size_t i = 0; i < 6; ++i) CHECK(done.pose_error[6 * k + i] == doctest::Approx(error[static_cast<int>(i)]));

  CHECK_THROWS_WITH_AS(play(plan, servo), doctest::Contains("the servo stands at"), Error);
  servo.reset(start);
  CHECK_THROWS_WITH_AS(play(plan, servo, -1.0), doctest::Contains("settle"), Error);
  CHECK_THROWS_WITH_AS(play(cubic(0.0, 1.0, 1.0, 3), servo), doctest::Contains("1 joints"), Error);
  Trajectory failed;
  failed.dof = 7;
  CHECK_THROWS_WITH_AS(play(failed, servo), doctest::Contains("empty"), Error);
  CHECK(servo.q() == start);
}
