#include <sigmaik/planning/collision_costs.hpp>

#include <algorithm>
#include <cmath>

#include "../message.hpp"
#include "../numbers.hpp"
#include "../quasi_random.hpp"
#include "../ranges.hpp"

namespace sigmaik::planning {
namespace {

using sigmaik::detail::require;

using sigmaik::detail::kInfinity;

void require_positive(const char* name, double value) {
  require(std::isfinite(value) && value > 0.0, name, " = ", value, " must be finite and greater than 0");
}

// c(d), its slope, and the curvature of the Hessian.
struct Hinge {
  double value = 0.0, slope = 0.0, curvature = 0.0;
};

Hinge hinge(double distance, double clearance) noexcept {
  const double missing = clearance - distance;
  if (!(missing > 0.0)) return {};
  if (missing <= clearance) return {0.5 * missing * missing / clearance, -missing / clearance, 1.0 / clearance};
  return {missing - 0.5 * clearance, -1.0, 1.0 / missing};
}

// Gathers slopes with respect to the spheres' centres into a gradient in q. Σ_i f_iᵀ ∂c_i/∂q_k = z_kᵀ Σ_i (c_i − p_k) ×
// f_i, over the spheres i that joint k moves, is z_kᵀ(M − p_k × F) with running sums F = Σ f_i and M = Σ c_i × f_i from
// the tip.
class Gathered {
 public:
  explicit Gathered(const ArmSpheres& spheres) noexcept : spheres_(spheres) {
    for (int k = 0; k < spheres.chain().dof(); ++k) {
      force_[static_cast<std::size_t>(k)].setZero();
      moment_[static_cast<std::size_t>(k)].setZero();
    }
  }
  void add(int i, const SphereState& state, const Eigen::Vector3d& force) noexcept {
    if (spheres_.joints(i) == 0) return;
    const std::size_t last = static_cast<std::size_t>(spheres_.joints(i) - 1);
    force_[last] += force;
    moment_[last] += state.center[static_cast<std::size_t>(i)].cross(force);
  }
  void into(const SphereState& state, JointVector& gradient) const noexcept {
    Eigen::Vector3d force = Eigen::Vector3d::Zero(), moment = force;
    for (int k = spheres_.chain().dof() - 1; k >= 0; --k) {
      const std::size_t at = static_cast<std::size_t>(k);
      force += force_[at];
      moment += moment_[at];
      gradient[k] = spheres_.chain().constants()[at].prismatic
                        ? state.axis[at].dot(force)
                        : state.axis[at].dot(moment - state.origin[at].cross(force));
    }
  }

 private:
  const ArmSpheres& spheres_;
  std::array<Eigen::Vector3d, kMaxJoints> force_, moment_;
};

// hessian += weight · row rowᵀ, in the lower triangle of joints [first, last).
void add_square(const JointVector& row, double weight, int first, int last, JointMatrix& hessian) noexcept {
  for (int b = first; b < last; ++b) {
    const double scaled = weight * row[b];
    for (int a = b; a < last; ++a) hessian(a, b) += scaled * row[a];
  }
}

void mirror_lower(JointMatrix& hessian) noexcept {
  for (int b = 1; b < hessian.cols(); ++b) {
    for (int a = 0; a < b; ++a) hessian(a, b) = hessian(b, a);
  }
}

class SphereCost : public JointCost {
 public:
  SphereCost(const ArmSpheres& spheres, double clearance, double weight)
      : spheres_(spheres), clearance_(clearance), weight_(weight) {
    require_positive("clearance", clearance);
    require_positive("weight", weight);
  }
  int dof() const noexcept override { return spheres_.chain().dof(); }

  double gradient(const JointRef& q, JointVector& gradient) const noexcept override {
    return derivatives(q, gradient, nullptr);
  }
  double model(const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept override {
    hessian.setZero(dof(), dof());
    const double value = derivatives(q, gradient, &hessian);
    mirror_lower(hessian);
    return value;
  }

 protected:
  // Value and gradient; adds to the lower triangle of the Hessian where one is asked for.
  virtual double derivatives(const JointRef& q, JointVector& gradient, JointMatrix* hessian) const noexcept = 0;

  ArmSpheres spheres_;
  double clearance_, weight_;
};

class CollisionCost final : public SphereCost {
 public:
  CollisionCost(const ArmSpheres& spheres, const DistanceField& field, double clearance, double weight)
      : SphereCost(spheres, clearance, weight), field_(field) {
    require(spheres.first_moving() < spheres.size(), "no joint moves any of the ", spheres.size(), " spheres");
  }

