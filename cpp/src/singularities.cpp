#include <sigmaik/singularities.hpp>

#include <cmath>
#include <tuple>
#include <type_traits>
#include <utility>

#include <sigmaik/error.hpp>
#include <sigmaik/kinematics.hpp>

#include "elementary.hpp"
#include "jets.hpp"
#include "message.hpp"
#include "singular_arms.hpp"

namespace sigmaik {

class SingularSets::Model {
 public:
  virtual ~Model() = default;
  std::string name;
  int dof = 0, residual_count = 0;
  std::vector<SingularSet> sets;

  virtual void residuals(const JointRef& q, double* r) const noexcept = 0;
  virtual double psi(int i, const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept = 0;
  virtual double potential(const JointRef& q, const Potential& p, JointVector* gradient,
                           JointMatrix* hessian) const noexcept = 0;
  virtual double manipulability(const JointRef& q, JointVector* gradient, JointMatrix* hessian) const noexcept = 0;
  virtual Tape residual_tape() const = 0;
  virtual Tape manipulability_tape() const = 0;
};

namespace {

using detail::Jet;
using detail::Jets;
using detail::Values;

// The sines and cosines of all joints, padded to whole vectors.
struct SinCos {
  double sine[8], cosine[8];

  template <int lanes>
  SIGMAIK_INLINE static SinCos of(const double* q, int n) {
    SinCos out;
    detail::sincos_all<lanes, 8>(q, n, out.sine, out.cosine);
    return out;
  }
};

// Calls f(Joint<k>, element k) for every element of a tuple.
template <typename Tuple, typename Function>
SIGMAIK_INLINE void for_each(const Tuple& tuple, Function&& f) {
  [&]<std::size_t... k>(std::index_sequence<k...>) __attribute__((always_inline)) {
    (f(detail::Joint<static_cast<int>(k)>{}, std::get<k>(tuple)), ...);
  }(std::make_index_sequence<std::tuple_size_v<Tuple>>{});
}

// The formulas of one arm, their derivatives included. `gradient` is (n,) and `hessian` (n, n), column by column; all
// entries are written.
template <typename Arm, int lanes>
struct Kernels {
  static constexpr int n = Arm::kDof;
  using Residuals = decltype(Arm::residuals(Values{}));
  using Minors = decltype(Arm::minors(Values{}));
  static constexpr int kResiduals = std::tuple_size_v<Residuals>, kMinors = std::tuple_size_v<Minors>;

  // The set of each residual.
  static constexpr std::array<int, kResiduals> kSet = [] {
    std::array<int, kResiduals> out{};
    for (int set = 0, at = 0; set < Arm::kSets; ++set) {
      for (int j = 0; j < Arm::kCodimension[static_cast<std::size_t>(set)]; ++j)
        out[static_cast<std::size_t>(at++)] = set;
    }
    return out;
  }();

  static SIGMAIK_INLINE void residuals(const double* q, double* r) {
    const SinCos x = SinCos::of<lanes>(q, n);
    for_each(Arm::residuals(Values{x.sine, x.cosine}),
             [&](auto k, double value) __attribute__((always_inline)) { r[k] = value; });
  }

  static SIGMAIK_INLINE double potential(const double* q, const Potential& p) {
    double r[kResiduals], psi[kMaxSets] = {}, phi[kMaxSets];
    residuals(q, r);
    for (int k = 0; k < kResiduals; ++k) psi[kSet[static_cast<std::size_t>(k)]] += r[k] * r[k];
    return potentials(psi, p, phi);
  }

  // The weighted potentials φ_i; returns their sum.
  static SIGMAIK_INLINE double potentials(const double (&psi)[kMaxSets], const Potential& p, double (&phi)[kMaxSets]) {
    double exponents[kMaxSets];
    for (int i = 0; i < kMaxSets; ++i) exponents[i] = p.eta1 - p.eta2 * psi[i];
    detail::exp_all<lanes, kMaxSets>(exponents, phi);
    double sum = 0.0;
    for (int i = 0; i < kMaxSets; ++i) {
      phi[i] *= i < Arm::kSets ? p.weights[static_cast<std::size_t>(i)] : 0.0;
      sum += phi[i];
    }
    return sum;
  }

