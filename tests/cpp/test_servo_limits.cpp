// The effect of limits on the servo's command: while no limit is met, there is none; else the command is the best that
// is left, without jumps, and leads back from outside. test_limits.cpp tests the limits themselves.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include <sigmaik/constrained_ik.hpp>
#include <sigmaik/least_squares.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/servo.hpp>

#include "arms.hpp"
#include "heap.hpp"
#include "jump.hpp"
#include "methods.hpp"
#include "numbers.hpp"
#include "oracles.hpp"
#include "random.hpp"
#include "twin.hpp"

namespace {

using namespace sigmaik;
using test::kInfinity;
using test::kNan;
using test::MatrixXd;
using test::Random;
using test::VectorXd;

using test::arms;

Jacobian jacobian(const Chain& chain, const JointVector& q) {
  ChainState state;
  update(chain, q, state);
  return state.jacobian;
}

double ratio(const MatrixXd& m) {
  const VectorXd s = test::singular_values(m);
  return s[s.size() - 1] / s[0];
}

JointVector inside(Random& random, const Chain& chain, double margin = 0.05) {
  JointVector q(chain.dof());
  for (int i = 0; i < chain.dof(); ++i) {
    const double lower = chain.limits().lower[i] + margin, upper = chain.limits().upper[i] - margin;
    q[i] = random.uniform(std::max(lower, -2.5), std::min(upper, 2.5));
  }
  return q;
}

JointVector regular(Random& random, const Chain& chain, double least_ratio) {
  for (;;) {
    const JointVector q = inside(random, chain);
    if (ratio(jacobian(chain, q)) >= least_ratio) return q;
  }
}

// Which limits to hold.
ServoOptions holding(bool position, bool velocity, bool acceleration, bool jerk) {
  ServoOptions options;
  options.limits.position = position;
  options.limits.velocity = velocity;
  options.limits.acceleration = acceleration;
  options.limits.jerk = jerk;
  options.soft_start = 0.0;
  return options;
}

// The same arm, with an acceleration limit in each joint, and a jerk limit if asked for.
Chain complete(const Chain& chain, double jerk = kInfinity) {
  JointLimits limits = chain.limits();
  limits.acceleration = limits.acceleration.cwiseMin(10.0);
  limits.jerk.setConstant(jerk);
  return chain.with_limits(limits);
}

// One cycle at q from rest.
ServoStep once(const Chain& chain, const Method& method, const ServoOptions& options, const JointVector& q,
               const Twist& twist) {
  Servo servo(chain, method, options);
  servo.reset(q);
  return servo.update_twist(twist);
}

// The answer of a servo's rule alone.
VectorXd rule(const Chain& chain, const Method& method, const ServoOptions& options, const JointVector& q,
              const Twist& twist) {
  VelocitySolver solver = test::rule_of(Servo(chain, method, options));
  return solver.solve(jacobian(chain, q), twist).qdot;
}

// The Jacobian whose angular rows have the unit of the linear rows.
MatrixXd weighted(const Chain& chain, const JointVector& q, double length_scale) {
  MatrixXd J = jacobian(chain, q);
  J.bottomRows(3) *= length_scale;
  return J;
}

// Position limits of joint i around q, so close that without an acceleration limit the joint may have velocities from
// −speed to speed for one cycle.
void close_in(double speed, double dt, const JointVector& q, Eigen::Index i, JointLimits& limits) {
  limits.lower[i] = q[i] - speed * dt;
  limits.upper[i] = q[i] + speed * dt;
}

}  // namespace

TEST_CASE("while no limit is met the answer is the rule's, to the last digit") {
  for (const double jerk : {kInfinity, 500.0}) {
    long same = 0, other = 0;
    for (const auto& [key, shipped] : arms()) {
      const std::string& name = key;
      const Chain chain = complete(shipped, jerk);
      for (const Method& method : test::library_methods()) {
        for (const OnLimit on_limit : {OnLimit::Redistribute, OnLimit::Scale}) {
          CAPTURE(name);
          CAPTURE(jerk);
          Random random(1);
          ServoOptions options;
          options.on_limit = on_limit;
          Servo servo(chain, method, options);
          VelocitySolver solver = test::rule_of(servo);
          servo.reset(regular(random, chain, 0.05));
          const Twist twist = 0.1 * random.unit(6);
          for (int cycle = 0; cycle < 400; ++cycle) {
            const Twist now = twist * std::min(1.0, 2e-5 * cycle * cycle);
            const VectorXd asked = solver.solve(jacobian(chain, servo.q()), now).qdot;
            const ServoStep step = servo.update_twist(now);
            if (step.limiting_joints != 0) {
              ++other;
              continue;
            }
            ++same;
            CHECK(VectorXd(step.qdot) == asked);
            CHECK(step.scale == 1.0);
            CHECK(step.status <= Status::Damped);
          }
        }
      }
    }
    CAPTURE(jerk);
    CAPTURE(other);
    // With jerk limits the command is the rule's once the velocity has been reached.
    CHECK(same > (std::isinf(jerk) ? 57000 : 30000));
  }
}

