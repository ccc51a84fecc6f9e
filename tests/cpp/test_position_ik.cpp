// Position inverse kinematics: solutions of the shipped and of random arms, exactly inside the limits; singular poses,
// poses out of reach, masks; the nearest solution and all solutions against the closed form; input that is refused.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <sigmaik/analytic_ik.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/position_ik.hpp>

#include "arms.hpp"
#include "configurations.hpp"
#include "heap.hpp"
#include "numbers.hpp"
#include "random.hpp"
#include "settling.hpp"

namespace {

using sigmaik::Chain;
using sigmaik::Frame;
using sigmaik::JointLimits;
using sigmaik::JointType;
using sigmaik::JointVector;
using sigmaik::Pose;
using sigmaik::PositionIk;
using sigmaik::PositionIkBranch;
using sigmaik::PositionIkOptions;
using sigmaik::PositionIkResult;
using sigmaik::PositionIkStatus;
using sigmaik::Segment;
using sigmaik::Twist;
using test::inside;
using test::kInfinity;
using test::kNan;
using test::Random;
using test::sample;

constexpr double kPi = std::numbers::pi;

static_assert(noexcept(std::declval<const PositionIk&>().solve(std::declval<const Pose&>())));
static_assert(noexcept(std::declval<const PositionIk&>().solve(std::declval<const Pose&>(),
                                                               std::declval<const sigmaik::JointRef&>())));

bool reaches(const Chain& chain, const JointVector& q, const Pose& target, double tolerance = 1e-6) {
  const Twist error = sigmaik::pose_error(pose(chain, q), target);
  return error.head<3>().norm() <= 1.001 * tolerance && error.tail<3>().norm() <= 1.001 * tolerance;
}

// A random arm, with position limits at about half of the joints that do not turn endlessly.
Chain limited_chain(Random& random, int n, double prismatic) {
  const Chain chain = random.chain(n, prismatic, 0.4);
  JointLimits limits = chain.limits();
  for (int i = 0; i < n; ++i) {
    const JointType type = chain.joint_types()[static_cast<std::size_t>(i)];
    if (type == JointType::Continuous) continue;
    if (type == JointType::Revolute && random.chance(0.5)) continue;
    const double middle = random.uniform(-1.0, 1.0),
                 half = type == JointType::Prismatic ? 0.5 : random.uniform(0.5, 4.0);
    limits.lower[i] = middle - half;
    limits.upper[i] = middle + half;
  }
  return chain.with_limits(limits);
}

double travel_time(const Chain& chain, const JointVector& q, const JointVector& near) {
  double most = 0.0;
  for (int i = 0; i < q.size(); ++i) {
    const double speed = chain.limits().velocity[i];
    most = std::max(most, std::abs(q[i] - near[i]) / (std::isfinite(speed) ? speed : 1.0));
  }
  return most;
}

// The largest difference of a joint, whole turns aside.
double apart(const JointVector& a, const JointVector& b) {
  return (a - b).unaryExpr([](double x) { return std::abs(x - 2.0 * kPi * std::round(x / (2.0 * kPi))); }).maxCoeff();
}

// Six joints, axes 2, 3, 4 parallel, axes 5 and 6 that meet, everything else at random.
Chain parallel_arm(Random& random) {
  const Eigen::Vector3d second = random.unit(3);
  Eigen::Vector3d axis[6], point[6];
  const auto oblique = [&](const Eigen::Vector3d& other) {
    for (;;) {
      const Eigen::Vector3d one = random.unit(3);
      if (one.cross(other).norm() > 0.5) return one;
    }
  };
  for (auto& p : point) p = 0.4 * Eigen::Vector3d(random.vector(3));
  axis[0] = oblique(second);
  axis[1] = second;
  axis[2] = random.chance(0.5) ? second : Eigen::Vector3d(-second);
  axis[3] = random.chance(0.5) ? second : Eigen::Vector3d(-second);
  axis[4] = oblique(second);
  axis[5] = oblique(axis[4]);
  point[5] = point[4] + random.normal() * 0.1 * axis[4];
  Pose last = Pose::Identity();
  std::vector<Segment> segments;
  for (int i = 0; i < 6; ++i) {
    Pose at = random.pose();
    at.translation() = point[i] + 0.1 * random.normal() * axis[i];
    Segment s;
    s.joint_name = "j" + std::to_string(i);
    s.link_name = "l" + std::to_string(i);
    s.type = JointType::Revolute;
    s.lower = -kPi;
    s.upper = kPi;
    s.origin = last.inverse() * at;
    s.axis = at.linear().transpose() * axis[i];
    last = at;
    segments.push_back(s);
  }
  Segment tool;
  tool.joint_name = "tool_joint";
  tool.link_name = "tool";
  tool.origin = random.pose(0.3);
  segments.push_back(tool);
  return Chain("base", segments);
}

Chain slider(double lower, double upper) {
  Segment s;
  s.joint_name = "slide";
  s.link_name = "tool";
  s.type = JointType::Prismatic;
  s.axis = Eigen::Vector3d::UnitX();
  s.lower = lower;
  s.upper = upper;
  return Chain("base", {s});
}

}  // namespace

