// ConstrainedIk against the equations of Schreiber, Otter and Hirzinger, and against its promises: limits held, the
// exact part exact, the rest as good as possible, time scaling, torques, and the closed form where it is allowed.

#include <doctest/doctest.h>

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <sigmaik/constrained_ik.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/pose.hpp>

#include "arms.hpp"
#include "configurations.hpp"
#include "numbers.hpp"
#include "oracles.hpp"
#include "random.hpp"

using namespace sigmaik;
using test::kInfinity;
using test::MatrixXd;
using test::Random;
using test::VectorXd;

namespace {

Chain arm(const std::string& name) { return Chain::from_urdf(SIGMAIK_ROBOTS_DIR "/" + name + ".urdf"); }

JointVector middle(const Chain& chain) {
  JointVector q(chain.dof());
  for (int i = 0; i < chain.dof(); ++i) {
    const double low = std::max(chain.limits().lower[i], -3.0), high = std::min(chain.limits().upper[i], 3.0);
    q[i] = 0.5 * (low + high) + 0.1 * (high - low) * (i % 2 == 0 ? 1.0 : -1.0);
  }
  return q;
}

Pose moved(const Pose& from, const Twist& by) {
  Pose to = from;
  to.translation() += by.head<3>();
  to.linear() = rotation_exp(by.tail<3>()) * from.linear();
  return to;
}

ConstrainedIkOptions unlimited() {
  ConstrainedIkOptions o;
  o.limits.position = o.limits.velocity = o.limits.acceleration = o.limits.jerk = false;
  o.analytic = false;
  return o;
}

MatrixXd rows_of(const std::array<bool, 6>& mask, bool value, const MatrixXd& m) {
  MatrixXd out(6, m.cols());
  int row = 0;
  for (std::size_t i = 0; i < 6; ++i) {
    if (mask[i] == value) out.row(row++) = m.row(static_cast<Eigen::Index>(i));
  }
  return out.topRows(row);
}

// min |A x − b| where C x = d, by the null space of C.
VectorXd constrained(const MatrixXd& A, const VectorXd& b, const MatrixXd& C, const VectorXd& d) {
  if (C.rows() == 0) return test::least_squares(A, b);
  const MatrixXd Z = test::null_space(C);
  const VectorXd x = test::least_squares(C, d);
  if (A.rows() == 0 || Z.cols() == 0) return x;
  return x + Z * test::least_squares(A * Z, b - A * x);
}

}  // namespace

