// Random arms towards targets that rest: each comes to rest in a stated time, inside all limits.
//
//     sigmaik_settling [cases] [seed] [threads]   exit code 1 if a Servo does not come to rest or breaks a limit
//     sigmaik_settling --case NUMBER              one case again, in words
//     sigmaik_settling --table [cases] [seed]     the counts as CSV, a line for each property, for `sigmaik stress`
//
// A case is all its number says: arm, limits, rule, options, start and target. docs/reliability.md defines the counts.

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <sigmaik/constrained_ik.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/servo.hpp>

#include "arms.hpp"
#include "limit_watch.hpp"
#include "methods.hpp"
#include "random.hpp"
#include "settling.hpp"
#include "table.hpp"

namespace {

using namespace sigmaik;
using test::Random;

constexpr double kFade = 12.0;  // [s] after the settling time: e⁻¹² of what other joints make up for is at rest

enum Target { kNear, kFar, kOutOfReach, kBeyondLimit, kZeroTwist, kTargets };
constexpr std::array<const char*, kTargets> kTargetNames{"near", "anywhere", "out of reach", "beyond a joint limit",
                                                         "zero twist"};

struct Count {
  long cases = 0, at_rest = 0, arrived = 0, faded = 0, broken = 0;
  double slowest = 0.0;  // [s]
  void add(const Count& other) {
    cases += other.cases;
    at_rest += other.at_rest;
    arrived += other.arrived;
    faded += other.faded;
    broken += other.broken;
    slowest = std::max(slowest, other.slowest);
  }
};

struct Counts {
  std::array<Count, kTargets> servo, constrained;
  std::vector<unsigned> failed;
  void add(const Counts& other) {
    for (std::size_t i = 0; i < kTargets; ++i) {
      servo[i].add(other.servo[i]);
      constrained[i].add(other.constrained[i]);
    }
    failed.insert(failed.end(), other.failed.begin(), other.failed.end());
  }
};

struct Case {
  Chain chain;
  JointVector start;
  Target kind;
  Pose target;
  double dt;
};

// Acceleration from 0.5 to 10³ rad/s² and jerk from 20 to 10⁵ rad/s³; a third of the arms has no jerk limit.
Chain with_dynamics(Random& random, const Chain& chain) {
  JointLimits limits = chain.limits();
  limits.acceleration.setConstant(random.decades(std::log10(0.5), 3.0));
  if (random.chance(0.67)) limits.jerk.setConstant(random.decades(std::log10(20.0), 5.0));
  return chain.with_limits(limits);
}

Case draw(Random& random) {
  const auto& arms = test::arms();
  const Chain& shipped = std::next(arms.begin(), random.integer(0, static_cast<int>(arms.size()) - 1))->second;
  Case c{with_dynamics(random, shipped), {}, static_cast<Target>(random.integer(0, kTargets - 1)), {}, 0.0};
  c.dt = random.chance(0.5) ? 0.001 : 0.004;
  c.start = test::start_of(random, c.chain, 0.98);
  JointVector goal = c.kind == kNear ? test::near(random, c.chain, c.start, 0.25)
                                     : test::start_of(random, c.chain, 0.98);
  if (c.kind == kBeyondLimit) {
    goal = c.start;
    const int i = random.integer(0, c.chain.dof() - 1);
    const double lower = c.chain.limits().lower[i], upper = c.chain.limits().upper[i];
    const bool up = random.chance(0.5);
    goal[i] = std::isfinite(upper) ? (up ? upper + 0.3 : lower - 0.3) : (up ? M_PI : -M_PI);
  }
  c.target = pose(c.chain, goal);
  if (c.kind == kOutOfReach) c.target.translation() *= random.uniform(1.5, 4.0);
  return c;
}

ServoOptions options_of(Random& random, const Case& c) {
  ServoOptions o;
  o.dt = c.dt;
  if (random.chance(0.3)) o.on_limit = OnLimit::Scale;
  if (random.chance(0.25)) o.exact = {true, true, true, false, false, false};
  if (random.chance(0.2)) o.task.mask = {true, true, true, true, true, false};
  if (c.kind != kZeroTwist && random.chance(0.2)) o.posture_gain = random.uniform(0.1, 2.0);
  return o;
}

// Runs `cycle` until the arm has rested for half a second. `cycle` gives q, q̇ and whether the target is met.
template <typename Cycle>
Count settle(const Case& c, double time, Cycle&& cycle) {
  Count count;
  count.cases = 1;
  test::LimitWatch watch(c.chain.limits(), c.dt, JointVector::Zero(c.chain.dof()));
  double still = 0.0, t = 0.0;
  bool there = false;
  JointVector q, qdot;
  for (; t < time && still < 0.5; t += c.dt) {
    there = cycle(t, q, qdot);
    watch.step(q, qdot);
    still = test::at_rest(c.chain, qdot) ? still + c.dt : 0.0;
  }
  count.at_rest = still > 0.0 ? 1 : 0;
  count.arrived = there ? 1 : 0;
  count.broken = watch.broken;
  count.slowest = t - still;
  return count;
}

bool met(const Twist& error) { return error.head<3>().norm() < 1e-3 && error.tail<3>().norm() < 0.5 * M_PI / 180.0; }

Count run_servo(Random& random, const Case& c, bool talk) {
  const std::vector<Method> methods = test::all_methods();
  const Method method =
      random.chance(0.5) ? Method{JParse{}}
                         : methods[static_cast<std::size_t>(random.integer(0, static_cast<int>(methods.size()) - 1))];
  const ServoOptions options = options_of(random, c);
  if (talk) {
    std::printf("servo, %s, %s, exact %d, dt %g\n", name(method),
                options.on_limit == OnLimit::Scale ? "scale" : "redistribute", options.exact[0], options.dt);
  }
  Servo servo(c.chain, method, options);
  servo.reset(c.start);
  const Twist twist = 0.3 * random.vector(6);
  bool faded = false;
  Count count = settle(c, servo.settling_time() + kFade, [&](double t, JointVector& q, JointVector& qdot) {
    const bool pushes = c.kind == kZeroTwist && t < 0.3;
    const ServoStep step = c.kind != kZeroTwist ? servo.update(c.target)
                                                : servo.update_twist(pushes ? twist : Twist(Twist::Zero()));
    if (talk && std::fmod(t, 1.0) < c.dt) {
      std::printf("%6.1f s  %-8s error %.4f m %.4f rad  fastest %.5f\n", t, to_string(step.status),
                  step.pose_error.head<3>().norm(), step.pose_error.tail<3>().norm(), step.qdot.cwiseAbs().maxCoeff());
    }
    q = step.q;
    qdot = step.qdot;
    faded = faded || step.not_settling;
    return c.kind == kZeroTwist || met(step.pose_error);
  });
  count.faded = faded ? 1 : 0;
  return count;
}

Count run_constrained(const Case& c) {
  ConstrainedIkOptions options;
  options.dt = c.dt;
  ConstrainedIk ik(c.chain, options);
  ik.reset(c.start);
  bool faded = false;
  Count count = settle(c, ik.settling_time() + kFade, [&](double, JointVector& q, JointVector& qdot) {
    const ConstrainedIkStep step = ik.update(c.target);
    q = step.q;
    qdot = step.qdot;
    faded = faded || step.not_settling;
    return met(step.error);
  });
  count.faded = faded ? 1 : 0;
  return count;
}

void run(unsigned number, bool talk, Counts& counts) {
  Random random(number);
  const Case c = draw(random);
  const auto at = static_cast<std::size_t>(c.kind);
  const bool servo = random.chance(0.85) || c.kind == kZeroTwist;
  if (talk) std::printf("%s\n", kTargetNames[at]);
  const Count count = servo ? run_servo(random, c, talk) : run_constrained(c);
  (servo ? counts.servo : counts.constrained)[at].add(count);
  if (count.at_rest == 0 || count.broken != 0) counts.failed.push_back(number);
}

void print(const char* name, const std::array<Count, kTargets>& counts) {
  for (std::size_t i = 0; i < kTargets; ++i) {
    const Count& c = counts[i];
    if (c.cases == 0) continue;
    std::printf(
        "%-12s %-21s cases %7ld  at rest %7ld  arrived %7ld  faded out %5ld  limits broken %ld  slowest %.1f s\n", name,
        kTargetNames[i], c.cases, c.at_rest, c.arrived, c.faded, c.broken, c.slowest);
  }
}

void print_table(const Counts& counts) {
  stress::print_head();
  for (const auto* part : {&counts.servo, &counts.constrained}) {
    Count sum;
    for (const Count& c : *part) sum.add(c);
    const std::string name = part == &counts.servo ? "" : " (constrained)";
    stress::print_row("rest" + name, "targets that rest", sum.cases, sum.cases - sum.at_rest, sum.slowest,
                      counts.failed);
    stress::print_row("limits on the way to rest" + name, "targets that rest", sum.cases, sum.broken, 0.0,
                      counts.failed);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const bool table = stress::takes_table(argc, argv);
  Counts total;
  if (argc == 3 && std::strcmp(argv[1], "--case") == 0) {
    run(static_cast<unsigned>(std::strtoul(argv[2], nullptr, 10)), true, total);
    print("servo", total.servo);
    print("constrained", total.constrained);
    return total.failed.empty() ? 0 : 1;
  }
  const long cases = argc > 1 ? static_cast<long>(std::strtod(argv[1], nullptr)) : 1000;
  const auto seed = static_cast<unsigned>(argc > 2 ? std::strtoul(argv[2], nullptr, 10) : 1);
  const int threads = argc > 3 ? std::max(1, std::atoi(argv[3])) : 1;
  if (cases < 1) {
    std::fprintf(stderr, "usage: sigmaik_settling [cases] [seed] [threads], or sigmaik_settling --case NUMBER\n");
    return 2;
  }
  test::arms();
  const auto begin = std::chrono::steady_clock::now();
  std::atomic<long> next{0};
  std::mutex mutex;
  const auto work = [&] {
    Counts mine;
    for (long i = next++; i < cases; i = next++) run(seed * 1000003u + static_cast<unsigned>(i), false, mine);
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
  print("servo", total.servo);
  print("constrained", total.constrained);
  std::printf("%.1f s\n", std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  if (total.failed.empty()) return 0;
  std::printf("FAILED: %zu cases; again with", total.failed.size());
  for (std::size_t i = 0; i < std::min<std::size_t>(10, total.failed.size()); ++i) {
    std::printf(" --case %u", total.failed[i]);
  }
  std::printf("\n");
  return 1;
}
