// Random arms under random commands, cycle after cycle, against the limits as a robot's controller would check them.
//
//     sigmaik_stress [cycles] [seed] [threads]   episodes until so many cycles are run; exit code 1 if anything failed
//     sigmaik_stress --episode NUMBER            one episode again, in words
//     sigmaik_stress --table [cycles] [seed]     the counts as CSV, a line for each property, for `sigmaik stress`
//
// An episode is all its number says: arm, limits, options, start and commands. docs/reliability.md defines the counts.

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <sigmaik/constrained_ik.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/servo.hpp>

#include "numbers.hpp"
#include "random.hpp"
#include "table.hpp"

namespace {

using namespace sigmaik;
using test::kInfinity;
using test::kNan;
using test::Random;

constexpr double kTolerance = 1e-9;  // relative, of velocity, acceleration and jerk limits; positions get none
constexpr double kDone = 1e-4;       // the servo's: a twist that misses this part of itself is done
constexpr double kSnap = 2e-12;      // q + q̇ dt to this, times 1 + |q|

double ulp(double x) { return std::nextafter(std::abs(x), kInfinity) - std::abs(x); }

// ---- Counts ---------------------------------------------------------------------------------------------------------

enum Failure {
  kPosition,
  kVelocity,
  kAcceleration,
  kJerk,          // limits that could have been kept
  kNotRecovered,  // joint-cycles after the time by which an infeasible start is over
  kNotFinite,
  kNotSum,
  kUnasked,
  kRefused,
  kAccepted,
  kReport,
  kFailures
};
constexpr const char* kFailureNames[kFailures] = {
    "position limit broken", "velocity limit broken", "acceleration limit broken", "jerk limit broken",
    "not back in time",      "output not finite",     "q is not q + dt qdot",      "moved unasked",
    "good input refused",    "bad input accepted",    "report contradicts itself"};

struct Counts {
  long episodes = 0, cycles = 0, joint_cycles = 0, servo = 0, constrained = 0, analytic = 0, infeasible = 0;
  long infeasible_joints = 0, recovered_joints = 0, bad_inputs = 0, held = 0, taken_over = 0;
  std::array<long, 5> servo_status{}, constrained_status{};
  std::array<long, kFailures> failures{};
  std::array<double, 4> worst{};  // largest of value / (limit + rounding), position: [rad or m] beyond the limit
  double longest_recovery = 0.0;  // as a part of the time allowed
  std::array<std::uint32_t, 4> worst_episode{};
  std::vector<std::uint32_t> failed;

  bool any() const {
    return std::any_of(failures.begin(), failures.end(), [](long n) { return n != 0; });
  }
  void add(const Counts& o) {
    for (long Counts::* n : {&Counts::episodes, &Counts::cycles, &Counts::joint_cycles, &Counts::servo,
                             &Counts::constrained, &Counts::analytic, &Counts::infeasible, &Counts::infeasible_joints,
                             &Counts::recovered_joints, &Counts::bad_inputs, &Counts::held, &Counts::taken_over}) {
      this->*n += o.*n;
    }
    for (std::size_t i = 0; i < servo_status.size(); ++i) {
      servo_status[i] += o.servo_status[i];
      constrained_status[i] += o.constrained_status[i];
    }
    for (std::size_t i = 0; i < kFailures; ++i) failures[i] += o.failures[i];
    for (std::size_t i = 0; i < worst.size(); ++i) {
      if (o.worst[i] > worst[i]) {
        worst[i] = o.worst[i];
        worst_episode[i] = o.worst_episode[i];
      }
    }
    longest_recovery = std::max(longest_recovery, o.longest_recovery);
    failed.insert(failed.end(), o.failed.begin(), o.failed.end());
  }
};

// ---- The independent check of one joint -----------------------------------------------------------------------------

struct Limits {
  double lower, upper, velocity, acceleration, jerk, recovery;  // recovery: [1/s or m/s] least speed back
};

// Time from v to rest with slope 0 at both ends, in continuous time.
double stopping_time(const Limits& l, double v) {
  if (std::isinf(l.jerk)) return v / l.acceleration;
  if (std::isinf(l.acceleration) || v < l.acceleration * l.acceleration / l.jerk) return 2.0 * std::sqrt(v / l.jerk);
  return v / l.acceleration + l.acceleration / l.jerk;
}

// Whether all limits can surely be kept from here, with a tenth of the way to spare: a slope that grows towards a limit
// is first reduced to 0; a slope that falls only helps.
bool can_be_kept(const Limits& l, double dt, double q, double v, double a) {
  if (q > l.upper || q < l.lower || std::abs(v) > l.velocity) return false;
  for (const double sign : {1.0, -1.0}) {
    const double slope = std::isinf(l.jerk) || sign * a <= 0.0 ? 0.0 : std::abs(a) + l.jerk * dt;
    const double release = slope == 0.0 ? 0.0 : slope / l.jerk;
    const double now = std::max(0.0, sign * v), then = std::max(0.0, sign * v + 0.5 * slope * release);
    if (then > l.velocity) return false;
    const double way = (now + 0.5 * slope * release) * release + 0.5 * then * stopping_time(l, then);
    const double room = sign > 0.0 ? l.upper - q : q - l.lower;
    if (1.1 * way + 3.0 * std::max(now, then) * dt > room) return false;
  }
  return true;
}

// Time to stop, turn round, travel and settle, a few times over.
double recovery_time(const Limits& l, double dt, double q, double v) {
  const double speed = std::abs(v), a = l.acceleration, j = l.jerk;
  const bool both = !std::isinf(a) && !std::isinf(j);
  const double stopping = speed / a + 2.0 * std::sqrt(speed / j) + (both ? a / j : 0.0);
  const double outside = std::max({0.0, q - l.upper, l.lower - q});
  const double over = outside + speed * (stopping + dt);
  return 4.0 * stopping + 3.0 * over / l.recovery + 8.0 * std::cbrt(over / j) + 8.0 * std::sqrt(l.recovery / j) +
         6.0 * std::sqrt(over / a) + 4.0 * l.recovery / a + (both ? 8.0 * a / j : 0.0) +
         (std::isinf(l.velocity) ? 2.0 : 0.0) + 100.0 * dt;
}

class Joint {
 public:
  Joint(const Limits& limits, double dt, double q, double v)
      : l_(limits), dt_(dt), q_(q), v_(v), fastest_(std::abs(v)), farthest_(std::abs(q)) {
    feasible_ = armed_ = can_be_kept(l_, dt, q, v, 0.0);
    deadline_ = feasible_ ? 0.0 : recovery_time(l_, dt, q, v);
    q_before_ = q - v * dt;
    q_before_that_ = q_before_ - v * dt;
  }

