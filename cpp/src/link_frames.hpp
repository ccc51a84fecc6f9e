#pragma once
// Where the frames of an arm's links are, in the frames of the joints that move them.

#include <vector>

#include <sigmaik/chain.hpp>

namespace sigmaik::detail {

// One entry for the base, then one for each segment.
struct LinkFrames {
  std::vector<Pose> in_joint{Pose::Identity()};  // in the frame of the last joint that moves the link
  std::vector<int> joints{0};                    // number of joints that move the link

  // At q = 0 the links' frames are products of the origins, and the joints' frames are products of the constants: the
  // transform between the two does not depend on q.
  explicit LinkFrames(const Chain& chain) {
    Pose link = Pose::Identity(), joint = Pose::Identity();
    for (const Segment& s : chain.segments()) {
      link = link * s.origin;
      if (s.type != JointType::Fixed) {
        const JointConstants& c = chain.constants()[static_cast<std::size_t>(joints.back())];
        joint.translate(c.translation).rotate(c.rotation);
      }
      joints.push_back(joints.back() + (s.type != JointType::Fixed ? 1 : 0));
      in_joint.push_back(joint.inverse() * link);
    }
  }
};

}  // namespace sigmaik::detail
