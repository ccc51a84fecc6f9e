#include <sigmaik/planning/collision_check.hpp>

#include <algorithm>
#include <cstdio>
#include <vector>

#include <sigmaik/error.hpp>
#include <sigmaik/planning/collision_costs.hpp>

#include "samples.hpp"

namespace sigmaik::planning {

double CollisionCheck::least_distance(std::size_t count, const double* q) const {
  std::vector<double> distance(count);
  min_distance(spheres_, field_, count, q, distance.data());
  return *std::min_element(distance.begin(), distance.end());
}

bool CollisionCheck::free(const Trajectory& motion) const {
  const std::size_t count = detail::kDense * (motion.size() - 1) + 1;
  return least_distance(count, motion.sample(detail::evenly(motion.t.front(), motion.t.back(), count)).q.data()) >= 0.0;
}

void CollisionCheck::require_free(const std::string& name, const JointVector& q) const {
  const double distance = min_distance(spheres_, field_, q);
  if (distance >= 0.0) return;
  char depth[32];
  std::snprintf(depth, sizeof depth, "%.3f", -distance);
  throw Error("the " + name + " is in collision: the arm is " + depth + " m inside an obstacle");
}

}  // namespace sigmaik::planning
