// The servo, cycle by cycle, on the shipped arms and on random ones: rules, starts, fades, postures.
// test_servo_limits.cpp tests the effect of limits; here limits are off, or far away, or limits of velocity alone.

#include <doctest/doctest.h>

#include <map>
#include <numbers>

#include <sigmaik/error.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/servo.hpp>

#include "arms.hpp"
#include "heap.hpp"
#include "methods.hpp"
#include "numbers.hpp"
#include "random.hpp"
#include "settling.hpp"
#include "twin.hpp"

namespace {

using namespace sigmaik;
using test::all_methods;
using test::kInfinity;
using test::kNan;
using test::MatrixXd;
using test::Random;
using test::VectorXd;

using test::arms;

double singular_ratio(const Chain& chain, const JointVector& q) {
  ChainState state;
  update(chain, q, state);
  Spectrum s;
  s.decompose(state.jacobian);
  return s.sigma(s.size() - 1) / s.sigma(0);
}

// A configuration inside the limits, away from singularities.
JointVector regular_configuration(Random& random, const Chain& chain, double least_ratio = 0.08) {
  for (;;) {
    JointVector q(chain.dof());
    for (int i = 0; i < chain.dof(); ++i) {
      q[i] = random.uniform(std::max(chain.limits().lower[i], -2.5), std::min(chain.limits().upper[i], 2.5));
    }
    if (singular_ratio(chain, q) >= least_ratio) return q;
  }
}

bool same(const ServoStep& a, const ServoStep& b) {
  return a.q == b.q && a.qdot == b.qdot && a.status == b.status && a.pose_error == b.pose_error && a.scale == b.scale &&
         a.limiting_joints == b.limiting_joints && a.achieved_twist == b.achieved_twist;
}

// Options for the rule alone.
ServoOptions free_options() {
  ServoOptions options;
  options.limits.position = options.limits.velocity = options.limits.acceleration = options.limits.jerk = false;
  return options;
}

// Options for velocity limits alone, by scaling.
ServoOptions scaled_options() {
  ServoOptions options = free_options();
  options.limits.velocity = true;
  options.on_limit = OnLimit::Scale;
  return options;
}

// Checks that hold for every step, whatever the command is. Position limits count for joints that are inside.
void check_step(const Chain& chain, const ServoStep& step, const JointVector& before, const ServoOptions& options) {
  REQUIRE(step.qdot.size() == chain.dof());
  REQUIRE(step.q.size() == chain.dof());
  CHECK(step.qdot.allFinite());
  CHECK(step.q.allFinite());
  CHECK(step.achieved_twist.allFinite());
  const JointLimits& limits = chain.limits();
  for (int i = 0; i < chain.dof(); ++i) {
    if (options.limits.velocity) CHECK(std::abs(step.qdot[i]) <= limits.velocity[i]);
    CHECK(std::abs(step.q[i] - before[i] - options.dt * step.qdot[i]) <= 1e-12 * (1.0 + std::abs(before[i])));
    if (!options.limits.position || before[i] < limits.lower[i] || before[i] > limits.upper[i]) continue;
    CHECK(step.q[i] >= limits.lower[i]);
    CHECK(step.q[i] <= limits.upper[i]);
  }
  CHECK(step.scale >= 0.0);
  CHECK(step.scale <= 1.0);
  if (step.scale < 1.0) CHECK(step.status == Status::Limited);
  if (step.status == Status::Limited) CHECK(step.limiting_joints != 0);
  if (options.on_limit != OnLimit::Scale || step.status == Status::Limited) return;
  for (int i = 0; i < chain.dof(); ++i) {  // less than 1e-4 of the twist is missing
    if ((step.limiting_joints >> i & 1) != 0) CHECK(std::abs(step.qdot[i]) >= limits.velocity[i] * (1.0 - 1e-12));
  }
}

}  // namespace

TEST_CASE("every arm reaches each target that it can reach") {
  REQUIRE(arms().size() == 9);
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    Random random(1);
    for (int repeat = 0; repeat < 10; ++repeat) {
      CAPTURE(name);
      CAPTURE(repeat);
      const JointVector start = regular_configuration(random, chain);
      JointVector goal;
      do {
        goal = start;
        for (int i = 0; i < chain.dof(); ++i) {
          goal[i] = std::clamp(goal[i] + random.uniform(-0.4, 0.4), chain.limits().lower[i], chain.limits().upper[i]);
        }
      } while (singular_ratio(chain, goal) < 0.06);  // towards a singular pose the arm is slow
      const Pose target = pose(chain, goal);
      ServoOptions options;
      options.dt = 0.004;
      Servo servo(chain, JParse{}, options);
      servo.reset(start);
      JointVector before = start;
      ServoStep step;
      for (int cycle = 0; cycle < 2500; ++cycle) {
        step = servo.update(target);
        check_step(chain, step, before, options);
        before = step.q;
      }
      const double near = step.limiting_joints == 0 ? 1e-6 : 1e-4;  // along a limit the arm takes longer
      CHECK(step.pose_error.head<3>().norm() < near);
      CHECK(step.pose_error.tail<3>().norm() < near);
      CHECK((servo.tip().matrix() - target.matrix()).cwiseAbs().maxCoeff() < near);
      CHECK(servo.q() == step.q);
    }
  }
}

TEST_CASE("velocity limits are kept without tolerance, by scaling, and the limiting joints are named") {
  Random random(2);
  int limited = 0;
  for (const auto& [key, shipped] : arms()) {
    const std::string& name = key;
    for (int repeat = 0; repeat < 20; ++repeat) {
      CAPTURE(name);
      JointLimits limits = shipped.limits();
      for (int i = 0; i < shipped.dof(); ++i) limits.velocity[i] = random.decades(-2.0, 0.5);
      if (random.chance(0.3)) limits.velocity[random.integer(0, shipped.dof() - 1)] = kInfinity;
      const Chain chain = shipped.with_limits(limits);
      const Method method = all_methods()[static_cast<std::size_t>(repeat) % all_methods().size()];
      ServoOptions options = scaled_options();
      options.soft_start = 0.0;
      options.gain_linear = options.gain_angular = random.decades(0.0, 2.0);
      Servo servo(chain, method, options);
      JointVector before = regular_configuration(random, chain);
      servo.reset(before);
      const Pose target = pose(chain, regular_configuration(random, chain));
      for (int cycle = 0; cycle < 100; ++cycle) {
        ChainState state;
        update(chain, before, state);
        const ServoStep step = servo.update(target);
        check_step(chain, step, before, options);
        CHECK((step.achieved_twist - state.jacobian * step.qdot).norm() < 1e-14 * (1.0 + step.qdot.norm()));
        if (step.status == Status::Limited) {
          ++limited;
          // The answer of the rule alone.
          Twist twist = pose_error(state.tip, target);
          CHECK(twist == step.pose_error);
          twist.head<3>() *= std::min(1.0, servo.max_linear_error() / twist.head<3>().norm()) * options.gain_linear;
          twist.tail<3>() *= std::min(1.0, options.max_angular_error / twist.tail<3>().norm()) * options.gain_angular;
          VelocitySolver solver = test::rule_of(servo);
          const VectorXd asked = solver.solve(state.jacobian, twist).qdot;
          CHECK((step.qdot - step.scale * asked).norm() < 1e-7 * (step.qdot.norm() + 1e-3));
          for (int i = 0; i < chain.dof(); ++i) {
            const bool named = (step.limiting_joints >> i & 1) != 0;
            const double part = std::abs(step.qdot[i]) / limits.velocity[i];
            if (named) CHECK(part == doctest::Approx(1.0).epsilon(1e-11));
            if (part > 1.0 - 1e-13) CHECK(named);
          }
        }
        before = step.q;
      }
    }
  }
  CHECK(limited > 3000);
}

