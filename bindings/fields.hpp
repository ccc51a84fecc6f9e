#pragma once
// One table a struct of options, from which its Python keywords, their defaults, the docstring, the stub's signature
// and the errors are made. A new option is a member of the struct and a line of its table:
//
//     template <>
//     struct Fields<ServoOptions> {
//       static constexpr std::tuple all{
//           field("gain_linear", &ServoOptions::gain_linear, "[1/s] ≥ 0, position error to velocity"),
//           nested(&ServoOptions::limits),  // the table of LimitOptions, its keywords beside these
//           field("eta1", [](auto& o) -> auto& { return o.potential.eta1; }, "…")};  // a member of a member
//     };
//     def_init<ServoOptions>(c, "Servo", {parameter<Chain>("chain")}, 1, "What it does.", make);
//
// Specialisations of Fields and Words stand in a header where two bindings use them (a class template that two sources
// specialise differently breaks the one-definition rule).

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "arguments.hpp"

namespace sigmaik::bindings {

/// An argument that a function does not have, has twice, or that is of a wrong type. In Python: sigmaik.ArgumentError,
/// both an Error and a TypeError.
class SIGMAIK_HIDDEN ArgumentError : public Error {
 public:
  using Error::Error;
};

// ---- Tables ---------------------------------------------------------------------------------------------------------

/// A Python keyword, and the member that it sets: a pointer to the member, or a function from the struct to it.
template <typename Member>
struct Field {
  const char* name;
  Member member;
  const char* doc;  // unit, range, meaning
};

template <typename Member>
constexpr Field<Member> field(const char* name, Member member, const char* doc) {
  return {name, member, doc};
}

/// A struct within the struct: the keywords of its own table stand beside the others.
template <typename Member>
struct Nested {
  Member member;
};

template <typename Member>
constexpr Nested<Member> nested(Member member) {
  return {member};
}

/// `all`: a tuple of field(…) and nested(…).
template <typename Options>
struct Fields;

/// `all`: an array of Word, the texts by which Python names the values of an enum.
template <typename Enum>
struct Words;

/// The parameters of a rule bring their words along.
template <typename Enum>
  requires requires { Choices<Enum>::all; }
struct Words<Enum> {
  static constexpr auto all = Choices<Enum>::all;
};

template <typename Enum>
struct Word {
  const char* text;  // null: None
  Enum value;
};

/// Calls visit(name, member, doc) for every keyword, in the order of the table.
template <typename Options, typename Visit>
void for_each_field(Options& options, Visit&& visit) {
  const auto one = [&]<typename Entry>(const Entry& entry) {
    if constexpr (requires { entry.name; }) {
      visit(entry.name, std::invoke(entry.member, options), entry.doc);
    } else {
      for_each_field(std::invoke(entry.member, options), visit);
    }
  };
  std::apply([&](const auto&... entries) { (one(entries), ...); }, Fields<std::remove_const_t<Options>>::all);
}

// ---- Types of arguments ---------------------------------------------------------------------------------------------

/// "'abc'", "[1, 2, …": an object in an error.
std::string shown(py::handle object);

/// Throws: `what` must be `need`, not `object`.
[[noreturn]] void refuse(const char* what, const std::string& need, py::handle object);

/// The value of an object that pybind11 converts.
template <typename T>
T converted(py::handle object, const char* what, const char* need) {
  py::detail::make_caster<T> caster;
  if (!caster.load(object, true)) {
    PyErr_Clear();
    refuse(what, need, object);
  }
  return py::detail::cast_op<T>(std::move(caster));
}

/// "0.1", "inf": the shortest text that is read back as this number.
std::string text_of(double value);

/// How an argument of type T is typed in the stub, shown as a default there, read, and given back. Here: of a class
/// that is bound. `kNone`: whether None stands for the default.
template <typename T>
struct Argument {
  static constexpr bool kNone = false;
  static std::string type() {
    const auto type = py::type::of<T>();
    return py::str(type.attr("__module__")).template cast<std::string>() + "." +
           py::str(type.attr("__qualname__")).template cast<std::string>();
  }
  static const T& from(py::handle object, const char* what) {
    if (!py::isinstance<T>(object)) {
      refuse(what, "a " + py::str(py::type::of<T>().attr("__name__")).template cast<std::string>(), object);
    }
    return object.cast<const T&>();
  }
  static py::object to(const T& value) { return py::cast(value); }
};

template <>
struct Argument<double> {
  static constexpr bool kNone = false;
  static std::string type() { return "typing.SupportsFloat | typing.SupportsIndex"; }
  static std::string text(double value) { return text_of(value); }
  static double from(py::handle object, const char* what) { return converted<double>(object, what, "a number"); }
  static py::object to(double value) { return py::float_(value); }
};

template <>
struct Argument<bool> {
  static constexpr bool kNone = false;
  static std::string type() { return "bool"; }
  static std::string text(bool value) { return value ? "True" : "False"; }
  static bool from(py::handle object, const char* what) { return converted<bool>(object, what, "True or False"); }
  static py::object to(bool value) { return py::bool_(value); }
};

template <typename T>
  requires std::is_integral_v<T>
struct Argument<T> {
  static constexpr bool kNone = false;
  static std::string type() { return "typing.SupportsInt | typing.SupportsIndex"; }
  static std::string text(T value) { return std::to_string(value); }
  static T from(py::handle object, const char* what) {
    return converted<T>(object, what, std::is_unsigned_v<T> ? "a whole number, not below 0" : "a whole number");
  }
  static py::object to(T value) { return py::int_(value); }
};

/// Of an enum that has Words.
template <typename T>
  requires std::is_enum_v<T>
struct Argument<T> {
  static constexpr bool kNone = false;  // None is one of the words, or none of them
  static std::string type() {
    std::string texts, none;
    for (const auto& word : Words<T>::all) {
      if (word.text == nullptr) {
        none = " | None";
      } else {
        texts += (texts.empty() ? "'" : ", '") + std::string(word.text) + "'";
      }
    }
    return "typing.Literal[" + texts + "]" + none;
  }
  static std::string text(T value) {
    for (const auto& word : Words<T>::all) {
      if (word.value == value) return word.text == nullptr ? "None" : "'" + std::string(word.text) + "'";
    }
    return "...";
  }
  static T from(py::handle object, const char* what) {
    const bool is_text = py::isinstance<py::str>(object);
    const std::string text = is_text ? text_argument(object, what) : "";
    std::string need;
    for (std::size_t i = 0; i < Words<T>::all.size(); ++i) {
      const auto& word = Words<T>::all[i];
      if (word.text == nullptr ? object.is_none() : is_text && text == word.text) return word.value;
      if (i > 0) need += i + 1 < Words<T>::all.size() ? ", " : " or ";
      need += Argument::text(word.value);
    }
    if (is_text) throw Error(std::string(what) + " = '" + text + "' must be " + need);
    refuse(what, need, object);
  }
  static py::object to(T value) {
    for (const auto& word : Words<T>::all) {
      if (word.value == value && word.text != nullptr) return py::str(word.text);
    }
    return py::none();
  }
};

/// None: nothing.
template <typename T>
struct Argument<std::optional<T>> {
  static constexpr bool kNone = false;
  static std::string type() { return Argument<T>::type() + " | None"; }
  static std::string text(const std::optional<T>& value) {
    if constexpr (requires(const T& t) { Argument<T>::text(t); }) {
      if (value) return Argument<T>::text(*value);
    }
    return "None";
  }
  static std::optional<T> from(py::handle object, const char* what) {
    if (object.is_none()) return std::nullopt;
    return Argument<T>::from(object, what);
  }
  static py::object to(const std::optional<T>& value) { return value ? Argument<T>::to(*value) : py::none(); }
};

/// Any of the rules, or the name of one.
template <>
struct Argument<Method> {
  static constexpr bool kNone = false;
  static std::string type() { return "sigmaik._core.Method | str"; }
  static Method from(py::handle object, const char* what) {
    return converted<Method>(object, what, "a sigmaik.Method, or the name of one");
  }
  static py::object to(const Method& value) { return py::cast(value); }
};

/// A cost, or any other object that others may hold, too.
template <typename T>
struct Argument<std::shared_ptr<T>> {
  static constexpr bool kNone = false;
  static std::string type() { return Argument<T>::type(); }
  static std::shared_ptr<T> from(py::handle object, const char* what) {
    Argument<T>::from(object, what);
    return object.cast<std::shared_ptr<T>>();
  }
};

/// Objects of Python.
template <>
struct Argument<std::vector<py::object>> {
  static constexpr bool kNone = false;
  static std::string type() { return "collections.abc.Sequence[typing.Any]"; }
  static std::vector<py::object> from(py::handle object, const char* what) {
    return converted<std::vector<py::object>>(object, what, "a sequence");
  }
};

/// An answer.
template <>
struct Argument<py::array_t<double>> {
  static std::string type() { return "numpy.typing.NDArray[numpy.float64]"; }
};

/// Read later, by who knows its shape.
template <>
struct Argument<ArrayLike> {
  static constexpr bool kNone = false;
  static std::string type() { return "numpy.typing.ArrayLike"; }
  static ArrayLike from(py::handle object, const char*) { return py::reinterpret_borrow<ArrayLike>(object); }
};

/// Joint positions or velocities (n,); None, and empty: the struct's own.
template <>
struct Argument<JointVector> {
  static constexpr bool kNone = true;
  static std::string type() { return "numpy.typing.ArrayLike | None"; }
  static std::string text(const JointVector&) { return "None"; }
  static JointVector from(py::handle object, const char* what) { return joint_argument(object, what, -1); }
  static py::object to(const JointVector& value) {
    return value.size() == 0 ? py::none() : py::object(to_numpy(value));
  }
};

/// Six truth values, one a row of a twist.
template <>
struct Argument<std::array<bool, 6>> {
  static constexpr bool kNone = true;
  static std::string type() { return "numpy.typing.ArrayLike | None"; }
  static std::string text(const std::array<bool, 6>& rows) {
    std::string out;
    for (const bool row : rows) out += (out.empty() ? "(" : ", ") + std::string(row ? "1" : "0");
    return out + ")";
  }
  static std::array<bool, 6> from(py::handle object, const char* what) { return rows_argument(object, what); }
  static py::object to(const std::array<bool, 6>& rows) {
    py::array_t<bool> out(6);
    std::copy(rows.begin(), rows.end(), out.mutable_data());
    return out;
  }
};

/// A number for each row of a twist (6,), or one for all; not checked to be finite.
template <>
struct Argument<Twist> {
  static constexpr bool kNone = true;
  static std::string type() { return "numpy.typing.ArrayLike | None"; }
  static std::string text(const Twist& value);
  static Twist from(py::handle object, const char* what);
  static py::object to(const Twist& value) { return to_numpy(value); }
};

/// A finite vector (3,).
template <>
struct Argument<Eigen::Vector3d> {
  static constexpr bool kNone = true;
  static std::string type() { return "numpy.typing.ArrayLike | None"; }
  static std::string text(const Eigen::Vector3d& value);
  static Eigen::Vector3d from(py::handle object, const char* what);
  static py::object to(const Eigen::Vector3d& value) { return to_numpy(value); }
};

// ---- Functions ------------------------------------------------------------------------------------------------------

/// An argument that stands before the options. One of type std::optional may be left out.
template <typename T>
struct Parameter {
  const char* name;
  const char* doc;
};

template <typename T>
constexpr Parameter<T> parameter(const char* name, const char* doc = nullptr) {
  return {name, doc};
}

/// One argument of a function, as the signature and the errors need it.
struct SIGMAIK_HIDDEN Slot {
  std::string name, type, text, doc;  // text: the default; empty: required
};

/// The arguments of a function: first those that stand before the options, then the options; `positional` of all these
/// may be given by position.
struct SIGMAIK_HIDDEN Signature {
  std::string function;
  std::vector<Slot> slots;
  std::size_t positional;

