// A target stream and a servo behind it, under samples and clocks made of bytes: targets are poses, finite, and
// commands hold the limits.
#include <sigmaik/error.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/servo.hpp>
#include <sigmaik/target_stream.hpp>

#include "fuzz_arm.hpp"
#include "limit_watch.hpp"

using namespace sigmaik;
using fuzz::Bytes;
using fuzz::demand;

namespace {

TargetStreamOptions options(Bytes& bytes) {
  TargetStreamOptions o;
  o.mode = static_cast<StreamMode>(bytes.integer(0, 2));
  if (bytes.one_in(3)) o.max_speed = bytes.decades(-2.0, 2.0);
  if (bytes.one_in(3)) o.smoothing = bytes.uniform(0.0, 0.3);
  if (bytes.one_in(3)) o.latency = bytes.uniform(0.0, 0.3);
  if (bytes.one_in(3)) o.horizon = bytes.uniform(0.0, 0.3);
  return o;
}

void drive(Bytes& bytes) {
  const Chain chain = fuzz::arm(bytes);
  TargetStream stream(options(bytes));
  Servo servo(chain);
  servo.reset(fuzz::configuration(bytes, chain));
  test::LimitWatch watch(chain.limits(), 1e-3, JointVector::Zero(chain.dof()));
  double time = 0.0;
  for (int cycles = 0; cycles < 500 && !bytes.empty(); ++cycles) {
    const int kind = bytes.integer(0, 15);
    if (kind < 4) stream.push(time - bytes.uniform(0.0, 0.05), bytes.pose(1.0));
    if (kind == 4) stream.push(bytes.any(), bytes.pose(1.0));
    if (kind == 5) time += bytes.number(10.0);
    if (kind == 6) time = bytes.any();
    time += 1e-3;
    const Target target = stream.at(time);
    demand(is_pose(target.pose.matrix()), "the target is a pose");
    demand(target.twist.allFinite(), "the target's twist is finite");
    const ServoStep step = servo.update(target.pose, target.twist);
    demand(step.status != Status::BadInput || watch.broken == 0, "a servo takes the stream's targets");
    watch.step(step);
    demand(watch.broken == 0, "every command inside the limits (stream)");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes(data, size);
  try {
    drive(bytes);
  } catch (const Error&) {  // set-up refuses an option
  }
  return 0;
}
