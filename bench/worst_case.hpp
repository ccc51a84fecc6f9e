#pragma once
// The cycle of a servo as bytes: an arm, its limits, where it is and how it moves, the command before, and the command
// whose cycle is measured. bench/worst_case.cpp searches the bytes of the most iterations.

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include <sigmaik/servo.hpp>

namespace bench {

using Genome = std::vector<std::uint8_t>;

inline constexpr int kGlobalGenes = 6, kJointGenes = 9, kTwistGenes = 12;

inline std::size_t genome_size(int joints) {
  return static_cast<std::size_t>(kGlobalGenes + kJointGenes * joints + kTwistGenes);
}

inline double part(std::uint8_t gene) { return gene / 255.0; }
inline double decades(std::uint8_t gene, double low, double high) {
  return std::pow(10.0, low + (high - low) * part(gene));
}

/// The servo after its cycle before, and the command of the next.
struct Cycle {
  sigmaik::Servo servo;
  sigmaik::Twist twist;
};

inline sigmaik::Segment segment(const std::uint8_t* gene, int i, bool jerk) {
  using sigmaik::JointType;
  sigmaik::Segment s;
  s.joint_name = "j" + std::to_string(i);
  s.link_name = "l" + std::to_string(i);
  s.type = JointType::Revolute;
  const double right = 0.5 * std::numbers::pi;
  const std::array<double, 4> turns{0.0, right, -right, part(gene[0])};
  s.origin.linear() = Eigen::AngleAxisd(turns[gene[0] % 4], Eigen::Vector3d::UnitX()).toRotationMatrix();
  s.origin.translation() = Eigen::Vector3d(gene[0] % 8 < 4 ? 0.0 : part(gene[1]), 0.0,
                                           gene[0] % 8 < 4 ? part(gene[1]) : 0.0);
  const double q = 6.0 * part(gene[2]) - 3.0, range = decades(gene[3], -3.0, 0.7);
  s.lower = q - part(gene[4]) * range;
  s.upper = q + (1.0 - part(gene[4])) * range;
  s.velocity = decades(gene[5], -1.0, 1.0);
  s.acceleration = decades(gene[6], 0.0, 3.0);
  if (jerk) s.jerk = decades(gene[8], 2.0, 5.0);
  return s;
}

inline Cycle decode(const Genome& genome, int joints) {
  const std::uint8_t* gene = genome.data() + kGlobalGenes;
  const bool jerk = genome[0] % 2 == 1;
  std::vector<sigmaik::Segment> segments;
  for (int i = 0; i < joints; ++i) segments.push_back(segment(gene + kJointGenes * i, i, jerk));
  sigmaik::ServoOptions options;
  options.exact = {(genome[1] & 1) != 0, (genome[1] & 2) != 0,  (genome[1] & 4) != 0,
                   (genome[1] & 8) != 0, (genome[1] & 16) != 0, (genome[1] & 32) != 0};
  if (genome[2] % 2 == 1) options.posture_gain = decades(genome[2], -1.0, 2.0);
  options.soft_start = 0.0;
  Cycle cycle{sigmaik::Servo(sigmaik::Chain("base", segments), sigmaik::JParse{}, options), {}};
  sigmaik::JointVector q(joints), qdot(joints);
  for (int i = 0; i < joints; ++i) {
    q[i] = 6.0 * part(gene[kJointGenes * i + 2]) - 3.0;
    qdot[i] = (2.0 * part(gene[kJointGenes * i + 7]) - 1.0) * segments[static_cast<std::size_t>(i)].velocity;
  }
  cycle.servo.reset(q, qdot);
  const std::uint8_t* twist = gene + kJointGenes * joints;
  sigmaik::Twist before;
  for (int k = 0; k < 6; ++k) {
    const double scale = k < 3 ? 2.0 : 6.0;
    before[k] = scale * (2.0 * part(twist[k]) - 1.0);
    cycle.twist[k] = scale * (2.0 * part(twist[6 + k]) - 1.0);
  }
  for (int k = 0; k < genome[3] % 4; ++k) cycle.servo.update_twist(before);
  return cycle;
}

}  // namespace bench
