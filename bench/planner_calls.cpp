// A call of each planner as bench/planner_calls.py makes it from Python: the same arm, ends and paths.
#include <cmath>
#include <string>

#include <benchmark/benchmark.h>

#include <sigmaik/planning/cart_motion.hpp>
#include <sigmaik/planning/costs/geometry_aware.hpp>
#include <sigmaik/planning/costs/potential.hpp>
#include <sigmaik/planning/plan.hpp>

namespace {

using namespace sigmaik::planning;
using sigmaik::JointVector;

struct Task {
  sigmaik::Chain chain = sigmaik::Chain::from_urdf(std::string(SIGMAIK_ROBOTS_DIR) + "/kuka_lbr_iiwa_14_r820.urdf", "",
                                                   "flange");
  JointVector start = JointVector::Zero(7), goal = JointVector::Zero(7);

  Task() {
    start << -0.8, 0.6, 0.4, -1.2, 0.3, 0.9, 0.0;
    goal << 0.7, 0.9, -0.3, 1.1, -0.5, 1.2, 0.4;
  }
};

PlanarPath path(int samples) {
  PlanarPath out(samples, 2);
  for (int i = 0; i < samples; ++i) {
    const double s = static_cast<double>(i) / (samples - 1);
    out.row(i) << 0.3 + 0.5 * s, 0.2 - 0.5 * s + 0.05 * std::sin(6.0 * s);
  }
  return out;
}

void planner_call_time_optimal(benchmark::State& state) {
  const Task task;
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        time_optimal(task.chain, {task.start, task.goal, {}, {}, {}}, costs::Potential{}, {.time_weight = 600.0}).cost);
  }
}
void planner_call_gradient(benchmark::State& state) {
  const Task task;
  for (auto _ : state)
    benchmark::DoNotOptimize(gradient(task.chain, task.start, task.goal, costs::GeometryAware{}).cost);
}
void planner_call_stochastic(benchmark::State& state) {
  const Task task;
  for (auto _ : state) {
    benchmark::DoNotOptimize(stochastic(task.chain, task.start, task.goal, costs::GeometryAware{}).cost);
  }
}
void planner_call_cart_motion(benchmark::State& state) {
  const PlanarPath flange = path(5068);
  for (auto _ : state) benchmark::DoNotOptimize(cart_motion(flange, 0.5, 0.75, 0.2).energy);
}
void planner_call_cart_motion_plane(benchmark::State& state) {
  const PlanarPath flange = path(200);
  for (auto _ : state) benchmark::DoNotOptimize(plane_cart_motion(flange, {0.0, -0.2}, {0.5, 0.1}, 0.2).energy);
}
BENCHMARK(planner_call_time_optimal)->Unit(benchmark::kMillisecond);
BENCHMARK(planner_call_gradient)->Unit(benchmark::kMillisecond);
BENCHMARK(planner_call_stochastic)->Unit(benchmark::kMillisecond);
BENCHMARK(planner_call_cart_motion)->Unit(benchmark::kMillisecond);
BENCHMARK(planner_call_cart_motion_plane)->Unit(benchmark::kMillisecond);

}  // namespace
