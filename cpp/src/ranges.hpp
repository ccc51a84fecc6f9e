#pragma once
// A range of independent pieces of work, split among threads.

#include <algorithm>
#include <cstddef>
#include <system_error>
#include <thread>
#include <vector>

namespace sigmaik::detail {

// Calls work(begin, end) so that all of [0, count) is done, by at most `threads` threads at once, this one included.
template <typename Work>
void split_range(std::size_t count, int threads, const Work& work) {
  // More threads than cores gain nothing. The question costs microseconds.
  const unsigned cores = threads == 1 ? 1u : std::max(1u, std::thread::hardware_concurrency());
  const std::size_t workers = std::min({static_cast<std::size_t>(threads), count, std::size_t{cores}});
  if (workers <= 1) return work(std::size_t{0}, count);
  std::vector<std::thread> pool;
  pool.reserve(workers - 1);
  const auto part = [&](std::size_t w) { return count * w / workers; };
  std::size_t started = 1;
  try {
    for (; started < workers; ++started) pool.emplace_back(work, part(started), part(started + 1));
  } catch (const std::system_error&) {  // the system gives no more threads: this thread does the rest
  }
  work(0, part(1));
  work(part(started), count);
  for (std::thread& thread : pool) thread.join();
}

}  // namespace sigmaik::detail