  // Adds f x ∇x to the gradient and f (∇x∇xᵀ + x ∇²x) to the Hessian: half of the derivatives of f x².
  template <unsigned mask, int order>
  static SIGMAIK_INLINE void add_square(const Jet<mask, order>& x, double f, double* gradient, double* hessian) {
    using X = Jet<mask, order>;
    const double fx = f * x.v;
    detail::for_joints<mask>([&](auto i) __attribute__((always_inline)) {
      gradient[i] += fx * x.g[X::at(i)];
      if constexpr (order == 2) {
        detail::for_joints<(mask & ((2u << i) - 1u))>([&](auto j) __attribute__((always_inline)) {
          hessian[j * n + i] += f * x.g[X::at(i)] * x.g[X::at(j)] + fx * x.h[X::at(i, j)];
        });
      }
    });
  }

  static SIGMAIK_INLINE void mirror(double* hessian) {
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < j; ++i) hessian[j * n + i] = hessian[i * n + j];
    }
  }
  template <int order>
  static SIGMAIK_INLINE void clear(double* gradient, double* hessian) {
    for (int i = 0; i < n; ++i) gradient[i] = 0.0;
    if constexpr (order == 2) {
      for (int i = 0; i < n * n; ++i) hessian[i] = 0.0;
    }
  }

  static SIGMAIK_INLINE double psi(int set, const double* q, double* gradient, double* hessian) {
    const SinCos x = SinCos::of<lanes>(q, n);
    clear<2>(gradient, hessian);
    double sum = 0.0;
    for_each(Arm::residuals(Jets<2>{x.sine, x.cosine}), [&](auto k, const auto& r) __attribute__((always_inline)) {
      if (kSet[static_cast<std::size_t>(k())] != set) return;
      sum += r.v * r.v;
      add_square(r, 2.0, gradient, hessian);
    });
    mirror(hessian);
    return sum;
  }

  // ∇φ = −η₂ φ ∇ψ,  ∇²φ = φ (η₂² ∇ψ∇ψᵀ − η₂ ∇²ψ).
  template <int order>
  static SIGMAIK_INLINE double potential(const double* q, const Potential& p, double* gradient, double* hessian) {
    const SinCos x = SinCos::of<lanes>(q, n);
    const auto r = Arm::residuals(Jets<order>{x.sine, x.cosine});
    double psi[kMaxSets] = {}, phi[kMaxSets];
    for_each(r, [&](auto k, const auto& jet)
                    __attribute__((always_inline)) { psi[kSet[static_cast<std::size_t>(k())]] += jet.v * jet.v; });
    const double sum = potentials(psi, p, phi);
    clear<order>(gradient, hessian);
    double slopes[Arm::kSets][n] = {};  // ∇ψ_i
    for_each(r, [&](auto k, const auto& jet) __attribute__((always_inline)) {
      constexpr int set = kSet[static_cast<std::size_t>(decltype(k)::value)];
      using J = std::decay_t<decltype(jet)>;
      add_square(jet, -2.0 * p.eta2 * phi[set], gradient, hessian);
      if constexpr (order == 2) {
        detail::for_joints<J::kMask>(
            [&](auto i) __attribute__((always_inline)) { slopes[set][i] += 2.0 * jet.v * jet.g[J::at(i)]; });
      }
    });
    if constexpr (order == 2) {
      for (int set = 0; set < Arm::kSets; ++set) {
        const double f = p.eta2 * p.eta2 * phi[set];
        for (int j = 0; j < n; ++j) {
          for (int i = j; i < n; ++i) hessian[j * n + i] += f * slopes[set][i] * slopes[set][j];
        }
      }
      mirror(hessian);
    }
    return sum;
  }

  static SIGMAIK_INLINE double manipulability(const double* q) {
    const SinCos x = SinCos::of<lanes>(q, n);
    double square = 0.0;
    for_each(Arm::minors(Values{x.sine, x.cosine}),
             [&](auto, double m) __attribute__((always_inline)) { square += m * m; });
    return std::sqrt(square);
  }

