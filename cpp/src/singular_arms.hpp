#pragma once
// The singular sets of each known arm. Values, derivatives, recorded expressions and texts all come from one
// description.
//
// `residuals` and `minors` are templates over the scalar: x.s(q4) and x.c(q4) are sin and cos of the chain's fourth
// joint. The squares of the minors add up to m² = det(JJᵀ). The Comau has a spherical wrist, which leaves one minor.
// Axes 1 to 3 of both seven-joint arms meet in the shoulder. About this point, m² is a sum over 3×3 minors of the
// moments of axes 4 to 7 (Cauchy-Binet formula).

#include <array>
#include <tuple>

#include <sigmaik/singularities.hpp>

#include "jets.hpp"

namespace sigmaik::detail {

inline constexpr Joint<1> q2{};
inline constexpr Joint<2> q3{};
inline constexpr Joint<3> q4{};
inline constexpr Joint<4> q5{};
inline constexpr Joint<5> q6{};

struct ComauRacer {
  static constexpr const char* kName = "comau_racer_7_1_4";
  static constexpr int kDof = 6, kSets = 3;
  static constexpr std::array<int, kSets> kCodimension{1, 1, 1};
  static std::array<SingularSet, kSets> sets() {
    return {
        {{"wrist", "sin q5 = 0", 1, {4}},
         {"elbow", "sin(q3 + 0.1878184) = 0: shoulder, elbow and wrist in line", 1, {2}},
         {"shoulder", "0.15 + 0.59 sin q2 - 0.13 cos(q3 - q2) - 0.684 sin(q3 - q2) = 0: wrist on axis 1", 1, {1, 2}}}};
  }
  static constexpr double a1 = 0.15, a2 = 0.59, a3 = 0.13, d4 = 0.684;
  static constexpr double l = 0.6962442100297855;  // √(a3² + d4²)

