#pragma once
// On which side of each part of the forbidden region a cart's law of the least energy passes.

#include <optional>
#include <string>

#include <sigmaik/planning/cart.hpp>

namespace sigmaik::planning::detail {

/// A law, or why there is none.
struct Outcome {
  std::optional<CartFault> fault;
  std::string facts;
  CartLaw law;
};

/// The taut string on the best sides, by branch and bound, outside the circle of radius r, within the options' range,
/// speed and turn. Their limits of acceleration are not looked at.
Outcome best_sides(const PlanarPath& path, double start, double end, double r, const CartOptions& options);

}  // namespace sigmaik::planning::detail