// Solutions -----------------------------------------------------------------------------------------------------------

TEST_CASE("every pose of a configuration inside the limits is solved, on each shipped arm, exactly inside the limits") {
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    const Chain& chain = arm;
    CAPTURE(name);
    const PositionIk ik(chain);
    Random random(11);
    int exact = 0;
    constexpr int kCount = 2000;
    for (int k = 0; k < kCount; ++k) {
      const Pose target = pose(chain, sample(random, chain));
      const PositionIkResult found = ik.solve(target);
      REQUIRE(found.status == PositionIkStatus::Ok);
      REQUIRE(inside(chain, found.q));
      REQUIRE(reaches(chain, found.q, target));
      CHECK((found.error - sigmaik::pose_error(pose(chain, found.q), target)).norm() <= 1e-15);
      CHECK(found.solve_time > 0.0);
      exact += found.error.norm() < 1e-10;
    }
    CHECK(exact > 0.99 * kCount);  // the last step takes an error to rounding, not only below the tolerance
  }
}

TEST_CASE("poses at singularities are solved on each shipped arm: all zeros, a joint at zero, two joints at limits") {
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    const Chain& chain = arm;
    CAPTURE(name);
    const PositionIk ik(chain);
    Random random(12);
    const auto check = [&](JointVector q) {
      q = q.cwiseMax(chain.limits().lower).cwiseMin(chain.limits().upper);
      const Pose target = pose(chain, q);
      for (const PositionIkResult& found : {ik.solve(target), ik.solve(target, q)}) {
        CAPTURE(q.transpose());
        CHECK(found.status == PositionIkStatus::Ok);
        CHECK(inside(chain, found.q));
        CHECK(reaches(chain, found.q, target));
      }
    };
    check(JointVector::Zero(chain.dof()));
    for (int joint = 0; joint < chain.dof(); ++joint) {
      for (int k = 0; k < 5; ++k) {
        JointVector q = sample(random, chain);
        q[joint] = 0.0;
        check(q);
        q[random.integer(0, chain.dof() - 1)] = 0.0;
        check(q);
        q[joint] = chain.limits().upper[joint];
        if (!std::isfinite(q[joint])) q[joint] = kPi;
        const int other = random.integer(0, chain.dof() - 1);
        q[other] = chain.limits().lower[other];
        if (!std::isfinite(q[other])) q[other] = -kPi;
        check(q);
      }
    }
  }
}

TEST_CASE("a pose that is singular where two joints are at their limits is solved") {
  const Chain& chain = test::arms().at("franka_panda");
  JointVector q(7);
  q << -2.8973, -1.7628, 0.540053725, -0.460039968, 0.0, 1.28243577, 0.0;
  const PositionIkResult found = PositionIk(chain).solve(pose(chain, q));
  CHECK(found.status == PositionIkStatus::Ok);
  CHECK(inside(chain, found.q));
}

