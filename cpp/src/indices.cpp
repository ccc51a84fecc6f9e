#include <sigmaik/indices.hpp>

#include <cmath>

#include <sigmaik/spectrum.hpp>

#include "message.hpp"
#include "numbers.hpp"
#include "quasi_random.hpp"
#include "ranges.hpp"
#include "symmetric_eigen.hpp"

namespace sigmaik {
namespace {

using detail::kInfinity;
// A singular value below this part of the largest one counts as zero. Rounding turns an exact zero into up to 4e-15.
constexpr double kRounding = 1e-14;

// The index as a function of σ_1 ≥ … ≥ σ_m, and its derivatives with respect to them. The derivatives of an infinite
// index are zero.
double from_sigma(Index index, double inverse_k, const Spectrum& spectrum, double* slope) noexcept {
  const int m = spectrum.rows();
  const double least = spectrum.sigma(m - 1);  // Spectrum::sigma is zero beyond size()
  for (int i = 0; i < m; ++i) slope[i] = 0.0;
  switch (index) {
    case Index::Manipulability: {
      double before[kMaxTask + 1];
      before[0] = 1.0;
      for (int i = 0; i < m; ++i) before[i + 1] = before[i] * spectrum.sigma(i);
      double after = 1.0;
      for (int i = m - 1; i >= 0; --i) {
        slope[i] = before[i] * after;
        after *= spectrum.sigma(i);
      }
      return before[m];
    }
    case Index::ConditionNumber: {
      const double largest = spectrum.sigma(0);
      if (!(least > kRounding * largest)) return kInfinity;
      slope[0] = 1.0 / least;
      slope[m - 1] += -largest / (least * least);
      if (m == 1) slope[0] = 0.0;
      return largest / least;
    }
    case Index::MinSingularValue: slope[m - 1] = 1.0; return least;
    default: {
      if (!(least > kRounding * spectrum.sigma(0))) return kInfinity;
      double sum = 0.0;
      for (int i = 0; i < m; ++i) {
        const double sigma = spectrum.sigma(i), log = 2.0 * std::log(sigma) + std::log(inverse_k);
        sum += log * log;
        slope[i] = 4.0 * log / sigma;
      }
      return sum;
    }
  }
}

double of_jacobian(Index index, const TaskJacobianRef& jacobian, double k = 1.0) noexcept {
  Spectrum spectrum;
  spectrum.decompose(jacobian);
  double slope[kMaxTask];
  return from_sigma(index, 1.0 / k, spectrum, slope);
}

}  // namespace

const char* to_string(Index index) noexcept {
  switch (index) {
    case Index::Manipulability: return "manipulability";
    case Index::ConditionNumber: return "condition_number";
    case Index::MinSingularValue: return "min_singular_value";
    default: return "geometry_aware";
  }
}

IndexFunction::IndexFunction(Index index, const IndexOptions& options)
    : index_(index), angular_(options.length_scale), inverse_k_(1.0 / options.k) {
  detail::require(std::isfinite(options.length_scale) && options.length_scale > 0.0,
                  "length_scale = ", options.length_scale, " must be finite and greater than 0");
  detail::require(std::isfinite(options.k) && options.k > 0.0, "k = ", options.k, " must be finite and greater than 0");
  if (options.sigma.size() == 0 || index != Index::GeometryAware) return;
  const TaskMatrix& sigma = options.sigma;
  detail::require(sigma.rows() == sigma.cols(), "Σ is ", sigma.rows(), "×", sigma.cols(), "; it must be square");
  detail::require(
      sigma.allFinite() && (sigma - sigma.transpose()).cwiseAbs().maxCoeff() <= 1e-9 * sigma.cwiseAbs().maxCoeff(),
      "Σ must be finite and symmetric");
  const auto [values, vectors] = detail::symmetric_eigen(sigma);
  detail::require(values[0] > 0.0, "Σ must be positive definite; its smallest eigenvalue is ", values[0]);
  whiten_ = vectors.lazyProduct(values.cwiseSqrt().cwiseInverse().asDiagonal() * vectors.transpose());
  inverse_k_ = 1.0;
}

double IndexFunction::value(const TaskJacobianRef& jacobian) const noexcept {
  TaskJacobian weighted = jacobian;
  if (weighted.rows() > 3) weighted.bottomRows(weighted.rows() - 3) *= angular_;
  if (whiten_.size() != 0) weighted = whiten_.lazyProduct(weighted).eval();
  return of_jacobian(index_, weighted, 1.0 / inverse_k_);
}

double IndexFunction::value(const Chain& chain, const JointRef& q, JointVector& out) const noexcept {
  ChainState state;
  update(chain, q, state);
  if (!chain.has_mimics()) return gradient(state.jacobian, out);
  Jacobian slope;
  const double value = this->slope(state.jacobian, slope);
  JacobianGradient d;
  jacobian_gradient(chain, q, state.jacobian, d);
  out.resize(chain.dof());
  for (int k = 0; k < chain.dof(); ++k) out[k] = slope.cwiseProduct(d[static_cast<std::size_t>(k)]).sum();
  return value;
}

double IndexFunction::slope(const Jacobian& jacobian, Jacobian& slope) const noexcept {
  Jacobian weighted = jacobian;
  weighted.bottomRows<3>() *= angular_;
  if (whiten_.size() != 0) weighted = whiten_.lazyProduct(weighted).eval();
  Spectrum spectrum;
  spectrum.decompose(weighted);
  double of_sigma[kMaxTask];
  const double value = from_sigma(index_, inverse_k_, spectrum, of_sigma);
  slope.setZero(6, jacobian.cols());
  for (int i = 0; i < spectrum.size(); ++i) {
    Eigen::Matrix<double, 6, 1> u = of_sigma[i] * spectrum.u(i);
    if (whiten_.size() != 0) u = whiten_.lazyProduct(u).eval();
    u.tail<3>() *= angular_;
    slope += u * spectrum.v(i).transpose();
  }
  return value;
}

// With J_j = [v_j; ω_j], ∂_kJ x = [ω_k × Σ_{j≥k} v_j x_j + (Σ_{j<k} ω_j x_j) × v_k; ω_k × Σ_{j≥k} ω_j x_j]: running
// sums therefore give u_iᵀ ∂_kJ v_i for all k in one pass.
double IndexFunction::gradient(const Jacobian& jacobian, JointVector& out) const noexcept {
  const int n = static_cast<int>(jacobian.cols());
  Jacobian weighted = jacobian;
  weighted.bottomRows<3>() *= angular_;
  if (whiten_.size() != 0) weighted = whiten_.lazyProduct(weighted).eval();
  Spectrum spectrum;
  spectrum.decompose(weighted);
  double slope[kMaxTask];
  const double value = from_sigma(index_, inverse_k_, spectrum, slope);
  out.setZero(n);
  for (int i = 0; i < spectrum.size(); ++i) {
    if (slope[i] == 0.0) continue;
    Eigen::Matrix<double, 6, 1> u = slope[i] * spectrum.u(i);
    if (whiten_.size() != 0) u = whiten_.lazyProduct(u).eval();
    const Eigen::Vector3d up = u.head<3>(), uo = angular_ * u.tail<3>();
    const auto x = spectrum.v(i);
    Eigen::Vector3d v = Eigen::Vector3d::Zero(), w = v,
                    w_before = v;  // Σ_{j≥k} v_j x_j, Σ_{j≥k} ω_j x_j, Σ_{j<k} ω_j x_j
    for (int j = 0; j < n; ++j) w_before += x[j] * jacobian.col(j).tail<3>();
    for (int k = n - 1; k >= 0; --k) {
      const Eigen::Vector3d v_k = jacobian.col(k).head<3>(), w_k = jacobian.col(k).tail<3>();
      v += x[k] * v_k;
      w += x[k] * w_k;
      w_before -= x[k] * w_k;
      out[k] += w_k.dot(v.cross(up) + w.cross(uo)) + v_k.dot(up.cross(w_before));
    }
  }
  return value;
}

double manipulability(const TaskJacobianRef& jacobian) noexcept { return of_jacobian(Index::Manipulability, jacobian); }
double condition_number(const TaskJacobianRef& jacobian) noexcept {
  return of_jacobian(Index::ConditionNumber, jacobian);
}
double min_singular_value(const TaskJacobianRef& jacobian) noexcept {
  return of_jacobian(Index::MinSingularValue, jacobian);
}
double geometry_aware(const TaskJacobianRef& jacobian, double k) noexcept {
  return of_jacobian(Index::GeometryAware, jacobian, k);
}

double reference_scale(const Chain& chain, double length_scale) {
  const int n = chain.dof();
  const detail::QuasiRandom configurations(chain);
  const JointVector &low = configurations.lower, &high = configurations.upper;
  detail::require(std::isfinite(length_scale) && length_scale > 0.0, "length_scale = ", length_scale,
                  " must be finite and greater than 0");
  // σ_1², and its gradient in q.
  const auto largest = [&](const JointVector& q, JointVector* gradient) {
    ChainState state;
    update(chain, q, state);
    Jacobian weighted = state.jacobian;
    weighted.bottomRows<3>() *= length_scale;
    Spectrum spectrum;
    spectrum.decompose(weighted);
    if (gradient != nullptr) {
      JacobianGradient d;
      jacobian_gradient(chain, q, state.jacobian, d);
      Eigen::Matrix<double, 6, 1> u = spectrum.u(0);
      u.tail<3>() *= length_scale;
      for (int k = 0; k < n; ++k) {
        (*gradient)[k] = 2.0 * spectrum.sigma(0) * u.dot(d[static_cast<std::size_t>(k)] * spectrum.v(0));
      }
    }
    return spectrum.sigma(0) * spectrum.sigma(0);
  };
  JointVector best = 0.5 * (low + high), q(n), gradient(n);
  double most = largest(best, nullptr);
  for (int sample = 1; sample <= 1000; ++sample) {
    q = configurations(sample);
    const double value = largest(q, nullptr);
    if (value > most) {
      most = value;
      best = q;
    }
  }
  double step = 0.1;
  for (int iteration = 0; iteration < 100 && step > 1e-6; ++iteration) {
    largest(best, &gradient);
    const double length = gradient.norm();
    if (!(length > 0.0)) break;
    q = (best + step / length * gradient).cwiseMax(low).cwiseMin(high);
    const double value = largest(q, nullptr);
    if (value > most) {
      most = value;
      best = q;
      step *= 1.5;
    } else {
      step *= 0.5;
    }
  }
  return std::max(kDefaultScale, 1.1 * most);
}

void evaluate(const Chain& chain, const IndexFunction& index, std::size_t count, const double* q, double* value,
              double* gradient, int threads) {
  detail::require(threads >= 1, "threads = ", threads, " must be at least 1");
  const int n = chain.dof();
  detail::split_range(count, threads, [&](std::size_t begin, std::size_t end) {
    ChainState state;
    JointVector slope(n);
    for (std::size_t b = begin; b < end; ++b) {
      const Eigen::Map<const Eigen::VectorXd> at(q + b * static_cast<std::size_t>(n), n);
      if (gradient == nullptr) {
        update(chain, at, state);
        value[b] = index.value(state.jacobian);
      } else {
        value[b] = index.value(chain, at, slope);
        Eigen::Map<Eigen::VectorXd>(gradient + b * static_cast<std::size_t>(n), n) = slope;
      }
    }
  });
}

}  // namespace sigmaik