  bool feasible() const { return feasible_; }
  double deadline() const { return deadline_; }
  double recovered() const { return recovered_; }

  template <typename Fail, typename Worst>
  void step(long cycle, double q, double v, const Fail& fail, const Worst& worst) {
    fastest_ = std::max(fastest_, std::abs(v));
    farthest_ = std::max(farthest_, std::abs(q));
    if (!(std::abs(q - (q_ + v * dt_)) <= kSnap * (1.0 + std::abs(q_)))) fail(kNotSum);

    const double rounding = 2.0 * ulp(fastest_) / dt_, a = (v - v_) / dt_;
    const auto check = [&](Failure kind, double value, double limit, double allowed) {
      if (!(limit < kInfinity)) return;
      const double most = limit * (1.0 + kTolerance) + allowed;
      worst(kind, std::abs(value) / (limit + allowed));
      if (!(std::abs(value) <= most)) fail(kind);
    };
    check(kAcceleration, a, l_.acceleration, rounding);
    check(kJerk, (a - a_) / dt_, l_.jerk, 2.0 * rounding / dt_);
    // The same differences from positions, because some controllers receive positions alone.
    const double e = kSnap * (1.0 + farthest_);
    const double d1 = (q - q_) / dt_, d2 = (q - 2.0 * q_ + q_before_) / (dt_ * dt_);
    const double d3 = (q - 3.0 * q_ + 3.0 * q_before_ - q_before_that_) / (dt_ * dt_ * dt_);
    check(kAcceleration, d2, l_.acceleration, 4.0 * e / (dt_ * dt_));
    check(kJerk, d3, l_.jerk, 8.0 * e / (dt_ * dt_ * dt_));

    if (!armed_ && static_cast<double>(cycle) * dt_ >= deadline_) {
      armed_ = late_ = true;
    }
    if (armed_) {
      const bool outside = q > l_.upper || q < l_.lower;
      worst(kPosition, std::max({0.0, q - l_.upper, l_.lower - q}));
      if (outside) fail(late_ ? kNotRecovered : kPosition);
      check(late_ ? kNotRecovered : kVelocity, v, l_.velocity, 0.0);
      check(late_ ? kNotRecovered : kVelocity, d1, l_.velocity, 2.0 * e / dt_);
    }
    q_before_that_ = q_before_;
    q_before_ = q_;
    q_ = q;
    v_ = v;
    a_ = a;
    const bool inside = q <= l_.upper && q >= l_.lower && std::abs(v) <= l_.velocity * (1.0 + kTolerance);
    if (!feasible_) recovered_ = inside ? (recovered_ < 0.0 ? static_cast<double>(cycle) * dt_ : recovered_) : -1.0;
    if (!armed_) armed_ = can_be_kept(l_, dt_, q, v, a);
  }