TEST_CASE("one cycle, by the formula: gains, caps, posture and weights") {
  Random random(24);
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    for (int repeat = 0; repeat < 40; ++repeat) {
      CAPTURE(name);
      ServoOptions options = free_options();
      options.soft_start = 0.0;
      options.gain_linear = random.uniform(0.0, 10.0);
      options.gain_angular = random.uniform(0.0, 10.0);
      options.max_linear_error = random.decades(-2.0, 1.0);
      options.max_angular_error = random.decades(-2.0, 1.0);
      options.length_scale = random.decades(-1.0, 1.0);
      options.posture = regular_configuration(random, chain);
      options.posture_gain = random.uniform(0.0, 5.0);
      options.posture_max_speed = random.decades(-2.0, 1.0);
      const Method method = DampedLeastSquares{random.decades(-2.0, 0.0)};  // this rule damps every direction in part
      const JointVector start = regular_configuration(random, chain);
      const Pose target = pose(chain, regular_configuration(random, chain));
      Servo servo(chain, method, options);
      servo.reset(start);
      const ServoStep step = servo.update(target);

      ChainState state;
      update(chain, start, state);
      Twist twist = pose_error(state.tip, target);
      CHECK(step.pose_error == twist);
      twist.head<3>() *= options.gain_linear * std::min(1.0, servo.max_linear_error() / twist.head<3>().norm());
      twist.tail<3>() *= options.gain_angular * std::min(1.0, options.max_angular_error / twist.tail<3>().norm());
      JointVector posture(chain.dof());
      for (int i = 0; i < chain.dof(); ++i) {
        double away = options.posture[i] - start[i];
        if (chain.joint_types()[static_cast<std::size_t>(i)] == JointType::Continuous) {
          away = std::remainder(away, 2.0 * std::numbers::pi);
        }
        posture[i] = std::clamp(options.posture_gain * away, -options.posture_max_speed, options.posture_max_speed);
      }
      VelocitySolver solver = test::rule_of(servo);
      const Solution expected = solver.solve(state.jacobian, twist, posture);
      CHECK((step.qdot - expected.qdot).norm() < 1e-10 * (1.0 + expected.qdot.norm()));
      CHECK((step.achieved_twist - expected.achieved_twist).norm() < 1e-10 * (1.0 + expected.qdot.norm()));
      CHECK((step.singular_values - expected.singular_values).norm() < 1e-12 * expected.singular_values[0]);
      CHECK(step.status == expected.status);
      CHECK(step.task_rows == 6);
    }
  }
}

TEST_CASE("without limits nothing is held back") {
  const Chain& chain = arms().at("ufactory_xarm7");
  ServoOptions options = free_options();
  options.soft_start = 0.0;
  Servo servo(chain, JParse{}, options);
  Random random(3);
  servo.reset(regular_configuration(random, chain));
  Twist twist = Twist::Zero();
  twist[0] = 50.0;
  const ServoStep step = servo.update_twist(twist);
  CHECK(step.status == Status::Ok);
  CHECK(step.scale == 1.0);
  CHECK((step.qdot.cwiseAbs() - chain.limits().velocity).maxCoeff() > 0.0);
}

TEST_CASE("reset: a target at the tip's own pose moves nothing, and the start is the posture") {
  Random random(4);
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    for (const Method& method : all_methods()) {
      CAPTURE(name);
      ServoOptions options;
      options.posture_gain = 3.0;
      options.soft_start = 0.0;
      Servo servo(chain, method, options);
      const JointVector start = regular_configuration(random, chain);
      servo.reset(start);
      const Pose own = servo.tip();
      CHECK(own.matrix() == pose(chain, start).matrix());
      for (int cycle = 0; cycle < 50; ++cycle) {
        const ServoStep step = servo.update(own);
        CHECK(step.qdot.norm() < 1e-12);
        CHECK(step.status <= Status::Damped);  // of rounding
      }
      CHECK((servo.q() - start).norm() < 1e-13);
    }
  }
}

TEST_CASE("reset forgets everything before it") {
  Random random(5);
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    CAPTURE(name);
    ServoOptions options;
    options.posture_gain = 1.0;
    Servo used(chain, JParse{}, options), fresh(chain, JParse{}, options);
    used.reset(regular_configuration(random, chain), random.vector(chain.dof()));
    for (int cycle = 0; cycle < 37; ++cycle) used.update(pose(chain, regular_configuration(random, chain)));
    const JointVector start = regular_configuration(random, chain);
    const Pose target = pose(chain, regular_configuration(random, chain));
    used.reset(start);
    fresh.reset(start);
    for (int cycle = 0; cycle < 300; ++cycle) {
      const ServoStep a = used.update(target), b = fresh.update(target);
      REQUIRE(same(a, b));
    }
  }
}

