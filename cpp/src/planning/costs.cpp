#include <sigmaik/planning/costs.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include <sigmaik/indices.hpp>

#include "../message.hpp"

namespace sigmaik::planning {
namespace {

using sigmaik::detail::require;

void require_positive(const char* name, double value) {
  require(std::isfinite(value) && value > 0.0, name, " = ", value, " must be finite and greater than 0");
}

class PotentialCost final : public JointCost {
 public:
  PotentialCost(const SingularSets& sets, const Potential& potential, double weight)
      : sets_(sets), potential_(potential) {
    require_positive("weight", weight);
    require_positive("eta2", potential.eta2);
    require(std::isfinite(potential.eta1) && potential.eta1 <= 100.0, "eta1 = ", potential.eta1,
            " must be at most 100");
    for (double& w : potential_.weights) {
      require(std::isfinite(w) && w >= 0.0, "a set's weight is ", w, "; it must be finite and not negative");
      w *= weight;
    }
  }
  int dof() const noexcept override { return sets_.dof(); }
  double value(const JointRef& q) const noexcept override { return sets_.potential(q, potential_); }
  double model(const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept override {
    return sets_.potential(q, potential_, gradient, hessian);
  }
  double gradient(const JointRef& q, JointVector& gradient) const noexcept override {
    return sets_.potential(q, potential_, gradient);
  }

 private:
  SingularSets sets_;
  Potential potential_;
};

// Turns m and its derivatives into weight/(m + ε) and its derivatives.
class InverseCost : public JointCost {
 public:
  InverseCost(double weight, double epsilon) : weight_(weight), epsilon_(epsilon) {
    require_positive("weight", weight);
    require_positive("epsilon", epsilon);
  }

 protected:
  double invert(double m) const noexcept { return weight_ / (m + epsilon_); }
  double invert(double m, JointVector& gradient, JointMatrix& hessian) const noexcept {
    const double inverse = 1.0 / (m + epsilon_), slope = -weight_ * inverse * inverse;
    hessian *= slope;
    hessian.noalias() += (-2.0 * slope * inverse * gradient) * gradient.transpose();
    gradient *= slope;
    return weight_ * inverse;
  }
  double invert(double m, JointVector& gradient) const noexcept {
    const double inverse = 1.0 / (m + epsilon_);
    gradient *= -weight_ * inverse * inverse;
    return weight_ * inverse;
  }

 private:
  double weight_, epsilon_;
};

class ClosedFormCost final : public InverseCost {
 public:
  ClosedFormCost(const SingularSets& sets, double weight, double epsilon) : InverseCost(weight, epsilon), sets_(sets) {}
  int dof() const noexcept override { return sets_.dof(); }
  double value(const JointRef& q) const noexcept override { return invert(sets_.manipulability(q)); }
  double model(const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept override {
    const double m = sets_.manipulability(q, gradient, hessian);
    return invert(m, gradient, hessian);
  }
  double gradient(const JointRef& q, JointVector& gradient) const noexcept override {
    const double m = sets_.manipulability(q, gradient);
    return invert(m, gradient);
  }

 private:
  SingularSets sets_;
};

// The Hessian (n, n), symmetric, by differences of slope(q, gradient).
template <typename Slope>
void difference_hessian(const JointRef& q, JointMatrix& hessian, Slope slope) noexcept {
  constexpr double kStep = 1e-5;  // [rad or m]
  const Eigen::Index n = q.size();
  JointVector moved = q, up(n), down(n);
  hessian.resize(n, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    moved[k] = q[k] + kStep;
    slope(moved, up);
    moved[k] = q[k] - kStep;
    slope(moved, down);
    moved[k] = q[k];
    hessian.col(k) = (up - down) / (2.0 * kStep);
  }
  hessian = (0.5 * (hessian + hessian.transpose())).eval();
}

class GenericCost final : public InverseCost {
 public:
  GenericCost(const Chain& chain, double weight, double epsilon)
      : InverseCost(weight, epsilon), chain_(chain), index_(Index::Manipulability) {}
  int dof() const noexcept override { return chain_.dof(); }
  double value(const JointRef& q) const noexcept override {
    ChainState state;
    update(chain_, q, state);
    return invert(index_.value(state.jacobian));
  }
  double model(const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept override {
    const double m = index_.value(chain_, q, gradient);
    difference_hessian(q, hessian, [this](const JointVector& x, JointVector& g) { index_.value(chain_, x, g); });
    return invert(m, gradient, hessian);
  }
  double gradient(const JointRef& q, JointVector& gradient) const noexcept override {
    const double m = index_.value(chain_, q, gradient);
    return invert(m, gradient);
  }

 private:
  Chain chain_;
  IndexFunction index_;
};

// weight · f(index), where derived classes give the value and the slope of f.
class IndexCost : public JointCost {
 public:
  IndexCost(const Chain& chain, const IndexFunction& index, double weight)
      : chain_(chain), index_(index), weight_(weight) {
    require_positive("weight", weight);
  }
  int dof() const noexcept override { return chain_.dof(); }
  double value(const JointRef& q) const noexcept override {
    ChainState state;
    update(chain_, q, state);
    double ignored;
    return weight_ * shape(index_.value(state.jacobian), ignored);
  }
  double gradient(const JointRef& q, JointVector& slope) const noexcept override {
    double factor;
    const double value = shape(index_.value(chain_, q, slope), factor);
    slope *= weight_ * factor;
    return weight_ * value;
  }
  double model(const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept override {
    difference_hessian(q, hessian, [this](const JointVector& x, JointVector& g) { this->gradient(x, g); });
    return this->gradient(q, gradient);
  }

 protected:
  virtual double shape(double index, double& slope) const noexcept = 0;

 private:
  Chain chain_;
  IndexFunction index_;
  double weight_;
};

class GeometryAwareCost final : public IndexCost {
 public:
  GeometryAwareCost(const Chain& chain, double k, double weight, double most)
      : IndexCost(chain, IndexFunction(Index::GeometryAware, {.k = k}), weight), most_(most) {
    require_positive("most", most);
  }

