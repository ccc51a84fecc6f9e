#pragma once
// Arms of a fuzzer: also planar ones, with coincident axes and without lengths, which are exactly singular.

#include <numbers>
#include <string>
#include <vector>

#include <sigmaik/chain.hpp>

#include "bytes.hpp"

namespace fuzz {

inline double limit(Bytes& bytes, double low, double high) {
  return bytes.one_in(5) ? kInfinity : bytes.decades(low, high);
}

inline sigmaik::Segment segment(Bytes& bytes, int i) {
  using sigmaik::JointType;
  sigmaik::Segment s;
  s.joint_name = "j" + std::to_string(i);
  s.link_name = "l" + std::to_string(i);
  const int kind = bytes.integer(0, 7);
  s.type = kind == 0 ? JointType::Prismatic : kind == 1 ? JointType::Continuous : JointType::Revolute;
  const double right = 0.5 * std::numbers::pi;
  switch (bytes.integer(0, 5)) {
    case 0: break;
    case 1: s.origin.linear() = Eigen::AngleAxisd(right, Eigen::Vector3d::UnitX()).toRotationMatrix(); break;
    case 2: s.origin.linear() = Eigen::AngleAxisd(-right, Eigen::Vector3d::UnitX()).toRotationMatrix(); break;
    case 3: s.origin.linear() = Eigen::AngleAxisd(right, Eigen::Vector3d::UnitY()).toRotationMatrix(); break;
    default: s.origin.linear() = bytes.rotation(2.0); break;
  }
  switch (bytes.integer(0, 4)) {
    case 0: break;
    case 1: s.origin.translation().x() = bytes.uniform(-1.0, 1.0); break;
    case 2: s.origin.translation().z() = bytes.uniform(-1.0, 1.0); break;
    default:
      for (int k = 0; k < 3; ++k) s.origin.translation()[k] = bytes.uniform(-1.0, 1.0);
  }
  if (s.type != JointType::Continuous && !bytes.one_in(5)) {
    s.lower = bytes.uniform(-3.0, 3.0);
    s.upper = s.lower + bytes.decades(-3.0, 1.0);
  }
  s.velocity = limit(bytes, -2.0, 1.5);
  s.acceleration = limit(bytes, -1.0, 4.0);
  s.jerk = bytes.one_in(2) ? kInfinity : bytes.decades(0.0, 8.0);
  return s;
}

inline sigmaik::Chain arm(Bytes& bytes) {
  const int n = bytes.one_in(2) ? bytes.integer(1, sigmaik::kMaxJoints) : bytes.integer(5, 8);
  std::vector<sigmaik::Segment> segments;
  for (int i = 0; i < n; ++i) segments.push_back(segment(bytes, i));
  sigmaik::Segment tool;
  tool.joint_name = tool.link_name = "tip";
  tool.origin.translation().z() = bytes.uniform(0.0, 0.3);
  segments.push_back(tool);
  return sigmaik::Chain("base", segments);
}

/// Inside the position limits.
inline sigmaik::JointVector configuration(Bytes& bytes, const sigmaik::Chain& chain) {
  sigmaik::JointVector q(chain.dof());
  for (int i = 0; i < chain.dof(); ++i) {
    const double low = std::max(chain.limits().lower[i], -3.0), high = std::min(chain.limits().upper[i], 3.0);
    q[i] = low <= high ? std::clamp(bytes.uniform(low, high), low, high)
                       : (chain.limits().lower[i] > -kInfinity ? chain.limits().lower[i] : chain.limits().upper[i]);
    if (bytes.one_in(8)) q[i] = std::clamp(0.0, chain.limits().lower[i], chain.limits().upper[i]);
  }
  return q;
}

}  // namespace fuzz
