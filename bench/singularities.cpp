// Potentials around known singular sets beside manipulability, in closed form and from the Jacobian; each with its
// gradient.
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <Eigen/Cholesky>

#include <sigmaik/indices.hpp>
#include <sigmaik/singularities.hpp>

#include "scene.hpp"

namespace {

using sigmaik::JointVector;
using sigmaik::SingularSets;

constexpr int kPoints = 1024;

// An arm, its sets, and configurations all over its range.
struct Arm {
  sigmaik::Chain chain;
  SingularSets sets;
  std::vector<JointVector> q;

  explicit Arm(const std::string& name)
      : chain(sigmaik::Chain::from_urdf(std::string(SIGMAIK_ROBOTS_DIR) + "/" + name + ".urdf", "", "flange")),
        sets(SingularSets::load(name)) {
    for (int i = 0; i < kPoints; ++i) {
      JointVector x(chain.dof());
      for (int j = 0; j < chain.dof(); ++j) x[j] = 3.0 * std::sin(12.9898 * i + 78.233 * j);
      q.push_back(x);
    }
  }
};

const Arm& arm(benchmark::State& state) {
  static const std::vector<Arm> all = [] {
    std::vector<Arm> list;
    for (const std::string& name : SingularSets::names()) list.emplace_back(name);
    return list;
  }();
  const Arm& a = all[static_cast<std::size_t>(state.range(0))];
  state.SetLabel(a.sets.name());
  return a;
}

template <typename Function>
void run(benchmark::State& state, Function function) {
  const Arm& a = arm(state);
  JointVector gradient(a.chain.dof());
  int i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(function(a, a.q[static_cast<std::size_t>(i++ & (kPoints - 1))], gradient));
    benchmark::ClobberMemory();
  }
}

void potential_gradient(benchmark::State& state) {
  run(state,
      [](const Arm& a, const JointVector& q, JointVector& gradient) { return a.sets.potential(q, {}, gradient); });
}
BENCHMARK(potential_gradient)->DenseRange(0, 2);

void potential_hessian(benchmark::State& state) {
  sigmaik::JointMatrix hessian(7, 7);
  run(state, [&](const Arm& a, const JointVector& q, JointVector& gradient) {
    return a.sets.potential(q, {}, gradient, hessian);
  });
}
BENCHMARK(potential_hessian)->DenseRange(0, 2);

void manipulability_closed_form_gradient(benchmark::State& state) {
  run(state,
      [](const Arm& a, const JointVector& q, JointVector& gradient) { return a.sets.manipulability(q, gradient); });
}
BENCHMARK(manipulability_closed_form_gradient)->DenseRange(0, 2);

// From the singular values: right down to zero.
void manipulability_svd_gradient(benchmark::State& state) {
  const sigmaik::IndexFunction index(sigmaik::Index::Manipulability);
  run(state,
      [&](const Arm& a, const JointVector& q, JointVector& gradient) { return index.value(a.chain, q, gradient); });
}
BENCHMARK(manipulability_svd_gradient)->DenseRange(0, 2);

// √det(JJᵀ) as one would write it: m from a Cholesky factor, ∂_k m = m tr((JJᵀ)⁻¹ J ∂_kJᵀ) with all ∂_kJ.
void manipulability_determinant_gradient(benchmark::State& state) {
  run(state, [](const Arm& a, const JointVector& q, JointVector& gradient) {
    static sigmaik::JacobianGradient derivative;
    sigmaik::ChainState s;
    update(a.chain, q, s);
    sigmaik::jacobian_gradient(s.jacobian, derivative);
    const Eigen::Matrix<double, 6, 6> gram = s.jacobian.lazyProduct(s.jacobian.transpose());
    const Eigen::LLT<Eigen::Matrix<double, 6, 6>> llt(gram);
    const double m = llt.matrixLLT().diagonal().prod();
    const sigmaik::Jacobian w = llt.solve(s.jacobian);
    for (int k = 0; k < gradient.size(); ++k) {
      gradient[k] = m * w.cwiseProduct(derivative[static_cast<std::size_t>(k)]).sum();
    }
    return m;
  });
}
BENCHMARK(manipulability_determinant_gradient)->DenseRange(0, 2);

}  // namespace
