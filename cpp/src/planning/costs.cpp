#include <sigmaik/planning/costs.hpp>

#include <cmath>

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
  PotentialCost(const SingularSets& sets, const Potential& potential, double weight) : sets_(sets), potential_(potential) {
    require_positive("weight", weight);
    require_positive("eta2", potential.eta2);
    require(std::isfinite(potential.eta1) && potential.eta1 <= 100.0, "eta1 = ", potential.eta1, " must be at most 100");
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

// From m with its derivatives to weight/(m + ε) with its own.
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
    constexpr double kStep = 1e-5;  // [rad or m]
    const int n = dof();
    const double m = index_.value(chain_, q, gradient);
    JointVector moved = q, up(n), down(n);
    hessian.resize(n, n);
    for (int k = 0; k < n; ++k) {
      moved[k] = q[k] + kStep;
      index_.value(chain_, moved, up);
      moved[k] = q[k] - kStep;
      index_.value(chain_, moved, down);
      moved[k] = q[k];
      hessian.col(k) = (up - down) / (2.0 * kStep);
    }
    hessian = (0.5 * (hessian + hessian.transpose())).eval();
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

}  // namespace sigmaik::planning