TEST_CASE("one linearisation is equation (25) with (26), for any exact rows, weights and axes") {
  Random random(1);
  int compared = 0;
  for (int repeat = 0; repeat < 3000; ++repeat) {
    const Chain chain = random.chain(random.integer(2, 9), 0.1);
    const int n = chain.dof();
    ConstrainedIkOptions o = unlimited();
    o.iterations = 1;
    o.dt = random.decades(-3, -1);
    o.task.frame = random.chance(0.5) ? Frame::Base : Frame::Tool;
    for (bool& row : o.exact) row = random.chance(0.4);
    for (int i = 0; i < 6; ++i) {
      o.alpha[i] = random.decades(-1, 1);
      o.beta[i] = random.chance(0.2) ? 0.0 : random.decades(-1, 1);
    }
    const bool scaled = random.chance(0.5);
    if (scaled) o.gamma = random.decades(-1, 1);
    ConstrainedIk ik(chain, o);
    const JointVector q = random.configuration(n);
    ik.reset(q);
    const Pose target = moved(ik.tip(), 0.3 * Twist(random.vector(6)));
    const ConstrainedIkStep step = ik.step(target);

    ChainState state;
    update(chain, q, state);
    MatrixXd axes = MatrixXd::Identity(6, 6);
    if (o.task.frame == Frame::Tool) {
      axes.topLeftCorner(3, 3) = axes.bottomRightCorner(3, 3) = state.tip.linear().transpose();
    }
    // The Jacobian of the error by differences: its rotational rows are not those of the geometric Jacobian.
    const Twist error = -pose_error(state.tip, target);
    MatrixXd slope(6, n);
    for (int j = 0; j < n; ++j) {
      constexpr double h = 1e-6;
      JointVector up = q, down = q;
      up[j] += h;
      down[j] -= h;
      slope.col(j) = (pose_error(pose(chain, down), target) - pose_error(pose(chain, up), target)) / (2.0 * h);
    }
    const Twist motion = pose_error(state.tip, target);  // the first step starts at the tip
    const int unknowns = n + (scaled ? 1 : 0);
    const auto exact = [&](const MatrixXd& m) { return rows_of(o.exact, true, axes * m); };
    const auto rest = [&](const MatrixXd& m) { return rows_of(o.exact, false, axes * m); };
    const VectorXd alpha = rows_of(o.exact, false, o.alpha), beta = rows_of(o.exact, false, o.beta);
    const auto ap = alpha.size();
    MatrixXd A = MatrixXd::Zero(2 * ap + (scaled ? 1 : 0), unknowns);
    VectorXd b = VectorXd::Zero(A.rows());
    A.topLeftCorner(ap, n) = alpha.asDiagonal() * rest(slope);
    b.head(ap) = alpha.asDiagonal() * rest(-error);
    A.block(ap, 0, ap, n) = beta.asDiagonal() * rest(state.jacobian);
    b.segment(ap, ap) = beta.asDiagonal() * rest(motion);
    MatrixXd C = MatrixXd::Zero(6 - ap, unknowns);
    C.leftCols(n) = exact(slope);
    const VectorXd d = -exact(error);
    // Motion from the tip to the target changes the error by exactly −error: J_l⁻¹(φ) maps φ onto itself.
    if (scaled) {
      A.col(n).head(ap) = alpha.asDiagonal() * rest(motion);
      C.col(n) = exact(motion);
      A(2 * ap, n) = *o.gamma;
    }
    const VectorXd x = constrained(A, b, C, d);
    if (scaled && (x[n] < 1e-6 || x[n] > 1.0 - 1e-6)) continue;  // another test covers the bounds of ϑ
    const auto conditioned = [](const MatrixXd& m, double least) {
      if (m.rows() == 0) return true;
      const VectorXd sigma = test::singular_values(m);
      return sigma.minCoeff() > least * sigma.maxCoeff();
    };
    const MatrixXd all = (MatrixXd(A.rows() + C.rows(), unknowns) << A, C).finished();
    if (!conditioned(C, 1e-2) || !conditioned(all, 1e-3)) continue;  // differences are not exact enough
    ++compared;
    CHECK((step.qdot * o.dt - x.head(n)).norm() < 1e-5 * (1.0 + x.norm()));
    if (scaled) CHECK(step.time_scale == doctest::Approx(x[n]).epsilon(1e-5));
    CHECK(step.used == IkSource::Optimised);
    CHECK(step.active == 0);
  }
  CHECK(compared > 500);
}

TEST_CASE("without the error's rate and limits, iterations are Newton's: quadratic to a pose that can be reached") {
  Random random(2);
  for (const std::string name : {"kuka_kr6_r900", "ufactory_xarm7", "franka_panda", "ur10", "puma560"}) {
    const Chain chain = arm(name);
    for (int repeat = 0; repeat < 50; ++repeat) {
      CAPTURE(name);
      ConstrainedIkOptions o = unlimited();
      o.beta.setZero();
      o.iterations = 8;
      for (bool& row : o.exact) row = random.chance(0.5);
      ConstrainedIk ik(chain, o);
      JointVector q = middle(chain), goal = q;
      for (int i = 0; i < chain.dof(); ++i) goal[i] += random.uniform(-0.15, 0.15);
      ik.reset(q);
      const ConstrainedIkStep step = ik.step(pose(chain, goal));
      CHECK(step.error.norm() < 1e-9);
      CHECK(step.status == Status::Ok);
      CHECK(step.exact_met);
    }
  }
}

TEST_CASE("a rotation of nearly half a turn converges as fast as a small one") {
  Random random(3);
  const Chain chain = arm("ufactory_xarm7");
  ConstrainedIkOptions o = unlimited();
  o.beta.setZero();
  o.iterations = 1;
  o.exact = {};
  o.task.mask = {false, false, false, true, true, true};
  for (int repeat = 0; repeat < 50; ++repeat) {
    ConstrainedIk ik(chain, o);
    ik.reset(middle(chain));
    Twist by = Twist::Zero();
    by.tail<3>() = 0.02 * Eigen::Vector3d(random.unit(3));
    const Pose near = moved(ik.tip(), by);
    const double small = ik.step(near).error.tail<3>().norm();
    CHECK(small < 5e-4);
  }
}

