#pragma once
// The methods that every test of "each method" goes through. A new rule joins by being in sigmaik::Rules.

#include <vector>

#include <sigmaik/rules.hpp>

namespace test {

/// Every rule of the library, with the parameters that it comes with.
inline std::vector<sigmaik::Method> library_methods() {
  std::vector<sigmaik::Method> out;
  sigmaik::Rules::for_each([&](const auto& rule) { out.emplace_back(rule); });
  return out;
}

/// The library's methods, and the others of their modes.
inline std::vector<sigmaik::Method> all_methods() {
  using namespace sigmaik;
  std::vector<Method> out = library_methods();
  out.emplace_back(AdaptiveDampedLeastSquares{DampingRule::Manipulability});
  out.emplace_back(AdaptiveDampedLeastSquares{DampingRule::SmallestSingularValue});
  out.emplace_back(JParse{0.2, 2.0, 0.5, true});
  out.emplace_back(JParse{0.2, 2.0, 0.5, false});
  return out;
}

}  // namespace test
