// Cycles whose time is told, and differs from one to the next: limits hold against the clock.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include <sigmaik/pose.hpp>
#include <sigmaik/servo.hpp>

#include "arms.hpp"
#include "configurations.hpp"
#include "numbers.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::kInfinity;
using test::kNan;
using test::Random;

// The limits against the clock, from differences of the positions' velocities, as parts of the limits.
class ClockWatch {
 public:
  ClockWatch(const JointLimits& limits, const JointVector& q, double dt, double assumed = 10.0)
      : limits_(limits), q_(q), v_(JointVector::Zero(q.size())), a_(v_), last_(dt) {
    for (double& a : limits_.acceleration) a = a < kInfinity ? a : assumed;
    if (limits_.deceleration.size() == 0) limits_.deceleration = limits_.acceleration;
    limits_.deceleration = (limits_.deceleration.array() < kInfinity)
                               .select(limits_.deceleration, limits_.acceleration);
  }

  void step(const JointVector& q, const JointVector& qdot, double h) {
    const double middles = 0.5 * (h + last_);
    for (Eigen::Index i = 0; i < q.size(); ++i) {
      const double v = (q[i] - q_[i]) / h, rounding = 4e-16 * (1.0 + std::abs(q[i])) / h;
      sum = std::max(sum, (std::abs(v - qdot[i]) - 4.0 * rounding) / (1.0 + std::abs(v)));
      position = std::max({position, q[i] - limits_.upper[i], limits_.lower[i] - q[i]});
      velocity = std::max(velocity, std::abs(qdot[i]) / limits_.velocity[i]);
      const double change = qdot[i] - v_[i], a = change / h, fine = 4e-15 * (std::abs(qdot[i]) + std::abs(v_[i]));
      acceleration = std::max(acceleration, (std::abs(a) - fine / h) / motor(i, qdot[i]));
      between_middles = std::max(between_middles, (std::abs(change) - fine) / middles / motor(i, qdot[i]));
      const double slack = 2.0 * fine / std::min(h, last_);
      jerk = std::max(jerk, (std::abs(a - a_[i]) - slack) / middles / limits_.jerk[i]);
      a_[i] = a;
    }
    q_ = q;
    v_ = qdot;
    last_ = h;
  }

  double sum = 0.0, position = 0.0, velocity = 0.0, acceleration = 0.0, between_middles = 0.0, jerk = 0.0;

 private:
  // The limit of a joint that speeds up, that brakes, or that turns round.
  double motor(Eigen::Index i, double v) const {
    const double a = limits_.acceleration[i], b = limits_.deceleration[i];
    if (v * v_[i] < 0.0) return std::min(a, b);
    return std::abs(v) > std::abs(v_[i]) ? a : b;
  }

  JointLimits limits_;
  JointVector q_, v_, a_;
  double last_;
};

// Times of cycles in parts of dt.
double part(Random& random, int kind) {
  switch (kind) {
    case 0: return random.decades(-1.0, std::log10(20.0) - 1e-12);  // anything
    case 1: return random.uniform(0.7, 1.6);                        // a loop without real time
    case 2: return random.chance(0.02) ? 2.0 : 1.0;                 // a lost packet
    case 3: return random.chance(0.5) ? 0.1 : 20.0;                 // the ends of the range
    default: return random.chance(0.3) ? random.uniform(1.0, 4.0) : 1.0;
  }
}

JointLimits one_joint(Random& random, bool jerk) {
  JointLimits limits;
  const double half = random.decades(-1.0, 0.5);
  limits.lower.setConstant(1, -half);
  limits.upper.setConstant(1, half);
  limits.velocity.setConstant(1, random.chance(0.8) ? random.decades(-1.0, 1.0) : kInfinity);
  limits.acceleration.setConstant(1, random.decades(0.0, 2.0));
  limits.jerk.setConstant(1, jerk ? random.decades(0.5, 4.5) : kInfinity);
  if (random.chance(0.3)) limits.deceleration = random.decades(-0.5, 0.5) * limits.acceleration;
  limits.effort.setConstant(1, kInfinity);
  return limits;
}

}  // namespace