TEST_CASE("errors decay by β²/(α²+β²) a cycle, and the exact part is exact at once") {
  const Chain chain = arm("kuka_kr6_r900");
  for (const double beta : {0.0, 1.0, 5.0}) {
    ConstrainedIkOptions o = unlimited();
    o.beta.setConstant(beta);
    ConstrainedIk ik(chain, o);
    ik.reset(middle(chain));
    Twist by = Twist::Zero();
    by << 0.0, 0.0, 0.0, 1e-3, -2e-3, 1e-3;
    const Pose target = moved(ik.tip(), by);
    ik.step(target);  // the first step's motion is the whole way, so nothing is left
    ConstrainedIkStep step = ik.step(target);
    CHECK(step.error.norm() < 1e-5);
    // A start off the target that does not come from the target's motion: limits hold the arm back on its way to a far
    // target.
    ConstrainedIkOptions tight = o;
    tight.limits.velocity = true;
    JointLimits limits = chain.limits();
    limits.velocity.setConstant(0.05);
    ConstrainedIk held(chain.with_limits(limits), tight);
    held.reset(middle(chain));
    const Pose far = moved(held.tip(), 10.0 * by);
    double last = kInfinity;
    const double decay = beta * beta / (1.0 + beta * beta);
    int free = 0;
    for (int i = 0; i < 4000; ++i) {
      step = held.step(far);
      CHECK(step.error.head<3>().norm() < 1e-6);
      const double error = step.error.tail<3>().norm();
      if (step.active == 0 && last < kInfinity && last > 1e-7) {
        ++free;
        CHECK(error == doctest::Approx(decay * last).epsilon(0.02).scale(1e-8));
      }
      last = step.active == 0 ? error : kInfinity;
    }
    CHECK(last < 1e-7);
    if (beta > 0.0) CHECK(free > 5);
  }
}

TEST_CASE("limits hold, there is always an answer, and the exact part gives way last") {
  Random random(4);
  for (const std::string name : {"kuka_kr6_r900", "ufactory_xarm7", "franka_panda", "comau_racer_7_1_4"}) {
    const Chain chain = arm(name);
    const JointLimits& limits = chain.limits();
    for (int episode = 0; episode < 12; ++episode) {
      CAPTURE(name);
      CAPTURE(episode);
      ConstrainedIkOptions o;
      o.dt = 0.004;
      o.analytic = random.chance(0.5);
      if (random.chance(0.5)) o.gamma = random.decades(-2, 1);
      if (random.chance(0.5)) o.max_error.tail<3>().setConstant(0.05);
      ConstrainedIk ik(chain, o);
      ik.reset(middle(chain));
      JointVector q = ik.q(), qdot = JointVector::Zero(chain.dof());
      Pose target = ik.tip();
      for (int cycle = 0; cycle < 600; ++cycle) {
        if (cycle % 100 == 0) target = moved(target, 0.5 * Twist(random.vector(6)));
        const ConstrainedIkStep step = ik.step(target);
        REQUIRE(step.status != Status::BadInput);
        REQUIRE(step.q.allFinite());
        CHECK(step.time_scale >= 0.0);
        CHECK(step.time_scale <= 1.0);
        if (!o.gamma) CHECK(step.time_scale == 0.0);
        for (int i = 0; i < chain.dof(); ++i) {
          CHECK(step.q[i] >= limits.lower[i]);
          CHECK(step.q[i] <= limits.upper[i]);
          CHECK(std::abs(step.qdot[i]) <= limits.velocity[i] * (1.0 + 1e-9));
          CHECK(std::abs(step.qdot[i] - qdot[i]) / o.dt <= limits.acceleration[i] * (1.0 + 1e-9));
          CHECK(std::abs(step.q[i] - q[i] - o.dt * step.qdot[i]) < 1e-11);
        }
        CHECK((step.error + pose_error(pose(chain, step.q), target)).norm() < 1e-12);
        q = step.q;
        qdot = step.qdot;
      }
    }
  }
}

