// What a cycle and a sample of a TargetStream cost: 1 kHz, samples at 30 Hz.
#include <cmath>

#include <benchmark/benchmark.h>

#include <sigmaik/target_stream.hpp>

namespace {

sigmaik::Pose hand(double time) {
  sigmaik::Pose pose = sigmaik::Pose::Identity();
  pose.translation() << 0.1 * std::sin(time), 0.1 * std::cos(1.3 * time), 0.05 * std::sin(0.7 * time);
  pose.linear() = sigmaik::rotation_exp(Eigen::Vector3d(0.3 * std::sin(time), 0.2 * std::cos(time), 0.0));
  return pose;
}

void target_stream_at(benchmark::State& state) {
  sigmaik::TargetStreamOptions options;
  options.mode = static_cast<sigmaik::StreamMode>(state.range(0));
  sigmaik::TargetStream stream(options);
  long cycle = 0;
  for (auto _ : state) {
    if (cycle % 33 == 0) {
      state.PauseTiming();
      stream.push(1e-3 * static_cast<double>(cycle), hand(1e-3 * static_cast<double>(cycle)));
      state.ResumeTiming();
    }
    benchmark::DoNotOptimize(stream.at(1e-3 * static_cast<double>(cycle++)));
  }
}
BENCHMARK(target_stream_at)->ArgName("mode")->DenseRange(0, 2);

void target_stream_push(benchmark::State& state) {
  sigmaik::TargetStreamOptions options;
  options.mode = static_cast<sigmaik::StreamMode>(state.range(0));
  sigmaik::TargetStream stream(options);
  const sigmaik::Pose pose = hand(0.3);
  double time = 0.0;
  for (auto _ : state) benchmark::DoNotOptimize(stream.push(time += 0.033, pose));
}
BENCHMARK(target_stream_push)->ArgName("mode")->DenseRange(0, 2);

}  // namespace
