#include <sigmaik/planning/joint_cost.hpp>

#include "../message.hpp"
#include "../ranges.hpp"

namespace sigmaik::planning {

double JointCost::gradient(const JointRef& q, JointVector& gradient) const noexcept {
  JointMatrix hessian(dof(), dof());
  return model(q, gradient, hessian);
}

void JointCost::evaluate(std::size_t count, const double* q, double* value, double* gradient) const noexcept {
  const int n = dof();
  JointVector slope(n);
  for (std::size_t b = 0; b < count; ++b) {
    const std::size_t at = b * static_cast<std::size_t>(n);
    const Eigen::Map<const Eigen::VectorXd> joints(q + at, n);
    if (gradient == nullptr) {
      value[b] = this->value(joints);
    } else {
      value[b] = this->gradient(joints, slope);
      Eigen::Map<Eigen::VectorXd>(gradient + at, n) = slope;
    }
  }
}

void evaluate(const JointCost& cost, std::size_t count, const double* q, double* value, double* gradient, int threads) {
  sigmaik::detail::require(threads >= 1, "threads = ", threads, " must be at least 1");
  const auto n = static_cast<std::size_t>(cost.dof());
  sigmaik::detail::split_range(count, threads, [&](std::size_t begin, std::size_t end) {
    cost.evaluate(end - begin, q + begin * n, value + begin, gradient == nullptr ? nullptr : gradient + begin * n);
  });
}

}  // namespace sigmaik::planning