 private:
  double shape(double index, double& slope) const noexcept override {
    slope = index < most_ ? 1.0 : 0.0;
    return std::min(index, most_);
  }
  double most_;
};

class LogManipulabilityCost final : public IndexCost {
 public:
  LogManipulabilityCost(const Chain& chain, double weight)
      : IndexCost(chain, IndexFunction(Index::Manipulability), weight) {}

 private:
  double shape(double index, double& slope) const noexcept override {
    constexpr double kLeast = 1e-9;
    slope = index > kLeast ? -1.0 / index : 0.0;
    return -std::log(std::max(index, kLeast));
  }
};

class ScaledCost final : public JointCost {
 public:
  ScaledCost(double factor, JointCostPtr cost) : factor_(factor), cost_(std::move(cost)) {
    require(std::isfinite(factor) && factor >= 0.0, "a cost times ", factor,
            ": the factor must be finite and not below 0");
    require(cost_ != nullptr, "there is no cost to scale");
  }
  int dof() const noexcept override { return cost_->dof(); }
  double value(const JointRef& q) const noexcept override { return factor_ * cost_->value(q); }
  double gradient(const JointRef& q, JointVector& slope) const noexcept override {
    const double value = cost_->gradient(q, slope);
    slope *= factor_;
    return factor_ * value;
  }
  double model(const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept override {
    const double value = cost_->model(q, gradient, hessian);
    gradient *= factor_;
    hessian *= factor_;
    return factor_ * value;
  }

 private:
  double factor_;
  JointCostPtr cost_;
};

class SumCost final : public JointCost {
 public:
  explicit SumCost(std::vector<JointCostPtr> costs) : costs_(std::move(costs)) {
    require(!costs_.empty(), "there is no cost to add up");
    for (const JointCostPtr& cost : costs_) {
      require(cost != nullptr, "a cost is null");
      require(cost->dof() == dof(), "costs are for ", dof(), " and for ", cost->dof(), " joints");
    }
  }
  int dof() const noexcept override { return costs_.front()->dof(); }
  double value(const JointRef& q) const noexcept override {
    double sum = 0.0;
    for (const JointCostPtr& cost : costs_) sum += cost->value(q);
    return sum;
  }
  double gradient(const JointRef& q, JointVector& slope) const noexcept override {
    JointVector g(dof());
    double sum = costs_.front()->gradient(q, slope);
    for (std::size_t i = 1; i < costs_.size(); ++i) {
      sum += costs_[i]->gradient(q, g);
      slope += g;
    }
    return sum;
  }
  double model(const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept override {
    JointVector g(dof());
    JointMatrix h(dof(), dof());
    double sum = costs_.front()->model(q, gradient, hessian);
    for (std::size_t i = 1; i < costs_.size(); ++i) {
      sum += costs_[i]->model(q, g, h);
      gradient += g;
      hessian += h;
    }
    return sum;
  }

 private:
  std::vector<JointCostPtr> costs_;
};

}  // namespace

JointCostPtr potential_cost(const SingularSets& sets, const Potential& potential, double weight) {
  return std::make_shared<PotentialCost>(sets, potential, weight);
}

JointCostPtr manipulability_cost(const SingularSets& sets, double weight, double epsilon) {
  return std::make_shared<ClosedFormCost>(sets, weight, epsilon);
}

JointCostPtr manipulability_cost(const Chain& chain, double weight, double epsilon) {
  return std::make_shared<GenericCost>(chain, weight, epsilon);
}

JointCostPtr geometry_aware_cost(const Chain& chain, double k, double weight, double most) {
  return std::make_shared<GeometryAwareCost>(chain, k, weight, most);
}

JointCostPtr log_manipulability_cost(const Chain& chain, double weight) {
  return std::make_shared<LogManipulabilityCost>(chain, weight);
}

JointCostPtr scaled_cost(double factor, JointCostPtr cost) {
  return std::make_shared<ScaledCost>(factor, std::move(cost));
}

JointCostPtr sum_of_costs(std::vector<JointCostPtr> costs) {
  if (costs.size() == 1 && costs.front()) return costs.front();
  return std::make_shared<SumCost>(std::move(costs));
}

}  // namespace sigmaik::planning