TEST_CASE("redistribution solves the bounded least squares of its description") {
  Random random(2);
  int cases = 0, several = 0, damped = 0;
  for (const auto& [key, shipped] : arms()) {
    const std::string& name = key;
    for (int repeat = 0; repeat < 60; ++repeat) {
      CAPTURE(name);
      CAPTURE(repeat);
      const int n = shipped.dof();
      const ServoOptions options = holding(true, false, false, false);
      const bool singular = repeat % 2 == 0;  // there the weights are the rule's thresholds
      const JointVector q = singular ? inside(random, shipped) : regular(random, shipped, 0.11);
      const Twist twist = 0.5 * random.unit(6);
      const Servo servo(shipped, JParse{}, options);
      VelocitySolver solver = test::rule_of(servo);
      const VectorXd asked = solver.solve(jacobian(shipped, q), twist).qdot;
      JointLimits limits = shipped.limits();
      VectorXd fastest(n);
      for (int i = 0; i < n; ++i) {
        const bool far = random.chance(0.5) ||
                         shipped.joint_types()[static_cast<std::size_t>(i)] == JointType::Continuous;
        fastest[i] = far ? 1e3 : std::abs(asked[i]) * random.uniform(0.1, 1.5) + 1e-6;
        if (shipped.joint_types()[static_cast<std::size_t>(i)] != JointType::Continuous) {
          close_in(fastest[i], options.dt, q, i, limits);
        }
      }
      if (((asked.cwiseAbs() - fastest).array() <= 0.0).all()) continue;
      const Chain chain = shipped.with_limits(limits);
      const ServoStep step = once(chain, JParse{}, options, q, twist);
      const VectorXd qdot = step.qdot, x = qdot - asked;
      ++cases;

      // With S = Σ w_i u_i v_iᵀ, w_i the rule's weights, first min |S (q̇ − q̇_rule)|² + λ² |q̇ − q̇_rule|², λ = σ_max/100.
      // Then once more about this answer, and with the weight lag·|S (q̇ − q̇_rule)|, of this answer, on q̇ itself.
      const Spectrum& spectrum = solver.spectrum();
      const double largest = spectrum.sigma(0), lambda = 1e-2 * largest;
      MatrixXd S(spectrum.size(), n);
      for (int i = 0; i < spectrum.size(); ++i) {
        S.row(i) = solver.resolution().weight[static_cast<std::size_t>(i)] * spectrum.v(i).transpose();
      }
      const MatrixXd J = weighted(shipped, q, servo.length_scale());
      if (!singular) CHECK((S.transpose() * S - J.transpose() * J).norm() < 1e-9 * largest * largest);
      LeastSquaresProblem problem;
      const auto m = S.rows();
      problem.A = (MatrixXd(m + n, n) << S, lambda * MatrixXd::Identity(n, n)).finished();
      problem.b = VectorXd::Zero(m + n);
      problem.lower = -fastest - asked;
      problem.upper = fastest - asked;
      LeastSquares oracle;
      const VectorXd first = asked + oracle.solve(problem).x;
      const double motion = servo.pace().lag * (S * (first - asked)).norm();
      problem.A = MatrixXd(m + 2 * n, n);
      problem.A << S, lambda * MatrixXd::Identity(n, n), std::sqrt(motion) * MatrixXd::Identity(n, n);
      problem.b = VectorXd(m + 2 * n);
      problem.b << VectorXd::Zero(m), lambda * (first - asked), -std::sqrt(motion) * asked;
      const LeastSquaresSolution best = oracle.solve(problem);
      CHECK((x - best.x).norm() <= 1e-8 * (1.0 + x.norm()));
      int held = 0;
      for (int i = 0; i < n; ++i) {
        CHECK(step.q[i] <= limits.upper[i]);
        CHECK(step.q[i] >= limits.lower[i]);
        const bool on = std::abs(qdot[i]) >= fastest[i] * (1.0 - 1e-9);
        held += on;
        if ((step.limiting_joints >> i & 1) != 0) CHECK(on);
      }
      CHECK(step.limiting_joints != 0);
      several += held > 1;
      damped += step.singular != 0;

      // So the tool is no farther off than with each joint of the rule's answer cut off at its limit.
      const VectorXd cut = asked.cwiseMax(-fastest).cwiseMin(fastest);
      CHECK((S * x).norm() <=
            (S * (cut - asked)).norm() + lambda * (cut - asked).norm() + std::sqrt(motion) * cut.norm());
      CHECK((step.status == Status::Limited) == ((J * x).norm() > 1e-4 * (J * asked).norm()));
    }
  }
  CHECK(cases > 300);
  CHECK(several > 100);
  CHECK(damped > 20);
}

