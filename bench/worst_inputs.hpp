#pragma once
// The slowest cycles that sigmaik_worst_case has found.

#include <string>
#include <vector>

#include "worst_case.hpp"

namespace bench {

struct Kept {
  int joints;
  const char* genes;  // two hexadecimal digits each
};

inline const std::vector<Kept> kWorst = {
    {16, "424e05eadf18bcb4003c021b6566b9514cbad1d1d1634ae3071a4b2f32caa7b59714edbc12132ad38bdac094fbe4726f7e9c7f6464618cde2c07da3e5bb55c40cff5ed4fb29249bc2c2d3cd0550d53715af9bba1bed7b3ea638cbed6ba3c9f0274abe81f9fde674c165eeaee798f6113a8cf8cd8e102eb185606204d3ce770a8781b23940f6b4ea649b35f58cf0dca0432bf4febf0ecf59a57b11c26c91dee8ab5c8"},
};

inline Genome genome_of(const Kept& kept) {
  const std::string text = kept.genes;
  Genome genome;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2) {
    genome.push_back(static_cast<std::uint8_t>(std::stoi(text.substr(i, 2), nullptr, 16)));
  }
  return genome;
}

}  // namespace bench
