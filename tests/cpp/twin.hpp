#pragma once
// The rule of a servo, alone: what a servo answers where no limit acts.

#include <sigmaik/servo.hpp>

namespace test {

inline sigmaik::VelocitySolver rule_of(const sigmaik::Servo& servo) {
  sigmaik::VelocitySolver solver(servo.method(), servo.length_scale(), servo.options().task);
  solver.set_pace(servo.pace());
  return solver;
}

}  // namespace test
