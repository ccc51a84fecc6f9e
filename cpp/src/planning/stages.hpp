#pragma once
// The linear algebra of double integrators that share one scalar: a Riccati recursion over the stages.
//
// With positions q_k, displacements p_k = h q̇_k and a_k = h² q̈_k the dynamics
//
//     q_{k+1} = q_k + p_k + a_k/2,     p_{k+1} = p_k + a_k
//
// know no step h: A = [I I; 0 I] and B = [I/2; I] only add, and a stage costs little more than the Cholesky factor of
// one n×n matrix and n×2n right-hand sides to it. The step borders the system by one column. Both ends are fixed, so
// the last two controls follow from the node before them. With δq, δp at node N−3 and δp_{N-1} = e at the end:
//
//     δa_{N-3} = −δq − 3/2 δp − e/2,   δq_{N-2} = δq/2 + δp/4 − e/4,   δp_{N-2} = −δq − δp/2 − e/2,
//     δa_{N-2} = δq + δp/2 + 3/2 e
//
// Joints are padded to whole vectors: a padded one has an identity for its Hessian, stands still, and touches no other.

#include <cmath>
#include <cstddef>
#include <vector>

#include "../lanes.hpp"

namespace sigmaik::planning::detail {

using sigmaik::detail::Column;
using sigmaik::detail::splat;

// One number a joint.
template <int W>
struct alignas(64) Row {
  double at[W];
  double& operator[](int i) noexcept { return at[i]; }
  double operator[](int i) const noexcept { return at[i]; }
};

// Row i is at[i].
template <int W>
struct alignas(64) Square {
  double at[W][W];
};

// The quadratic model of a stage in (δq, δp, δa, δh), and what the recursion leaves to solve with it.
template <int W>
struct Stage {
  Square<W> qq;                // Hessian in q: dense, as costs couple the joints
  Row<W> pp, qp, aa;           // diagonals: limits and effort see one joint each
  Row<W> ph, ah;               // with the step
  Row<W> gq, gp, ga;           // gradient
  Square<W> factor;            // Lᵀ (row j is column j of L) of R + BᵀPB = L Lᵀ; its diagonal inverted
  Square<W> wq, wp;            // L⁻¹ BᵀPA
  Row<W> w[2];                 // L⁻¹ (g_a + Bᵀs), for the gradient and for the step's column
  Row<W> dq[2], dp[2], da[2];  // the two solutions
};

template <int W>
inline double dot_rows(const Row<W>& x, const Row<W>& y) noexcept {
  double sum = 0.0;
  for (int i = 0; i < W; ++i) sum += x[i] * y[i];
  return sum;
}

template <int lanes, int W>
SIGMAIK_INLINE Column<lanes, W> operator+(Column<lanes, W> x, const Column<lanes, W>& y) noexcept {
#pragma GCC unroll 8
  for (int i = 0; i < W / lanes; ++i) x.at[i] += y.at[i];
  return x;
}
template <int lanes, int W>
SIGMAIK_INLINE Column<lanes, W> operator-(Column<lanes, W> x, const Column<lanes, W>& y) noexcept {
#pragma GCC unroll 8
  for (int i = 0; i < W / lanes; ++i) x.at[i] -= y.at[i];
  return x;
}
template <int lanes, int W>
SIGMAIK_INLINE Column<lanes, W> operator*(double f, Column<lanes, W> x) noexcept {
  const auto factor = splat<lanes>(f);
#pragma GCC unroll 8
  for (int i = 0; i < W / lanes; ++i) x.at[i] = factor * x.at[i];
  return x;
}

template <int lanes, int W>
struct Recursion {
  using C = Column<lanes, W>;
  using Stages = std::vector<Stage<W>>;

  // Factorises. False where the reduced Hessian is not positive definite: the model has no minimum then.
  static SIGMAIK_INLINE bool factorise(Stages& stages, int nodes) noexcept {
    Square<W> vqq, vqp, vpp, vpq;  // the value function ½ δyᵀ [qq qp; pq pp] δy of what lies behind a stage
    start_value(stages[static_cast<std::size_t>(nodes - 3)], stages[static_cast<std::size_t>(nodes - 2)], vqq, vqp,
                vpp);
    for (int k = nodes - 4; k >= 0; --k) {
      Stage<W>& s = stages[static_cast<std::size_t>(k)];
      for (int j = 0; j < W; ++j) {
        for (int i = 0; i < W; ++i) vpq.at[i][j] = vqp.at[j][i];
      }
      reduce(s, vqq, vqp, vpp, vpq);
      if (!eliminate(s)) return false;
      if (k == 0) break;
      step_back(s, vqq, vqp, vpp, vpq);
    }
    return true;
  }