TEST_CASE("position limits hold for any choice inside the bounds and any times of cycles, at the change, too") {
  for (const bool jerk : {false, true}) {
    for (const bool changes : {false, true}) {
      double position = 0.0, acceleration = 0.0, between_middles = 0.0, jerks = 0.0, lost = 0.0;
      for (unsigned seed = 0; seed < 600; ++seed) {
        Random random(seed);
        const double dt = random.decades(-4.0, -2.0);
        const JointLimits limits = one_joint(random, jerk);
        LimitTracker tracker(limits, dt);
        JointVector q = 0.9 * random.uniform(-1.0, 1.0) * limits.upper;
        tracker.reset(q);
        ClockWatch watch(limits, q, dt);
        const int kind = random.integer(0, 4), even = changes ? random.integer(50, 800) : 0;
        if (!changes) REQUIRE(tracker.set_cycle(1.7 * dt));  // the first cycle has another time
        int way = 1;
        for (int cycle = 0; cycle < 1200; ++cycle) {
          const double h = cycle < even ? dt : cycle == 0 ? 1.7 * dt : part(random, kind) * dt;
          REQUIRE(tracker.set_cycle(h));
          if (random.chance(0.01)) way = random.integer(-1, 1);
          const VelocityBounds& bounds = tracker.bounds();
          REQUIRE(bounds.lower[0] <= bounds.upper[0]);
          JointVector qdot = way > 0 ? bounds.upper : way < 0 ? bounds.lower : tracker.stop();
          if (random.chance(0.2)) qdot[0] = random.uniform(bounds.lower[0], bounds.upper[0]);
          if (!(std::abs(qdot[0]) < 1e3)) qdot[0] = std::copysign(1e3, qdot[0]);
          tracker.advance(qdot);
          watch.step(tracker.q(), qdot, h);
        }
        CHECK(watch.velocity <= 1.0 + 1e-9);
        position = std::max(position, watch.position);
        (kind == 2 || kind == 4 ? lost : acceleration) = std::max(kind == 2 || kind == 4 ? lost : acceleration,
                                                                  watch.acceleration);
        between_middles = std::max(between_middles, watch.between_middles);
        jerks = std::max(jerks, watch.jerk);
      }
      CAPTURE(jerk);
      CAPTURE(changes);
      CHECK(position <= 1e-11);
      if (!changes) {
        CHECK(acceleration <= 1.0 + 1e-8);
        CHECK(lost <= 1.0 + 1e-8);
        if (!jerk) CHECK(between_middles <= 1.0 + 1e-8);
        if (jerk) CHECK(jerks <= 1.0 + 1e-5);
      } else if (!jerk) {
        CHECK(lost <= 1.0 + 1e-8);  // no cycle is shorter than dt
        CHECK(acceleration <= 10.0 + 1e-6);
      }
    }
  }
}

TEST_CASE(
    "lost packets and a loop without real time: 1.0 of the limits against the clock, with the time of each cycle") {
  for (const bool told : {true, false}) {
    double acceleration = 0.0, between_middles = 0.0, position = 0.0, velocity = 0.0;
    for (unsigned seed = 0; seed < 40; ++seed) {
      Random random(seed);
      auto arm = test::arms().begin();
      std::advance(arm, seed % test::arms().size());
      const Chain& chain = arm->second;
      Servo servo(chain);
      const double dt = servo.options().dt;
      servo.reset(test::sample(random, chain));
      ClockWatch watch(chain.limits(), servo.q(), dt);
      Pose target = servo.tip();
      Twist twist = Twist::Zero();
      bool poses = true;
      for (int cycle = 0; cycle < 1500; ++cycle) {
        if (random.chance(0.004)) {
          poses = random.chance(0.5);
          target = pose(chain, test::sample(random, chain));
          twist << random.vector(3), 2.0 * random.vector(3);
        }
        const double h = dt * part(random, 1 + seed % 2);
        const std::optional<double> time = told ? std::optional<double>(h) : std::nullopt;
        const ServoStep step = poses ? servo.update(target, Twist::Zero(), time) : servo.update_twist(twist, time);
        watch.step(step.q, told ? step.qdot : JointVector(step.qdot * (dt / h)), h);
      }
      acceleration = std::max(acceleration, watch.acceleration);
      between_middles = std::max(between_middles, watch.between_middles);
      position = std::max(position, watch.position);
      velocity = std::max(velocity, watch.velocity);
    }
    CHECK(position <= 0.0);
    if (told) {
      CHECK(acceleration <= 1.0 + 1e-8);
      CHECK(between_middles <= 1.0 + 1e-8);
      CHECK(velocity <= 1.0 + 1e-9);
    } else {
      CHECK(acceleration > 10.0);  // why the time matters
    }
  }
}

