// Every kernel beside its peers, in one binary: ratios of one run mean something on a noisy machine.
#include <array>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include <Eigen/SVD>
#include <benchmark/benchmark.h>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainiksolvervel_pinv.hpp>
#include <kdl/chainiksolvervel_pinv_givens.hpp>
#include <kdl/chainiksolvervel_wdls.hpp>
#include <kdl/chainjnttojacsolver.hpp>

#include <sigmaik/kdl.hpp>
#include <sigmaik/sigmaik.hpp>

namespace {

using sigmaik::Chain;
using sigmaik::JointVector;

constexpr int kPath = 1024;  // a power of two, so that going round costs nothing

// Seven joints at 1 kHz: a smooth motion at speeds of about 1 rad/s, there and back.
struct Scene {
  Chain arm = Chain::from_urdf(std::string(SIGMAIK_ROBOTS_DIR) + "/ufactory_xarm7.urdf");
  std::vector<JointVector> q;
  std::vector<sigmaik::Jacobian> jacobian;
  std::vector<Eigen::Matrix<double, 6, 7>> random;
  sigmaik::Twist twist;

  Scene() {
    sigmaik::ChainState state;
    JointVector home(7);
    home << 0.0, -0.35, 0.2, 1.05, 0.1, 1.4, 0.0;
    for (int i = 0; i < kPath; ++i) {
      const double phase = 2.0 * M_PI * i / kPath;
      JointVector now = home;
      for (int j = 0; j < 7; ++j) now[j] += 0.16 * std::sin(phase + j);
      update(arm, now, state);
      q.push_back(now);
      jacobian.push_back(state.jacobian);
    }
    std::mt19937_64 generator(1);
    std::normal_distribution<double> normal;
    for (int i = 0; i < kPath; ++i) random.push_back(Eigen::Matrix<double, 6, 7>::NullaryExpr([&] { return normal(generator); }));
    twist << 0.1, -0.05, 0.2, 0.1, 0.3, -0.2;
  }
};

const Scene& scene() {
  static const Scene instance;
  return instance;
}

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
  sigmaik::Servo servo(s.arm, sigmaik::JParse{}, {.posture = s.q[0], .posture_gain = 1.0});
  servo.reset(s.q[0]);
  std::vector<sigmaik::Pose> target;
  for (const JointVector& q : s.q) target.push_back(pose(s.arm, q));
  int i = 0;
  for (auto _ : state) {
    const sigmaik::ServoStep step = servo.update(target[i++ & (kPath - 1)]);
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

// Batch --------------------------------------------------------------------------------------------------------------

void solve_batch_sigmaik(benchmark::State& state) {
  const Scene& s = scene();
  constexpr std::size_t kCount = 16 * kPath;
  std::vector<double> jacobian, twist(kCount * 6, 0.1), qdot(kCount * 7);
  for (std::size_t b = 0; b < kCount; ++b) {
    const auto& j = s.random[b & (kPath - 1)];
    for (int row = 0; row < 6; ++row) {
      for (int column = 0; column < 7; ++column) jacobian.push_back(j(row, column));
    }
  }
  for (auto _ : state) {
    sigmaik::solve_batch(sigmaik::JParse{}, 1.0, {kCount, 6, 7}, jacobian.data(), twist.data(), qdot.data(), nullptr,
                         static_cast<int>(state.range(0)));
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * kCount));
}
BENCHMARK(solve_batch_sigmaik)->Arg(1)->Arg(2)->UseRealTime();

}  // namespace