TEST_CASE("a velocity limit keeps the direction of the twist, and as much of its speed as the joints can do") {
  Random random(13);
  int cases = 0, helped = 0, whole = 0;
  double given_up = 0.0;
  for (const auto& [key, shipped] : arms()) {
    const std::string& name = key;
    const int n = shipped.dof();
    for (int repeat = 0; repeat < 60; ++repeat) {
      for (const OnLimit on_limit : {OnLimit::Redistribute, OnLimit::Scale}) {
        CAPTURE(name);
        CAPTURE(repeat);
        CAPTURE(static_cast<int>(on_limit));
        ServoOptions options = holding(false, true, false, false);
        options.on_limit = on_limit;
        const JointVector q = repeat % 3 == 0 ? inside(random, shipped) : regular(random, shipped, 0.11);
        const Twist twist = 0.5 * random.unit(6);
        const VectorXd rough = rule(shipped, JParse{}, options, q, twist);
        JointLimits limits = shipped.limits();
        for (int i = 0; i < n; ++i) {
          const bool fast = random.chance(0.5);
          limits.velocity[i] = fast ? 3.0 * rough.cwiseAbs().maxCoeff()
                                    : std::abs(rough[i]) * random.uniform(0.1, 1.5) + 1e-3;
        }
        const Chain chain = shipped.with_limits(limits);
        Servo servo(chain, JParse{}, options);
        servo.reset(q);
        VelocitySolver solver = test::rule_of(servo);  // the threshold depends on the velocity limits
        const MatrixXd J = weighted(chain, q, servo.length_scale());
        const VectorXd asked = solver.solve(jacobian(chain, q), twist).qdot;
        const double fits = 1.0 / std::max(1.0, (asked.cwiseAbs().cwiseQuotient(limits.velocity)).maxCoeff());
        const VectorXd qdot = servo.update_twist(twist).qdot;
        if (fits == 1.0) {
          CHECK(qdot == asked);
          continue;
        }
        ++cases;
        const VectorXd goal = J * asked, done = J * qdot;
        const double s = done.dot(goal) / goal.squaredNorm();
        CHECK((done - s * goal).norm() <= 1e-9 * goal.norm());
        CHECK((qdot.cwiseAbs() - limits.velocity).maxCoeff() <= 0.0);
        CHECK(s <= 1.0 + 1e-9);
        CHECK(s >= fits * (1.0 - 1e-9));
        if (on_limit == OnLimit::Scale || n <= 6) {
          CHECK((qdot - fits * asked).norm() <= 1e-9 * asked.norm());
          continue;
        }
        // One free direction: q̇ = s q̇_rule + y n is inside for y in an interval; the largest s has an interval left.
        const VectorXd null = test::svd(J).v.col(6);
        const auto interval = [&](double part) {
          double low = -kInfinity, high = kInfinity;
          for (int i = 0; i < n; ++i) {
            const double v = part * asked[i], limit = limits.velocity[i];
            if (std::abs(null[i]) < 1e-9) {
              if (std::abs(v) > limit * (1.0 + 1e-9)) return std::pair{1.0, -1.0};
              continue;
            }
            const double a = (-limit - v) / null[i], b = (limit - v) / null[i];
            low = std::max(low, std::min(a, b));
            high = std::min(high, std::max(a, b));
          }
          return std::pair{low, high};
        };
        double low = fits, high = 1.0;
        if (const auto [a, b] = interval(1.0); a <= b) low = 1.0;
        for (int k = 0; k < 60 && low < 1.0; ++k) {
          const double middle = 0.5 * (low + high);
          const auto [a, b] = interval(middle);
          (a <= b ? low : high) = middle;
        }
        // The motion that leaves the tool as it is has a price of 1e-6: with y(s) the least of it, the answer minimises
        // (1 − s)² + 1e-6 (|q̇ − q̇_rule|/max|q̇_rule|)², whose slope vanishes where 1 − s = 1e-6 y y'/max|q̇_rule|².
        const auto least = [&](double part) {
          const auto [a, b] = interval(part);
          return std::max({0.0, a, -b});
        };
        const double slope = (least(low) - least(low - 1e-4)) / 1e-4, fastest = asked.cwiseAbs().maxCoeff();
        const double price = 1e-6 * least(low) * slope / (fastest * fastest);
        given_up = std::max(given_up, std::min(low, 1.0) - s);
        CHECK(s >= std::min(low, 1.0 - 1.1 * price) - 1e-7);
        helped += s > fits + 1e-3;
        whole += s > 1.0 - 1e-5;
        // Of these velocities it is the nearest to the rule's.
        const auto [a, b] = interval(s);
        const double free = std::clamp(0.0, std::min(a, b), std::max(a, b));
        CHECK((qdot - s * asked - free * null).norm() <= 1e-5 * (1.0 + asked.norm()));
      }
    }
  }
  MESSAGE("part of the speed that redundant arms give up rather than move faster: ≤ ", given_up);
  CHECK(cases > 500);
  CHECK(helped > 100);
  CHECK(whole > 20);
}

TEST_CASE("redundant arms: the other joints take over the whole twist where they can") {
  Random random(3);
  int cases = 0, took_over = 0;
  for (const auto& [key, shipped] : arms()) {
    const std::string& name = key;
    if (shipped.dof() != 7) continue;
    for (int repeat = 0; repeat < 60; ++repeat) {
      const JointVector q = regular(random, shipped, 0.1);
      const MatrixXd J = jacobian(shipped, q);
      const VectorXd null = test::svd(J).v.col(6);
      const Twist twist = 0.3 * random.unit(6);
      const JParse method{0.05};
      const VectorXd asked = rule(shipped, method, holding(true, false, false, false), q, twist);
      for (int i = 0; i < 7; ++i) {
        if (std::abs(null[i]) < 0.5) continue;
        for (const bool blocked : {false, true}) {
          CAPTURE(name);
          CAPTURE(i);
          CAPTURE(blocked);
          JointLimits limits = shipped.limits();
          limits.velocity.setConstant(kInfinity);
          if (!blocked) {
            limits.velocity[i] = 0.7 * std::abs(asked[i]);
          } else if (shipped.joint_types()[static_cast<std::size_t>(i)] == JointType::Continuous) {
            continue;
          } else {
            (asked[i] > 0.0 ? limits.upper : limits.lower)[i] = q[i];
          }
          const ServoStep step = once(shipped.with_limits(limits), method, holding(blocked, true, false, false), q,
                                      twist);
          ++cases;
          const double missed = (step.achieved_twist - twist).norm() / twist.norm();
          CHECK(missed <= 1e-3);
          took_over += missed <= 1e-4;
          if (missed <= 5e-5) CHECK(step.status == Status::Ok);
          if (missed > 3e-4) CHECK(step.status == Status::Limited);
          CHECK(step.limiting_joints == 1u << i);
          if (blocked) CHECK(step.q[i] == q[i]);
        }
      }
    }
  }
  CHECK(cases > 200);
  CHECK(took_over > 0.95 * cases);
}