  // ∇m = ∇(m²)/2m,  ∇²m = (∇²(m²)/2 − ∇m∇mᵀ)/m; a single minor avoids the
  // cancellation in these formulas.
  template <int order>
  static SIGMAIK_INLINE double manipulability(const double* q, double* gradient, double* hessian) {
    const SinCos x = SinCos::of<lanes>(q, n);
    const auto minors = Arm::minors(Jets<order>{x.sine, x.cosine});
    clear<order>(gradient, hessian);
    if constexpr (kMinors == 1) {
      const auto& m = std::get<0>(minors);
      using M = std::decay_t<decltype(m)>;
      const double sign = m.v > 0.0 ? 1.0 : m.v < 0.0 ? -1.0 : 0.0;
      detail::for_joints<M::kMask>([&](auto i) __attribute__((always_inline)) {
        gradient[i] = sign * m.g[M::at(i)];
        if constexpr (order == 2) {
          detail::for_joints<(M::kMask & ((2u << i) - 1u))>(
              [&](auto j) __attribute__((always_inline)) { hessian[j * n + i] = sign * m.h[M::at(i, j)]; });
        }
      });
      if constexpr (order == 2) mirror(hessian);
      return std::abs(m.v);
    } else {
      double square = 0.0;
      for_each(minors, [&](auto, const auto& m) __attribute__((always_inline)) { square += m.v * m.v; });
      const double value = std::sqrt(square);
      if (!(value > 0.0)) return 0.0;
      const double inverse = 1.0 / value;
      for_each(minors,
               [&](auto, const auto& m) __attribute__((always_inline)) { add_square(m, inverse, gradient, hessian); });
      if constexpr (order == 2) {
        for (int j = 0; j < n; ++j) {
          for (int i = j; i < n; ++i) hessian[j * n + i] -= inverse * gradient[i] * gradient[j];
        }
        mirror(hessian);
      }
      return value;
    }
  }
};

// Pointers to the kernels for one vector width.
template <typename Arm>
struct Entries {
  void (*residuals)(const double* q, double* r);
  double (*psi)(int set, const double* q, double* gradient, double* hessian);
  double (*potential)(const double* q, const Potential& p);
  double (*potential_gradient)(const double* q, const Potential& p, double* gradient);
  double (*potential_hessian)(const double* q, const Potential& p, double* gradient, double* hessian);
  double (*manipulability)(const double* q);
  double (*manipulability_gradient)(const double* q, double* gradient);
  double (*manipulability_hessian)(const double* q, double* gradient, double* hessian);
};

// One function for each kernel and vector width. The attribute allows the compiler to use the processor's wider vectors
// in the kernel that is inlined into the function.
#define SIGMAIK_ENTRIES(NAME, LANES, ATTRIBUTES)                                                              \
  template <typename Arm>                                                                                     \
  struct NAME {                                                                                               \
    using K = Kernels<Arm, LANES>;                                                                            \
    ATTRIBUTES static void residuals(const double* q, double* r) { K::residuals(q, r); }                      \
    ATTRIBUTES static double psi(int i, const double* q, double* g, double* h) { return K::psi(i, q, g, h); } \
    ATTRIBUTES static double value(const double* q, const Potential& p) { return K::potential(q, p); }        \
    ATTRIBUTES static double gradient(const double* q, const Potential& p, double* g) {                       \
      return K::template potential<1>(q, p, g, nullptr);                                                      \
    }                                                                                                         \
    ATTRIBUTES static double hessian(const double* q, const Potential& p, double* g, double* h) {             \
      return K::template potential<2>(q, p, g, h);                                                            \
    }                                                                                                         \
    ATTRIBUTES static double m(const double* q) { return K::manipulability(q); }                              \
    ATTRIBUTES static double m_gradient(const double* q, double* g) {                                         \
      return K::template manipulability<1>(q, g, nullptr);                                                    \
    }                                                                                                         \
    ATTRIBUTES static double m_hessian(const double* q, double* g, double* h) {                               \
      return K::template manipulability<2>(q, g, h);                                                          \
    }                                                                                                         \
    static constexpr Entries<Arm> all{residuals, psi, value, gradient, hessian, m, m_gradient, m_hessian};    \
  }

SIGMAIK_ENTRIES(Baseline, 2, );
#if defined(__x86_64__) && !defined(SIGMAIK_NO_DISPATCH)
SIGMAIK_ENTRIES(Wide, 4, __attribute__((target("avx2,fma"))));
#endif
#undef SIGMAIK_ENTRIES

template <typename Arm>
const Entries<Arm>& entries() {
#if defined(__x86_64__) && !defined(SIGMAIK_NO_DISPATCH)
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return Wide<Arm>::all;
#endif
  return Baseline<Arm>::all;
}

template <typename Arm>
class ArmModel final : public SingularSets::Model {
 public:
  ArmModel() : run_(entries<Arm>()) {
    name = Arm::kName;
    dof = Arm::kDof;
    residual_count = Kernels<Arm, 2>::kResiduals;
    const auto list = Arm::sets();
    sets.assign(list.begin(), list.end());
  }