  double value(const JointRef& q) const noexcept override {
    SphereState state;
    spheres_.update(q, state);
    double sum = 0.0;
    for (int i = spheres_.first_moving(); i < spheres_.size(); ++i) {
      sum += hinge(field_.distance(state.center[static_cast<std::size_t>(i)]) - spheres_.radius(i), clearance_).value;
    }
    return weight_ * sum;
  }

 private:
  double derivatives(const JointRef& q, JointVector& gradient, JointMatrix* hessian) const noexcept override {
    SphereState state;
    spheres_.update(q, state);
    Gathered gathered(spheres_);
    JointVector row(dof());
    Eigen::Vector3d slope;
    double sum = 0.0;
    for (int i = spheres_.first_moving(); i < spheres_.size(); ++i) {
      const double distance = field_.distance(state.center[static_cast<std::size_t>(i)], slope) - spheres_.radius(i);
      const Hinge h = hinge(distance, clearance_);
      if (h.slope == 0.0) continue;
      sum += h.value;
      gathered.add(i, state, weight_ * h.slope * slope);
      if (hessian == nullptr) continue;
      spheres_.row(i, state, slope, row);
      add_square(row, weight_ * h.curvature, 0, spheres_.joints(i), *hessian);
    }
    gradient.resize(dof());
    gathered.into(state, gradient);
    return weight_ * sum;
  }

  DistanceField field_;
};

class SelfCollisionCost final : public SphereCost {
 public:
  SelfCollisionCost(const ArmSpheres& spheres, const std::vector<SpherePair>& pairs, double clearance, double weight)
      : SphereCost(spheres, clearance, weight) {
    for (const SpherePair& pair : pairs) {
      for (const int i : pair) {
        require(i >= 0 && i < spheres.size(), "pair (", pair[0], ", ", pair[1], "): there is no sphere ", i,
                "; the arm has ", spheres.size());
      }
      const auto [near, far] = std::minmax(pair[0], pair[1]);
      require(spheres.joints(near) < spheres.joints(far), "pair (", pair[0], ", ", pair[1],
              "): no joint moves one of the spheres against the other");
      pairs_.push_back({near, far, spheres.radius(near) + spheres.radius(far)});
    }
  }

  double value(const JointRef& q) const noexcept override {
    SphereState state;
    spheres_.update(q, state);
    double sum = 0.0;
    for (const Pair& pair : pairs_) {
      const double square = way(pair, state).squaredNorm(), reach = pair.radii + clearance_;
      if (square < reach * reach) sum += hinge(std::sqrt(square) - pair.radii, clearance_).value;
    }
    return weight_ * sum;
  }

 private:
  struct Pair {
    int near, far;  // from the base
    double radii;   // [m] of both
  };

  Eigen::Vector3d way(const Pair& pair, const SphereState& state) const noexcept {
    return state.center[static_cast<std::size_t>(pair.far)] - state.center[static_cast<std::size_t>(pair.near)];
  }

  double derivatives(const JointRef& q, JointVector& gradient, JointMatrix* hessian) const noexcept override {
    SphereState state;
    spheres_.update(q, state);
    Gathered gathered(spheres_);
    JointVector row(dof());
    double sum = 0.0;
    for (const Pair& pair : pairs_) {
      Eigen::Vector3d slope = way(pair, state);
      const double square = slope.squaredNorm(), reach = pair.radii + clearance_;
      if (!(square < reach * reach)) continue;
      const double length = std::sqrt(square);
      if (length > 0.0) slope /= length;  // else the slope is zero: no direction out is better than another
      const Hinge h = hinge(length - pair.radii, clearance_);
      sum += h.value;
      gathered.add(pair.far, state, weight_ * h.slope * slope);
      gathered.add(pair.near, state, -weight_ * h.slope * slope);
      if (hessian == nullptr) continue;
      // Joints that move both spheres do not change their distance.
      spheres_.row(pair.far, state, slope, row);
      add_square(row, weight_ * h.curvature, spheres_.joints(pair.near), spheres_.joints(pair.far), *hessian);
    }
    gradient.resize(dof());
    gathered.into(state, gradient);
    return weight_ * sum;
  }

