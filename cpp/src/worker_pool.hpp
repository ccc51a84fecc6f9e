#pragma once
// Threads that stay, and share ranges of independent pieces of work.

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <thread>
#include <vector>

namespace sigmaik::detail {

// Worker w of W does [count·w/W, count·(w+1)/W), and the caller is worker 0: who does what does not depend on timing.
class WorkerPool {
 public:
  // At most `threads` workers, the caller included, and not more than the machine has cores: more gain nothing.
  explicit WorkerPool(int threads) {
    const unsigned cores = threads == 1 ? 1u : std::max(1u, std::thread::hardware_concurrency());
    const std::size_t workers = std::min(static_cast<std::size_t>(threads), std::size_t{cores});
    threads_.reserve(workers - 1);
    try {
      for (std::size_t w = 1; w < workers; ++w) threads_.emplace_back([this, w] { serve(w); });
    } catch (const std::exception&) {  // the system gives no more threads, or no memory for them
    }
  }
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;
  ~WorkerPool() {
    task_ = Task{};
    call();
    for (std::thread& thread : threads_) thread.join();
  }

  // Number of workers, the caller of run() included.
  std::size_t size() const noexcept { return threads_.size() + 1; }

  // Calls work(begin, end) so that all of [0, count) is done, and returns when it is. No heap. One caller at a time.
  template <typename Work>
  void run(std::size_t count, const Work& work) noexcept {
    if (threads_.empty()) return work(std::size_t{0}, count);
    task_ = {
        [](const void* what, std::size_t begin, std::size_t end) { (*static_cast<const Work*>(what))(begin, end); },
        &work, count, size()};
    left_.store(threads_.size(), std::memory_order_relaxed);
    call();
    part(0);
    for (std::size_t left = left_.load(std::memory_order_acquire); left != 0;
         left = left_.load(std::memory_order_acquire)) {
      left_.wait(left, std::memory_order_acquire);
    }
  }

 private:
  struct Task {
    void (*run)(const void*, std::size_t, std::size_t) = nullptr;  // null: the threads end
    const void* work = nullptr;
    std::size_t count = 0, workers = 1;
  };

  void call() noexcept {
    call_.fetch_add(1, std::memory_order_release);
    call_.notify_all();
  }
  void part(std::size_t worker) noexcept {
    task_.run(task_.work, task_.count * worker / task_.workers, task_.count * (worker + 1) / task_.workers);
  }
  void serve(std::size_t worker) noexcept {
    for (std::uint32_t seen = 0;;) {
      call_.wait(seen, std::memory_order_acquire);
      const std::uint32_t now = call_.load(std::memory_order_acquire);
      if (now == seen) continue;
      seen = now;
      if (task_.run == nullptr) return;
      part(worker);
      if (left_.fetch_sub(1, std::memory_order_acq_rel) == 1) left_.notify_one();
    }
  }

  std::vector<std::thread> threads_;
  Task task_;
  std::atomic<std::uint32_t> call_{0};
  std::atomic<std::size_t> left_{0};
};

}  // namespace sigmaik::detail