  void residuals(const JointRef& q, double* r) const noexcept override { run_.residuals(q.data(), r); }

  double psi(int i, const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept override {
    gradient.resize(dof);
    hessian.resize(dof, dof);
    return run_.psi(i, q.data(), gradient.data(), hessian.data());
  }

  double potential(const JointRef& q, const Potential& p, JointVector* gradient,
                   JointMatrix* hessian) const noexcept override {
    if (gradient == nullptr) return run_.potential(q.data(), p);
    gradient->resize(dof);
    if (hessian == nullptr) return run_.potential_gradient(q.data(), p, gradient->data());
    hessian->resize(dof, dof);
    return run_.potential_hessian(q.data(), p, gradient->data(), hessian->data());
  }

  double manipulability(const JointRef& q, JointVector* gradient, JointMatrix* hessian) const noexcept override {
    if (gradient == nullptr) return run_.manipulability(q.data());
    gradient->resize(dof);
    if (hessian == nullptr) return run_.manipulability_gradient(q.data(), gradient->data());
    hessian->resize(dof, dof);
    return run_.manipulability_hessian(q.data(), gradient->data(), hessian->data());
  }

  Tape residual_tape() const override {
    Tape tape;
    for_each(Arm::residuals(detail::Recording{&tape}),
             [&](auto, const detail::Recorded& r) { tape.results.push_back(r.index); });
    return tape;
  }
  Tape manipulability_tape() const override {
    Tape tape;
    for_each(Arm::minors(detail::Recording{&tape}),
             [&](auto, const detail::Recorded& r) { tape.results.push_back(r.index); });
    return tape;
  }

 private:
  const Entries<Arm>& run_;
};

const std::vector<const SingularSets::Model*>& models() {
  static const ArmModel<detail::ComauRacer> comau;
  static const ArmModel<detail::Panda> panda;
  static const ArmModel<detail::Iiwa14> iiwa;
  static const std::vector<const SingularSets::Model*> all{&comau, &panda, &iiwa};
  return all;
}

// Whether the axes of two chains move in the same way, whatever the transforms before the first and after the last axis
// are. The test compares, for every pair of axes, the cosine of their angle and the reciprocal product of their screws,
// in three postures.
bool same_axes(const Chain& a, const Chain& b) {
  if (a.joint_types() != b.joint_types() || a.dof() != b.dof()) return false;
  const int n = a.dof();
  ChainState x, y;
  for (int posture = 0; posture < 3; ++posture) {
    JointVector q(n);
    for (int i = 0; i < n; ++i) q[i] = std::sin(1.7 * i + 2.3 * posture + 0.4);
    if (!update(a, q, x) || !update(b, q, y)) return false;
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < i; ++j) {
        const auto products = [&](const ChainState& s) {
          const Eigen::Vector3d vi = s.jacobian.col(i).head<3>(), wi = s.jacobian.col(i).tail<3>();
          const Eigen::Vector3d vj = s.jacobian.col(j).head<3>(), wj = s.jacobian.col(j).tail<3>();
          return Eigen::Vector2d(wi.dot(wj), vi.dot(wj) + wi.dot(vj));
        };
        if ((products(x) - products(y)).cwiseAbs().maxCoeff() > 1e-4) return false;
      }
    }
  }
  return true;
}

// A joint about z (sign = 1) or −z (sign = −1). The joint's frame results from the frame before by a rotation by
// `twist` about x, a translation by `length` along x and by `offset` along the new z, and a rotation by `angle` about
// this z.
struct Link {
  double twist, length, offset, angle = 0.0, sign = 1.0;
};

Chain chain_of(const std::vector<Link>& links) {
  std::vector<Segment> segments;
  for (std::size_t i = 0; i < links.size(); ++i) {
    const Link& l = links[i];
    Segment s;
    s.joint_name = "joint_" + std::to_string(i + 1);
    s.link_name = "link_" + std::to_string(i + 1);
    s.type = JointType::Revolute;
    s.origin = Eigen::AngleAxisd(l.twist, Eigen::Vector3d::UnitX()) * Eigen::Translation3d(l.length, 0.0, l.offset) *
               Eigen::AngleAxisd(l.angle, Eigen::Vector3d::UnitZ());
    s.axis = l.sign * Eigen::Vector3d::UnitZ();
    segments.push_back(s);
  }
  return Chain("base", segments);
}

