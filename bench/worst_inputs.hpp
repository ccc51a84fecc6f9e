#pragma once
// The slowest cycles that sigmaik_worst_case has found.

#include <string>

#include "worst_case.hpp"

namespace bench {

struct Kept {
  int joints;
  const char* genes;  // two hexadecimal digits each
};

inline constexpr Kept kWorst[] = {
    // 214 steps where joints are held one by one, 155 where all joints beyond their bounds are held at once
    {16,
     "424e05eadf18bcb4003c021b6566b9514cbad1d1d1634ae3071a4b2f32caa7b59714edbc12132ad38bdac094fbe4726f7e9c"
     "7f6464618cde2c07da3e5bb55c40cff5ed4fb29249bc2c2d3cd0550d53715af9bba1bed7b3ea638cbed6ba3c9f0274abe81f"
     "9fde674c165eeaee798f6113a8cf8cd8e102eb185606204d3ce770a8781b23940f6b4ea649b35f58cf0dca0432bf4febf0ec"
     "f59a57b11c26c91dee8ab5c8"},
    {16,
     "5af36f9a3ef982e09f94f14250aa463fc55739c9fe649cd89c2392044eacfffc7a70db688dea2cd5429bae9aed72155c544c"
     "1f97e72881f32fc90c19f0487f048e0a2a1ffb7e711f43eb995c4bdb4118d63478b99c3368388504eee91636b3ad5dcaec66"
     "882c352290225edb6814589c0d38f99d402aa5cc6852ac7d7a84c72f2657259c4ef0513f5b0af71e8c17fac1232cd4d2c24d"
     "4bc89d5b8a5dfb598ba9ccca"},
    {7,
     "642e642baae370086ebec26842718d386d5d0565ebef89cad24ca737fde48312704ecba5900b19c6e6ce48812f0ea62e7702"
     "0e1809afc536f94c344c8072b3e98538010a73d90209b71e72852adeec02bb"},
    {6,
     "58cbf7fc0f3f776dc01d890a2b466db46bfc8c77e82a860e1b069c72ba7e9e50739c13ad151ddc7bddc1d5f37f8fb951b3ea"
     "aabf03a93b09f1df50535205af9d5a0bbd88974daf26"},
    {7,
     "424e98eec940e82b0315570c4ffdb3aa0deccf3dd97b3fe363a8496c07e2cf95d38c90bc14de83b8a3dbc0e5c3f98e9e4510"
     "7f0c6365bb071308ebd79a93d43f19edeab1b35e5ce08223bdcf5b744c257c"},
    {6,
     "784eba7b11e3232801142c2a18afb3bca2c3a51dca609a0d333745371cdca7967317c1c39d2fd0cafef7030efe9d8dfead50"
     "b96cbf199ac741031b35f77d8e402bfe5d4b3f151825"},
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
