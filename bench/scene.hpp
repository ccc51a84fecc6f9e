#pragma once
// What every benchmark works on: seven joints at 1 kHz.

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <sigmaik/sigmaik.hpp>

namespace bench {

using sigmaik::JointVector;

inline constexpr int kPath = 1024;  // a power of two, so that going round costs nothing

// A smooth motion of the xArm7 at about 1 rad/s, there and back, and the poses on its way.
struct Scene {
  sigmaik::Chain arm = sigmaik::Chain::from_urdf(std::string(SIGMAIK_ROBOTS_DIR) + "/ufactory_xarm7.urdf");
  std::vector<JointVector> q;
  std::vector<sigmaik::Pose> pose;
  std::vector<sigmaik::Jacobian> jacobian;
  std::vector<Eigen::Matrix<double, 6, 7>> random;
  sigmaik::Twist twist;

  Scene() {
    sigmaik::ChainState state;
    JointVector home(7);
    home << 0.0, -0.35, 0.2, 1.05, 0.1, 1.4, 0.0;
    for (int i = 0; i < kPath; ++i) {
      JointVector now = home;
      for (int j = 0; j < 7; ++j) now[j] += 0.16 * std::sin(2.0 * M_PI * i / kPath + j);
      update(arm, now, state);
      q.push_back(now);
      pose.push_back(state.tip);
      jacobian.push_back(state.jacobian);
    }
    std::mt19937_64 generator(1);
    std::normal_distribution<double> normal;
    for (int i = 0; i < kPath; ++i) {
      random.push_back(Eigen::Matrix<double, 6, 7>::NullaryExpr([&] { return normal(generator); }));
    }
    twist << 0.1, -0.05, 0.2, 0.1, 0.3, -0.2;
  }

  // J-PARSE with a posture and the arm's limits, at the path's start.
  sigmaik::Servo servo() const {
    sigmaik::Servo servo(arm, sigmaik::JParse{}, {.posture = q[0], .posture_gain = 1.0});
    servo.reset(q[0]);
    return servo;
  }
};

inline const Scene& scene() {
  static const Scene instance;
  return instance;
}

}  // namespace bench
