// An arm, options and commands made of bytes. Every command of a Servo and of a ConstrainedIk is finite and inside the
// limits of position, velocity, acceleration and jerk, by differences of the commands.
#include <vector>

#include <sigmaik/constrained_ik.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/servo.hpp>

#include "fuzz_arm.hpp"
#include "limit_watch.hpp"
#include "methods.hpp"

using namespace sigmaik;
using fuzz::Bytes;
using fuzz::demand;

namespace {

constexpr int kMostCycles = 400;

Task task(Bytes& bytes) {
  Task task;
  if (bytes.one_in(3)) {
    for (bool& row : task.mask) row = !bytes.one_in(3);
    if (task.rows() == 0) task.mask[2] = true;
  }
  if (bytes.one_in(3)) task.frame = Frame::Tool;
  return task;
}

ServoOptions options(Bytes& bytes) {
  ServoOptions o;
  o.dt = bytes.one_in(2) ? 1e-3 : bytes.decades(-4.0, -1.5);
  o.task = task(bytes);
  o.on_limit = bytes.one_in(2) ? OnLimit::Scale : OnLimit::Redistribute;
  if (bytes.one_in(3)) {
    for (std::size_t i = 0; i < 6; ++i) o.exact[i] = o.task.mask[i] && bytes.one_in(2);
  }
  if (bytes.one_in(4)) o.gain_linear = bytes.decades(-1.0, 3.0);
  if (bytes.one_in(4)) o.gain_angular = bytes.decades(-1.0, 3.0);
  if (bytes.one_in(4)) o.posture_gain = bytes.decades(-1.0, 2.0);
  if (bytes.one_in(4)) o.length_scale = bytes.decades(-2.0, 1.0);
  if (bytes.one_in(4)) o.soft_start = bytes.uniform(0.0, 0.2);
  o.guided = bytes.one_in(16);
  return o;
}

// Finite, and the same in the step and in the servo.
void check(const Servo& servo, const ServoStep& step, const test::LimitWatch& watch) {
  demand(watch.broken == 0, "every command inside the limits (servo)");
  demand(step.q.allFinite() && step.qdot.allFinite(), "finite commands (servo)");
  demand(step.q == servo.q() && step.qdot == servo.qdot(), "the step is the servo's state");
  demand(step.achieved_twist.allFinite() && step.pose_error.allFinite(), "finite report (servo)");
  demand(step.scale >= 0.0 && step.scale <= 1.0, "scale in [0, 1]");
}

struct Command {
  explicit Command(Bytes& bytes, const Pose& tip)
      : kind(bytes.integer(0, 9)), cycles(1 + static_cast<int>(bytes.byte() / 4)) {
    pose = kind < 3 ? bytes.pose(1.5) : tip;
    if (kind == 3) {
      pose.linear() = (tip.linear() * bytes.rotation(0.3)).eval();
      for (int i = 0; i < 3; ++i) pose.translation()[i] += bytes.uniform(-0.1, 0.1);
    }
    twist = bytes.twist(kind == 5 ? 1e3 : 0.5);
    if (kind == 9) twist.setZero();
  }
  int kind, cycles;
  Pose pose;
  Twist twist;
};

ServoStep cycle(Servo& servo, const Command& command) {
  switch (command.kind) {
    case 4:
    case 5:
    case 9: return servo.update_twist(command.twist);
    case 6: return servo.update_twist(command.twist, Frame::Tool, Eigen::Vector3d(0.0, 0.0, 0.1));
    case 7: return servo.hold();
    case 8: return servo.update(command.pose, command.twist);
    default: return servo.update(command.pose);
  }
}

void drive_servo(Bytes& bytes, const Chain& chain) {
  static const std::vector<Method> methods = test::all_methods();
  const auto method = [&]() -> const Method& {
    return methods[static_cast<std::size_t>(bytes.integer(0, static_cast<int>(methods.size()) - 1))];
  };
  const ServoOptions chosen = options(bytes);
  Servo servo(chain, method(), chosen);
  servo.reset(fuzz::configuration(bytes, chain));
  test::LimitWatch watch(chain.limits(), chosen.dt, JointVector::Zero(chain.dof()));
  for (int cycles = 0; cycles < kMostCycles && !bytes.empty();) {
    const Command command(bytes, servo.tip());
    if (bytes.one_in(16)) servo.set_method(method());
    if (bytes.one_in(16)) {
      Servo next(chain, method(), chosen);
      next.continue_from(servo);
      servo = std::move(next);
    }
    const bool measured = bytes.one_in(16);
    for (int k = 0; k < command.cycles && cycles < kMostCycles; ++k, ++cycles) {
      if (measured) servo.measure(servo.q() + JointVector::Constant(chain.dof(), bytes.number(0.05)));
      const ServoStep step = cycle(servo, command);
      watch.step(step);
      check(servo, step, watch);
    }
  }
}

void drive_constrained(Bytes& bytes, const Chain& chain) {
  ConstrainedIkOptions o;
  o.dt = bytes.one_in(2) ? 1e-3 : bytes.decades(-4.0, -1.5);
  o.task = task(bytes);
  for (std::size_t i = 0; i < 6; ++i) o.exact[i] = o.task.mask[i] && bytes.one_in(2);
  if (bytes.one_in(2)) o.gamma = bytes.decades(-2.0, 2.0);
  if (bytes.one_in(3)) o.max_error.setConstant(bytes.decades(-3.0, 0.0));
  ConstrainedIk ik(chain, o);
  ik.reset(fuzz::configuration(bytes, chain));
  test::LimitWatch watch(chain.limits(), o.dt, JointVector::Zero(chain.dof()));
  for (int cycles = 0; cycles < kMostCycles && !bytes.empty();) {
    const Command command(bytes, pose(chain, ik.q()));
    for (int k = 0; k < command.cycles && cycles < kMostCycles; ++k, ++cycles) {
      const ConstrainedIkStep step = ik.update(command.pose);
      watch.step(step.q, step.qdot);
      demand(watch.broken == 0, "every command inside the limits (constrained)");
      demand(step.q == ik.q() && step.error.allFinite(), "finite report (constrained)");
      demand(step.time_scale >= 0.0 && step.time_scale <= 1.0, "time scale in [0, 1]");
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes(data, size);
  const bool constrained = bytes.one_in(4);
  try {
    const Chain chain = fuzz::arm(bytes);
    constrained ? drive_constrained(bytes, chain) : drive_servo(bytes, chain);
  } catch (const Error&) {  // set-up refuses an option
  }
  return 0;
}
