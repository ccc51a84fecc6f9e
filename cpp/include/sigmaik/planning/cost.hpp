#pragma once
/// \file cost.hpp
/// Costs that are combined before the arm is known:
///
///     Cost cost = costs::Potential{} + 2.0 * costs::Collision{field} + costs::JointLimits{};
///     Trajectory plan = time_optimal(arm, start, goal, cost);
///
/// A term is any type with `bind(chain)`, which makes a JointCost, or a BatchCost, of that chain's joints. So a new
/// cost is a struct of its own; costs/ has those of the library.

#include <concepts>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include <sigmaik/chain.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/planning/batch_cost.hpp>
#include <sigmaik/planning/joint_cost.hpp>

namespace sigmaik::planning {

/// A type that can be a term of a Cost.
template <typename T>
concept CostTerm = requires(const T& term, const Chain& chain) {
  { term.bind(chain) } -> std::convertible_to<BatchCostPtr>;
};

/// A weighted sum of terms. A value.
class Cost {
 public:
  /// The empty cost, which is zero.
  Cost() = default;
  /// One term. Implicit, so that terms add up.
  template <typename Term>
    requires(!std::same_as<Term, Cost> && CostTerm<Term>)
  Cost(Term term)
      : Cost(Bind([term = std::move(term)](const Chain& chain) -> BatchCostPtr { return term.bind(chain); })) {}
  /// An existing cost of one arm's joints.
  template <std::derived_from<BatchCost> Made>
  Cost(std::shared_ptr<Made> cost) {
    if (cost) parts_.push_back({1.0, [cost = BatchCostPtr(std::move(cost))](const Chain&) { return cost; }});
  }

  /// Whether the cost has no terms.
  bool empty() const noexcept { return parts_.empty(); }

  /// The sum for one arm: a JointCost where every term is one, null where there are no terms.
  /// \throws Error where a term does not fit the chain
  BatchCostPtr bind(const Chain& chain) const;
  /// The sum for planners that need Hessians.
  /// \throws Error also where a term is no JointCost
  JointCostPtr bind_smooth(const Chain& chain) const;

  /// Adds the parts of another cost.
  Cost& operator+=(const Cost& other);
  /// \throws Error where the factor is not finite or negative
  Cost& operator*=(double factor);

 private:
  using Bind = std::function<BatchCostPtr(const Chain&)>;
  explicit Cost(Bind bind) { parts_.push_back({1.0, std::move(bind)}); }

  struct Part {
    double factor;
    Bind bind;
  };
  std::vector<Part> parts_;
};

/// The sum of two costs.
inline Cost operator+(Cost a, const Cost& b) { return a += b; }
/// \throws Error where the factor is not finite or negative
inline Cost operator*(double factor, Cost cost) { return cost *= factor; }
/// The cost times a factor.
inline Cost operator*(Cost cost, double factor) { return cost *= factor; }

/// The library's terms.
namespace costs {
// The operator must be found for two terms of which neither is a Cost yet.
using planning::operator+;
using planning::operator*;
}  // namespace costs

SIGMAIK_SAME_LAYOUT(Cost);

}  // namespace sigmaik::planning
