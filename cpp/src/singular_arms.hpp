#pragma once
// What is known of each arm: one description, from which values, derivatives, expressions and texts come.
//
// `residuals` and `minors` are templates over the scalar; s[i], c[i] are sin and cos of the chain's joint i. The squares of
// the minors add up to m² = det(JJᵀ). The Comau's come from its spherical wrist. Both seven-joint arms have axes 1 to 3
// through the shoulder: about that point m² is a sum over 3×3 minors of the moments of axes 4 to 7 (Cauchy-Binet).

#include <array>

#include <sigmaik/singularities.hpp>

#include "lanes.hpp"

namespace sigmaik::detail {

struct ComauRacer {
  static constexpr const char* kName = "comau_racer_7_1_4";
  static constexpr int kDof = 6, kFirst = 1, kVariables = 4, kSets = 3, kResiduals = 3, kMinors = 1;
  static constexpr std::array<int, kSets> kCodimension{1, 1, 1};
  static std::array<SingularSet, kSets> sets() {
    return {{{"wrist", "sin q5 = 0", 1, {4}},
             {"elbow", "sin(q3 + 0.1878184) = 0: shoulder, elbow and wrist in line", 1, {2}},
             {"shoulder", "0.15 + 0.59 sin q2 - 0.13 cos(q3 - q2) - 0.684 sin(q3 - q2) = 0: wrist on axis 1", 1, {1, 2}}}};
  }
  static constexpr double a1 = 0.15, a2 = 0.59, a3 = 0.13, d4 = 0.684;
  static constexpr double l = 0.6962442100297855;  // √(a3² + d4²)

