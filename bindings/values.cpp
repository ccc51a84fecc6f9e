#include "values.hpp"

namespace sigmaik::bindings {

void check_pickle(const py::tuple& state, std::size_t size, const char* name) {
  const std::string of = std::string("the pickle of a ") + name;
  if (state.empty() || !py::isinstance<py::int_>(state[0])) throw Error(of + " has no version");
  if (!py::object(state[0]).equal(py::int_(kValuesVersion))) {
    throw Error(of + " has version " + shown(state[0]) + "; this sigmaik reads version " +
                std::to_string(kValuesVersion));
  }
  if (state.size() != size) {
    throw Error(of + " has " + std::to_string(state.size()) + " parts, needs " + std::to_string(size));
  }
}

std::string pickled_bytes(const py::tuple& state, std::size_t index, const char* name) {
  if (!py::isinstance<py::bytes>(state[index])) throw Error(std::string("the pickle of a ") + name + " has no bytes");
  return state[index].cast<std::string>();
}

}  // namespace sigmaik::bindings
