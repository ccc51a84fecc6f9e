#include <benchmark/benchmark.h>
#include <proxsuite/proxqp/dense/dense.hpp>

#include "qp_problem.hpp"

namespace {

using Qp = proxsuite::proxqp::dense::QP<double>;
constexpr auto none = proxsuite::nullopt;

void warm(Qp& qp) {
  qp.settings.eps_abs = 1e-9;
  qp.settings.initial_guess = proxsuite::proxqp::InitialGuessStatus::WARM_START_WITH_PREVIOUS_RESULT;
}

void velocity_proxsuite(benchmark::State& state) {
  const auto& s = bench::scene();
  bench::VelocityProblem problem;
  Qp qp(7, 0, 7);
  warm(qp);
  const Eigen::MatrixXd c = Eigen::MatrixXd::Identity(7, 7);
  const Eigen::VectorXd limit = Eigen::VectorXd::Constant(7, bench::VelocityProblem::kLimit);
  problem.set(s.jacobian[0], s.twist);
  qp.init(problem.hessian, problem.gradient, none, none, c, -limit, limit);
  qp.solve();
  int i = 0;
  for (auto _ : state) {
    problem.set(s.jacobian[static_cast<std::size_t>(i++ & (bench::kPath - 1))], s.twist);
    qp.update(problem.hessian, problem.gradient, none, none, none, none, none);
    qp.solve();
    benchmark::DoNotOptimize(qp.results.x.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(velocity_proxsuite);

void constrained_proxsuite(benchmark::State& state) {
  const auto& s = bench::scene();
  bench::ConstrainedProblem problem;
  Qp qp(7, 3, 7);
  warm(qp);
  const Eigen::MatrixXd c = Eigen::MatrixXd::Identity(7, 7);
  const Eigen::VectorXd limit = Eigen::VectorXd::Constant(7, bench::ConstrainedProblem::kLimit);
  problem.set(s.jacobian[0], s.twist);
  qp.init(problem.hessian(), problem.gradient(), problem.linear, problem.v, c, -limit, limit);
  qp.solve();
  int i = 0;
  for (auto _ : state) {
    problem.set(s.jacobian[static_cast<std::size_t>(i++ & (bench::kPath - 1))], s.twist);
    qp.update(problem.hessian(), problem.gradient(), problem.linear, problem.v, none, none, none);
    qp.solve();
    benchmark::DoNotOptimize(qp.results.x.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(constrained_proxsuite);

}  // namespace
