// Batches beside loops over single problems, in one binary: the ratios of one run mean something on a noisy machine.
#include <cstdint>
#include <vector>

#include <benchmark/benchmark.h>

#include "scene.hpp"

namespace {

// B random 6×7 problems as fresh solvers solve them, one after the other; `batch` of growth.cpp is the same in lanes.
void batch_by_solvers(benchmark::State& state) {
  const auto& s = bench::scene();
  const auto count = static_cast<std::size_t>(state.range(0));
  sigmaik::VelocitySolver solver(sigmaik::JParse{});
  for (auto _ : state) {
    for (std::size_t b = 0; b < count; ++b) {
      solver.reset();
      benchmark::DoNotOptimize(solver.solve(s.random[b & (bench::kPath - 1)], s.twist));
    }
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * count));
}
BENCHMARK(batch_by_solvers)->Arg(4096);

// B servos along the path of the scene, each a little behind the other. Arguments: B, threads, poses or twists.
void servo_batch(benchmark::State& state) {
  const auto& s = bench::scene();
  const auto count = static_cast<std::size_t>(state.range(0));
  sigmaik::ServoBatch batch(s.arm, sigmaik::JParse{}, {}, count, static_cast<int>(state.range(1)));
  batch.reset({s.q[0].data(), 7});
  std::vector<double> rows(count * (state.range(2) != 0 ? 16 : 6), 0.0);
  int cycle = 0;
  for (auto _ : state) {
    state.PauseTiming();
    ++cycle;
    for (std::size_t b = 0; b < count; ++b) {
      const auto at = static_cast<std::size_t>(cycle + static_cast<int>(b)) & (bench::kPath - 1);
      if (state.range(2) != 0) {
        Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(rows.data() + 16 * b) = s.pose[at].matrix();
      } else {
        for (std::size_t i = 0; i < 6; ++i)
          rows[6 * b + i] = 0.3 * s.twist[static_cast<Eigen::Index>(i)] * ((cycle & 512) != 0 ? -1.0 : 1.0);
      }
    }
    state.ResumeTiming();
    benchmark::DoNotOptimize(state.range(2) != 0 ? batch.update(rows) : batch.update_twist(rows));
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * count));
}
BENCHMARK(servo_batch)->ArgsProduct({{64, 256, 1024, 4096}, {1, 2}, {0, 1}})->UseRealTime();

// The same servos one by one, as a loop over Servo.
void servo_loop_of_singles(benchmark::State& state) {
  const auto& s = bench::scene();
  const auto count = static_cast<std::size_t>(state.range(0));
  sigmaik::Servo one(s.arm, sigmaik::JParse{});
  one.reset(s.q[0]);
  std::vector<sigmaik::Servo> servos(count, one);
  int cycle = 0;
  for (auto _ : state) {
    ++cycle;
    for (std::size_t b = 0; b < count; ++b) {
      benchmark::DoNotOptimize(
          servos[b].update(s.pose[static_cast<std::size_t>(cycle + static_cast<int>(b)) & (bench::kPath - 1)]));
    }
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * count));
}
BENCHMARK(servo_loop_of_singles)->Arg(64)->Arg(1024);

// A cycle of ActionChunks.
void action_chunks_at(benchmark::State& state) {
  const auto& s = bench::scene();
  sigmaik::ActionChunks chunks;
  std::vector<sigmaik::Pose> poses(s.pose.begin(), s.pose.begin() + 100);
  chunks.push(0.0, poses);
  double time = 0.0;
  int cycle = 0;
  for (auto _ : state) {
    if (++cycle % 9000 == 0) {
      state.PauseTiming();
      chunks.push(time, poses);
      state.ResumeTiming();
    }
    benchmark::DoNotOptimize(chunks.at(time += 1e-3));
  }
}
BENCHMARK(action_chunks_at);

}  // namespace
