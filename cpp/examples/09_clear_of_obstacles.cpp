// A servo that keeps clear of a table, a post that moves, and itself. The same as 09_clear_of_obstacles.py.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include <sigmaik/sigmaik.hpp>

int main(int argc, char** argv) try {
  if (argc != 2) return std::fprintf(stderr, "usage: %s ROBOT.urdf\n", argv[0]), 2;
  using sigmaik::Obstacle;
  const auto arm = sigmaik::Chain::from_urdf(argv[1]);
  Obstacle table = Obstacle::half_space({0.0, 0.0, 0.05}, {0.0, 0.0, 1.0});
  table.name = "table";
  table.links = {arm.tip(), "link6"};  // the arm stands in it
  Obstacle post = Obstacle::capsule({0.45, -0.3, 0.0}, {0.45, -0.3, 0.6}, 0.03);
  post.name = "post";
  sigmaik::Collisions collisions(arm, {table, post});
  sigmaik::ServoOptions options;
  options.collisions = collisions;
  sigmaik::Servo servo(arm, sigmaik::JParse{}, options);
  sigmaik::JointVector q(7);
  q << 0.0, -0.4, 0.0, 0.9, 0.0, 1.3, 0.0;
  servo.reset(q);
  sigmaik::Pose target = servo.tip();
  target.translation()[2] = 0.02;  // below the table's top
  double least = 1.0;
  sigmaik::ServoStep step;
  sigmaik::Pose place = post.pose;
  sigmaik::Twist twist = sigmaik::Twist::Zero();
  for (int i = 0; i < 6000; ++i) {
    twist[1] = 0.1 * std::cos(i * 1e-3);  // m/s
    place.translation()[1] += twist[1] * 1e-3;
    collisions.move(1, place, twist);  // from any thread
    step = servo.update(target);
    least = std::min(least, step.clearance);
  }
  std::printf("%zu capsules, least clearance %.1f mm, at the end %.1f mm from %s\n", collisions.capsules().size(),
              1e3 * least, 1e3 * step.clearance,
              collisions.body_names()[static_cast<std::size_t>(step.nearest[1])].c_str());
  return least > 0.01 - 1e-9 ? 0 : 1;
} catch (const sigmaik::Error& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