TEST_CASE("time scaling: none where none is needed; all six rows exact: the path kept by slowing down") {
  const Chain chain = arm("kuka_kr6_r900");
  ConstrainedIkOptions o;
  o.dt = 0.004;
  o.gamma = 1.0;
  o.exact.fill(true);
  o.analytic = false;
  // A step does not know how fast the path can be followed later on, so with acceleration limits the arm may be too
  // fast to brake.
  o.limits.acceleration = false;
  ConstrainedIk ik(chain, o);
  JointVector home(6);
  home << 0.0, -1.3, 1.5, 0.3, 0.5, 0.0;
  ik.reset(home);
  const Pose start = ik.tip();
  // A line of a second in 20 ms: the caller advances its clock by (1 − ϑ) dt.
  const auto line = [&](double t) {
    Twist by = Twist::Zero();
    by[1] = 0.25 * (1.0 - std::cos(std::min(t, 1.0) * M_PI));
    return moved(start, by);
  };
  double t = 0.0, most = 0.0;
  int cycles = 0;
  while (t < 1.0 - 1e-9 && cycles < 5000) {
    const double next = std::min(t + 0.2, 1.0);
    const ConstrainedIkStep step = ik.step(line(next));
    t += (1.0 - step.time_scale) * (next - t);
    most = std::max(most, step.time_scale);
    CHECK(step.path_error.head<3>().norm() < 2e-5);
    CHECK(step.path_error.tail<3>().norm() < 2e-5);
    CHECK(std::abs(step.error[0]) < 1e-4);  // distance from the line
    ++cycles;
  }
  CHECK(most > 0.5);
  CHECK(cycles > 40);
  CHECK(cycles < 5000);

  ConstrainedIk slow(chain, o);
  slow.reset(home);
  for (int i = 0; i < 200; ++i) {
    const ConstrainedIkStep step = slow.step(line(1e-3 * i));
    CHECK(step.time_scale < 1e-12);
    CHECK(step.error.norm() < 1e-6);
  }
}

TEST_CASE("the largest error allowed is kept where it can be together with the exact part") {
  const Chain chain = arm("kuka_kr6_r900");
  JointLimits limits = chain.limits();
  limits.velocity.setConstant(0.5);
  ConstrainedIkOptions o;
  o.dt = 0.004;
  o.analytic = false;
  o.gamma = 0.1;
  o.max_error.tail<3>().setConstant(0.01);
  o.limits.acceleration = false;  // with them a step, which cannot see ahead, may be too fast to keep max_error
  ConstrainedIk ik(chain.with_limits(limits), o);
  JointVector home(6);
  home << 0.0, -1.3, 1.5, 0.0, 0.15, 0.0;
  ik.reset(home);
  const Pose start = ik.tip();
  int active = 0, lost = 0;
  double t = 0.0;
  for (int i = 0; i < 1500; ++i) {
    Twist by = Twist::Zero();
    const double next = t + o.dt;
    by[1] = 0.3 * std::sin(next) * std::sin(next);
    const ConstrainedIkStep step = ik.step(moved(start, by));
    t += (1.0 - step.time_scale) * o.dt;
    active += step.error_active;
    CHECK(step.exact_met);
    CHECK(step.path_error.head<3>().norm() < 1e-5);
    const bool beyond = step.path_error.tail<3>().cwiseAbs().maxCoeff() > 0.01 * 1.05;  // the linearisation's error
    lost += beyond;
    CHECK((!beyond || step.error_active));
  }
  CHECK(active > 50);
  CHECK(lost == 0);
}

