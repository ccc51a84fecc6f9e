// The slowest cycles of a servo, found by a search: hill climbing on counts of iterations, which have no noise.
//
//     sigmaik_worst_case search [joints] [evaluations] [restarts] [seed]   the worst input found, as a line for
//     worst_inputs.hpp sigmaik_worst_case                                                   the kept inputs: counts,
//     and times
//
// The times are processor times of the measured cycle alone, each the least of several repeats, because a machine does
// other things, too; beside them the same cycle of typical inputs.

#include <time.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>

#include <sigmaik/error.hpp>

#include "../cpp/src/work.hpp"
#include "worst_case.hpp"
#include "worst_inputs.hpp"

namespace {

using bench::Genome;
using sigmaik::detail::Work;
using sigmaik::detail::work;

// About the nanoseconds of one of each.
double weight(const Work& w) {
  return 300.0 * static_cast<double>(w.steps) + 100.0 * static_cast<double>(w.sweeps) +
         30.0 * static_cast<double>(w.evaluations);
}

Work counts(const Genome& genome, int joints) {
  try {
    bench::Cycle cycle = bench::decode(genome, joints);
    work = {};
    cycle.servo.update_twist(cycle.twist);
    return work;
  } catch (const sigmaik::Error&) {
    return {};
  }
}

double now() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e9 * static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_nsec);
}

// [ns] the least of `repeats`.
double time_of(const Genome& genome, int joints, int repeats) {
  const bench::Cycle cycle = bench::decode(genome, joints);
  double least = 1e300;
  for (int k = 0; k < repeats; ++k) {
    sigmaik::Servo servo = cycle.servo;
    const double start = now();
    const volatile double keep = servo.update_twist(cycle.twist).qdot[0];
    (void)keep;
    least = std::min(least, now() - start);
  }
  return least;
}

Genome random_genome(int joints, std::mt19937_64& engine) {
  Genome genome(bench::genome_size(joints));
  for (std::uint8_t& gene : genome) gene = static_cast<std::uint8_t>(engine());
  return genome;
}

Genome climb(int joints, long evaluations, std::mt19937_64& engine) {
  Genome best = random_genome(joints, engine);
  double most = weight(counts(best, joints));
  for (long k = 0; k < evaluations; ++k) {
    Genome next = best;
    for (auto changes = 1 + engine() % (k % 16 == 0 ? 24 : 3); changes > 0; --changes) {
      std::uint8_t& gene = next[engine() % next.size()];
      gene = static_cast<std::uint8_t>(engine() % 2 == 0 ? engine() : gene + engine() % 9 - 4);
    }
    const double now_most = weight(counts(next, joints));
    if (now_most < most) continue;  // what is equal may be a way on
    most = now_most;
    best = std::move(next);
  }
  return best;
}

void search(int joints, long evaluations, int restarts, unsigned seed) {
  std::mt19937_64 engine(seed);
  Genome worst;
  double most = -1.0;
  for (int k = 0; k < restarts; ++k) {
    Genome found = climb(joints, evaluations, engine);
    const double value = weight(counts(found, joints));
    std::fprintf(stderr, "%d joints, climb %d: %ld steps\n", joints, k, counts(found, joints).steps);
    if (value <= most) continue;
    most = value;
    worst = std::move(found);
  }
  const Work w = counts(worst, joints);
  std::printf("    // %ld steps in %ld problems, %ld sweeps, %ld evaluations\n    {%d, \"", w.steps, w.problems,
              w.sweeps, w.evaluations, joints);
  for (const std::uint8_t gene : worst) std::printf("%02x", gene);
  std::printf("\"},\n");
}

void report() {
  std::printf("%-28s %7s %9s %7s %12s %9s\n", "cycle", "steps", "problems", "sweeps", "evaluations", "time [us]");
  const auto row = [](const char* name, const Work& w, double ns) {
    std::printf("%-28s %7ld %9ld %7ld %12ld %9.1f\n", name, w.steps, w.problems, w.sweeps, w.evaluations, 1e-3 * ns);
  };
  for (const bench::Kept& kept : bench::kWorst) {
    const Genome genome = bench::genome_of(kept);
    row((std::to_string(kept.joints) + " joints, found by search").c_str(), counts(genome, kept.joints),
        time_of(genome, kept.joints, 300));
  }
  for (const int joints : {6, 7, 16}) {
    std::mt19937_64 engine(1);
    constexpr int kInputs = 5000;
    std::vector<double> times, weights;
    std::vector<Work> all;
    for (int k = 0; k < kInputs; ++k) {
      const Genome genome = random_genome(joints, engine);
      all.push_back(counts(genome, joints));
      times.push_back(time_of(genome, joints, 5));
    }
    Work mean;
    for (const Work& w : all) {
      mean.steps += w.steps;
      mean.problems += w.problems;
      mean.sweeps += w.sweeps;
      mean.evaluations += w.evaluations;
    }
    for (long Work::* n : {&Work::steps, &Work::problems, &Work::sweeps, &Work::evaluations}) mean.*n /= kInputs;
    double sum = 0.0;
    for (const double t : times) sum += t;
    const std::string name = std::to_string(joints) + " joints, random: ";
    row((name + "mean").c_str(), mean, sum / kInputs);
    std::sort(times.begin(), times.end());
    std::sort(all.begin(), all.end(), [](const Work& a, const Work& b) { return weight(a) < weight(b); });
    row((name + "p99.9").c_str(), all[kInputs * 999 / 1000], times[kInputs * 999 / 1000]);
    row((name + "worst").c_str(), all.back(), times.back());
  }
}

}  // namespace

int main(int argc, char** argv) {
  const auto number = [&](int i, long otherwise) { return argc > i ? std::atol(argv[i]) : otherwise; };
  if (argc > 1 && std::string(argv[1]) == "search") {
    search(static_cast<int>(number(2, 16)), number(3, 20000), static_cast<int>(number(4, 8)),
           static_cast<unsigned>(number(5, 1)));
  } else {
    report();
  }
}