  // Solutions of the factorised model: [0] for its gradient with the step held, [1] for a unit change of the step,
  // which moves the ends: δp_0 = start, δp_{N-1} = end.
  static SIGMAIK_INLINE void solve(Stages& stages, int nodes, const Row<W>& start, const Row<W>& end) noexcept {
    const C e = load(end);
    C sq[2], sp[2];  // the value function's gradients
    start_gradients(stages[static_cast<std::size_t>(nodes - 3)], stages[static_cast<std::size_t>(nodes - 2)], end, sq,
                    sp);
    sweep_back(stages, nodes, sq, sp);
    Row<W> q[2]{}, p[2]{};
    p[1] = start;
    for (int k = 0; k < nodes - 1; ++k) {
      Stage<W>& s = stages[static_cast<std::size_t>(k)];
      for (int c = 0; c < 2; ++c) {
        s.dq[c] = q[c];
        s.dp[c] = p[c];
        Row<W>& a = s.da[c];
        const C x = load(q[c]), v = load(p[c]);
        if (k < nodes - 3) {
          control(s, c, x, v, a);
        } else if (k == nodes - 3) {
          C out = -1.0 * x - 1.5 * v;
          if (c == 1) out = out - 0.5 * e;
          out.store(a.at);
        } else {
          C out = -1.0 * v;
          if (c == 1) out = out + e;
          out.store(a.at);
        }
        const C da = load(a);
        (x + v + 0.5 * da).store(q[c].at);
        (v + da).store(p[c].at);
      }
    }
  }

 private:
  static SIGMAIK_INLINE C load(const double (&x)[W]) noexcept { return C::load(x); }
  static SIGMAIK_INLINE C load(const Row<W>& x) noexcept { return C::load(x.at); }

  // L⁻¹ x in place: rows of `factor` are L's columns.
  static SIGMAIK_INLINE void forward(const Square<W>& factor, Row<W>& x) noexcept {
    C r = load(x);
    for (int j = 0; j < W; ++j) {
      r.store(x.at);
      const double xj = x[j] * factor.at[j][j];
      r = r - xj * load(factor.at[j]);
      r.store(x.at);
      x[j] = xj;
      r = load(x);
    }
  }

  // S x for a symmetric S.
  static SIGMAIK_INLINE C times(const Square<W>& s, const Row<W>& x) noexcept {
    C y = x[0] * load(s.at[0]);
    for (int j = 1; j < W; ++j) y = y + x[j] * load(s.at[j]);
    return y;
  }

  // The value function at node N−3: its two controls follow from it and the end.
  static SIGMAIK_INLINE void start_value(const Stage<W>& s1, const Stage<W>& s2, Square<W>& vqq, Square<W>& vqp,
                                         Square<W>& vpp) noexcept {
    for (int j = 0; j < W; ++j) {
      const C h = load(s2.qq.at[j]);
      (load(s1.qq.at[j]) + 0.25 * h).store(vqq.at[j]);
      (0.125 * h).store(vqp.at[j]);
      (0.0625 * h).store(vpp.at[j]);
      const double last = s2.pp[j] + s2.aa[j];
      vqq.at[j][j] += s1.aa[j] + last - s2.qp[j];
      vqp.at[j][j] += s1.qp[j] + 1.5 * s1.aa[j] + 0.5 * (last - s2.qp[j]);
      vpp.at[j][j] += s1.pp[j] + 2.25 * s1.aa[j] + 0.25 * (last - s2.qp[j]);
    }
  }

  // BᵀPA and R + BᵀPB.
  static SIGMAIK_INLINE void reduce(Stage<W>& s, const Square<W>& vqq, const Square<W>& vqp, const Square<W>& vpp,
                                    const Square<W>& vpq) noexcept {
    Square<W>& l = s.factor;
    for (int j = 0; j < W; ++j) {
      const C qq = load(vqq.at[j]), qp = load(vqp.at[j]), pq = load(vpq.at[j]), pp = load(vpp.at[j]);
      const C gq = 0.5 * qq + pq, gp = gq + 0.5 * qp + pp;
      gq.store(s.wq.at[j]);
      gp.store(s.wp.at[j]);
      (0.25 * qq + 0.5 * (qp + pq) + pp).store(l.at[j]);
      l.at[j][j] += s.aa[j];
    }
  }

  // Cholesky's factor L, and L⁻¹ BᵀPA with it. False where a pivot is not positive.
  static SIGMAIK_INLINE bool eliminate(Stage<W>& s) noexcept {
    Square<W>& l = s.factor;
    for (int j = 0; j < W; ++j) {
      const double pivot = l.at[j][j];
      if (!(pivot > 0.0)) return false;
      const double inverse = 1.0 / std::sqrt(pivot);
      for (int i = 0; i < j; ++i) l.at[j][i] = 0.0;
      const C column = inverse * load(l.at[j]), wq = inverse * load(s.wq.at[j]), wp = inverse * load(s.wp.at[j]);
      column.store(l.at[j]);
      wq.store(s.wq.at[j]);
      wp.store(s.wp.at[j]);
      for (int c = j + 1; c < W; ++c) {
        const double f = l.at[j][c];
        (load(l.at[c]) - f * column).store(l.at[c]);
        (load(s.wq.at[c]) - f * wq).store(s.wq.at[c]);
        (load(s.wp.at[c]) - f * wp).store(s.wp.at[c]);
      }
      l.at[j][j] = inverse;
    }
    return true;
  }