  /// One object a slot, null where none is given.
  /// \throws ArgumentError where an argument is missing, unknown or given twice
  std::vector<py::handle> sort(const py::args& args, const py::kwargs& kwargs) const;

  /// "name(self: …, chain: …, *, gain_linear: … = 5.0) -> None", `doc`, and a line or more for each slot.
  /// pybind11-stubgen reads the first line.
  std::string docstring(const std::string& name, const std::string& self, const std::string& returns,
                        const std::string& doc) const;
};

template <typename Options>
void add_options(std::vector<Slot>& slots) {
  const Options defaults{};
  for_each_field(defaults, [&]<typename T>(const char* name, const T& value, const char* doc) {
    slots.push_back({name, Argument<T>::type(), Argument<T>::text(value), doc});
  });
}

using Keywords = py::typing::Dict<py::str, py::object>;

/// The keywords and values of a struct: `**` of them makes the same struct again.
template <typename Options>
Keywords to_dict(const Options& options) {
  Keywords out;
  for_each_field(
      options, [&]<typename T>(const char* name, const T& value, const char*) { out[name] = Argument<T>::to(value); });
  return out;
}

/// The table of a struct as Python objects: a tuple (name, type, default, doc) for each keyword.
template <typename Options>
py::list table_of() {
  std::vector<Slot> slots;
  add_options<Options>(slots);
  py::list out;
  for (const Slot& slot : slots) out.append(py::make_tuple(slot.name, slot.type, slot.text, slot.doc));
  return out;
}

/// Sets the members for which `object` holds something.
template <typename Options>
void set_options(Options& options, const py::handle* object) {
  for_each_field(options, [&]<typename T>(const char* name, T& member, const char*) {
    const py::handle given = *object++;
    if (given.ptr() == nullptr || (Argument<T>::kNone && given.is_none())) return;
    member = Argument<T>::from(given, name);
  });
}

template <typename Options, typename... Leading>
Signature signature(const std::string& function, const std::tuple<Parameter<Leading>...>& leading,
                    std::size_t positional_options) {
  Signature out{function, {}, sizeof...(Leading) + positional_options};
  const auto add = [&]<typename T>(const Parameter<T>& p) {
    const bool optional = requires {
      typename T::value_type;
      T(std::nullopt);
    };
    out.slots.push_back({p.name, Argument<T>::type(), optional ? "None" : "", p.doc == nullptr ? "" : p.doc});
  };
  std::apply([&](const auto&... p) { (add(p), ...); }, leading);
  add_options<Options>(out.slots);
  return out;
}

/// call(first…, leading…, options) with what a call of Python gives.
template <typename Options, typename... Leading, typename Call, typename... First>
decltype(auto) call_with(const Signature& signature, const py::args& args, const py::kwargs& kwargs, const Call& call,
                         First&&... first) {
  const std::vector<py::handle> given = signature.sort(args, kwargs);
  const auto read = [&]<typename T>(std::type_identity<T>, std::size_t i) -> decltype(auto) {
    const char* const name = signature.slots[i].name.c_str();
    return Argument<T>::from(given[i].ptr() == nullptr ? py::handle(Py_None) : given[i], name);
  };
  Options options{};
  set_options(options, given.data() + sizeof...(Leading));
  return [&]<std::size_t... I>(std::index_sequence<I...>) -> decltype(auto) {
    return call(std::forward<First>(first)..., read(std::type_identity<Leading>{}, I)..., options);
  }(std::index_sequence_for<Leading...>{});
}

/// The constructor of `c`: make(leading…, options). `positional_options` of the options may be given by position, the
/// others by name alone.
template <typename Options, typename Class, typename... Extra, typename... Leading, typename Make>
void def_init(py::class_<Class, Extra...>& c, const std::tuple<Parameter<Leading>...>& leading,
              std::size_t positional_options, const char* doc, Make make) {
  py::options mute;
  mute.disable_function_signatures();
  const std::string name = py::str(c.attr("__name__"));
  const Signature s = signature<Options>(name, leading, positional_options);
  c.def(py::init([s, make](const py::args& args, const py::kwargs& kwargs) {
          return call_with<Options, Leading...>(s, args, kwargs, make);
        }),
        s.docstring("__init__", Argument<Class>::type(), "None", doc).c_str());
}

/// The property `options` of `c`: what its constructor was given, by keyword.
template <typename Class, typename... Extra>
void def_options(py::class_<Class, Extra...>& c) {
  c.def_property_readonly(
      "options", [](const Class& self) { return to_dict(self.options()); },
      "The options by keyword: with ** of them the constructor makes the same again.");
}

/// A method of `c`: call(self, leading…, options).
template <typename Options, typename Class, typename... Extra, typename... Leading, typename Call>
void def_method(py::class_<Class, Extra...>& c, const char* name, const std::tuple<Parameter<Leading>...>& leading,
                std::size_t positional_options, const char* doc, Call call) {
  py::options mute;
  mute.disable_function_signatures();
  const std::string owner = py::str(c.attr("__name__"));
  const Signature s = signature<Options>(owner + "." + name, leading, positional_options);
  using Result = std::invoke_result_t<Call, Class&, decltype(Argument<Leading>::from({}, ""))..., const Options&>;
  c.def(
      name,
      [s, call](Class& self, const py::args& args, const py::kwargs& kwargs) {
        return call_with<Options, Leading...>(s, args, kwargs, call, self);
      },
      s.docstring(name, Argument<Class>::type(), Argument<std::decay_t<Result>>::type(), doc).c_str());
}

/// A function of the module: call(leading…, options).
template <typename Options, typename... Leading, typename Call>
void def_function(py::module_& m, const char* name, const std::tuple<Parameter<Leading>...>& leading,
                  std::size_t positional_options, const char* doc, Call call) {
  py::options mute;
  mute.disable_function_signatures();
  const Signature s = signature<Options>(name, leading, positional_options);
  using Result = std::invoke_result_t<Call, decltype(Argument<Leading>::from({}, ""))..., const Options&>;
  m.def(
      name,
      [s, call](const py::args& args, const py::kwargs& kwargs) {
        return call_with<Options, Leading...>(s, args, kwargs, call);
      },
      s.docstring(name, "", Argument<std::decay_t<Result>>::type(), doc).c_str());
}

}  // namespace sigmaik::bindings
