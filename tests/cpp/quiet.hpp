#pragma once
// What a call does beside computing: calls to the heap (heap.hpp), locks, and system calls. Include it in one file of
// an executable. Locks are counted by standing in for the functions of pthreads; system calls are trapped by a filter
// of the kernel (seccomp) in a child process.

#include <functional>
#include <string>

#include "heap.hpp"

#if defined(SIGMAIK_TEST_HEAP) && defined(__linux__) && defined(__x86_64__)
#define SIGMAIK_TEST_QUIET 1

#include <dlfcn.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <pthread.h>
#include <semaphore.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstddef>

namespace test {
inline thread_local long lock_calls = 0;

template <typename Function>
Function* next_of(Function*& kept, const char* name) {
  if (kept == nullptr) kept = reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
  return kept;
}
}  // namespace test

extern "C" {
#define SIGMAIK_COUNT_LOCK(name, type)                     \
  int name(type* object) {                                 \
    static int (*next)(type*) = nullptr;                   \
    ++test::lock_calls;                                    \
    return test::next_of<int(type*)>(next, #name)(object); \
  }
SIGMAIK_COUNT_LOCK(pthread_mutex_lock, pthread_mutex_t)
SIGMAIK_COUNT_LOCK(pthread_mutex_trylock, pthread_mutex_t)
SIGMAIK_COUNT_LOCK(pthread_rwlock_rdlock, pthread_rwlock_t)
SIGMAIK_COUNT_LOCK(pthread_rwlock_wrlock, pthread_rwlock_t)
SIGMAIK_COUNT_LOCK(sem_wait, sem_t)
#undef SIGMAIK_COUNT_LOCK
}

namespace test {

struct Quiet {
  long heap = 0, locks = 0;
  int system_call = -1;   // the first one; −1: none
  bool finished = false;  // the work came to its end
  bool filtered = false;  // the kernel trapped system calls
};

inline int& report_to() {
  static int pipe = -1;
  return pipe;
}

inline void on_system_call(int, siginfo_t* info, void*) {
  Quiet quiet;
  quiet.system_call = info->si_syscall;
  quiet.filtered = true;
  if (::write(report_to(), &quiet, sizeof quiet) < 0) _exit(2);
  _exit(1);
}

// From here on this thread can write to the report, and end the process. Any other system call is a SIGSYS.
inline bool trap_system_calls() {
  struct sigaction action{};
  action.sa_sigaction = on_system_call;
  action.sa_flags = SA_SIGINFO;
  if (sigaction(SIGSYS, &action, nullptr) != 0) return false;
  const auto call = [](int number, unsigned char beyond) {
    return sock_filter BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<unsigned>(number), beyond, 0);
  };
  sock_filter filter[] = {
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      call(SYS_exit_group, 4),
      call(SYS_rt_sigreturn, 3),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_write, 0, 3),
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, args)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<unsigned>(report_to()), 0, 1),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP),
  };
  sock_fprog program{sizeof filter / sizeof filter[0], filter};
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

inline Quiet count(const std::function<void()>& work, bool filter) {
  Quiet quiet;
  quiet.filtered = filter && trap_system_calls();
  const long heap = heap_calls, locks = lock_calls;
  work();
  quiet.heap = heap_calls - heap;
  quiet.locks = lock_calls - locks;
  quiet.finished = true;
  return quiet;
}

/// Runs the work in a child process that may make no system call.
inline Quiet quiet_of(const std::function<void()>& work) {
  int ends[2];
  if (pipe(ends) != 0) return {};
  const pid_t child = fork();
  if (child == 0) {
    report_to() = ends[1];
    const Quiet quiet = count(work, true);
    _exit(::write(ends[1], &quiet, sizeof quiet) == sizeof quiet ? 0 : 2);
  }
  close(ends[1]);
  Quiet quiet;
  if (read(ends[0], &quiet, sizeof quiet) != sizeof quiet) quiet = {};
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  return quiet;
}

}  // namespace test
#endif