TEST_CASE("soft start: the command of a pose target grows from zero, a twist command acts at once") {
  Random random(6);
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    CAPTURE(name);
    ServoOptions soft = free_options(), hard = free_options();
    // At this gain the arm's own motion changes the command by less than the fading does.
    soft.gain_linear = soft.gain_angular = hard.gain_linear = hard.gain_angular = 5.0;
    soft.soft_start = 0.1;
    hard.soft_start = 0.0;
    const JointVector start = regular_configuration(random, chain);
    const Pose target = pose(chain, regular_configuration(random, chain));
    Servo a(chain, JParse{}, soft), b(chain, JParse{}, hard);
    a.reset(start);
    b.reset(start);
    const VectorXd full = b.update(target).qdot;
    VectorXd last = VectorXd::Zero(chain.dof());
    for (int cycle = 0; cycle < 150; ++cycle) {
      const VectorXd now = a.update(target).qdot;
      if (cycle == 0) CHECK((now - 0.01 * full).norm() < 1e-12 * full.norm());
      CHECK((now - last).norm() < 0.05 * full.norm());
      last = now;
    }
    a.reset(start);
    b.reset(start);
    const Twist twist = 0.1 * random.vector(6);
    for (int cycle = 0; cycle < 150; ++cycle) REQUIRE(same(a.update_twist(twist), b.update_twist(twist)));
  }
}

TEST_CASE("after a stop a zero twist, or the tip's own pose, moves nothing, whatever the velocity of the start was") {
  const Chain& chain = test::arms().at("ufactory_xarm7");
  Random random(29);
  for (int run = 0; run < 10; ++run) {
    Servo servo(chain, JParse{});
    servo.reset(test::start_of(random, chain, 0.6), random.vector(7));
    if (run % 3 == 1) REQUIRE(servo.set_tool(random.pose()));
    for (int k = 0; k < 2000; ++k) servo.hold();
    if (run % 3 == 2) {
      Servo next(chain, JParse{});
      next.continue_from(servo);
      servo = next;
    }
    const JointVector q = servo.q();
    const Pose own = servo.tip();
    for (int k = 0; k < 200; ++k) {
      if (run % 2 == 0) {
        servo.update_twist(Twist::Zero());
      } else {
        servo.update(own);
      }
    }
    CHECK((servo.q() - q).cwiseAbs().maxCoeff() < 1e-9);
  }
}

TEST_CASE("reset with a velocity: the command starts from the arm's motion") {
  Random random(7);
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    CAPTURE(name);
    const ServoOptions options = free_options();
    const JointVector start = regular_configuration(random, chain), moving = 0.3 * random.vector(chain.dof());
    const Pose target = pose(chain, regular_configuration(random, chain));
    for (const bool twist : {false, true}) {
      ServoOptions hard = options;
      hard.soft_start = 0.0;
      Servo servo(chain, JParse{}, options), full(chain, JParse{}, hard);
      servo.reset(start, moving);
      for (int cycle = 1; cycle <= 200; ++cycle) {
        full.reset(servo.q());
        const Twist command = Twist::Constant(0.02);
        const ServoStep step = twist ? servo.update_twist(command) : servo.update(target);
        const VectorXd asked = twist ? full.update_twist(command).qdot : full.update(target).qdot;
        const double share = std::min(1.0, 0.01 * cycle);
        CHECK((step.qdot - share * asked - (1.0 - share) * moving).norm() < 1e-6 * (1.0 + asked.norm()));
      }
    }
    // Even then no velocity limit is broken, unless the motors cannot brake any faster.
    const ServoOptions only_velocity = scaled_options();
    Servo limited(chain, JParse{}, only_velocity);
    limited.reset(start, JointVector(1e3 * moving));
    JointVector before = start;
    for (int cycle = 0; cycle < 200; ++cycle) {
      const ServoStep step = limited.update(target);
      check_step(chain, step, before, only_velocity);
      before = step.q;
    }
  }
}

TEST_CASE("a target that is no pose or twist is refused, and leaves no trace where there are no limits") {
  Random random(8);
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    CAPTURE(name);
    ServoOptions options = free_options();
    options.posture_gain = 1.0;
    Servo servo(chain, JParse{}, options), untouched(chain, JParse{}, options);
    const JointVector start = regular_configuration(random, chain);
    const Pose target = pose(chain, regular_configuration(random, chain));
    servo.reset(start);
    untouched.reset(start);
    for (int cycle = 0; cycle < 200; ++cycle) {
      const JointVector before = servo.q();
      std::vector<ServoStep> refused;
      for (const double bad : {kNan, kInfinity, -kInfinity}) {
        Pose wrong = target;
        wrong.matrix()(random.integer(0, 3), random.integer(0, 3)) = bad;
        refused.push_back(servo.update(wrong));
        Twist twist = Twist::Zero();
        twist[random.integer(0, 5)] = bad;
        refused.push_back(servo.update_twist(twist));
      }
      Pose wrong = target;
      wrong.linear() *= 1.001;
      refused.push_back(servo.update(wrong));
      wrong = target;
      wrong.linear().col(1) *= -1.0;
      refused.push_back(servo.update(wrong));
      wrong.matrix().setZero();
      refused.push_back(servo.update(wrong));
      for (const ServoStep& step : refused) {
        CHECK(step.status == Status::BadInput);
        CHECK(step.qdot.size() == chain.dof());
        CHECK(step.qdot.isZero(0.0));
        CHECK(step.achieved_twist.isZero(0.0));
        CHECK(step.q == before);
      }
      CHECK(servo.q() == before);
      REQUIRE(same(servo.update(target), untouched.update(target)));
    }
  }
}

TEST_CASE("before reset() the servo commands nothing, and says that it has no position to command") {
  Servo servo(arms().at("ur10"), JParse{});
  CHECK(servo.q().size() == 0);
  for (const ServoStep& step : {servo.update(Pose::Identity()), servo.update_twist(Twist::Zero()), servo.hold()}) {
    CHECK(step.status == Status::BadInput);
    CHECK(step.qdot.size() == 6);
    CHECK(step.qdot.isZero(0.0));
  }
}

TEST_CASE("reset refuses wrong sizes and values, and then changes nothing") {
  Random random(9);
  const Chain& chain = arms().at("ufactory_xarm7");
  Servo servo(chain, JParse{});
  CHECK_THROWS_AS(servo.reset(VectorXd::Zero(6)), Error);
  CHECK(servo.q().size() == 0);
  const JointVector start = regular_configuration(random, chain);
  servo.reset(start);
  const Pose target = pose(chain, regular_configuration(random, chain));
  servo.update(target);
  const JointVector q = servo.q();
  for (const int n : {0, 1, 6, 8, 16, 17, 20, 1000}) {
    const VectorXd wrong = VectorXd::Zero(n);
    CHECK_THROWS_AS(servo.reset(wrong), Error);
    if (n != 0) CHECK_THROWS_AS(servo.reset(start, wrong), Error);
  }
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    JointVector wrong = start;
    wrong[3] = bad;
    CHECK_THROWS_AS(servo.reset(wrong), Error);
    CHECK_THROWS_AS(servo.reset(start, wrong), Error);
  }
  CHECK(servo.q() == q);
}