TEST_CASE("exact rows are kept at position limits while the others give way, in base and in tool axes") {
  Random random(4);
  int cases = 0, gave_way = 0, first_lost = 0;
  for (const auto& [key, shipped] : arms()) {
    const std::string& name = key;
    const int n = shipped.dof();
    for (int repeat = 0; repeat < 80; ++repeat) {
      CAPTURE(name);
      CAPTURE(repeat);
      const JointVector q = regular(random, shipped, 0.11);
      ChainState state;
      update(shipped, q, state);
      ServoOptions options = holding(true, false, false, false);
      options.task.frame = repeat % 2 == 0 ? Frame::Base : Frame::Tool;
      Task first{{true, true, true, false, false, false}, options.task.frame};
      if (repeat % 3 == 2) first.mask = {false, false, true, true, true, false};  // height and tilt
      options.exact = first.mask;
      const Twist twist = 0.5 * random.unit(6);
      const VectorXd asked = rule(shipped, JParse{}, options, q, twist);
      const int i = random.integer(0, n - 1);
      if (shipped.joint_types()[static_cast<std::size_t>(i)] == JointType::Continuous) continue;
      // Whether the other joints can do the first rows alone.
      MatrixXd rest = select_rows(first, state.tip.linear(), state.jacobian);
      rest.col(i).setZero();
      if (ratio(rest) < 0.15) continue;
      JointLimits limits = shipped.limits();
      for (int k = 0; k < n; ++k) {
        if (shipped.joint_types()[static_cast<std::size_t>(k)] == JointType::Continuous) continue;
        close_in(k == i ? 0.3 * std::abs(asked[i]) : 1e3, options.dt, q, k, limits);
      }
      const ServoStep step = once(shipped.with_limits(limits), JParse{}, options, q, twist);
      const Twist missed = twist - step.achieved_twist;
      ++cases;
      // The first rows weigh 10³ times as much, so they miss 10⁻⁶ of the motion of the other rows, times their pull,
      // and what the weight of joint motion leaves of them.
      const double pull = (twist.norm() + missed.norm()) / ratio(rest);
      CHECK(select_rows(first, state.tip.linear(), missed).norm() <= 5e-5 * pull);
      if (missed.norm() > 1e-3 * twist.norm()) {
        ++gave_way;
        CHECK(step.status == Status::Limited);
        // Without priority these rows would have lost something too.
        options.exact.fill(false);
        const ServoStep even = once(shipped.with_limits(limits), JParse{}, options, q, twist);
        const Twist even_missed = twist - even.achieved_twist;
        first_lost += select_rows(first, state.tip.linear(), even_missed).norm() > 1e-3 * twist.norm();
      }
    }
  }
  CHECK(cases > 150);
  CHECK(gave_way > 100);
  CHECK(first_lost > 50);
}

TEST_CASE("exact rows are a priority without limits too: near singularities they are done, and the others give way") {
  Random random(14);
  int cases = 0, gave_way = 0, even_lost = 0;
  for (const auto& [key, shipped] : arms()) {
    const std::string& name = key;
    for (int repeat = 0; repeat < 80; ++repeat) {
      CAPTURE(name);
      CAPTURE(repeat);
      ServoOptions options = holding(false, false, false, false);
      options.exact = {true, true, true, false, false, false};
      const JointVector q = inside(random, shipped);
      const Servo servo(shipped, JParse{}, options);
      MatrixXd J = weighted(shipped, q, servo.length_scale());
      // The position rows alone are regular by J-PARSE's threshold, all rows together are not.
      const VectorXd all = test::singular_values(J), three = test::singular_values(MatrixXd(J.topRows(3)));
      if (three[2] < 0.11 * all[0] || all[5] > 0.03 * all[0]) continue;
      ++cases;
      const Twist twist = 3.0 * random.unit(6);
      const ServoStep step = once(shipped, JParse{}, options, q, twist);
      const Twist missed = twist - step.achieved_twist;
      CHECK(missed.head<3>().norm() <= 1e-9 * twist.norm());
      if (missed.tail<3>().norm() > 1e-3) {
        ++gave_way;
        CHECK(step.status == Status::Damped);
      }
      options.exact.fill(false);
      const ServoStep even = once(shipped, JParse{}, options, q, twist);
      even_lost += (twist - even.achieved_twist).head<3>().norm() > 1e-3;
    }
  }
  CHECK(cases > 30);
  CHECK(gave_way > 25);
  CHECK(even_lost > 30);
}

