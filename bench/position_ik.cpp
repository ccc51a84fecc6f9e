// Position IK on every shipped arm: random configurations inside the limits give the poses. What counts is the mean
// time, and the share of poses that are solved within 5 ms (`solved`, 1 is all).
#include <cmath>
#include <filesystem>
#include <map>
#include <random>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include <sigmaik/kinematics.hpp>
#include <sigmaik/position_ik.hpp>

namespace {

using sigmaik::Chain;
using sigmaik::JointVector;
using sigmaik::Pose;
using sigmaik::PositionIk;
using sigmaik::PositionIkResult;
using sigmaik::PositionIkStatus;

constexpr int kPoses = 10000;

struct Arm {
  PositionIk ik;
  std::vector<Pose> poses;
  std::vector<JointVector> near;
};

JointVector sample(const Chain& chain, std::mt19937_64& generator) {
  JointVector q(chain.dof());
  for (int i = 0; i < q.size(); ++i) {
    const double lower = chain.limits().lower[i], upper = chain.limits().upper[i];
    q[i] = std::uniform_real_distribution<double>(std::isfinite(lower) ? lower : -M_PI,
                                                  std::isfinite(upper) ? upper : M_PI)(generator);
  }
  return q;
}

Arm load(const std::string& file) {
  const Chain chain = Chain::from_urdf(file, "", "flange");
  Arm arm{PositionIk(chain), {}, {}};
  std::mt19937_64 generator(1);
  for (int k = 0; k < kPoses; ++k) {
    arm.poses.push_back(pose(chain, sample(chain, generator)));
    arm.near.push_back(sample(chain, generator));
  }
  return arm;
}

void solve(benchmark::State& state, const Arm& arm, bool near) {
  std::size_t k = 0, solved = 0, calls = 0;
  for (auto _ : state) {
    const PositionIkResult found = near ? arm.ik.solve(arm.poses[k], arm.near[k]) : arm.ik.solve(arm.poses[k]);
    solved += found.status == PositionIkStatus::Ok && found.solve_time < 5e-3;
    ++calls;
    k = (k + 1) % kPoses;
  }
  state.counters["solved"] = static_cast<double>(solved) / static_cast<double>(calls);
}

void solve_all(benchmark::State& state, const Arm& arm) {
  std::size_t k = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(arm.ik.solve_all(arm.poses[k]));
    k = (k + 1) % kPoses;
  }
}

const bool registered = [] {
  static std::map<std::string, Arm> arms;
  for (const auto& entry : std::filesystem::directory_iterator(SIGMAIK_ROBOTS_DIR)) {
    if (entry.path().extension() == ".urdf") arms.emplace(entry.path().stem().string(), load(entry.path().string()));
  }
  for (const auto& [name, arm] : arms) {
    const Arm* const one = &arm;
    benchmark::RegisterBenchmark(("position_ik_solve/" + name).c_str(),
                                 [one](auto& state) { solve(state, *one, false); });
    benchmark::RegisterBenchmark(("position_ik_near/" + name).c_str(),
                                 [one](auto& state) { solve(state, *one, true); });
    benchmark::RegisterBenchmark(("position_ik_all/" + name).c_str(), [one](auto& state) { solve_all(state, *one); });
  }
  return true;
}();

}  // namespace
