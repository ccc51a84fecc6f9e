// Position only, or any rotation about the tool's axis: fewer task rows, more freedom. The same as 03_position_only.py.
#include <cstdio>

#include <sigmaik/sigmaik.hpp>

int main(int argc, char** argv) try {
  if (argc != 2) return std::fprintf(stderr, "usage: %s ROBOT.urdf\n", argv[0]), 2;
  const auto arm = sigmaik::Chain::from_urdf(argv[1]);
  const struct {
    const char* name;
    sigmaik::Task task;
  } cases[] = {{"whole pose", {}},
               {"position only", {{true, true, true, false, false, false}}},
               {"free about tool z", {{true, true, true, true, true, false}, sigmaik::Frame::Tool}}};
  for (const auto& [name, task] : cases) {
    sigmaik::Servo servo(arm, sigmaik::JParse{}, {.dt = 1e-3, .task = task});
    servo.reset(sigmaik::JointVector::Constant(arm.dof(), 0.4));
    sigmaik::Pose target = servo.tip();
    target.translation() += Eigen::Vector3d(-0.1, 0.1, 0.1);
    target.rotate(Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitZ()));
    sigmaik::ServoStep step;
    for (int cycle = 0; cycle < 5000; ++cycle) step = servo.update(target);
    std::printf("%-18s position error %.6f m, orientation error %.6f rad\n", name, step.pose_error.head<3>().norm(),
                step.pose_error.tail<3>().norm());
  }
  return 0;
} catch (const sigmaik::Error& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
