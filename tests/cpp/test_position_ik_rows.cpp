// What PositionIk counts of a pose error: ranges, a cone about an axis, exact rows. Derivatives against differences;
// poses inside ranges are solved; of poses out of reach the exact rows are met, and no other configuration is nearer.

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include <sigmaik/error.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/position_ik.hpp>

#include "../../cpp/src/position_ik_rows.hpp"
#include "arms.hpp"
#include "configurations.hpp"
#include "heap.hpp"
#include "numbers.hpp"
#include "random.hpp"

namespace {

using sigmaik::Chain;
using sigmaik::Frame;
using sigmaik::JointLimits;
using sigmaik::JointType;
using sigmaik::JointVector;
using sigmaik::Pose;
using sigmaik::PositionIk;
using sigmaik::PositionIkOptions;
using sigmaik::PositionIkResult;
using sigmaik::PositionIkStatus;
using sigmaik::ToolCone;
using sigmaik::Twist;
using sigmaik::detail::Matrix6;
using sigmaik::detail::PoseRows;
using sigmaik::detail::Row6;
using sigmaik::detail::RowErrors;
using test::inside;
using test::kInfinity;
using test::kNan;
using test::Random;
using test::sample;

constexpr double kPi = std::numbers::pi;
constexpr double kTolerance = 1.001e-6;
constexpr std::array<bool, 6> kPosition{true, true, true, false, false, false};
constexpr std::array<bool, 6> kOrientation{false, false, false, true, true, true};

// A random arm with position limits at every joint that does not turn endlessly.
Chain limited_chain(Random& random, int n, double prismatic) {
  const Chain chain = random.chain(n, prismatic, 0.4);
  JointLimits limits = chain.limits();
  for (int i = 0; i < n; ++i) {
    const JointType type = chain.joint_types()[static_cast<std::size_t>(i)];
    if (type == JointType::Continuous) continue;
    const double middle = random.uniform(-1.0, 1.0);
    const double half = type == JointType::Prismatic ? 0.5 : random.uniform(0.5, 2.5);
    limits.lower[i] = middle - half;
    limits.upper[i] = middle + half;
  }
  return chain.with_limits(limits);
}

Eigen::Vector3d direction(Random& random) { return random.unit(3); }

PositionIkOptions random_ranges(Random& random) {
  PositionIkOptions options;
  options.task.frame = random.chance(0.5) ? Frame::Base : Frame::Tool;
  for (std::size_t i = 0; i < 6; ++i) {
    if (random.chance(0.4)) continue;
    options.ranges[i][0] = -random.decades(-3.0, -0.5);
    options.ranges[i][1] = random.chance(0.2) ? 0.0 : random.decades(-3.0, -0.5);
  }
  return options;
}

// Any options: ranges and rows that are left out or exact, or a cone.
PositionIkOptions random_options(Random& random) {
  PositionIkOptions options = random_ranges(random);
  for (std::size_t i = 0; i < 6; ++i) options.task.mask[i] = random.chance(0.8);
  for (std::size_t i = 0; i < 6; ++i) options.exact[i] = random.chance(0.3);
  options.task.mask[0] = true;
  if (random.chance(0.4)) {
    options.cone = ToolCone{direction(random), random.chance(0.3) ? 0.0 : random.uniform(0.0, 1.0)};
    for (std::size_t i = 3; i < 6; ++i) {
      options.task.mask[i] = true;
      options.exact[i] = false;
      options.ranges[i] = {0.0, 0.0};
    }
  }
  return options;
}

// The pose `by` the twist from `tip`: in base axes, about the tip's origin.
Pose moved(const Pose& tip, const Twist& by) {
  Pose out = tip;
  out.translation() += by.head<3>();
  out.linear() = sigmaik::rotation_exp(by.tail<3>()) * tip.linear();
  return out;
}

// The error in the task's axes; rows that are left out are not asked.
Twist in_task(const PositionIkOptions& options, const Pose& tip, const Pose& target) {
  Twist error = sigmaik::pose_error(tip, target);
  if (options.task.frame == Frame::Tool) {
    error.head<3>() = tip.linear().transpose() * error.head<3>();
    error.tail<3>() = tip.linear().transpose() * error.tail<3>();
  }
  return error;
}

double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

// How far the rows of one kind, from `first`, are outside their ranges or the cone, and counted by `rows`.
double outside(const PositionIkOptions& options, const Pose& tip, const Pose& target, std::size_t first,
               const std::array<bool, 6>& rows) {
  if (first == 3 && options.cone) {
    const double angle = angle_between(tip.linear() * options.cone->axis, target.linear() * options.cone->axis);
    return rows[3] ? std::max(0.0, angle - options.cone->angle) : 0.0;
  }
  const Twist error = in_task(options, tip, target);
  double sum = 0.0;
  for (std::size_t i = first; i < first + 3; ++i) {
    if (!options.task.mask[i] || !rows[i]) continue;
    const double e = error[static_cast<Eigen::Index>(i)];
    const double beyond = e - std::clamp(e, options.ranges[i][0], options.ranges[i][1]);
    sum += beyond * beyond;
  }
  return std::sqrt(sum);
}

bool allowed(const PositionIkOptions& options, const Pose& tip, const Pose& target) {
  return outside(options, tip, target, 0, options.task.mask) <= kTolerance &&
         outside(options, tip, target, 3, options.task.mask) <= kTolerance;
}

// The distance of the rows that are held (or of the others), lengths in characteristic lengths.
double distance(const Chain& chain, const PositionIkOptions& options, const JointVector& q, const Pose& target,
                bool held) {
  std::array<bool, 6> rows{};
  for (std::size_t i = 0; i < 6; ++i) rows[i] = options.task.mask[i] && options.exact[i] == held;
  const Pose tip = pose(chain, q);
  return std::hypot(outside(options, tip, target, 0, rows) / chain.characteristic_length(),
                    outside(options, tip, target, 3, rows));
}

// A target whose error from `tip` is allowed: at random within the ranges and the cone.
Pose allowed_target(Random& random, const PositionIkOptions& options, const Pose& tip) {
  Twist error = Twist::Zero();
  for (std::size_t i = 0; i < 6; ++i) {
    error[static_cast<Eigen::Index>(i)] = random.uniform(options.ranges[i][0], options.ranges[i][1]);
  }
  if (options.task.frame == Frame::Tool) {
    error.head<3>() = tip.linear() * error.head<3>();
    error.tail<3>() = tip.linear() * error.tail<3>();
  }
  if (options.cone) {
    const Eigen::Vector3d axis = options.cone->axis.normalized();
    const double tilt = random.uniform(0.0, options.cone->angle), roll = random.uniform(-kPi, kPi);
    Eigen::Vector3d across = axis.cross(direction(random));
    across.normalize();
    const Eigen::Matrix3d turn = sigmaik::rotation_exp(tilt * across) * sigmaik::rotation_exp(roll * axis);
    error.tail<3>() = sigmaik::rotation_log(tip.linear() * turn * tip.linear().transpose());
  }
  return moved(tip, error);
}

PositionIkOptions random_cone(Random& random) {
  PositionIkOptions options;
  options.cone = ToolCone{direction(random), random.chance(0.3) ? 0.0 : random.uniform(0.01, 1.0)};
  return options;
}

}  // namespace

