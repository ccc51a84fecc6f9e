// How cost grows with joints, task rows and batch size.
#include <string>
#include <thread>
#include <vector>

#include <benchmark/benchmark.h>

#include "scene.hpp"

namespace {

using bench::JointVector;

// n revolute joints with axes and offsets of no special kind.
sigmaik::Chain chain_of(int n) {
  std::vector<sigmaik::Segment> segments(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    sigmaik::Segment& s = segments[static_cast<std::size_t>(i)];
    s.joint_name = "joint" + std::to_string(i);
    s.link_name = "link" + std::to_string(i);
    s.type = sigmaik::JointType::Revolute;
    s.velocity = 3.0;
    s.axis = Eigen::Vector3d(std::sin(i + 1.0), std::cos(2.0 * i), std::sin(3.0 * i + 0.5));
    s.origin.translation() = Eigen::Vector3d(0.1, 0.05 * std::cos(i), 0.2);
  }
  return sigmaik::Chain("base", segments);
}

// One cycle of a servo on n joints.
void servo_joints(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const sigmaik::Chain arm = chain_of(n);
  const JointVector home = JointVector::Constant(n, 0.3);
  sigmaik::Servo servo(arm, sigmaik::JParse{}, {.posture = home, .posture_gain = 1.0});
  servo.reset(home);
  std::vector<sigmaik::Pose> target;
  for (int i = 0; i < bench::kPath; ++i) {
    JointVector q = home;
    for (int j = 0; j < n; ++j) q[j] += 0.16 * std::sin(2.0 * M_PI * i / bench::kPath + j);
    target.push_back(pose(arm, q));
  }
  int i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(servo.update(target[static_cast<std::size_t>(i++ & (bench::kPath - 1))]).qdot.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(servo_joints)->DenseRange(1, sigmaik::kMaxJoints);

// The first m rows of a 6×7 Jacobian.
void solve_rows(benchmark::State& state) {
  const auto& s = bench::scene();
  const auto m = state.range(0);
  sigmaik::VelocitySolver solver(sigmaik::JParse{});
  int i = 0;
  for (auto _ : state) {
    const auto& j = s.jacobian[static_cast<std::size_t>(i++ & (bench::kPath - 1))];
    benchmark::DoNotOptimize(solver.solve(j.topRows(m), s.twist.head(m)).qdot.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(solve_rows)->DenseRange(1, 6);

// B random 6×7 problems by one or two threads.
void batch(benchmark::State& state) {
  const auto& s = bench::scene();
  const auto count = static_cast<std::size_t>(state.range(0));
  std::vector<double> jacobian, twist(count * 6, 0.1), qdot(count * 7);
  for (std::size_t b = 0; b < count; ++b) {
    const auto& j = s.random[b & (bench::kPath - 1)];
    for (int row = 0; row < 6; ++row) {
      for (int column = 0; column < 7; ++column) jacobian.push_back(j(row, column));
    }
  }
  for (auto _ : state) {
    sigmaik::solve_batch(sigmaik::JParse{}, 1.0, {count, 6, 7}, jacobian.data(), twist.data(), qdot.data(), nullptr,
                         static_cast<int>(state.range(1)));
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * count));
}
BENCHMARK(batch)->ArgsProduct({{1, 16, 256, 4096, 65536}, {1, 2}})->UseRealTime();

}  // namespace
