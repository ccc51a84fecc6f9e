// Closed-form inverse kinematics: every posture of random poses of the shipped and of random arms, against forward
// kinematics and Newton's method; singular poses of each kind; limits and turns; arms and input that are refused.

#include <doctest/doctest.h>

#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/LU>

#include <sigmaik/analytic_ik.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/pose.hpp>

#include "heap.hpp"
#include "numbers.hpp"
#include "oracles.hpp"
#include "random.hpp"

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using sigmaik::AnalyticBranch;
using sigmaik::AnalyticIk;
using sigmaik::AnalyticNearest;
using sigmaik::AnalyticSolutions;
using sigmaik::AnalyticStatus;
using sigmaik::Chain;
using sigmaik::JointLimits;
using sigmaik::JointType;
using sigmaik::JointVector;
using sigmaik::Pose;
using sigmaik::Segment;
using sigmaik::SixJoints;
using test::kInfinity;
using test::Random;

constexpr double kPi = std::numbers::pi;
const char* const kShipped[] = {"kuka_kr6_r900", "comau_racer_7_1_4", "puma560"};

static_assert(noexcept(std::declval<const AnalyticIk&>().solve(std::declval<const Pose&>())));
static_assert(noexcept(std::declval<const AnalyticIk&>().nearest(std::declval<const Pose&>(),
                                                                 std::declval<const sigmaik::JointRef&>())));

Chain load(const std::string& name) { return Chain::from_urdf(SIGMAIK_ROBOTS_DIR "/" + name + ".urdf"); }

// ---- Arms -----------------------------------------------------------------------------------------------------------

// Axes of an arm at q = 0, in its base.
struct Layout {
  Vector3d h[6];  // directions
  Vector3d o[6];  // points on the axes
};

Vector3d apart_from(Random& random, const Vector3d& other, double least) {
  for (;;) {
    const Vector3d axis = random.unit(3);
    if (axis.cross(other).norm() > least) return axis;
  }
}

// Any arm that qualifies; `classical`: right angles, axes 1 and 2 that meet, and arms whose links have one length.
Layout layout(Random& random, bool classical) {
  Layout l;
  const auto point = [&] { return Vector3d(0.5 * random.vector(3)); };
  if (!classical) {
    l.h[0] = random.unit(3);
    l.h[1] = apart_from(random, l.h[0], 0.2);
    l.h[3] = random.unit(3);
    l.h[4] = apart_from(random, l.h[3], 0.2);
    l.h[5] = random.chance(0.2) ? l.h[3] : apart_from(random, l.h[4], 0.2);
    for (Vector3d& o : l.o) o = point();
    // Planar links of some length
    do {
      l.o[2] = point();
      l.o[3] = point();
    } while ((l.o[2] - l.o[1]).cross(l.h[1]).norm() < 0.1 || (l.o[3] - l.o[2]).cross(l.h[1]).norm() < 0.1);
  } else {
    const Matrix3d r = random.rotation();
    const bool equal = random.chance(0.3), offset = random.chance(0.3), shifted = !equal && random.chance(0.5);
    const double upper = random.uniform(0.2, 0.6), fore = equal ? upper : random.uniform(0.2, 0.6);
    l.h[0] = r.col(2);
    l.h[1] = r.col(1);
    l.h[3] = r.col(0);
    l.h[4] = r.col(1);
    l.h[5] = r.col(0);
    l.o[0] = point();
    l.o[1] = l.o[0] + (shifted ? 0.1 : 0.0) * r.col(0) + (offset ? 0.15 : 0.0) * r.col(1);
    l.o[2] = l.o[1] + upper * r.col(2);
    l.o[3] = l.o[2] + fore * r.col(0);
  }
  l.h[2] = random.chance(0.5) ? l.h[1] : Vector3d(-l.h[1]);
  l.o[4] = l.o[3];
  l.o[5] = l.o[3];
  return l;
}

// A chain with frames anywhere along the axes and turned at random, a fixed joint on the way, random zeros, base and
// tool.
Chain chain_of(Random& random, const Layout& l, double size = 1.0, double mounting = 1.0) {
  std::vector<Segment> segments;
  Pose last = Pose::Identity();
  const auto add = [&](Pose at, const Vector3d& axis, JointType type) {
    Segment s;
    s.joint_name = "j" + std::to_string(segments.size());
    s.link_name = "l" + std::to_string(segments.size());
    s.origin = last.inverse() * at;
    s.axis = at.linear().transpose() * axis;
    s.type = type;
    last = at;
    segments.push_back(s);
  };
  const Pose base = random.pose(mounting);
  for (int i = 0; i < 6; ++i) {
    Pose at = random.pose();
    at.translation() = size * (l.o[i] + random.uniform(-0.5, 0.5) * l.h[i]);
    at = base * at;
    if (random.chance(0.2)) add(random.pose(), Vector3d::UnitZ(), JointType::Fixed);
    add(at, base.linear() * l.h[i], random.chance(0.5) ? JointType::Continuous : JointType::Revolute);
  }
  Pose tool = random.pose();
  tool.translation() = size * (l.o[5] + Vector3d(0.2 * random.vector(3)));
  add(base * tool, Vector3d::UnitZ(), JointType::Fixed);
  return Chain("base", segments);
}

Chain random_arm(Random& random, bool classical = false) { return chain_of(random, layout(random, classical)); }

Chain with_limits(const Chain& chain, const JointVector& lower, const JointVector& upper) {
  std::vector<Segment> segments = chain.segments();
  int i = 0;
  for (Segment& s : segments) {
    if (s.type == JointType::Fixed) continue;
    s.type = JointType::Revolute;
    s.lower = lower[i];
    s.upper = upper[i++];
  }
  return Chain(chain.base(), segments);
}