TEST_CASE("torque limits are the dynamics', and come before the exact part") {
  const Chain chain = arm("franka_panda");
  JointLimits limits = chain.limits();
  limits.acceleration.setConstant(kInfinity);
  limits.effort << 60, 60, 40, 40, 8, 8, 8;
  ConstrainedIkOptions o;
  o.dt = 0.002;
  o.torque_limits = true;
  o.limits.assumed_acceleration = kInfinity;  // the torques are the only limit of the accelerations
  const Chain weak = chain.with_limits(limits);
  ConstrainedIk ik(weak, o);
  JointVector home(7);
  home << 0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785;
  ik.reset(home);
  Dynamics dynamics(weak);
  const Pose start = ik.tip();
  JointVector q = home, qdot = JointVector::Zero(7);
  int active = 0, broken = 0;
  for (int i = 0; i < 1500; ++i) {
    Twist by = Twist::Zero();
    const double t = o.dt * i;
    by.head<3>() << 0.1 * std::sin(4.0 * t), 0.15 * std::sin(3.0 * t), 0.1 * std::sin(5.0 * t);
    const ConstrainedIkStep step = ik.step(moved(start, by));
    const VectorXd torque = dynamics.mass_matrix(q) * VectorXd((step.qdot - qdot) / o.dt) + dynamics.coriolis(q, qdot) +
                            dynamics.gravity(q);
    const double share = (torque.cwiseAbs().cwiseQuotient(VectorXd(limits.effort))).maxCoeff();
    active += step.torque_active;
    if (share > 1.0 + 1e-6) {
      ++broken;
      CHECK(step.status == Status::Limited);
    }
    q = step.q;
    qdot = step.qdot;
  }
  CHECK(active > 20);
  CHECK(broken == 0);
}

TEST_CASE("closed form while it is inside the limits, optimised where it is not, and back") {
  const Chain chain = arm("kuka_kr6_r900");
  ConstrainedIkOptions o;
  o.dt = 0.004;
  ConstrainedIk ik(chain, o);
  REQUIRE(ik.has_analytic());
  JointVector home(6);
  home << 0.0, -1.3, 1.5, 0.0, 0.005, 0.0;
  ik.reset(home);
  const Pose start = ik.tip();
  std::map<IkSource, int> used;
  int switches = 0;
  IkSource last = IkSource::Analytic;
  for (int i = 0; i < 2000; ++i) {
    Twist by = Twist::Zero();
    by[1] = 0.15 * (1.0 - std::cos(2.0 * o.dt * i));
    const ConstrainedIkStep step = ik.step(moved(start, by));
    ++used[step.used];
    switches += step.used != last;
    last = step.used;
    if (step.used == IkSource::Analytic) {
      CHECK(step.status == Status::Ok);
      CHECK(step.error.norm() < 1e-9);
      CHECK(step.active == 0);
    }
  }
  CHECK(used[IkSource::Analytic] > 500);
  CHECK(used[IkSource::Optimised] > 5);
  CHECK(switches >= 2);
  CHECK(switches < 40);
  CHECK(last == IkSource::Analytic);
  CHECK_FALSE(ConstrainedIk(arm("ur10")).has_analytic());
}

namespace {

// A configuration with much room on all sides.
struct Home {
  const char* name;
  std::vector<double> q;
};
const std::vector<Home> kHomes{{"ufactory_xarm7", {0.0, -0.5, 0.0, 1.0, 0.0, 1.2, 0.0}},
                               {"franka_panda", {0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785}},
                               {"kinova_gen3_7dof", {0.0, 0.5, 0.0, 1.0, 0.0, 1.2, 0.0}},
                               {"kuka_kr6_r900", {0.0, -1.3, 1.5, 0.3, 0.5, 0.0}},
                               {"ur10", {0.3, -1.2, 1.5, -1.0, -1.5, 0.3}}};

JointVector at_home(const Home& home) {
  return Eigen::Map<const JointVector>(home.q.data(), static_cast<Eigen::Index>(home.q.size()));
}

ConstrainedIkOptions every(double dt) {
  ConstrainedIkOptions o;
  o.dt = dt;
  o.beta.setConstant(5.0 * std::sqrt(1e-3 / dt));
  return o;
}

// The largest part of its velocity limit that a joint uses.
double speed(const Chain& chain, const JointVector& qdot) {
  double most = 0.0;
  for (int i = 0; i < chain.dof(); ++i) {
    const double limit = chain.limits().velocity[i];
    most = std::max(most, std::abs(qdot[i]) / (limit < kInfinity ? limit : 1.0));
  }
  return most;
}

// Seconds after which the arm is at a resting target and at rest, and stays so.
double settling_time(const Chain& chain, const ConstrainedIkOptions& o, const JointVector& q, const Twist& by,
                     double seconds) {
  ConstrainedIk ik(chain, o);
  ik.reset(q);
  const Pose target = moved(ik.tip(), by);
  double last = 0.0;
  ConstrainedIkStep step;
  for (double t = o.dt; t < seconds; t += o.dt) {
    step = ik.step(target);
    const bool there = step.error.head<3>().norm() <= 1e-4 && step.error.tail<3>().norm() <= 1e-3;
    if (!there || speed(chain, step.qdot) >= 1e-3) last = t;
  }
  CHECK(step.status == Status::Ok);
  CHECK(step.qdot.cwiseAbs().maxCoeff() < 1e-9);
  return last;
}

}  // namespace

