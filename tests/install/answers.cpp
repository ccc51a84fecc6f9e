// A user's program that takes every kind of type across the library's boundary, both ways, and prints what comes back.
// tools/check_install.sh compiles it with different compilers and flags and compares the numbers. Eigen's own types
// work beside the library's here, because a linker keeps one of two equal inline functions: neither the program nor
// the library may get the other's.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <initializer_list>
#include <optional>
#include <vector>

#include <Eigen/Dense>
#include <sigmaik/analytic_ik.hpp>
#include <sigmaik/computed_torque.hpp>
#include <sigmaik/constrained_ik.hpp>
#include <sigmaik/dynamics.hpp>
#include <sigmaik/planning/costs.hpp>
#include <sigmaik/planning/time_optimal.hpp>
#include <sigmaik/sigmaik.hpp>

namespace {

using sigmaik::JointVector;

// NAME and its numbers, on one line.
void print(const char* name, const std::vector<double>& values) {
  std::printf("%s", name);
  for (const double x : values) {
    if (!std::isfinite(x)) std::exit(1);
    std::printf(" %.17g", x);
  }
  std::printf("\n");
}
template <typename Derived>
void print(const char* name, const Eigen::MatrixBase<Derived>& values) {
  const Eigen::MatrixXd all = values;
  print(name, std::vector<double>(all.data(), all.data() + all.size()));
}

JointVector joints(std::initializer_list<double> values) {
  JointVector out(static_cast<Eigen::Index>(values.size()));
  std::copy(values.begin(), values.end(), out.data());
  return out;
}

const JointVector kStart = joints({0.0, -0.4, 0.0, -2.0, 0.0, 1.6, 0.7});

void print(const sigmaik::ServoStep& step) {
  print("  q", step.q);
  print("  qdot", step.qdot);
  print("  achieved_twist", step.achieved_twist);
  print("  singular_values", step.singular_values);
  print("  status scale task_rows",
        {static_cast<double>(step.status), step.scale, static_cast<double>(step.task_rows)});
}

void servo(const sigmaik::Chain& arm) {
  sigmaik::Twist twist;
  twist << 0.05, 0.02, -0.03, 0.0, 0.1, 0.0;

  sigmaik::Servo plain(arm, sigmaik::JParse{}, {.dt = 1e-3});
  plain.reset(kStart);
  sigmaik::ServoStep step;
  for (int cycle = 0; cycle < 1000; ++cycle) step = plain.update_twist(twist);
  std::printf("servo, twist\n");
  print(step);

  sigmaik::ServoOptions options;
  options.dt = 2e-3;
  options.gain_linear = 3.0;
  options.max_linear_error = 0.2;
  options.soft_start = 0.05;
  options.posture = kStart;
  options.posture_gain = 0.5;
  options.on_limit = sigmaik::OnLimit::Scale;
  options.length_scale = 0.4;
  options.task.mask[5] = false;
  std::optional<sigmaik::Servo> other;  // a copy of a servo, in storage of the program's
  other.emplace(sigmaik::Servo(arm, sigmaik::DampedLeastSquares{}, options));
  other->reset(kStart);
  Eigen::Isometry3d target(other->tip());  // aligned as the program's flags say
  target.translate(Eigen::Vector3d(0.05, 0.1, -0.05));
  target.rotate(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()));
  const JointVector offset = JointVector::Constant(arm.dof(), 0.01);
  for (int cycle = 0; cycle < 300; ++cycle) {
    other->measure(other->q() + offset);
    step = other->update(target);
  }
  std::printf("servo, pose, other options\n");
  print(step);
  print("  posture", other->options().posture);
  print("  length_scale soft_start", {*other->options().length_scale, other->options().soft_start});
  print("  following_error", other->following_error());
  print("  slowness", other->pace().slowness);
  print("  lag length_scale max_linear_error settling_time",
        {plain.pace().lag, plain.length_scale(), plain.max_linear_error(), plain.settling_time()});
}

