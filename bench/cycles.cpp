// A number of control cycles and nothing else, for callgrind: the instructions of a run with 2 N cycles, less those of
// one with N, over N, are those of a cycle.
#include <cstdio>
#include <cstdlib>

#include "scene.hpp"

int main(int argc, char** argv) {
  if (argc != 2) return std::fprintf(stderr, "usage: %s CYCLES\n", argv[0]), 2;
  sigmaik::Servo servo = bench::scene().servo();
  double sum = 0.0;
  for (int i = 0; i < std::atoi(argv[1]); ++i) sum += servo.update(bench::scene().pose[i & (bench::kPath - 1)]).qdot[0];
  std::printf("%g\n", sum);
}
