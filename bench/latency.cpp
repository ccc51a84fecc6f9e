// How long one call can take: the loop of a controller, timed call by call, on one core while the other is idle, busy,
// or runs a second controller; flat out, and at 1 kHz. Prints percentiles and histograms; with a path, JSON too.
#include <pthread.h>
#include <sched.h>
#include <time.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "scene.hpp"

namespace {

using Clock = std::chrono::steady_clock;

bool pin(int core) {
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(static_cast<std::size_t>(core), &set);
  return pthread_setaffinity_np(pthread_self(), sizeof set, &set) == 0;
}

// A servo that follows a smooth motion at about 1 rad/s, posture and limit check included.
struct Controller {
  sigmaik::Servo servo = bench::scene().servo();
  std::size_t cycle = 0;

  sigmaik::ServoStep step() { return servo.update(bench::scene().pose[cycle++ & (bench::kPath - 1)]); }
};

// What goes on beside the loop.
class Neighbour {
 public:
  Neighbour(const std::string& kind, int core) {
    if (kind == "idle") return;
    thread_ = std::thread([this, kind, core] {
      pin(core);
      if (kind == "controller") {
        Controller controller;
        while (!stop_) sink_ = controller.step().qdot[0];
      } else {  // arithmetic, and memory beyond any cache
        std::vector<double> memory(1 << 23, 1.0);
        std::size_t at = 0;
        while (!stop_) {
          at = (at * 1664525 + 1013904223) & (memory.size() - 1);
          memory[at] = std::sqrt(memory[at] + 1.0);
          sink_ = memory[at];
        }
      }
    });
  }
  ~Neighbour() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }

 private:
  std::atomic<bool> stop_{false};
  std::atomic<double> sink_{0.0};
  std::thread thread_;
};

std::vector<double> flat_out(int calls) {
  Controller controller;
  std::vector<double> ns(static_cast<std::size_t>(calls));
  for (int i = 0; i < 2000; ++i) controller.step();
  for (double& time : ns) {
    const auto start = Clock::now();
    const volatile double keep = controller.step().qdot[0];
    (void)keep;
    time = std::chrono::duration<double, std::nano>(Clock::now() - start).count();
  }
  return ns;
}

std::vector<double> at_1_khz(int calls) {
  Controller controller;
  std::vector<double> ns(static_cast<std::size_t>(calls));
  timespec next;
  clock_gettime(CLOCK_MONOTONIC, &next);
  for (double& time : ns) {
    next.tv_nsec += 1'000'000;
    if (next.tv_nsec >= 1'000'000'000) {
      next.tv_nsec -= 1'000'000'000;
      ++next.tv_sec;
    }
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, nullptr);
    const auto start = Clock::now();
    const volatile double keep = controller.step().qdot[0];
    (void)keep;
    time = std::chrono::duration<double, std::nano>(Clock::now() - start).count();
  }
  return ns;
}

double percentile(const std::vector<double>& sorted, double p) {
  return sorted[static_cast<std::size_t>(p * static_cast<double>(sorted.size() - 1))];
}

// Counts per bin, ten bins a decade from 100 ns on.
std::vector<std::size_t> histogram(const std::vector<double>& ns) {
  std::vector<std::size_t> bins(41);
  for (const double time : ns) {
    const double bin = std::clamp(10.0 * std::log10(std::max(time, 1.0) / 100.0), 0.0, 40.0);
    ++bins[static_cast<std::size_t>(bin)];
  }
  return bins;
}

}  // namespace

int main(int argc, char** argv) {
  const int scale = argc > 2 ? std::max(1, std::atoi(argv[2])) : 1;
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  if (!pin(cores > 1 ? 1 : 0)) std::printf("the loop could not be pinned to a core\n");
  std::string json;
  std::printf("Servo::update(pose), J-PARSE, 7 joints, posture and limits; ns a call\n");
  std::printf("%-9s %-11s %9s %8s %8s %8s %9s %9s\n", "loop", "other core", "calls", "p50", "p99", "p99.9", "max",
              "p99.9/p50");
  std::vector<std::pair<std::string, std::vector<std::size_t>>> histograms;
  for (const char* rate : {"flat out", "1 kHz"}) {
    for (const char* other : {"idle", "busy", "controller"}) {
      if (cores < 2 && std::string(other) != "idle") continue;
      const Neighbour neighbour(other, 0);
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      std::vector<double> ns = std::string(rate) == "1 kHz" ? at_1_khz(3000 * scale) : flat_out(1'000'000 * scale);
      const auto bins = histogram(ns);
      std::sort(ns.begin(), ns.end());
      const double p50 = percentile(ns, 0.5), p99 = percentile(ns, 0.99), p999 = percentile(ns, 0.999);
      std::printf("%-9s %-11s %9zu %8.0f %8.0f %8.0f %9.0f %9.2f\n", rate, other, ns.size(), p50, p99, p999, ns.back(),
                  p999 / p50);
      std::fflush(stdout);
      char line[512];
      std::snprintf(line, sizeof line,
                    "%s  {\"loop\": \"%s\", \"other\": \"%s\", \"calls\": %zu, \"p50\": %.1f, \"p99\": %.1f, "
                    "\"p99.9\": %.1f, \"max\": %.1f, \"bins_per_decade_from_100_ns\": [",
                    json.empty() ? "" : ",\n", rate, other, ns.size(), p50, p99, p999, ns.back());
      json += line;
      for (std::size_t i = 0; i < bins.size(); ++i) json += (i > 0 ? ", " : "") + std::to_string(bins[i]);
      json += "]}";
      histograms.emplace_back(std::string(rate) + ", other core " + other, bins);
    }
  }
  for (const auto& [title, bins] : histograms) {
    std::printf("\n%s\n", title.c_str());
    for (std::size_t i = 0; i < bins.size(); ++i) {
      if (bins[i] == 0) continue;
      const int width = static_cast<int>(std::ceil(6.0 * std::log10(1.0 + static_cast<double>(bins[i]))));
      std::printf("%9.0f ns %9zu %s\n", 100.0 * std::pow(10.0, static_cast<double>(i) / 10.0), bins[i],
                  std::string(static_cast<std::size_t>(width), '#').c_str());
    }
  }
  if (argc > 1) std::ofstream(argv[1]) << "[\n" << json << "\n]\n";
  return 0;
}
