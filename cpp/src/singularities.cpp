#include <sigmaik/singularities.hpp>

#include <cmath>
#include <type_traits>

#include <sigmaik/error.hpp>
#include <sigmaik/kinematics.hpp>

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

using detail::Jet1;
using detail::Jet2;
using detail::Recorded;

// sin and cos of the joints that matter, as scalars of any kind.
template <typename Arm, typename T>
struct SinCos {
  T s[Arm::kDof], c[Arm::kDof];

  explicit SinCos(const JointRef& q) noexcept {
    for (int i = Arm::kFirst, k = 0; k < Arm::kVariables; ++i, ++k) {
      double sine, cosine;
      ::sincos(q[i], &sine, &cosine);
      if constexpr (std::is_same_v<T, double>) {
        s[i] = sine;
        c[i] = cosine;
      } else {
        s[i] = T::of(k, sine, cosine, -sine);
        c[i] = T::of(k, cosine, -sine, -cosine);
      }
    }
  }
};

template <typename Arm>
class ArmModel final : public SingularSets::Model {
  static constexpr int K = Arm::kVariables;
  using First = Jet1<K>;
  using Second = Jet2<K>;

 public:
  ArmModel() {
    name = Arm::kName;
    dof = Arm::kDof;
    residual_count = Arm::kResiduals;
    const auto list = Arm::sets();
    sets.assign(list.begin(), list.end());
  }

  void residuals(const JointRef& q, double* r) const noexcept override {
    const SinCos<Arm, double> x(q);
    Arm::residuals(x.s, x.c, r);
  }