Chain unlimited(const Chain& chain) {
  return with_limits(chain, JointVector::Constant(6, -kInfinity), JointVector::Constant(6, kInfinity));
}

// ---- Measures -------------------------------------------------------------------------------------------------------

// Largest difference of joints, where whole turns do not count.
double apart(const SixJoints& a, const SixJoints& b) {
  double largest = 0.0;
  for (int i = 0; i < 6; ++i) largest = std::max(largest, std::abs(std::remainder(a[i] - b[i], 2.0 * kPi)));
  return largest;
}

double size_of(const Chain& chain) {
  double size = chain.tool().translation().norm();
  for (std::size_t i = 0; i < 6; ++i) size += chain.constants()[i].translation.norm();
  return size;
}

double misses(const Chain& chain, const SixJoints& q, const Pose& pose) {
  const Pose got = sigmaik::pose(chain, q);
  return std::max((got.translation() - pose.translation()).norm() / size_of(chain),
                  (got.linear() - pose.linear()).cwiseAbs().maxCoeff());
}

double nearest_branch(const AnalyticSolutions& solutions, const SixJoints& q) {
  double least = kInfinity;
  for (const AnalyticBranch& branch : solutions) least = std::min(least, apart(branch.q, q));
  return least;
}

double closest_pair(const AnalyticSolutions& s) {
  double least = kInfinity;
  for (const AnalyticBranch& a : s) {
    for (const AnalyticBranch& b : s) {
      if (&a < &b) least = std::min(least, apart(a.q, b.q));
    }
  }
  return least;
}

// The distance from singularities: the factors of the Jacobian's determinant, by shoulder, elbow and wrist.
Vector3d factors(const Chain& chain, const SixJoints& q) {
  sigmaik::ChainState state;
  REQUIRE(sigmaik::update(chain, q, state));
  const auto axis = [&](int i) -> Vector3d { return state.jacobian.col(i).tail<3>(); };
  const auto velocity = [&](int i) -> Vector3d { return state.jacobian.col(i).head<3>(); };
  // The point c from the tip that axes 4, 5, 6 have in common: velocity + axis × c = 0.
  Eigen::Matrix<double, 9, 3> a;
  Eigen::Matrix<double, 9, 1> b;
  for (int i = 0; i < 3; ++i) {
    const Vector3d w = axis(3 + i);
    a.middleRows<3>(3 * i) << 0.0, -w[2], w[1], w[2], 0.0, -w[0], -w[1], w[0], 0.0;
    b.segment<3>(3 * i) = -velocity(3 + i);
  }
  const Vector3d centre = test::least_squares(a, b);
  const auto at_centre = [&](int i) -> Vector3d { return velocity(i) + axis(i).cross(centre); };
  return {at_centre(0).dot(axis(1)), at_centre(1).cross(at_centre(2)).dot(axis(1)),
          axis(3).cross(axis(4)).dot(axis(5))};
}

bool regular(const Chain& chain, const SixJoints& q, double least = 1e-3) {
  return factors(chain, q).cwiseAbs().minCoeff() > least;
}

// Moves joint 2, 3 or 5 to where the shoulder's, elbow's or wrist's factor is zero; false where it never is.
bool make_singular(const Chain& chain, int which, SixJoints& q, Random& random) {
  const int joint = which == 0 ? 1 : which == 1 ? 2 : 4;
  const auto at = [&](double angle) {
    SixJoints moved = q;
    moved[joint] = angle;
    return factors(chain, moved)[which];
  };
  const double start = random.uniform(-kPi, kPi);
  double low = start, high = start;
  for (int k = 1; k <= 64 && high == low; ++k) {
    const double next = start + 2.0 * kPi * k / 64;
    if ((at(next) > 0.0) != (at(start) > 0.0)) {
      low = next - 2.0 * kPi / 64;
      high = next;
    }
  }
  if (high == low) return false;
  const bool rising = at(high) > 0.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    ((at(middle) > 0.0) == rising ? high : low) = middle;
  }
  q[joint] = std::abs(at(low)) < std::abs(at(high)) ? low : high;
  return true;
}

SixJoints configuration(Random& random) { return random.configuration(6); }

// Checks that each branch reproduces the pose, that q is among the branches, and that no two branches are equal.
void check_regular(const Chain& chain, const AnalyticIk& ik, const SixJoints& q) {
  const Pose pose = sigmaik::pose(chain, q);
  const AnalyticSolutions s = ik.solve(pose);
  CAPTURE(q.transpose());
  REQUIRE(s.status == AnalyticStatus::Ok);
  REQUIRE(s.count <= 8);
  double worst = 0.0;
  for (const AnalyticBranch& branch : s) worst = std::max(worst, misses(chain, branch.q, pose));
  CHECK(worst < 1e-12);
  CHECK(nearest_branch(s, q) < 1e-9);
  CHECK(closest_pair(s) > 1e-6);
  const AnalyticNearest near = ik.nearest(pose, q);
  REQUIRE(near.status == AnalyticStatus::Ok);
  CHECK(misses(chain, near.branch.q, pose) < 1e-12);
}

}  // namespace

// ---- Regular poses --------------------------------------------------------------------------------------------------

