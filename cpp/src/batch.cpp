#include <sigmaik/batch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>

#include <sigmaik/velocity_solver.hpp>

#include "finite.hpp"
#include "lane_jacobi.hpp"
#include "message.hpp"
#include "ranges.hpp"

namespace sigmaik {

// A decomposition that was found in lanes, written into a Spectrum for the rules to read.
struct detail::SpectrumParts {
  // U = I: the basis of the u_i is then that of the command.
  static void begin(Spectrum& to, int m, int n) noexcept {
    to = Spectrum{};
    to.m_ = m;
    to.n_ = n;
    for (int i = 0; i < m; ++i) to.u_(i, i) = 1.0;
  }
  static void set_sigma(Spectrum& to, int i, double sigma) noexcept { to.sigma_[static_cast<std::size_t>(i)] = sigma; }
  static double* u(Spectrum& to, int i) noexcept { return to.u_.col(i).data(); }
  static double* v(Spectrum& to, int i) noexcept { return to.v_.col(i).data(); }
};

namespace {

using detail::LaneWork;
using detail::SpectrumParts;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// [part of σ_max] Two σ_i nearer to each other than this have u_i and v_i that rounding turns by more than 1e-10. A
// method whose answer depends on them there is left to the solver of single problems: one that looks at v_i, and any at
// its threshold, where it may treat the two differently.
constexpr double kTie = 1e-6;
constexpr double kExact = 1e-9;  // part of the command that an exact answer may miss, as for a VelocitySolver

template <int value>
using Constant = std::integral_constant<int, value>;

// The problems, and what the method needs of their decompositions.
struct Batch {
  const Method& method;
  double length_scale;
  BatchShape shape;
  const double* jacobian;
  const double* twist;
  double* qdot;
  std::int8_t* status;  // may be null
  bool needs_u;         // the method depends on u_i, not only on u_iᵀẋ
  bool needs_v;         // the method depends on v_i
  double threshold;     // of the method, relative: the answer may jump there

  bool wide() const noexcept { return shape.rows <= shape.cols; }
  // The columns to make orthogonal are those of Jᵀ (wide) or of J. With the columns of Jᵀ rotate the rows of U, or ẋ
  // alone, which becomes u_iᵀẋ; with those of J rotate the rows of V.
  int columns() const noexcept { return std::min(shape.rows, shape.cols); }
  int length() const noexcept { return std::max(shape.rows, shape.cols); }
  int carried() const noexcept { return !wide() ? shape.cols : needs_u ? shape.rows : 1; }
  // J and V from a tall matrix do not give the rest of U.
  bool in_lanes() const noexcept { return wide() || !needs_u; }
  double weight(int row) const noexcept { return row < 3 ? 1.0 : length_scale; }
  const double* jacobian_of(std::size_t b) const noexcept {
    return jacobian + b * static_cast<std::size_t>(shape.rows * shape.cols);
  }
  const double* twist_of(std::size_t b) const noexcept { return twist + b * static_cast<std::size_t>(shape.rows); }
  double* qdot_of(std::size_t b) const noexcept { return qdot + b * static_cast<std::size_t>(shape.cols); }
};

Batch batch_of(const Method& method, double length_scale, const BatchShape& shape, const double* jacobian,
               const double* twist, double* qdot, std::int8_t* status) noexcept {
  Batch batch{method, length_scale, shape, jacobian, twist, qdot, status, false, false, relative_threshold(method)};
  std::visit(
      [&]<typename R>(const R& rule) {
        if constexpr (std::is_same_v<R, CustomRule>) {
          batch.needs_u = batch.needs_v = true;
        } else {
          if constexpr (AmplifyingRule<R>) {
            if (rule.row_gains().linear != 1.0 || rule.row_gains().angular != 1.0) batch.needs_u = true;
          }
          if constexpr (ClampingRule<R>) batch.needs_v = true;
          if constexpr (std::is_same_v<R, PseudoInverse>) batch.threshold = rule.tolerance;
        }
      },
      method);
  return batch;
}

// A problem as a VelocitySolver alone solves it.
void solve_alone(const Batch& batch, VelocitySolver& solver, std::size_t b) noexcept {
  const int m = batch.shape.rows, n = batch.shape.cols;
  TaskJacobian j(m, n);
  j = Eigen::Map<const RowMajor>(batch.jacobian_of(b), m, n);
  solver.reset();
  const Solution solution = solver.solve(j, Eigen::Map<const Eigen::VectorXd>(batch.twist_of(b), m));
  Eigen::Map<Eigen::VectorXd>(batch.qdot_of(b), n) = solution.qdot;
  if (batch.status != nullptr) batch.status[b] = static_cast<std::int8_t>(solution.status);
}

// One lane of a decomposition: the lengths of the orthogonal columns, one over each, and their entries.
struct Lane {
  const double* entries = nullptr;  // entry j of column i is at (i kLaneEntries + j) stride
  int stride = 0;
  double sigma[kMaxTask] = {}, inverse[kMaxTask] = {};