 private:
  Limits l_;
  double dt_, q_, v_, a_ = 0.0, fastest_, farthest_, q_before_, q_before_that_;
  bool feasible_, armed_, late_ = false;  // late: only the deadline has armed the check
  double deadline_, recovered_ = -1.0;
};

// ---- Arms, limits, starts -------------------------------------------------------------------------------------------

const std::vector<std::pair<std::string, Chain>>& shipped() {
  static const std::vector<std::pair<std::string, Chain>> all = [] {
    std::map<std::string, Chain> found;
    for (const auto& entry : std::filesystem::directory_iterator(SIGMAIK_ROBOTS_DIR)) {
      if (entry.path().extension() != ".urdf") continue;
      found.emplace(entry.path().stem().string(), Chain::from_urdf(entry.path().string(), "", "flange"));
    }
    return std::vector<std::pair<std::string, Chain>>(found.begin(), found.end());
  }();
  return all;
}

// Limits over many decades, ratios that make no sense included.
JointLimits random_limits(Random& random, const Chain& chain, double dt) {
  JointLimits limits = chain.limits();
  const bool jerk = random.chance(0.5);
  for (int i = 0; i < chain.dof(); ++i) {
    const double middle = random.uniform(-2.0, 2.0), half = random.decades(-3.0, 1.0);
    if (chain.joint_types()[static_cast<std::size_t>(i)] != JointType::Continuous) {
      limits.lower[i] = random.chance(0.85) ? middle - half : -kInfinity;
      limits.upper[i] = random.chance(0.85) ? middle + half : kInfinity;
    }
    limits.velocity[i] = random.chance(0.8) ? random.decades(-2.0, 1.5) : kInfinity;
    limits.acceleration[i] = random.chance(0.8) ? random.decades(-1.0, 4.0) : kInfinity;
    limits.jerk[i] = kInfinity;
    if (!jerk || random.chance(0.3)) continue;
    const double a = std::min(limits.acceleration[i], 10.0);
    limits.jerk[i] = random.chance(0.5) ? random.decades(-1.0, 8.0) : a / dt * random.decades(-3.0, 2.0);
  }
  return limits;
}

Method random_method(Random& random) {
  const double gamma = random.decades(-2.0, -0.5);
  switch (random.integer(0, 11)) {
    case 0: return PseudoInverse{};
    case 1: return DampedLeastSquares{random.decades(-3.0, 0.0)};
    case 2: return AdaptiveDampedLeastSquares{};
    case 3: return AdaptiveDampedLeastSquares{DampingRule::Manipulability};
    case 4: return AdaptiveDampedLeastSquares{DampingRule::SmallestSingularValue};
    case 5: return SelectivelyDampedLeastSquares{};
    case 6: return JacobianProjection{gamma};
    case 7: return JacobianSafety{gamma};
    case 8: return JacobianSafetyProjection{gamma};
    case 9: return JParse{gamma, random.uniform(0.0, 4.0), random.uniform(0.0, 4.0), random.chance(0.5)};
    default: return JParse{gamma};
  }
}

double inside(Random& random, double lower, double upper) {
  const double low = std::max(lower, std::min(upper, 2.5) - 5.0), high = std::min(upper, low + 5.0);
  return random.chance(0.1) ? low : random.chance(0.1) ? high : random.uniform(low, high);
}

// ---- Commands -------------------------------------------------------------------------------------------------------

struct Command {
  enum Kind { kPose, kTwist } kind = kPose;
  Pose pose = Pose::Identity();
  Twist twist = Twist::Zero();
  bool bad = false;
};

// Commands as people, cameras, policies and broken cables give them.
class Commander {
 public:
  Commander(Random& random, const Chain& chain, const JointVector& q, bool poses_only)
      : random_(random),
        chain_(chain),
        goal_(q),
        policy_(random.integer(0, poses_only ? 4 : 10)),
        dwell_(random.decades(0.0, 2.7)),
        size_(random.decades(-2.0, 1.0)),
        bad_(random.chance(0.2) ? 0.01 : 0.0) {
    command_.pose = sigmaik::pose(chain, q);
    command_.kind = policy_ <= 4 ? Command::kPose : Command::kTwist;
    if (policy_ > 4) command_.twist = size_ * random.unit(6);
  }