TEST_CASE("limits hold against the clock with jerk limits, holds and bad input between") {
  double acceleration = 0.0, jerk = 0.0, position = 0.0, sum = 0.0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    Random random(seed);
    auto arm = test::arms().begin();
    std::advance(arm, seed % test::arms().size());
    JointLimits limits = arm->second.limits();
    limits.jerk.setConstant(random.decades(2.0, 4.0));
    const Chain chain = arm->second.with_limits(limits);
    ServoOptions options;
    options.dt = random.decades(-3.5, -2.0);
    Servo servo(chain, JParse{}, options);
    servo.reset(test::sample(random, chain));
    ClockWatch watch(limits, servo.q(), options.dt);
    Pose target = servo.tip();
    const int kind = random.integer(0, 3);
    for (int cycle = 0; cycle < 600; ++cycle) {
      if (random.chance(0.01)) target = pose(chain, test::sample(random, chain));
      const double h = options.dt * (cycle == 0 ? 1.5 : part(random, kind));
      Pose bad = target;
      bad.linear() *= 2.0;
      const ServoStep step = random.chance(0.02) ? servo.hold(h)
                                                 : servo.update(random.chance(0.01) ? bad : target, Twist::Zero(), h);
      watch.step(step.q, step.qdot, h);
    }
    CHECK(watch.velocity <= 1.0 + 1e-9);
    acceleration = std::max(acceleration, watch.acceleration);
    jerk = std::max(jerk, watch.jerk);
    position = std::max(position, watch.position);
    sum = std::max(sum, watch.sum);
  }
  CHECK(position <= 0.0);
  CHECK(acceleration <= 1.0 + 1e-8);
  CHECK(jerk <= 1.0 + 1e-5);
  CHECK(sum <= 1e-9);
}

TEST_CASE("with dt in each call, and with no time, the commands are the same to the last digit") {
  for (const auto& arm : test::arms()) {
    Random random(7);
    JointLimits limits = arm.second.limits();
    if (random.chance(0.5)) limits.jerk.setConstant(500.0);
    const Chain chain = arm.second.with_limits(limits);
    Servo a(chain), b(chain);
    const JointVector start = test::sample(random, chain);
    a.reset(start);
    b.reset(start);
    Pose target = a.tip();
    int differ = 0;
    for (int cycle = 0; cycle < 500; ++cycle) {
      if (random.chance(0.02)) target = pose(chain, test::sample(random, chain));
      const Twist twist = 0.3 * random.vector(6);
      const bool poses = cycle / 100 % 2 == 0;
      const ServoStep x = poses ? a.update(target) : a.update_twist(twist);
      const ServoStep y = poses ? b.update(target, Twist::Zero(), 1e-3) : b.update_twist(twist, 1e-3);
      differ += x.q != y.q || x.qdot != y.qdot;
    }
    CAPTURE(arm.first);
    CHECK(differ == 0);
  }
}

TEST_CASE("a time outside the range is bad input: the arm brakes inside its limits") {
  const Chain& chain = test::arms().at("ur10");
  for (const double wrong : {0.0, -1e-3, kNan, 0.09e-3, 20.1e-3, 1e9, kInfinity, -kInfinity}) {
    CAPTURE(wrong);
    Servo servo(chain);
    JointVector q(6);
    q << 0.3, -1.2, 1.5, -0.4, 1.2, 0.1;
    servo.reset(q);
    Twist twist = Twist::Zero();
    twist[2] = 0.2;
    for (int cycle = 0; cycle < 200; ++cycle) servo.update_twist(twist);
    const double before = servo.qdot().norm();
    REQUIRE(before > 0.05);
    for (int call = 0; call < 3; ++call) {
      const double last = servo.qdot().norm();
      const ServoStep step = call == 0   ? servo.update_twist(twist, wrong)
                             : call == 1 ? servo.update(servo.tip(), Twist::Zero(), wrong)
                                         : servo.hold(wrong);
      CHECK(step.status == Status::BadInput);
      CHECK((step.qdot.norm() < last || last == 0.0));
    }
    CHECK(servo.update_twist(twist).status != Status::BadInput);
    CHECK(servo.update_twist(twist, 0.1e-3).status != Status::BadInput);
    CHECK(servo.update_twist(twist, 20e-3).status != Status::BadInput);
  }
}

TEST_CASE("an arm arrives and rests in cycles of any time") {
  for (unsigned seed = 0; seed < 24; ++seed) {
    Random random(seed);
    auto arm = test::arms().begin();
    std::advance(arm, seed % test::arms().size());
    const Chain& chain = arm->second;
    Servo servo(chain);
    const JointVector start = test::sample(random, chain);
    servo.reset(0.8 * start);
    const Pose target = pose(chain, 0.8 * start + 0.02 * random.vector(chain.dof()));
    const int kind = random.integer(0, 4);
    for (double time = 0.0; time < 6.0;) {
      const double h = 1e-3 * part(random, kind);
      servo.update(target, Twist::Zero(), h);
      time += h;
    }
    CAPTURE(seed);
    CHECK(servo.qdot().cwiseAbs().maxCoeff() < 1e-3);
  }
}
