// Eigen's own checks, over the library's sources: this executable compiles them itself, with assertions on and with
// EIGEN_RUNTIME_NO_MALLOC. An allocation, a size that does not fit a bounded type or an index out of range aborts.
// test_solver.cpp, test_servo.cpp and test_servo_limits.cpp count the heap calls of the library as it is shipped.
#include <doctest/doctest.h>

#include <limits>
#include <string>

#include <sigmaik/constrained_ik.hpp>
#include <sigmaik/planning/collision_costs.hpp>
#include <sigmaik/planning/costs.hpp>
#include <sigmaik/sigmaik.hpp>

#include "methods.hpp"
#include "random.hpp"

#if !defined(EIGEN_RUNTIME_NO_MALLOC) || defined(NDEBUG)
#error "this test needs Eigen's run-time checks"
#endif

namespace {

// Eigen must not allocate while this object lives.
class NoMalloc {
 public:
  NoMalloc() { Eigen::internal::set_is_malloc_allowed(false); }
  ~NoMalloc() { Eigen::internal::set_is_malloc_allowed(true); }
};

const std::vector<sigmaik::Method> kMethods = test::all_methods();

}  // namespace

TEST_CASE("Eigen's check is on") {
  CHECK(Eigen::internal::is_malloc_allowed());
  const NoMalloc none;
  CHECK_FALSE(Eigen::internal::is_malloc_allowed());
}

TEST_CASE("decompositions and rules of every size pass Eigen's checks") {
  test::Random random(1);
  for (int m = 1; m <= sigmaik::kMaxTask; ++m) {
    for (int n = 1; n <= sigmaik::kMaxJoints; ++n) {
      const Eigen::MatrixXd regular = random.matrix(m, n), zero = Eigen::MatrixXd::Zero(m, n);
      const Eigen::VectorXd twist = random.vector(m), posture = random.vector(n);
      for (const sigmaik::Method& method : kMethods) {
        sigmaik::VelocitySolver solver(method, 0.5);
        double sum = 0.0;
        {
          const NoMalloc none;
          for (const Eigen::MatrixXd* j : {&regular, &zero, &regular}) {
            sum += solver.solve(*j, twist).qdot.sum() + solver.solve(*j, twist, posture).qdot.sum();
          }
        }
        CHECK(std::isfinite(sum));
      }
    }
  }
}

TEST_CASE("servos of every size pass Eigen's checks") {
  test::Random random(2);
  for (int n = 1; n <= sigmaik::kMaxJoints; ++n) {
    const sigmaik::Chain chain = random.chain(n, 0.3);
    const sigmaik::JointVector q = random.configuration(n);
    for (const sigmaik::Method& method : kMethods) {
      for (const sigmaik::Task& task :
           {sigmaik::Task{}, sigmaik::Task{{true, true, true, true, true, false}, sigmaik::Frame::Tool}}) {
        sigmaik::Servo servo(chain, method, {.posture = q, .posture_gain = 1.0, .length_scale = 0.4, .task = task});
        servo.reset(random.configuration(n));
        const sigmaik::Pose target = random.pose();
        const sigmaik::Twist twist = random.vector(6);
        sigmaik::ChainState state;
        static sigmaik::JacobianGradient gradient;
        double sum = 0.0;
        {
          const NoMalloc none;
          for (int cycle = 0; cycle < 20; ++cycle) {
            sum += servo.update(target).qdot.sum() + servo.update_twist(twist).qdot.sum();
          }
          update(chain, q, state);
          sigmaik::jacobian_gradient(state.jacobian, gradient);
          sum += pose(chain, q).translation().sum() + gradient[0].sum();
        }
        CHECK(std::isfinite(sum));
      }
    }
  }
}

