#include <sigmaik/batch.hpp>

#include <sigmaik/velocity_solver.hpp>

#include "message.hpp"
#include "ranges.hpp"

namespace sigmaik {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace

void solve_batch(const Method& method, double length_scale, const BatchShape& shape, const double* jacobian,
                 const double* twist, double* qdot, std::int8_t* status, int threads) {
  const int m = shape.rows, n = shape.cols;
  detail::require(m >= 1 && m <= kMaxTask, "the Jacobians have ", m, " rows; 1 to ", kMaxTask, " are supported");
  detail::require(n >= 1 && n <= kMaxJoints, "the Jacobians have ", n, " columns; 1 to ", kMaxJoints, " are supported");
  detail::require(threads >= 1, "threads = ", threads, " must be at least 1");
  const VelocitySolver prototype(method, length_scale);

  const auto work = [&](std::size_t begin, std::size_t end) {
    VelocitySolver solver = prototype;
    TaskJacobian j(m, n);
    for (std::size_t b = begin; b < end; ++b) {
      j = Eigen::Map<const RowMajor>(jacobian + b * static_cast<std::size_t>(m * n), m, n);
      const Eigen::Map<const Eigen::VectorXd> command(twist + b * static_cast<std::size_t>(m), m);
      solver.reset();
      const Solution solution = solver.solve(j, command);
      Eigen::Map<Eigen::VectorXd>(qdot + b * static_cast<std::size_t>(n), n) = solution.qdot;
      if (status != nullptr) status[b] = static_cast<std::int8_t>(solution.status);
    }
  };

  detail::split_range(shape.count, threads, work);
}

}  // namespace sigmaik
