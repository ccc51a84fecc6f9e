#pragma once
// sin, cos and exp of several numbers at once, to about one ulp. The arguments are reduced by the method of Cody and
// Waite; sin and cos use the polynomials of Cephes.

#include <cmath>

#include "lanes.hpp"

namespace sigmaik::detail {

template <int lanes>
struct IntegersOf;
template <>
struct IntegersOf<2> {
  using type = long long __attribute__((vector_size(16)));
};
template <>
struct IntegersOf<4> {
  using type = long long __attribute__((vector_size(32)));
};
template <int lanes>
using Integers = typename IntegersOf<lanes>::type;

// Adding this number rounds to an integer, and the integer is then found in the lowest bits of the sum.
inline constexpr double kRounder = 6755399441055744.0;  // 1.5 · 2⁵²

// For |x| ≤ 1e5.
template <int lanes>
SIGMAIK_INLINE void sincos_reduced(Vector<lanes> x, Vector<lanes>& sine, Vector<lanes>& cosine) {
  using V = Vector<lanes>;
  using I = Integers<lanes>;
  const V shifted = x * 0.63661977236758134308 + kRounder;  // quarter turns
  const I quarter = __builtin_bit_cast(I, shifted);
  const V n = shifted - kRounder;
  V r = x - n * 1.57079625129699707031;  // π/2 in three parts; the first two have few digits, so that their products
                                         // with n are exact
  r = r - n * 7.54978941586159635335e-8;
  r = r - n * 5.39030285815811905290e-15;
  const V z = r * r;
  // Estrin's scheme evaluates a polynomial in short chains of dependent operations.
  const V w = z * z;
  const V s = r + r * z *
                      ((8.33333333332211858878e-3 * z - 1.66666666666666307295e-1) +
                       w * ((2.75573136213857245213e-6 * z - 1.98412698295895385996e-4) +
                            w * (1.58962301576546568060e-10 * z - 2.50507477628578072866e-8)));
  const V c = (1.0 - 0.5 * z) + w * ((-1.38888888888730564116e-3 * z + 4.16666666666665929218e-2) +
                                     w * ((-2.75573141792967388112e-7 * z + 2.48015872888517045348e-5) +
                                          w * (-1.13585365213876817300e-11 * z + 2.08757008419747316778e-9)));
  const I odd = (quarter & 1) != 0;
  const V a = odd ? c : s, b = odd ? s : c;
  sine = (quarter & 2) != 0 ? -a : a;
  cosine = ((quarter + 1) & 2) != 0 ? -b : b;
}

// Loads numbers into vectors one by one. If the numbers were stored one by one just before, a load of a whole vector
// would stall until all stores have finished.
template <int lanes, int padded>
SIGMAIK_INLINE Column<lanes, padded> gather(const double* x, int count) {
  Column<lanes, padded> out;
#pragma GCC unroll 8
  for (int i = 0; i < padded / lanes; ++i) {
    Vector<lanes> v{};
#pragma GCC unroll 4
    for (int j = 0; j < lanes; ++j) v[j] = i * lanes + j < count ? x[i * lanes + j] : 0.0;
    out.at[i] = v;
  }
  return out;
}

// Sines and cosines of `count` angles; entries beyond `count` are padding.
template <int lanes, int padded>
SIGMAIK_INLINE void sincos_all(const double* x, int count, double (&sine)[padded], double (&cosine)[padded]) {
  double largest = 0.0;
  for (int i = 0; i < count; ++i) largest = std::fmax(largest, std::fabs(x[i]));
  if (!(largest <= 1e5)) {
    for (int i = 0; i < count; ++i) {
      sine[i] = std::sin(x[i]);
      cosine[i] = std::cos(x[i]);
    }
    return;
  }
  const auto in = gather<lanes, padded>(x, count);
  Column<lanes, padded> s, c;
#pragma GCC unroll 8
  for (int i = 0; i < padded / lanes; ++i) sincos_reduced<lanes>(in.at[i], s.at[i], c.at[i]);
  s.store(sine);
  c.store(cosine);
}

// e^x for x ≤ 700; zero if e^x is smaller than the smallest normal number.
template <int lanes>
SIGMAIK_INLINE Vector<lanes> exp_reduced(Vector<lanes> x) {
  using V = Vector<lanes>;
  using I = Integers<lanes>;
  const I tiny = x < -708.0;
  const V y = tiny ? V{} : x;
  const V shifted = y * 1.4426950408889634074 + kRounder;
  const V n = shifted - kRounder;
  V r = y - n * 6.93145751953125e-1;  // log 2 in two parts, as π/2 above
  r = r - n * 1.42860682030941723212e-6;
  // Taylor series up to r¹³/13! by Estrin's scheme; the error is below 5e-18 for |r| ≤ log(2)/2.
  const V r2 = r * r, r4 = r2 * r2, r8 = r4 * r4;
  const V low = (1.0 + r) + r2 * (0.5 + r * (1.0 / 6.0)) +
                r4 * ((1.0 / 24.0 + r * (1.0 / 120.0)) + r2 * (1.0 / 720.0 + r * (1.0 / 5040.0)));
  const V high = (1.0 / 40320.0 + r * (1.0 / 362880.0)) + r2 * (1.0 / 3628800.0 + r * (1.0 / 39916800.0)) +
                 r4 * (1.0 / 479001600.0 + r * (1.0 / 6227020800.0));
  const I power = (__builtin_bit_cast(I, shifted) - __builtin_bit_cast(I, splat<lanes>(kRounder)) + 1023) << 52;
  return tiny ? V{} : (low + r8 * high) * __builtin_bit_cast(V, power);
}

template <int lanes, int count>
SIGMAIK_INLINE void exp_all(const double (&x)[count], double (&out)[count]) {
  double largest = x[0];
  for (int i = 1; i < count; ++i) largest = std::fmax(largest, x[i]);
  if (!(largest <= 700.0)) {
    for (int i = 0; i < count; ++i) out[i] = std::exp(x[i]);
    return;
  }
  const auto in = gather<lanes, count>(x, count);
  Column<lanes, count> result;
#pragma GCC unroll 8
  for (int i = 0; i < count / lanes; ++i) result.at[i] = exp_reduced<lanes>(in.at[i]);
  result.store(out);
}

}  // namespace sigmaik::detail