TEST_CASE("poses of random arms of 1 to 16 joints are solved, exactly inside the limits") {
  Random random(13);
  for (int n = 1; n <= 16; ++n) {
    for (int arm = 0; arm < 6; ++arm) {
      const Chain chain = limited_chain(random, n, arm < 3 ? 0.0 : 0.3);
      const PositionIk ik(chain);
      int solved = 0;
      for (int k = 0; k < 20; ++k) {
        const Pose target = pose(chain, sample(random, chain));
        const PositionIkResult found = ik.solve(target);
        CHECK(inside(chain, found.q));
        CHECK(reaches(chain, found.q, target) == (found.status == PositionIkStatus::Ok));
        solved += found.status == PositionIkStatus::Ok;
      }
      CAPTURE(n);
      CAPTURE(arm);
      CHECK(solved == 20);
    }
  }
}

TEST_CASE("poses of single precision are solved") {
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    const Chain& chain = arm;
    CAPTURE(name);
    const PositionIk ik(chain);
    Random random(15);
    for (int k = 0; k < 200; ++k) {
      const JointVector q = sample(random, chain);
      Pose target;
      target.matrix() = pose(chain, q).matrix().cast<float>().cast<double>();
      CHECK(ik.solve(target, q).status == PositionIkStatus::Ok);
      CHECK(ik.solve(target).status == PositionIkStatus::Ok);
    }
  }
}

TEST_CASE("an arm in millimetres has the same solutions as the arm in metres") {
  Random random(14);
  const Chain metres = test::arms().at("ur10");
  std::vector<Segment> segments = metres.segments();
  for (Segment& s : segments) s.origin.translation() *= 1000.0;
  const Chain millimetres(metres.base(), segments);
  const PositionIk small(metres), large(millimetres, {.tolerance = {1e-3, 1e-6}});
  for (int k = 0; k < 100; ++k) {
    const JointVector q = sample(random, metres);
    CHECK(apart(small.solve(pose(metres, q)).q, large.solve(pose(millimetres, q)).q) < 1e-6);
  }
}

// Near ----------------------------------------------------------------------------------------------------------------

TEST_CASE("with a closed form the answer has the least travel time of all branches and turns") {
  for (const char* const name : {"kuka_kr6_r900", "comau_racer_7_1_4", "puma560"}) {
    CAPTURE(name);
    const Chain& chain = test::arms().at(name);
    const PositionIk ik(chain);
    const sigmaik::AnalyticIk closed(chain);
    Random random(21);
    for (int k = 0; k < 300; ++k) {
      const Pose target = pose(chain, sample(random, chain));
      const JointVector near = sample(random, chain);
      double least = kInfinity;
      for (const auto& branch : closed.solve(target)) {
        double most = 0.0;
        for (int i = 0; i < 6; ++i) {
          double nearest = kInfinity;
          for (int turn = -2; turn <= 2; ++turn) {
            const double q = branch.q[i] + 2.0 * kPi * turn;
            if (q < chain.limits().lower[i] || q > chain.limits().upper[i]) continue;
            const double speed = chain.limits().velocity[i];
            nearest = std::min(nearest, std::abs(q - near[i]) / (std::isfinite(speed) ? speed : 1.0));
          }
          most = std::max(most, nearest);
        }
        least = std::min(least, most);
      }
      const PositionIkResult found = ik.solve(target, near);
      REQUIRE(found.status == PositionIkStatus::Ok);
      CHECK(travel_time(chain, found.q, near) <= least + 1e-9);
    }
  }
}

TEST_CASE("the answer is hardly ever farther from `near` than the configuration that made the pose") {
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    const Chain& chain = arm;
    CAPTURE(name);
    const PositionIk ik(chain);
    Random random(22);
    int farther = 0;
    constexpr int kCount = 200;
    for (int k = 0; k < kCount; ++k) {
      const JointVector q = sample(random, chain);
      JointVector near = q;
      for (int i = 0; i < near.size(); ++i) near[i] += random.uniform(-0.5, 0.5);
      near = near.cwiseMax(chain.limits().lower).cwiseMin(chain.limits().upper);
      const Pose target = pose(chain, q);
      const PositionIkResult found = ik.solve(target, near);
      REQUIRE(found.status == PositionIkStatus::Ok);
      REQUIRE(inside(chain, found.q));
      REQUIRE(reaches(chain, found.q, target));
      farther += travel_time(chain, found.q, near) > 1.1 * travel_time(chain, q, near) + 1e-6;
    }
    CHECK(farther <= 0.02 * kCount);
  }
}

