// Values and states as bytes: what was saved goes on bit by bit, and bytes that were changed are refused.

#include <doctest/doctest.h>

#include <functional>
#include <string>
#include <vector>

#include <sigmaik/values.hpp>

#include "arms.hpp"
#include "configurations.hpp"
#include "methods.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::arms;
using test::Random;

Chain with_jerk(const Chain& chain, double jerk) {
  JointLimits limits = chain.limits();
  limits.jerk.setConstant(jerk);
  return chain.with_limits(limits);
}

// Every option that changes what a servo remembers, at random.
ServoOptions random_options(Random& random, const Chain& chain) {
  ServoOptions options;
  options.dt = random.chance(0.5) ? 1e-3 : 4e-3;
  options.guided = random.chance(0.4);
  if (random.chance(0.5)) options.exact = {true, true, true, false, false, false};
  if (random.chance(0.3)) options.on_limit = OnLimit::Scale;
  if (random.chance(0.3)) options.avoid.what = Avoid::Manipulability;
  if (random.chance(0.3)) options.posture_gain = 2.0;
  if (random.chance(0.3)) options.posture = test::sample(random, chain);
  if (random.chance(0.2)) options.limits.position = false;
  return options;
}

// One call of a servo, the same for all the servos that are given.
using Call = std::function<ServoStep(Servo&)>;
Call random_call(Random& random, const Servo& servo, Pose& target) {
  const Chain& chain = servo.chain();
  if (random.chance(0.02)) target = pose(chain, test::sample(random, chain));
  if (random.chance(0.01)) {
    const JointVector measured = servo.q() + 0.01 * JointVector(random.vector(chain.dof()));
    return [measured](Servo& s) { return s.measure(measured) ? s.hold() : ServoStep{}; };
  }
  if (random.chance(0.01)) return [](Servo& s) { return s.hold(); };
  if (random.chance(0.005)) {
    const auto methods = test::library_methods();
    const Method method = methods[static_cast<std::size_t>(random.integer(0, static_cast<int>(methods.size()) - 1))];
    return [method](Servo& s) {
      s.set_method(method);
      return s.hold();
    };
  }
  if (random.chance(0.1)) {
    const Twist twist = 0.3 * Twist(random.vector(6));
    return [twist](Servo& s) { return s.update_twist(twist); };
  }
  const Pose now = target;
  return [now](Servo& s) { return s.update(now); };
}

// Another object that was made with the same arguments, and has the state.
Servo twin(const Servo& servo) {
  Servo out(load<Chain>(save(servo.chain())), servo.method(), servo.options());
  load_state(out, save_state(servo));
  return out;
}

ConstrainedIk twin(const ConstrainedIk& ik) {
  ConstrainedIk out(load<Chain>(save(ik.chain())), ik.options());
  load_state(out, save_state(ik));
  return out;
}

TargetStream twin(const TargetStream& stream) {
  TargetStream out(stream.options());
  load_state(out, save_state(stream));
  return out;
}

// The checksum of changed bytes, so that the bytes are read further: FNV-1a behind 24 bytes of header.
void mend_checksum(std::string& bytes) {
  std::uint64_t hash = 14695981039346656037u;
  for (std::size_t i = 24; i < bytes.size(); ++i) {
    hash = (hash ^ static_cast<std::uint8_t>(bytes[i])) * 1099511628211u;
  }
  for (std::size_t i = 0; i < 8; ++i) bytes[16 + i] = static_cast<char>(hash >> (8 * i));
}

// Whether load(bytes) throws Error; nothing else may come out of it.
template <typename Load>
bool refuses(const std::string& bytes, Load load) {
  try {
    load(bytes);
    return false;
  } catch (const Error&) {
    return true;
  }
}

}  // namespace

TEST_CASE("a servo that is saved at any time goes on bit by bit, with every rule and option") {
  Random random(1);
  const auto methods = test::all_methods();
  int guides = 0, searches = 0;
  for (int trial = 0; trial < 60; ++trial) {
    CAPTURE(trial);
    auto arm = arms().begin();
    std::advance(arm, random.integer(0, static_cast<int>(arms().size()) - 1));
    const Chain chain = random.chance(0.4) ? with_jerk(arm->second, random.decades(2.0, 4.0)) : arm->second;
    const Method& method = methods[static_cast<std::size_t>(trial) % methods.size()];
    ServoOptions options = random_options(random, chain);
    if (chain.dof() < 6) options.exact = {};
    Servo servo(chain, method, options);
    CHECK(same_state(twin(servo), servo));  // before it starts
    servo.reset(test::sample(random, chain));
    Pose target = pose(chain, test::sample(random, chain));
    for (int cycle = random.integer(0, 600); cycle > 0; --cycle) random_call(random, servo, target)(servo);
    for (int k = 0; k < 4; ++k) {
      Servo copy = servo, other = twin(servo);
      REQUIRE(same_state(other, servo));
      for (int cycle = 0; cycle < 60; ++cycle) {
        const Call call = random_call(random, servo, target);
        const ServoStep one = call(servo), two = call(other), three = call(copy);
        REQUIRE(save(one) == save(two));
        REQUIRE(save(one) == save(three));
        guides += one.guide != GuideState::Off;
        searches += one.guide == GuideState::Searching;
      }
      REQUIRE(same_state(other, servo));
      REQUIRE(save_state(other) == save_state(servo));
    }
    servo.hold();
    Servo later = servo;
    later.update_twist(Twist::Ones());
    CHECK(!same_state(later, servo));
  }
  CHECK(guides > 1000);
  CHECK(searches > 5);
}