TEST_CASE("scaling keeps the direction, and changes velocities in proportion, whenever the limits allow") {
  long straight = 0, bent = 0;
  for (const auto& [key, shipped] : arms()) {
    const std::string& name = key;
    for (const double jerk : {0.0, kInfinity, 200.0}) {
      const bool accelerations = jerk > 0.0;
      Random random(5);
      CAPTURE(name);
      CAPTURE(jerk);
      const Chain chain = complete(shipped, accelerations ? jerk : kInfinity);
      ServoOptions options = holding(true, true, accelerations, accelerations);
      options.on_limit = OnLimit::Scale;
      Servo servo(chain, JParse{}, options);
      VelocitySolver solver = test::rule_of(servo);
      LimitTracker tracker(chain.limits(), 1e-3, {.acceleration = accelerations, .jerk = accelerations});
      const JointVector start = inside(random, chain);
      servo.reset(start);
      tracker.reset(start);
      Twist twist = 0.5 * random.unit(6);
      // The largest s in [0, 1] for which from + s way is inside; below 0 if there is none.
      const auto largest = [](const VectorXd& from, const VectorXd& way, const VelocityBounds& bounds) {
        double low = 0.0, high = 1.0;
        for (Eigen::Index i = 0; i < way.size(); ++i) {
          if (way[i] == 0.0) {
            if (from[i] < bounds.lower[i] - 1e-12 || from[i] > bounds.upper[i] + 1e-12) return -1.0;
            continue;
          }
          const double a = (bounds.lower[i] - from[i]) / way[i], b = (bounds.upper[i] - from[i]) / way[i];
          low = std::max(low, std::min(a, b));
          high = std::min(high, std::max(a, b));
        }
        return low <= high ? high : -1.0;
      };
      for (int cycle = 0; cycle < 1500; ++cycle) {
        if (random.chance(0.01)) twist = random.decades(-2.0, 0.5) * random.unit(6);
        const VectorXd asked = solver.solve(jacobian(chain, servo.q()), twist).qdot;
        const VectorXd last = tracker.qdot(), zero = VectorXd::Zero(chain.dof());
        // Velocity limits slow the motion down first, and then position limits.
        const double fits = 1.0 / std::max(1.0, asked.cwiseAbs().cwiseQuotient(chain.limits().velocity).maxCoeff());
        const double speed = fits * largest(zero, fits * asked, tracker.heading());
        const VectorXd goal = std::max(0.0, speed) * asked;
        VectorXd way = goal - last;
        for (double& x : way) x = std::abs(x) > 1e-12 ? x : 0.0;  // smaller entries are rounding
        const double part = largest(last, way, tracker.bounds());
        const JointVector along = tracker.approach(goal);
        const bool allowed = tracker.bounds().contain(along);
        const ServoStep step = servo.update_twist(twist);
        JointVector qdot = step.qdot;
        tracker.advance(qdot);
        REQUIRE(qdot == step.qdot);
        if (tracker.has_jerk()) {  // test_approach.cpp: in proportion, and to no acceleration
          if (speed >= 0.0 && allowed) {
            ++straight;
            CHECK((step.qdot - along).norm() <= 1e-9 * (asked.norm() + last.norm()));
          } else {
            ++bent;
          }
        } else if (speed >= 0.0 && part >= 0.0) {
          ++straight;
          CHECK((step.qdot - last - part * way).norm() <= 1e-9 * (asked.norm() + last.norm()));
          if (!accelerations) CHECK((step.qdot - speed * asked).norm() <= 1e-9 * asked.norm());
        } else {
          ++bent;
          CHECK(step.status == Status::Limited);
        }
      }
    }
  }
  CHECK(straight > 20000);
  CAPTURE(bent);
}

TEST_CASE("without acceleration limits the answer does not depend on the cycles before it") {
  int limited = 0;
  for (const auto& [key, shipped] : arms()) {
    const std::string& name = key;
    for (const OnLimit on_limit : {OnLimit::Redistribute, OnLimit::Scale}) {
      Random random(12);
      CAPTURE(name);
      JointLimits limits = shipped.limits();
      limits.velocity *= 0.3;
      const Chain chain = shipped.with_limits(limits);
      ServoOptions options = holding(true, true, false, false);
      options.on_limit = on_limit;
      Servo servo(chain, JParse{}, options);
      servo.reset(regular(random, chain, 0.05));
      const Twist from = random.unit(6), to = random.unit(6);
      for (int cycle = 0; cycle < 600; ++cycle) {
        const Twist twist = from + 0.002 * cycle * (to - from);
        const ServoStep fresh = once(chain, JParse{}, options, servo.q(), twist);
        const ServoStep step = servo.update_twist(twist);
        limited += step.status == Status::Limited;
        CHECK((step.qdot - fresh.qdot).norm() <= 1e-4 * fresh.qdot.norm());
      }
    }
  }
  CHECK(limited > 3000);
}

