// Every function that a public header marks real time: no call to the heap, no lock, and no system call, from the first
// call on. A function that is marked and not called here fails the test. test_realtime.cpp checks sizes and indices.
#include <doctest/doctest.h>

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <sigmaik/constrained_ik.hpp>
#include <sigmaik/planning/collision_costs.hpp>
#include <sigmaik/planning/costs.hpp>
#include <sigmaik/servo_loop.hpp>
#include <sigmaik/sigmaik.hpp>

#include "arms.hpp"
#include "methods.hpp"
#include "quiet.hpp"
#include "random.hpp"
#include "realtime_marks.hpp"

#ifdef SIGMAIK_TEST_QUIET

namespace {

using namespace sigmaik;
using Work = std::function<void()>;

volatile double sink = 0.0;  // so that no call is left out

void use(double value) { sink = sink + value; }

// What the calls are about: a panda with jerk limits, in states with and without active limits.
struct Rig {
  Chain chain = [] {
    const Chain& arm = test::arms().at("franka_panda");
    JointLimits limits = arm.limits();
    limits.acceleration.setConstant(10.0);
    limits.jerk.setConstant(2000.0);
    return arm.with_limits(limits);
  }();
  JointVector q = [] {
    JointVector start(7);
    start << 0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785;
    return start;
  }();
  JointVector zero = JointVector::Zero(7), gradient = JointVector::Zero(7);
  JointMatrix hessian = JointMatrix::Zero(7, 7);
  Pose tip = pose(chain, q);
  Pose near = [this] {
    Pose target = tip;
    target.translation().x() += 0.05;
    return target;
  }();
  Pose far = [this] {
    Pose target = tip;
    target.translation() *= 4.0;
    return target;
  }();
  Twist twist{{0.1, -0.05, 0.1, 0.2, 0.0, -0.1}};
  ChainState state = [this] {
    ChainState at;
    update(chain, q, at);
    return at;
  }();
};

Rig& rig() {
  static Rig all;
  return all;
}

std::shared_ptr<Servo> servo(const Method& method = JParse{}, const ServoOptions& options = {}) {
  auto made = std::make_shared<Servo>(rig().chain, method, options);
  made->reset(rig().q);
  return made;
}

// A servo of each kind goes to a near and an unreachable pose, along twists, and stops.
Work servo_work(const std::function<void(Servo&, int)>& cycle) {
  std::vector<std::shared_ptr<Servo>> all;
  for (const Method& method : test::all_methods()) all.push_back(servo(method));
  ServoOptions exact, scale, guided, masked;
  exact.exact = {true, true, true, false, false, false};
  scale.on_limit = OnLimit::Scale;
  guided.guided = true;
  masked.task = Task{{true, true, true, true, true, false}, Frame::Tool};
  masked.posture_gain = 1.0;
  masked.avoid = AvoidanceOptions{Avoid::Manipulability, 1.0};
  for (const ServoOptions& options : {exact, scale, guided, masked}) all.push_back(servo(JParse{}, options));
  return [all, cycle] {
    for (const auto& one : all) {
      for (int k = 0; k < 600; ++k) cycle(*one, k);
    }
  };
}

using Calls = std::multimap<std::string, Work>;

void add_servo(Calls& calls) {
  Rig& r = rig();
  calls.emplace(
      "servo.hpp update", servo_work([&r](Servo& s, int k) {
        Pose wrong = r.near;
        wrong.matrix()(0, 0) = std::nan("");
        use(s.update(k % 97 == 96 ? wrong : k < 300 ? r.near : r.far, k < 100 ? r.twist : Twist::Zero()).qdot[0]);
      }));
  calls.emplace("servo.hpp update_twist", servo_work([&r](Servo& s, int k) {
                  use(s.update_twist(k < 300 ? r.twist : Twist(1e3 * r.twist)).qdot[0]);
                }));
  calls.emplace("servo.hpp update_twist", servo_work([&r](Servo& s, int) {
                  use(s.update_twist(r.twist, Frame::Tool, Eigen::Vector3d(0.0, 0.0, 0.1)).qdot[0]);
                }));
  calls.emplace("servo.hpp hold",
                servo_work([&r](Servo& s, int k) { use(k % 2 == 0 ? s.update(r.far).qdot[0] : s.hold().qdot[0]); }));
  calls.emplace("servo.hpp measure", servo_work([&r](Servo& s, int k) {
                  use(s.measure(r.q + r.zero, k % 2 == 0 ? r.zero : JointVector()) ? 1.0 : 0.0);
                  use(s.update(r.near).qdot[0]);
                }));
  auto old = servo();
  for (int k = 0; k < 50; ++k) old->update(r.near);
  calls.emplace("servo.hpp set_tool", servo_work([&r](Servo& s, int k) {
                  Pose tool = Pose::Identity();
                  tool.translation().z() = 0.05 * (k / 40 % 3);
                  use(s.set_tool(tool) ? s.update(r.near).qdot[0] : 0.0);
                }));
  calls.emplace("servo.hpp continue_from", servo_work([old](Servo& s, int) { s.continue_from(*old); }));
}

void add_limits(Calls& calls) {
  Rig& r = rig();
  auto tracker = std::make_shared<LimitTracker>(r.chain.limits());
  tracker->reset(r.q);
  auto other = std::make_shared<LimitTracker>(*tracker);
  const JointVector fast = JointVector::Constant(7, 1.0);
  calls.emplace("limits.hpp continue_from", [=] { other->continue_from(*tracker); });
  calls.emplace("limits.hpp heading", [=] { use(tracker->heading().upper[0]); });
  calls.emplace("limits.hpp heading_speed", [=] { use(tracker->heading_speed(0, 0.1)); });
  calls.emplace("limits.hpp arrival", [=] { use(tracker->arrival(fast, 10.0)); });
  calls.emplace("limits.hpp approach", [=] { use(tracker->approach(fast)[0]); });
  calls.emplace("limits.hpp set_cycle", [=] {
    auto uneven = *tracker;
    for (int k = 0; k < 3000; ++k) {
      JointVector qdot = k % 700 < 500 ? fast : JointVector(-2.0 * fast);
      use(uneven.set_cycle(k % 5 == 0 ? 2.5e-3 : 1e-3) && uneven.advance(qdot) ? 1.0 : 0.0);
    }
  });
  calls.emplace("limits.hpp advance", [=] {
    for (int k = 0; k < 3000; ++k) {
      JointVector qdot = k % 700 < 500 ? fast : JointVector(-2.0 * fast);
      use(tracker->advance(qdot) ? 1.0 : 0.0);
    }
  });
}

void add_kinematics(Calls& calls) {
  Rig& r = rig();
  calls.emplace("kinematics.hpp update", [&r] {
    ChainState state;
    use(update(r.chain, r.q, state) ? state.jacobian(0, 0) : 0.0);
  });
  calls.emplace("kinematics.hpp pose", [&r] { use(pose(r.chain, r.q)(0, 0)); });
  calls.emplace("kinematics.hpp jacobian_gradient", [&r] {
    static JacobianGradient gradient;
    jacobian_gradient(r.state.jacobian, gradient);
    use(gradient[0](0, 0));
  });
  calls.emplace("task.hpp select_rows", [&r] {
    const Task task{{true, true, true, true, true, false}, Frame::Tool};
    use(select_rows(task, r.tip.linear(), r.state.jacobian)(0, 0));
  });
  auto solver = std::make_shared<AnalyticIk>(test::arms().at("comau_racer_7_1_4"));
  const JointVector q = JointVector::Constant(6, 0.4);
  const Pose target = pose(test::arms().at("comau_racer_7_1_4"), q);
  calls.emplace("analytic_ik.hpp solve", [=] { use(solver->solve(target).count); });
  calls.emplace("analytic_ik.hpp nearest", [=] { use(static_cast<double>(solver->nearest(target, q).status)); });
  auto dynamics = std::make_shared<Dynamics>(r.chain);
  calls.emplace("dynamics.hpp evaluate", [=, &r] {
    DynamicsTerms terms;
    dynamics->evaluate(r.q, r.zero, terms);
    use(terms.bias[0]);
  });
  calls.emplace("dynamics.hpp inverse_dynamics",
                [=, &r] { dynamics->inverse_dynamics(r.q, r.zero, r.zero, r.gradient); });
  calls.emplace("dynamics.hpp forward_dynamics",
                [=, &r] { use(dynamics->forward_dynamics(r.q, r.zero, r.zero, r.gradient) ? 1.0 : 0.0); });
  auto torque = std::make_shared<ComputedTorque>(r.chain);
  calls.emplace("computed_torque.hpp update", [=, &r] {
    use(torque->update(r.q, r.zero, r.q, r.zero, r.zero).torque[0]);
    use(torque->update(r.q, r.zero, r.zero.head(3), r.zero, r.zero).torque[0]);
  });
}

void add_rules(Calls& calls) {
  Rig& r = rig();
  calls.emplace("spectrum.hpp decompose", [&r] {
    Spectrum spectrum;
    for (int k = 0; k < 20; ++k) spectrum.decompose(r.state.jacobian);
    spectrum.decompose(Jacobian::Zero(6, 7));
    use(spectrum.sigma(0));
  });
  auto spectrum = std::make_shared<Spectrum>();
  spectrum->decompose(r.state.jacobian);
  const TaskVector command = r.twist;
  auto methods = std::make_shared<std::vector<Method>>(test::all_methods());
  calls.emplace("rules.hpp resolve", [=] {
    for (const Method& method : *methods) use(resolve(method, *spectrum, command, 56).speed[0]);
  });
  calls.emplace("rule.hpp resolve_by", [=] { use(resolve_by(JParse{}, *spectrum, command, 56).speed[0]); });
  auto custom = std::make_shared<CustomRule>(JParse{});
  calls.emplace("custom.hpp resolve", [=] { use(custom->resolve(*spectrum, command, 56).speed[0]); });
  auto solver = std::make_shared<VelocitySolver>(JParse{});
  calls.emplace("velocity_solver.hpp solve",
                [=, &r] { use(solver->solve(r.state.jacobian, r.twist, r.zero).qdot[0]); });
  test::Random random(1);
  auto problem = std::make_shared<LeastSquaresProblem>();
  problem->A = random.matrix(6, 16);
  problem->b = 3.0 * random.vector(6);
  problem->G = random.matrix(6, 16);
  problem->h = random.vector(6);
  problem->lower = UnknownVector::Constant(16, -0.3);
  problem->upper = UnknownVector::Constant(16, 0.2);
  auto squares = std::make_shared<LeastSquares>();
  calls.emplace("least_squares.hpp solve", [=] { use(squares->solve(*problem).x[0]); });
}

void add_singularities(Calls& calls) {
  Rig& r = rig();
  auto sets = std::make_shared<SingularSets>(SingularSets::load("franka_panda"));
  calls.emplace("singularities.hpp set", [=] { use(static_cast<double>(sets->set(0).codimension)); });
  calls.emplace("singularities.hpp residuals", [=, &r] {
    std::array<double, kMaxResiduals> out;
    use(sets->residuals(r.q, out));
  });
  calls.emplace("singularities.hpp psi", [=, &r] {
    std::array<double, kMaxSets> out;
    use(sets->psi(r.q, out));
  });
  calls.emplace("singularities.hpp psi", [=, &r] { use(sets->psi(0, r.q, r.gradient, r.hessian)); });
  calls.emplace("singularities.hpp potential", [=, &r] { use(sets->potential(r.q)); });
  calls.emplace("singularities.hpp potential", [=, &r] { use(sets->potential(r.q, {}, r.gradient)); });
  calls.emplace("singularities.hpp potential", [=, &r] { use(sets->potential(r.q, {}, r.gradient, r.hessian)); });
  calls.emplace("singularities.hpp manipulability", [=, &r] { use(sets->manipulability(r.q)); });
  calls.emplace("singularities.hpp manipulability", [=, &r] { use(sets->manipulability(r.zero, r.gradient)); });
  calls.emplace("singularities.hpp manipulability", [=, &r] { use(sets->manipulability(r.q, r.gradient, r.hessian)); });
  auto avoidance = std::make_shared<Avoidance>(r.chain, AvoidanceOptions{Avoid::Manipulability, 1.0});
  calls.emplace("avoidance.hpp velocity", [=, &r] { use(avoidance->velocity(r.q)[0]); });
  auto index = std::make_shared<IndexFunction>(Index::ConditionNumber);
  calls.emplace("indices.hpp value", [=, &r] { use(index->value(r.state.jacobian)); });
  calls.emplace("indices.hpp value", [=, &r] { use(index->value(r.chain, r.q, r.gradient)); });
  calls.emplace("indices.hpp manipulability", [&r] { use(manipulability(r.state.jacobian)); });
  calls.emplace("indices.hpp condition_number", [&r] { use(condition_number(r.state.jacobian)); });
  calls.emplace("indices.hpp min_singular_value", [&r] { use(min_singular_value(r.state.jacobian)); });
  calls.emplace("indices.hpp geometry_aware", [&r] { use(geometry_aware(r.state.jacobian)); });
}

void add_costs(Calls& calls) {
  using namespace sigmaik::planning;
  Rig& r = rig();
  std::vector<double> distances(4 * 5 * 6);
  for (std::size_t i = 0; i < distances.size(); ++i) distances[i] = 0.01 * static_cast<double>(i % 40) - 0.1;
  auto field = std::make_shared<DistanceField>(distances, std::array<int, 3>{4, 5, 6},
                                               Eigen::Vector3d(-1.0, -1.0, -1.0), 0.4);
  auto spheres = std::make_shared<ArmSpheres>(ArmSpheres::along_links(r.chain, 0.1));
  const JointCostPtr cost = sum_of_costs(
      {collision_cost(*spheres, *field, 0.5), joint_limit_cost(r.chain),
       self_collision_cost(*spheres, self_collision_pairs(*spheres, 0.3, 1.0), 0.3)});
  calls.emplace("joint_cost.hpp value", [=, &r] { use(cost->value(r.q)); });
  calls.emplace("joint_cost.hpp gradient", [=, &r] { use(cost->gradient(r.q, r.gradient)); });
  calls.emplace("joint_cost.hpp model", [=, &r] { use(cost->model(r.q, r.gradient, r.hessian)); });
  calls.emplace("joint_cost.hpp evaluate", [=, &r] {
    double value = 0.0, gradient[7];
    cost->evaluate(1, r.q.data(), &value, gradient);
    use(value);
  });
  calls.emplace("distance_field.hpp distance", [=] { use(field->distance(Eigen::Vector3d(0.1, 0.0, 0.2))); });
  calls.emplace("distance_field.hpp distance", [=] {
    Eigen::Vector3d gradient;
    use(field->distance(Eigen::Vector3d(0.1, 0.0, 0.2), gradient));
  });
  calls.emplace("collision_costs.hpp min_distance", [=, &r] { use(min_distance(*spheres, *field, r.q)); });
  auto state = std::make_shared<SphereState>();
  spheres->update(r.q, *state);
  const int last = spheres->size() - 1;
  calls.emplace("arm_spheres.hpp update", [=, &r] { use(spheres->update(r.q, *state) ? 1.0 : 0.0); });
  calls.emplace("arm_spheres.hpp jacobian", [=] {
    PointJacobian jacobian(3, 7);
    spheres->jacobian(last, *state, jacobian);
    use(jacobian(0, 0));
  });
  calls.emplace("arm_spheres.hpp row", [=, &r] { spheres->row(last, *state, Eigen::Vector3d::UnitX(), r.gradient); });
}

void add_streams(Calls& calls) {
  Rig& r = rig();
  for (const char* name : {"target_stream.hpp push", "target_stream.hpp at"}) {
    std::vector<std::shared_ptr<TargetStream>> streams;
    for (const StreamMode mode : {StreamMode::Hold, StreamMode::Interpolate, StreamMode::Predict}) {
      TargetStreamOptions options;
      options.mode = mode;
      streams.push_back(std::make_shared<TargetStream>(options));
    }
    calls.emplace(name, [=, &r] {
      for (const auto& stream : streams) {
        for (int k = 0; k < 500; ++k) {
          Pose pose = k % 90 == 80 ? r.far : r.near;
          pose.translation().y() += 1e-4 * k;
          if (k % 25 == 0) use(static_cast<double>(stream->push(1e-3 * k, pose)));
          use(stream->at(k % 100 == 99 ? 0.0 : 1e-3 * k).twist[0]);
        }
      }
    });
  }
  const std::array<Pose, 8> actions{r.near, r.near, r.far, r.near, r.near, r.far, r.near, r.near};
  std::array<Twist, 8> twists;
  twists.fill(r.twist);
  for (const char* name : {"action_chunks.hpp push", "action_chunks.hpp push_twists", "action_chunks.hpp at"}) {
    auto chunks = std::make_shared<ActionChunks>();
    calls.emplace(name, [=] {
      for (int k = 0; k < 3000; ++k) {
        if (k % 300 == 0) use(static_cast<double>(chunks->push(1e-3 * k - 0.1, actions)));
        if (k % 700 == 699) use(static_cast<double>(chunks->push_twists(1e-3 * k - 0.1, twists)));
        use(chunks->at(1e-3 * k).twist[0]);
      }
    });
  }
  auto batch = std::make_shared<ServoBatch>(r.chain, JParse{}, ServoOptions{}, 3);
  std::vector<double> starts(r.q.data(), r.q.data() + r.q.size()), targets(3 * 16);
  batch->reset(starts);
  for (int k = 0; k < 3; ++k) {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> target = r.near.matrix();
    std::copy(target.data(), target.data() + 16, targets.begin() + 16 * k);
  }
  calls.emplace("servo_batch.hpp update", [=] {
    for (int k = 0; k < 200; ++k) use(batch->update(targets) ? 1.0 : 0.0);
  });
  auto collisions = std::make_shared<Collisions>(r.chain,
                                                 std::vector<Obstacle>{Obstacle::sphere({0.8, 0.0, 0.4}, 0.1)});
  calls.emplace("collisions.hpp nearest", [=, &r] { use(collisions->nearest(r.q).distance); });
  ConstrainedIkOptions options;
  options.gamma = 1.0;
  std::vector<std::shared_ptr<ConstrainedIk>> all{std::make_shared<ConstrainedIk>(r.chain),
                                                  std::make_shared<ConstrainedIk>(r.chain, options)};
  for (const auto& ik : all) ik->reset(r.q);
  calls.emplace("constrained_ik.hpp update", [=, &r] {
    for (const auto& ik : all) {
      for (int k = 0; k < 400; ++k) use(ik->update(k < 200 ? r.near : r.far).qdot[0]);
    }
  });
}

Calls all_calls() {
  Calls calls;
  add_servo(calls);
  add_limits(calls);
  add_kinematics(calls);
  add_rules(calls);
  add_singularities(calls);
  add_costs(calls);
  add_streams(calls);
  return calls;
}

}  // namespace