  const Command& next(const Pose& tip) {
    if (command_.bad) command_ = good_;
    const bool change = random_.chance(1.0 / dwell_);
    switch (policy_) {
      case 0:  // a walk of the joints, also far beyond their limits
        if (change) {
          for (double& x : goal_) x += size_ * random_.normal();
          command_.pose = sigmaik::pose(chain_, goal_);
        }
        break;
      case 1:  // jumps
        if (change) command_.pose = random_.pose(random_.decades(-1.0, 0.5));
        break;
      case 2:  // out of reach
        if (change) {
          command_.pose = tip;
          command_.pose.translation() += random_.decades(0.0, 3.0) * random_.unit(3);
        }
        break;
      case 3:  // drifts, smoothly
        command_.pose.translation() += 1e-3 * size_ * random_.unit(3);
        command_.pose.linear() = rotation_exp(Eigen::Vector3d(1e-3 * size_ * random_.unit(3))) * command_.pose.linear();
        break;
      case 4:  // noise around the tip's pose
        command_.pose = tip;
        command_.pose.translation() += 1e-3 * size_ * random_.vector(3);
        command_.pose.linear() = rotation_exp(Eigen::Vector3d(1e-2 * size_ * random_.vector(3))) * tip.linear();
        break;
      case 5:  // the same command all the time
        break;
      case 6:  // bang-bang
        if (change) command_.twist = -command_.twist;
        break;
      case 7:
        if (change) command_.twist = random_.decades(-3.0, 2.0) * random_.unit(6);
        break;
      case 8:  // twists of any size
        if (change) command_.twist = random_.decades(0.0, random_.chance(0.1) ? 250.0 : 12.0) * random_.unit(6);
        break;
      case 9:  // zero and other twists in turns
        if (change) command_.twist = command_.twist.isZero(0.0) ? Twist(size_ * random_.unit(6)) : Twist(Twist::Zero());
        break;
      default:  // poses and twists in turns
        if (change) {
          command_.kind = command_.kind == Command::kPose ? Command::kTwist : Command::kPose;
          command_.twist = size_ * random_.unit(6);
          command_.pose = random_.pose();
        }
    }
    good_ = command_;
    if (bad_ > 0.0 && random_.chance(bad_)) {
      command_.bad = true;
      const double what = random_.chance(0.5) ? kNan : random_.chance(0.5) ? kInfinity : -kInfinity;
      if (command_.kind == Command::kTwist) {
        command_.twist[random_.integer(0, 5)] = what;
      } else if (random_.chance(0.3)) {
        command_.pose.linear() *= 1.01;
      } else {
        command_.pose.matrix()(random_.integer(0, 2), random_.integer(0, 3)) = what;
      }
    }
    return command_;
  }

 private:
  Random& random_;
  const Chain& chain_;
  JointVector goal_;
  int policy_;
  double dwell_, size_, bad_;
  Command command_, good_;
};

// ---- An episode -----------------------------------------------------------------------------------------------------

// The properties of an episode, all drawn at random.
struct Setup {
  double dt;
  bool constrained;  // ConstrainedIk, else Servo
  std::string name;
  Chain chain;
  std::array<bool, 4> holds;  // limits of position, velocity, acceleration, jerk
  double recovery_speed;
  double assumed_acceleration;  // of joints whose limits have none; infinite: none
  std::vector<Joint> joints;
  JointVector start, moving;
  bool at_once;              // the start is at rest: no command is faded in
  bool position_only_start;  // reset() gets positions alone
};

class Episode {
 public:
  Episode(std::uint32_t number, bool talk) : number_(number), talk_(talk), random_(number) {}

  static long length(std::uint32_t number) {
    Random random(number);
    return static_cast<long>(random.decades(2.0, 3.7));
  }

  // The number determines the episode: the order in which numbers are drawn is part of this test.
  Counts run() {
    Setup setup = draw();
    if (talk_) describe(setup);
    Commander commander(random_, setup.chain, setup.start, setup.constrained);
    if (setup.constrained) {
      drive_constrained(setup, commander);
    } else {
      drive_servo(setup, commander);
    }
    judge(setup);
    return counts_;
  }

 private:
  // ---- Draw

  Setup draw() {
    length_ = static_cast<long>(random_.decades(2.0, 3.7));
    const double dt = random_.chance(0.5) ? 1e-3 : random_.decades(-4.0, -1.5);
    const bool constrained = random_.chance(0.3);
    auto [name, chain] = random_.chance(0.5) ? draw_shipped(dt) : draw_random(dt);
    const std::array<bool, 4> holds{!random_.chance(0.05), !random_.chance(0.05), !random_.chance(0.05),
                                    !random_.chance(0.05)};
    const double recovery_speed = random_.chance(0.7) ? 0.1 : random_.decades(-1.0, 0.0);
    const double assumed = random_.chance(0.5) ? kInfinity : random_.chance(0.5) ? 10.0 : random_.decades(-1.0, 4.0);
    Setup setup{dt, constrained, name, chain, holds, recovery_speed, assumed, {}, {}, {}, false, false};
    draw_start(setup);
    setup.at_once = setup.moving.isZero(0.0);
    setup.position_only_start = setup.at_once && random_.chance(0.5);
    return setup;
  }

  std::pair<std::string, Chain> draw_shipped(double dt) {
    const auto& all = shipped();
    const auto which = static_cast<std::size_t>(random_.integer(0, static_cast<int>(all.size()) - 1));
    const auto& [name, chain] = all[which];
    JointLimits limits = chain.limits();
    const bool jerk = random_.chance(0.4), tight = random_.chance(0.4);
    for (int i = 0; i < chain.dof(); ++i) {
      if (tight) limits.velocity[i] = random_.decades(-2.0, 0.5);
      if (tight || std::isinf(limits.acceleration[i])) limits.acceleration[i] = random_.decades(0.0, 3.0);
      if (jerk) limits.jerk[i] = random_.decades(1.0, 6.0);
    }
    if (random_.chance(0.2)) return {name, chain};
    return {name, chain.with_limits(random_.chance(0.2) ? random_limits(random_, chain, dt) : limits)};
  }

