#include <sigmaik/least_squares.hpp>

#include <algorithm>
#include <array>
#include <cmath>

#include "active_set.hpp"
#include "finite.hpp"
#include "numbers.hpp"
#include "work.hpp"

namespace sigmaik {
namespace {

using detail::ActiveSet;
using detail::ActiveSetProblem;

using detail::kInfinity;

static_assert(detail::kActiveSetRows == kMaxObjectives + kMaxEqualities + kMaxInequalities);

template <int P>
void run_baseline(ActiveSetProblem<P>& problem) noexcept {
  ActiveSet<2, P>(problem).run();
}

#if defined(__x86_64__) && !defined(SIGMAIK_NO_DISPATCH)
template <int P>
__attribute__((target("avx2,fma"))) void run_avx2(ActiveSetProblem<P>& problem) noexcept {
  ActiveSet<4, P>(problem).run();
}

template <int P>
void (*run)(ActiveSetProblem<P>&) noexcept = run_baseline<P>;

// Chosen while the library is loaded; a call before that runs the baseline, which is slower.
[[maybe_unused]] const bool chosen = [] {
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    run<8> = run_avx2<8>;
    run<16> = run_avx2<16>;
    run<kMaxUnknowns> = run_avx2<kMaxUnknowns>;
  }
  return true;
}();
#else
template <int P>
constexpr auto run = run_baseline<P>;
#endif

int unknowns_of(const LeastSquaresProblem& p) noexcept {
  return static_cast<int>(std::max({p.A.cols(), p.C.cols(), p.G.cols(), p.lower.size(), p.upper.size()}));
}

bool fits(const RowMatrix& matrix, const RowVector& right, Eigen::Index n) noexcept {
  return right.size() == matrix.rows() && (matrix.rows() == 0 || matrix.cols() == n);
}

bool valid(const LeastSquaresProblem& p, int n) noexcept {
  if (n < 1 || n > kMaxUnknowns || p.C.rows() > kMaxEqualities || p.G.rows() > kMaxInequalities) return false;
  if (!fits(p.A, p.b, n) || !fits(p.C, p.d, n) || !fits(p.G, p.h, n)) return false;
  if (!detail::finite(p.A) || !detail::finite(p.C) || !detail::finite(p.G) || !detail::finite(p.b) ||
      !detail::finite(p.d)) {
    return false;
  }
  for (const double h : p.h) {
    if (!(h > -kInfinity)) return false;
  }
  if ((p.lower.size() != 0 && p.lower.size() != n) || (p.upper.size() != 0 && p.upper.size() != n)) return false;
  for (int i = 0; i < n; ++i) {
    const double low = p.lower.size() != 0 ? p.lower[i] : -kInfinity;
    const double high = p.upper.size() != 0 ? p.upper[i] : kInfinity;
    if (!(low <= high) || low == kInfinity || high == -kInfinity) return false;
  }
  return true;
}

// The problem for the kernel, padded to P unknowns; and for each of the kernel's inequalities the row of G, because
// rows without a bound are left out.
template <int P>
struct Packed {
  ActiveSetProblem<P> work;
  std::array<int, kMaxInequalities> inequality;
};

template <int P>
void pack_rows(const LeastSquaresProblem& p, int n, std::uint32_t active, Packed<P>& packed) noexcept {
  ActiveSetProblem<P>& work = packed.work;
  int rows = 0;
  const auto append = [&](const RowMatrix& matrix, const RowVector& right, Eigen::Index k) {
    const double* from = matrix.data() + k * matrix.cols();
    int j = 0;
    for (; j < n; ++j) work.row[rows][j] = from[j];
    for (; j < P; ++j) work.row[rows][j] = 0.0;
    work.rhs[rows++] = right[k];
  };
  work.active = 0;
  for (int k = 0; k < p.G.rows(); ++k) {
    if (p.h[k] == kInfinity) continue;
    if (active >> k & 1u) work.active |= 1u << rows;
    packed.inequality[static_cast<std::size_t>(rows)] = k;
    append(p.G, p.h, k);
  }
  work.inequalities = rows;
  for (int k = 0; k < p.C.rows(); ++k) append(p.C, p.d, k);
  work.equalities = rows - work.inequalities;
  for (int k = 0; k < p.A.rows(); ++k) append(p.A, p.b, k);
  work.objectives = rows - work.inequalities - work.equalities;
}

template <int P, typename Guess>
void pack_bounds(const LeastSquaresProblem& p, int n, const Guess& guess, ActiveSetProblem<P>& work) noexcept {
  work.at_lower = work.at_upper = 0;
  for (int i = 0; i < P; ++i) {
    const bool inside = i < n;
    work.lower[i] = inside && p.lower.size() != 0 ? p.lower[i] : -kInfinity;
    work.upper[i] = inside && p.upper.size() != 0 ? p.upper[i] : kInfinity;
    work.x[i] = inside ? guess.x[i] : 0.0;
    if ((guess.at_lower >> i & 1u) != 0 && work.lower[i] > -kInfinity) work.at_lower |= 1u << i;
    if ((guess.at_upper >> i & 1u) != 0 && work.upper[i] < kInfinity) work.at_upper |= 1u << i;
  }
}

// Computes what is left of G x ≤ h and C x = d, and from it the status.
template <int P>
void measure_constraints(const ActiveSetProblem<P>& work, LeastSquaresSolution& s) noexcept {
  double over = 0.0, off = 0.0;
  bool met = true;
  for (int k = 0; k < work.inequalities + work.equalities; ++k) {
    double sum = -work.rhs[k], terms = std::abs(work.rhs[k]);
    for (int j = 0; j < work.unknowns; ++j) {
      sum += work.row[k][j] * work.x[j];
      terms += std::abs(work.row[k][j] * work.x[j]);
    }
    const bool inequality_row = k < work.inequalities;
    if (inequality_row) sum = std::max(sum, 0.0);
    (inequality_row ? over : off) += sum * sum;
    if (std::abs(sum) > 1e-9 * terms) met = false;
  }
  s.violation = std::sqrt(over);
  s.equality_error = std::sqrt(off);
  s.status = !work.finished ? LeastSquaresStatus::StepLimit
             : met          ? LeastSquaresStatus::Optimal
                            : LeastSquaresStatus::Infeasible;
}

template <int P, typename Guess>
LeastSquaresSolution solve_padded(const LeastSquaresProblem& p, int n, const Guess& guess) noexcept {
  Packed<P> packed;
  ActiveSetProblem<P>& work = packed.work;
  work.unknowns = n;
  work.finished = false;
  pack_rows(p, n, guess.active, packed);
  pack_bounds(p, n, guess, work);
  run<P>(work);
  detail::count_work(&detail::Work::steps, work.steps);
  detail::count_work(&detail::Work::problems, 1);

  LeastSquaresSolution s;
  s.x = Eigen::Map<const UnknownVector>(work.x, n);
  if (!s.x.allFinite()) {  // overflow
    s.x.setZero();
    return s;
  }
  s.steps = work.steps;
  s.at_lower = work.at_lower;
  s.at_upper = work.at_upper;
  for (int k = 0; k < work.inequalities; ++k) {
    if (work.active >> k & 1u) s.active |= 1u << packed.inequality[static_cast<std::size_t>(k)];
  }
  measure_constraints(work, s);
  return s;
}

}  // namespace

