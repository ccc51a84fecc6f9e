// Newton steps of position_ik.hpp, with the second derivatives of the pose.

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Cholesky>

#include "position_ik_descent.hpp"

namespace sigmaik::detail {
namespace {

// ½ of the second derivative of E, in units of `scale` of each joint. With the twist s_k of joint k at the tip, and E's
// derivatives −f and K with respect to the tip's twist,
//     ½ ∂²E/∂q_k∂q_l = s_kᵀ K s_l − fᵀ ½ (∂s_k/∂q_l + ∂s_l/∂q_k)
JointMatrix curvature(const Chain& chain, const DescentPoint& point, const JointVector& scale, const Row6& force,
                      const Matrix6& stiffness) noexcept {
  const Jacobian& jacobian = point.state.jacobian;
  const Eigen::Index n = jacobian.cols();
  JacobianGradient gradient;
  jacobian_gradient(chain, point.q, jacobian, gradient);
  const Eigen::Vector3d linear = force.head<3>(), angular = 0.5 * force.tail<3>();
  JointMatrix h(n, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const Row6 stiff = stiffness * jacobian.col(k);
    const Jacobian& of_k = gradient[static_cast<std::size_t>(k)];
    for (Eigen::Index l = 0; l <= k; ++l) {
      const Jacobian& of_l = gradient[static_cast<std::size_t>(l)];
      const double bend = linear.dot(of_k.col(l).head<3>()) +
                          angular.dot(of_k.col(l).tail<3>() + of_l.col(k).tail<3>());
      h(k, l) = h(l, k) = scale[k] * scale[l] * (stiff.dot(jacobian.col(l)) - bend);
    }
  }
  return h;
}

using Factor = Eigen::LLT<JointMatrix>;
constexpr int kTries = 64;  // of λ, each four times the one before

// The rows and columns of h that are free, with λ on the diagonal, factorised. λ grows until the matrix is positive.
bool factorise(const JointMatrix& h, const std::array<int, kMaxJoints>& free, int count, double& lambda,
               Factor& out) noexcept {
  JointMatrix part(count, count);
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < count; ++j) {
      part(i, j) = h(free[static_cast<std::size_t>(i)], free[static_cast<std::size_t>(j)]);
    }
  }
  for (int i = 0; i < kTries; ++i) {
    JointMatrix damped = part;
    damped.diagonal().array() += lambda;
    out.compute(damped);
    if (out.info() == Eigen::Success) return true;
    lambda *= 4.0;
  }
  return false;
}

}  // namespace

// Minimises the quadratic model of E plus λ |Δq|²_W inside the limits, by the active set of step(). Joints at a limit
// that the gradient pushes further are fixed from the start (Bertsekas, 1982): E may be concave along these, and a λ
// that is large for their sake would slow the others down. The method of Levenberg and Marquardt leaves the second
// derivatives out, which is right where the error goes to zero quickly. At a singularity the second derivatives are
// what moves the tip along the lost direction, and at a pose out of reach the error does not go to zero.
JointVector Descent::curved_step(const DescentPoint& point, double damping, double& expected) const noexcept {
  const int n = static_cast<int>(point.q.size());
  const JointVector scale = problem_.reach.cwiseSqrt();
  const Pose& tip = point.state.tip;
  const Row6 force = problem_.rows.force(tip, target_, shift_);
  const JointMatrix h = curvature(problem_.chain, point, scale, force, problem_.rows.stiffness(tip, target_, shift_));
  const JointVector slope = scale.cwiseProduct(point.state.jacobian.transpose() * force);
  double lambda = damping + 1e-13 * std::max(h.diagonal().cwiseAbs().sum(), 1e-280);

  JointVector move = JointVector::Zero(n), next = point.q;  // `move` in units of `scale`
  std::uint32_t fixed = 0;
  for (int i = 0; i < n; ++i) {
    const bool pushed = slope[i] > 0.0 ? point.q[i] >= problem_.upper[i] : point.q[i] <= problem_.lower[i];
    if (pushed && slope[i] != 0.0) fixed |= 1u << i;
  }
  for (;;) {
    std::array<int, kMaxJoints> free;
    int count = 0;
    for (int i = 0; i < n; ++i) {
      if ((fixed >> i & 1u) == 0) free[static_cast<std::size_t>(count++)] = i;
    }
    if (count == 0) break;
    JointVector right(count);
    for (int i = 0; i < count; ++i) {
      const int joint = free[static_cast<std::size_t>(i)];
      right[i] = slope[joint];
      for (int k = 0; k < n; ++k) {
        if ((fixed >> k & 1u) != 0) right[i] -= h(joint, k) * move[k];
      }
    }
    Factor factor(count);
    if (!factorise(h, free, count, lambda, factor)) break;
    const JointVector z = factor.solve(right);
    bool inside = true;
    for (int i = 0; i < count; ++i) {
      const int joint = free[static_cast<std::size_t>(i)];
      const double wanted = point.q[joint] + scale[joint] * z[i];
      next[joint] = std::clamp(wanted, problem_.lower[joint], problem_.upper[joint]);
      move[joint] = (next[joint] - point.q[joint]) / scale[joint];
      if (next[joint] == wanted) continue;
      fixed |= 1u << joint;
      inside = false;
    }
    if (inside) break;
  }
  expected = point.cost - 2.0 * slope.dot(move) + move.dot(h * move);
  return next;
}

}  // namespace sigmaik::detail
