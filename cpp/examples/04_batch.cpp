// A hundred thousand problems at once, on every core. The same as 04_batch.py.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <random>
#include <thread>
#include <vector>

#include <sigmaik/sigmaik.hpp>

int main(int argc, char** argv) try {
  if (argc != 2) return std::fprintf(stderr, "usage: %s ROBOT.urdf\n", argv[0]), 2;
  const auto arm = sigmaik::Chain::from_urdf(argv[1]);
  const int n = arm.dof();
  constexpr std::size_t kCount = 100'000;
  std::mt19937_64 random(0);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);

  std::vector<double> jacobian, twist(kCount * 6), qdot(kCount * static_cast<std::size_t>(n));
  sigmaik::ChainState state;
  for (std::size_t b = 0; b < kCount; ++b) {
    update(arm, sigmaik::JointVector::NullaryExpr(n, [&] { return 3.0 * uniform(random); }), state);
    for (int row = 0; row < 6; ++row) {
      for (int column = 0; column < n; ++column) jacobian.push_back(state.jacobian(row, column));
    }
  }
  std::generate(twist.begin(), twist.end(), [&] { return uniform(random); });

  const int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  const auto start = std::chrono::steady_clock::now();
  sigmaik::solve_batch(sigmaik::JParse{}, 1.0, {kCount, 6, n}, jacobian.data(), twist.data(), qdot.data(), nullptr,
                       threads);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  const double fastest = std::abs(
      *std::max_element(qdot.begin(), qdot.end(), [](double a, double b) { return std::abs(a) < std::abs(b); }));
  std::printf("%.2f million solves a second, largest joint speed %.1f rad/s\n", 1e-6 * kCount / seconds.count(),
              fastest);
  return 0;
} catch (const sigmaik::Error& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