  std::pair<std::string, Chain> draw_random(double dt) {
    const double prismatic = random_.chance(0.5) ? 0.0 : 0.4;
    const Chain plain = random_.chain(random_.integer(2, 9), prismatic);
    return {"random", plain.with_limits(random_limits(random_, plain, dt))};
  }

  // Where each joint starts, and how fast.
  void draw_start(Setup& setup) {
    const JointLimits& c = setup.chain.limits();
    const auto& holds = setup.holds;
    const int n = setup.chain.dof();
    setup.start = setup.moving = JointVector::Zero(n);
    const int kind = random_.integer(0, 9);  // 0, 1: outside; 2: too fast; 3, 4: all zero; 5, 6: moving; else at rest
    for (int i = 0; i < n; ++i) {
      const Limits limits{holds[0] ? c.lower[i] : -kInfinity,
                          holds[0] ? c.upper[i] : kInfinity,
                          holds[1] ? c.velocity[i] : kInfinity,
                          !holds[2]                       ? kInfinity
                          : std::isinf(c.acceleration[i]) ? setup.assumed_acceleration
                                                          : c.acceleration[i],
                          holds[3] ? c.jerk[i] : kInfinity,
                          std::isinf(c.velocity[i]) ? 0.01 : setup.recovery_speed * c.velocity[i]};
      auto [q, v] = draw_joint(kind, limits);
      // A recovery that takes longer than the episode would show nothing; zero is a pose at which people do start.
      if (recovery_time(limits, setup.dt, q, v) / setup.dt > 0.9 * static_cast<double>(length_) &&
          !can_be_kept(limits, setup.dt, q, v, 0.0)) {
        v = 0.0;
        q = std::clamp(q, limits.lower, limits.upper);
      }
      setup.start[i] = q;
      setup.moving[i] = v;
      setup.joints.emplace_back(limits, setup.dt, q, v);
      if (!setup.joints.back().feasible()) ++counts_.infeasible_joints;
    }
    counts_.infeasible = counts_.infeasible_joints != 0;
  }

  // Position and velocity.
  std::pair<double, double> draw_joint(int kind, const Limits& limits) {
    double v = 0.0, q = inside(random_, limits.lower, limits.upper);
    if (kind <= 1 && random_.chance(0.5)) {
      const double over = random_.decades(-6.0, 0.3);
      if (limits.upper < kInfinity && random_.chance(0.5)) {
        q = limits.upper + over;
      } else if (limits.lower > -kInfinity) {
        q = limits.lower - over;
      }
    }
    if (kind == 3 || kind == 4) q = 0.0;
    const double speed = std::min(limits.velocity, random_.decades(-1.0, 1.0));
    if (kind == 1 || kind == 2) v = 3.0 * speed * random_.uniform(-1.0, 1.0);
    if (kind == 5 || kind == 6) v = speed * random_.uniform(-1.0, 1.0);
    return {q, v};
  }

  Task draw_task() {
    Task task;
    if (random_.chance(0.3)) {
      for (bool& row : task.mask) row = random_.chance(0.6);
      if (task.rows() == 0) task.mask[static_cast<std::size_t>(random_.integer(0, 5))] = true;
    }
    if (random_.chance(0.4)) task.frame = Frame::Tool;
    return task;
  }

  void describe(const Setup& setup) const {
    const JointLimits& c = setup.chain.limits();
    std::printf(
        "episode %u: %s, %d joints, %s, dt %.3g s, %ld cycles, assumed acceleration %g, %ld infeasible joints\n",
        number_, setup.name.c_str(), setup.chain.dof(), setup.constrained ? "ConstrainedIk" : "Servo", setup.dt,
        length_, setup.assumed_acceleration, counts_.infeasible_joints);
    for (int i = 0; i < setup.chain.dof(); ++i) {
      std::printf("  joint %d: q %.6g, qdot %.4g in [%.6g, %.6g], velocity %.4g, acceleration %.4g, jerk %.4g%s\n", i,
                  setup.start[i], setup.moving[i], c.lower[i], c.upper[i], c.velocity[i], c.acceleration[i], c.jerk[i],
                  setup.joints[static_cast<std::size_t>(i)].feasible() ? "" : " (infeasible)");
    }
  }

  // ---- Build

  template <typename Options>
  static void build_limits(const Setup& setup, Options& o) {
    o.limits.position = setup.holds[0];
    o.limits.velocity = setup.holds[1];
    o.limits.acceleration = setup.holds[2];
    o.limits.jerk = setup.holds[3];
    o.limits.assumed_acceleration = setup.assumed_acceleration;
    o.limits.recovery_speed = setup.recovery_speed;
  }

