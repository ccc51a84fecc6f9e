#pragma once
// The natural cubic spline through support states, in unit time, and the times that an arm needs for it.

#include <optional>
#include <vector>

#include <sigmaik/chain.hpp>
#include <sigmaik/planning/trajectory.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik::planning::detail {

class NaturalSpline {
 public:
  /// Through q (states, n) in C order.
  NaturalSpline(std::vector<double> q, int states, int dof);

  /// Through the states, or, where this spline overshoots a position limit, through states that are as much nearer to
  /// the straight line between the ends as it takes: the line is within the limits, and the overshoot is convex in the
  /// distance from it.
  static NaturalSpline within(const JointLimits& limits, const std::vector<double>& q, int states, int dof);

  /// Lowest and highest positions (n,), between the states too.
  void extremes(JointVector& low, JointVector& high) const;
  /// Largest speeds (n,) [rad or m per unit time], between the states too.
  JointVector fastest() const;
  /// [s] the shortest that keeps the limits of velocity and acceleration; 1 where there are none or nothing moves.
  double shortest(const JointLimits& limits) const;

  /// t, q, q̇, q̈ and `cubic` of a motion over `duration` [s].
  Trajectory over(double duration) const;

 private:
  struct Step {  // of one joint: in s ∈ [0, 1], q̇ = a s² + b s + c
    double q, qdot, qddot, jerk;
    double a, b, c;
  };
  Step step(int k, int joint) const;

  int states_, dof_;
  double h_;  // between states
  std::vector<double> q_, qdot_, qddot_;
};

}  // namespace sigmaik::planning::detail