TEST_CASE("a configuration is its own nearest solution") {
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    const Chain& chain = arm;
    CAPTURE(name);
    const PositionIk ik(chain);
    Random random(23);
    for (int k = 0; k < 100; ++k) {
      const JointVector q = sample(random, chain);
      CHECK((ik.solve(pose(chain, q), q).q - q).cwiseAbs().maxCoeff() < 1e-5);
    }
  }
}

TEST_CASE("continuous joints turn the short way round, however many turns `near` has") {
  const Chain& chain = test::arms().at("kinova_gen3_7dof");
  const PositionIk ik(chain);
  Random random(24);
  for (int k = 0; k < 50; ++k) {
    const JointVector q = sample(random, chain);
    JointVector near = q;
    for (int i = 0; i < 7; ++i) {
      if (chain.joint_types()[static_cast<std::size_t>(i)] == JointType::Continuous)
        near[i] += 2.0 * kPi * random.integer(-9, 9);
    }
    const PositionIkResult found = ik.solve(pose(chain, q), near);
    CHECK(found.status == PositionIkStatus::Ok);
    CHECK((found.q - near).cwiseAbs().maxCoeff() < 1e-5);
  }
}

// All solutions -------------------------------------------------------------------------------------------------------

TEST_CASE(
    "arms with three parallel axes, and axes 5 and 6 that meet: all solutions contain the configuration of the pose") {
  Random random(33);
  int singular = 0, whole = 0;
  for (int arm = 0; arm < 30; ++arm) {
    const Chain chain = parallel_arm(random);
    const PositionIk ik(chain);
    for (int k = 0; k < 20; ++k) {
      const JointVector q = sample(random, chain);
      const std::vector<PositionIkBranch> found = ik.solve_all(pose(chain, q));
      double nearest = kInfinity;
      for (const PositionIkBranch& branch : found) {
        REQUIRE(reaches(chain, branch.q, pose(chain, q), 1e-9));
        nearest = std::min(nearest, apart(branch.q, q));
      }
      singular += nearest > 1e-6;
      whole += found.size() == 8;
      const PositionIkResult near = ik.solve(pose(chain, q), q);
      CHECK(near.status == PositionIkStatus::Ok);
      CHECK((near.q - q).cwiseAbs().maxCoeff() < 1e-5);
    }
  }
  CHECK(singular <= 3);
  CHECK(whole > 60);  // of 600: eight solutions are usual for such arms
}

TEST_CASE(
    "the closed form of three parallel axes has as many solutions as the search of an arm that is almost the same") {
  const Chain& chain = test::arms().at("ur10");
  std::vector<Segment> segments = chain.segments();
  for (Segment& s : segments) {
    if (s.joint_name == chain.joint_names()[3]) s.axis = (s.axis + 1e-7 * s.axis.unitOrthogonal()).normalized();
  }
  const PositionIk closed(chain), search(Chain(chain.base(), segments));
  Random random(34);
  int different = 0;
  for (int k = 0; k < 100; ++k) {
    const Pose target = pose(chain, sample(random, chain));
    different += closed.solve_all(target).size() != search.solve_all(target).size();
  }
  CHECK(different <= 6);
}

TEST_CASE("all solutions are distinct, inside the limits, and the one with the largest margin comes first") {
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    const Chain& chain = arm;
    CAPTURE(name);
    const PositionIk ik(chain);
    Random random(31);
    for (int k = 0; k < 20; ++k) {
      const Pose target = pose(chain, sample(random, chain));
      const std::vector<PositionIkBranch> found = ik.solve_all(target);
      REQUIRE(!found.empty());
      for (std::size_t i = 0; i < found.size(); ++i) {
        CHECK(inside(chain, found[i].q));
        CHECK(reaches(chain, found[i].q, target));
        CHECK(found[i].sigma_min >= 0.0);
        const double margin = std::min((found[i].q - chain.limits().lower).minCoeff(),
                                       (chain.limits().upper - found[i].q).minCoeff());
        CHECK(found[i].margin == margin);
        if (i > 0) CHECK(found[i].margin <= found[i - 1].margin);
        for (std::size_t j = 0; j < i; ++j) CHECK(apart(found[i].q, found[j].q) > 1e-2);
      }
    }
  }
}