TEST_CASE("shipped arms: every posture, eight or four of them") {
  for (const char* const name : kShipped) {
    CAPTURE(name);
    const Chain chain = load(name);
    const AnalyticIk ik(chain);
    CHECK(ik.chain().joint_names() == chain.joint_names());
    Random random(1);
    int full = 0;
    for (int i = 0; i < 4000; ++i) {
      const SixJoints q = configuration(random);
      if (!regular(chain, q)) continue;
      check_regular(chain, ik, q);
      const AnalyticSolutions s = ik.solve(sigmaik::pose(chain, q));
      CHECK((s.count == 8 || s.count == 4));
      full += s.count == 8;
    }
    CHECK(full > 2000);
  }
}

TEST_CASE("random arms: any angles, offsets, signs, zeros, frames, bases and tools") {
  Random random(2);
  int counts[9] = {};
  for (int arm = 0; arm < 600; ++arm) {
    CAPTURE(arm);
    const Chain chain = random_arm(random, arm % 3 == 0);
    const AnalyticIk ik(chain);
    for (int i = 0; i < 25; ++i) {
      const SixJoints q = configuration(random);
      if (!regular(chain, q)) continue;
      check_regular(chain, ik, q);
      ++counts[ik.solve(sigmaik::pose(chain, q)).count];
    }
  }
  for (const int count : {2, 4, 6, 8}) CHECK(counts[count] > 100);
  for (const int count : {0, 1, 3, 5, 7}) CHECK(counts[count] == 0);
}

TEST_CASE("a large arm or a far mounting costs only the digits of its own rounding") {
  Random random(3);
  for (const double size : {1e-3, 1.0, 1e3}) {
    for (const double mounting : {0.0, 1.0, 1e3}) {
      CAPTURE(size);
      CAPTURE(mounting);
      for (int arm = 0; arm < 20; ++arm) {
        const Chain chain = chain_of(random, layout(random, arm % 2 == 0), size, mounting);
        const AnalyticIk ik(chain);
        for (int i = 0; i < 20; ++i) {
          const SixJoints q = configuration(random);
          const Pose pose = sigmaik::pose(chain, q);
          const AnalyticSolutions s = ik.solve(pose);
          CHECK(s.count > 0);
          for (const AnalyticBranch& branch : s) CHECK(misses(chain, branch.q, pose) < 3e-12);
        }
      }
    }
  }
}

TEST_CASE("Newton's method from random starts finds all listed postures, and no others") {
  Random random(4);
  std::vector<Chain> arms;
  for (const char* const name : kShipped) arms.push_back(load(name));
  for (int i = 0; i < 5; ++i) arms.push_back(random_arm(random, i == 0));
  for (const Chain& chain : arms) {
    CAPTURE(chain.joint_names()[0]);
    const AnalyticIk ik(chain);
    for (int target = 0; target < 2; ++target) {
      SixJoints q = configuration(random);
      while (!regular(chain, q, 1e-2)) q = configuration(random);
      const Pose pose = sigmaik::pose(chain, q);
      const AnalyticSolutions s = ik.solve(pose);
      std::vector<int> found(static_cast<std::size_t>(s.count), 0);
      int converged = 0;
      for (int start = 0; start < 600; ++start) {
        SixJoints at = SixJoints(random.vector(6) * 2.0);
        sigmaik::Twist error;
        for (int i = 0; i < 60; ++i) {
          sigmaik::ChainState state;
          sigmaik::update(chain, at, state);
          error = sigmaik::pose_error(state.tip, pose);
          if (error.norm() < 1e-13) break;
          const Eigen::Matrix<double, 6, 6> j = state.jacobian;
          SixJoints step = j.partialPivLu().solve(error);
          if (!step.allFinite()) break;
          if (step.norm() > 0.5) step *= 0.5 / step.norm();
          at += step;
        }
        if (!(error.norm() < 1e-11)) continue;
        ++converged;
        CHECK(nearest_branch(s, at) < 1e-6);
        for (std::size_t k = 0; k < found.size(); ++k) found[k] += apart(s.branches[k].q, at) < 1e-6;
      }
      CHECK(converged > 20);
      for (const int times : found) CHECK(times > 0);
    }
  }
}

TEST_CASE("a rotation in single precision is taken as the nearest one") {
  Random random(5);
  const Chain chain = load("kuka_kr6_r900");
  const AnalyticIk ik(chain);
  for (int i = 0; i < 500; ++i) {
    const SixJoints q = configuration(random);
    if (!regular(chain, q, 1e-2)) continue;
    Pose rough = sigmaik::pose(chain, q);
    rough.matrix() = rough.matrix().cast<float>().cast<double>();
    const AnalyticSolutions s = ik.solve(rough);
    CHECK(nearest_branch(s, q) < 1e-3);
    const test::Svd svd = test::svd(rough.linear());
    Pose exact = rough;
    exact.linear() = svd.u * svd.v.transpose();
    for (const AnalyticBranch& branch : s) CHECK(misses(chain, branch.q, exact) < 1e-12);
  }
}

TEST_CASE("branches keep their places along a path") {
  Random random(6);
  const Chain chain = unlimited(load("kuka_kr6_r900"));
  const AnalyticIk ik(chain);
  for (int path = 0; path < 50; ++path) {
    SixJoints from = configuration(random);
    AnalyticSolutions last = ik.solve(sigmaik::pose(chain, from));
    const SixJoints step = 1e-4 * random.unit(6);
    for (int i = 0; i < 200; ++i) {
      const SixJoints to = from + step;
      if (!regular(chain, to, 2e-2) || !regular(chain, from, 2e-2)) break;
      const AnalyticSolutions s = ik.solve(sigmaik::pose(chain, to));
      if (s.count != 8 || last.count != 8) break;
      for (std::size_t k = 0; k < 8; ++k) {
        if (regular(chain, s.branches[k].q, 2e-2)) CHECK(apart(s.branches[k].q, last.branches[k].q) < 0.05);
      }
      from = to;
      last = s;
    }
  }
}

