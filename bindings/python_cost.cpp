#include "python_cost.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

namespace sigmaik::bindings {
namespace {

using planning::BatchCost;
using planning::JointCostPtr;

class PythonCost final : public BatchCost {
 public:
  PythonCost(const py::object& object, int dof) : dof_(dof), name_(py::str(py::type::of(object).attr("__name__"))) {
    value_ = method(object, "value");
    if (value_.is_none()) throw Error("a cost of type '" + name_ + "' has no method value(q)");
    gradient_ = method(object, "gradient");
  }
  int dof() const noexcept override { return dof_; }

  void evaluate(std::size_t count, const double* q, double* value, double* gradient) const override {
    const py::gil_scoped_acquire gil;
    call(value_, "value", count, q, {}, value);
    if (gradient == nullptr) return;
    if (gradient_.is_none()) {
      differences(count, q, gradient);
    } else {
      call(gradient_, "gradient", count, q, {dof_}, gradient);
    }
  }

 private:
  static py::object method(const py::object& object, const char* name) {
    py::object found = py::getattr(object, name, py::none());
    if (!found.is_none() && PyCallable_Check(found.ptr()) == 0) {
      throw Error(py::str(py::type::of(object).attr("__name__")).cast<std::string>() + "." + name +
                  " cannot be called");
    }
    return found;
  }

  // f(q) with q an array of its own (count, n), which f may keep; the answer is (count, *one).
  void call(const py::object& f, const char* what, std::size_t count, const double* q, std::vector<py::ssize_t> one,
            double* out) const {
    const auto rows = static_cast<py::ssize_t>(count), n = static_cast<py::ssize_t>(dof_);
    const py::object answer = f(py::array_t<double>({rows, n}, q));
    const std::string name = name_ + "." + what;
    const Array array = one.empty()
                            ? array_argument(answer, name.c_str(), {rows}, ("(" + std::to_string(rows) + ",)").c_str())
                            : array_argument(
                                  answer, name.c_str(), {rows, one.front()},
                                  ("(" + std::to_string(rows) + ", " + std::to_string(one.front()) + ")").c_str());
    std::copy(array.data(), array.data() + array.size(), out);
  }

  // (f(q + h e_j) − f(q − h e_j))/(2h), all in one call. With h = ∛ε max(1, |q_j|) the error of the difference, h²
  // f‴/6, and that of rounding, ε f/h, are of one size.
  void differences(std::size_t count, const double* q, double* gradient) const {
    const auto n = static_cast<std::size_t>(dof_);
    std::vector<double> around, value(2 * count * n), width(count * n);
    around.reserve(2 * count * n * n);
    for (std::size_t b = 0; b < count; ++b) {
      for (std::size_t j = 0; j < n; ++j) {
        const double at = q[b * n + j], h = 6.0554544523933395e-06 * std::max(1.0, std::abs(at));
        const double ends[] = {at + h, at - h};
        width[b * n + j] = ends[0] - ends[1];  // as rounded
        for (const double end : ends) {
          around.insert(around.end(), q + b * n, q + (b + 1) * n);
          around[around.size() - n + j] = end;
        }
      }
    }
    call(value_, "value", 2 * count * n, around.data(), {}, value.data());
    for (std::size_t i = 0; i < count * n; ++i) gradient[i] = (value[2 * i] - value[2 * i + 1]) / width[i];
  }

  int dof_;
  std::string name_;
  py::object value_, gradient_;
};

class BatchSum final : public BatchCost {
 public:
  BatchSum(std::vector<planning::BatchCostPtr> costs, int dof) : costs_(std::move(costs)), dof_(dof) {}
  int dof() const noexcept override { return dof_; }

  void evaluate(std::size_t count, const double* q, double* value, double* gradient) const override {
    const std::size_t slopes = gradient == nullptr ? 0 : count * static_cast<std::size_t>(dof_);
    std::vector<double> v(count), g(slopes);
    std::fill(value, value + count, 0.0);
    std::fill(gradient, gradient + slopes, 0.0);
    for (const planning::BatchCostPtr& cost : costs_) {
      cost->evaluate(count, q, v.data(), gradient == nullptr ? nullptr : g.data());
      std::transform(v.begin(), v.end(), value, value, std::plus<>());
      std::transform(g.begin(), g.end(), gradient, gradient, std::plus<>());
    }
  }

 private:
  std::vector<planning::BatchCostPtr> costs_;
  int dof_;
};

}  // namespace

planning::BatchCostPtr with_python_costs(JointCostPtr cost, int dof, const std::vector<py::object>& python) {
  if (python.empty()) return cost;
  if (cost && cost->dof() != dof) {
    throw Error("the cost is for " + std::to_string(cost->dof()) + " joints, the chain has " + std::to_string(dof));
  }
  std::vector<planning::BatchCostPtr> all;
  if (cost) all.push_back(std::move(cost));
  for (const py::object& object : python) all.push_back(std::make_shared<PythonCost>(object, dof));
  return std::make_shared<BatchSum>(std::move(all), dof);
}

}  // namespace sigmaik::bindings
