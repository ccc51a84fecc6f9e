#pragma once
/// \file layout.hpp
/// A program and the library that it links must agree on the size of every public type. Where sizes differ (headers of
/// another version, another Eigen, a compiler option that changes types), linking fails, and the message names the
/// type: "undefined reference to sigmaik::detail::Layout<…Sized<sigmaik::ServoOptions, N>…>::in_library".
///
/// Options for vector instructions (-mavx2, -march=native, EIGEN_MAX_ALIGN_BYTES) change no public type, because the
/// matrices of types.hpp are unaligned.

#include <cstddef>

namespace sigmaik::detail {

/// A type and the size [bytes] that the compiler gives to it.
template <typename Type, std::size_t size>
struct Sized {
  // The place of an aligned member, such as Eigen::Vector4d, would depend on the compiler's options.
  static_assert(alignof(Type) <= alignof(double), "a public type has an aligned member: give it sigmaik::kLayout");
};

/// The library defines `in_library` for the sizes that it was compiled with, and for no others.
template <typename... Sizes>
struct Layout {
  static const char in_library;
};

/// The list of the members of a type, for values.hpp.
template <typename Type>
struct Members;

template <typename... Types>
using LayoutOf = Layout<Sized<Types, sizeof(Types)>...>;

#ifdef SIGMAIK_DEFINE_LAYOUTS  // by layout.cpp alone
template <typename... Sizes>
const char Layout<Sizes...>::in_library = 0;
#endif

}  // namespace sigmaik::detail

// The reference to the library's symbol stays in the object file even where nothing reads it.
#ifdef __has_attribute
#if __has_attribute(retain)
#define SIGMAIK_KEEP __attribute__((used, retain))
#elif __has_attribute(used)
#define SIGMAIK_KEEP __attribute__((used))
#endif
#endif
#ifndef SIGMAIK_KEEP
#define SIGMAIK_KEEP
#endif

/// Stands at the end of a header, in the namespace of its public types, and names them. A header that has it is
/// included by cpp/src/layout.cpp.
#define SIGMAIK_SAME_LAYOUT(Type, ...)                          \
  SIGMAIK_KEEP static const char* const same_layout_of_##Type = \
      &::sigmaik::detail::LayoutOf<Type __VA_OPT__(, ) __VA_ARGS__>::in_library