TEST_CASE("the watch sees a lock, an allocation, and a system call") {
  std::mutex mutex;
  const auto work_of_lock = [&mutex] { const std::lock_guard lock(mutex); };
  CHECK(test::quiet_of(work_of_lock).locks == 1);
  CHECK(test::quiet_of([] { use(std::vector<double>(100, 1.0)[7]); }).heap == 2);
  const test::Quiet call = test::quiet_of([] { use(static_cast<double>(::syscall(SYS_getppid))); });
  if (!call.filtered) {
    MESSAGE("this kernel lets no process filter its system calls: they are not checked");
  } else {
    CHECK(call.system_call == SYS_getppid);
    CHECK_FALSE(call.finished);
  }
  const test::Quiet nothing = test::quiet_of([] { use(std::sqrt(sink + 2.0)); });
  CHECK(nothing.finished);
  CHECK(nothing.heap + nothing.locks == 0);
  CHECK(nothing.system_call == -1);
}

TEST_CASE("every call that a header marks real time takes no heap, no lock and no system call") {
  for (const auto& call : all_calls()) {
    INFO("the call: ", call.first);
    const test::Quiet quiet = test::quiet_of(call.second);
    CHECK(quiet.finished);
    CHECK(quiet.heap == 0);
    CHECK(quiet.locks == 0);
    CHECK(quiet.system_call == -1);
  }
}

