#pragma once
// What a cycle makes of a matrix that a caller gives as a pose.

#include <sigmaik/pose.hpp>

namespace sigmaik::detail {

// is_pose(), is_rough() and nearest_pose(), from one RᵀR.
struct AskedPose {
  bool valid = false;
  bool rough = false;
  Pose pose;  // the nearest pose; as asked where that is none

  explicit AskedPose(const Pose& asked) noexcept;
};

}  // namespace sigmaik::detail
