#pragma once
/// \file custom.hpp
/// A rule of an application's own, as one alternative of Method.

#include <array>
#include <cstddef>
#include <new>
#include <type_traits>

#include <sigmaik/rules/rule.hpp>

namespace sigmaik {

/// Holds a copy of any small struct that is a Rule, without heap. It converts from the struct:
///
///     struct Halved {                                         // an application's rule
///       static constexpr const char* kName = "Halved";
///       double relative_threshold() const noexcept { return 0.1; }
///       Direction at(double sigma, const SpectrumSummary& s) const noexcept {
///         return sigma > 0.1 * s.largest ? Direction{1.0 / sigma, 1.0, true} : Direction{0.0, 1.0, false};
///       }
///     };
///     Servo servo(chain, Halved{});
///
/// The loop over the directions is compiled together with the struct's at(), as for the rules of the library; a cycle
/// pays one call through a pointer.
class CustomRule {
 public:
  static constexpr std::size_t kMaxSize = 128;  ///< of the struct, in bytes

  /// \throws Error what the rule's check() throws, and where relative_threshold() is not in (0, 1], when a solver or
  ///     servo is made of it
  template <Rule R>
    requires(!std::is_same_v<R, CustomRule>)
  CustomRule(const R& rule) noexcept : functions_(&kFunctions<R>) {  // NOLINT: converts on purpose
    static_assert(std::is_trivially_copyable_v<R> && sizeof(R) <= kMaxSize && alignof(R) <= alignof(double),
                  "a rule is copied as bytes: keep plain numbers in it, or a pointer to what is larger");
    ::new (static_cast<void*>(bytes_.data())) R(rule);
  }

  /// The struct's kName.
  const char* name() const noexcept { return functions_->name; }
  /// Checks the parameters.
  /// \throws Error with the parameter, its value and its range
  void check() const { functions_->check(bytes_.data()); }
  /// In (0, 1]: a direction with σ_i at or below this part of σ_max is near a singularity.
  double relative_threshold() const noexcept { return functions_->relative_threshold(bytes_.data()); }
  /// Applies the rule, see resolve(). Real time.
  Resolution resolve(const Spectrum& spectrum, const TaskVector& command, std::uint8_t angular,
                     const Pace& pace = {}) const noexcept {
    return functions_->resolve(bytes_.data(), spectrum, command, angular, pace);
  }
  /// The struct where it is an R, else null.
  template <Rule R>
  const R* get_if() const noexcept {
    return functions_ == &kFunctions<R> ? from<R>(bytes_.data()) : nullptr;
  }

 private:
  struct Functions {
    const char* name;
    void (*check)(const std::byte*);
    double (*relative_threshold)(const std::byte*) noexcept;
    Resolution (*resolve)(const std::byte*, const Spectrum&, const TaskVector&, std::uint8_t, const Pace&) noexcept;
  };

  template <typename R>
  static const R* from(const std::byte* bytes) noexcept {
    return std::launder(reinterpret_cast<const R*>(bytes));
  }
  template <typename R>
  static constexpr Functions kFunctions{
      R::kName, [](const std::byte* bytes) { check_rule(*from<R>(bytes)); },
      [](const std::byte* bytes) noexcept { return from<R>(bytes)->relative_threshold(); },
      [](const std::byte* bytes, const Spectrum& spectrum, const TaskVector& command, std::uint8_t angular,
         const Pace& pace) noexcept { return resolve_by(*from<R>(bytes), spectrum, command, angular, pace); }};

  const Functions* functions_;
  alignas(double) std::array<std::byte, kMaxSize> bytes_{};
};

}  // namespace sigmaik
