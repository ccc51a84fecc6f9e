// A motion in little time that keeps clear of singularities, and what it costs. The same as
// 06_clear_of_singularities.py.
#include <algorithm>
#include <cstdio>

#include <sigmaik/error.hpp>
#include <sigmaik/indices.hpp>
#include <sigmaik/planning/costs.hpp>
#include <sigmaik/planning/time_optimal.hpp>

int main(int argc, char** argv) try {
  if (argc != 2) return std::fprintf(stderr, "usage: %s ROBOT.urdf\n", argv[0]), 2;
  namespace planning = sigmaik::planning;
  const auto arm = sigmaik::Chain::from_urdf(argv[1], "", "", std::vector<double>(7, 10.0));  // rad/s²
  planning::TimeOptimalProblem problem;
  problem.start.resize(7);
  problem.goal.resize(7);
  problem.start << -1.0, -0.5, 0.2, 0.8, 0.3, 0.9, 0.0;
  problem.goal << 1.2, 0.6, -0.4, 1.5, -0.2, -0.9, 0.5;
  const struct {
    const char* name;
    planning::JointCostPtr cost;
  } cases[] = {{"straight there", nullptr}, {"clear of singularities", planning::manipulability_cost(arm, 10.0, 1e-6)}};
  for (const auto& [name, cost] : cases) {
    planning::TimeOptimal planner(arm, cost, {.time_weight = 600.0});
    const planning::TimeOptimalResult plan = planner.solve(problem);
    double least = 1.0;
    sigmaik::ChainState state;
    for (std::size_t k = 0; k < plan.q.size(); k += 7) {
      update(arm, Eigen::Map<const Eigen::VectorXd>(plan.q.data() + k, 7), state);
      least = std::min(least, sigmaik::manipulability(state.jacobian));
    }
    std::printf("%-22s %s, %.2f s, least manipulability %.4f\n", name, to_string(plan.status), plan.duration, least);
  }
  return 0;
} catch (const sigmaik::Error& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