TEST_CASE("options out of their range are refused") {
  const Chain& chain = arms().at("ufactory_xarm7");
  const auto refuses = [&chain](auto change) {
    ServoOptions options;
    change(options);
    CHECK_THROWS_AS(Servo(chain, JParse{}, options), Error);
  };
  for (const double bad : {kNan, -1.0, -kInfinity}) {
    refuses([bad](ServoOptions& o) { o.dt = bad; });
    refuses([bad](ServoOptions& o) { o.gain_linear = bad; });
    refuses([bad](ServoOptions& o) { o.gain_angular = bad; });
    refuses([bad](ServoOptions& o) { o.max_linear_error = bad; });
    refuses([bad](ServoOptions& o) { o.max_angular_error = bad; });
    refuses([bad](ServoOptions& o) { o.soft_start = bad; });
    refuses([bad](ServoOptions& o) { o.posture_gain = bad; });
    refuses([bad](ServoOptions& o) { o.posture_max_speed = bad; });
    refuses([bad](ServoOptions& o) { o.length_scale = bad; });
    refuses([bad](ServoOptions& o) { o.limits.recovery_speed = bad; });
  }
  refuses([](ServoOptions& o) { o.limits.recovery_speed = 0.0; });
  refuses([](ServoOptions& o) { o.limits.recovery_speed = 1.5; });
  refuses([](ServoOptions& o) {
    o.task.mask = {true, true, true, false, false, false};
    o.exact = {false, false, false, true, false, false};
  });
  refuses([](ServoOptions& o) { o.dt = 0.0; });
  refuses([](ServoOptions& o) { o.dt = kInfinity; });
  refuses([](ServoOptions& o) { o.gain_linear = kInfinity; });
  refuses([](ServoOptions& o) { o.gain_angular = kInfinity; });
  refuses([](ServoOptions& o) { o.posture_gain = kInfinity; });
  refuses([](ServoOptions& o) { o.soft_start = kInfinity; });
  refuses([](ServoOptions& o) { o.max_linear_error = 0.0; });
  refuses([](ServoOptions& o) { o.max_angular_error = 0.0; });
  refuses([](ServoOptions& o) { o.posture_max_speed = 0.0; });
  refuses([](ServoOptions& o) { o.length_scale = 0.0; });
  refuses([](ServoOptions& o) { o.posture = VectorXd::Zero(6); });
  refuses([](ServoOptions& o) { o.posture = VectorXd::Constant(7, kNan); });
  refuses([](ServoOptions& o) { o.task.mask.fill(false); });
  CHECK_THROWS_AS(Servo(chain, JParse{2.0}), Error);
  ServoOptions fine;
  fine.max_linear_error = fine.max_angular_error = fine.posture_max_speed = kInfinity;
  fine.gain_linear = fine.gain_angular = fine.soft_start = 0.0;
  CHECK_NOTHROW(Servo(chain, JParse{}, fine));
}

TEST_CASE("targets that jump: always finite, always within the limits, and reached when they rest") {
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    for (const Method& method : all_methods()) {
      Random random(10);
      CAPTURE(name);
      CAPTURE(sigmaik::name(method));
      ServoOptions options;
      options.dt = 0.01;
      Servo servo(chain, method, options);
      JointVector before = regular_configuration(random, chain);
      servo.reset(before);
      Pose target;
      for (int cycle = 0; cycle < 600; ++cycle) {
        if (cycle % 30 == 0) {
          target = pose(chain, regular_configuration(random, chain, 0.0));
          if (random.chance(0.3)) target.translation() *= random.decades(0.0, 3.0);
        }
        const ServoStep step = servo.update(target);
        REQUIRE(step.status != Status::BadInput);
        check_step(chain, step, before, options);
        before = step.q;
      }
    }
  }
}

TEST_CASE("out of reach for ten thousand cycles the arm is stretched out and still") {
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    Random random(11);
    for (int repeat = 0; repeat < 2; ++repeat) {
      CAPTURE(name);
      CAPTURE(repeat);
      ServoOptions options = scaled_options();
      options.dt = 0.004;
      Servo servo(chain, JParse{}, options);
      JointVector before = regular_configuration(random, chain);
      servo.reset(before);
      Pose target = servo.tip();
      target.translation() += 4.0 * random.unit(3);
      double late_path = 0.0, most_turn = 0.0;
      VectorXd last = VectorXd::Zero(chain.dof());
      ServoStep step;
      for (int cycle = 0; cycle < 10000; ++cycle) {
        step = servo.update(target);
        check_step(chain, step, before, options);
        if (cycle > 9000) {
          late_path += options.dt * step.qdot.norm();
          most_turn = std::max(most_turn, (step.qdot - last).norm());
        }
        last = step.qdot;
        before = step.q;
      }
      CHECK(step.status == Status::Damped);
      CHECK(step.singular_values[5] < 0.1 * step.singular_values[0]);
      // After four seconds, only the slow creep of a singular approach is left, and no jitter.
      CHECK(late_path < 0.2);
      CHECK(most_turn < 1e-4);
    }
  }
}

TEST_CASE("a start at an exact singularity: possible directions move, and the status reports the others") {
  int feasible = 0, infeasible = 0;
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    ChainState state;
    const JointVector zero = JointVector::Zero(chain.dof());
    update(chain, zero, state);
    Spectrum s;
    s.decompose(state.jacobian);
    for (int direction = 0; direction < 12; ++direction) {
      CAPTURE(name);
      CAPTURE(direction);
      Twist unit = Twist::Zero();
      unit[direction % 6] = direction < 6 ? 1.0 : -1.0;
      double possible = 0.0, regular = 0.0;  // share of the direction that the arm can do at all, and that is regular
      for (int i = 0; i < 6; ++i) {
        const double part = s.u(i).dot(unit);
        if (s.sigma(i) > 1e-9 * s.sigma(0)) possible += part * part;
        if (s.sigma(i) > 0.1 * s.sigma(0)) regular += part * part;
      }
      for (const bool as_pose : {false, true}) {
        const ServoOptions options = scaled_options();  // zero is not inside every arm's limits
        Servo servo(chain, JParse{}, options);
        servo.reset(zero);
        Pose target = servo.tip();
        target.translation() += 0.05 * unit.head<3>();
        target.linear() = rotation_exp(0.05 * unit.tail<3>()) * target.linear();
        JointVector before = zero;
        bool damped = false;
        double progress = 0.0;
        for (int cycle = 0; cycle < 100; ++cycle) {
          const ServoStep step = as_pose ? servo.update(target) : servo.update_twist(0.05 * unit);
          check_step(chain, step, before, options);
          CHECK(step.status != Status::BadInput);
          CHECK(step.status != Status::Holding);
          damped = damped || step.status == Status::Damped;
          progress += 1e-3 * unit.dot(step.achieved_twist);
          before = step.q;
        }
        if (possible > 1e-6) {
          ++feasible;
          CHECK(progress > 1e-9);
          if (regular > 0.3) CHECK(progress > 1e-4);
        } else {
          ++infeasible;
          CHECK(damped);
          CHECK(before.cwiseAbs().maxCoeff() < 1e-9);
        }
        if (possible < 1.0 - 1e-6) CHECK(damped);
      }
    }
  }
  CHECK(feasible > 100);
  CHECK(infeasible > 10);
}