  double at(int i, int j) const noexcept { return entries[(i * detail::kLaneEntries + j) * stride]; }
};

// The method's answer: q̇ = Σ speed_i v_i. `order` names the columns from the longest to the shortest. Returns whether
// the directions are determined well enough.
bool answer(const Batch& batch, std::size_t b, const Lane& lane, Spectrum& spectrum, std::array<double, 6>& factor,
            bool& exact) noexcept {
  const int k = batch.columns(), m = batch.shape.rows, n = batch.shape.cols, length = batch.length();
  std::array<int, 6> order{};
  for (int i = 0; i < k; ++i) {
    int at = i;
    for (; at > 0 && lane.sigma[order[static_cast<std::size_t>(at - 1)]] < lane.sigma[i]; --at) {
      order[static_cast<std::size_t>(at)] = order[static_cast<std::size_t>(at - 1)];
    }
    order[static_cast<std::size_t>(at)] = i;
  }
  TaskVector command = TaskVector::Zero(m);
  double longest = 0.0, last = 0.0;
  for (int i = 0; i < k; ++i) {
    const int from = order[static_cast<std::size_t>(i)];
    const double sigma = lane.sigma[from];
    if (i == 0) longest = sigma;
    if (std::abs(sigma - batch.threshold * longest) < kTie * longest) return false;
    if (batch.needs_v && i > 0 && last - sigma < kTie * longest) return false;
    last = sigma;
    SpectrumParts::set_sigma(spectrum, i, sigma);
    if (batch.wide()) {
      if (!batch.needs_u) command[i] = lane.at(from, n);
      for (int row = 0; batch.needs_u && row < m; ++row) SpectrumParts::u(spectrum, i)[row] = lane.at(from, n + row);
      for (int j = 0; batch.needs_v && j < n; ++j)
        SpectrumParts::v(spectrum, i)[j] = lane.at(from, j) * lane.inverse[from];
    } else {
      double part = 0.0;
      for (int row = 0; row < m; ++row) part += lane.at(from, row) * batch.weight(row) * batch.twist_of(b)[row];
      command[i] = part * lane.inverse[from];
      for (int j = 0; batch.needs_v && j < n; ++j) SpectrumParts::v(spectrum, i)[j] = lane.at(from, length + j);
    }
  }
  if (batch.needs_u) {
    for (int row = 0; row < m; ++row) command[row] = batch.weight(row) * batch.twist_of(b)[row];
  }
  if (!detail::finite(command)) return false;
  const Resolution resolution = resolve(batch.method, spectrum, command, 0b111000);
  double largest = 0.0;  // in the rows of the task, as Resolution::exact has it: the basis here may be another
  for (int row = 0; row < m; ++row) largest = std::max(largest, std::abs(batch.weight(row) * batch.twist_of(b)[row]));
  exact = !batch.needs_u || resolution.exact;
  for (int i = 0; i < k; ++i) {
    const double speed = resolution.speed[static_cast<std::size_t>(i)];
    if (!batch.needs_u && !(std::abs(spectrum.sigma(i) * speed - command[i]) <= kExact * largest)) exact = false;
    const int from = order[static_cast<std::size_t>(i)];
    factor[static_cast<std::size_t>(from)] = batch.wide() ? speed * lane.inverse[from] : speed;
  }
  return true;
}

// Whether J q̇ misses no more of the twist than VelocitySolver allows for an exact answer.
Status judge(const Batch& batch, std::size_t b, bool exact) noexcept {
  double missed = 0.0, largest = 0.0;
  for (int row = 0; row < batch.shape.rows; ++row) {
    const double* const j = batch.jacobian_of(b) + row * batch.shape.cols;
    double achieved = 0.0;
    for (int i = 0; i < batch.shape.cols; ++i) achieved += j[i] * batch.qdot_of(b)[i];
    missed = std::max(missed, batch.weight(row) * std::abs(achieved - batch.twist_of(b)[row]));
    largest = std::max(largest, batch.weight(row) * std::abs(batch.twist_of(b)[row]));
  }
  return exact && missed <= kExact * largest ? Status::Ok : Status::Damped;
}

// Lane l of `work` becomes problem b: the columns, weighted, and what rotates with them. `length` as that of the batch.
template <int lanes, typename Size>
SIGMAIK_INLINE void load_lane(const Batch& batch, std::size_t b, LaneWork<lanes>& work, int l, Size length) {
  const int m = batch.shape.rows, n = batch.shape.cols, k = batch.columns();
  const double* const j = batch.jacobian_of(b);
  const double* const x = batch.twist_of(b);
  for (int i = 0; batch.wide() && i < k; ++i) {
    const double weight = batch.weight(i);
    const double* const row = j + i * length;
    for (int at = 0; at < length; ++at) work.w[i][at][l] = weight * row[at];
    if (!batch.needs_u) work.w[i][length][l] = weight * x[i];
  }
  for (int i = 0; !batch.wide() && i < k; ++i) {
    for (int at = 0; at < m; ++at) work.w[i][at][l] = batch.weight(at) * j[at * n + i];
  }
  if (batch.wide() && !batch.needs_u) return;
  for (int i = 0; i < k; ++i) {
    for (int at = 0; at < k; ++at) work.w[i][length + at][l] = at == i ? 1.0 : 0.0;
  }
}

// Problems [begin, begin + count) of a block; lanes beyond repeat the last problem.
template <int k, int lanes, typename Size, typename Entries>
SIGMAIK_INLINE void solve_block(const Batch& batch, std::size_t begin, std::size_t count, VelocitySolver& alone,
                                Spectrum& spectrum, Size length, Entries entries) {
  LaneWork<lanes> work;
  for (int l = 0; l < lanes; ++l) {
    load_lane<lanes>(batch, begin + std::min(static_cast<std::size_t>(l), count - 1), work, l, length);
  }
  detail::lane_orthogonalise<k, lanes>(work, length, entries);

  Lane lane[lanes];
  std::array<double, 6> factors[lanes] = {};
  bool done[lanes] = {}, exact[lanes] = {};
  for (int i = 0; i < k; ++i) {
    const detail::Vector<lanes> sigma = detail::square_root(work.square[i]), inverse = 1.0 / sigma;
    for (int l = 0; l < lanes; ++l) {
      lane[l].sigma[i] = sigma[l];
      lane[l].inverse[i] = inverse[l];
    }
  }
  for (int l = 0; l < lanes && static_cast<std::size_t>(l) < count; ++l) {
    if (work.regular[l] == 0) continue;
    lane[l].entries = reinterpret_cast<const double*>(&work.w[0][0]) + l;
    lane[l].stride = lanes;
    done[l] = answer(batch, begin + static_cast<std::size_t>(l), lane[l], spectrum, factors[l], exact[l]);
  }

  // q̇ = Σ factor_i × the columns' entries that are v_i, but for a factor.
  const int n = batch.shape.cols, offset = batch.wide() ? 0 : length;
  detail::Vector<lanes> factor[kMaxTask] = {}, zero = detail::splat<lanes>(0.0);
  for (int i = 0; i < k; ++i) {
    detail::Vector<lanes> all = zero;
    for (int l = 0; l < lanes; ++l) all[l] = factors[l][static_cast<std::size_t>(i)];
    factor[i] = all;
  }
  for (int j = 0; j < n; ++j) {
    detail::Vector<lanes> sum = factor[0] * work.w[0][offset + j];
    for (int i = 1; i < k; ++i) sum += factor[i] * work.w[i][offset + j];
    zero += 0.0 * sum;
    for (int l = 0; l < lanes && static_cast<std::size_t>(l) < count; ++l) {
      batch.qdot_of(begin + static_cast<std::size_t>(l))[j] = sum[l];
    }
  }
  for (int l = 0; l < lanes && static_cast<std::size_t>(l) < count; ++l) {
    const std::size_t b = begin + static_cast<std::size_t>(l);
    if (!done[l] || zero[l] != 0.0) {
      solve_alone(batch, alone, b);
    } else if (batch.status != nullptr) {
      batch.status[b] = static_cast<std::int8_t>(judge(batch, b, exact[l]));
    }
  }
}

// Problems [begin, end), block by block.
template <int lanes>
SIGMAIK_INLINE void solve_range(const Batch& batch, std::size_t begin, std::size_t end, VelocitySolver& alone) {
  Spectrum spectrum;
  SpectrumParts::begin(spectrum, batch.shape.rows, batch.shape.cols);
  const auto run = [&](auto columns, auto length, auto entries) __attribute__((always_inline)) {
    constexpr int k = decltype(columns)::value;
    for (; begin < end; begin += lanes) {
      const std::size_t count = std::min<std::size_t>(end - begin, lanes);
      solve_block<k, lanes>(batch, begin, count, alone, spectrum, length, entries);
    }
  };
  const int length = batch.length(), entries = length + batch.carried();
  switch (batch.columns()) {
    case 1: return run(Constant<1>{}, length, entries);
    case 2: return run(Constant<2>{}, length, entries);
    case 3: return run(Constant<3>{}, length, entries);
    case 4: return run(Constant<4>{}, length, entries);
    case 5: return run(Constant<5>{}, length, entries);
    default: break;
  }
  // The arms that there are: sizes that the compiler knows.
  if (length == 6 && entries == 7) return run(Constant<6>{}, Constant<6>{}, Constant<7>{});
  if (length == 7 && entries == 8) return run(Constant<6>{}, Constant<7>{}, Constant<8>{});
  run(Constant<6>{}, length, entries);
}

void solve_baseline(const Batch& batch, std::size_t begin, std::size_t end, VelocitySolver& alone) {
  solve_range<2>(batch, begin, end, alone);
}

using Solve = void (*)(const Batch&, std::size_t, std::size_t, VelocitySolver&);

#if defined(__x86_64__) && !defined(SIGMAIK_NO_DISPATCH)
__attribute__((target("avx2,fma"))) void solve_avx2(const Batch& batch, std::size_t begin, std::size_t end,
                                                    VelocitySolver& alone) {
  solve_range<4>(batch, begin, end, alone);
}

Solve widest() noexcept {
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") ? solve_avx2 : solve_baseline;
}
#else
Solve widest() noexcept { return solve_baseline; }
#endif

}  // namespace

void solve_batch(const Method& method, double length_scale, const BatchShape& shape, const double* jacobian,
                 const double* twist, double* qdot, std::int8_t* status, int threads) {
  const int m = shape.rows, n = shape.cols;
  detail::require(m >= 1 && m <= kMaxTask, "the Jacobians have ", m, " rows; 1 to ", kMaxTask, " are supported");
  detail::require(n >= 1 && n <= kMaxJoints, "the Jacobians have ", n, " columns; 1 to ", kMaxJoints, " are supported");
  detail::require(threads >= 1, "threads = ", threads, " must be at least 1");
  const VelocitySolver prototype(method, length_scale);
  const Batch batch = batch_of(method, length_scale, shape, jacobian, twist, qdot, status);
  static const Solve solve = widest();

  detail::split_range(shape.count, threads, [&](std::size_t begin, std::size_t end) {
    VelocitySolver alone = prototype;
    if (batch.in_lanes()) return solve(batch, begin, end, alone);
    for (; begin < end; ++begin) solve_alone(batch, alone, begin);
  });
}

}  // namespace sigmaik