  ConstrainedIkOptions build_constrained(const Setup& setup) {
    ConstrainedIkOptions o;
    o.dt = setup.dt;
    o.task = draw_task();
    for (std::size_t i = 0; i < 6; ++i) o.exact[i] = random_.chance(0.4);
    if (random_.chance(0.5)) o.beta.setConstant(random_.decades(-1.0, 2.0));
    if (random_.chance(0.5)) o.gamma = random_.decades(-3.0, 3.0);
    if (random_.chance(0.3)) o.max_error = Twist::Constant(random_.decades(-4.0, 0.0));
    o.iterations = random_.integer(1, 3);
    o.analytic = random_.chance(0.7);
    o.torque_limits = random_.chance(0.3);
    build_limits(setup, o);
    return o;
  }

  ServoOptions build_servo(const Setup& setup) {
    ServoOptions o;
    o.dt = setup.dt;
    o.task = draw_task();
    if (random_.chance(0.4)) {
      for (std::size_t i = 0; i < 6; ++i) o.exact[i] = o.task.mask[i] && random_.chance(0.4);
    }
    o.on_limit = random_.chance(0.6) ? OnLimit::Redistribute : OnLimit::Scale;
    if (random_.chance(0.3)) o.gain_linear = o.gain_angular = random_.decades(-1.0, 2.5);
    if (random_.chance(0.2)) o.max_linear_error = o.max_angular_error = kInfinity;
    if (random_.chance(0.5)) o.soft_start = 0.0;
    if (random_.chance(0.3)) {
      o.posture_gain = random_.decades(-1.0, 1.5);
      if (random_.chance(0.5)) {
        o.posture = JointVector::NullaryExpr(setup.chain.dof(), [this] { return random_.uniform(-4.0, 4.0); });
      }
      if (random_.chance(0.5)) o.posture_max_speed = random_.decades(-2.0, 1.0);
    }
    if (random_.chance(0.3)) o.length_scale = random_.decades(-1.5, 1.0);
    build_limits(setup, o);
    return o;
  }

  // ---- Drive

  void drive_constrained(Setup& setup, Commander& commander) {
    counts_.constrained = 1;
    ConstrainedIkOptions o = build_constrained(setup);
    std::optional<ConstrainedIk> ik;
    try {
      ik.emplace(setup.chain, o);
    } catch (const Error&) {  // no inertias, or no efforts
      o.torque_limits = false;
      ik.emplace(setup.chain, o);
    }
    counts_.analytic = ik->has_analytic();
    ik->reset(setup.start, setup.position_only_start ? JointVector() : setup.moving);
    if (talk_) {
      std::printf("  gamma %g, max_error %g, iterations %d, analytic %d, torque limits %d\n", o.gamma.value_or(0.0),
                  o.max_error[0], o.iterations, ik->has_analytic(), o.torque_limits);
    }
    loop(setup, [&](long) {
      const Command& command = commander.next(ik->tip());
      const ConstrainedIkStep s = ik->step(command.pose);
      ++counts_.constrained_status[static_cast<std::size_t>(s.status)];
      input(command.bad, s.status == Status::BadInput, true);
      held(s.active != 0, s.status == Status::Limited);
      if (!(s.time_scale >= 0.0 && s.time_scale <= 1.0)) fail(kReport);
      if (!s.error.allFinite() || !s.path_error.allFinite()) fail(kNotFinite);
      if (s.status == Status::Ok && o.task.whole() && s.error.cwiseAbs().maxCoeff() > 2e-9) fail(kReport);
      idle_ = command.bad;
      q_ = s.q;
      qdot_ = s.qdot;
    });
  }

  void drive_servo(Setup& setup, Commander& commander) {
    counts_.servo = 1;
    const ServoOptions o = build_servo(setup);
    const Method method = random_method(random_);
    Servo servo(setup.chain, method, o);
    servo.reset(setup.start, setup.position_only_start ? JointVector() : setup.moving);
    const bool changes_method = random_.chance(0.1);
    if (talk_) {
      std::printf("  %s, %s, posture gain %g, gains %g, length scale %g, rows %d, exact %d%d%d%d%d%d\n",
                  sigmaik::name(method), o.on_limit == OnLimit::Scale ? "Scale" : "Redistribute", o.posture_gain,
                  o.gain_linear, o.length_scale.value_or(0.0), o.task.rows(), o.exact[0], o.exact[1], o.exact[2],
                  o.exact[3], o.exact[4], o.exact[5]);
    }
    const bool no_fade = setup.at_once || o.soft_start == 0.0;
    ChainState state;
    loop(setup, [&](long cycle) {
      if (changes_method && random_.chance(0.01)) servo.set_method(random_method(random_));
      const Command& command = commander.next(servo.tip());
      const bool twist = command.kind == Command::kTwist;
      // Without limits a huge twist takes a joint beyond the range of sensible numbers.
      const bool sane = servo.q().cwiseAbs().maxCoeff() < 1e100;
      const bool look = cycle % 32 == 0 && sane;
      if (look) update(setup.chain, servo.q(), state);
      const ServoStep s = twist ? servo.update_twist(command.twist) : servo.update(command.pose);
      ++counts_.servo_status[static_cast<std::size_t>(s.status)];
      const bool judged = sane && (!twist || command.twist.cwiseAbs().maxCoeff() < 1e100);
      input(command.bad, s.status == Status::BadInput, judged);
      held(s.limiting_joints != 0, s.status == Status::Limited);
      if (!(s.scale >= 0.0 && s.scale <= 1.0)) fail(kReport);
      if (s.status == Status::Ok && s.scale != 1.0) fail(kReport);
      if (!s.achieved_twist.allFinite() || !s.pose_error.allFinite()) fail(kNotFinite);
      if (look && s.qdot.allFinite()) check_achieved(state, s);
      if (look && twist && s.status == Status::Ok && o.posture_gain == 0.0 && no_fade) {
        check_done(o.task, servo.length_scale(), state, command.twist, s);
      }
      idle_ = command.bad || (twist && command.twist.isZero(0.0) && o.posture_gain == 0.0 && no_fade);
      q_ = s.q;
      qdot_ = s.qdot;
    });
  }