TEST_CASE("every rule, at every arm's zero pose: finite, within the limits, the same each time") {
  Random random(12);
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    for (const Method& method : all_methods()) {
      CAPTURE(name);
      CAPTURE(sigmaik::name(method));
      Servo first(chain, method), second(chain, method);
      const JointVector zero = JointVector::Zero(chain.dof());
      first.reset(zero);
      second.reset(zero);
      Pose target = first.tip();
      target.translation() += 0.3 * random.unit(3);
      target.linear() = rotation_exp(random.vector(3)) * target.linear();
      JointVector before = zero;
      for (int cycle = 0; cycle < 500; ++cycle) {
        const ServoStep step = first.update(target);
        check_step(chain, step, before, ServoOptions{});
        REQUIRE(same(step, second.update(target)));
        before = step.q;
      }
    }
  }
}

TEST_CASE("twists are exact away from singularities") {
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    Random random(13);
    for (int repeat = 0; repeat < 20; ++repeat) {
      CAPTURE(name);
      Servo servo(chain, JParse{0.01}, scaled_options());
      servo.reset(regular_configuration(random, chain));
      const Pose start = servo.tip();
      const Twist twist = 0.02 * random.unit(6);
      int done = 0;
      for (; done < 1000; ++done) {
        const ServoStep step = servo.update_twist(twist);
        if (step.status != Status::Ok) break;
        CHECK((step.achieved_twist - twist).norm() < 1e-9 * twist.norm());
        CHECK(step.pose_error.isZero(0.0));
      }
      CHECK(done > 100);
      const double time = 1e-3 * done;
      CHECK((servo.tip().translation() - start.translation() - time * twist.head<3>()).norm() < 2e-5);
      const Eigen::Matrix3d turned = rotation_exp(time * twist.tail<3>()) * start.linear();
      CHECK((servo.tip().linear() - turned).norm() < 2e-5);
    }
  }
}

TEST_CASE("a twist in the tool's axes, and about another point, moves this point as asked") {
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    CAPTURE(name);
    Random random(15);
    for (int repeat = 0; repeat < 50; ++repeat) {
      const JointVector start = regular_configuration(random, chain);
      const Pose tip = pose(chain, start);
      const Twist asked = 0.02 * random.unit(6);
      const Eigen::Vector3d offset = 0.3 * random.unit(3);
      Servo servo(chain, JParse{0.01}, scaled_options());
      const auto achieved = [&](Frame frame, const Eigen::Vector3d& point) {
        servo.reset(start);
        return servo.update_twist(asked, frame, point).achieved_twist;
      };
      // v at the point is v at the tip + ω × the way from the tip.
      Twist seen = achieved(Frame::Base, offset);
      const Eigen::Vector3d way = offset - tip.translation(), omega = seen.tail<3>();
      servo.reset(start);
      if (servo.update_twist(asked, Frame::Base, offset).status != Status::Ok) continue;
      CHECK((seen.head<3>() + omega.cross(way) - asked.head<3>()).norm() < 1e-9);
      CHECK((omega - asked.tail<3>()).norm() < 1e-9);
      seen = achieved(Frame::Tool, offset);
      const Eigen::Vector3d in_base = tip.linear() * offset, turning = seen.tail<3>();
      servo.reset(start);
      if (servo.update_twist(asked, Frame::Tool, offset).status != Status::Ok) continue;
      CHECK((tip.linear().transpose() * (seen.head<3>() + turning.cross(in_base)) - asked.head<3>()).norm() < 1e-9);
      CHECK((tip.linear().transpose() * turning - asked.tail<3>()).norm() < 1e-9);
      // The tip's origin in base axes is the twist as it is.
      servo.reset(start);
      const JointVector plain = servo.update_twist(asked).qdot;
      servo.reset(start);
      CHECK((servo.update_twist(asked, Frame::Base, tip.translation()).qdot - plain).norm() < 1e-12);
    }
    Servo servo(chain, JParse{}, scaled_options());
    servo.reset(regular_configuration(random, chain));
    CHECK(servo.update_twist(Twist::Zero(), Frame::Tool, {kNan, 0.0, 0.0}).status == Status::BadInput);
  }
}

TEST_CASE("a target whose rotation is rounded counts as the nearest pose") {
  const Chain& chain = arms().at("ur10");
  Random random(16);
  for (int repeat = 0; repeat < 100; ++repeat) {
    const JointVector start = regular_configuration(random, chain);
    Pose rounded = pose(chain, JointVector(start + 0.1 * random.vector(6)));
    rounded.linear() = (rounded.linear() * 1e5).array().round().matrix() * 1e-5;
    Servo servo(chain, JParse{}), other(chain, JParse{});
    servo.reset(start);
    other.reset(start);
    for (int cycle = 0; cycle < 5; ++cycle) {
      const ServoStep step = servo.update(rounded);
      CHECK(step.status != Status::BadInput);
      CHECK(step.qdot == other.update(sigmaik::nearest_pose(rounded)).qdot);
    }
    CHECK(servo.rough_targets() == 5);
    CHECK(other.rough_targets() == 0);
    rounded.linear() *= 1.001;
    CHECK(servo.update(rounded).status == Status::BadInput);
    CHECK(servo.rough_targets() == 5);
  }
}

TEST_CASE("zero commands: nothing moves, and the status is Ok") {
  Random random(14);
  for (const auto& [name, chain] : arms()) {
    for (const Method& method : all_methods()) {
      ServoOptions options;
      options.limits.position = false;  // a joint outside would come back
      Servo servo(chain, method, options);
      servo.reset(random.chance(0.5) ? JointVector(JointVector::Zero(chain.dof()))
                                     : regular_configuration(random, chain));
      const ServoStep step = servo.update_twist(Twist::Zero());
      CHECK(step.qdot.isZero(0.0));
      CHECK(step.status == Status::Ok);
    }
  }
}