const char* to_string(LeastSquaresStatus status) noexcept {
  switch (status) {
    case LeastSquaresStatus::Optimal: return "optimal";
    case LeastSquaresStatus::Infeasible: return "infeasible";
    case LeastSquaresStatus::StepLimit: return "step limit";
    case LeastSquaresStatus::BadInput: break;
  }
  return "bad input";
}

LeastSquaresSolution LeastSquares::solve(const LeastSquaresProblem& problem) noexcept {
  const int n = unknowns_of(problem);
  if (!valid(problem, n)) {
    LeastSquaresSolution s;
    s.x = UnknownVector::Zero(std::clamp(n, 0, kMaxUnknowns));
    return s;
  }
  const int inequalities = static_cast<int>(problem.G.rows());
  if (n != guess_.unknowns || inequalities != guess_.inequalities) {
    guess_ = Guess{n, inequalities, 0, 0, 0, UnknownVector::Zero(n)};
  }
  LeastSquaresSolution s;
  if (n <= 8) {
    s = solve_padded<8>(problem, n, guess_);
  } else if (n <= 16) {
    s = solve_padded<16>(problem, n, guess_);
  } else {
    s = solve_padded<kMaxUnknowns>(problem, n, guess_);
  }
  guess_.x = s.x;
  guess_.at_lower = s.at_lower;
  guess_.at_upper = s.at_upper;
  guess_.active = s.active;
  return s;
}

}  // namespace sigmaik
