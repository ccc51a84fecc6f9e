#include "joint_weights.hpp"

#include <algorithm>

#include <Eigen/Cholesky>

namespace sigmaik::detail {

void WeightedDirections::add(const Spectrum& spectrum, const Resolution& resolution) noexcept {
  for (int i = 0; i < spectrum.size() && count_ < kMaxTask; ++i) {
    const double weight = resolution.weight[static_cast<std::size_t>(i)], sigma = spectrum.sigma(i);
    v_.col(count_).head(spectrum.cols()) = spectrum.v(i);
    part_[static_cast<std::size_t>(count_++)] = weight > sigma ? sigma / weight : sigma > 0.0 ? 1.0 : 0.0;
  }
}

// T z of joint_weights.hpp.
TaskVector WeightedDirections::solve(const JointVector& lightness, const TaskVector& y) const noexcept {
  const auto n = lightness.size();
  TaskMatrix m(count_, count_);
  TaskVector right(count_);
  for (int i = 0; i < count_; ++i) {
    const double t = part_[static_cast<std::size_t>(i)];
    const JointVector light = lightness.cwiseProduct(v_.col(i).head(n));
    for (int j = 0; j < count_; ++j) m(i, j) = t * part_[static_cast<std::size_t>(j)] * light.dot(v_.col(j).head(n));
    m(i, i) += 1.0 - t * t;
    right[i] = t * y[i];
  }
  // Positive definite: the least eigenvalue is at least the least lightness where V is orthonormal.
  TaskVector z = Eigen::LLT<TaskMatrix>(m).solve(right);
  for (int i = 0; i < count_; ++i) z[i] *= part_[static_cast<std::size_t>(i)];
  return z;
}

JointVector WeightedDirections::prefer(const JointVector& qdot, const JointRef& posture,
                                       const JointVector& lightness) const noexcept {
  const auto n = qdot.size();
  const JointVector own = posture.size() != 0 ? JointVector(qdot - posture) : qdot;
  const auto v = v_.topLeftCorner(n, count_);
  const TaskVector y = v.transpose().lazyProduct(own);
  const JointVector even = JointVector::Ones(n);
  const JointVector weighted = lightness.cwiseProduct(JointVector(v.lazyProduct(solve(lightness, y))));
  const JointVector plain = v.lazyProduct(solve(even, y));
  const JointVector answer = qdot + (weighted - plain);
  return answer.allFinite() ? answer : qdot;
}

}  // namespace sigmaik::detail
