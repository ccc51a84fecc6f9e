#pragma once
// Scalars to put through a template: truncated Taylor series in K variables, of first or second order, and a recorder.
// Templates use T·T, T + T, T − T, double·T and T + double alone.

#include <sigmaik/singularities.hpp>

#include "lanes.hpp"

namespace sigmaik::detail {

// Value and gradient.
template <int K>
struct Jet1 {
  double v = 0.0;
  double g[K] = {};

  // sin or cos of variable k: f(x), f'(x).
  static Jet1 of(int k, double value, double slope, double /*bend*/) noexcept {
    Jet1 x;
    x.v = value;
    if (k >= 0 && k < K) x.g[k] = slope;
    return x;
  }
  friend SIGMAIK_INLINE Jet1 operator+(Jet1 x, const Jet1& y) noexcept {
    x.v += y.v;
    for (int i = 0; i < K; ++i) x.g[i] += y.g[i];
    return x;
  }
  friend SIGMAIK_INLINE Jet1 operator-(Jet1 x, const Jet1& y) noexcept {
    x.v -= y.v;
    for (int i = 0; i < K; ++i) x.g[i] -= y.g[i];
    return x;
  }
  friend SIGMAIK_INLINE Jet1 operator*(const Jet1& x, const Jet1& y) noexcept {
    Jet1 z;
    z.v = x.v * y.v;
    for (int i = 0; i < K; ++i) z.g[i] = x.v * y.g[i] + y.v * x.g[i];
    return z;
  }
  friend SIGMAIK_INLINE Jet1 operator*(double f, Jet1 x) noexcept {
    x.v *= f;
    for (int i = 0; i < K; ++i) x.g[i] *= f;
    return x;
  }
  friend SIGMAIK_INLINE Jet1 operator+(Jet1 x, double c) noexcept {
    x.v += c;
    return x;
  }
};

// Value, gradient and the Hessian's lower triangle, row after row.
template <int K>
struct Jet2 {
  static constexpr int kPairs = K * (K + 1) / 2;
  double v = 0.0;
  double g[K] = {};
  double h[kPairs] = {};

  static Jet2 of(int k, double value, double slope, double bend) noexcept {
    Jet2 x;
    x.v = value;
    if (k >= 0 && k < K) {
      x.g[k] = slope;
      x.h[k * (k + 3) / 2] = bend;
    }
    return x;
  }
  friend SIGMAIK_INLINE Jet2 operator+(Jet2 x, const Jet2& y) noexcept {
    x.v += y.v;
    for (int i = 0; i < K; ++i) x.g[i] += y.g[i];
    for (int i = 0; i < kPairs; ++i) x.h[i] += y.h[i];
    return x;
  }
  friend SIGMAIK_INLINE Jet2 operator-(const Jet2& x, const Jet2& y) noexcept { return x + -1.0 * y; }
  friend SIGMAIK_INLINE Jet2 operator*(const Jet2& x, const Jet2& y) noexcept {
    Jet2 z;
    z.v = x.v * y.v;
    for (int i = 0; i < K; ++i) z.g[i] = x.v * y.g[i] + y.v * x.g[i];
    for (int i = 0, at = 0; i < K; ++i) {
      for (int j = 0; j <= i; ++j, ++at) z.h[at] = x.v * y.h[at] + y.v * x.h[at] + x.g[i] * y.g[j] + x.g[j] * y.g[i];
    }
    return z;
  }
  friend SIGMAIK_INLINE Jet2 operator*(double f, Jet2 x) noexcept {
    x.v *= f;
    for (int i = 0; i < K; ++i) x.g[i] *= f;
    for (int i = 0; i < kPairs; ++i) x.h[i] *= f;
    return x;
  }
  friend SIGMAIK_INLINE Jet2 operator+(Jet2 x, double c) noexcept {
    x.v += c;
    return x;
  }
};

// Writes down what is done to it.
struct Recorded {
  Tape* tape = nullptr;
  int index = 0;

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
  friend Recorded operator*(double f, const Recorded& x) {
    return record(x.tape, {Operation::Constant, 0, 0, f}) * x;
  }
  friend Recorded operator+(const Recorded& x, double c) {
    return x + record(x.tape, {Operation::Constant, 0, 0, c});
  }
};

}  // namespace sigmaik::detail