  // ---- Judge

  void check_achieved(const ChainState& state, const ServoStep& s) {
    const double size = (1.0 + state.jacobian.norm()) * s.qdot.norm();
    if (!((s.achieved_twist - state.jacobian * s.qdot).norm() <= 1e-12 * size)) fail(kReport);
  }

  // Status::Ok: the twist is done.
  void check_done(const Task& task, double length_scale, const ChainState& state, const Twist& twist,
                  const ServoStep& s) {
    Twist weighted = twist, missed = twist - s.achieved_twist;
    weighted.tail<3>() *= length_scale;
    missed.tail<3>() *= length_scale;
    const TaskVector asked = select_rows(task, state.tip.linear(), weighted);
    const TaskVector not_done = select_rows(task, state.tip.linear(), missed);
    if (!(not_done.norm() <= 2.0 * kDone * asked.norm())) fail(kReport);
  }

  void judge(const Setup& setup) {
    counts_.episodes = 1;
    counts_.cycles = length_;
    counts_.joint_cycles = length_ * setup.chain.dof();
    for (std::uint32_t& episode : counts_.worst_episode) episode = number_;
    for (const Joint& joint : setup.joints) {
      if (joint.feasible()) continue;
      if (joint.recovered() >= 0.0) ++counts_.recovered_joints;
      counts_.longest_recovery = std::max(counts_.longest_recovery, joint.recovered() / joint.deadline());
    }
    if (counts_.any()) counts_.failed.push_back(number_);
  }

  void fail(Failure kind) {
    if (talk_ && said_[kind]++ < 5) std::printf("  cycle %ld, joint %d: %s\n", cycle_, joint_, kFailureNames[kind]);
    ++counts_.failures[kind];
  }
  void input(bool bad, bool refused, bool judged) {
    counts_.bad_inputs += bad;
    if (bad && !refused) fail(kAccepted);
    if (!bad && refused && judged) fail(kRefused);
  }
  void held(bool some, bool limited) {
    counts_.held += some;
    counts_.taken_over += some && !limited;
  }

  template <typename Cycle>
  void loop(Setup& setup, const Cycle& cycle) {
    const int n = setup.chain.dof();
    int at_rest = setup.at_once ? 2 : 0;  // cycles
    bool in = true;
    for (const Joint& joint : setup.joints) in = in && joint.feasible();
    q_ = setup.start;
    for (cycle_ = 0; cycle_ < length_; ++cycle_) {
      joint_ = -1;
      cycle(cycle_);
      if (q_.size() != n || qdot_.size() != n || !q_.allFinite() || !qdot_.allFinite()) {
        fail(kNotFinite);
        return;
      }
      if (idle_ && in && at_rest >= 2 && !qdot_.isZero(0.0)) fail(kUnasked);
      at_rest = qdot_.isZero(0.0) ? at_rest + 1 : 0;
      for (joint_ = 0; joint_ < n; ++joint_) {
        setup.joints[static_cast<std::size_t>(joint_)].step(
            cycle_, q_[joint_], qdot_[joint_], [this](Failure kind) { fail(kind); },
            [this](Failure kind, double value) {
              if (kind > kJerk) return;
              counts_.worst[kind] = std::max(counts_.worst[kind], value);
            });
      }
    }
  }

