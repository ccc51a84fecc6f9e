// A 1 kHz loop whose every command a Franka Panda's controller accepts: targets and twists jump, and what it checks is
// checked here. The same as 05_franka_limits.py.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <random>

#include <sigmaik/sigmaik.hpp>

namespace {

constexpr double kDt = 1e-3;

// The controller differentiates the commands, and stops the arm where one goes too far.
class Checker {
 public:
  explicit Checker(const sigmaik::JointLimits& limits) : limits_(limits) {
    last_qdot_.setZero(limits.velocity.size());
    last_acceleration_.setZero(limits.velocity.size());
  }

  void check(const sigmaik::ServoStep& step) {
    const sigmaik::JointVector acceleration = (step.qdot - last_qdot_) / kDt;
    const sigmaik::JointVector jerk = (acceleration - last_acceleration_) / kDt;
    last_qdot_ = step.qdot;
    last_acceleration_ = acceleration;
    const sigmaik::JointVector middle = 0.5 * (limits_.upper + limits_.lower), half = limits_.upper - middle;
    note(peaks[0], step.q - middle, half);
    note(peaks[1], step.qdot, limits_.velocity);
    note(peaks[2], acceleration, limits_.acceleration);
    note(peaks[3], jerk, limits_.jerk);
  }

  double peaks[4] = {0.0, 0.0, 0.0, 0.0};  // of position, velocity, acceleration, jerk, as parts of their limits
  int violations = 0;

 private:
  void note(double& most, const sigmaik::JointVector& values, const sigmaik::JointVector& limits) {
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      const double ratio = std::abs(values[i]) / limits[i];
      if (!(ratio <= 1.0 + 1e-6)) ++violations;  // counts NaN, too; 1e-6: rounding of the differences
      most = std::max(most, ratio);
    }
  }

  sigmaik::JointLimits limits_;
  sigmaik::JointVector last_qdot_, last_acceleration_;
};

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 2) return std::fprintf(stderr, "usage: %s ROBOT.urdf, next to franka_panda.urdf\n", argv[0]), 2;
  const auto urdf = std::filesystem::path(argv[1]).parent_path() / "franka_panda.urdf";
  sigmaik::Chain arm = sigmaik::Chain::from_urdf(urdf.string(), "", "flange");
  sigmaik::JointLimits limits = arm.limits();  // positions from the URDF, the rest from libfranka's rate_limiting.h
  limits.velocity << 2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61;          // [rad/s]
  limits.acceleration << 15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0;           // [rad/s²]
  limits.jerk << 7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0;  // [rad/s³]
  arm = arm.with_limits(limits);

  sigmaik::JointVector home(7);
  home << 0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785;
  sigmaik::Servo servo(arm, sigmaik::JParse{}, {.dt = kDt});
  servo.reset(home);
  const sigmaik::Pose start = servo.tip();
  Checker checker(limits);
  std::mt19937_64 random(0);
  std::normal_distribution<double> normal;
  int limited = 0;

  // Poses that jump, every third far out of reach.
  sigmaik::Pose target = start;
  for (int cycle = 0; cycle < 20000; ++cycle) {
    if (cycle % 500 == 0) {
      target = start;
      target.translation() += 0.3 * Eigen::Vector3d(normal(random), normal(random), normal(random));
      if (cycle / 500 % 3 == 2) target.translation() *= 5.0;
      target.rotate(Eigen::AngleAxisd(normal(random), Eigen::Vector3d::UnitX()));
    }
    const sigmaik::ServoStep step = servo.update(target);
    checker.check(step);
    limited += step.status == sigmaik::Status::Limited;
  }
  // Twists that jump, four times in a second.
  sigmaik::Twist twist = sigmaik::Twist::Zero();
  for (int cycle = 0; cycle < 20000; ++cycle) {
    if (cycle % 250 == 0) twist = sigmaik::Twist::NullaryExpr([&] { return normal(random); });
    const sigmaik::ServoStep step = servo.update_twist(twist);
    checker.check(step);
    limited += step.status == sigmaik::Status::Limited;
  }
  // The key is let go: how long until all joints stand?
  const double speed = servo.qdot().cwiseAbs().maxCoeff();
  int cycles = 0;
  while (servo.qdot().cwiseAbs().maxCoeff() > 1e-9 && cycles < 5000) {
    checker.check(servo.update_twist(sigmaik::Twist::Zero()));
    ++cycles;
  }

  std::printf("%d cycles, %d limited, %d violations\n", 40000 + cycles, limited, checker.violations);
  std::printf("peaks, of the limits: position %.4f, velocity %.4f, acceleration %.4f, jerk %.4f\n", checker.peaks[0],
              checker.peaks[1], checker.peaks[2], checker.peaks[3]);
  std::printf("an abrupt stop from %.2f rad/s took %d ms\n", speed, cycles);
  return checker.violations == 0 ? 0 : 1;
} catch (const sigmaik::Error& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
