// Every kernel beside its peers, in one binary: ratios of one run mean something on a noisy machine.
#include <vector>

#include <benchmark/benchmark.h>
#include <Eigen/SVD>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainiksolvervel_pinv.hpp>
#include <kdl/chainiksolvervel_pinv_givens.hpp>
#include <kdl/chainiksolvervel_wdls.hpp>
#include <kdl/chainjnttojacsolver.hpp>

#include <sigmaik/constrained_ik.hpp>
#include <sigmaik/kdl.hpp>

#include "scene.hpp"

namespace {

using bench::JointVector;
using bench::kPath;
using bench::Scene;
using bench::scene;

// Kinematics ---------------------------------------------------------------------------------------------------------

void pose_and_jacobian_sigmaik(benchmark::State& state) {
  const Scene& s = scene();
  sigmaik::ChainState out;
  int i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(update(s.arm, s.q[i++ & (kPath - 1)], out));
    benchmark::ClobberMemory();
  }
}
BENCHMARK(pose_and_jacobian_sigmaik);

void pose_and_jacobian_kdl(benchmark::State& state) {
  const Scene& s = scene();
  const KDL::Chain chain = to_kdl(s.arm);
  KDL::ChainFkSolverPos_recursive position(chain);
  KDL::ChainJntToJacSolver velocity(chain);
  KDL::JntArray q(7);
  KDL::Frame pose;
  KDL::Jacobian jacobian(7);
  int i = 0;
  for (auto _ : state) {
    q.data = s.q[i++ & (kPath - 1)];
    position.JntToCart(q, pose);
    velocity.JntToJac(q, jacobian);
    benchmark::DoNotOptimize(jacobian.data.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(pose_and_jacobian_kdl);

void jacobian_gradient_sigmaik(benchmark::State& state) {
  const Scene& s = scene();
  static sigmaik::JacobianGradient out;
  int i = 0;
  for (auto _ : state) {
    sigmaik::jacobian_gradient(s.jacobian[i++ & (kPath - 1)], out);
    benchmark::ClobberMemory();
  }
}
BENCHMARK(jacobian_gradient_sigmaik);

// Decomposition ------------------------------------------------------------------------------------------------------

void svd_warm_sigmaik(benchmark::State& state) {
  const Scene& s = scene();
  sigmaik::Spectrum spectrum;
  int i = 0;
  double sweeps = 0.0;
  for (auto _ : state) {
    spectrum.decompose(s.jacobian[i++ & (kPath - 1)]);
    sweeps += spectrum.sweeps();
    benchmark::ClobberMemory();
  }
  state.counters["sweeps"] = benchmark::Counter(sweeps, benchmark::Counter::kAvgIterations);
}
BENCHMARK(svd_warm_sigmaik);

void svd_cold_sigmaik(benchmark::State& state) {
  const Scene& s = scene();
  sigmaik::Spectrum spectrum;
  int i = 0;
  for (auto _ : state) {
    spectrum = {};
    spectrum.decompose(s.jacobian[i++ & (kPath - 1)]);
    benchmark::ClobberMemory();
  }
}
BENCHMARK(svd_cold_sigmaik);

void svd_eigen_jacobi_fixed(benchmark::State& state) {
  const Scene& s = scene();
  Eigen::JacobiSVD<Eigen::Matrix<double, 6, 7>> svd(6, 7, Eigen::ComputeFullU | Eigen::ComputeFullV);
  std::vector<Eigen::Matrix<double, 6, 7>> fixed(s.jacobian.begin(), s.jacobian.end());
  int i = 0;
  for (auto _ : state) {
    svd.compute(fixed[i++ & (kPath - 1)]);
    benchmark::DoNotOptimize(svd.singularValues().data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(svd_eigen_jacobi_fixed);

// Velocity -----------------------------------------------------------------------------------------------------------

const sigmaik::Method kMethods[] = {sigmaik::PseudoInverse{},
                                    sigmaik::DampedLeastSquares{},
                                    sigmaik::AdaptiveDampedLeastSquares{},
                                    sigmaik::SelectivelyDampedLeastSquares{},
                                    sigmaik::JParse{},
                                    sigmaik::JacobianProjection{},
                                    sigmaik::JacobianSafety{},
                                    sigmaik::JacobianSafetyProjection{}};

void solve_sigmaik(benchmark::State& state) {
  const Scene& s = scene();
  const sigmaik::Method& method = kMethods[state.range(0)];
  sigmaik::VelocitySolver solver(method);
  const JointVector posture = JointVector::Constant(7, 0.1);
  int i = 0;
  for (auto _ : state) {
    const sigmaik::Solution solution = solver.solve(s.jacobian[i++ & (kPath - 1)], s.twist, posture);
    benchmark::DoNotOptimize(solution.qdot.data());
    benchmark::ClobberMemory();
  }
  state.SetLabel(name(method));
}
BENCHMARK(solve_sigmaik)->DenseRange(0, 7);

void servo_pose_sigmaik(benchmark::State& state) {
  const Scene& s = scene();
  sigmaik::Servo servo = s.servo();
  int i = 0;
  for (auto _ : state) {
    const sigmaik::ServoStep step = servo.update(s.pose[i++ & (kPath - 1)]);
    benchmark::DoNotOptimize(step.qdot.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(servo_pose_sigmaik);

template <typename Solver>
void kdl_velocity(benchmark::State& state, Solver& solver) {
  const Scene& s = scene();
  KDL::JntArray q(7), qdot(7);
  const KDL::Twist twist(KDL::Vector(s.twist[0], s.twist[1], s.twist[2]),
                         KDL::Vector(s.twist[3], s.twist[4], s.twist[5]));
  int i = 0;
  for (auto _ : state) {
    q.data = s.q[i++ & (kPath - 1)];
    benchmark::DoNotOptimize(solver.CartToJnt(q, twist, qdot));
    benchmark::ClobberMemory();
  }
}

void velocity_kdl_wdls(benchmark::State& state) {
  const KDL::Chain chain = to_kdl(scene().arm);
  KDL::ChainIkSolverVel_wdls solver(chain);
  solver.setLambda(0.1);
  kdl_velocity(state, solver);
}
BENCHMARK(velocity_kdl_wdls);

void velocity_kdl_pinv(benchmark::State& state) {
  const KDL::Chain chain = to_kdl(scene().arm);
  KDL::ChainIkSolverVel_pinv solver(chain);
  kdl_velocity(state, solver);
}
BENCHMARK(velocity_kdl_pinv);

void velocity_kdl_pinv_givens(benchmark::State& state) {
  const KDL::Chain chain = to_kdl(scene().arm);
  KDL::ChainIkSolverVel_pinv_givens solver(chain);
  kdl_velocity(state, solver);
}
BENCHMARK(velocity_kdl_pinv_givens);

// Position -----------------------------------------------------------------------------------------------------------

// The KUKA's poses all over its joints' ranges, and postures 0.1 rad about from those that led there.
struct Poses {
  sigmaik::AnalyticIk ik{sigmaik::Chain::from_urdf(std::string(SIGMAIK_ROBOTS_DIR) + "/kuka_kr6_r900.urdf")};
  std::vector<sigmaik::Pose> pose;
  std::vector<JointVector> near;

  Poses() {
    const sigmaik::JointLimits& limits = ik.chain().limits();
    std::mt19937_64 generator(1);
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    for (int i = 0; i < kPath; ++i) {
      JointVector q(6);
      for (int j = 0; j < 6; ++j) q[j] = limits.lower[j] + uniform(generator) * (limits.upper[j] - limits.lower[j]);
      pose.push_back(sigmaik::pose(ik.chain(), q));
      for (int j = 0; j < 6; ++j) q[j] += 0.1 * (uniform(generator) - 0.5);
      near.push_back(q);
    }
  }
};

const Poses& poses() {
  static const Poses instance;
  return instance;
}

void analytic_ik_solve(benchmark::State& state) {
  const Poses& p = poses();
  int i = 0;
  for (auto _ : state) {
    const sigmaik::AnalyticSolutions solutions = p.ik.solve(p.pose[i++ & (kPath - 1)]);
    benchmark::DoNotOptimize(&solutions);
    benchmark::ClobberMemory();
  }
}
BENCHMARK(analytic_ik_solve);

void analytic_ik_nearest(benchmark::State& state) {
  const Poses& p = poses();
  int i = 0;
  for (auto _ : state) {
    const int k = i++ & (kPath - 1);
    const sigmaik::AnalyticNearest nearest = p.ik.nearest(p.pose[k], p.near[k]);
    benchmark::DoNotOptimize(&nearest);
    benchmark::ClobberMemory();
  }
}
BENCHMARK(analytic_ik_nearest);

// Limits -------------------------------------------------------------------------------------------------------------

// A twist that changes faster and further than the arm can, so that limits are active in most cycles.
template <sigmaik::OnLimit kOnLimit>
void servo_limited(benchmark::State& state) {
  const Scene& s = scene();
  sigmaik::Servo servo(s.arm, sigmaik::JParse{}, {.on_limit = kOnLimit});
  servo.reset(s.q[0]);
  int i = 0, held = 0, limited = 0;
  for (auto _ : state) {
    sigmaik::Twist twist = 8.0 * s.twist;
    const double phase = 2.0 * M_PI * i++ / 500.0;
    twist.head<3>() *= std::sin(phase);
    twist.tail<3>() *= std::cos(1.3 * phase);
    const sigmaik::ServoStep step = servo.update_twist(twist);
    held += std::popcount(step.limiting_joints);
    limited += step.limiting_joints != 0;
    benchmark::DoNotOptimize(step.qdot.data());
  }
  state.counters["held"] = held / static_cast<double>(i);
  state.counters["limited"] = limited / static_cast<double>(i);
}
BENCHMARK(servo_limited<sigmaik::OnLimit::Redistribute>)->Name("servo_redistribute");
BENCHMARK(servo_limited<sigmaik::OnLimit::Scale>)->Name("servo_scale");

// The KUKA back and forth across its wrist's singularity, with two iterations and limits active much of the time.
template <bool kAnalytic>
void constrained_ik(benchmark::State& state) {
  const sigmaik::Chain arm = sigmaik::Chain::from_urdf(std::string(SIGMAIK_ROBOTS_DIR) + "/kuka_kr6_r900.urdf");
  sigmaik::ConstrainedIkOptions options;
  options.analytic = kAnalytic;
  sigmaik::ConstrainedIk ik(arm, options);
  JointVector home(6);
  home << 0.0, -1.3, 1.5, 0.0, 0.005, 0.0;
  ik.reset(home);
  const sigmaik::Pose start = ik.tip();
  std::vector<sigmaik::Pose> path(kPath, start);
  for (int k = 0; k < kPath; ++k)
    path[static_cast<std::size_t>(k)].translation()[1] += 0.1 * std::sin(2.0 * M_PI * k / kPath);
  int i = 0, held = 0, optimised = 0;
  for (auto _ : state) {
    const sigmaik::ConstrainedIkStep step = ik.step(path[static_cast<std::size_t>(i++ & (kPath - 1))]);
    held += step.active != 0;
    optimised += step.used == sigmaik::IkSource::Optimised;
    benchmark::DoNotOptimize(step.qdot.data());
  }
  state.counters["limited"] = held / static_cast<double>(i);
  state.counters["optimised"] = optimised / static_cast<double>(i);
}
BENCHMARK(constrained_ik<false>)->Name("constrained_ik_step");
BENCHMARK(constrained_ik<true>)->Name("constrained_ik_step_switching");

}  // namespace
