#include <benchmark/benchmark.h>
#include <eiquadprog/eiquadprog-fast.hpp>

#include "qp_problem.hpp"

namespace {

using eiquadprog::solvers::EiquadprogFast;

// |x_i| ≤ limit.
struct Box {
  Eigen::MatrixXd normals;
  Eigen::VectorXd offsets;
  explicit Box(double limit) : normals(14, 7), offsets(Eigen::VectorXd::Constant(14, limit)) {
    normals << Eigen::MatrixXd::Identity(7, 7), -Eigen::MatrixXd::Identity(7, 7);
  }
};

void velocity_eiquadprog(benchmark::State& state) {
  const auto& s = bench::scene();
  bench::VelocityProblem problem;
  EiquadprogFast solver;
  solver.reset(7, 0, 14);
  const Eigen::MatrixXd ce(0, 7);
  const Eigen::VectorXd ce0(0);
  const Box box(bench::VelocityProblem::kLimit);
  Eigen::VectorXd x(7);
  int i = 0;
  for (auto _ : state) {
    problem.set(s.jacobian[static_cast<std::size_t>(i++ & (bench::kPath - 1))], s.twist);
    benchmark::DoNotOptimize(
        solver.solve_quadprog(problem.hessian, problem.gradient, ce, ce0, box.normals, box.offsets, x));
    benchmark::ClobberMemory();
  }
}
BENCHMARK(velocity_eiquadprog);

void constrained_eiquadprog(benchmark::State& state) {
  const auto& s = bench::scene();
  bench::ConstrainedProblem problem;
  EiquadprogFast solver;
  solver.reset(7, 3, 14);
  const Box box(bench::ConstrainedProblem::kLimit);
  Eigen::MatrixXd ce(3, 7);
  Eigen::VectorXd ce0(3), x(7);
  int i = 0, failed = 0;
  for (auto _ : state) {
    problem.set(s.jacobian[static_cast<std::size_t>(i++ & (bench::kPath - 1))], s.twist);
    ce = problem.linear;
    ce0 = -problem.v;
    failed += solver.solve_quadprog(problem.hessian(), problem.gradient(), ce, ce0, box.normals, box.offsets, x) !=
              eiquadprog::solvers::EIQUADPROG_FAST_OPTIMAL;
    benchmark::ClobberMemory();
  }
  state.counters["failed"] = failed / static_cast<double>(i);
}
BENCHMARK(constrained_eiquadprog);

}  // namespace