// Derivatives ---------------------------------------------------------------------------------------------------------

TEST_CASE("the rate of the rows' errors is that of central differences, for any mask, frame and cone") {
  Random random(1);
  for (int k = 0; k < 3000; ++k) {
    const PositionIkOptions options = random_options(random);
    const PoseRows rows(options, 0.7, 30.0);
    const Pose tip = random.pose();
    const Pose target = random.chance(0.3) ? moved(tip, random.decades(-6.0, -1.0) * Twist(random.unit(6)))
                                           : random.pose();
    const Twist error = sigmaik::pose_error(tip, target);
    if (error.tail<3>().norm() > 2.8) continue;  // the logarithm jumps at a half turn
    if (options.cone && angle_between(tip.linear() * options.cone->axis, target.linear() * options.cone->axis) > 1.7) {
      continue;  // θ cot θ is limited from 2.9 on; below 1.7 differences are accurate
    }
    const RowErrors found = rows.rates(tip, target, error);
    for (int i = 0; i < 6; ++i) {
      const double h = 1e-6;
      const auto at = [&](double by) {
        const Pose p = moved(tip, by * Twist(Twist::Unit(i)));
        return rows.errors(p, target, sigmaik::pose_error(p, target));
      };
      const Row6 difference = (at(-h) - at(h)) / (2.0 * h);
      CHECK((found.rate.col(i) - difference).cwiseAbs().maxCoeff() < 1e-6);
    }
  }
}

