// Drives an arm to a pose out of its reach, and back: it stretches out, and returns. The same as 01_servo.py.
#include <cstdio>

#include <sigmaik/sigmaik.hpp>

int main(int argc, char** argv) try {
  if (argc != 2) return std::fprintf(stderr, "usage: %s ROBOT.urdf\n", argv[0]), 2;
  const auto arm = sigmaik::Chain::from_urdf(argv[1]);  // throws sigmaik::Error with the facts
  sigmaik::Servo servo(arm, sigmaik::JParse{.gamma = 0.1}, {.dt = 1e-3});
  servo.reset(sigmaik::JointVector::Constant(arm.dof(), 0.4));
  const sigmaik::Pose home = servo.tip();
  sigmaik::Pose far = home;
  far.translation() *= 10.0;

  for (const sigmaik::Pose& target : {far, home}) {
    sigmaik::ServoStep step;
    for (int cycle = 0; cycle < 15000; ++cycle) {  // real time from here: noexcept, no heap, no locks
      step = servo.update(target);
      // A controller sends this step, too: the step is a cycle of the stop.
      if (step.status == sigmaik::Status::BadInput) return 1;
      // step.q and step.qdot go to the arm
    }
    std::printf("%-7s position error %.6f m, smallest / largest singular value %.4f\n", to_string(step.status),
                step.pose_error.head<3>().norm(),
                step.singular_values[step.singular_values.size() - 1] / step.singular_values[0]);
  }
  return 0;
} catch (const sigmaik::Error& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