TEST_CASE("leaving a limit is never held back, from any corner of the limits") {
  int whole = 0, corners = 0;
  for (const auto& [key, shipped] : arms()) {
    const std::string& name = key;
    Random random(6);
    const Chain chain = complete(shipped);
    const int n = chain.dof();
    const JointLimits& limits = chain.limits();
    for (int corner = 0; corner < 1 << n; ++corner) {
      JointVector q(n), inward(n);
      bool new_one = true;
      for (int i = 0; i < n; ++i) {
        const bool up = (corner >> i & 1) != 0;
        if (std::isinf(limits.upper[i])) {
          new_one = new_one && !up;
          q[i] = random.uniform(-2.0, 2.0);
          inward[i] = 0.0;
        } else {
          q[i] = up ? limits.upper[i] : limits.lower[i];
          inward[i] = (up ? -1.0 : 1.0) * random.uniform(0.02, 0.2);
        }
      }
      if (!new_one) continue;
      CAPTURE(name);
      CAPTURE(corner);
      ++corners;
      const Jacobian J = jacobian(chain, q);
      const Twist twist = J * inward;
      const ServoStep step = once(chain, JParse{}, holding(true, true, false, false), q, twist);
      const Twist asked = J * rule(chain, JParse{}, holding(true, true, false, false), q, twist);
      CHECK(step.qdot.norm() > 1e-6);
      CHECK(step.achieved_twist.dot(asked) > 0.0);
      if (ratio(J) > 0.1) {  // the way inside is among all velocities that can be chosen
        ++whole;
        CHECK((step.achieved_twist - twist).norm() <= 1e-3 * twist.norm());
      }
      // With all limits, and for two hundred cycles.
      for (const OnLimit on_limit : {OnLimit::Redistribute, OnLimit::Scale}) {
        if (on_limit == OnLimit::Scale && (n != 6 || ratio(J) < 0.1)) continue;  // else the rule itself leads inside
        ServoOptions options = holding(true, true, true, true);
        options.on_limit = on_limit;
        Servo servo(chain, JParse{}, options);
        servo.reset(q);
        for (int cycle = 0; cycle < 200; ++cycle) servo.update_twist(Twist(jacobian(chain, servo.q()) * inward));
        CHECK((servo.q() - q).norm() > 1e-5);
      }
    }
  }
  CHECK(corners > 400);
  CHECK(whole > 30);
}

TEST_CASE("starts outside the limits, and too fast ones: every arm comes back, and stays") {
  for (const auto& [key, shipped] : arms()) {
    const std::string& name = key;
    for (const double jerk : {kInfinity, 300.0}) {
      for (int kind = 0; kind < 6; ++kind) {
        Random random(7);
        CAPTURE(name);
        CAPTURE(jerk);
        CAPTURE(kind);
        const Chain chain = complete(shipped, jerk);
        const JointLimits& limits = chain.limits();
        const int n = chain.dof();
        JointVector start = inside(random, chain), moving = JointVector::Zero(n);
        for (int i = 0; i < n; ++i) {
          if (kind < 2 && !std::isinf(limits.upper[i])) {
            start[i] = kind == 0 ? limits.upper[i] + 0.04 : limits.lower[i] - 0.04;
          }
          if (kind >= 2 && kind < 4) moving[i] = (kind == 2 ? 2.0 : -2.0) * limits.velocity[i];
        }
        if (kind == 4) start.setZero();  // outside for some arms
        if (kind == 5 && !std::isinf(limits.upper[1])) start[1] = limits.upper[1] + 0.5;
        ServoOptions options;
        if (random.chance(0.5)) options.on_limit = OnLimit::Scale;
        Servo servo(chain, JParse{}, options);
        servo.reset(start, moving);
        const Pose target = pose(chain, inside(random, chain));
        JointVector last = moving, last_change = JointVector::Zero(n);
        const double dt = options.dt;
        long broken = 0, late = 0, grew = 0;
        // The time to come back at a tenth of the speed, after the overshoot of the fast starts.
        double time = 0.0;
        for (int i = 0; i < n; ++i) {
          const double v = std::abs(moving[i]), a = limits.acceleration[i];
          const double over = std::max({0.0, start[i] - limits.upper[i], limits.lower[i] - start[i]}) + v * v / a +
                              (std::isinf(jerk) ? 0.0 : v * a / jerk);
          time = std::max(time, 1.2 * over / (0.1 * limits.velocity[i]) + 4.0 * v / a);
        }
        const int allowed = static_cast<int>(time / dt) + 1000;
        for (int cycle = 0; cycle < allowed + 300; ++cycle) {
          const ServoStep step = servo.update(target);
          const JointVector change = step.qdot - last;
          for (int i = 0; i < n; ++i) {
            broken += std::abs(change[i]) > limits.acceleration[i] * dt * (1.0 + 1e-9);
            broken += std::abs(change[i] - last_change[i]) > jerk * dt * dt * (1.0 + 1e-9) + 1e-14;
            late += cycle >= allowed && (step.q[i] > limits.upper[i] || step.q[i] < limits.lower[i] ||
                                         std::abs(step.qdot[i]) > limits.velocity[i] * (1.0 + 1e-9));
            grew += std::abs(step.qdot[i]) > std::max(std::abs(last[i]), limits.velocity[i]) * (1.0 + 1e-9);
          }
          last = step.qdot;
          last_change = change;
        }
        CHECK(broken == 0);
        CHECK(late == 0);
        CHECK(grew == 0);
      }
    }
  }
}

TEST_CASE("a start at all zeros: each of twelve directions moves, or says why not") {
  int moved = 0, said = 0;
  for (const auto& [key, shipped] : arms()) {
    const std::string& name = key;
    const Chain chain = complete(shipped);
    for (const OnLimit on_limit : {OnLimit::Redistribute, OnLimit::Scale}) {
      for (int direction = 0; direction < 12; ++direction) {
        CAPTURE(name);
        CAPTURE(direction);
        ServoOptions options;
        options.on_limit = on_limit;
        Servo servo(chain, JParse{}, options);
        servo.reset(JointVector::Zero(chain.dof()));
        Twist unit = Twist::Zero();
        unit[direction % 6] = direction < 6 ? 1.0 : -1.0;
        double progress = 0.0;
        int fine = 0;
        for (int cycle = 0; cycle < 300; ++cycle) {
          const ServoStep step = servo.update_twist(0.05 * unit);
          progress += options.dt * unit.dot(step.achieved_twist);
          fine += step.status == Status::Ok;
          REQUIRE(step.status <= Status::Limited);
          // Ok means done.
          if (step.status == Status::Ok) CHECK((step.achieved_twist - 0.05 * unit).norm() < 1e-6);
        }
        const bool through = progress > 0.5 * 300 * options.dt * 0.05;
        CHECK((through || fine < 300));
        (through ? moved : said)++;
      }
    }
  }
  MESSAGE("from all zeros: ", moved, " directions done, ", said, " damped or limited");
  CHECK(moved > 60);
}

