#pragma once
// Scalar types for the formulas in singular_arms.hpp, which are templates over the scalar: truncated Taylor series
// (jets) whose joints are known at compile time, and a recorder of operations. The formulas use only x·y, x + y, x − y,
// number·x and x + number.

#include <bit>
#include <utility>

#include <sigmaik/singularities.hpp>

#include "lanes.hpp"

namespace sigmaik::detail {

// The index of a joint as a type.
template <int i>
using Joint = std::integral_constant<int, i>;

// Calls f(Joint<i>) for every bit i of mask.
template <unsigned mask, typename Function>
SIGMAIK_INLINE void for_joints(Function&& f) {
  if constexpr (mask != 0) {
    f(Joint<std::countr_zero(mask)>{});
    for_joints<mask&(mask - 1)>(f);
  }
}

// Value, gradient and (if order = 2) Hessian with respect to the joints of `mask`. The derivatives with respect to all
// other joints are zero and are not stored.
template <unsigned mask, int order>
struct Jet {
  static constexpr unsigned kMask = mask;
  static constexpr int kCount = std::popcount(mask);
  static constexpr int kPairs = order == 2 ? kCount * (kCount + 1) / 2 : 1;
  double v;
  double g[kCount];
  double h[kPairs];  // lower triangle, row after row

  static constexpr bool has(int i) { return (mask >> i & 1u) != 0; }
  static constexpr int at(int i) { return std::popcount(mask & ((1u << i) - 1u)); }
  static constexpr int at(int i, int j) {  // i ≥ j
    return at(i) * (at(i) + 1) / 2 + at(j);
  }
};

// Sets z.g = f(i) and z.h = s(i, j) for all joints i ≥ j of z.
template <unsigned mask, int order, typename First, typename Second>
SIGMAIK_INLINE void fill(Jet<mask, order>& z, First&& f, Second&& s) {
  using Z = Jet<mask, order>;
  for_joints<mask>([&](auto i) __attribute__((always_inline)) {
    z.g[Z::at(i)] = f(i);
    if constexpr (order == 2) {
      for_joints<(mask & ((2u << i) - 1u))>([&](auto j) __attribute__((always_inline)) { z.h[Z::at(i, j)] = s(i, j); });
    }
  });
}

template <unsigned a, unsigned b, int order>
SIGMAIK_INLINE Jet<a | b, order> operator+(const Jet<a, order>& x, const Jet<b, order>& y) {
  using X = Jet<a, order>;
  using Y = Jet<b, order>;
  Jet<a | b, order> z;
  z.v = x.v + y.v;
  fill(
      z,
      [&](auto i) __attribute__((always_inline)) {
        if constexpr (!Y::has(i))
          return x.g[X::at(i)];
        else if constexpr (!X::has(i))
          return y.g[Y::at(i)];
        else
          return x.g[X::at(i)] + y.g[Y::at(i)];
      },
      [&](auto i, auto j) __attribute__((always_inline)) {
        double sum = 0.0;
        if constexpr (X::has(i) && X::has(j)) sum = x.h[X::at(i, j)];
        if constexpr (Y::has(i) && Y::has(j)) sum += y.h[Y::at(i, j)];
        return sum;
      });
  return z;
}

template <unsigned a, int order>
SIGMAIK_INLINE Jet<a, order> operator*(double f, Jet<a, order> x) {
  x.v *= f;
  for (double& g : x.g) g *= f;
  if constexpr (order == 2) {
    for (double& h : x.h) h *= f;
  }
  return x;
}

template <unsigned a, int order>
SIGMAIK_INLINE Jet<a, order> operator+(Jet<a, order> x, double c) {
  x.v += c;
  return x;
}

template <unsigned a, unsigned b, int order>
SIGMAIK_INLINE Jet<a | b, order> operator-(const Jet<a, order>& x, const Jet<b, order>& y) {
  return x + -1.0 * y;
}

template <unsigned a, unsigned b, int order>
SIGMAIK_INLINE Jet<a | b, order> operator*(const Jet<a, order>& x, const Jet<b, order>& y) {
  using X = Jet<a, order>;
  using Y = Jet<b, order>;
  Jet<a | b, order> z;
  z.v = x.v * y.v;
  fill(
      z,
      [&](auto i) __attribute__((always_inline)) {
        if constexpr (!Y::has(i))
          return y.v * x.g[X::at(i)];
        else if constexpr (!X::has(i))
          return x.v * y.g[Y::at(i)];
        else
          return y.v * x.g[X::at(i)] + x.v * y.g[Y::at(i)];
      },
      [&](auto i, auto j) __attribute__((always_inline)) {
        double sum = 0.0;
        if constexpr (X::has(i) && X::has(j)) sum = y.v * x.h[X::at(i, j)];
        if constexpr (Y::has(i) && Y::has(j)) sum += x.v * y.h[Y::at(i, j)];
        if constexpr (X::has(i) && Y::has(j)) sum += x.g[X::at(i)] * y.g[Y::at(j)];
        if constexpr (X::has(j) && Y::has(i)) sum += x.g[X::at(j)] * y.g[Y::at(i)];
        return sum;
      });
  return z;
}

// A scalar that records the operations on it.
struct Recorded {
  Tape* tape;
  int index;

  static Recorded record(Tape* tape, const Operation& operation) {
    tape->operations.push_back(operation);
    return {tape, static_cast<int>(tape->operations.size()) - 1};
  }
  friend Recorded operator+(const Recorded& x, const Recorded& y) {
    return record(x.tape, {Operation::Add, x.index, y.index});
  }
  friend Recorded operator-(const Recorded& x, const Recorded& y) {
    return record(x.tape, {Operation::Subtract, x.index, y.index});
  }
  friend Recorded operator*(const Recorded& x, const Recorded& y) {
    return record(x.tape, {Operation::Multiply, x.index, y.index});
  }
  friend Recorded operator*(double f, const Recorded& x) { return record(x.tape, {Operation::Constant, 0, 0, f}) * x; }
  friend Recorded operator+(const Recorded& x, double c) { return x + record(x.tape, {Operation::Constant, 0, 0, c}); }
};

// The sines and cosines of the joints, x.s(Joint<i>) and x.c(Joint<i>), for each scalar type.
struct Values {
  const double *sine, *cosine;
  template <int i>
  SIGMAIK_INLINE double s(Joint<i>) const {
    return sine[i];
  }
  template <int i>
  SIGMAIK_INLINE double c(Joint<i>) const {
    return cosine[i];
  }
};

template <int order>
struct Jets {
  const double *sine, *cosine;
  template <int i>
  SIGMAIK_INLINE Jet<1u << i, order> s(Joint<i>) const {
    return {sine[i], {cosine[i]}, {-sine[i]}};
  }
  template <int i>
  SIGMAIK_INLINE Jet<1u << i, order> c(Joint<i>) const {
    return {cosine[i], {-sine[i]}, {-cosine[i]}};
  }
};

struct Recording {
  Tape* tape;
  template <int i>
  Recorded s(Joint<i>) const {
    return of(Operation::Sin, i);
  }
  template <int i>
  Recorded c(Joint<i>) const {
    return of(Operation::Cos, i);
  }

 private:
  Recorded of(Operation::Kind kind, int joint) const {  // records each sine and cosine once
    for (std::size_t at = 0; at < tape->operations.size(); ++at) {
      const Operation& o = tape->operations[at];
      if (o.kind == kind && o.a == joint) return {tape, static_cast<int>(at)};
    }
    return Recorded::record(tape, {kind, joint});
  }
};

}  // namespace sigmaik::detail
