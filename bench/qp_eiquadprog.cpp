#include <benchmark/benchmark.h>
#include <eiquadprog/eiquadprog-fast.hpp>

#include "qp_problem.hpp"

namespace {

void qp_eiquadprog(benchmark::State& state) {
  const auto& s = bench::scene();
  bench::QpProblem problem;
  eiquadprog::solvers::EiquadprogFast solver;
  solver.reset(7, 0, 14);
  const Eigen::MatrixXd ce(0, 7);
  const Eigen::VectorXd ce0(0);
  Eigen::MatrixXd ci(14, 7);
  ci << Eigen::MatrixXd::Identity(7, 7), -Eigen::MatrixXd::Identity(7, 7);
  const Eigen::VectorXd ci0 = Eigen::VectorXd::Constant(14, bench::QpProblem::kLimit);
  Eigen::VectorXd x(7);
  int i = 0;
  for (auto _ : state) {
    problem.set(s.jacobian[static_cast<std::size_t>(i++ & (bench::kPath - 1))], s.twist);
    benchmark::DoNotOptimize(solver.solve_quadprog(problem.hessian, problem.gradient, ce, ce0, ci, ci0, x));
    benchmark::ClobberMemory();
  }
}
BENCHMARK(qp_eiquadprog);

}  // namespace