TEST_CASE("after a step of the target the arm comes to rest there, for any arm, axis, size and cycle") {
  for (const Home& home : kHomes) {
    const Chain chain = arm(home.name);
    for (const double dt : {1e-3, 4e-3}) {
      for (int axis = 0; axis < 6; ++axis) {
        for (const double size : {-0.1, -0.03, -0.01, 0.01, 0.06}) {
          CAPTURE(std::string(home.name));
          CAPTURE(dt);
          CAPTURE(axis);
          CAPTURE(size);
          Twist by = Twist::Zero();
          by[axis] = size * (axis < 3 ? 1.0 : 3.0);
          CHECK(settling_time(chain, every(dt), at_home(home), by, 2.0) < (std::abs(size) <= 0.03 ? 0.6 : 1.0));
        }
      }
    }
  }
}

TEST_CASE("a step of the target ends at rest under every jerk limit, in a time in proportion") {
  for (const Home& home : kHomes) {
    for (const double jerk : {20.0, 100.0, 500.0, 2000.0, 10000.0}) {
      for (const double size : {0.01, 0.1}) {
        for (const int axis : {0, 2, 4}) {
          CAPTURE(std::string(home.name));
          CAPTURE(jerk);
          CAPTURE(size);
          CAPTURE(axis);
          JointLimits limits = arm(home.name).limits();
          limits.jerk.setConstant(jerk);
          const Chain chain = arm(home.name).with_limits(limits);
          Twist by = Twist::Zero();
          by[axis] = -size;
          // The way grows with the third power of the time under a jerk limit, and with the second without.
          const double most = 0.3 + 8.0 * std::cbrt(size / jerk) + 2.0 * std::sqrt(size);
          CHECK(settling_time(chain, every(1e-3), at_home(home), by, most + 0.5) < most);
        }
      }
    }
  }
}

TEST_CASE("at a target out of reach the arm does not swing, and its joints end below 1 % of their speeds") {
  for (const Home& home : kHomes) {
    for (int axis = 0; axis < 3; ++axis) {
      CAPTURE(std::string(home.name));
      CAPTURE(axis);
      const Chain chain = arm(home.name);
      ConstrainedIk ik(chain, every(2e-3));
      ik.reset(at_home(home));
      Twist by = Twist::Zero();
      by[axis] = 2.0;
      const Pose target = moved(ik.tip(), by);
      ConstrainedIkStep step;
      for (int i = 0; i < 5000; ++i) step = ik.step(target);
      CHECK(speed(chain, step.qdot) < 1e-2);
      CHECK(step.status == Status::Limited);
    }
  }
}

TEST_CASE("a reachable target is reached, at joint limits and through singularities, too") {
  const auto arrives = [](const Chain& chain, const JointVector& from, const JointVector& to) {
    CAPTURE(from.transpose());
    CAPTURE(to.transpose());
    ConstrainedIk ik(chain, every(2e-3));
    ik.reset(from);
    const Pose target = pose(chain, to);
    ConstrainedIkStep step;
    for (int i = 0; i < 4000; ++i) step = ik.update(target);
    CHECK(step.error.norm() < 1e-5);
    CHECK(speed(chain, step.qdot) < 1e-3);
  };
  for (const auto& [key, chain] : test::arms()) {
    const std::string& name = key;
    CAPTURE(name);
    Random random(2);
    for (int k = 0; k < 25; ++k) {
      const JointVector from = test::sample(random, chain);
      JointVector to = from;
      for (double& q : to) q += random.uniform(-0.25, 0.25);
      arrives(chain, from, to.cwiseMax(chain.limits().lower).cwiseMin(chain.limits().upper));
    }
  }
  // Joint 3 is near its upper limit, and the shortest way without limits leads past this limit.
  JointVector from(6), to(6);
  from << 2.272, 2.131, -0.122, 0.675, 0.801, -11.704;
  to << 2.113, 2.027, -0.012, 0.588, 0.897, -11.703;
  arrives(arm("comau_racer_7_1_4"), from, to);
}

