#pragma once
/// \file parameters.hpp
/// The parameters of a rule, each described once: name, member, range and text. The checks of set-up, and in Python the
/// constructor's keywords, defaults, docstring, stub and errors are made from this table. See rules/jparse.hpp.

#include <limits>
#include <optional>
#include <tuple>
#include <type_traits>

namespace sigmaik {

/// Numbers that a parameter accepts; NaN is never one of them.
struct Range {
  double low = -std::numeric_limits<double>::infinity();  ///< least value, accepted unless `open`
  double high = std::numeric_limits<double>::infinity();  ///< largest value, accepted
  bool open = false;                                      ///< `low` itself is not accepted
  const char* hint = "";                                  ///< for the error: what to do instead

  bool contains(double value) const noexcept;  ///< false for ±∞
};

/// One parameter of Owner. Its default is the member's own initialiser. above(), at_least(), at_most() and none_is()
/// return a changed copy.
template <typename Owner, typename Value>
struct Parameter {
  using value_type = Value;      ///< type of the member
  const char* name;              ///< keyword and attribute in Python
  Value Owner::* member;         ///< where the value is
  const char* doc;               ///< meaning, unit, range
  std::optional<Range> range{};  ///< accepted numbers; none: all
  std::optional<Value> none{};   ///< the value that Python spells None

  /// The same for values above `low`; `hint` goes into the error.
  constexpr Parameter above(double low, const char* hint = "") const {
    Parameter out = *this;
    out.range = range.value_or(Range{});
    out.range->low = low;
    out.range->open = true;
    out.range->hint = hint;
    return out;
  }
  /// The same for values of at least `low`.
  constexpr Parameter at_least(double low) const {
    Parameter out = *this;
    out.range = range.value_or(Range{});
    out.range->low = low;
    return out;
  }
  /// The same for values of at most `high`.
  constexpr Parameter at_most(double high) const {
    Parameter out = *this;
    out.range = range.value_or(Range{});
    out.range->high = high;
    return out;
  }
  /// The same with None in Python for `value`.
  constexpr Parameter none_is(const Value& value) const {
    Parameter out = *this;
    out.none = value;
    return out;
  }
};

/// A parameter: its name, its member, and its meaning with unit and range.
template <typename Owner, typename Value>
constexpr Parameter<Owner, Value> param(const char* name, Value Owner::* member, const char* doc) {
  return {name, member, doc};
}

/// A value of an enum, and its text.
template <typename Enum>
struct Choice {
  const char* text;  ///< the text in Python and on the command line
  Enum value;        ///< the value
};

/// Specialised for each enum that is a parameter: `all`, an array of Choice.
template <typename Enum>
struct Choices;

/// Calls visit(parameter) for each of R::parameters(), in order.
template <typename R, typename Visit>
constexpr void for_each_parameter(Visit&& visit) {
  std::apply([&](const auto&... each) { (visit(each), ...); }, R::parameters());
}

/// \throws Error "OWNER: NAME = VALUE must be …" unless the range contains the value
void check_range(const char* owner, const char* name, double value, const Range& range);

/// Checks every number of R::parameters() against its range.
/// \throws Error with the parameter, its value and its range
template <typename R>
void check_parameters(const R& rule) {
  for_each_parameter<R>([&](const auto& p) {
    if constexpr (std::is_same_v<std::decay_t<decltype(rule.*p.member)>, double>) {
      if (p.range) check_range(R::kName, p.name, rule.*p.member, *p.range);
    }
  });
}

}  // namespace sigmaik