TEST_CASE("the posture: moves the joints, not the tip; capped per joint; continuous joints take the nearest turn") {
  const Chain& chain = arms().at("kinova_gen3_7dof");
  Random random(15);
  const double turn = 2.0 * std::numbers::pi;
  bool continuous = false;
  for (int repeat = 0; repeat < 30; ++repeat) {
    const JointVector near = regular_configuration(random, chain, 0.1);
    JointVector start = near;
    ServoOptions options;
    options.soft_start = 0.0;
    const bool capped = repeat % 2 == 0;
    options.posture_gain = capped ? 2.0 : 0.2;
    if (capped) options.posture_max_speed = 0.3;
    options.posture = near;
    for (int i = 0; i < chain.dof(); ++i) {
      if (chain.joint_types()[static_cast<std::size_t>(i)] != JointType::Continuous) continue;
      continuous = true;
      start[i] += turn * random.integer(-3, 3);
    }
    Servo same_place(chain, JParse{0.05}, options);
    same_place.reset(start);
    for (int cycle = 0; cycle < 10; ++cycle) {
      CHECK(same_place.update_twist(Twist::Zero()).qdot.norm() < 1e-12);
    }

    options.posture = JointVector(near + 0.3 * random.vector(chain.dof()));
    Servo servo(chain, JParse{0.05}, options);
    servo.reset(start);
    const Pose own = servo.tip();
    double from = 0.0, to = 0.0;
    for (int cycle = 0; cycle < 1000; ++cycle) {
      const ServoStep step = servo.update(own);
      // The posture's motion is a projection, so it is no larger than the velocity that was projected.
      if (capped) CHECK(step.qdot.norm() <= 0.3 * std::sqrt(7.0) + 0.05);
      VectorXd away = options.posture - step.q;
      for (int i = 0; i < chain.dof(); ++i) {
        if (chain.joint_types()[static_cast<std::size_t>(i)] == JointType::Continuous) {
          away[i] -= turn * std::round(away[i] / turn);
        }
      }
      (cycle == 0 ? from : to) = away.norm();
    }
    if (!capped) CHECK(to < from);  // the projected gradient of a distance; with the cap it is no gradient
    CHECK((servo.tip().matrix() - own.matrix()).cwiseAbs().maxCoeff() < 1e-3);
  }
  CHECK(continuous);
}

TEST_CASE("position only: the position is reached, the orientation is free") {
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    Random random(16);
    for (int repeat = 0; repeat < 5; ++repeat) {
      CAPTURE(name);
      ServoOptions options;
      options.task.mask = {true, true, true, false, false, false};
      options.dt = 0.004;
      Servo servo(chain, JParse{}, options), other(chain, JParse{}, options);
      const JointVector start = regular_configuration(random, chain);
      JointVector goal = start;
      for (int i = 0; i < chain.dof(); ++i) goal[i] += random.uniform(-0.4, 0.4);
      Pose target = pose(chain, goal), turned = target;
      turned.linear() = random.rotation();
      servo.reset(start);
      other.reset(start);
      ServoStep step;
      for (int cycle = 0; cycle < 2000; ++cycle) {
        step = servo.update(target);
        REQUIRE((other.update(turned).q - step.q).norm() < 1e-9);  // the target's orientation is ignored
        CHECK(step.singular_values.size() == 3);
      }
      CHECK(step.pose_error.head<3>().norm() < 1e-6);
      CHECK((step.status == Status::Ok || step.limiting_joints != 0));
    }
  }
}

TEST_CASE("with equal gains J-PARSE never increases the error, in which the length scale weighs the orientation") {
  Random random(17);
  int descents = 0;
  for (int repeat = 0; repeat < 3000; ++repeat) {
    const int n = random.integer(1, 9);
    const Chain chain = random.chain(n, 0.2);
    const JointVector q = random.configuration(n);
    ChainState state;
    REQUIRE(update(chain, q, state));
    Pose target = random.pose();
    if (random.chance(0.5)) target = pose(chain, JointVector(q + random.decades(-3.0, 0.0) * random.vector(n)));
    ServoOptions options;
    options.soft_start = 0.0;
    options.max_linear_error = options.max_angular_error = kInfinity;
    const double gain = random.uniform(0.0, 4.0);
    Servo servo(chain, JParse{random.uniform(0.01, 1.0), gain, gain, random.chance(0.5)}, options);
    servo.reset(q);
    const Twist error = pose_error(state.tip, target);
    if (error.tail<3>().norm() > 3.1) continue;  // the logarithm jumps at a half turn
    const VectorXd qdot = servo.update(target).qdot;
    CAPTURE(repeat);
    // A radian of the error weighs as much as the length scale.
    const auto weighted = [&servo](Twist e) {
      e.tail<3>() *= servo.length_scale();
      return e;
    };
    const double square = weighted(error).squaredNorm();
    const double rate = -2.0 * weighted(error).dot(weighted(state.jacobian * qdot));
    CHECK(rate <= 1e-12 * square * 5.0);
    if (rate < -1e-3 * square) ++descents;
    // The same by differences: eᵀe along the motion, with the derivative of the logarithm included.
    const double h = 1e-6 / (1.0 + qdot.norm());
    const Twist ahead = pose_error(pose(chain, JointVector(q + h * qdot)), target);
    const Twist behind = pose_error(pose(chain, JointVector(q - h * qdot)), target);
    const double difference = (weighted(ahead).squaredNorm() - weighted(behind).squaredNorm()) / (2.0 * h);
    CHECK(difference == doctest::Approx(rate).epsilon(1e-4).scale(1e-4 * (1.0 + square) * (1.0 + qdot.norm())));
  }
  CHECK(descents > 2000);
}

TEST_CASE("the error shrinks cycle by cycle") {
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    Random random(18);
    for (int repeat = 0; repeat < 5; ++repeat) {
      CAPTURE(name);
      ServoOptions options = scaled_options();
      options.max_linear_error = options.max_angular_error = kInfinity;
      Servo servo(chain, JParse{}, options);
      servo.reset(regular_configuration(random, chain));
      const Pose target = pose(chain, regular_configuration(random, chain));
      if (pose_error(servo.tip(), target).tail<3>().norm() > 3.0) continue;
      double last = kInfinity;
      for (int cycle = 0; cycle < 3000; ++cycle) {
        Twist error = servo.update(target).pose_error;
        error.tail<3>() *= servo.length_scale();
        const double now = error.squaredNorm();
        CHECK(now <= last * (1.0 + 1e-5));
        last = now;
      }
    }
  }
}