// ---- Singular poses -------------------------------------------------------------------------------------------------

TEST_CASE("singular poses: shoulder, elbow, wrist and all together") {
  Random random(7);
  std::vector<Chain> arms;
  for (const char* const name : kShipped) arms.push_back(unlimited(load(name)));
  for (int i = 0; i < 120; ++i) arms.push_back(unlimited(random_arm(random, i % 2 == 0)));
  int checked[8] = {};
  for (std::size_t arm = 0; arm < arms.size(); ++arm) {
    CAPTURE(arm);
    const Chain& chain = arms[arm];
    const AnalyticIk ik(chain);
    for (unsigned kinds = 1; kinds < 8; ++kinds) {
      for (int repeat = 0; repeat < 4; ++repeat) {
        SixJoints q = configuration(random);
        bool there = true;
        // In this order no move changes a factor that is already zero.
        for (const int which : {1, 0, 2}) {
          if ((kinds >> which & 1u) != 0) there = there && make_singular(chain, which, q, random);
        }
        if (!there) continue;
        const Vector3d factor = factors(chain, q).cwiseAbs();
        bool clear = true;  // of the other singularities
        for (int which = 0; which < 3; ++which) clear = clear && ((kinds >> which & 1u) != 0 || factor[which] > 3e-3);
        // Folded onto axis 2, the arm reaches the pose with every q2, and is singular at the shoulder for some of them.
        if (!clear) continue;
        CAPTURE(kinds);
        CAPTURE(q.transpose());
        const Pose pose = sigmaik::pose(chain, q);
        const AnalyticSolutions s = ik.solve(pose);
        REQUIRE(s.status == AnalyticStatus::Ok);
        unsigned flags = 0;
        for (const AnalyticBranch& branch : s) {
          CHECK(misses(chain, branch.q, pose) < 1e-11);
          flags |= branch.singular;
        }
        // Where an earlier angle is free, solve() may choose one at which the wrist is not singular.
        const unsigned sure = kinds == 4 ? 4u : kinds & 3u;
        CHECK((flags & sure) == sure);
        CHECK(closest_pair(s) > 1e-6);
        CHECK(s.count < 8);

        // An angle that the pose leaves free stays as it is.
        const AnalyticNearest near = ik.nearest(pose, q);
        REQUIRE(near.status == AnalyticStatus::Ok);
        CHECK((near.branch.singular & kinds) == kinds);
        CHECK((near.branch.q - q).cwiseAbs().maxCoeff() < 1e-7);
        CHECK(misses(chain, near.branch.q, pose) < 1e-11);
        ++checked[kinds];
      }
    }
  }
  for (unsigned kinds = 1; kinds < 8; ++kinds) {
    CAPTURE(kinds);
    CHECK(checked[kinds] > 100);
  }
}

TEST_CASE("numbers of postures at singular poses of the KUKA") {
  const Chain chain = unlimited(load("kuka_kr6_r900"));
  const AnalyticIk ik(chain);
  const double bend = std::atan2(0.035, 0.42), fore = std::hypot(0.035, 0.42);
  const auto count = [&](const SixJoints& q) { return ik.solve(sigmaik::pose(chain, q)).count; };
  SixJoints q;
  q << 0.3, -1.2, 1.4, 0.7, 0.9, -0.4;
  CHECK(count(q) == 8);
  q[4] = 0.0;
  CHECK(count(q) == 7);  // one of four arm postures is singular
  q[4] = kPi;
  CHECK(count(q) == 7);
  q[4] = 0.9;
  q[2] = bend;  // stretched; with the shoulder turned by half a turn, the arm cannot reach so far
  CHECK(count(q) == 2);
  q[2] = bend - kPi;  // folded
  CHECK((count(q) == 2 || count(q) == 6));
  // Wrist centre on axis 1: 0.025 + 0.455 cos q2 + fore cos(q2 + q3 − bend) = 0
  q[2] = 1.4;
  const double x = 0.455 + fore * std::cos(1.4 - bend), y = fore * std::sin(1.4 - bend);
  q[1] = -std::atan2(y, x) - std::acos(-0.025 / std::hypot(x, y));
  CHECK(count(q) == 4);
  const AnalyticSolutions s = ik.solve(sigmaik::pose(chain, q));
  for (const AnalyticBranch& branch : s) {
    CHECK(branch.singular == sigmaik::kShoulderSingular);
    CHECK(branch.q[0] == 0.0);  // free, and reported as free
  }
  // Every value of the free angle reaches the pose.
  for (double angle = -3.0; angle < 3.0; angle += 0.37) {
    SixJoints near = q;
    near[0] = angle;
    const AnalyticNearest nearest = ik.nearest(sigmaik::pose(chain, q), near);
    CHECK(nearest.branch.q[0] == angle);
    CHECK(misses(chain, nearest.branch.q, sigmaik::pose(chain, q)) < 1e-12);
  }
}

