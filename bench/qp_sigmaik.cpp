#include <benchmark/benchmark.h>

#include <sigmaik/least_squares.hpp>

#include "qp_problem.hpp"

namespace {

using sigmaik::LeastSquares;
using sigmaik::LeastSquaresProblem;

template <bool kWarm>
void constrained_sigmaik(benchmark::State& state) {
  const auto& s = bench::scene();
  bench::ConstrainedProblem problem;
  LeastSquares solver;
  LeastSquaresProblem p;
  p.A.resize(3, 7);
  p.C.resize(3, 7);
  p.lower = Eigen::VectorXd::Constant(7, -bench::ConstrainedProblem::kLimit);
  p.upper = -p.lower;
  int i = 0, steps = 0, held = 0;
  for (auto _ : state) {
    problem.set(s.jacobian[static_cast<std::size_t>(i++ & (bench::kPath - 1))], s.twist);
    p.A = problem.angular;
    p.b = problem.omega;
    p.C = problem.linear;
    p.d = problem.v;
    if constexpr (!kWarm) solver.reset();
    const auto solution = solver.solve(p);
    benchmark::DoNotOptimize(solution.x.data());
    benchmark::ClobberMemory();
    steps += solution.steps;
    held += std::popcount(solution.at_lower | solution.at_upper);
  }
  state.counters["steps"] = steps / static_cast<double>(i);
  state.counters["held"] = held / static_cast<double>(i);
}
BENCHMARK(constrained_sigmaik<true>)->Name("constrained_sigmaik");
BENCHMARK(constrained_sigmaik<false>)->Name("constrained_sigmaik_cold");

}  // namespace