TEST_CASE("force and stiffness are the derivatives of the cost") {
  Random random(2);
  int compared = 0;
  for (int k = 0; k < 2000; ++k) {
    const PositionIkOptions options = k % 4 == 0 ? PositionIkOptions{} : random_options(random);
    const double length = 0.7;
    const PoseRows rows(options, length, 30.0);
    REQUIRE(rows.plain() == (k % 4 == 0));
    const Pose tip = random.pose(), target = random.pose();
    if (sigmaik::pose_error(tip, target).tail<3>().norm() > 2.6) continue;
    if (options.cone && angle_between(tip.linear() * options.cone->axis, target.linear() * options.cone->axis) > 2.6) {
      continue;
    }
    Row6 shift = Row6::Zero();
    if (k % 3 == 0 && !rows.plain()) shift = rows.held(Row6(0.1 * random.vector(6)));
    const auto half_cost = [&](const Pose& p) {
      const Row6 y = rows.errors(p, target, sigmaik::pose_error(p, target)) + shift;
      return 0.5 * rows.weighted(rows.outside(y)).squaredNorm();
    };
    const Row6 force = rows.force(tip, target, shift);
    const Matrix6 stiffness = rows.stiffness(tip, target, shift);
    const double scale = 1.0 + force.norm();
    Row6 slope;
    for (int i = 0; i < 6; ++i) {
      const double h = 1e-5;
      const Twist step = Twist::Unit(i);
      slope[i] = (half_cost(moved(tip, -h * step)) - half_cost(moved(tip, h * step))) / (2.0 * h);
    }
    CHECK((force - slope).cwiseAbs().maxCoeff() < 1e-3 * scale);  // of exact rows the cost has a large curvature
    // ξᵀ K ξ is the second derivative of the cost along exp(t ξ), whatever is inside a range.
    const Twist along = random.unit(6);
    const double h = 1e-3;
    const double second = (half_cost(moved(tip, h * along)) - 2.0 * half_cost(tip) +
                           half_cost(moved(tip, -h * along))) /
                          (h * h);
    const Row6 before = rows.force(moved(tip, -h * along), target, shift),
               after = rows.force(moved(tip, h * along), target, shift);
    const bool smooth = (before - after).norm() < 1.0 * scale;  // no end of a range is passed
    if (!smooth) continue;
    compared += std::abs(along.dot(stiffness * along) - second) < 1e-2 * scale;
    if (rows.plain()) CHECK(along.dot(stiffness * along) == doctest::Approx(second).epsilon(1e-4));
  }
  CHECK(compared > 800);
}

TEST_CASE("an error inside its range counts for nothing, an error outside by the distance from the range") {
  Random random(3);
  for (int k = 0; k < 1000; ++k) {
    const PositionIkOptions options = random.chance(0.3) ? random_cone(random) : random_ranges(random);
    const PoseRows rows(options, 0.7, 30.0);
    const Pose tip = random.pose();
    const Pose target = allowed_target(random, options, tip);
    const Row6 y = rows.errors(tip, target, sigmaik::pose_error(tip, target));
    CHECK(rows.outside(y).norm() < 1e-12);
    if (options.cone) continue;
    const Row6 step = random.vector(6), beyond = rows.outside(Row6(y + step));
    for (int i = 0; i < 6; ++i) {
      const auto [least, largest] = options.ranges[static_cast<std::size_t>(i)];
      const double e = y[i] + step[i];
      CHECK(beyond[i] == doctest::Approx(e > largest ? e - largest : e < least ? e - least : 0.0));
    }
  }
}

// Ranges --------------------------------------------------------------------------------------------------------------

TEST_CASE("a pose within ranges of a configuration is solved, within the ranges and the limits, on each shipped arm") {
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    const Chain& chain = arm;
    CAPTURE(name);
    Random random(11);
    for (int k = 0; k < 20; ++k) {
      const PositionIkOptions options = k % 3 == 0 ? random_cone(random) : random_ranges(random);
      const PositionIk ik(chain, options);
      for (int i = 0; i < 20; ++i) {
        const JointVector q = sample(random, chain);
        const Pose target = allowed_target(random, options, pose(chain, q));
        for (const PositionIkResult& found : {ik.solve(target), ik.solve(target, sample(random, chain))}) {
          CHECK(found.status == PositionIkStatus::Ok);
          CHECK(inside(chain, found.q));
          CHECK(allowed(options, pose(chain, found.q), target));
        }
      }
    }
  }
}

