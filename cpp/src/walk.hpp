#pragma once
// The forward kinematics of a chain, from the base to the last joint, in one pass over the chain's constants.

#include <cmath>

#include <sigmaik/chain.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik::detail {

// Columns of a frame, padded to four entries so that they fill vector registers.
struct FrameColumns {
  Eigen::Vector4d x{1.0, 0.0, 0.0, 0.0}, y{0.0, 1.0, 0.0, 0.0}, z{0.0, 0.0, 1.0, 0.0}, p{0.0, 0.0, 0.0, 0.0};

  // Appends a transform that is given in this frame.
  void append(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) noexcept {
    p += along(translation);
    const Eigen::Vector4d new_x = along(rotation.col(0)), new_y = along(rotation.col(1));
    z = along(rotation.col(2));
    x = new_x;
    y = new_y;
  }

  // The position of a point that is given in this frame.
  Eigen::Vector4d at(const Eigen::Vector3d& point) const noexcept { return p + along(point); }

 private:
  template <typename Entries>
  Eigen::Vector4d along(const Entries& v) const noexcept {
    return v[0] * x + v[1] * y + v[2] * z;
  }
};

// Calls joint(i, frame) for each of moving() joints, from the base to the last joint; z of the frame lies along the
// joint's axis. Returns the frame of the last joint.
template <typename Visit>
FrameColumns walk(const Chain& chain, const JointRef& q, Visit joint) noexcept {
  const JointConstants* constants = chain.constants().data();
  const int n = chain.moving();
  const bool mimics = chain.has_mimics();
  FrameColumns f;
  for (int i = 0; i < n; ++i) {
    const JointConstants& c = constants[i];
    f.append(c.rotation, c.translation);
    double position = 0.0;
    if (mimics) {
      const Coupling& coupling = chain.couplings()[static_cast<std::size_t>(i)];
      position = coupling.multiplier * q[coupling.joint] + coupling.offset;
    } else {
      position = q[i];
    }
    if (c.prismatic) {
      f.p += position * f.z;
    } else {
      const double cosine = std::cos(position), sine = std::sin(position);
      const Eigen::Vector4d x = f.x;
      f.x = cosine * x + sine * f.y;
      f.y = cosine * f.y - sine * x;
    }
    joint(i, f);
  }
  return f;
}

}  // namespace sigmaik::detail
