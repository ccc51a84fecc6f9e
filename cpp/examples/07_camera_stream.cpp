// Follows a marker that a camera sees at 30 Hz, 50 ms late, now and then wrong, until it stops. The same as
// 07_camera_stream.py.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include <sigmaik/sigmaik.hpp>

int main(int argc, char** argv) try {
  if (argc != 2) return std::fprintf(stderr, "usage: %s ROBOT.urdf\n", argv[0]), 2;
  const auto arm = sigmaik::Chain::from_urdf(argv[1]);
  if (arm.dof() != 7) return std::fprintf(stderr, "this example starts an arm of seven joints\n"), 2;
  sigmaik::Servo servo(arm, sigmaik::JParse{}, {.dt = 1e-3});
  sigmaik::JointVector start(7);
  start << 0.0, -0.35, 0.0, 1.05, 0.0, 1.4, 0.0;
  servo.reset(start);
  const sigmaik::Pose home = servo.tip();
  sigmaik::TargetStream stream;  // predicts; Interpolate plays late, Hold stays at the last sample
  stream.reset(home);

  const auto marker = [&](double time) {  // where it is: a circle across the arm's plane
    sigmaik::Pose pose = home;
    pose.translation() += 0.1 * Eigen::Vector3d(0.0, std::sin(time), 1.0 - std::cos(time));
    return pose;
  };

  double worst = 0.0;
  sigmaik::Target target;
  sigmaik::ServoStep step;
  for (int cycle = 0; cycle < 10000; ++cycle) {
    const double now = 1e-3 * cycle;
    if (cycle % 33 == 0 && cycle >= 50 && cycle < 8000) {  // a sample comes; then no more
      sigmaik::Pose seen = marker(now - 0.05);
      if (cycle % 495 == 0) seen.translation()[0] += 0.4;  // wrong
      stream.push(now - 0.05, seen);
    }
    target = stream.at(now);
    step = servo.update(target.pose, target.twist);
    if (step.status == sigmaik::Status::BadInput) return 1;
    // step.q and step.qdot go to the arm
    if (cycle >= 3000 && cycle < 8000) {
      worst = std::max(worst, (servo.tip().translation() - marker(now + 1e-3).translation()).norm());
    }
  }
  std::printf("%d samples, %d refused; at most %.1f mm from the marker\n", static_cast<int>(stream.counts().accepted),
              static_cast<int>(stream.counts().outliers), 1e3 * worst);
  std::printf("then %s, at %.6f rad/s\n", to_string(target.status), step.qdot.norm());
  return 0;
} catch (const sigmaik::Error& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