  // P ← Q + AᵀPA − WᵀW.
  static SIGMAIK_INLINE void step_back(const Stage<W>& s, Square<W>& vqq, Square<W>& vqp, Square<W>& vpp,
                                       const Square<W>& vpq) noexcept {
    for (int j = 0; j < W; ++j) {
      C qq = load(vqq.at[j]);
      C qp = qq + load(vqp.at[j]);
      C pp = qp + load(vpq.at[j]) + load(vpp.at[j]);
      qq = qq + load(s.qq.at[j]);
      for (int r = 0; r < W; ++r) {
        const C wq = load(s.wq.at[r]), wp = load(s.wp.at[r]);
        qq = qq - s.wq.at[r][j] * wq;
        qp = qp - s.wq.at[r][j] * wp;
        pp = pp - s.wp.at[r][j] * wp;
      }
      qq.store(vqq.at[j]);
      qp.store(vqp.at[j]);
      pp.store(vpp.at[j]);
      vqp.at[j][j] += s.qp[j];
      vpp.at[j][j] += s.pp[j];
    }
  }

  // The value function's gradients at node N−3.
  static SIGMAIK_INLINE void start_gradients(const Stage<W>& s1, const Stage<W>& s2, const Row<W>& end, C (&sq)[2],
                                             C (&sp)[2]) noexcept {
    Row<W> q2;
    (-0.25 * load(end)).store(q2.at);
    Row<W> a1, gp2, ga2, gq2_end;
    for (int i = 0; i < W; ++i) {
      a1[i] = s1.ah[i] - 0.5 * s1.aa[i] * end[i];
      gp2[i] = s2.ph[i] - (0.5 * s2.pp[i] + 0.25 * s2.qp[i]) * end[i];
      gq2_end[i] = -0.5 * s2.qp[i] * end[i];
      ga2[i] = s2.ah[i] + 1.5 * s2.aa[i] * end[i];
    }
    const C gq2[2] = {load(s2.gq), times(s2.qq, q2) + load(gq2_end)};
    const C ga1s[2] = {load(s1.ga), load(a1)};
    const C last[2] = {load(s2.ga) - load(s2.gp), load(ga2) - load(gp2)};
    for (int c = 0; c < 2; ++c) {
      sq[c] = 0.5 * gq2[c] + last[c] - ga1s[c];
      sp[c] = 0.25 * gq2[c] + 0.5 * last[c] - 1.5 * ga1s[c];
    }
    sq[0] = sq[0] + load(s1.gq);
    sp[0] = sp[0] + load(s1.gp);
    sp[1] = sp[1] + load(s1.ph);
  }

  // Leaves each stage's L⁻¹ (g_a + Bᵀs), as the gradients pass it on their way to the start.
  static SIGMAIK_INLINE void sweep_back(Stages& stages, int nodes, C (&sq)[2], C (&sp)[2]) noexcept {
    for (int k = nodes - 4; k >= 0; --k) {
      Stage<W>& s = stages[static_cast<std::size_t>(k)];
      (load(s.ga) + 0.5 * sq[0] + sp[0]).store(s.w[0].at);
      (load(s.ah) + 0.5 * sq[1] + sp[1]).store(s.w[1].at);
      forward(s.factor, s.w[0]);
      forward(s.factor, s.w[1]);
      if (k == 0) break;
      sp[0] = sp[0] + sq[0] + load(s.gp);
      sp[1] = sp[1] + sq[1] + load(s.ph);
      sq[0] = sq[0] + load(s.gq);
      for (int r = 0; r < W; ++r) {
        const C wq = load(s.wq.at[r]), wp = load(s.wp.at[r]);
        for (int c = 0; c < 2; ++c) {
          sq[c] = sq[c] - s.w[c][r] * wq;
          sp[c] = sp[c] - s.w[c][r] * wp;
        }
      }
    }
  }

  // The control a = −L⁻ᵀ (w + W δy) of a stage.
  static SIGMAIK_INLINE void control(const Stage<W>& s, int c, const C& x, const C& v, Row<W>& a) noexcept {
    for (int r = 0; r < W; ++r) {
      const C sum = product(load(s.wq.at[r]), x) + product(load(s.wp.at[r]), v);
      a[r] = s.w[c][r] + total(sum);
    }
    for (int j = W - 1; j >= 0; --j) {  // a ← −L⁻ᵀ a; what is done stands negated
      double rest = a[j];
      for (int i = j + 1; i < W; ++i) rest += s.factor.at[j][i] * a[i];
      a[j] = -rest * s.factor.at[j][j];
    }
  }

  static SIGMAIK_INLINE C product(C x, const C& y) noexcept {
#pragma GCC unroll 8
    for (int i = 0; i < W / lanes; ++i) x.at[i] *= y.at[i];
    return x;
  }
  static SIGMAIK_INLINE double total(const C& x) noexcept {
    auto s = x.at[0];
#pragma GCC unroll 8
    for (int i = 1; i < W / lanes; ++i) s += x.at[i];
    return sigmaik::detail::sum(s);
  }
};

}  // namespace sigmaik::planning::detail