TEST_CASE("the same on random arms of 1 to 16 joints") {
  Random random(12);
  for (int n = 1; n <= 16; ++n) {
    int solved = 0;
    for (int arm = 0; arm < 20; ++arm) {
      const Chain chain = limited_chain(random, n, arm < 10 ? 0.0 : 0.3);
      const PositionIkOptions options = arm % 3 == 0 ? random_cone(random) : random_ranges(random);
      const PositionIk ik(chain, options);
      for (int k = 0; k < 10; ++k) {
        const JointVector q = sample(random, chain);
        const Pose target = allowed_target(random, options, pose(chain, q));
        const PositionIkResult found = ik.solve(target);
        CHECK(inside(chain, found.q));
        CHECK(allowed(options, pose(chain, found.q), target) == (found.status == PositionIkStatus::Ok));
        solved += found.status == PositionIkStatus::Ok;
      }
    }
    CAPTURE(n);
    CHECK(solved == 200);
  }
}

TEST_CASE("poses within ranges of exactly singular configurations are solved") {
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    const Chain& chain = arm;
    CAPTURE(name);
    Random random(13);
    for (int k = 0; k < 20; ++k) {
      const PositionIkOptions options = k % 3 == 0 ? random_cone(random) : random_ranges(random);
      const PositionIk ik(chain, options);
      JointVector q = k < 2 ? JointVector(JointVector::Zero(chain.dof())) : sample(random, chain);
      q[random.integer(0, chain.dof() - 1)] = 0.0;
      q[random.integer(0, chain.dof() - 1)] = 0.0;
      q = q.cwiseMax(chain.limits().lower).cwiseMin(chain.limits().upper);
      const Pose target = allowed_target(random, options, pose(chain, q));
      const PositionIkResult found = ik.solve(target), near = ik.solve(target, q);
      CHECK(found.status == PositionIkStatus::Ok);
      CHECK(near.status == PositionIkStatus::Ok);
      CHECK(allowed(options, pose(chain, found.q), target));
    }
  }
}

TEST_CASE("a configuration within the ranges is its own nearest solution") {
  for (const char* const name : {"ur10", "kuka_kr6_r900", "ufactory_xarm7"}) {
    CAPTURE(name);
    const Chain& chain = test::arms().at(name);
    Random random(14);
    for (int k = 0; k < 40; ++k) {
      const PositionIkOptions options = k % 3 == 0 ? random_cone(random) : random_ranges(random);
      const PositionIk ik(chain, options);
      const JointVector q = sample(random, chain);
      const PositionIkResult found = ik.solve(allowed_target(random, options, pose(chain, q)), q);
      CHECK(found.status == PositionIkStatus::Ok);
      CHECK((found.q - q).cwiseAbs().maxCoeff() < 1e-5);
    }
  }
}

TEST_CASE("with ranges the nearest solution is hardly ever farther away than without") {
  int farther = 0, count = 0;
  for (const char* const name : {"ur10", "kuka_kr6_r900", "ufactory_xarm7"}) {
    const Chain& chain = test::arms().at(name);
    const PositionIk whole(chain);
    Random random(15);
    for (int k = 0; k < 100; ++k) {
      const PositionIkOptions options = k % 3 == 0 ? random_cone(random) : random_ranges(random);
      const JointVector near = sample(random, chain);
      const JointVector q =
          (near + 0.5 * random.vector(chain.dof())).cwiseMax(chain.limits().lower).cwiseMin(chain.limits().upper);
      const Pose target = pose(chain, q);
      const auto time = [&](const PositionIkResult& found) {
        return (found.q - near).cwiseQuotient(chain.limits().velocity).cwiseAbs().maxCoeff();
      };
      farther += time(PositionIk(chain, options).solve(target, near)) > 1.05 * time(whole.solve(target, near)) + 1e-6;
      ++count;
    }
  }
  CAPTURE(farther);
  CHECK(farther <= 0.02 * count);
}

