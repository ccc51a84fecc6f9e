#pragma once
// Short vectors of doubles in the compiler's vector types. `lanes` is the width of a register: two in every x86-64,
// four where the processor has AVX2.

namespace sigmaik::detail {

#define SIGMAIK_INLINE inline __attribute__((always_inline))

template <int lanes>
struct VectorOf;
template <>
struct VectorOf<2> {
  using type = double __attribute__((vector_size(16)));
};
template <>
struct VectorOf<4> {
  using type = double __attribute__((vector_size(32)));
};
template <int lanes>
using Vector = typename VectorOf<lanes>::type;
// −1 or 0 in each lane: what a comparison of two vectors gives.
template <int lanes>
using Mask = decltype(Vector<lanes>{} < Vector<lanes>{});

template <int lanes>
SIGMAIK_INLINE Vector<lanes> splat(double x) {
  Vector<lanes> v{};
#pragma GCC unroll 4
  for (int i = 0; i < lanes; ++i) v[i] = x;
  return v;
}

SIGMAIK_INLINE double sum(Vector<2> x) { return x[0] + x[1]; }
SIGMAIK_INLINE double sum(Vector<4> x) { return (x[0] + x[2]) + (x[1] + x[3]); }

SIGMAIK_INLINE Vector<2> square_root(Vector<2> x) { return Vector<2>{__builtin_sqrt(x[0]), __builtin_sqrt(x[1])}; }
SIGMAIK_INLINE Vector<4> square_root(Vector<4> x) {
  return Vector<4>{__builtin_sqrt(x[0]), __builtin_sqrt(x[1]), __builtin_sqrt(x[2]), __builtin_sqrt(x[3])};
}

// One column, as vectors.
template <int lanes, int length>
struct Column {
  Vector<lanes> at[length / lanes];

  static SIGMAIK_INLINE Column load(const double (&x)[length]) {
    Column c;
#pragma GCC unroll 8
    for (int i = 0; i < length / lanes; ++i) __builtin_memcpy(&c.at[i], x + i * lanes, sizeof c.at[i]);
    return c;
  }
  SIGMAIK_INLINE void store(double (&x)[length]) const {
#pragma GCC unroll 8
    for (int i = 0; i < length / lanes; ++i) __builtin_memcpy(x + i * lanes, &at[i], sizeof at[i]);
  }
};

template <int lanes, int length>
SIGMAIK_INLINE double dot(const double (&x)[length], const double (&y)[length]) {
  const auto a = Column<lanes, length>::load(x), b = Column<lanes, length>::load(y);
  Vector<lanes> s = a.at[0] * b.at[0];
#pragma GCC unroll 8
  for (int i = 1; i < length / lanes; ++i) s += a.at[i] * b.at[i];
  return sum(s);
}

template <int lanes, int length>
SIGMAIK_INLINE void set_zero(double (&x)[length]) {
  const auto zero = splat<lanes>(0.0);
#pragma GCC unroll 12
  for (int j = 0; j < length / lanes; ++j) __builtin_memcpy(x + j * lanes, &zero, sizeof zero);
}

template <int lanes, int length>
SIGMAIK_INLINE void copy_column(const double (&x)[length], double (&to)[length]) {
  Column<lanes, length>::load(x).store(to);
}

template <int lanes, int length>
SIGMAIK_INLINE void swap_columns(double (&x)[length], double (&y)[length]) {
  const auto a = Column<lanes, length>::load(x), b = Column<lanes, length>::load(y);
  a.store(y);
  b.store(x);
}

// x += factor y.
template <int lanes, int length>
SIGMAIK_INLINE void add_scaled(double (&x)[length], double factor, const double (&y)[length]) {
  auto a = Column<lanes, length>::load(x);
  const auto b = Column<lanes, length>::load(y);
  const auto f = splat<lanes>(factor);
#pragma GCC unroll 12
  for (int j = 0; j < length / lanes; ++j) a.at[j] += f * b.at[j];
  a.store(x);
}

}  // namespace sigmaik::detail
