#pragma once
// The closed form of six-joint arms whose axes 2, 3, 4 are parallel and whose axes 5 and 6 meet, such as Universal
// Robots' arms, for position_ik.cpp.
//
// The arm is a product of exponentials, T = e₁ e₂ e₃ e₄ e₅ e₆ M (Brockett 1984), with axes h_i and the tip's pose M at
// q = 0. With E = T M⁻¹ and the point W where axes 5 and 6 meet, E W = e₁ e₂ e₃ e₄ W. The subproblems are those of
// Elias and Wen, "IK-Geo: Unified robot inverse kinematics using subproblem decomposition" (Mechanism and Machine
// Theory 209, 2025), of arms with three parallel axes, h = h₂:
//
//     q1     hᵀ e₁⁻¹ E W = hᵀ W                                     nothing moves W along h but joint 1
//     q5     hᵀ R₁ᵀ R_E h₆ = hᵀ R₅ h₆                               joints 2, 3, 4 turn about h, joint 6 about h₆
//     q6     R₆ᵀ R₅ᵀ h = R_Eᵀ R₁ h
//     θ      the angle about h of R₁ᵀ R_E R₆ᵀ R₅ᵀ, which joints 2, 3, 4 make together
//     q2…q4  a planar arm of two links that ends at axis 4

#include <array>
#include <complex>
#include <optional>

#include <sigmaik/chain.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik::detail {

class ParallelAxes {
 public:
  // Nothing where the arm is of another kind.
  static std::optional<ParallelAxes> of(const Chain& chain);

  struct Solutions {
    int count = 0;
    bool singular = false;  // a joint was free, or two solutions are almost one: there are more than these
    std::array<JointVector, 8> q;
  };
  // Every solution [rad], joints on any turn and also outside the limits. Close to singularities the last digits are
  // missing. `free6`: joint 6 where it is free.
  Solutions solve(const Pose& pose, double free6) const noexcept;

 private:
  ParallelAxes() = default;
  void elbows(const Eigen::Vector3d& place, double theta, double q1, double q5, double q6,
              Solutions& out) const noexcept;
  std::complex<double> in_plane(const Eigen::Vector3d& v) const noexcept { return {x_.dot(v), y_.dot(v)}; }

  std::array<Eigen::Vector3d, 6> h_, o_;      // axes and points on them, in the base at q = 0
  Eigen::Vector3d meet_;                      // W
  Pose zero_inverse_;                         // M⁻¹
  Eigen::Vector3d x_, y_;                     // the plane normal to h
  double sign3_ = 1.0, sign4_ = 1.0;          // of axes 3 and 4 along h
  std::complex<double> upper_, fore_, hand_;  // links of the planar arm, and from axis 4 to W
};

}  // namespace sigmaik::detail