  // The paper's angles are θ2 = π/2 − q2 and θ3 = q3 + π/2, so that θ2 + θ3 = π + q3 − q2.
  template <typename T>
  struct Parts {
    T elbow, radius;  // a3 sin θ3 − d4 cos θ3, and the wrist's distance from axis 1
    SIGMAIK_INLINE Parts(const T* s, const T* c)
        : elbow(a3 * c[2] + d4 * s[2]),
          radius(a2 * s[1] + (-a3) * (c[2] * c[1] + s[2] * s[1]) + (-d4) * (s[2] * c[1] - c[2] * s[1]) + a1) {}
  };
  template <typename T>
  static SIGMAIK_INLINE void residuals(const T* s, const T* c, T* r) {
    const Parts<T> p(s, c);
    r[0] = s[4];
    r[1] = (1.0 / l) * p.elbow;
    r[2] = (1.0 / (a2 + l)) * p.radius;
  }
  template <typename T>
  static SIGMAIK_INLINE void minors(const T* s, const T* c, T* m) {
    const Parts<T> p(s, c);
    m[0] = a2 * (s[4] * p.elbow * p.radius);
  }
};

struct IiwaLengths {
  static constexpr double d3 = 0.42, d5 = 0.40, a4 = 0.0, a5 = 0.0, a7 = 0.0;
  static constexpr double twist5 = -1.0;  // axis 6 leans to the other side of axis 5
};
struct PandaLengths {
  static constexpr double d3 = 0.316, d5 = 0.384, a4 = 0.0825, a5 = -0.0825, a7 = 0.088;
  static constexpr double twist5 = 1.0;
};

// Of axis 5: P its distance from the shoulder; (−C, A) the wrist as the shoulder sees it; K is zero where shoulder, elbow
// and wrist are in line; F, with cos q5, where the moments of axes 4, 6 and 7 lie in a plane.
template <typename Lengths, typename T>
struct SevenJoints : Lengths {
  using Lengths::a4, Lengths::a5, Lengths::a7, Lengths::d3, Lengths::d5;
  T P, A, B, C, K, F;
  SIGMAIK_INLINE SevenJoints(const T* s, const T* c)
      : P(a4 * c[3] + d3 * s[3] + a5),
        A(a5 * s[3] + d5 * c[3] + d3),
        B((-a4) * s[3] + d3 * c[3] + d5),
        C((-a5) * c[3] + d5 * s[3] + (-a4)),
        K(d3 * C + a4 * A),
        F(s[5] * K + a7 * (P + (-a5))) {}
};

template <typename Lengths, typename T>
SIGMAIK_INLINE void seven_joint_minors(const T* s, const T* c, T* m) {
  using L = Lengths;
  const SevenJoints<L, T> e(s, c);
  const T& F = e.F;
  const T k5 = c[4] * e.K, t = s[4] * e.P;
  const T cp = c[4] * e.P;
  const T d5 = e.B * (s[4] * s[4] * F) + k5 * (L::twist5 * (c[5] * e.P) + c[4] * (e.B * s[5] + L::a7));
  const T hx = e.C * F + (L::a4 * L::a7) * (c[4] * cp);
  const T hz = e.A * F - (L::d3 * L::a7) * (c[4] * cp);
  const T hy = (-L::a5 * L::a7) * (s[4] * cp);
  const T u = c[2] * hx - s[2] * hy, w = s[2] * hx + c[2] * hy;  // both negated
  m[0] = L::a7 * (s[1] * (t * cp));
  m[1] = s[1] * d5;
  m[2] = s[1] * (t * F);
  m[3] = s[1] * (e.P * k5);
  m[4] = s[1] * w;
  m[5] = u;
  m[6] = s[1] * hz - c[1] * u;
}

struct Iiwa14 {
  static constexpr const char* kName = "kuka_lbr_iiwa_14_r820";
  static constexpr int kDof = 7, kFirst = 1, kVariables = 5, kSets = 4, kResiduals = 7, kMinors = 7;
  static constexpr std::array<int, kSets> kCodimension{1, 2, 2, 2};
  static std::array<SingularSet, kSets> sets() {
    return {{{"elbow", "sin q4 = 0: stretched or folded", 1, {3}},
             {"shoulder", "sin q2 = 0 and cos q3 = 0", 2, {1, 2}},
             {"shoulder-wrist", "sin q2 = 0 and sin q6 = 0", 2, {1, 5}},
             {"wrist", "cos q5 = 0 and sin q6 = 0", 2, {4, 5}}}};
  }
  template <typename T>
  static SIGMAIK_INLINE void residuals(const T* s, const T* c, T* r) {
    r[0] = s[3];
    r[1] = s[1];
    r[2] = c[2];
    r[3] = s[1];
    r[4] = s[5];
    r[5] = c[4];
    r[6] = s[5];
  }
  template <typename T>
  static SIGMAIK_INLINE void minors(const T* s, const T* c, T* m) {
    seven_joint_minors<IiwaLengths>(s, c, m);
  }
};

struct Panda {
  static constexpr const char* kName = "franka_panda";
  static constexpr int kDof = 7, kFirst = 1, kVariables = 5, kSets = 4, kResiduals = 8, kMinors = 7;
  static constexpr std::array<int, kSets> kCodimension{2, 2, 2, 2};
  static std::array<SingularSet, kSets> sets() {
    return {{{"wrist", "cos q5 = 0 and K(q4) sin q6 + 0.088 (0.316 sin q4 + 0.0825 cos q4) = 0", 2, {3, 4, 5}},
             {"elbow", "sin q5 = 0 and K(q4) = 0.12827 sin(q4 + 0.467002) = 0: shoulder, elbow and wrist in line", 2, {3, 4}},
             {"shoulder", "sin q2 = 0 and g(q3, q4, q5, q6) = 0", 2, {1, 2, 3, 4, 5}},
             {"shoulder-wrist", "q4 = 0 and sin q6 = -0.12571: shoulder on axes 5 and 7", 2, {3, 5}}}};
  }
  using L = PandaLengths;
  static constexpr double rho3 = 0.3265918706887849, rho5 = 0.39276233271534583;  // √(d3² + a4²), √(d5² + a5²)

  template <typename T>
  static SIGMAIK_INLINE void residuals(const T* s, const T* c, T* r) {
    const SevenJoints<L, T> e(s, c);
    const T g = c[2] * (e.C * e.F) + L::a7 * (c[4] * e.P * (L::a4 * (c[2] * c[4]) + L::a5 * (s[2] * s[4])));
    r[0] = c[4];
    r[1] = (1.0 / (rho3 * rho5)) * e.F;
    r[2] = s[4];
    r[3] = (1.0 / (rho3 * rho5)) * e.K;
    r[4] = s[1];
    r[5] = (1.0 / (rho3 * rho5 * rho5)) * g;
    r[6] = (1.0 / rho3) * e.P;
    r[7] = (1.0 / (L::d3 + L::d5)) * (e.B * s[5] + L::a7);
  }
  template <typename T>
  static SIGMAIK_INLINE void minors(const T* s, const T* c, T* m) {
    seven_joint_minors<L>(s, c, m);
  }
};

}  // namespace sigmaik::detail
