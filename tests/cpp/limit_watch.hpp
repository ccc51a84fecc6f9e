#pragma once
// The limits of an arm, as a robot's controller checks them: in every cycle, from differences of the commands.

#include <algorithm>
#include <cmath>
#include <limits>

#include <sigmaik/chain.hpp>
#include <sigmaik/servo.hpp>

namespace test {

class LimitWatch {
 public:
  /// \param assumed [rad/s²] the acceleration limit of joints that have none
  LimitWatch(const sigmaik::JointLimits& limits, double dt, const sigmaik::JointVector& qdot,
             const sigmaik::JointVector& qddot = {}, double assumed = 10.0)
      : limits_(limits), dt_(dt), v_(qdot), fastest_(qdot.cwiseAbs()) {
    a_ = qddot.size() != 0 ? qddot : sigmaik::JointVector(sigmaik::JointVector::Zero(qdot.size()));
    for (double& a : limits_.acceleration) {
      if (!(a < std::numeric_limits<double>::infinity())) a = assumed;
    }
  }

  void step(const sigmaik::JointVector& q, const sigmaik::JointVector& v) {
    constexpr double kTolerance = 1.0 + 1e-9;
    for (Eigen::Index i = 0; i < v.size(); ++i) {
      fastest_[i] = std::max(fastest_[i], std::abs(v[i]));
      const double rounding = std::numeric_limits<double>::epsilon() * fastest_[i] / dt_, a = (v[i] - v_[i]) / dt_;
      broken += !std::isfinite(q[i]) || !std::isfinite(v[i]);
      broken += q[i] > limits_.upper[i] || q[i] < limits_.lower[i];
      broken += std::abs(v[i]) > limits_.velocity[i] * kTolerance;
      broken += std::abs(a) > limits_.acceleration[i] * kTolerance + 2.0 * rounding;
      broken += std::abs(a - a_[i]) / dt_ > limits_.jerk[i] * kTolerance + 4.0 * rounding / dt_;
      v_[i] = v[i];
      a_[i] = a;
    }
  }
  void step(const sigmaik::ServoStep& step) { this->step(step.q, step.qdot); }

  /// [rad/s²] (n,), of the last cycle.
  const sigmaik::JointVector& qddot() const { return a_; }

  long broken = 0;  ///< how often a joint was beyond a limit

 private:
  sigmaik::JointLimits limits_;
  double dt_;
  sigmaik::JointVector v_, a_, fastest_;
};

}  // namespace test
