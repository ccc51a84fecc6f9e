#include <sigmaik/planning/plan.hpp>

#include <sigmaik/planning/costs/collision.hpp>

namespace sigmaik::planning {
namespace {

// The cost with that of the obstacles, and the check of the answer.
struct Clear {
  Cost cost;
  std::optional<CollisionCheck> check;

  Clear(const Chain& chain, const Cost& own, const std::optional<KeepClear>& obstacles) : cost(own) {
    if (!obstacles) return;
    const ArmSpheres spheres = obstacles->spheres ? *obstacles->spheres : ArmSpheres::along_links(chain);
    check.emplace(spheres, obstacles->field);
    if (obstacles->weight == 0.0) return;
    cost += costs::Collision{obstacles->field, spheres, obstacles->margin, obstacles->weight};
  }
};

template <typename Options>
Trajectory with_support_states(const Chain& chain, const JointVector& start, const JointVector& goal, const Cost& cost,
                               const Options& options, const std::optional<KeepClear>& obstacles) {
  Clear clear(chain, cost, obstacles);
  return SupportPlanner(chain, clear.cost.bind(chain), options.states, std::move(clear.check))
      .plan(start, goal, options);
}

}  // namespace

Trajectory time_optimal(const Chain& chain, const TimeOptimalProblem& problem, const Cost& cost,
                        const TimeOptimalOptions& options, const std::optional<KeepClear>& obstacles,
                        const std::optional<SingularSets>& sets) {
  const Clear clear(chain, cost, obstacles);
  return TimeOptimal(chain, clear.cost.bind_smooth(chain), options, sets ? sets : SingularSets::of(chain), clear.check)
      .plan(problem);
}

Trajectory gradient(const Chain& chain, const JointVector& start, const JointVector& goal, const Cost& cost,
                    const GradientOptions& options, const std::optional<KeepClear>& obstacles) {
  return with_support_states(chain, start, goal, cost, options, obstacles);
}

Trajectory stochastic(const Chain& chain, const JointVector& start, const JointVector& goal, const Cost& cost,
                      const StochasticOptions& options, const std::optional<KeepClear>& obstacles) {
  return with_support_states(chain, start, goal, cost, options, obstacles);
}

}  // namespace sigmaik::planning