TEST_CASE("servos and constrained inverse kinematics with limits active pass Eigen's checks") {
  test::Random random(3);
  for (int n = 1; n <= sigmaik::kMaxJoints; ++n) {
    const sigmaik::Chain plain = random.chain(n, 0.3);
    sigmaik::JointLimits limits = plain.limits();
    for (int i = 0; i < n; ++i) {
      limits.velocity[i] = 0.1;
      if (random.chance(0.5)) limits.acceleration[i] = 1.0;
      if (random.chance(0.5)) limits.jerk[i] = 50.0;
      if (plain.joint_types()[static_cast<std::size_t>(i)] == sigmaik::JointType::Continuous) continue;
      limits.lower[i] = -0.02;
      limits.upper[i] = 0.02;
    }
    const sigmaik::Chain chain = plain.with_limits(limits);
    const sigmaik::JointVector zero = sigmaik::JointVector::Zero(n), moving = 0.05 * random.vector(n);
    const sigmaik::Pose target = random.pose(3.0);
    sigmaik::Pose wrong = target;
    wrong.matrix()(0, 0) = std::numeric_limits<double>::quiet_NaN();
    const sigmaik::Twist twist = random.vector(6);
    for (const sigmaik::OnLimit on_limit : {sigmaik::OnLimit::Redistribute, sigmaik::OnLimit::Scale}) {
      for (const sigmaik::Frame frame : {sigmaik::Frame::Base, sigmaik::Frame::Tool}) {
        sigmaik::ServoOptions options;
        options.on_limit = on_limit;
        options.task.frame = frame;
        if (frame == sigmaik::Frame::Tool) options.exact = {true, true, false, false, false, true};
        if (frame == sigmaik::Frame::Tool) options.max_tool_speed = 0.1;
        options.speed_points.setConstant(3, 2, 0.1);
        sigmaik::Servo servo(chain, sigmaik::JParse{}, options);
        servo.reset(zero, moving);
        double sum = 0.0;
        {
          const NoMalloc none;
          for (int cycle = 0; cycle < 100; ++cycle) {
            sum += servo.update(target).qdot.sum() + servo.update_twist(twist).qdot.sum();
            if (cycle > 50) sum += servo.measure(moving, zero) + servo.update(target, twist).qdot.sum();
            if (cycle % 30 == 29) sum += servo.update(wrong).qdot.sum();
            if (cycle > 70) sum += servo.update_twist(twist, cycle % 2 == 0 ? 3e-3 : 4e-4).qdot.sum();
          }
        }
        CHECK(std::isfinite(sum));
      }
    }
    for (const bool hard : {false, true}) {
      sigmaik::ConstrainedIkOptions options;
      if (hard) {
        options.gamma = 1.0;
        options.max_error.setConstant(0.01);
        options.task.frame = sigmaik::Frame::Tool;
      }
      sigmaik::ConstrainedIk ik(chain, options);
      ik.reset(zero, moving);
      double sum = 0.0;
      {
        const NoMalloc none;
        for (int cycle = 0; cycle < 50; ++cycle) sum += ik.step(cycle % 20 == 19 ? wrong : target).qdot.sum();
      }
      CHECK(std::isfinite(sum));
    }
  }
}

TEST_CASE("closed forms and torque limits in constrained inverse kinematics pass Eigen's checks") {
  const std::string robots = SIGMAIK_ROBOTS_DIR;
  for (const bool torque : {false, true}) {
    const sigmaik::Chain chain = sigmaik::Chain::from_urdf(robots + (torque ? "/franka_panda.urdf" : "/puma560.urdf"),
                                                           "", "flange");
    sigmaik::ConstrainedIkOptions options;
    options.torque_limits = torque;
    options.gamma = 1.0;
    sigmaik::ConstrainedIk ik(chain, options);
    CHECK(ik.has_analytic() == !torque);
    const sigmaik::JointVector start = 0.5 * (chain.limits().lower + chain.limits().upper);
    sigmaik::Pose near = pose(chain, sigmaik::JointVector(start.array() + 0.2)), far = near;
    far.translation() *= 5.0;
    ik.reset(start);
    double sum = 0.0;
    {
      const NoMalloc none;
      for (int cycle = 0; cycle < 400; ++cycle) sum += ik.step(cycle < 200 ? near : far).qdot.sum();
    }
    CHECK(std::isfinite(sum));
  }
}

TEST_CASE("streams of samples pass Eigen's checks") {
  test::Random random(12);
  for (const auto mode : {sigmaik::StreamMode::Hold, sigmaik::StreamMode::Interpolate, sigmaik::StreamMode::Predict}) {
    sigmaik::TargetStreamOptions options;
    options.mode = mode;
    sigmaik::TargetStream stream(options);
    sigmaik::Pose pose = random.pose(), wrong = random.pose(9.0);
    double sum = 0.0;
    {
      const NoMalloc none;
      for (int cycle = 0; cycle < 2000; ++cycle) {
        pose.translation()[0] += 1e-4;
        if (cycle % 25 == 0) stream.push(1e-3 * cycle, pose);
        if (cycle % 40 == 7) stream.push(1e-3 * cycle, wrong);
        sum += stream.at(1e-3 * cycle).twist.sum();
      }
    }
    CHECK(std::isfinite(sum));
  }
}

TEST_CASE("costs of collisions of every size pass Eigen's checks") {
  using namespace sigmaik::planning;
  test::Random random(11);
  std::vector<double> distances(4 * 5 * 6);
  for (double& d : distances) d = random.uniform(-0.5, 0.5);
  const DistanceField field(distances, {4, 5, 6}, Eigen::Vector3d(-1.0, -1.0, -1.0), 0.4);
  for (int n = 2; n <= sigmaik::kMaxJoints; ++n) {
    const sigmaik::Chain chain = random.chain(n, 0.3);
    const ArmSpheres spheres = ArmSpheres::along_links(chain, 0.1);
    const JointCostPtr cost = sum_of_costs(
        {collision_cost(spheres, field, 0.5), joint_limit_cost(chain),
         self_collision_cost(spheres, self_collision_pairs(spheres, 0.3, 1.0), 0.3)});
    const sigmaik::JointVector q = random.configuration(n);
    sigmaik::JointVector gradient(n);
    sigmaik::JointMatrix hessian(n, n);
    double sum = 0.0;
    {
      const NoMalloc none;
      sum += cost->value(q) + cost->gradient(q, gradient) + cost->model(q, gradient, hessian);
      sum += min_distance(spheres, field, q);
    }
    CHECK(std::isfinite(sum + gradient.sum() + hessian.sum()));
  }
}