TEST_CASE("half a turn away: it turns, and arrives") {
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    if (name == "puma560") continue;  // its wrist's limits do not matter here, but its wrist is singular on the way
    Random random(19);
    CAPTURE(name);
    const JointVector start = regular_configuration(random, chain, 0.12);
    ServoOptions options;
    options.dt = 0.004;
    Servo servo(chain, JParse{}, options);
    servo.reset(start);
    Pose target = servo.tip();
    target.linear() = target.linear() * Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitZ());
    const ServoStep first = servo.update(target);
    CHECK(first.pose_error.tail<3>().norm() == doctest::Approx(std::numbers::pi).epsilon(1e-12));
    ServoStep step;
    for (int cycle = 0; cycle < 5000; ++cycle) step = servo.update(target);
    CHECK(step.pose_error.norm() < 1e-5);
  }
}

TEST_CASE("targets and twists of any size") {
  Random random(20);
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    for (const Method& method : all_methods()) {
      for (const bool limits : {true, false}) {
        CAPTURE(name);
        CAPTURE(sigmaik::name(method));
        ServoOptions options = limits ? ServoOptions{} : free_options();
        options.soft_start = 0.0;
        if (random.chance(0.3)) options.dt = 1e10;
        if (random.chance(0.3)) options.max_linear_error = kInfinity;
        Servo servo(chain, method, options);
        servo.reset(regular_configuration(random, chain));
        for (const double size : {1e10, 1e100, 1e160, 1e200, 1e300, 1.7e308}) {
          CAPTURE(size);
          Pose target = Pose::Identity();
          target.translation()[random.integer(0, 2)] = random.chance(0.5) ? size : -size;
          for (const bool twist : {false, true}) {
            const double before = servo.qdot().cwiseAbs().maxCoeff();
            const ServoStep step = twist ? servo.update_twist(Twist::Constant(size)) : servo.update(target);
            CHECK(step.q.allFinite());
            CHECK(step.qdot.allFinite());
            CHECK(step.achieved_twist.allFinite());
            CHECK(step.pose_error.allFinite());
            if (step.status == Status::BadInput) {
              CHECK(step.qdot.cwiseAbs().maxCoeff() <= before);
              if (!limits) CHECK(step.qdot.isZero(0.0));
            }
          }
          CHECK(servo.q().allFinite());
        }
      }
    }
  }
  // All targets far away are alike: the arm goes there as fast as to any target out of reach.
  const Chain& chain = arms().at("ufactory_xarm7");
  ServoOptions options = scaled_options();
  options.soft_start = 0.0;
  const JointVector start = regular_configuration(random, chain);
  VectorXd near;
  for (const double size : {1e3, 1e100, 1e200, 1e308}) {
    CAPTURE(size);
    Servo servo(chain, JParse{}, options);
    servo.reset(start);
    Pose target = servo.tip();
    target.translation()[0] += size;
    const VectorXd qdot = servo.update(target).qdot;
    if (near.size() == 0) near = qdot;
    CHECK((qdot - near).norm() < 1e-9 * near.norm());
    CHECK(near.norm() > 0.1);
  }
}

TEST_CASE("the rule may be changed on the way; a copy goes on by itself") {
  Random random(21);
  const Chain& chain = arms().at("franka_panda");
  Servo servo(chain, JParse{}, free_options());
  servo.reset(regular_configuration(random, chain));
  const Pose target = pose(chain, regular_configuration(random, chain));
  for (int cycle = 0; cycle < 50; ++cycle) servo.update(target);
  CHECK_THROWS_AS(servo.set_method(JParse{-1.0}), Error);
  CHECK(std::get<JParse>(servo.method()).gamma == 0.1);
  Servo copy = servo;
  for (int cycle = 0; cycle < 50; ++cycle) REQUIRE(same(servo.update(target), copy.update(target)));
  servo.set_method(DampedLeastSquares{0.5});
  CHECK(std::string(sigmaik::name(servo.method())) == "DampedLeastSquares");
  const JointVector q = servo.q();
  const ServoStep a = servo.update(target), b = copy.update(target);
  CHECK(a.qdot != b.qdot);
  CHECK(a.q == JointVector(q + 1e-3 * a.qdot));
  CHECK(a.status == Status::Damped);
}

TEST_CASE("an arm of another size under the same servo moves the same") {
  Random random(22);
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    for (const double size : {0.1, 10.0, 1000.0}) {
      CAPTURE(name);
      std::vector<Segment> segments = chain.segments();
      for (Segment& s : segments) s.origin.translation() *= size;
      const Chain other(chain.base(), segments);
      Servo a(chain), b(other);
      CHECK(b.length_scale() == doctest::Approx(size * a.length_scale()).epsilon(1e-12));
      const JointVector start = regular_configuration(random, chain), goal = regular_configuration(random, chain);
      a.reset(start);
      b.reset(start);
      const Pose target = pose(chain, goal), there = pose(other, goal);
      for (int cycle = 0; cycle < 500; ++cycle) {
        const ServoStep s = a.update(target), t = b.update(there);
        REQUIRE((s.q - t.q).norm() < 1e-7);
      }
    }
  }
}

TEST_CASE("feed-forward: behind a moving target the error is of the order of dt, not speed/gain") {
  // A target T(t) = exp(t ω) about a place that drifts, fed forward: e' = −g e + O(dt) in the loop, so e → O(dt).
  Random random(31);
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    CAPTURE(name);
    if (chain.dof() < 6) continue;
    const JointVector start = regular_configuration(random, chain, 0.1);
    const Pose home = pose(chain, start);
    const Eigen::Vector3d v = 0.05 * random.unit(3), omega = 0.1 * random.unit(3);
    double error[2][2];
    for (const bool fed : {false, true}) {
      for (const int fine : {0, 1}) {
        ServoOptions options = free_options();
        options.dt = fine == 0 ? 2e-3 : 1e-3;
        options.soft_start = 0.0;
        Servo servo(chain, PseudoInverse{}, options);
        servo.reset(start);
        Twist twist;
        twist << v, omega;
        ServoStep step;
        const int cycles = static_cast<int>(std::lround(1.2 / options.dt));
        for (int k = 0; k < cycles; ++k) {
          Pose target = home;
          target.translation() += k * options.dt * v;
          target.linear() = rotation_exp(k * options.dt * omega) * home.linear();
          step = fed ? servo.update(target, twist) : servo.update(target);
        }
        error[fed][fine] = step.pose_error.norm();
      }
    }
    const double lag = std::hypot(v.norm(), omega.norm()) / ServoOptions{}.gain_linear;
    CHECK(error[0][1] == doctest::Approx(lag).epsilon(0.05));
    CHECK(error[1][1] < 0.02 * lag);
    CHECK(error[1][1] < 0.6 * error[1][0]);  // halves with dt
  }
}