// The loop's thread is not in a child process, so this process counts; its system calls are not trapped.
TEST_CASE("ServoLoop::measure takes no heap and no lock") {
  Rig& r = rig();
  ServoLoop loop(*servo());
  loop.start();
  const test::Quiet quiet = test::count(
      [&] {
        for (int k = 0; k < 100; ++k) use(loop.measure(r.q, r.zero) ? 1.0 : 0.0);
      },
      false);
  CHECK(quiet.heap == 0);
  CHECK(quiet.locks == 0);
  loop.stop();
}

TEST_CASE("every function that a header marks real time is called above") {
  test::Marks marks = test::realtime_marks(std::filesystem::path(SIGMAIK_ROBOTS_DIR) / "../../../cpp/include");
  CHECK(marks.size() >= 49);
  CHECK(marks["servo.hpp update_twist"] == 2);
  CHECK(marks["dynamics.hpp forward_dynamics"] == 1);
  CHECK(marks["singularities.hpp potential"] == 3);
  test::Marks called{{"servo_loop.hpp measure", 1}};
  for (const auto& call : all_calls()) ++called[call.first];
  for (const auto& mark : marks) {
    INFO("the function: ", mark.first);
    CHECK(called[mark.first] == mark.second);
  }
  for (const auto& call : called) {
    INFO("the function: ", call.first);
    CHECK(marks[call.first] == call.second);
  }
}

#endif