void solver(const sigmaik::Chain& arm) {
  sigmaik::ChainState state;
  sigmaik::update(arm, kStart, state);
  const Eigen::MatrixXd jacobian = state.jacobian;
  const Eigen::VectorXd twist = Eigen::VectorXd::LinSpaced(6, -0.1, 0.2);
  sigmaik::VelocitySolver solver(sigmaik::JParse{.gamma = 0.2}, 0.5);
  const sigmaik::Solution solution = solver.solve(jacobian, twist, JointVector::Constant(arm.dof(), 0.1));
  std::printf("velocity solver\n");
  print("  qdot", solution.qdot);
  print("  singular_values", solution.singular_values);
  print("  achieved_twist", solution.achieved_twist);
  print("  u_0", solver.spectrum().u(0));
  print("  v_0", solver.spectrum().v(0));
  // The program's own Eigen, on the same numbers.
  const Eigen::MatrixXd gram = jacobian * jacobian.transpose();
  print("  eigenvalues", Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(gram).eigenvalues());
  print("  pose⁻¹", Eigen::Matrix4d(state.tip.matrix()).inverse());
}

void constrained(const sigmaik::Chain& arm) {
  sigmaik::ConstrainedIkOptions options;
  options.exact = {true, true, false, false, false, false};
  options.gamma = 0.3;
  options.iterations = 3;
  sigmaik::ConstrainedIk ik(arm, options);
  ik.reset(kStart);
  Eigen::Isometry3d target(ik.tip());
  target.pretranslate(Eigen::Vector3d(0.0, 0.05, -0.05));
  sigmaik::ConstrainedIkStep step;
  for (int cycle = 0; cycle < 300; ++cycle) step = ik.step(target);
  std::printf("constrained ik\n");
  print("  q", step.q);
  print("  error", step.error);
  print("  path_error", step.path_error);
  print("  time_scale", {step.time_scale});
}

void dynamics(const sigmaik::Chain& arm) {
  sigmaik::Inertia payload;
  payload.mass = 0.5;
  payload.center_of_mass = Eigen::Vector3d(0.0, 0.0, 0.1);
  sigmaik::Dynamics dynamics(arm, {0.0, 0.0, -9.81}, payload);
  const Eigen::VectorXd q = kStart, qdot = Eigen::VectorXd::LinSpaced(arm.dof(), -0.5, 0.5);
  std::printf("dynamics\n");
  // Freed here: the storage of what comes back is the program's.
  const Eigen::MatrixXd mass = dynamics.mass_matrix(q);
  print("  mass", mass);
  print("  coriolis", dynamics.coriolis(q, qdot));
  print("  gravity", dynamics.gravity(q));
  sigmaik::DynamicsTerms terms;
  dynamics.evaluate(q, qdot, terms);
  print("  bias", terms.bias);
  JointVector torque, qddot;
  dynamics.inverse_dynamics(q, qdot, JointVector::Ones(arm.dof()), torque);
  dynamics.forward_dynamics(q, qdot, torque, qddot);
  print("  torque", torque);
  print("  qddot", qddot);

  sigmaik::ComputedTorque control(arm, {.frequency = 15.0, .payload = payload});
  const JointVector zero = JointVector::Zero(arm.dof());
  print("  computed torque", control.update(q, zero, q.array() + 0.01, zero, zero).torque);
}

void plan(const sigmaik::Chain& arm) {
  namespace planning = sigmaik::planning;
  sigmaik::JointLimits limits = arm.limits();
  limits.acceleration = JointVector::Constant(arm.dof(), 10.0);
  planning::TimeOptimal planner(arm.with_limits(limits), planning::manipulability_cost(arm, 10.0, 1e-6),
                                {.nodes = 20, .time_weight = 600.0});
  const planning::TimeOptimalResult result = planner.solve(
      {.start = kStart, .goal = joints({0.8, 0.3, 0.2, -1.4, 0.2, 1.9, 0.3})});
  std::printf("plan\n");
  print("  q", result.q);
  print("  duration cost", {result.duration, result.cost});
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return std::fprintf(stderr, "usage: %s ROBOT.urdf\n", argv[0]), 2;
  const sigmaik::Chain arm = sigmaik::Chain::from_urdf(argv[1]);
  servo(arm);
  solver(arm);
  constrained(arm);
  dynamics(arm);
  plan(arm);
  return 0;
}