TEST_CASE(
    "feed-forward: zero is none, it is added after the caps, limits are held, and what is not finite is refused") {
  Random random(32);
  for (const auto& [key, chain] : arms()) {
    const std::string& name = key;
    CAPTURE(name);
    const JointVector start = regular_configuration(random, chain);
    Pose far = pose(chain, start);
    far.translation() += Eigen::Vector3d(3.0, 0.0, 0.0);
    Servo a(chain, JParse{}, free_options()), b(chain, JParse{}, free_options()), held(chain, JParse{});
    for (Servo* servo : {&a, &b, &held}) servo->reset(start);
    const Twist twist = random.vector(6);
    JointVector before = start;
    for (int cycle = 0; cycle < 200; ++cycle) {
      CHECK(same(a.update(far), b.update(far, Twist::Zero())));
      const ServoStep step = held.update(far, 10.0 * twist);
      check_step(chain, step, before, ServoOptions{});
      before = step.q;
    }
    ServoOptions options = free_options();
    options.soft_start = 0.0;
    Servo by_pose(chain, JParse{}, options), by_twist(chain, JParse{}, options);
    by_pose.reset(start);
    by_twist.reset(start);
    Twist sum = twist;
    sum[0] += options.gain_linear * by_pose.max_linear_error();
    CHECK((by_pose.update(far, twist).qdot - by_twist.update_twist(sum).qdot).norm() < 1e-9 * sum.norm());
    for (const double bad : {kNan, kInfinity}) {
      Twist wrong = twist;
      wrong[random.integer(0, 5)] = bad;
      CHECK(held.update(far, wrong).status == Status::BadInput);
    }
  }
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("update() and update_twist() leave the heap alone, whatever they are given") {
  Random random(23);
  for (const auto& [name, chain] : arms()) {
    for (const Method& method : all_methods()) {
      for (const Frame frame : {Frame::Base, Frame::Tool}) {
        ServoOptions options;
        options.posture_gain = 1.0;
        options.length_scale = 0.5;
        options.task.frame = frame;
        if (random.chance(0.5)) options.task.mask = {true, true, true, true, true, false};
        Servo servo(chain, method, options);
        servo.reset(JointVector::Zero(chain.dof()));
        const Pose target = pose(chain, regular_configuration(random, chain));
        Pose wrong = target;
        wrong.matrix()(1, 1) = kNan;
        ServoStep step;
        const test::HeapWatch watch;
        for (int cycle = 0; cycle < 50; ++cycle) {
          step = servo.update(target);
          step = servo.update(wrong);
          step = servo.update_twist(Twist::Constant(0.1));
          step = servo.update_twist(Twist::Constant(kNan));
        }
        CHECK(watch.calls() == 0);
        CHECK(step.status == Status::BadInput);
      }
    }
  }
}
#endif

TEST_CASE("a redundant arm moves away from singularities without moving its tool") {
  for (const char* name : {"kuka_lbr_iiwa_14_r820", "franka_panda"}) {
    const Chain& chain = test::arms().at(name);
    const SingularSets sets = SingularSets::load(name);
    for (const Avoid what : {Avoid::Potential, Avoid::Manipulability}) {
      Random random(20);
      for (int trial = 0; trial < 20; ++trial) {
        JointVector q(7);
        for (int i = 0; i < 7; ++i) q[i] = random.uniform(0.7 * chain.limits().lower[i], 0.7 * chain.limits().upper[i]);
        ServoOptions options;
        options.avoid = {.what = what, .gain = what == Avoid::Potential ? 1.0 : 20.0};
        Servo servo(chain, JParse{}, options);
        servo.reset(q);
        const Pose target = pose(chain, q);
        // The function that the servo descends: its value rises only by the effect of limits and of the tool's task.
        const auto height = [&](const JointVector& x) {
          return what == Avoid::Potential ? sets.potential(x, options.avoid.potential) : -sets.manipulability(x);
        };
        double before = height(q), risen = 0.0;
        for (int cycle = 0; cycle < 3000; ++cycle) {
          const ServoStep step = servo.update(target);
          risen += std::max(0.0, height(step.q) - before);
          before = height(step.q);
          REQUIRE(step.pose_error.norm() < 2e-3);
        }
        CAPTURE(trial);
        CHECK(before <= height(q) + 1e-6);
        CHECK(risen < 1e-3 * (1.0 + height(q) - before));
      }
    }
  }
}

TEST_CASE("what avoidance refuses") {
  const Chain& known = test::arms().at("franka_panda");
  const Chain& unknown = test::arms().at("ufactory_xarm7");
  const auto make = [](const Chain& chain, const AvoidanceOptions& avoid) {
    ServoOptions options;
    options.avoid = avoid;
    Servo servo(chain, JParse{}, options);
  };
  CHECK_NOTHROW(make(unknown, {.what = Avoid::Manipulability}));
  CHECK_THROWS_AS(make(unknown, {.what = Avoid::Potential}), Error);
  CHECK_THROWS_AS(make(known, {.what = Avoid::Potential, .gain = -1.0}), Error);
  CHECK_THROWS_AS(make(known, {.what = Avoid::Potential, .max_speed = 0.0}), Error);
  CHECK_THROWS_AS(make(known, {.what = Avoid::Potential, .potential = {.eta2 = 0.0}}), Error);
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("avoidance touches no heap") {
  for (const char* name : {"franka_panda", "ufactory_xarm7"}) {
    const Chain& chain = test::arms().at(name);
    for (const Avoid what : {Avoid::Manipulability, Avoid::Potential}) {
      if (what == Avoid::Potential && !SingularSets::of(chain)) continue;
      ServoOptions options;
      options.avoid.what = what;
      Servo servo(chain, JParse{}, options);
      servo.reset(JointVector::Constant(7, 0.4).cwiseMax(chain.limits().lower).cwiseMin(chain.limits().upper));
      const Twist twist = Twist::Constant(0.05);
      const test::HeapWatch heap;
      for (int cycle = 0; cycle < 100; ++cycle) servo.update_twist(twist);
      CHECK(heap.calls() == 0);
    }
  }
}
#endif