TEST_CASE("a motion that is too fast leaves the tool upright, and the tool arrives") {
  JointVector q(7);
  q << 0.0, -0.4, 0.0, -2.0, 0.0, 1.6, 0.7;
  for (const double jerk : {kInfinity, 2000.0}) {
    JointLimits limits = arm("franka_panda").limits();
    limits.jerk.setConstant(jerk);
    const Chain chain = arm("franka_panda").with_limits(limits);
    for (const double duration : {0.2, 0.3, 0.4, 0.5}) {
      for (const int axis : {0, 1, 2}) {
        CAPTURE(jerk);
        CAPTURE(duration);
        CAPTURE(axis);
        ConstrainedIk ik(chain, every(1e-3));
        ik.reset(q);
        const Pose start = ik.tip();
        double most = 0.0, late = 0.0;
        for (double t = 1e-3; t < duration + 3.0; t += 1e-3) {
          const double u = std::min(1.0, t / duration);
          Twist by = Twist::Zero();
          by[axis] = (axis == 1 ? 0.3 : -0.2) * u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
          const ConstrainedIkStep step = ik.step(moved(start, by));
          most = std::max(most, step.error.tail<3>().norm());
          if (t > duration + 1.0) late = std::max({late, step.error.tail<3>().norm(), step.error.head<3>().norm()});
        }
        CHECK(most < 10.0 * M_PI / 180.0);
        CHECK(late < 1e-4);
      }
    }
  }
}

TEST_CASE("a smooth motion inside the limits is followed without a lag, under jerk limits, too") {
  for (const Home& home : kHomes) {
    for (const double jerk : {kInfinity, 5000.0}) {
      JointLimits limits = arm(home.name).limits();
      limits.jerk.setConstant(jerk);
      ConstrainedIk ik(arm(home.name).with_limits(limits), every(1e-3));
      ik.reset(at_home(home));
      const Pose start = ik.tip();
      for (int i = 0; i < 3000; ++i) {
        CAPTURE(std::string(home.name));
        CAPTURE(jerk);
        CAPTURE(i);
        const double wave = 1.0 - std::cos(2e-3 * i), bump = wave * wave;
        Twist by;
        by << 0.01 * bump, -0.01 * bump, -0.01 * bump, 0.02 * bump, 0.02 * bump, -0.02 * bump;
        const ConstrainedIkStep step = ik.step(moved(start, by));
        REQUIRE(step.error.norm() < 1e-6);
        REQUIRE(step.status != Status::Limited);
      }
    }
  }
}

namespace {

// The line of 0.2 m past the wrist's singularity, there and back, of "sigmaik axis5 --example 1", or straight across
// it, of "--example 2"; `offset` [rad] of axis 5 from zero, where it is closest.
struct Line {
  JointVector start = JointVector::Zero(6);
  Pose from;
  Eigen::Vector3d way;
  double duration;
  bool back;

  Line(const Chain& chain, bool past, double offset, double seconds) : duration(seconds), back(past) {
    constexpr double kDegree = M_PI / 180.0;
    if (past) {
      start << 0.0, -90.0, 90.0, 90.0, 0.0, -90.0;
    } else {
      start << 0.0, -80.0, 100.0, 0.0, 0.0, 0.0;
    }
    start *= kDegree;
    start[4] = offset;
    from = pose(chain, start);
    way = past ? Eigen::Vector3d(0.0, 0.0, -0.2) : Eigen::Vector3d(0.0, 0.2, 0.0);
    if (!past) return;
    const AnalyticIk closed(chain);
    from.translation() -= 0.5 * way;
    for (int k = 500; k >= 0; --k) {
      Pose here = from;
      here.translation() += 1e-3 * k * way;
      start = closed.nearest(here, start).branch.q;
    }
  }