TEST_CASE("all solutions of an arm of six joints contain the configuration that made the pose") {
  for (const char* const name : {"ur10", "kuka_kr6_r900", "puma560", "comau_racer_7_1_4"}) {
    CAPTURE(name);
    const Chain& chain = test::arms().at(name);
    const PositionIk ik(chain);
    Random random(32);
    int missed = 0;
    for (int k = 0; k < 100; ++k) {
      const JointVector q = sample(random, chain);
      double nearest = kInfinity;
      for (const PositionIkBranch& branch : ik.solve_all(pose(chain, q)))
        nearest = std::min(nearest, apart(branch.q, q));
      missed += nearest > 1e-3;
    }
    CHECK(missed <= 1);
  }
}

// Out of reach --------------------------------------------------------------------------------------------------------

TEST_CASE("out of reach the answer is the nearest pose: a slider stops at its limit exactly") {
  const Chain chain = slider(-0.3, 0.5);
  const PositionIk ik(chain);
  for (const double x : {-2.0, -0.3, 0.1, 0.5, 0.7}) {
    Pose target = Pose::Identity();
    target.translation().x() = x;
    const PositionIkResult found = ik.solve(target);
    CHECK(found.status == (x >= -0.3 && x <= 0.5 ? PositionIkStatus::Ok : PositionIkStatus::Unreachable));
    CHECK(found.q[0] == doctest::Approx(std::clamp(x, -0.3, 0.5)));
    CHECK(inside(chain, found.q));
  }
}

TEST_CASE("far out of reach each shipped arm points at the target, and says that it is unreachable") {
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    const Chain& chain = arm;
    CAPTURE(name);
    const PositionIk ik(chain, {.task = {{true, true, true, false, false, false}}});
    Random random(41);
    double reach = 0.0;
    for (int k = 0; k < 20000; ++k) reach = std::max(reach, pose(chain, sample(random, chain)).translation().norm());
    for (int k = 0; k < 5; ++k) {
      Pose target = Pose::Identity();
      target.translation() << 5.0 * std::cos(1.3 * k - 2.6), 5.0 * std::sin(1.3 * k - 2.6), 2.0;
      const PositionIkResult found = ik.solve(target);
      CHECK(found.status == PositionIkStatus::Unreachable);
      CHECK(inside(chain, found.q));
      CHECK(found.error.tail<3>().norm() == 0.0);
      // No tip of many random configurations is nearer.
      double least = kInfinity;
      for (int i = 0; i < 5000; ++i) {
        least = std::min(least, (pose(chain, sample(random, chain)).translation() - target.translation()).norm());
      }
      CHECK(found.error.head<3>().norm() <= least + 1e-9);
    }
  }
}

TEST_CASE("whole poses of an arm with few joints are unreachable, and no other configuration is nearer") {
  Random random(42);
  for (int trial = 0; trial < 100; ++trial) {
    const int n = 1 + trial % 5;
    const Chain chain = limited_chain(random, n, 0.2);
    const PositionIk ik(chain);
    CAPTURE(trial);
    const double length = chain.characteristic_length();
    const auto distance = [&](const Twist& error) {
      return std::hypot(error.head<3>().norm() / length, error.tail<3>().norm());
    };
    for (int k = 0; k < 5; ++k) {
      CAPTURE(k);
      const Pose target = random.pose();
      const PositionIkResult found = ik.solve(target);
      CHECK(found.status == PositionIkStatus::Unreachable);
      CHECK(inside(chain, found.q));
      double least = kInfinity;
      for (int i = 0; i < 2000; ++i) {
        least = std::min(least, distance(sigmaik::pose_error(pose(chain, sample(random, chain)), target)));
      }
      CHECK(distance(found.error) <= least + 1e-6);
      for (int i = 0; i < 200; ++i) {  // a minimum: no small motion inside the limits comes closer
        const JointVector q = (found.q + 1e-4 * JointVector(random.unit(n)))
                                  .cwiseMax(chain.limits().lower)
                                  .cwiseMin(chain.limits().upper);
        CHECK(distance(sigmaik::pose_error(pose(chain, q), target)) >= distance(found.error) - 1e-9);
      }
    }
  }
}

// Masks ---------------------------------------------------------------------------------------------------------------