TEST_CASE("a guided servo that is saved while it predicts, searches or leads goes on bit by bit") {
  int searching = 0, leading = 0;
  for (const char* arm : {"puma560", "franka_panda"}) {
    const Chain& chain = arms().at(arm);
    Random random(8);
    for (int trial = 0; trial < 6; ++trial) {
      Servo servo(chain, JParse{}, {.dt = 4e-3, .guided = true});
      servo.reset(test::sample(random, chain));
      const Pose target = pose(chain, test::sample(random, chain));
      GuideState last = GuideState::Off;
      for (int cycle = 0; cycle < 400; ++cycle) {
        const GuideState state = servo.update(target).guide;
        searching += state == GuideState::Searching ? 1 : 0;
        leading += state == GuideState::ChangingBranch || state == GuideState::Posture ? 1 : 0;
        // Each change of the state, each cycle of a search, and now and then.
        if (state == last && state != GuideState::Searching && cycle % 40 != 7) continue;
        last = state;
        Servo other = twin(servo), copy = servo;
        REQUIRE(same_state(other, servo));
        for (int k = 0; k < 12; ++k) REQUIRE(save(copy.update(target)) == save(other.update(target)));
        REQUIRE(same_state(other, copy));
      }
    }
  }
  CHECK(searching > 0);
  CHECK(leading > 0);
}

TEST_CASE("a ConstrainedIk that is saved at any time goes on bit by bit") {
  Random random(2);
  int optimised = 0;
  for (int trial = 0; trial < 40; ++trial) {
    CAPTURE(trial);
    const Chain& chain = arms().at(std::vector<const char*>{"ur10", "franka_panda", "ufactory_xarm7"}[trial % 3]);
    ConstrainedIkOptions options;
    if (random.chance(0.5)) options.gamma = 1.0;
    if (random.chance(0.3)) options.exact = {true, true, true, true, true, true};
    if (random.chance(0.3)) options.max_error.tail<3>().setConstant(0.1);
    options.analytic = random.chance(0.5);
    ConstrainedIk ik(chain, options);
    CHECK(same_state(twin(ik), ik));
    ik.reset(test::sample(random, chain));
    const Pose from = ik.tip();
    const Twist twist = 0.2 * Twist(random.vector(6));
    double time = 0.0;
    const auto target = [&] {
      time += options.dt;
      Pose out = from;
      const double way = std::min(time, 0.4);
      out.translation() += way * twist.head<3>();
      out.linear() = rotation_exp(way * twist.tail<3>()) * from.linear();
      return out;
    };
    for (int k = 0; k < 5; ++k) {
      for (int cycle = random.integer(0, 120); cycle > 0; --cycle) ik.update(target());
      ConstrainedIk copy = ik, other = twin(ik);
      REQUIRE(same_state(other, ik));
      for (int cycle = 0; cycle < 40; ++cycle) {
        const Pose goal = target();
        const ConstrainedIkStep one = ik.update(goal), two = other.update(goal), three = copy.update(goal);
        REQUIRE(save(one) == save(two));
        REQUIRE(save(one) == save(three));
        optimised += one.used == IkSource::Optimised;
      }
      REQUIRE(save_state(other) == save_state(ik));
    }
  }
  CHECK(optimised > 1000);
}

TEST_CASE("a target stream that is saved at any time goes on bit by bit, in each mode") {
  Random random(3);
  for (const StreamMode mode : {StreamMode::Hold, StreamMode::Interpolate, StreamMode::Predict}) {
    TargetStreamOptions options;
    options.mode = mode;
    TargetStream stream(options);
    Pose place = random.pose();
    double time = 0.0;
    for (int k = 0; k < 400; ++k) {
      TargetStream other = twin(stream);
      REQUIRE(same_state(other, stream));
      for (int cycle = 0; cycle < 5; ++cycle) {
        time += 4e-3;
        place.translation() += 2e-3 * Eigen::Vector3d(random.vector(3));
        if (random.chance(0.5)) REQUIRE(stream.push(time - 0.01, place) == other.push(time - 0.01, place));
        REQUIRE(save(stream.at(time)) == save(other.at(time)));
      }
      REQUIRE(save_state(other) == save_state(stream));
      if (random.chance(0.02)) stream.reset(place);
    }
  }
}

TEST_CASE("a solver that is saved goes on bit by bit") {
  Random random(4);
  for (const Method& method : test::all_methods()) {
    VelocitySolver solver(method, 0.5);
    for (int k = 0; k < 50; ++k) {
      VelocitySolver other(method, 0.5);
      load_state(other, save_state(solver));
      REQUIRE(same_state(other, solver));
      const TaskJacobian jacobian = random.matrix(6, 7);
      const TaskVector twist = random.vector(6);
      REQUIRE(save(solver.solve(jacobian, twist)) == save(other.solve(jacobian, twist)));
    }
  }
}

