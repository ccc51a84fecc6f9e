// A controller's loop: a twist in, a joint command out, a thousand times a second.
#include <cstdio>

#include <sigmaik/sigmaik.hpp>

int main(int argc, char** argv) {
  if (argc != 2) return std::fprintf(stderr, "usage: %s ROBOT.urdf\n", argv[0]), 2;
  const auto arm = sigmaik::Chain::from_urdf(argv[1]);
  sigmaik::Servo servo(arm, sigmaik::JParse{}, {.dt = 1e-3});
  servo.reset(sigmaik::JointVector::Constant(arm.dof(), 1.0));
  const Eigen::Vector3d start = servo.tip().translation();

  sigmaik::Twist twist;
  twist << 0.05, 0, 0, 0, 0, 0;  // along the base's x at 0.05 m/s
  for (int cycle = 0; cycle < 1000; ++cycle) {
    const sigmaik::ServoStep step = servo.update_twist(twist);
    if (step.status == sigmaik::Status::BadInput) return std::fprintf(stderr, "bad input\n"), 1;
    // step.q and step.qdot go to the arm
  }
  const Eigen::Vector3d moved = servo.tip().translation() - start;
  std::printf("%d joints, tip went %.4f m in 1 s\n", arm.dof(), moved.x());
  // Speeding up within the joints' acceleration limits takes a little of the way.
  return moved.x() > 0.049 && (moved - Eigen::Vector3d(0.05, 0, 0)).norm() < 5e-4 ? 0 : 1;
}
