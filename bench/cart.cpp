// The cart's law for the two experiments' size, 5068 samples: one part of the region, and several with both sides.
#include <cmath>
#include <vector>

#include <benchmark/benchmark.h>

#include <sigmaik/planning/cart.hpp>

namespace {

using namespace sigmaik::planning;

PlanarPath line(int samples) {
  PlanarPath path(samples, 2);
  for (int i = 0; i < samples; ++i) {
    const double s = static_cast<double>(i) / (samples - 1);
    path.row(i) << 0.260367 + s * (0.815706 - 0.260367), 0.195885 + s * (-0.302453 - 0.195885);
  }
  return path;
}

void cart_law_line(benchmark::State& state) {
  const PlanarPath path = line(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(cart_law(path, 0.5, 0.75, 0.2, {.turn = 2.47}).energy);
}
BENCHMARK(cart_law_line)->Arg(500)->Arg(5068)->Arg(50000)->Unit(benchmark::kMicrosecond);

// From rest to rest, where the acceleration is limited: an interior-point method instead of a string.
void cart_law_limited(benchmark::State& state) {
  const PlanarPath path = line(static_cast<int>(state.range(0)));
  const CartOptions options{.turn = 2.47, .duration = 200.0, .max_acceleration = 1e-3, .at_rest = true};
  for (auto _ : state) benchmark::DoNotOptimize(cart_law(path, 0.5, 0.75, 0.2, options).energy);
}
BENCHMARK(cart_law_limited)->Arg(500)->Arg(5068)->Unit(benchmark::kMillisecond);

// Waves about the cart's line: a part of the region in each half wave.
void cart_law_waves(benchmark::State& state) {
  constexpr int kSamples = 5068;
  PlanarPath path(kSamples, 2);
  for (int i = 0; i < kSamples; ++i) {
    const double s = static_cast<double>(i) / (kSamples - 1);
    path.row(i) << 0.5 * std::sin(2.0 + 9.0 * s),
        0.6 * std::cos(3.14159265358979 * static_cast<double>(state.range(0)) * s);
  }
  int strings = 0;
  for (auto _ : state) strings = cart_law(path, 0.0, 0.2, 0.2).strings;
  state.counters["strings"] = strings;
}
BENCHMARK(cart_law_waves)->Arg(3)->Arg(8)->Unit(benchmark::kMicrosecond);

void cart_descent_1000(benchmark::State& state) {
  const PlanarPath path = line(5068);
  std::vector<double> lower, upper, straight;
  forbidden_intervals(path, 0.2, lower, upper);
  for (Eigen::Index i = 0; i < path.rows(); ++i) {
    straight.push_back(0.5 + 0.25 * static_cast<double>(i) / static_cast<double>(path.rows() - 1));
  }
  for (auto _ : state) {
    std::vector<double> x = straight;
    benchmark::DoNotOptimize(cart_descent(lower, upper, x, {.max_iterations = 1000}));
  }
}
BENCHMARK(cart_descent_1000)->Unit(benchmark::kMillisecond);

}  // namespace
