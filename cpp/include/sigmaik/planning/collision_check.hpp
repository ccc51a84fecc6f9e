#pragma once
/// \file collision_check.hpp
/// The check of a planner's answer: obstacles that a motion must not touch.

#include <cstddef>
#include <string>

#include <sigmaik/layout.hpp>
#include <sigmaik/planning/arm_spheres.hpp>
#include <sigmaik/planning/distance_field.hpp>
#include <sigmaik/planning/trajectory.hpp>

namespace sigmaik::planning {

/// An arm among obstacles. A value, safe to use from many threads.
class CollisionCheck {
 public:
  /// Keeps the arm and the obstacles.
  CollisionCheck(ArmSpheres spheres, DistanceField field) : spheres_(std::move(spheres)), field_(std::move(field)) {}

  /// The arm.
  const ArmSpheres& spheres() const noexcept { return spheres_; }
  /// The obstacles.
  const DistanceField& field() const noexcept { return field_; }

  /// The least signed distance [m] of the arm to the obstacles at `count` configurations q (count, n) in C order.
  double least_distance(std::size_t count, const double* q) const;

  /// Whether no sample of the motion touches an obstacle, with ten samples for each step.
  bool free(const Trajectory& motion) const;

  /// \param name of the configuration in the error's text, such as "start"
  /// \throws Error where the arm touches an obstacle at q
  void require_free(const std::string& name, const JointVector& q) const;

 private:
  ArmSpheres spheres_;
  DistanceField field_;
};

SIGMAIK_SAME_LAYOUT(CollisionCheck);

}  // namespace sigmaik::planning