TEST_CASE("rows that the mask leaves out are free, in base axes and in the tool's") {
  Random random(51);
  for (const char* const name : {"ufactory_xarm7", "ur10", "puma560"}) {
    const Chain& chain = test::arms().at(name);
    for (const Frame frame : {Frame::Base, Frame::Tool}) {
      for (int bits = 1; bits < 63; ++bits) {
        PositionIkOptions options;
        options.task.frame = frame;
        for (std::size_t i = 0; i < 6; ++i) options.task.mask[i] = (bits >> i & 1) != 0;
        const PositionIk ik(chain, options);
        for (int k = 0; k < 3; ++k) {
          const JointVector q = sample(random, chain);
          const Pose target = pose(chain, q);
          CAPTURE(name);
          CAPTURE(bits);
          CAPTURE(frame == Frame::Tool);
          const PositionIkResult found = ik.solve(target);
          CHECK(found.status == PositionIkStatus::Ok);
          CHECK(inside(chain, found.q));
          const Pose tip = pose(chain, found.q);
          const sigmaik::TaskVector rows = select_rows(options.task, tip.linear(), sigmaik::pose_error(tip, target));
          CHECK(rows.norm() <= 2e-6);
          CHECK((found.error - expand_rows(options.task, tip.linear(), rows)).norm() <= 1e-15);
        }
      }
    }
  }
}

// The rest ------------------------------------------------------------------------------------------------------------

TEST_CASE("a target that is a half turn away is solved") {
  for (const char* const name : {"ufactory_xarm7", "ur10", "kuka_kr6_r900"}) {
    const Chain& chain = test::arms().at(name);
    const PositionIk ik(chain);
    Random random(61);
    for (int k = 0; k < 100; ++k) {
      JointVector q = sample(random, chain);
      q[chain.dof() - 1] = 0.5 * kPi;
      const Pose target = pose(chain, q);
      q[chain.dof() - 1] = -0.5 * kPi;
      const PositionIkResult found = ik.solve(target, q);
      CHECK(found.status == PositionIkStatus::Ok);
      CHECK(reaches(chain, found.q, target));
    }
  }
}

TEST_CASE("answers are the same in every call, in a copy, in a batch and in any number of threads") {
  const Chain& chain = test::arms().at("franka_panda");
  const PositionIk ik(chain);
  const PositionIk copy = ik;
  const PositionIk again(chain);
  Random random(62);
  constexpr int kCount = 40;
  std::vector<double> poses, one(7 * kCount), two(7 * kCount);
  std::vector<PositionIkStatus> status(kCount);
  std::vector<JointVector> q;
  for (int k = 0; k < kCount; ++k) {
    Pose target = pose(chain, sample(random, chain));
    if (k == 3) target.translation().x() += 7.0;
    if (k == 4) target.matrix()(0, 0) = kNan;
    q.push_back(ik.solve(target).q);
    CHECK(copy.solve(target).q == q.back());
    CHECK(again.solve(target).q == q.back());
    for (int i = 0; i < 16; ++i) poses.push_back(target.matrix()(i / 4, i % 4));
  }
  ik.solve_batch(kCount, poses.data(), one.data(), status.data(), 1);
  ik.solve_batch(kCount, poses.data(), two.data(), nullptr, 3);
  for (int k = 0; k < kCount; ++k) {
    const Eigen::Map<const Eigen::VectorXd> first(one.data() + 7 * k, 7), second(two.data() + 7 * k, 7);
    const PositionIkStatus expected = k == 3   ? PositionIkStatus::Unreachable
                                      : k == 4 ? PositionIkStatus::BadInput
                                               : PositionIkStatus::Ok;
    CHECK(status[static_cast<std::size_t>(k)] == expected);
    if (expected == PositionIkStatus::Ok) {
      CHECK(first == q[static_cast<std::size_t>(k)]);
      CHECK(second == first);
    } else {
      CHECK(first.array().isNaN().all());
      CHECK(second.array().isNaN().all());
    }
  }
  CHECK_THROWS_AS(ik.solve_batch(kCount, poses.data(), one.data(), nullptr, 0), sigmaik::Error);
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("no call of solve() touches the heap") {
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    const Chain& chain = arm;
    CAPTURE(name);
    const PositionIk ik(chain);
    Random random(63);
    const JointVector near = sample(random, chain);
    Pose target = pose(chain, sample(random, chain)), far = target;
    far.translation().x() += 5.0;
    const test::HeapWatch watch;
    const PositionIkResult first = ik.solve(target), second = ik.solve(target, near), third = ik.solve(far, near);
    CHECK(watch.calls() == 0);
    CHECK(first.status == PositionIkStatus::Ok);
    CHECK(second.status == PositionIkStatus::Ok);
    CHECK(third.status == PositionIkStatus::Unreachable);
  }
}
#endif

