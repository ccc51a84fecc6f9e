#pragma once
// Counts calls to the heap, by standing in for malloc and the functions of its family. Include it in one file of an
// executable: the calls of operator new, Eigen's aligned allocation and libraries are then counted too.
//
//     const test::HeapWatch watch;
//     solver.solve(j, twist);
//     CHECK(watch.calls() == 0);

#include <cerrno>
#include <cstddef>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SIGMAIK_TEST_SANITIZED 1
#elif defined(__has_feature)  // clang
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define SIGMAIK_TEST_SANITIZED 1
#endif
#endif

// A sanitizer brings a heap of its own.
#if defined(__GLIBC__) && !defined(SIGMAIK_TEST_SANITIZED)
#define SIGMAIK_TEST_HEAP 1

extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);
}

namespace test {
inline thread_local long heap_calls = 0;
}

extern "C" {
void* malloc(std::size_t size) {
  ++test::heap_calls;
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  ++test::heap_calls;
  return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) {
  ++test::heap_calls;
  return __libc_realloc(block, size);
}
void free(void* block) {
  if (block != nullptr) ++test::heap_calls;
  __libc_free(block);
}
void* memalign(std::size_t alignment, std::size_t size) {
  ++test::heap_calls;
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  ++test::heap_calls;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size) {
  ++test::heap_calls;
  void* const found = __libc_memalign(alignment, size);
  if (found == nullptr) return ENOMEM;
  *block = found;
  return 0;
}
}

namespace test {

/// Calls to the heap by this thread since the watch was made.
class HeapWatch {
 public:
  long calls() const { return heap_calls - start_; }

 private:
  long start_ = heap_calls;
};

}  // namespace test
#endif