TEST_CASE("a free joint 1 turns to where an oblique wrist can do the rest") {
  Random random(16);
  int checked = 0, found = 0;
  for (int arm = 0; arm < 300; ++arm) {
    Layout l = layout(random, true);
    l.h[4] = apart_from(random, l.h[3], 0.4);
    l.h[5] = apart_from(random, l.h[4], 0.4);
    const Chain chain = unlimited(chain_of(random, l));
    const AnalyticIk ik(chain);
    SixJoints q = configuration(random);
    if (!make_singular(chain, 0, q, random)) continue;
    if (factors(chain, q).tail<2>().cwiseAbs().minCoeff() < 3e-3) continue;
    const Pose pose = sigmaik::pose(chain, q);
    const AnalyticNearest near = ik.nearest(pose, q);
    REQUIRE(near.status == AnalyticStatus::Ok);
    CHECK((near.branch.q - q).cwiseAbs().maxCoeff() < 1e-7);
    const AnalyticSolutions s = ik.solve(pose);
    for (const AnalyticBranch& branch : s) CHECK(misses(chain, branch.q, pose) < 1e-11);
    ++checked;
    found += s.count > 0;
  }
  CHECK(checked > 200);
  CHECK(found == checked);
}

TEST_CASE("answers stay as exact close to singular poses") {
  Random random(8);
  std::vector<Chain> arms;
  for (const char* const name : kShipped) arms.push_back(load(name));
  for (int i = 0; i < 150; ++i) arms.push_back(random_arm(random, i % 2 == 0));
  int lost = 0;
  for (std::size_t arm = 0; arm < arms.size(); ++arm) {
    const Chain& chain = arms[arm];
    const bool right_angled = arm < 3 || arm % 2 == 1;
    const AnalyticIk ik(chain);
    for (int i = 0; i < 40; ++i) {
      SixJoints q = configuration(random);
      for (const int which : {1, 0, 2}) {
        if (!random.chance(0.6) || !make_singular(chain, which, q, random)) continue;
        q[which == 0 ? 1 : which == 1 ? 2 : 4] += random.decades(-16.0, -2.0) * (random.chance(0.5) ? 1.0 : -1.0);
      }
      CAPTURE(q.transpose());
      const Pose pose = sigmaik::pose(chain, q);
      const AnalyticSolutions s = ik.solve(pose);
      if (s.status != AnalyticStatus::Ok) {  // at the corner of three reaches, oblique wrists lose a few poses
        CHECK_FALSE(right_angled);
        CHECK(factors(chain, q).cwiseAbs().maxCoeff() < 1e-6);
        ++lost;
        continue;
      }
      for (const AnalyticBranch& branch : s) CHECK(misses(chain, branch.q, pose) < 1e-11);
      CHECK(misses(chain, ik.nearest(pose, q).branch.q, pose) < 1e-11);
    }
  }
  CHECK(lost < 5);
}

TEST_CASE("the end of the reach") {
  const Chain chain = load("kuka_kr6_r900");
  const AnalyticIk ik(chain);
  const double bend = std::atan2(0.035, 0.42);
  SixJoints q;
  q << 0.3, -0.5, bend, 0.7, 0.9, -0.4;
  const Pose stretched = sigmaik::pose(chain, q);
  SixJoints outward = q;  // the same direction of the forearm, one elbow at a time
  const Pose base = sigmaik::pose(chain, outward);
  // Along the arm, from axis 2 to the wrist centre.
  const Vector3d along(std::cos(0.3) * std::cos(0.5), -std::sin(0.3) * std::cos(0.5), std::sin(0.5));
  for (const double beyond : {-1e-3, -1e-9, -1e-14, 0.0, 1e-14, 1e-13}) {
    Pose pose = base;
    pose.translation() += beyond * along;
    CAPTURE(beyond);
    const AnalyticSolutions s = ik.solve(pose);
    CHECK(s.status == AnalyticStatus::Ok);
    CHECK((s.branches[0].singular == sigmaik::kElbowSingular) == (std::abs(beyond) < 1e-12));
    CHECK(s.count == (std::abs(beyond) < 1e-12 ? 2 : 4));
    for (const AnalyticBranch& branch : s) CHECK(misses(chain, branch.q, pose) < 1e-12);
  }
  for (const double beyond : {1e-10, 1e-6, 1.0, 1e6, 1e150, 1e300}) {
    Pose pose = stretched;
    pose.translation() += beyond * along;
    CAPTURE(beyond);
    CHECK(ik.solve(pose).status == AnalyticStatus::Unreachable);
    CHECK(ik.solve(pose).count == 0);
    CHECK(ik.nearest(pose, q).status == AnalyticStatus::Unreachable);
  }
}

TEST_CASE("out of reach by the wrist's orientation, and in the hole around axis 1") {
  Random random(9);
  int oblique = 0;
  for (int arm = 0; arm < 50; ++arm) {
    const Chain chain = random_arm(random);
    const AnalyticIk ik(chain);
    const SixJoints q = configuration(random);
    Pose pose = sigmaik::pose(chain, q);
    // Another orientation about the wrist centre: all answers must reach it, or there is none.
    sigmaik::ChainState state;
    sigmaik::update(chain, q, state);
    for (int i = 0; i < 40; ++i) {
      Pose turned = pose;
      turned.linear() = random.rotation();
      const AnalyticSolutions s = ik.solve(turned);
      CHECK((s.status == AnalyticStatus::Ok) == (s.count > 0));
      oblique += s.count == 0;
      for (const AnalyticBranch& branch : s) CHECK(misses(chain, branch.q, turned) < 1e-11);
    }
  }
  CHECK(oblique > 100);

  // The PUMA's wrist stays 0.15005 m off axis 1.
  const Chain puma = load("puma560");
  const AnalyticIk ik(puma);
  Pose pose = Pose::Identity();
  pose.translation() << 0.1, 0.05, 1.2;
  CHECK(ik.solve(pose).status == AnalyticStatus::Unreachable);
  pose.translation() << 0.2, 0.05, 1.2;
  CHECK(ik.solve(pose).status == AnalyticStatus::Ok);
}

