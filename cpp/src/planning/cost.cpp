#include <sigmaik/planning/cost.hpp>

#include <algorithm>
#include <cmath>

#include <sigmaik/planning/costs.hpp>

#include "../message.hpp"

namespace sigmaik::planning {
namespace {

using sigmaik::detail::require;

// A weighted sum of costs of which some have no Hessian.
class BatchSum final : public BatchCost {
 public:
  struct Part {
    double factor;
    BatchCostPtr cost;
  };
  explicit BatchSum(std::vector<Part> parts) : parts_(std::move(parts)) {}
  int dof() const noexcept override { return parts_.front().cost->dof(); }

  void evaluate(std::size_t count, const double* q, double* value, double* gradient) const override {
    const std::size_t slopes = gradient == nullptr ? 0 : count * static_cast<std::size_t>(dof());
    std::vector<double> v(count), g(slopes);
    std::fill(value, value + count, 0.0);
    std::fill(gradient, gradient + slopes, 0.0);
    for (const Part& part : parts_) {
      part.cost->evaluate(count, q, v.data(), gradient == nullptr ? nullptr : g.data());
      for (std::size_t i = 0; i < count; ++i) value[i] += part.factor * v[i];
      for (std::size_t i = 0; i < slopes; ++i) gradient[i] += part.factor * g[i];
    }
  }

 private:
  std::vector<Part> parts_;
};

}  // namespace

Cost& Cost::operator+=(const Cost& other) {
  parts_.insert(parts_.end(), other.parts_.begin(), other.parts_.end());
  return *this;
}

Cost& Cost::operator*=(double factor) {
  require(std::isfinite(factor) && factor >= 0.0, "a cost times ", factor,
          ": the factor must be finite and not negative");
  for (Part& part : parts_) part.factor *= factor;
  return *this;
}

BatchCostPtr Cost::bind(const Chain& chain) const {
  std::vector<JointCostPtr> smooth;
  std::vector<BatchSum::Part> others;
  for (const Part& part : parts_) {
    BatchCostPtr cost = part.bind(chain);
    require(cost != nullptr, "a cost is null");
    require(cost->dof() == chain.dof(), "the cost is for ", cost->dof(), " joints, the chain has ", chain.dof());
    JointCostPtr joint_cost = std::dynamic_pointer_cast<const JointCost>(cost);
    if (joint_cost == nullptr) {
      others.push_back({part.factor, std::move(cost)});
    } else if (part.factor == 1.0) {
      smooth.push_back(std::move(joint_cost));
    } else {
      smooth.push_back(scaled_cost(part.factor, std::move(joint_cost)));
    }
  }
  JointCostPtr sum = smooth.empty() ? nullptr : sum_of_costs(std::move(smooth));
  if (others.empty()) return sum;
  if (sum) others.insert(others.begin(), {1.0, std::move(sum)});
  return std::make_shared<BatchSum>(std::move(others));
}

JointCostPtr Cost::bind_smooth(const Chain& chain) const {
  const BatchCostPtr bound = bind(chain);
  JointCostPtr smooth = std::dynamic_pointer_cast<const JointCost>(bound);
  require(bound == nullptr || smooth != nullptr,
          "a time-optimal motion needs costs with a Hessian (JointCost); one of these has none");
  return smooth;
}

}  // namespace sigmaik::planning