  Pose at(double t) const {
    double u = std::clamp(t / duration, 0.0, back ? 2.0 : 1.0);
    if (u > 1.0) u = 2.0 - u;
    Pose out = from;
    out.translation() += u * u * u * (10.0 - 15.0 * u + 6.0 * u * u) * way;
    return out;
  }
};

}  // namespace

TEST_CASE("time scaling looks ahead: all six rows stay exact past and from a singularity, and the end is reached") {
  const Chain chain = arm("kuka_kr6_r900");
  for (const bool past : {true, false}) {
    for (const double offset : {0.0, 1e-3, 0.01, 0.1, 0.3, 1.0, 2.0}) {
      if (past && offset < 0.1) continue;
      for (const double duration : {0.5, 0.7, 2.0}) {
        for (const double dt : {1e-3, 4e-3}) {
          CAPTURE(past);
          CAPTURE(offset);
          CAPTURE(duration);
          CAPTURE(dt);
          const Line line(chain, past, offset * M_PI / 180.0, duration);
          ConstrainedIkOptions o = every(dt);
          o.exact.fill(true);
          o.gamma = 0.005 * std::sqrt(dt / 4e-3);
          ConstrainedIk ik(chain, o);
          ik.reset(line.start);
          const double end = past ? 2.0 * duration : duration;
          double clock = 0.0, off = 0.0;
          int cycles = 0;
          const int most = static_cast<int>(8.0 / dt);
          for (; clock < end + 0.1 && cycles < most; ++cycles) {
            const ConstrainedIkStep step = ik.step(line.at(clock + dt));
            clock += (1.0 - step.time_scale) * dt;
            off = std::max(off, step.path_error.norm());
          }
          CHECK(cycles < most);
          CHECK(off < 1e-6);
        }
      }
    }
  }
}

TEST_CASE("bad targets stop the arm; bad options are refused with the facts") {
  const Chain chain = arm("kuka_kr6_r900");
  ConstrainedIk ik(chain);
  Pose nonsense = Pose::Identity();
  CHECK(ik.step(nonsense).status == Status::BadInput);  // before reset()
  JointVector home(6), qdot = JointVector::Constant(6, 0.5);
  home << 0.0, -1.3, 1.5, 0.0, 0.5, 0.0;
  ik.reset(home, qdot);
  nonsense.translation()[1] = std::nan("");
  for (int i = 0; i < 200; ++i) {
    const ConstrainedIkStep step = ik.step(nonsense);
    CHECK(step.status == Status::BadInput);
    for (int j = 0; j < 6; ++j) {
      CHECK(std::abs(step.qdot[j] - qdot[j]) <= chain.limits().acceleration[j] * 1e-3 * (1.0 + 1e-9));
    }
    qdot = step.qdot;
  }
  CHECK(qdot.isZero(0.0));

  const auto refused = [&](auto change, const std::string& fact, const char* name = "kuka_kr6_r900") {
    ConstrainedIkOptions o;
    change(o);
    std::string text = "accepted";
    try {
      ConstrainedIk refused_one(arm(name), o);
    } catch (const Error& e) {
      text = e.what();
    }
    CAPTURE(text);
    CHECK(text.find(fact) != std::string::npos);
  };
  refused([](auto& o) { o.dt = 0.0; }, "dt");
  refused([](auto& o) { o.alpha[4] = -1.0; }, "ωy");
  refused([](auto& o) { o.beta[3] = kInfinity; }, "ωx");
  refused([](auto& o) { o.alpha[5] = o.beta[5] = 0.0; }, "ωz");
  refused([](auto& o) { o.gamma = 0.0; }, "gamma");
  refused([](auto& o) { o.gamma = std::nan(""); }, "gamma");
  refused([](auto& o) { o.max_error[0] = 0.0; }, "max_error");
  refused([](auto& o) { o.iterations = 0; }, "iterations");
  refused([](auto& o) { o.task.mask = {}; }, "mask");
  refused([](auto& o) { o.torque_limits = true; }, "inertia");
  refused([](auto& o) { o.limits.recovery_speed = 0.0; }, "recovery_speed");
}