TEST_CASE("bad input") {
  const Chain chain = load("kuka_kr6_r900");
  const AnalyticIk ik(chain);
  SixJoints q = SixJoints::Constant(0.5);
  const Pose good = sigmaik::pose(chain, q);
  for (const double wrong : {std::numeric_limits<double>::quiet_NaN(), kInfinity, -kInfinity}) {
    for (int entry = 0; entry < 16; ++entry) {
      Pose bad = good;
      bad.matrix()(entry / 4, entry % 4) = wrong;
      CHECK(ik.solve(bad).status == AnalyticStatus::BadInput);
      CHECK(ik.solve(bad).count == 0);
      CHECK(ik.nearest(bad, q).status == AnalyticStatus::BadInput);
    }
    for (int joint = 0; joint < 6; ++joint) {
      SixJoints bad = q;
      bad[joint] = wrong;
      CHECK(ik.nearest(good, bad).status == AnalyticStatus::BadInput);
    }
  }
  Pose mirrored = good, scaled = good;
  mirrored.linear().col(0) *= -1.0;
  scaled.linear() *= 1.001;
  for (const Pose& bad : {mirrored, scaled}) {
    CHECK(ik.solve(bad).status == AnalyticStatus::BadInput);
    CHECK(ik.nearest(bad, q).status == AnalyticStatus::BadInput);
  }
  for (const int size : {0, 1, 5, 7, 16}) {
    CHECK(ik.nearest(good, JointVector::Zero(size)).status == AnalyticStatus::BadInput);
  }
  CHECK(ik.nearest(good, JointVector::Constant(6, 1e300)).status == AnalyticStatus::BadInput);
  CHECK(std::string(to_string(AnalyticStatus::Ok)) == "ok");
  CHECK(std::string(to_string(AnalyticStatus::Unreachable)) == "unreachable");
  CHECK(std::string(to_string(AnalyticStatus::BadInput)) == "bad input");
}

// ---- The nearest posture --------------------------------------------------------------------------------------------

namespace {

struct Turned {
  double angle;
  bool fits;
};

// The turn of `angle` within the limits that is nearest to `near`; if none is within, the nearest turn of all.
Turned turned(double angle, double near, double lower, double upper) {
  Turned best{angle, false};
  for (int k = -20; k <= 20; ++k) {
    const double x = angle + 2.0 * kPi * k;
    const bool fits = x >= lower - 1e-9 && x <= upper + 1e-9;
    if (best.fits && !fits) continue;
    if ((fits && !best.fits) || std::abs(x - near) < std::abs(best.angle - near)) best = {x, fits};
  }
  return best;
}

JointLimits random_limits(Random& random) {
  JointLimits limits;
  limits.lower.resize(6);
  limits.upper.resize(6);
  for (int i = 0; i < 6; ++i) {
    limits.lower[i] = random.chance(0.2) ? -kInfinity : random.uniform(-9.0, 3.0);
    limits.upper[i] = random.chance(0.2) ? kInfinity : std::max(limits.lower[i], -10.0) + random.uniform(0.5, 12.0);
  }
  return limits;
}

}  // namespace

TEST_CASE("solve and nearest against a search of every branch and turn, with random limits") {
  Random random(10);
  int inside = 0, outside = 0;
  for (int arm = 0; arm < 150; ++arm) {
    const Chain any = arm % 4 == 3 ? random_arm(random) : load(kShipped[arm % 4]);
    const JointLimits limits = random_limits(random);
    const Chain chain = with_limits(any, limits.lower, limits.upper);
    const AnalyticIk ik(chain);
    for (int i = 0; i < 40; ++i) {
      const SixJoints q = configuration(random), near = q + SixJoints(random.vector(6) * random.uniform(0.0, 4.0));
      if (!regular(chain, q)) continue;
      const Pose pose = sigmaik::pose(chain, q);
      const AnalyticSolutions s = ik.solve(pose);
      double least = kInfinity;
      bool best_fits = false;
      for (const AnalyticBranch& branch : s) {
        bool fits = true;
        double square = 0.0;
        for (int j = 0; j < 6; ++j) {
          const Turned zero = turned(branch.q[j], 0.0, limits.lower[j], limits.upper[j]);
          CHECK(std::abs(zero.angle - branch.q[j]) < 1e-9);
          if (zero.fits) {
            CHECK(branch.q[j] >= limits.lower[j]);
            CHECK(branch.q[j] <= limits.upper[j]);
          } else {
            CHECK(branch.q[j] > -kPi);
            CHECK(branch.q[j] <= kPi);
          }
          fits = fits && zero.fits;
          square += std::pow(turned(branch.q[j], near[j], limits.lower[j], limits.upper[j]).angle - near[j], 2);
        }
        CHECK(branch.within_limits == fits);
        (fits ? inside : outside) += 1;
        if ((fits && !best_fits) || (fits == best_fits && square < least)) {
          least = square;
          best_fits = fits;
        }
      }
      const AnalyticNearest nearest = ik.nearest(pose, near);
      REQUIRE(nearest.status == AnalyticStatus::Ok);
      CHECK(nearest.branch.within_limits == best_fits);
      CHECK((nearest.branch.q - near).norm() == doctest::Approx(std::sqrt(least)).epsilon(1e-6));
      CHECK(misses(chain, nearest.branch.q, pose) < 1e-11);
    }
  }
  CHECK(inside > 500);
  CHECK(outside > 500);
}