TEST_CASE("a cone of no angle is the mask that leaves the turn about the tool's axis free") {
  for (const char* const name : {"ur10", "ufactory_xarm7", "puma560"}) {
    CAPTURE(name);
    const Chain& chain = test::arms().at(name);
    PositionIkOptions cone, mask;
    cone.cone = ToolCone{Eigen::Vector3d::UnitZ(), 0.0};
    mask.task = {{true, true, true, true, true, false}, Frame::Tool};
    const PositionIk one(chain, cone), other(chain, mask);
    Random random(16);
    for (int k = 0; k < 100; ++k) {
      const Pose target = pose(chain, sample(random, chain));
      const PositionIkResult found = one.solve(target), again = other.solve(target);
      CHECK(found.status == PositionIkStatus::Ok);
      CHECK(again.status == PositionIkStatus::Ok);
      CHECK(angle_between(pose(chain, found.q).linear().col(2), target.linear().col(2)) < kTolerance);
      CHECK(std::abs(found.error.tail<3>().dot(pose(chain, found.q).linear().col(2))) < 1e-9);
    }
    for (const auto& branch : one.solve_all(pose(chain, sample(random, chain)))) CHECK(branch.sigma_min >= 0.0);
  }
}

TEST_CASE("a range without an end is a row that is left out") {
  const Chain& chain = test::arms().at("ur10");
  PositionIkOptions free;
  free.ranges[2] = {-kInfinity, kInfinity};
  const PositionIk ik(chain, free);
  Random random(17);
  for (int k = 0; k < 50; ++k) {
    Pose target = pose(chain, sample(random, chain));
    const double height = target.translation().z();
    target.translation().z() += 100.0;
    const PositionIkResult found = ik.solve(target);
    CHECK(found.status == PositionIkStatus::Ok);
    CHECK(std::abs(pose(chain, found.q).translation().z() - height) < 3.0);
    CHECK(found.error[2] > 90.0);
  }
}

// Exact rows ----------------------------------------------------------------------------------------------------------

TEST_CASE("out of reach the exact rows are met, and among configurations that meet these none is nearer") {
  Random random(21);
  int cases = 0, beaten = 0, unmet = 0;
  for (int trial = 0; trial < 120; ++trial) {
    PositionIkOptions options;
    const bool position = trial % 2 == 0;
    options.exact = position ? kPosition : kOrientation;
    if (trial % 5 == 1) options.exact = {true, true, false, false, false, true};
    const int n = random.integer(4, 7);
    const Chain chain = limited_chain(random, n, 0.1);
    PositionIkOptions part;  // the exact rows alone
    part.task.mask = options.exact;
    const PositionIk ik(chain, options), alone(chain, part);
    const JointVector q = sample(random, chain);
    Pose target = random.pose();
    if (options.exact == kOrientation) {
      target.linear() = pose(chain, q).linear();
    } else if (position) {
      target.translation() = pose(chain, q).translation();
    } else {
      target = pose(chain, q);
      target.translation().z() += 3.0;
    }
    const PositionIkResult found = ik.solve(target);
    REQUIRE(inside(chain, found.q));
    if (found.status == PositionIkStatus::Ok) continue;
    ++cases;
    CAPTURE(trial);
    CAPTURE(n);
    const bool met = outside(options, pose(chain, found.q), target, 0, options.exact) <= kTolerance &&
                     outside(options, pose(chain, found.q), target, 3, options.exact) <= kTolerance;
    CHECK(met >= (alone.solve(target).status == PositionIkStatus::Ok));
    unmet += !met;
    if (!met) continue;
    const double rest = distance(chain, options, found.q, target, false);
    for (int i = 0; i < 30; ++i) {  // the nearest, to one in a hundred, of solutions of the exact rows
      const PositionIkResult other = alone.solve(target, sample(random, chain));
      if (other.status != PositionIkStatus::Ok) continue;
      if (distance(chain, options, other.q, target, false) < 0.99 * rest - 1e-6) {
        ++beaten;
        break;
      }
    }
    for (int i = 0; i < 30; ++i) {  // a minimum: no small motion that meets the exact rows comes nearer
      const JointVector away =
          (found.q + 1e-3 * JointVector(random.unit(n))).cwiseMax(chain.limits().lower).cwiseMin(chain.limits().upper);
      const PositionIkResult other = alone.solve(target, away);
      if (other.status != PositionIkStatus::Ok || (other.q - found.q).norm() > 0.1) continue;
      CHECK(distance(chain, options, other.q, target, false) >= rest - 1e-7);
    }
  }
  CAPTURE(beaten);
  CAPTURE(unmet);
  CHECK(cases >= 90);
  CHECK(unmet <= 0.02 * cases);  // few joints with narrow limits, where a search of the exact rows alone finds nothing
  CHECK(beaten <= 0.02 * cases);
}