  std::uint32_t number_;
  bool talk_;
  Random random_;
  Counts counts_;
  long length_ = 0, cycle_ = 0;
  int joint_ = -1;
  bool idle_ = false;
  JointVector q_, qdot_;
  std::array<int, kFailures> said_{};
};

// The numbers of a run's episodes: any two runs of one seed begin with the same.
std::uint32_t episode_number(std::uint64_t seed, std::uint64_t index) {
  std::uint64_t z = (seed << 32) + (index + 1) * 0x9e3779b97f4a7c15ull;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return static_cast<std::uint32_t>(z ^ (z >> 31));
}

void print(const Counts& c) {
  std::printf("cycles %ld, joint-cycles %ld, episodes %ld (servo %ld, constrained %ld, of these closed form %ld)\n",
              c.cycles, c.joint_cycles, c.episodes, c.servo, c.constrained, c.analytic);
  std::printf("infeasible starts: episodes %ld, joints %ld, back inside %ld, in at most %.3g of the time allowed\n",
              c.infeasible, c.infeasible_joints, c.recovered_joints, c.longest_recovery);
  std::printf("bad inputs %ld, cycles with joints held %ld, of which others took over %ld\n", c.bad_inputs, c.held,
              c.taken_over);
  for (const auto* status : {&c.servo_status, &c.constrained_status}) {
    std::printf("%-16s", status == &c.servo_status ? "servo" : "constrained");
    for (std::size_t i = 0; i < 5; ++i) std::printf("  %s %ld", to_string(static_cast<Status>(i)), (*status)[i]);
    std::printf("\n");
  }
  for (std::size_t i = 0; i < kFailures; ++i) std::printf("%-26s %ld\n", kFailureNames[i], c.failures[i]);
  std::printf("worst: position beyond its limit by %.3g\n", c.worst[kPosition]);
  constexpr const char* kNames[] = {"position", "velocity", "acceleration (change of velocity in a cycle)", "jerk"};
  for (const Failure kind : {kVelocity, kAcceleration, kJerk}) {
    std::printf("worst: %s, of its limit 1 %+.2g (episode %u)\n", kNames[kind], c.worst[kind] - 1.0,
                c.worst_episode[kind]);
  }
}

// The property of each count, and what its cases are. A new count is a Failure, its name, and a line here.
void print_table(const Counts& c) {
  stress::print_head();
  const auto row = [&](Failure kind, const char* property, const char* of, long cases, double worst) {
    stress::print_row(property, of, cases, c.failures[kind], worst, c.failed);
  };
  row(kPosition, "position limits", "joints x cycles", c.joint_cycles, c.worst[kPosition]);
  row(kVelocity, "velocity limits", "joints x cycles", c.joint_cycles, c.worst[kVelocity]);
  row(kAcceleration, "acceleration limits", "joints x cycles", c.joint_cycles, c.worst[kAcceleration]);
  row(kJerk, "jerk limits", "joints x cycles", c.joint_cycles, c.worst[kJerk]);
  row(kNotRecovered, "back inside in time", "joints that start outside", c.infeasible_joints, c.longest_recovery);
  row(kNotFinite, "finite", "cycles", c.cycles, 0.0);
  row(kNotSum, "continuity: q + dt qdot", "joints x cycles", c.joint_cycles, 0.0);
  row(kUnasked, "rest where nothing is asked", "cycles", c.cycles, 0.0);
  row(kRefused, "good input taken", "cycles", c.cycles - c.bad_inputs, 0.0);
  row(kAccepted, "bad input refused", "bad inputs", c.bad_inputs, 0.0);
  row(kReport, "report agrees with the motion", "cycles", c.cycles, 0.0);
}

}  // namespace

int main(int argc, char** argv) {
  const bool table = stress::takes_table(argc, argv);
  if (argc == 3 && std::strcmp(argv[1], "--episode") == 0) {
    const Counts counts = Episode(static_cast<std::uint32_t>(std::strtoul(argv[2], nullptr, 10)), true).run();
    print(counts);
    return counts.any() ? 1 : 0;
  }
  const long cycles = argc > 1 ? static_cast<long>(std::strtod(argv[1], nullptr)) : 1000000;
  const auto seed = static_cast<std::uint64_t>(argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1);
  const int threads = argc > 3 ? std::max(1, std::atoi(argv[3])) : 1;
  if (cycles < 1) {
    std::fprintf(stderr, "usage: sigmaik_stress [cycles] [seed] [threads], or sigmaik_stress --episode NUMBER\n");
    return 2;
  }
  shipped();
  const auto begin = std::chrono::steady_clock::now();
  std::mutex mutex;
  Counts total;
  long handed_out = 0;
  std::uint64_t index = 0;
  const auto work = [&] {
    Counts mine;
    for (;;) {
      std::uint32_t number;
      {
        const std::lock_guard lock(mutex);
        if (handed_out >= cycles) break;
        number = episode_number(seed, index++);
        handed_out += Episode::length(number);
      }
      mine.add(Episode(number, false).run());
    }
    const std::lock_guard lock(mutex);
    total.add(mine);
  };
  std::vector<std::thread> pool;
  for (int i = 1; i < threads; ++i) pool.emplace_back(work);
  work();
  for (std::thread& thread : pool) thread.join();

  std::sort(total.failed.begin(), total.failed.end());
  if (table) {
    print_table(total);
    return 0;  // what failed is in the table
  }
  print(total);
  std::printf("%.1f s\n", std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  if (!total.any()) return 0;
  std::printf("FAILED: %zu episodes; again with", total.failed.size());
  for (std::size_t i = 0; i < std::min<std::size_t>(10, total.failed.size()); ++i) {
    std::printf(" --episode %u", total.failed[i]);
  }
  std::printf("\n");
  return 1;
}