TEST_CASE("bad input has the status BadInput, and no answer") {
  const Chain& chain = test::arms().at("ur10");
  const PositionIk ik(chain);
  const JointVector q = JointVector::Constant(6, 0.3);
  const Pose good = pose(chain, q);
  const auto refused = [](const PositionIkResult& result) {
    return result.status == PositionIkStatus::BadInput && result.q.size() == 0;
  };
  for (const double value : {kNan, kInfinity}) {
    Pose bad = good;
    bad.matrix()(1, 3) = value;
    CHECK(refused(ik.solve(bad)));
    CHECK(refused(ik.solve(bad, q)));
    CHECK_THROWS_AS(ik.solve_all(bad), sigmaik::Error);
    JointVector near = q;
    near[2] = value;
    CHECK(refused(ik.solve(good, near)));
  }
  Pose scaled = good;
  scaled.linear() *= 1.1;
  CHECK(refused(ik.solve(scaled)));
  Pose far = good;
  far.translation().x() = 1e300;
  CHECK(refused(ik.solve(far)));
  CHECK_THROWS_AS(ik.solve_all(far), sigmaik::Error);
  far.translation().x() = 9e8;
  CHECK(ik.solve(far).status == PositionIkStatus::Unreachable);
  CHECK(refused(ik.solve(good, JointVector::Zero(5))));
  CHECK(refused(ik.solve(good, JointVector::Constant(6, 1e10))));
}

TEST_CASE("options out of their range are refused, with the value") {
  const Chain& chain = test::arms().at("ur10");
  CHECK_THROWS_WITH_AS(PositionIk(chain, {.tolerance = {0.0, 1e-6}}), doctest::Contains("tolerance"), sigmaik::Error);
  CHECK_THROWS_WITH_AS(PositionIk(chain, {.tolerance = {1e-6, kNan}}), doctest::Contains("tolerance"), sigmaik::Error);
  CHECK_THROWS_WITH_AS(PositionIk(chain, {.starts = 0}), doctest::Contains("starts = 0"), sigmaik::Error);
  CHECK_THROWS_WITH_AS(PositionIk(chain, {.starts = 2049}), doctest::Contains("starts = 2049"), sigmaik::Error);
  CHECK_THROWS_AS(PositionIk(chain, {.task = {{false, false, false, false, false, false}}}), sigmaik::Error);
}

TEST_CASE("every status has a text") {
  CHECK(std::string(to_string(PositionIkStatus::Ok)) == "ok");
  CHECK(std::string(to_string(PositionIkStatus::Unreachable)) == "unreachable");
  CHECK(std::string(to_string(PositionIkStatus::BadInput)) == "bad input");
}

TEST_CASE("near a solution with joints at their limits is this solution") {
  for (const char* name : {"ur10", "kuka_kr6_r900", "ufactory_xarm7"}) {
    const Chain& chain = test::arms().at(name);
    const PositionIk ik(chain);
    test::Random random(12);
    for (int trial = 0; trial < 100; ++trial) {
      CAPTURE(name);
      CAPTURE(trial);
      JointVector q = test::start_of(random, chain, 0.9);
      for (int i = 0; i < chain.dof(); ++i) {
        const double limit = random.chance(0.5) ? chain.limits().lower[i] : chain.limits().upper[i];
        if (random.chance(0.4) && std::isfinite(limit)) q[i] = limit;
      }
      const PositionIkResult found = ik.solve(pose(chain, q), q);
      REQUIRE(found.status == PositionIkStatus::Ok);
      CHECK((found.q - q).cwiseAbs().maxCoeff() < 1e-3);
    }
  }
}
