// The largest speed of the tool and of the elbow, measured from positions by KDL: no cycle is faster.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include <kdl/chainfksolverpos_recursive.hpp>

#include <sigmaik/kdl.hpp>
#include <sigmaik/servo.hpp>

#include "arms.hpp"
#include "configurations.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using Eigen::Vector3d;
using test::Random;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// All origins of KDL's segments whose joint moves, the tip, and points of the tool.
class Points {
 public:
  Points(const Chain& chain, const ToolPoints& tool) : chain_(to_kdl(chain)), solver_(chain_), tool_(tool) {}

  std::vector<Vector3d> at(const JointVector& q) {
    KDL::JntArray joints(static_cast<unsigned>(q.size()));
    joints.data = q;
    std::vector<Vector3d> out;
    for (unsigned k = 0; k < chain_.getNrOfSegments(); ++k) {
      const bool last = k + 1 == chain_.getNrOfSegments();
      if (chain_.getSegment(k).getJoint().getType() == KDL::Joint::Fixed && !last) continue;
      KDL::Frame frame;
      solver_.JntToCart(joints, frame, static_cast<int>(k) + 1);
      out.emplace_back(frame.p[0], frame.p[1], frame.p[2]);
      if (!last) continue;
      for (Eigen::Index i = 0; i < tool_.cols(); ++i) {
        const KDL::Vector p = frame * KDL::Vector(tool_(0, i), tool_(1, i), tool_(2, i));
        out.emplace_back(p[0], p[1], p[2]);
      }
    }
    return out;
  }

 private:
  KDL::Chain chain_;
  KDL::ChainFkSolverPos_recursive solver_;
  ToolPoints tool_;
};

double fastest(const std::vector<Vector3d>& from, const std::vector<Vector3d>& to, double dt) {
  double speed = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i) speed = std::max(speed, (to[i] - from[i]).norm() / dt);
  return speed;
}

Chain without_position_limits(const Chain& chain) {
  JointLimits limits = chain.limits();
  limits.lower.setConstant(-kInfinity);
  limits.upper.setConstant(kInfinity);
  return chain.with_limits(limits);
}

struct Tally {
  long cycles = 0, broken = 0, limited = 0;
  double worst = 0.0;  // in parts of the limit
};

// Targets and twists that jump, holds, and cycles of any time where `uneven`.
void drive(Random& random, const Chain& chain, ServoOptions options, bool uneven, int cycles, Tally& tally) {
  options.max_tool_speed = random.decades(-1.5, 0.3);
  if (random.chance(0.5)) {
    options.speed_points.resize(3, random.integer(1, 3));
    for (double& x : options.speed_points.reshaped()) x = random.uniform(-0.2, 0.2);
  }
  Servo servo(chain, JParse{}, options);
  servo.reset(test::sample(random, chain));
  Points points(chain, options.speed_points);
  std::vector<Vector3d> before = points.at(servo.q());
  Pose target = servo.tip();
  Twist twist = Twist::Zero();
  int mode = 0;
  for (int cycle = 0; cycle < cycles; ++cycle) {
    if (random.chance(0.01)) {
      mode = random.integer(0, 5);
      target = pose(chain, test::sample(random, chain));
      twist << random.decades(-1.0, 1.0) * random.unit(3), random.decades(-1.0, 1.0) * random.unit(3);
    }
    const double dt = options.dt * (uneven ? random.decades(-1.0, 1.3) * 0.999 + 1e-4 : 1.0);
    const ServoStep step = mode == 5   ? servo.hold(dt)
                           : mode >= 3 ? servo.update_twist(twist, dt)
                                       : servo.update(target, Twist::Zero(), dt);
    const std::vector<Vector3d> now = points.at(step.q);
    const double part = fastest(before, now, dt) / options.max_tool_speed;
    before = now;
    ++tally.cycles;
    tally.limited += step.tool_speed_limits;
    tally.broken += part > 1.0 + 1e-9;
    tally.worst = std::max(tally.worst, part);
    CHECK(std::abs(step.tool_speed - part * options.max_tool_speed) <= 1e-9 * options.max_tool_speed);
  }
}

}  // namespace

