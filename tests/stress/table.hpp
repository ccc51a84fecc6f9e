#pragma once
// The counts of a stress program as lines of CSV, which `sigmaik stress` adds up: one line for each property.

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

namespace stress {

/// Prints the names of the columns.
inline void print_head() { std::printf("property,of,cases,failed,worst,again\n"); }

/// Prints a property.
/// \param of what a case is
/// \param worst the largest value seen, in the unit that the property says; 0 where there is none
/// \param again numbers of episodes that failed; the first ten are printed
template <typename Number>
void print_row(const std::string& property, const char* of, long cases, long failed, double worst,
               const std::vector<Number>& again) {
  std::printf("%s,%s,%ld,%ld,%.17g,", property.c_str(), of, cases, failed, worst);
  for (std::size_t i = 0; failed != 0 && i < std::min<std::size_t>(10, again.size()); ++i) {
    std::printf(i > 0 ? " %lu" : "%lu", static_cast<unsigned long>(again[i]));
  }
  std::printf("\n");
}

/// Whether the first argument asks for this table; takes the argument away.
inline bool takes_table(int& argc, char**& argv) {
  if (argc < 2 || std::string(argv[1]) != "--table") return false;
  --argc;
  ++argv;
  return true;
}

}  // namespace stress
