#include <string>
#include <tuple>
#include <type_traits>

#include "arguments.hpp"
#include "fields.hpp"

// Every class here is made from the rule's own table: see sigmaik/rules/jparse.hpp.

namespace sigmaik::bindings {

class SIGMAIK_HIDDEN RuleClasses : public py::tuple {
  using py::tuple::tuple;
};

}  // namespace sigmaik::bindings

template <>
struct pybind11::detail::handle_type_name<sigmaik::bindings::RuleClasses> {
  static constexpr auto name = const_name("tuple[type[sigmaik._core.Method], ...]");
};

namespace sigmaik::bindings {
namespace {

// A value that stands for "not given" is None in Python.
template <typename R, typename Value>
py::object to_python(const R& rule, const sigmaik::Parameter<R, Value>& p) {
  const Value value = rule.*p.member;
  return p.none && value == *p.none ? py::none() : Argument<Value>::to(value);
}

template <typename R, typename Value>
void from_python(R& rule, const sigmaik::Parameter<R, Value>& p, py::handle object) {
  if (p.none && object.is_none()) {
    rule.*p.member = *p.none;
    return;
  }
  const std::string what = std::string(R::kName) + ": " + p.name;
  const Value value = Argument<Value>::from(object, what.c_str());
  if (p.none && value == *p.none) throw Error(what + " = " + Argument<Value>::text(value) + " is no value; give None");
  rule.*p.member = value;
}

template <typename R>
py::dict parameters(const R& rule) {
  py::dict out;
  for_each_parameter<R>([&](const auto& p) { out[p.name] = to_python(rule, p); });
  return out;
}

template <typename R>
void bind_constructor(py::class_<R>& c) {
  Signature s{R::kName, {}, std::tuple_size_v<decltype(R::parameters())>};
  for_each_parameter<R>([&](const auto& p) {
    const auto value = R{}.*p.member;
    using A = Argument<std::decay_t<decltype(value)>>;
    const bool none = p.none && value == *p.none;
    s.slots.push_back({p.name, A::type() + (p.none ? " | None" : ""), none ? "None" : A::text(value), p.doc});
  });
  py::options mute;
  mute.disable_function_signatures();
  c.def(py::init([s](const py::args& args, const py::kwargs& kwargs) {
          const std::vector<py::handle> given = s.sort(args, kwargs);
          R rule{};
          auto object = given.begin();
          for_each_parameter<R>([&](const auto& p) {
            if (object->ptr() != nullptr) from_python(rule, p, *object);
            ++object;
          });
          check_rule(rule);
          return rule;
        }),
        s.docstring("__init__", Argument<R>::type(), "None", "").c_str());
}

template <typename R>
py::object bind_rule(py::module_& m) {
  auto c = py::class_<R>(m, R::kName, py::type::of<MethodClass>(), R::kDoc);
  bind_constructor(c);
  for_each_parameter<R>([&](const auto& p) {
    using Value = typename std::decay_t<decltype(p)>::value_type;
    using Spelled = std::conditional_t<std::is_enum_v<Value>, std::string, Value>;
    if (p.none) {
      c.def_property_readonly(
          p.name, [p](const R& rule) { return to_python(rule, p).template cast<std::optional<Spelled>>(); }, p.doc);
    } else {
      c.def_property_readonly(
          p.name, [p](const R& rule) { return to_python(rule, p).template cast<Spelled>(); }, p.doc);
    }
  });
  c.attr("short_name") = R::kShortName;
  c.attr("title") = R::kTitle;
  return c;
}

py::dict parameters(const py::object& self) {
  Method method;
  load_method(self, method);
  return std::visit(
      []<typename R>(const R& rule) -> py::dict {
        if constexpr (std::is_same_v<R, CustomRule>) {
          return {};
        } else {
          return parameters(rule);
        }
      },
      method);
}

}  // namespace

bool load_method(py::handle object, Method& method) {
  if (py::isinstance<py::str>(object)) {
    const py::object named = py::module_::import("sigmaik.methods").attr("parse")(object);
    return load_method(named, method);
  }
  bool found = false;
  Rules::for_each([&]<typename R>(const R&) {
    if (found || !py::isinstance<R>(object)) return;
    method = object.cast<const R&>();
    found = true;
  });
  if (!found) refuse("method", "a sigmaik.Method, or the name of one", object);
  return found;
}

py::object method_to_python(const Method& method) {
  return std::visit(
      []<typename R>(const R& rule) -> py::object {
        if constexpr (std::is_same_v<R, CustomRule>) {
          throw Error(std::string("the rule ") + rule.name() + " is an application's own: Python has no class for it");
        } else {
          return py::cast(rule);
        }
      },
      method);
}

void bind_methods(py::module_& m) {
  py::class_<MethodClass> base(
      m, "Method",
      "A rule with its parameters: what a method does with each singular direction. The base class of all of them.\n\n"
      "Wherever a method is an argument, its name is accepted too: \"jparse:gamma=0.2\", see sigmaik.methods.");
  base.def_property_readonly(
      "parameters", [](const py::object& self) -> py::typing::Dict<py::str, py::object> { return parameters(self); },
      "The constructor's arguments by name.");
  base.attr("short_name") = "";
  base.attr("title") = "";
  base.def("__repr__", [](const py::object& self) {
    std::string text;
    for (const auto& [key, value] : parameters(self)) {
      text += (text.empty() ? "" : ", ") + key.cast<std::string>() + "=" + py::repr(value).cast<std::string>();
    }
    return py::type::of(self).attr("__name__").cast<std::string>() + "(" + text + ")";
  });
  base.def("__hash__", [](const py::object& self) {  // by the values, as equality: −0.0 is 0.0
    return py::hash(py::make_tuple(py::type::of(self), py::tuple(parameters(self).attr("values")())));
  });
  base.def("__eq__", [](const py::object& self, const py::object& other) {
    return py::type::of(self).is(py::type::of(other)) && parameters(self).equal(parameters(other));
  });
  using Recipe = py::typing::Tuple<py::object, py::typing::Tuple<py::object, py::ellipsis>>;
  base.def("__reduce__", [](const py::object& self) -> Recipe {
    const auto partial = py::module_::import("functools").attr("partial");
    return py::make_tuple(partial(py::type::of(self), **parameters(self)), py::tuple());
  });

  py::list classes;
  Rules::for_each([&]<typename R>(const R&) { classes.append(bind_rule<R>(m)); });
  m.def(
      "rules", [all = py::tuple(classes)]() -> RuleClasses { return RuleClasses(all); },
      "The class of every rule, in the order of lists and tables.");
}

}  // namespace sigmaik::bindings
