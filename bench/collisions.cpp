// A cycle of a servo among obstacles: xArm7 with its 10 capsules, and 10 obstacles.
#include <optional>
#include <utility>
#include <vector>

#include <benchmark/benchmark.h>

#include "scene.hpp"

namespace {

using bench::kPath;
using bench::scene;
using sigmaik::Obstacle;

// Spheres, capsules, boxes and a floor around the path, which comes within 10 cm of some.
std::vector<Obstacle> obstacles(double nearer) {
  std::vector<Obstacle> out{Obstacle::half_space({0.0, 0.0, -0.1}, {0.0, 0.0, 1.0})};
  for (int i = 0; i < 3; ++i) {
    const double angle = 2.0 + 1.3 * i;
    const Eigen::Vector3d side((0.75 - nearer) * std::cos(angle), (0.75 - nearer) * std::sin(angle), 0.4);
    sigmaik::Pose pose = sigmaik::Pose::Identity();
    pose.translation() = side;
    out.push_back(Obstacle::sphere(side + Eigen::Vector3d(0.0, 0.0, 0.4), 0.1));
    out.push_back(Obstacle::capsule(side, side + Eigen::Vector3d(0.0, 0.1, 0.3), 0.05));
    pose.translation()[2] -= 0.3;
    out.push_back(Obstacle::box(pose, {0.2, 0.2, 0.2}));
  }
  return out;
}

void run(benchmark::State& state, std::optional<sigmaik::Collisions> collisions) {
  const auto& s = scene();
  sigmaik::ServoOptions options;
  options.collisions = std::move(collisions);
  sigmaik::Servo servo(s.arm, sigmaik::JParse{}, options);
  servo.reset(s.q[0]);
  int i = 0;
  double limited = 0.0, clearance = 1.0;
  for (auto _ : state) {
    const sigmaik::ServoStep step = servo.update(s.pose[static_cast<std::size_t>(i++ & (kPath - 1))]);
    limited += step.limited_by_collisions ? 1.0 : 0.0;
    clearance = std::min(clearance, step.clearance);
    benchmark::ClobberMemory();
  }
  state.counters["limited"] = benchmark::Counter(limited, benchmark::Counter::kAvgIterations);
  state.counters["clearance"] = clearance;
}

void cycle_without_collisions(benchmark::State& state) { run(state, std::nullopt); }
BENCHMARK(cycle_without_collisions);

void cycle_self_collisions(benchmark::State& state) { run(state, sigmaik::Collisions(scene().arm)); }
BENCHMARK(cycle_self_collisions);

void cycle_ten_obstacles(benchmark::State& state) { run(state, sigmaik::Collisions(scene().arm, obstacles(0.0))); }
BENCHMARK(cycle_ten_obstacles);

// The path is blocked: rows are active, and stops are verified near contact.
void cycle_ten_obstacles_blocked(benchmark::State& state) {
  run(state, sigmaik::Collisions(scene().arm, obstacles(0.2)));
}
BENCHMARK(cycle_ten_obstacles_blocked);

}  // namespace