TEST_CASE("a chain is the same again: names, limits, inertias, kinematics to the last digit") {
  Random random(5);
  std::vector<Chain> chains;
  for (const auto& [name, chain] : arms()) chains.push_back(chain);
  for (int k = 0; k < 200; ++k) chains.push_back(random.chain(random.integer(1, 16), 0.2));
  for (std::size_t i = 0; i < chains.size(); ++i) {
    const Chain& chain = chains[i];
    const Chain again = load<Chain>(save(chain));
    CHECK(same(chain, again));
    CHECK(hash(chain) == hash(again));
    CHECK(save(chain) == save(again));
    CHECK(chain.warnings() == again.warnings());
    const JointVector q = test::sample(random, chain);
    CHECK(pose(chain, q).matrix() == pose(again, q).matrix());
    CHECK(!same(chain, chains[(i + 1) % chains.size()]));
    JointLimits limits = chain.limits();
    limits.velocity[0] = std::nextafter(std::min(limits.velocity[0], 1.0), 0.0);
    CHECK(!same(chain, chain.with_limits(limits)));
    CHECK(same(limits, load<JointLimits>(save(limits))));
  }
}

TEST_CASE("-0 is the same as 0 and NaN the same as NaN, and they have one hash") {
  Inertia one, other;
  other.mass = -0.0;
  CHECK(same(one, other));
  CHECK(hash(one) == hash(other));
  one.mass = std::nan("1");
  other.mass = -std::nan("2");
  CHECK(same(one, other));
  CHECK(hash(one) == hash(other));
  other.mass = 1.0;
  CHECK(!same(one, other));
}

TEST_CASE("bytes that were cut off, changed, or are of another type or version are refused, and nothing changes") {
  Random random(6);
  const Chain& chain = arms().at("franka_panda");
  Servo servo(chain);
  servo.reset(test::sample(random, chain));
  servo.update_twist(Twist::Ones());
  const std::string state = save_state(servo), model = save(chain);
  const Servo before = servo;
  const auto into_servo = [&](const std::string& bytes) { load_state(servo, bytes); };
  const auto into_chain = [](const std::string& bytes) { load<Chain>(bytes); };
  for (int k = 0; k < 2000; ++k) {
    std::string bytes = k % 2 == 0 ? state : model;
    if (random.chance(0.3)) {
      bytes.resize(static_cast<std::size_t>(random.integer(0, static_cast<int>(bytes.size()) - 1)));
    } else if (random.chance(0.2)) {
      bytes += "x";
    } else {
      char& byte = bytes[static_cast<std::size_t>(random.integer(0, static_cast<int>(bytes.size()) - 1))];
      byte = static_cast<char>(byte ^ (1 << random.integer(0, 7)));
    }
    CHECK((k % 2 == 0 ? refuses(bytes, into_servo) : refuses(bytes, into_chain)));
  }
  CHECK(same_state(servo, before));
  CHECK(refuses(model, into_servo));
  CHECK(refuses(state, into_chain));
  CHECK(refuses("", into_chain));
  std::string later = state;
  later[4] = 2;
  CHECK_THROWS_WITH_AS(load_state(servo, later),
                       "the bytes of a value are refused: version 2; this library reads version 1", Error);
  Servo six(arms().at("ur10")), guided(chain, JParse{}, {.guided = true});
  CHECK_THROWS_AS(load_state(six, state), Error);
  CHECK_THROWS_AS(load_state(guided, state), Error);
}

TEST_CASE("bytes that were made with malice are refused, or are a state with which the servo goes on") {
  Random random(7);
  const Chain& chain = arms().at("puma560");
  Servo servo(chain, JParse{}, {.guided = true, .strict = false});
  servo.reset(0.5 * test::sample(random, chain));
  Pose target = pose(chain, test::sample(random, chain));
  for (int cycle = 0; cycle < 300; ++cycle) servo.update(target);
  const std::string state = save_state(servo), model = save(chain);
  int taken = 0, refused = 0;
  for (int k = 0; k < 1500; ++k) {
    std::string bytes = k % 4 == 0 ? model : state;
    for (int changes = random.integer(1, 4); changes > 0; --changes) {
      bytes[static_cast<std::size_t>(random.integer(24, static_cast<int>(bytes.size()) - 1))] = static_cast<char>(
          random.integer(0, 255));
    }
    mend_checksum(bytes);
    try {
      if (k % 4 == 0) {
        static_cast<void>(load<Chain>(bytes));
      } else {
        Servo other(chain, JParse{}, {.guided = true});
        load_state(other, bytes);
        for (int cycle = 0; cycle < 20; ++cycle) other.update(target);
        other.reset(servo.q());
        other.update(target);
      }
      ++taken;
    } catch (const Error&) {
      ++refused;
    }
  }
  CHECK(taken > 100);
  CHECK(refused > 100);
}
