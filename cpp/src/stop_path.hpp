#pragma once
// A cycle with a command, and the fastest stop of all joints after this cycle (limits.hpp): what a limit tracker allows
// always.

#include <algorithm>
#include <array>
#include <cmath>

#include <sigmaik/limits.hpp>

#include "jerk_bound.hpp"
#include "jerk_stop.hpp"

namespace sigmaik::detail {

class StopPath {
 public:
  // After q̇ (n,) inside the tracker's bounds.
  StopPath(const LimitTracker& tracker, const JointVector& qdot) noexcept
      : n_(tracker.n_), dt_(tracker.dt_), q_(tracker.q_), qdot_(qdot), reach_(JointVector::Zero(tracker.n_)) {
    for (int i = 0; i < n_; ++i) start(tracker, i);
  }

  // Cycles until all joints rest; the path is at q() after no cycle.
  int cycles() const noexcept { return cycles_; }

  // (n,) after k cycles.
  JointVector q(int k) const noexcept {
    JointVector out = q_;
    if (k <= 0) return out;
    for (int i = 0; i < n_; ++i) out[i] += dt_ * (qdot_[i] + travel(i, k - 1));
    return out;
  }

  // (n,) [rad or m] How far each joint gets away from its present position, at most, at any time.
  const JointVector& reach() const noexcept { return reach_; }

  // [rad or m] How far joint i gets away from the straight line between its positions after k and m > k cycles, which
  // differ by `change`, at most: |q̈| ≤ B gives B h²/8, and a position that grows or falls stays between both.
  double bend(int i, int k, int m, double change) const noexcept {
    const Joint& joint = joints_[static_cast<std::size_t>(i)];
    if (joint.last <= k) return 0.0;
    const double cycles = m - k, bend = 0.125 * joint.acceleration * dt_ * cycles * cycles;
    return joint.turns ? bend : std::min(bend, std::abs(change));
  }

 private:
  struct Joint {
    double acceleration = 0.0;  // B dt, of braking
    int last = 0;               // the cycle after which the joint rests
    bool turns = false, has_jerk = false;
  };

  void start(const LimitTracker& tracker, int i) noexcept {
    const auto at = static_cast<std::size_t>(i);
    Joint& joint = joints_[at];
    joint.acceleration = tracker.braking_[at];
    joint.has_jerk = (tracker.with_jerk_ >> i & 1u) != 0;
    constexpr double kLongest = 1e6;  // [cycles]
    double end = 0.0;
    if (joint.has_jerk) {
      const auto& memory = tracker.jerk_states_[at];
      const double slope = slope_of(qdot_[i], tracker.v_[i], memory.next, memory.next_slope, tracker.jerk_[at]);
      stops_[at] = JerkStop(qdot_[i], slope, tracker.jerk_[at], joint.acceleration);
      end = stops_[at].end();
      joint.turns = stops_[at].turns();
      if (joint.turns) {  // there, and back again
        const JerkStop mirrored(-qdot_[i], -slope, tracker.jerk_[at], joint.acceleration);
        reach_[i] = dt_ * (stops_[at].rise() + mirrored.rise());
      }
    } else {
      end = joint.acceleration < std::numeric_limits<double>::infinity() ? std::abs(qdot_[i]) / joint.acceleration
                                                                         : 0.0;
    }
    joint.last = 1 + static_cast<int>(std::ceil(std::min(end, kLongest)));
    cycles_ = std::max(cycles_, joint.last);
    reach_[i] += dt_ * (std::abs(qdot_[i]) + std::abs(travel(i, joint.last)));
  }

  // Σ v over `k` cycles of the stop.
  double travel(int i, int k) const noexcept {
    const auto at = static_cast<std::size_t>(i);
    if (k <= 0) return 0.0;
    if (joints_[at].has_jerk) return stops_[at].travel(k);
    const double a = joints_[at].acceleration, v = std::abs(qdot_[i]);
    if (!(a < std::numeric_limits<double>::infinity())) return 0.0;
    const double count = std::min(static_cast<double>(k), floor_of(v / a));
    return std::copysign(count * v - 0.5 * a * count * (count + 1.0), qdot_[i]);
  }

  int n_;
  double dt_;
  JointVector q_, qdot_;
  std::array<Joint, kMaxJoints> joints_{};
  std::array<JerkStop, kMaxJoints> stops_{};
  JointVector reach_;
  int cycles_ = 1;
};

}  // namespace sigmaik::detail