// The kinematics of a model, from the tables of Beck et al. (2022), with the joint angles of the shipped arms.
Chain reference(const std::string& name) {
  constexpr double right = M_PI / 2.0;
  if (name == detail::ComauRacer::kName) {
    using A = detail::ComauRacer;
    return chain_of({{0.0, 0.0, 0.43, 0.0, -1.0},
                     {right, A::a1, 0.0, right, -1.0},
                     {0.0, A::a2, 0.0, right, 1.0},
                     {right, A::a3, A::d4, 0.0, -1.0},
                     {-right, 0.0, 0.0, 0.0, -1.0},
                     {right, 0.0, 0.0, 0.0, -1.0}});
  }
  const auto seven = [&](auto lengths) {
    using L = decltype(lengths);
    return chain_of({{0.0, 0.0, 0.333},
                     {-right, 0.0, 0.0},
                     {right, 0.0, L::d3},
                     {right, L::a4, 0.0},
                     {-right, L::a5, L::d5},
                     {L::twist5 * right, 0.0, 0.0},
                     {right, L::a7, 0.0}});
  };
  return name == detail::Panda::kName ? seven(detail::PandaLengths{}) : seven(detail::IiwaLengths{});
}

}  // namespace

SingularSets SingularSets::load(const std::string& name) {
  std::string known;
  for (const Model* model : models()) {
    if (model->name == name) return SingularSets(model);
    known += (known.empty() ? "" : ", ") + model->name;
  }
  throw Error(detail::message("no singular sets are known of '", name, "'; there are those of ", known));
}

std::vector<std::string> SingularSets::names() {
  std::vector<std::string> all;
  for (const Model* model : models()) all.push_back(model->name);
  return all;
}

std::optional<SingularSets> SingularSets::of(const Chain& chain) {
  for (const Model* model : models()) {
    if (same_axes(chain, reference(model->name))) return SingularSets(model);
  }
  return std::nullopt;
}

const std::string& SingularSets::name() const noexcept { return model_->name; }
int SingularSets::dof() const noexcept { return model_->dof; }
int SingularSets::size() const noexcept { return static_cast<int>(model_->sets.size()); }
const SingularSet& SingularSets::set(int i) const noexcept { return model_->sets[static_cast<std::size_t>(i)]; }
int SingularSets::residual_count() const noexcept { return model_->residual_count; }

int SingularSets::residuals(const JointRef& q, std::array<double, kMaxResiduals>& r) const noexcept {
  model_->residuals(q, r.data());
  return model_->residual_count;
}

int SingularSets::psi(const JointRef& q, std::array<double, kMaxSets>& out) const noexcept {
  double r[kMaxResiduals];
  model_->residuals(q, r);
  const double* from = r;
  for (int i = 0; i < size(); ++i) {
    double& sum = out[static_cast<std::size_t>(i)] = 0.0;
    for (int j = 0; j < set(i).codimension; ++j, ++from) sum += *from * *from;
  }
  return size();
}

double SingularSets::psi(int i, const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept {
  return model_->psi(i, q, gradient, hessian);
}

double SingularSets::potential(const JointRef& q, const Potential& p) const noexcept {
  return model_->potential(q, p, nullptr, nullptr);
}
double SingularSets::potential(const JointRef& q, const Potential& p, JointVector& gradient) const noexcept {
  return model_->potential(q, p, &gradient, nullptr);
}
double SingularSets::potential(const JointRef& q, const Potential& p, JointVector& gradient,
                               JointMatrix& hessian) const noexcept {
  return model_->potential(q, p, &gradient, &hessian);
}

double SingularSets::manipulability(const JointRef& q) const noexcept {
  return model_->manipulability(q, nullptr, nullptr);
}
double SingularSets::manipulability(const JointRef& q, JointVector& gradient) const noexcept {
  return model_->manipulability(q, &gradient, nullptr);
}
double SingularSets::manipulability(const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept {
  return model_->manipulability(q, &gradient, &hessian);
}

Tape SingularSets::residual_tape() const { return model_->residual_tape(); }
Tape SingularSets::manipulability_tape() const { return model_->manipulability_tape(); }

}  // namespace sigmaik
