// Time-optimal motions between random configurations, time weight 600: a whole plan an iteration.
#include <random>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include <sigmaik/planning/costs.hpp>
#include <sigmaik/planning/time_optimal.hpp>

namespace {

using namespace sigmaik::planning;
using sigmaik::JointVector;
using sigmaik::SingularSets;

void time_optimal(benchmark::State& state, const std::string& name, const JointCostPtr& cost, bool restarts) {
  const auto chain = sigmaik::Chain::from_urdf(std::string(SIGMAIK_ROBOTS_DIR) + "/" + name + ".urdf", "", "flange");
  TimeOptimalOptions options;
  options.time_weight = 600.0;
  options.restarts = restarts;
  TimeOptimal planner(chain, cost, options);
  std::mt19937_64 engine(1);
  std::vector<TimeOptimalProblem> problems(256);
  const auto anywhere = [&] {
    JointVector q(chain.dof());
    for (int i = 0; i < chain.dof(); ++i) {
      q[i] = std::uniform_real_distribution<double>(chain.limits().lower[i], chain.limits().upper[i])(engine);
    }
    return q;
  };
  for (TimeOptimalProblem& p : problems) {
    p.start = anywhere();
    p.goal = anywhere();
  }
  std::size_t i = 0;
  double iterations = 0.0;
  for (auto _ : state) {
    const TimeOptimalResult r = planner.solve(problems[i++ & 255]);
    iterations += r.iterations;
    benchmark::DoNotOptimize(r.cost);
  }
  state.counters["iterations"] = benchmark::Counter(iterations, benchmark::Counter::kAvgIterations);
}

void register_all(const std::string& name) {
  const SingularSets sets = SingularSets::load(name);
  const auto add = [&](const char* what, const JointCostPtr& cost, bool restarts) {
    benchmark::RegisterBenchmark(("time_optimal_" + std::string(what) + "/" + name).c_str(),
                                 [=](benchmark::State& state) { time_optimal(state, name, cost, restarts); })
        ->Unit(benchmark::kMillisecond);
  };
  add("free", nullptr, true);
  add("potential", potential_cost(sets), true);
  add("potential_one_start", potential_cost(sets), false);
  add("manipulability", manipulability_cost(sets), true);
}

[[maybe_unused]] const bool registered = [] {
  for (const char* name : {"kuka_lbr_iiwa_14_r820", "franka_panda"}) register_all(name);
  return true;
}();

}  // namespace
