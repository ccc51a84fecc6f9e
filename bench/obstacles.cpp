// An arm of seven joints among obstacles: the costs of one configuration, with and without derivatives.
#include <cmath>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include <sigmaik/planning/collision_costs.hpp>

namespace {

using namespace sigmaik;
using namespace sigmaik::planning;

constexpr int kPoints = 1024;

// A table and a ball before an iiwa, and configurations all over its range.
struct Cell {
  Chain arm = Chain::from_urdf(std::string(SIGMAIK_ROBOTS_DIR) + "/kuka_lbr_iiwa_14_r820.urdf", "", "flange");
  ArmSpheres spheres = ArmSpheres::from_urdf(arm, std::string(SIGMAIK_ROBOTS_DIR) + "/kuka_lbr_iiwa_14_r820.urdf");
  DistanceField field;
  std::vector<JointVector> q;

  Cell() : field(sampled()) {
    for (int i = 0; i < kPoints; ++i) {
      JointVector x(arm.dof());
      for (int j = 0; j < arm.dof(); ++j) x[j] = 2.0 * std::sin(12.9898 * i + 78.233 * j);
      q.push_back(x);
    }
  }

  static DistanceField sampled() {
    constexpr int kNodes = 101;
    constexpr double kCell = 0.02;
    const Eigen::Vector3d origin(-1.0, -1.0, -0.5);
    std::vector<double> distances;
    for (int x = 0; x < kNodes; ++x) {
      for (int y = 0; y < kNodes; ++y) {
        for (int z = 0; z < kNodes; ++z) {
          const Eigen::Vector3d p = origin + kCell * Eigen::Vector3d(x, y, z);
          const double ball = (p - Eigen::Vector3d(-0.4, 0.3, 0.8)).norm() - 0.15;
          const Eigen::Array3d beside = (p - Eigen::Vector3d(0.6, 0.0, 0.4)).array().abs() -
                                        Eigen::Array3d(0.3, 0.5, 0.02);
          const double table = beside.max(0.0).matrix().norm() + std::min(beside.maxCoeff(), 0.0);
          distances.push_back(std::min(ball, table));
        }
      }
    }
    return DistanceField(distances, {kNodes, kNodes, kNodes}, origin, kCell);
  }
};

const Cell& scene() {
  static const Cell instance;
  return instance;
}

template <typename Function>
void run(benchmark::State& state, Function function) {
  const Cell& c = scene();
  state.SetLabel(std::to_string(c.spheres.size() - c.spheres.first_moving()) + " spheres");
  int i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(function(c.q[static_cast<std::size_t>(i++ & (kPoints - 1))]));
    benchmark::ClobberMemory();
  }
}

void sphere_centers(benchmark::State& state) {
  SphereState centers;
  run(state, [&](const JointVector& q) { return scene().spheres.update(q, centers); });
}
BENCHMARK(sphere_centers);

void value_of(benchmark::State& state, const JointCostPtr& cost) {
  run(state, [&](const JointVector& q) { return cost->value(q); });
}
void gradient_of(benchmark::State& state, const JointCostPtr& cost) {
  JointVector gradient(7);
  run(state, [&](const JointVector& q) { return cost->gradient(q, gradient); });
}
void hessian_of(benchmark::State& state, const JointCostPtr& cost) {
  JointVector gradient(7);
  JointMatrix hessian(7, 7);
  run(state, [&](const JointVector& q) { return cost->model(q, gradient, hessian); });
}

JointCostPtr obstacles() { return collision_cost(scene().spheres, scene().field, 0.1); }
JointCostPtr itself() { return self_collision_cost(scene().spheres, self_collision_pairs(scene().spheres)); }

void collision_value(benchmark::State& state) { value_of(state, obstacles()); }
void collision_gradient(benchmark::State& state) { gradient_of(state, obstacles()); }
void collision_hessian(benchmark::State& state) { hessian_of(state, obstacles()); }
void self_collision_value(benchmark::State& state) { value_of(state, itself()); }
void self_collision_gradient(benchmark::State& state) { gradient_of(state, itself()); }
BENCHMARK(collision_value);
BENCHMARK(collision_gradient);
BENCHMARK(collision_hessian);
BENCHMARK(self_collision_value);
BENCHMARK(self_collision_gradient);

}  // namespace
