#pragma once
// Counts of a cycle's iterations, for bench/worst_case.cpp. Without SIGMAIK_COUNT_WORK nothing is counted, and nothing
// is compiled.

namespace sigmaik::detail {

struct Work {
  long steps = 0;        // of active sets: one factorisation each
  long problems = 0;     // of bounded least squares
  long sweeps = 0;       // of one-sided Jacobi
  long evaluations = 0;  // of stopping distances under jerk limits
};

#ifdef SIGMAIK_COUNT_WORK
inline thread_local Work work;
inline void count_work(long Work::* kind, long more) noexcept { work.*kind += more; }
#else
inline void count_work(long Work::*, long) noexcept {}
#endif

}  // namespace sigmaik::detail