  std::vector<Pair> pairs_;
};

class JointLimitCost final : public JointCost {
 public:
  JointLimitCost(const Chain& chain, double margin, double weight)
      : lower_(chain.limits().lower.array() + margin), upper_(chain.limits().upper.array() - margin), weight_(weight) {
    require(std::isfinite(margin) && margin >= 0.0, "margin = ", margin, " must be finite and not negative");
    require_positive("weight", weight);
  }
  int dof() const noexcept override { return static_cast<int>(lower_.size()); }

  double value(const JointRef& q) const noexcept override {
    double sum = 0.0;
    for (int j = 0; j < dof(); ++j) {
      const double below = std::max(lower_[j] - q[j], 0.0), above = std::max(q[j] - upper_[j], 0.0);
      sum += below * below + above * above;
    }
    return 0.5 * weight_ * sum;
  }
  double gradient(const JointRef& q, JointVector& gradient) const noexcept override {
    gradient.resize(dof());
    for (int j = 0; j < dof(); ++j) {
      gradient[j] = weight_ * (std::max(q[j] - upper_[j], 0.0) - std::max(lower_[j] - q[j], 0.0));
    }
    return value(q);
  }
  double model(const JointRef& q, JointVector& slope, JointMatrix& hessian) const noexcept override {
    hessian.setZero(dof(), dof());
    for (int j = 0; j < dof(); ++j)
      hessian(j, j) = weight_ * ((q[j] < lower_[j] ? 1.0 : 0.0) + (q[j] > upper_[j] ? 1.0 : 0.0));
    return gradient(q, slope);
  }

 private:
  JointVector lower_, upper_;
  double weight_;
};

}  // namespace

JointCostPtr collision_cost(const ArmSpheres& spheres, const DistanceField& field, double clearance, double weight) {
  return std::make_shared<CollisionCost>(spheres, field, clearance, weight);
}

std::vector<SpherePair> self_collision_pairs(const ArmSpheres& spheres, double clearance, double most_contacts) {
  constexpr int kSamples = 1000;
  require(std::isfinite(clearance) && clearance >= 0.0, "clearance = ", clearance, " must be finite and not negative");
  require(most_contacts >= 0.0 && most_contacts <= 1.0, "most_contacts = ", most_contacts, " must be from 0 to 1");
  std::vector<SpherePair> candidates, pairs;
  for (int far = 0; far < spheres.size(); ++far) {
    for (int near = 0; near < far; ++near) {
      if (spheres.joints(far) - spheres.joints(near) >= 2) candidates.push_back({near, far});
    }
  }
  std::vector<int> contacts(candidates.size());
  const sigmaik::detail::QuasiRandom configurations(spheres.chain());
  SphereState state;
  for (int sample = 1; sample <= kSamples; ++sample) {
    spheres.update(configurations(sample), state);
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      const auto [near, far] = candidates[i];
      const double reach = spheres.radius(near) + spheres.radius(far) + clearance;
      const auto &a = state.center[static_cast<std::size_t>(near)], &b = state.center[static_cast<std::size_t>(far)];
      if ((a - b).squaredNorm() < reach * reach) ++contacts[i];
    }
  }
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (contacts[i] <= most_contacts * kSamples) pairs.push_back(candidates[i]);
  }
  return pairs;
}

JointCostPtr self_collision_cost(const ArmSpheres& spheres, const std::vector<SpherePair>& pairs, double clearance,
                                 double weight) {
  return std::make_shared<SelfCollisionCost>(spheres, pairs, clearance, weight);
}

JointCostPtr joint_limit_cost(const Chain& chain, double margin, double weight) {
  return std::make_shared<JointLimitCost>(chain, margin, weight);
}

double min_distance(const ArmSpheres& spheres, const DistanceField& field, const JointRef& q) noexcept {
  SphereState state;
  spheres.update(q, state);
  double least = kInfinity;
  for (int i = spheres.first_moving(); i < spheres.size(); ++i) {
    least = std::min(least, field.distance(state.center[static_cast<std::size_t>(i)]) - spheres.radius(i));
  }
  return least;
}

void min_distance(const ArmSpheres& spheres, const DistanceField& field, std::size_t count, const double* q,
                  double* distance, int threads) {
  require(threads >= 1, "threads = ", threads, " must be at least 1");
  const int n = spheres.chain().dof();
  sigmaik::detail::split_range(count, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      const Eigen::Map<const Eigen::VectorXd> joints(q + b * static_cast<std::size_t>(n), n);
      distance[b] = min_distance(spheres, field, joints);
    }
  });
}

}  // namespace sigmaik::planning