  // The paper's angles are θ2 = π/2 − q2 and θ3 = q3 + π/2, hence θ2 + θ3 = π + q3 − q2.
  template <typename X>
  static SIGMAIK_INLINE auto elbow(const X& x) {
    return a3 * x.c(q3) + d4 * x.s(q3);  // a3 sin θ3 − d4 cos θ3
  }
  template <typename X>
  static SIGMAIK_INLINE auto radius(const X& x) {  // from axis 1 to the wrist
    return x.s(q2) * (a3 * -1.0 * x.s(q3) + d4 * x.c(q3) + a2) + x.c(q2) * (-a3 * x.c(q3) + -d4 * x.s(q3)) + a1;
  }
  template <typename X>
  static SIGMAIK_INLINE auto residuals(const X& x) {
    return std::tuple(x.s(q5), (1.0 / l) * elbow(x), (1.0 / (a2 + l)) * radius(x));
  }
  template <typename X>
  static SIGMAIK_INLINE auto minors(const X& x) {
    return std::tuple(a2 * (x.s(q5) * (elbow(x) * radius(x))));
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

// P is the distance of axis 5 from the shoulder. (−C, A) is the position of the wrist relative to the shoulder. K is
// zero if shoulder, elbow and wrist lie on one line. F and cos q5 are zero if the moments of axes 4, 6 and 7 lie in a
// plane.
template <typename L, typename X>
struct SevenJoints {
  using Elbow = decltype(1.0 * std::declval<X>().s(q4) + 1.0 * std::declval<X>().c(q4));
  using Wrist = decltype(std::declval<X>().s(q6) * std::declval<Elbow>());
  static constexpr double d3 = L::d3, d5 = L::d5, a4 = L::a4, a5 = L::a5, a7 = L::a7;
  Elbow P, A, B, C, K;
  Wrist F;
  SIGMAIK_INLINE explicit SevenJoints(const X& x)
      : P(d3 * x.s(q4) + a4 * x.c(q4) + a5),
        A(a5 * x.s(q4) + d5 * x.c(q4) + d3),
        B(-a4 * x.s(q4) + d3 * x.c(q4) + d5),
        C(d5 * x.s(q4) + -a5 * x.c(q4) + -a4),
        K((d3 * d5 + a4 * a5) * x.s(q4) + (a4 * d5 - d3 * a5) * x.c(q4)),  // d3 C + a4 A
        F(x.s(q6) * K + a7 * (P + -a5)) {}
};

template <typename L, typename X>
SIGMAIK_INLINE auto seven_joint_minors(const X& x) {
  const SevenJoints<L, X> e(x);
  // One declaration each: a jet's type tells which joints the value depends on.
  const auto s2 = x.s(q2);
  const auto c2 = x.c(q2);
  const auto s3 = x.s(q3);
  const auto c3 = x.c(q3);
  const auto s5 = x.s(q5);
  const auto c5 = x.c(q5);
  const auto k5 = c5 * e.K;
  const auto sp = s5 * e.P;
  const auto cp = c5 * e.P;
  const auto d5 = e.B * (s5 * s5 * e.F) + k5 * (L::twist5 * (x.c(q6) * e.P) + c5 * (e.B * x.s(q6) + L::a7));
  const auto hx = e.C * e.F + (L::a4 * L::a7) * (c5 * cp);
  const auto hy = (-L::a5 * L::a7) * (s5 * cp);
  const auto hz = e.A * e.F + (-L::d3 * L::a7) * (c5 * cp);
  const auto u = c3 * hx - s3 * hy;
  const auto w = s3 * hx + c3 * hy;
  return std::tuple(L::a7 * (s2 * (sp * cp)), s2 * d5, s2 * (sp * e.F), s2 * (e.P * k5), s2 * w, u, s2 * hz - c2 * u);
}

struct Iiwa14 {
  static constexpr const char* kName = "kuka_lbr_iiwa_14_r820";
  static constexpr int kDof = 7, kSets = 4;
  static constexpr std::array<int, kSets> kCodimension{1, 2, 2, 2};
  static std::array<SingularSet, kSets> sets() {
    return {{{"elbow", "sin q4 = 0: stretched or folded", 1, {3}},
             {"shoulder", "sin q2 = 0 and cos q3 = 0", 2, {1, 2}},
             {"shoulder-wrist", "sin q2 = 0 and sin q6 = 0", 2, {1, 5}},
             {"wrist", "cos q5 = 0 and sin q6 = 0", 2, {4, 5}}}};
  }
  template <typename X>
  static SIGMAIK_INLINE auto residuals(const X& x) {
    return std::tuple(x.s(q4), x.s(q2), x.c(q3), x.s(q2), x.s(q6), x.c(q5), x.s(q6));
  }
  template <typename X>
  static SIGMAIK_INLINE auto minors(const X& x) {
    return seven_joint_minors<IiwaLengths>(x);
  }
};

struct Panda {
  static constexpr const char* kName = "franka_panda";
  static constexpr int kDof = 7, kSets = 4;
  static constexpr std::array<int, kSets> kCodimension{2, 2, 2, 2};
  static std::array<SingularSet, kSets> sets() {
    return {{{"wrist", "cos q5 = 0 and K(q4) sin q6 + 0.088 (0.316 sin q4 + 0.0825 cos q4) = 0", 2, {3, 4, 5}},
             {"elbow",
              "sin q5 = 0 and K(q4) = 0.12827 sin(q4 + 0.467002) = 0: shoulder, elbow and wrist in line",
              2,
              {3, 4}},
             {"shoulder", "sin q2 = 0 and g(q3, q4, q5, q6) = 0", 2, {1, 2, 3, 4, 5}},
             {"shoulder-wrist", "q4 = 0 and sin q6 = -0.12571: shoulder on axes 5 and 7", 2, {3, 5}}}};
  }
  using L = PandaLengths;
  static constexpr double rho3 = 0.3265918706887849, rho5 = 0.39276233271534583;  // √(d3² + a4²), √(d5² + a5²)

  template <typename X>
  static SIGMAIK_INLINE auto residuals(const X& x) {
    const SevenJoints<L, X> e(x);
    const auto c5 = x.c(q5);
    // c3 C F + a7 c5 P (a4 c3 c5 + a5 s3 s5)
    const auto p = L::a7 * (c5 * e.P);
    const auto g = x.c(q3) * (e.C * e.F + L::a4 * (p * c5)) + x.s(q3) * (L::a5 * (p * x.s(q5)));
    return std::tuple(c5, (1.0 / (rho3 * rho5)) * e.F, x.s(q5), (1.0 / (rho3 * rho5)) * e.K, x.s(q2),
                      (1.0 / (rho3 * rho5 * rho5)) * g, (1.0 / rho3) * e.P,
                      (1.0 / (L::d3 + L::d5)) * (e.B * x.s(q6) + L::a7));
  }
  template <typename X>
  static SIGMAIK_INLINE auto minors(const X& x) {
    return seven_joint_minors<L>(x);
  }
};

}  // namespace sigmaik::detail