TEST_CASE("turns of the KUKA's wrist") {
  const Chain chain = load("kuka_kr6_r900");  // joint 4 ±185°, joint 6 ±350°
  const AnalyticIk ik(chain);
  SixJoints q;
  q << 0.3, -1.2, 1.4, -3.2, 0.9, 5.5;
  const Pose pose = sigmaik::pose(chain, q);
  CHECK(ik.nearest(pose, q).branch.within_limits);
  CHECK((ik.nearest(pose, q).branch.q - q).cwiseAbs().maxCoeff() < 1e-12);
  // Beyond the range of joint 6: joint 6 must come back by a turn, where the other joints leave no other way.
  SixJoints beyond = q, back = q;
  beyond[5] = 6.2;
  back[5] = 6.2 - 2.0 * kPi;
  JointVector lower = beyond.array() - 0.5, upper = beyond.array() + 0.5;
  lower[5] = chain.limits().lower[5];
  upper[5] = chain.limits().upper[5];
  const AnalyticNearest nearest = AnalyticIk(with_limits(chain, lower, upper))
                                      .nearest(sigmaik::pose(chain, beyond), beyond);
  CHECK(nearest.branch.within_limits);
  CHECK((nearest.branch.q - back).cwiseAbs().maxCoeff() < 1e-12);
  // solve() chooses the turns nearest to zero.
  bool found = false;
  const AnalyticSolutions s = ik.solve(pose);
  for (const AnalyticBranch& branch : s) {
    if (apart(branch.q, q) > 1e-9) continue;
    found = true;
    CHECK(branch.q[3] == doctest::Approx(2.0 * kPi - 3.2));
    CHECK(branch.q[5] == doctest::Approx(5.5 - 2.0 * kPi));
    CHECK(branch.within_limits);
  }
  CHECK(found);
  // Many turns, where nothing limits the joints.
  const Chain free = unlimited(chain);
  SixJoints far = q;
  far[5] = 100.0;
  far[0] = -50.0;
  CHECK((AnalyticIk(free).nearest(sigmaik::pose(free, far), far).branch.q - far).cwiseAbs().maxCoeff() < 1e-11);
}

TEST_CASE("a joint on its limit is within it, and stays there") {
  const Chain kuka = load("kuka_kr6_r900");
  Random random(11);
  for (int i = 0; i < 500; ++i) {
    const SixJoints q = configuration(random);
    if (!regular(kuka, q, 1e-2)) continue;
    // Each joint is at an end of its own range, the lower or the upper end, whatever rounding does.
    JointVector lower = q, upper = q;
    for (int j = 0; j < 6; ++j) {
      if (random.chance(0.5)) {
        lower[j] -= 0.5;
      } else {
        upper[j] += 0.5;
      }
    }
    const Chain chain = with_limits(kuka, lower, upper);
    const AnalyticNearest nearest = AnalyticIk(chain).nearest(sigmaik::pose(chain, q), q);
    CHECK(nearest.branch.within_limits);
    CHECK((nearest.branch.q.array() >= lower.array()).all());
    CHECK((nearest.branch.q.array() <= upper.array()).all());
    CHECK((nearest.branch.q - q).cwiseAbs().maxCoeff() < 1e-11);
  }
}

TEST_CASE("nearest follows a path") {
  Random random(12);
  for (const char* const name : kShipped) {
    CAPTURE(name);
    const Chain chain = unlimited(load(name));
    const AnalyticIk ik(chain);
    for (int path = 0; path < 20; ++path) {
      const SixJoints centre = configuration(random), swing = random.vector(6), phase = random.vector(6);
      const auto along = [&](double t) -> SixJoints {
        return centre + SixJoints((swing.array() * (t + phase.array()).sin()).matrix());
      };
      SixJoints last = along(0.0);
      for (int i = 1; i <= 500; ++i) {
        const SixJoints q = along(0.004 * i);
        if (!regular(chain, q, 1e-3)) {  // the neighbours of q merge with it here: another branch may be nearer
          last = q;
          continue;
        }
        const AnalyticNearest nearest = ik.nearest(sigmaik::pose(chain, q), last);
        const double step = (q - last).norm();
        REQUIRE(nearest.status == AnalyticStatus::Ok);
        CHECK((nearest.branch.q - last).norm() <= step * (1.0 + 1e-6) + 1e-9);
        last = regular(chain, q, 1e-2) ? nearest.branch.q : q;
      }
    }
  }
}

TEST_CASE("nearest goes straight through the wrist's singularity") {
  Random random(13);
  for (const char* const name : kShipped) {
    CAPTURE(name);
    const Chain chain = unlimited(load(name));
    const AnalyticIk ik(chain);
    for (int path = 0; path < 50; ++path) {
      SixJoints q = configuration(random);
      if (factors(chain, q).head<2>().cwiseAbs().minCoeff() < 1e-2) continue;
      SixJoints last = q;
      last[4] = -0.1;
      for (int i = -50; i <= 50; ++i) {
        q[4] = 0.002 * i;  // 0 exactly on the way
        const AnalyticNearest nearest = ik.nearest(sigmaik::pose(chain, q), last);
        CHECK((nearest.branch.q - q).cwiseAbs().maxCoeff() < 1e-10);
        CHECK((nearest.branch.singular == sigmaik::kWristSingular) == (i == 0));
        last = nearest.branch.q;
      }
    }
  }
}

