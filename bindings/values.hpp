#pragma once
// What makes a bound class a value in Python: == by its members, hash where it is immutable, copies and pickles.
//
// A pickle is a tuple whose first entry is the version; values.hpp of the library says what its bytes are. copy.copy
// and copy.deepcopy go by the pickle, so that a class of Python that derives from ours stays of its class.

#include <sigmaik/values.hpp>

#include "fields.hpp"

namespace sigmaik::bindings {

/// Throws unless a pickled state has `size` entries and begins with the version of this library.
void check_pickle(const py::tuple& state, std::size_t size, const char* name);

/// The bytes that a pickled state holds at an index. Throws where there are none.
std::string pickled_bytes(const py::tuple& state, std::size_t index, const char* name);

/// Whether two options, or two members of them, are the same.
template <typename T>
bool equal(const T& one, const T& other) {
  if constexpr (requires { one.has_value(); }) {
    return one.has_value() == other.has_value() && (!one || equal(*one, *other));
  } else if constexpr (requires { one.cwiseAbs(); }) {
    return one.size() == other.size() && (one.array() == other.array()).all();
  } else if constexpr (std::is_same_v<T, ToolCone>) {
    return equal(one.axis, other.axis) && one.angle == other.angle;
  } else if constexpr (std::is_same_v<T, Inertia>) {
    return same(one, other);
  } else if constexpr (std::is_same_v<T, Collisions>) {
    return one.model() == other.model();  // copies share the scene
  } else if constexpr (requires { Fields<T>::all; }) {
    return std::apply(
        [&](const auto&... entry) {
          return (equal(std::invoke(entry.member, one), std::invoke(entry.member, other)) && ...);
        },
        Fields<T>::all);
  } else {
    return one == other;
  }
}

/// Whether two rules are the same, as == of their Python objects says.
inline bool equal(const Method& one, const Method& other) {
  return method_to_python(one).equal(method_to_python(other));
}

/// The inverse of to_dict().
template <typename Options>
Options from_dict(const py::dict& keywords) {
  Options out{};
  std::size_t taken = 0;
  for_each_field(out, [&]<typename T>(const char* name, T& member, const char*) {
    if (!keywords.contains(name)) return;
    ++taken;
    const py::object given = keywords[name];
    if (!(Argument<T>::kNone && given.is_none())) member = Argument<T>::from(given, name);
  });
  if (taken != keywords.size()) throw Error("a pickle has options that this version of sigmaik does not know");
  return out;
}

/// A class that the module has.
template <typename T>
py::class_<T> bound(const py::module_& m, const char* name) {
  return py::reinterpret_borrow<py::class_<T>>(m.attr(name));
}

/// ==, for objects of one class alone.
template <typename T, typename... Extra, typename Equal>
void def_equality(py::class_<T, Extra...>& c, Equal equal) {
  c.def(
      "__eq__",
      [equal](const T& self, const py::object& other) {
        return py::isinstance<T>(other) && equal(self, other.template cast<const T&>());
      },
      py::arg("other"));
}

/// An immutable answer or model.
template <typename T, typename... Extra>
void def_value(py::class_<T, Extra...> c) {
  const std::string name = py::str(c.attr("__name__"));
  def_equality(c, [](const T& a, const T& b) { return same(a, b); });
  c.def("__hash__", [](const T& value) { return static_cast<py::ssize_t>(hash(value)); });
  c.def(py::pickle([](const T& value) { return py::make_tuple(kValuesVersion, py::bytes(save(value))); },
                   [name](const py::tuple& state) {
                     check_pickle(state, 2, name.c_str());
                     return load<T>(pickled_bytes(state, 1, name.c_str()));
                   }));
}

/// An object that is made of arguments alone. `arguments`: these as a tuple; `make` takes the tuple; `equal` compares.
template <typename T, typename... Extra, typename Arguments, typename Make, typename Equal>
void def_pickle(py::class_<T, Extra...>& c, std::size_t count, Arguments arguments, Make make, Equal equal) {
  const std::string name = py::str(c.attr("__name__"));
  def_equality(c, equal);
  c.def(py::pickle(
      [arguments](const T& self) { return py::tuple(py::make_tuple(kValuesVersion) + py::tuple(arguments(self))); },
      [name, count, make](const py::tuple& state) {
        check_pickle(state, count + 1, name.c_str());
        const py::tuple arguments_of = state[py::slice(1, static_cast<py::ssize_t>(count) + 1, 1)];
        try {
          return make(arguments_of);
        } catch (const py::cast_error&) {
          throw Error("the pickle of a " + name + " holds objects of other types");
        }
      }));
}

/// The same for an object that remembers: `arguments` and `make` leave out the state.
template <typename T, typename... Extra, typename Arguments, typename Make, typename Equal>
void def_state(py::class_<T, Extra...>& c, std::size_t count, Arguments arguments, Make make, Equal equal) {
  const std::string name = py::str(c.attr("__name__"));
  def_pickle(
      c, count + 1,
      [arguments](const T& self) {
        return py::tuple(py::tuple(arguments(self)) + py::make_tuple(py::bytes(save_state(self))));
      },
      [name, count, make](const py::tuple& state) {
        T out = make(state);
        load_state(out, pickled_bytes(state, count, name.c_str()));
        return out;
      },
      [equal](const T& a, const T& b) { return equal(a, b) && same_state(a, b); });
}

/// A hash by the chain alone.
template <typename T, typename... Extra>
void def_hash_by_chain(py::class_<T, Extra...>& c) {
  c.def("__hash__", [](const T& self) { return static_cast<py::ssize_t>(hash(self.chain())); });
}

}  // namespace sigmaik::bindings