  double psi(int i, const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept override {
    const SinCos<Arm, Second> x(q);
    Second r[Arm::kResiduals];
    Arm::residuals(x.s, x.c, r);
    int at = 0;
    for (int j = 0; j < i; ++j) at += Arm::kCodimension[static_cast<std::size_t>(j)];
    const Second sum = square_sum(r + at, Arm::kCodimension[static_cast<std::size_t>(i)]);
    clear(&gradient, &hessian);
    add(sum, 1.0, 0.0, &gradient, &hessian);
    return sum.v;
  }

  double potential(const JointRef& q, const Potential& p, JointVector* gradient,
                   JointMatrix* hessian) const noexcept override {
    if (hessian != nullptr) return potential_of<Second>(q, p, gradient, hessian);
    if (gradient != nullptr) return potential_of<First>(q, p, gradient, hessian);
    double r[Arm::kResiduals];
    residuals(q, r);
    double sum = 0.0;
    const double* from = r;
    for (std::size_t i = 0; i < Arm::kSets; ++i) {
      const double psi = square_sum(from, Arm::kCodimension[i]);
      from += Arm::kCodimension[i];
      sum += p.weights[i] * std::exp(p.eta1 - p.eta2 * psi);
    }
    return sum;
  }

  double manipulability(const JointRef& q, JointVector* gradient, JointMatrix* hessian) const noexcept override {
    if (hessian != nullptr) return manipulability_of<Second>(q, gradient, hessian);
    if (gradient != nullptr) return manipulability_of<First>(q, gradient, hessian);
    const SinCos<Arm, double> x(q);
    double m[Arm::kMinors];
    Arm::minors(x.s, x.c, m);
    return std::sqrt(square_sum(m, Arm::kMinors));
  }

  Tape residual_tape() const override {
    return record<Arm::kResiduals>([](const auto* s, const auto* c, auto* out) { Arm::residuals(s, c, out); });
  }
  Tape manipulability_tape() const override {
    return record<Arm::kMinors>([](const auto* s, const auto* c, auto* out) { Arm::minors(s, c, out); });
  }

 private:
  template <typename T>
  static T square_sum(const T* r, int count) noexcept {
    T sum = r[0] * r[0];
    for (int i = 1; i < count; ++i) sum = sum + r[i] * r[i];
    return sum;
  }

  static void clear(JointVector* gradient, JointMatrix* hessian) noexcept {
    gradient->setZero(Arm::kDof);
    if (hessian != nullptr) hessian->setZero(Arm::kDof, Arm::kDof);
  }

  // Adds a times the jet's gradient, and a times its Hessian plus b times its gradient's square.
  static void add(const First& x, double a, double /*b*/, JointVector* gradient, JointMatrix* /*hessian*/) noexcept {
    for (int i = 0; i < K; ++i) (*gradient)[Arm::kFirst + i] += a * x.g[i];
  }
  static void add(const Second& x, double a, double b, JointVector* gradient, JointMatrix* hessian) noexcept {
    for (int i = 0, at = 0; i < K; ++i) {
      (*gradient)[Arm::kFirst + i] += a * x.g[i];
      for (int j = 0; j <= i; ++j, ++at) {
        const double value = a * x.h[at] + b * x.g[i] * x.g[j];
        (*hessian)(Arm::kFirst + i, Arm::kFirst + j) += value;
        if (i != j) (*hessian)(Arm::kFirst + j, Arm::kFirst + i) += value;
      }
    }
  }

  // ∇φ = −η₂ φ ∇ψ,  ∇²φ = φ (η₂² ∇ψ∇ψᵀ − η₂ ∇²ψ).
  template <typename T>
  double potential_of(const JointRef& q, const Potential& p, JointVector* gradient, JointMatrix* hessian) const noexcept {
    const SinCos<Arm, T> x(q);
    T r[Arm::kResiduals];
    Arm::residuals(x.s, x.c, r);
    clear(gradient, hessian);
    double sum = 0.0;
    const T* from = r;
    for (std::size_t i = 0; i < Arm::kSets; ++i) {
      const T psi = square_sum(from, Arm::kCodimension[i]);
      from += Arm::kCodimension[i];
      const double phi = p.weights[i] * std::exp(p.eta1 - p.eta2 * psi.v);
      sum += phi;
      add(psi, -p.eta2 * phi, p.eta2 * p.eta2 * phi, gradient, hessian);
    }
    return sum;
  }

  // ∇m = ∇(m²)/2m,  ∇²m = (∇²(m²)/2 − ∇m∇mᵀ)/m; of a single minor, without the cancellation.
  template <typename T>
  double manipulability_of(const JointRef& q, JointVector* gradient, JointMatrix* hessian) const noexcept {
    const SinCos<Arm, T> x(q);
    T m[Arm::kMinors];
    Arm::minors(x.s, x.c, m);
    clear(gradient, hessian);
    if constexpr (Arm::kMinors == 1) {
      add(m[0], m[0].v > 0.0 ? 1.0 : m[0].v < 0.0 ? -1.0 : 0.0, 0.0, gradient, hessian);
      return std::abs(m[0].v);
    } else {
      const T square = square_sum(m, Arm::kMinors);
      const double value = std::sqrt(square.v);
      if (!(value > 0.0)) return 0.0;
      add(square, 0.5 / value, -0.25 / (square.v * value), gradient, hessian);
      return value;
    }
  }

  template <int kCount, typename Function>
  static Tape record(Function function) {
    Tape tape;
    Recorded s[Arm::kDof], c[Arm::kDof], out[kCount];
    for (int i = Arm::kFirst; i < Arm::kFirst + K; ++i) {
      s[i] = Recorded::record(&tape, {Operation::Sin, i});
      c[i] = Recorded::record(&tape, {Operation::Cos, i});
    }
    function(s, c, out);
    for (const Recorded& result : out) tape.results.push_back(result.index);
    return tape;
  }
};

const std::vector<const SingularSets::Model*>& models() {
  static const ArmModel<detail::ComauRacer> comau;
  static const ArmModel<detail::Panda> panda;
  static const ArmModel<detail::Iiwa14> iiwa;
  static const std::vector<const SingularSets::Model*> all{&comau, &panda, &iiwa};
  return all;
}

// Whether two chains' axes move alike, whatever stands before the first and behind the last: for every pair of axes, the
// cosine of their angle and the product of their screws are the same, in three postures.
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

// A joint about z, or −z, in a frame that is turned by `twist` about x and moved by `length` along it, then moved by
// `offset` along z and turned by `angle` about it.
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

// The kinematics that a model stands for, by the tables of Beck et al. (2022) and in the angles of the shipped arms.
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