TEST_CASE("no checked point is faster than max_tool_speed, for any arms, targets, twists and stops") {
  for (const bool uneven : {false, true}) {
    Tally tally;
    for (unsigned seed = 0; seed < 60; ++seed) {
      Random random(seed);
      auto arm = test::arms().begin();
      std::advance(arm, random.integer(0, static_cast<int>(test::arms().size()) - 1));
      const Chain chain = random.chance(0.5) ? without_position_limits(arm->second)
                                             : random.chain(random.integer(2, 8), 0.15);
      ServoOptions options;
      options.dt = random.decades(-3.3, -2.3);
      options.on_limit = random.chance(0.3) ? OnLimit::Scale : OnLimit::Redistribute;
      drive(random, chain, options, uneven, 400, tally);
    }
    CAPTURE(uneven);
    MESSAGE("worst " << tally.worst << " of the limit, limited in " << tally.limited << " of " << tally.cycles);
    CHECK(tally.broken == 0);
    CHECK(tally.limited > tally.cycles / 4);
  }
}

TEST_CASE("position and jerk limits come first: a checked point is hardly ever faster then") {
  for (const bool jerk : {false, true}) {
    Tally tally;
    for (unsigned seed = 0; seed < 200; ++seed) {
      Random random(1000 + seed);
      auto arm = test::arms().begin();
      std::advance(arm, random.integer(0, static_cast<int>(test::arms().size()) - 1));
      JointLimits limits = arm->second.limits();
      if (jerk) limits.jerk.setConstant(random.decades(2.0, 4.0));
      ServoOptions options;
      options.dt = random.decades(-3.3, -2.3);
      options.on_limit = random.chance(0.3) ? OnLimit::Scale : OnLimit::Redistribute;
      drive(random, arm->second.with_limits(limits), options, false, 400, tally);
    }
    CAPTURE(jerk);
    MESSAGE("worst " << tally.worst << " of the limit, broken in " << tally.broken << " of " << tally.cycles);
    CHECK(tally.broken <= tally.cycles / 500);
    CHECK(tally.worst <= 1.3);
  }
}

TEST_CASE("an arm that starts faster becomes slow as fast as its limits allow, and never faster meanwhile") {
  for (unsigned seed = 0; seed < 40; ++seed) {
    Random random(seed);
    const Chain chain = without_position_limits(test::arms().at("ur10"));
    ServoOptions options;
    options.max_tool_speed = 0.25;
    Servo servo(chain, JParse{}, options);
    const JointVector qdot = 0.8 * random.vector(6).cwiseProduct(chain.limits().velocity).cwiseMin(3.0).cwiseMax(-3.0);
    servo.reset(test::sample(random, chain), qdot);
    Points points(chain, options.speed_points);
    std::vector<Vector3d> before = points.at(servo.q());
    int slow_after = -1;
    for (int cycle = 0; cycle < 1000; ++cycle) {
      Twist twist;
      twist << 1.0, 0.5, -0.2, 0.3, 0.1, 0.5;
      const ServoStep step = servo.update_twist(twist);
      const std::vector<Vector3d> now = points.at(step.q);
      const double speed = fastest(before, now, options.dt);
      before = now;
      if (slow_after < 0 && speed <= 0.25) slow_after = cycle;
      if (slow_after >= 0) CHECK(speed <= 0.25 * (1.0 + 1e-9));
    }
    CAPTURE(seed);
    CHECK(slow_after >= 0);
    CHECK(slow_after <= 1e3 * qdot.cwiseAbs().maxCoeff() / 10.0 + 1);  // all joints stop within this time
  }
}

TEST_CASE("the motion slows down along its direction, and without the limit nothing changes") {
  Random random(3);
  const Chain chain = without_position_limits(test::arms().at("ur10"));
  ServoOptions options;
  Servo free(chain, JParse{}, options);
  options.max_tool_speed = 0.25;
  Servo slow(chain, JParse{}, options);
  options.max_tool_speed = 1e3;
  Servo fast(chain, JParse{}, options);
  JointVector q(6);
  q << 0.3, -1.2, 1.5, -0.4, 1.2, 0.1;
  for (Servo* servo : {&free, &slow, &fast}) servo->reset(q);
  Twist twist = Twist::Zero();
  twist.head<3>() << 0.3, 0.2, 0.4;
  ServoStep step;
  for (int cycle = 0; cycle < 300; ++cycle) {
    step = slow.update_twist(twist);
    const ServoStep a = free.update_twist(twist), b = fast.update_twist(twist);
    CHECK(a.qdot == b.qdot);
    CHECK(!b.tool_speed_limits);
    CHECK(a.tool_speed == 0.0);
  }
  CHECK(step.tool_speed_limits);
  CHECK(step.status == Status::Limited);
  CHECK(step.tool_speed == doctest::Approx(0.25).epsilon(1e-3));
  const Vector3d v = step.achieved_twist.head<3>();
  CHECK(v.normalized().dot(twist.head<3>().normalized()) > 1.0 - 1e-6);
  CHECK(step.scale == doctest::Approx(v.norm() / twist.head<3>().norm()).epsilon(1e-3));
}