TEST_CASE("where the exact rows themselves are out of reach, they are as near as without the others") {
  Random random(22);
  for (int trial = 0; trial < 60; ++trial) {
    const int n = random.integer(2, 7);
    const Chain chain = limited_chain(random, n, 0.1);
    PositionIkOptions options, part;
    options.exact = kPosition;
    part.task.mask = kPosition;
    Pose target = random.pose();
    target.translation() *= 10.0 / target.translation().norm();
    const PositionIkResult found = PositionIk(chain, options).solve(target),
                           alone = PositionIk(chain, part).solve(target);
    CAPTURE(trial);
    CHECK(found.status == PositionIkStatus::Unreachable);
    CHECK(inside(chain, found.q));
    CHECK(found.error.head<3>().norm() <= alone.error.head<3>().norm() * (1.0 + 1e-4));
  }
}

TEST_CASE("exact rows change nothing for poses within reach") {
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    const Chain& chain = arm;
    CAPTURE(name);
    PositionIkOptions options;
    options.exact = kPosition;
    const PositionIk ik(chain, options);
    Random random(23);
    for (int k = 0; k < 200; ++k) {
      const Pose target = pose(chain, sample(random, chain));
      const PositionIkResult found = ik.solve(target), near = ik.solve(target, sample(random, chain));
      CHECK(found.status == PositionIkStatus::Ok);
      CHECK(near.status == PositionIkStatus::Ok);
      CHECK(allowed(options, pose(chain, found.q), target));
    }
  }
}

TEST_CASE("exact rows, ranges and a cone together: the exact rows are met, and the others are near or allowed") {
  Random random(24);
  for (int trial = 0; trial < 60; ++trial) {
    const Chain chain = limited_chain(random, 7, 0.0);
    PositionIkOptions options = trial % 2 == 0 ? random_cone(random) : random_ranges(random);
    options.exact = kPosition;
    const PositionIk ik(chain, options);
    Pose target = random.pose();
    target.translation() = pose(chain, sample(random, chain)).translation();
    const PositionIkResult found = ik.solve(target);
    CAPTURE(trial);
    CHECK(inside(chain, found.q));
    CHECK(outside(options, pose(chain, found.q), target, 0, kPosition) <= kTolerance);
    CHECK(allowed(options, pose(chain, found.q), target) == (found.status == PositionIkStatus::Ok));
  }
}

// The rest ------------------------------------------------------------------------------------------------------------

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("no call of solve() touches the heap, with ranges, a cone and exact rows") {
  Random random(31);
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    const Chain& chain = arm;
    CAPTURE(name);
    for (int k = 0; k < 4; ++k) {
      PositionIkOptions options = k % 2 == 0 ? random_cone(random) : random_ranges(random);
      if (k > 1) options.exact = kPosition;
      const PositionIk ik(chain, options);
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
}
#endif

TEST_CASE("ranges, cones and exact rows that make no sense are refused, with the facts") {
  const Chain& chain = test::arms().at("ur10");
  const auto refused = [&](const PositionIkOptions& options, const char* text) {
    CHECK_THROWS_WITH_AS(PositionIk(chain, options), doctest::Contains(text), sigmaik::Error);
  };
  PositionIkOptions options;
  options.ranges[1] = {0.25, 0.125};
  refused(options, "ranges[1] = (0.25, 0.125)");
  options.ranges[1] = {kNan, 0.1};
  refused(options, "ranges[1]");
  options.ranges[1] = {kInfinity, kInfinity};
  refused(options, "ranges[1]");
  options = {};
  options.cone = ToolCone{Eigen::Vector3d::Zero(), 0.1};
  refused(options, "axis (0, 0, 0)");
  options.cone = ToolCone{Eigen::Vector3d(kNan, 0.0, 0.0), 0.1};
  refused(options, "axis");
  options.cone = ToolCone{Eigen::Vector3d::UnitX(), -0.25};
  refused(options, "angle -0.25");
  options.cone = ToolCone{Eigen::Vector3d::UnitX(), 3.25};
  refused(options, "angle 3.25");
  options.cone->angle = 0.1;
  options.ranges[4] = {-0.1, 0.1};
  refused(options, "ranges[4] must be 0");
  options.ranges[4] = {0.0, 0.0};
  options.task.mask[5] = false;
  refused(options, "mask must have all three");
  options.task.mask[5] = true;
  options.exact[3] = true;
  refused(options, "exact or not together");
}
