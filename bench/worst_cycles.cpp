// The slowest cycles that the search of worst_case.cpp has found, as benchmarks.
#include <iterator>
#include <string>

#include <benchmark/benchmark.h>

#include "worst_inputs.hpp"

namespace {

void worst_cycle(benchmark::State& state) {
  const bench::Kept& kept = bench::kWorst[static_cast<std::size_t>(state.range(0))];
  const bench::Cycle cycle = bench::decode(bench::genome_of(kept), kept.joints);
  sigmaik::Servo servo = cycle.servo;
  for (auto _ : state) {
    servo = cycle.servo;  // the same cycle each time; the copy takes less than a microsecond
    benchmark::DoNotOptimize(servo.update_twist(cycle.twist).qdot[0]);
  }
  state.SetLabel(std::to_string(kept.joints) + " joints");
}
BENCHMARK(worst_cycle)->DenseRange(0, static_cast<int>(std::size(bench::kWorst)) - 1);

}  // namespace
