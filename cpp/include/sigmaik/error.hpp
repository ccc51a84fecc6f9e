#pragma once
/// \file error.hpp

#include <stdexcept>
#include <string>

namespace sigmaik {

/// Thrown while setting up, never from the loop. The text carries the facts: which joint, which value,
/// which rule. In Python: sigmaik.Error, a ValueError.
class Error : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

}  // namespace sigmaik
