#include <benchmark/benchmark.h>
#include <proxsuite/proxqp/dense/dense.hpp>

#include "qp_problem.hpp"

namespace {

void qp_proxsuite(benchmark::State& state) {
  const auto& s = bench::scene();
  bench::QpProblem problem;
  proxsuite::proxqp::dense::QP<double> qp(7, 0, 7);
  const Eigen::MatrixXd c = Eigen::MatrixXd::Identity(7, 7);
  const Eigen::VectorXd limit = Eigen::VectorXd::Constant(7, bench::QpProblem::kLimit);
  problem.set(s.jacobian[0], s.twist);
  qp.settings.eps_abs = 1e-9;
  qp.settings.initial_guess = proxsuite::proxqp::InitialGuessStatus::WARM_START_WITH_PREVIOUS_RESULT;
  qp.init(problem.hessian, problem.gradient, proxsuite::nullopt, proxsuite::nullopt, c, -limit, limit);
  qp.solve();
  int i = 0;
  for (auto _ : state) {
    problem.set(s.jacobian[static_cast<std::size_t>(i++ & (bench::kPath - 1))], s.twist);
    qp.update(problem.hessian, problem.gradient, proxsuite::nullopt, proxsuite::nullopt, proxsuite::nullopt,
              proxsuite::nullopt, proxsuite::nullopt);
    qp.solve();
    benchmark::DoNotOptimize(qp.results.x.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(qp_proxsuite);

}  // namespace