TEST_CASE("a free angle keeps to the limits") {
  const Chain kuka = load("kuka_kr6_r900");
  SixJoints q;
  q << 0.3, -1.2, 1.4, 0.7, 0.0, -0.4;
  JointVector lower = kuka.limits().lower, upper = kuka.limits().upper;
  lower[3] = 1.0;
  upper[3] = 4.0;
  const Chain chain = with_limits(kuka, lower, upper);
  const AnalyticIk ik(chain);
  const Pose pose = sigmaik::pose(chain, q);
  const AnalyticNearest nearest = ik.nearest(pose, q);
  CHECK(nearest.branch.within_limits);
  CHECK(nearest.branch.q[3] == 1.0);
  CHECK(misses(chain, nearest.branch.q, pose) < 1e-12);
  const AnalyticSolutions s = ik.solve(pose);
  bool found = false;
  for (const AnalyticBranch& branch : s) {
    if (branch.singular == 0) continue;
    found = true;
    CHECK(branch.q[3] == 1.0);
  }
  CHECK(found);
}

// ---- Refusals -------------------------------------------------------------------------------------------------------

namespace {

std::string refusal(const Chain& chain) {
  try {
    const AnalyticIk ik(chain);
  } catch (const sigmaik::Error& error) {
    return error.what();
  }
  return "";
}

void check_refused(const Chain& chain, const std::string& fact) {
  const std::string text = refusal(chain);
  CAPTURE(text);
  CAPTURE(fact);
  CHECK(text.find(fact) != std::string::npos);
}

}  // namespace

TEST_CASE("arms of other kinds are refused, with the facts") {
  check_refused(load("ur10"), "axis 6 misses the point where axes 4 and 5 meet by 0.115");
  for (const char* const name : {"ufactory_xarm7", "franka_panda", "kuka_lbr_iiwa_14_r820", "kinova_gen3_7dof"}) {
    check_refused(load(name), "there are 7");
  }
  Random random(14);
  for (int i = 0; i < 100; ++i) {
    const Layout good = layout(random, i % 2 == 0);
    Layout l = good;
    CHECK(refusal(chain_of(random, l)).empty());

    l.h[2] = (l.h[2] + 1e-6 * l.h[2].unitOrthogonal()).normalized();
    check_refused(chain_of(random, l), "rad from parallel, a geometry that is not covered");
    l.h[2] = random.unit(3);
    check_refused(chain_of(random, l), "from parallel, a geometry that is not covered");
    l = good;
    l.h[0] = -l.h[1];
    check_refused(chain_of(random, l), "axes 1 and 2 are parallel");
    l = good;
    l.h[4] = l.h[3];
    check_refused(chain_of(random, l), "axes 4 and 5 are parallel");
    l = good;
    l.h[5] = -l.h[4];
    check_refused(chain_of(random, l), "axes 5 and 6 are parallel");
    l = good;
    l.o[3] += 0.01 * l.h[3].cross(l.h[4]).normalized();
    check_refused(chain_of(random, l), "axes 4 and 5 miss each other by 0.0");
    l = good;
    l.o[5] += 0.02 * l.h[5].unitOrthogonal();
    check_refused(chain_of(random, l), "axis 6 misses the point where axes 4 and 5 meet by 0.0");
    l = good;
    l.o[2] = l.o[1];
    check_refused(chain_of(random, l), "axes 2 and 3 are one line");
    l = good;
    l.o[3] = l.o[4] = l.o[5] = l.o[2] + 0.3 * l.h[2];
    check_refused(chain_of(random, l), "the wrist centre lies on axis 3");

    // Below the tolerance: the arm is accepted, and its answers are as exact as the tolerance.
    l = good;
    l.h[2] = (l.h[2] + 1e-10 * l.h[2].unitOrthogonal()).normalized();
    l.o[5] += 1e-10 * l.h[5].unitOrthogonal();
    const Chain nearly = chain_of(random, l);
    REQUIRE(refusal(nearly).empty());
    const SixJoints q = configuration(random);
    if (!regular(nearly, q, 1e-2)) continue;
    const Pose pose = sigmaik::pose(nearly, q);
    const AnalyticSolutions s = AnalyticIk(nearly).solve(pose);
    CHECK(nearest_branch(s, q) < 1e-6);
    for (const AnalyticBranch& branch : s) CHECK(misses(nearly, branch.q, pose) < 2e-9);
  }
  // Every fault at once.
  Layout l = layout(random, true);
  l.o[5] += 0.1 * l.h[4];
  l.h[2] = random.unit(3);
  check_refused(chain_of(random, l), "axes 2 and 3");
  check_refused(chain_of(random, l), "; axis 6 misses");

  std::vector<Segment> segments = load("kuka_kr6_r900").segments();
  segments[2].type = JointType::Prismatic;
  check_refused(Chain("base", segments), "joint 'joint_a3' is prismatic");
  segments[2].type = JointType::Fixed;
  check_refused(Chain("base", segments), "needs 6 joints");
}

// ---- Real time ------------------------------------------------------------------------------------------------------

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("no heap") {
  Random random(15);
  for (int arm = 0; arm < 20; ++arm) {
    const Chain chain = random_arm(random, arm % 2 == 0);
    const AnalyticIk ik(chain);
    const SixJoints q = configuration(random);
    SixJoints singular = q;
    make_singular(chain, 2, singular, random);
    Pose far = sigmaik::pose(chain, q);
    far.translation() *= 100.0;
    Pose bad = far;
    bad.linear() *= 2.0;
    for (const Pose& pose : {sigmaik::pose(chain, q), sigmaik::pose(chain, singular), far, bad}) {
      int count = 0;
      const test::HeapWatch watch;
      count += ik.solve(pose).count;
      count += static_cast<int>(ik.nearest(pose, q).status);
      CHECK(watch.calls() == 0);
      CHECK(count >= 0);
    }
  }
}
#endif