TEST_CASE("bad input in motion: a stop as fast as the limits allow, and on again afterwards") {
  for (const auto& [key, shipped] : arms()) {
    const std::string& name = key;
    for (const double jerk : {kInfinity, 100.0}) {
      for (const bool as_pose : {false, true}) {
        Random random(9);
        CAPTURE(name);
        CAPTURE(jerk);
        const Chain chain = complete(shipped, jerk);
        const JointLimits& limits = chain.limits();
        Servo servo(chain, JParse{});
        servo.reset(regular(random, chain, 0.08));
        const Pose target = pose(chain, regular(random, chain, 0.08));
        for (int cycle = 0; cycle < 150; ++cycle) servo.update(target);
        REQUIRE(servo.qdot().norm() > 1e-2);

        JointVector last = servo.qdot(), last_change;
        int cycle = 0;
        for (; cycle < 3000; ++cycle) {
          Pose wrong = target;
          wrong.matrix()(random.integer(0, 2), random.integer(0, 3)) = random.chance(0.5) ? kNan : kInfinity;
          Twist twist = Twist::Zero();
          twist[random.integer(0, 5)] = random.chance(0.5) ? kNan : -kInfinity;
          const JointVector q = servo.q();
          const ServoStep step = as_pose ? servo.update(wrong) : servo.update_twist(twist);
          CHECK(step.status == Status::BadInput);
          CHECK(step.scale == 0.0);
          CHECK((step.achieved_twist - jacobian(chain, q) * step.qdot).norm() < 1e-12);
          const JointVector change = step.qdot - last;
          for (int i = 0; i < chain.dof(); ++i) {
            const double most = limits.acceleration[i] * 1e-3 * (1.0 + 1e-9);
            CHECK(std::abs(change[i]) <= most);
            if (cycle > 0) CHECK(std::abs(change[i] - last_change[i]) <= jerk * 1e-6 * (1.0 + 1e-9) + 1e-14);
            if (std::isinf(jerk)) {  // straight down
              const double want = std::max(0.0, std::abs(last[i]) - limits.acceleration[i] * 1e-3);
              CHECK(std::abs(step.qdot[i]) == doctest::Approx(want).epsilon(1e-9).scale(1e-9));
            }
          }
          last = step.qdot;
          last_change = change;
          if (last.isZero(0.0) && change.isZero(0.0)) break;
        }
        CHECK(cycle < 3000);
        const JointVector rest = servo.q();
        CHECK(servo.update_twist(Twist::Constant(kNan)).q == rest);

        ServoStep step = servo.update(target);
        CHECK(step.status != Status::BadInput);
        for (int k = 0; k < 3000; ++k) step = servo.update(target);
        CHECK(step.status != Status::BadInput);
        CHECK((servo.q() - rest).norm() > 1e-3);
      }
    }
  }
}

