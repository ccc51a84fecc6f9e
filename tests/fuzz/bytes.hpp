#pragma once
// Turns the bytes of a fuzzer into numbers. Where the bytes end, every answer is zero.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>

#include <sigmaik/types.hpp>

namespace fuzz {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : at_(data), end_(data + size) {}

  bool empty() const { return at_ == end_; }
  unsigned byte() { return empty() ? 0U : *at_++; }
  bool one_in(unsigned n) { return byte() % n == 1; }
  /// low … high, both included.
  int integer(int low, int high) { return low + static_cast<int>(byte() % static_cast<unsigned>(high - low + 1)); }
  /// [0, 1]
  double unit() { return (256.0 * byte() + byte()) / 65535.0; }
  double uniform(double low, double high) { return low + (high - low) * unit(); }
  /// 10^low … 10^high
  double decades(double low, double high) { return std::pow(10.0, uniform(low, high)); }
  /// Any double: also NaN, ±∞, and the smallest and largest numbers.
  double any() {
    std::array<unsigned char, sizeof(double)> raw{};
    for (unsigned char& b : raw) b = static_cast<unsigned char>(byte());
    double value;
    std::memcpy(&value, raw.data(), sizeof value);
    return value;
  }
  /// Mostly within ±range, sometimes any().
  double number(double range) { return one_in(64) ? any() : uniform(-range, range); }

  sigmaik::Twist twist(double range) {
    sigmaik::Twist twist;
    for (double& x : twist) x = number(range);
    return twist;
  }
  Eigen::Matrix3d rotation(double angle) {
    Eigen::Vector3d turn(uniform(-1.0, 1.0), uniform(-1.0, 1.0), uniform(-1.0, 1.0));
    const double length = turn.norm();
    if (length == 0.0) return Eigen::Matrix3d::Identity();
    return Eigen::AngleAxisd(angle * length, turn / length).toRotationMatrix();
  }
  sigmaik::Pose pose(double range) {
    sigmaik::Pose pose = sigmaik::Pose::Identity();
    pose.linear() = rotation(3.0);
    for (int i = 0; i < 3; ++i) pose.translation()[i] = number(range);
    if (one_in(64)) pose.matrix()(integer(0, 2), integer(0, 3)) = any();
    return pose;
  }

 private:
  const std::uint8_t *at_, *end_;
};

/// Ends the program where a property does not hold, which a fuzzer reports with its input.
inline void demand(bool holds, const char* property) {
  if (holds) return;
  std::fprintf(stderr, "broken: %s\n", property);
  std::abort();
}

}  // namespace fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
