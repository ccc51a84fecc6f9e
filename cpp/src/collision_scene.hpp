#pragma once
// What moves in the world of an arm: the poses of its obstacles, and the object that it carries. One writer at a time,
// any number of readers, and no reader waits: a reader that meets a writer keeps what it has, and asks again in its
// next cycle (a sequence lock, whose words are atomic).

#include <array>
#include <atomic>
#include <cstdint>
#include <mutex>

#include <sigmaik/collisions.hpp>

namespace sigmaik::detail {

struct MovingPose {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  // of the origin, base axes
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();      // [rad/s]
};

struct SceneState {
  std::array<MovingPose, kMaxObstacles> obstacles;
  std::array<Capsule, kMaxCarried> carried;  // in the tip's frame
  int carried_count = 0;
};

class Scene {
 public:
  // `obstacles`: how many poses there are.
  Scene(const SceneState& state, int obstacles) noexcept : state_(state), obstacles_(obstacles) { store(); }

  // Changes the state by change(state). Locks out other writers.
  template <typename Change>
  void write(Change change) {
    const std::lock_guard<std::mutex> lock(writing_);
    change(state_);
    store();
  }

  // Copies the state if it is not the one of `version`; real time. Returns whether it was copied.
  bool read(SceneState& state, std::uint64_t& version) const noexcept {
    for (int attempt = 0; attempt < 3; ++attempt) {
      const std::uint64_t before = version_.load(std::memory_order_acquire);
      if (before == version) return false;
      if ((before & 1u) != 0) continue;
      SceneState found;
      std::size_t at = 0;
      visit(found, [&](double& value) { value = words_[at++].load(std::memory_order_acquire); });
      found.carried_count = carried_count_.load(std::memory_order_acquire);
      if (version_.load(std::memory_order_relaxed) != before) continue;
      state = found;
      version = before;
      return true;
    }
    return false;
  }

 private:
  static constexpr std::size_t kWords = 18 * kMaxObstacles + 7 * kMaxCarried;

  template <typename State, typename Visit>
  void visit(State& state, Visit each) const noexcept {
    const auto all = [&each](auto& values) {
      for (Eigen::Index i = 0; i < values.size(); ++i) each(values.data()[i]);
    };
    for (std::size_t i = 0; i < static_cast<std::size_t>(obstacles_); ++i) {
      auto& pose = state.obstacles[i];
      all(pose.rotation);
      all(pose.translation);
      all(pose.velocity);
      all(pose.rate);
    }
    for (auto& capsule : state.carried) {
      all(capsule.a);
      all(capsule.b);
      each(capsule.radius);
    }
  }

  void store() noexcept {
    const std::uint64_t version = version_.load(std::memory_order_relaxed);
    version_.store(version + 1, std::memory_order_relaxed);
    std::size_t at = 0;
    // Each word is released after the odd version, so a reader that sees a new word sees that the version has changed.
    visit(state_, [&](const double& value) { words_[at++].store(value, std::memory_order_release); });
    carried_count_.store(state_.carried_count, std::memory_order_release);
    version_.store(version + 2, std::memory_order_release);
  }

  SceneState state_;
  int obstacles_;
  std::mutex writing_;
  std::atomic<std::uint64_t> version_{2};
  std::atomic<int> carried_count_{0};
  std::array<std::atomic<double>, kWords> words_{};
};

}  // namespace sigmaik::detail