TEST_CASE("no jumps where the set of held joints changes, as commands move and as the arm moves") {
  constexpr int kSteps = 300;
  double by_command = 0.0, over_rule = 0.0, by_state = 0.0, tool_by_state = 0.0, jump = 0.0;
  long switches = 0, steps = 0, swings = 0;
  for (const auto& [key, arm] : arms()) {
    const Chain& shipped = arm;
    const std::string& name = key;
    Random random(10);
    for (int repeat = 0; repeat < 40; ++repeat) {
      CAPTURE(name);
      CAPTURE(repeat);
      JointLimits limits = shipped.limits();
      for (double& v : limits.velocity) v = random.decades(-1.5, 0.5);
      // Velocity limits alone, or position limits all around the arm, too.
      const bool around = repeat % 2 == 1;
      const ServoOptions held = holding(around, true, false, false);
      const JointVector room = limits.velocity.cwiseProduct(JointVector(random.vector(shipped.dof()).cwiseAbs()));
      const auto chain_at = [&](const JointVector& place) {
        JointLimits there = limits;
        for (Eigen::Index i = 0; i < place.size(); ++i) {
          if (around && shipped.joint_types()[static_cast<std::size_t>(i)] != JointType::Continuous) {
            close_in(room[i], held.dt, place, i, there);
          }
        }
        return shipped.with_limits(there);
      };
      ServoOptions options = held;
      if (repeat % 5 == 4) options.exact = {true, true, true, false, false, false};
      if (repeat % 4 == 2) options.on_limit = OnLimit::Scale;
      const bool even = repeat % 5 != 4 && repeat % 4 != 2;
      const JointVector q = inside(random, shipped), way = 0.5 * random.unit(shipped.dof());
      const Twist from = random.unit(6), to = random.unit(6);
      const Chain chain = chain_at(q);
      const double sigma = test::singular_values(MatrixXd(jacobian(chain, q)))[0];
      const auto command = [&](double t) -> Twist { return from + t * (to - from); };
      const auto at_command = [&](double t) -> VectorXd { return once(chain, JParse{}, options, q, command(t)).qdot; };
      VectorXd last = at_command(0.0), last_rule = rule(chain, JParse{}, options, q, from), last_state = last;
      std::uint16_t joints = 0;
      double worst = 0.0, last_missed = 0.0;
      bool was_regular = false;
      int where = 0;
      for (int k = 1; k <= kSteps; ++k) {
        const double t = static_cast<double>(k) / kSteps;
        const ServoStep step = once(chain, JParse{}, options, q, command(t));
        const VectorXd now = step.qdot, now_rule = rule(chain, JParse{}, options, q, command(t));
        switches += step.limiting_joints != joints;
        joints = step.limiting_joints;
        const double change = (now - last).norm();
        by_command = std::max(by_command, change * sigma * kSteps / (to - from).norm());
        over_rule = std::max(over_rule, change / ((now_rule - last_rule).norm() + 1e-6));
        if (change > worst) {
          worst = change;
          where = k;
        }
        last = now;
        last_rule = now_rule;

        const JointVector there = q + t * way;
        const MatrixXd J = jacobian(chain, there);
        const VectorXd now_state = once(chain_at(there), JParse{}, options, there, from).qdot;
        const bool is_regular = ratio(J) > 0.1;
        const double missed = (from - J * now_state).norm();
        if (even && is_regular && was_regular) {
          tool_by_state = std::max(tool_by_state, std::abs(missed - last_missed) * kSteps / way.norm());
        }
        last_missed = missed;
        was_regular = is_regular;
        by_state = std::max(by_state, (now_state - last_state).norm() * kSteps / way.norm());
        ++steps;
        swings += ((now_state - last_state).array().abs() > 0.2 * limits.velocity.array()).any();
        last_state = now_state;
      }
      if (where > 0) {
        const double end = static_cast<double>(where) / kSteps;
        const double left = test::jump_within(at_command, end - 1.0 / kSteps, end, 26);
        CHECK(left < 1e-5);
        jump = std::max(jump, left);
      }
    }
  }
  MESSAGE("command: |Δq̇| σ_max / |Δtwist| ≤ ", by_command, ", |Δq̇| / |Δq̇ of the rule| ≤ ", over_rule,
          ", left of the largest change over 1e-8 of its step ", jump, ", ", switches, " switches");
  MESSAGE("state, steps of 1.7 mrad: |Δq̇| / |Δq| ≤ ", by_state, " 1/s, the tool's error ≤ ", tool_by_state,
          " 1/s; a fifth of a joint's speed in ", swings, " of ", steps, " steps");
  CHECK(switches > 1000);
  CHECK(over_rule < 1e4);  // the weight of joint motion against twist, 1e-4, allows this factor
  CHECK(by_command < 1e4);
  // As the arm moves, joints may swing from limit to limit where the free joints are singular among themselves; the
  // tool's error does not swing.
  CHECK(tool_by_state < 100.0);
  CHECK(100 * swings < steps);
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("no heap with limits active, in the servo and in constrained inverse kinematics") {
  Random random(11);
  for (const auto& [key, shipped] : arms()) {
    const std::string& name = key;
    const Chain chain = complete(shipped, 1000.0);
    for (const OnLimit on_limit : {OnLimit::Redistribute, OnLimit::Scale}) {
      for (const Frame frame : {Frame::Base, Frame::Tool}) {
        CAPTURE(name);
        ServoOptions options;
        options.on_limit = on_limit;
        options.task.frame = frame;
        if (random.chance(0.5)) options.exact = {true, true, true, false, false, false};
        Servo servo(chain, JParse{}, options);
        servo.reset(inside(random, chain), random.vector(chain.dof()));
        Pose target = pose(chain, inside(random, chain)), wrong = target;
        target.translation() *= 3.0;
        wrong.matrix()(0, 0) = kNan;
        int limited = 0;
        const test::HeapWatch watch;
        for (int cycle = 0; cycle < 300; ++cycle) {
          limited += servo.update(target).status == Status::Limited;
          limited += servo.update_twist(Twist::Constant(cycle % 100 < 50 ? 1.0 : -1.0)).status == Status::Limited;
          if (cycle % 50 == 49) servo.update(wrong);
        }
        CHECK(watch.calls() == 0);
        CHECK(limited > 100);
      }
    }
    for (const bool scaled : {false, true}) {
      const bool torque = name == "franka_panda";
      ConstrainedIkOptions options;
      options.torque_limits = torque;
      if (scaled) options.gamma = 1.0;
      if (scaled) options.max_error.setConstant(0.01);
      ConstrainedIk ik(chain, options);
      ik.reset(inside(random, chain), random.vector(chain.dof()));
      const Pose target = pose(chain, inside(random, chain));
      Pose far = target, wrong = target;
      far.translation() *= 3.0;
      wrong.matrix()(0, 0) = kNan;
      int limited = 0;
      const test::HeapWatch watch;
      for (int cycle = 0; cycle < 300; ++cycle) {
        limited += ik.step(cycle % 100 < 50 ? target : far).status == Status::Limited;
        if (cycle % 50 == 49) ik.step(wrong);
      }
      CHECK(watch.calls() == 0);
      CHECK(limited > 50);
    }
  }
}
#endif
