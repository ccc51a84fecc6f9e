// Many servos in one call. The answers are numpy arrays on the memory of the batch.

#include <mutex>
#include <string_view>

#include "servo_options.hpp"

namespace sigmaik::bindings {
namespace {

// What the constructor takes: the options of the servos, with `size` and `threads` behind dt.
struct BatchOptions {
  ServoOptions servo{};
  std::size_t size = 1;
  int threads = 1;
};

// An entry of the table of ServoOptions, for a struct that holds one.
template <typename Member>
struct InServo {
  Member member;
  constexpr auto& operator()(auto& options) const { return std::invoke(member, options.servo); }
};

template <typename Entry>
constexpr auto in_servo(const Entry& entry) {
  if constexpr (requires { entry.name; }) {
    return field(entry.name, InServo<decltype(entry.member)>{entry.member}, entry.doc);
  } else {
    return nested(InServo<decltype(entry.member)>{entry.member});
  }
}

}  // namespace

template <>
struct Fields<BatchOptions> {
  static constexpr std::tuple all = std::apply(
      [](const auto& dt, const auto&... others) {
        return std::tuple{in_servo(dt), field("size", &BatchOptions::size, "B ≥ 1, number of servos."),
                          field("threads", &BatchOptions::threads,
                                "≥ 1, the most that work at once; never more than the machine has cores. The threads "
                                "live as long as the batch, and the answers do not depend on their number."),
                          in_servo(others)...};
      },
      Fields<ServoOptions>::all);
  static_assert(std::get<0>(all).name == std::string_view("dt"), "dt and size are given by position");
};

namespace {

// A batch is for one caller at a time, and the GIL is not held during a cycle.
class GuardedBatch {
 public:
  GuardedBatch(const Chain& chain, const Method& method, const BatchOptions& options)
      : batch_(chain, method, options.servo, options.size, options.threads), options_(options) {}

  // Calls work(batch) without the GIL, one at a time.
  template <typename Work>
  void alone(const Work& work) {
    const py::gil_scoped_release release;
    const std::lock_guard lock(mutex_);
    work(batch_);
  }
  ServoBatch& batch() noexcept { return batch_; }
  const BatchOptions& options() const noexcept { return options_; }
  const Servo& first() const noexcept { return batch_.servo(0); }
  py::ssize_t size() const noexcept { return static_cast<py::ssize_t>(batch_.size()); }
  py::ssize_t dof() const noexcept { return first().chain().dof(); }

 private:
  ServoBatch batch_;
  BatchOptions options_;
  std::mutex mutex_;
};

std::span<const double> span_of(const Array& array) { return {array.data(), static_cast<std::size_t>(array.size())}; }

// Of the shape (B, …) that is needed; entries that are not finite stop their own row alone.
Array rows_of(py::handle object, const char* what, std::vector<py::ssize_t> shape) {
  const Array array = Array::ensure(object);
  if (!array) {
    PyErr_Clear();
    refuse(what, "an array of numbers", object);
  }
  if (std::vector<py::ssize_t>(array.shape(), array.shape() + array.ndim()) != shape) {
    std::string need;
    for (const py::ssize_t length : shape) need += (need.empty() ? "(" : ", ") + std::to_string(length);
    throw Error(std::string(what) + " has shape " + shape_text(array) + "; it needs " + need + ")");
  }
  return array;
}

// (n,) for all, or (B, n).
Array starts_of(py::handle object, const char* what, const GuardedBatch& self) {
  const Array array = Array::ensure(object);
  if (array && array.ndim() == 1) return rows_of(object, what, {self.dof()});
  return rows_of(object, what, {self.size(), self.dof()});
}

// A view on the memory of the batch, which lives as long as the view.
template <typename Number>
py::array_t<Number> view(py::handle self, std::span<Number> numbers, std::vector<py::ssize_t> shape) {
  return py::array_t<Number>(std::move(shape), numbers.data(), self);
}

void require_started(const GuardedBatch& self, ServoBatch& batch) {
  if (batch.started() == 0) throw Error("no servo of the batch has a start: call reset(q) first");
  (void)self;
}

void reset(GuardedBatch& self, const ArrayLike& q, const MaybeArray& mask, const MaybeArray& qdot) {
  const Array start = starts_of(q, "q", self);
  const Array speed = qdot ? starts_of(*qdot, "qdot", self) : Array(0);
  using Mask = py::array_t<bool, py::array::c_style>;
  Mask chosen(0);
  if (mask) {
    const py::array given = py::array::ensure(*mask);
    if (!given || given.dtype().kind() != 'b') {
      throw Error("mask must be an array of truth values, one for each of the " + std::to_string(self.size()) +
                  " servos");
    }
    if (given.ndim() != 1 || given.shape(0) != self.size()) {
      throw Error("mask has shape " + shape_text(given) + "; it needs (" + std::to_string(self.size()) + ",)");
    }
    chosen = Mask::ensure(given);
  }
  self.alone([&](ServoBatch& batch) {
    batch.reset(span_of(start),
                {reinterpret_cast<const std::uint8_t*>(chosen.data()), static_cast<std::size_t>(chosen.size())},
                span_of(speed));
  });
}

void bind_calls(py::class_<GuardedBatch>& c) {
  c.def("reset", &reset, py::arg("q"), py::arg("mask") = py::none(), py::arg("qdot") = py::none(),
        "Starts servos, or starts them again, at q: (n,) for all, or (B, n) with a row for each.\n\n"
        "mask: (B,) truth values, the servos to start; None: all. The other rows of q are not read.\n"
        "qdot: (n,) or (B, n) how the arms move now; None: they rest.\n"
        "Where an entry that is read is not finite, Error is raised and nothing has changed.")
      .def(
          "update",
          [](GuardedBatch& self, const ArrayLike& poses, const MaybeArray& feedforward) -> GuardedBatch& {
            require_started(self, self.batch());
            const Array targets = rows_of(poses, "poses", {self.size(), 4, 4});
            const Array twists = feedforward ? rows_of(*feedforward, "feedforward", {self.size(), 6}) : Array(0);
            self.alone([&](ServoBatch& batch) { batch.update(span_of(targets), span_of(twists)); });
            return self;
          },
          py::arg("poses"), py::arg("feedforward") = py::none(), py::return_value_policy::reference_internal,
          "One cycle of every servo towards poses (B, 4, 4) of the tip in the base, without the GIL. Returns the "
          "batch.\n\n"
          "feedforward: (B, 6) twists [v; ω] of targets that move, base axes, at the target's origin.\n"
          "A row that is not a pose stops its own servo, whose status is BAD_INPUT, and no other. Wrong shapes raise "
          "Error.\n"
          "Arrays of float64 in C order are read where they are; others are copied first.")
      .def(
          "update_twist",
          [](GuardedBatch& self, const ArrayLike& twists, const Text& frame) -> GuardedBatch& {
            require_started(self, self.batch());
            const Array asked = rows_of(twists, "twists", {self.size(), 6});
            const Frame axes = task_argument(py::none(), frame).frame;
            self.alone([&](ServoBatch& batch) { batch.update_twist(span_of(asked), axes); });
            return self;
          },
          py::arg("twists"), py::arg("frame") = "base", py::return_value_policy::reference_internal,
          "One cycle of every servo along twists (B, 6) [v; ω] of the tips' origins, without the GIL. Returns the "
          "batch.\n\n"
          "frame: the axes of the twists, 'base' or 'tool'.\n"
          "A row that is not finite stops its own servo, whose status is BAD_INPUT, and no other.")
      .def(
          "servo",
          [](GuardedBatch& self, py::ssize_t index) {
            if (index < 0 || index >= self.size()) {
              throw py::index_error("there are " + std::to_string(self.size()) + " servos, and no number " +
                                    std::to_string(index));
            }
            return Servo(self.batch().servo(static_cast<std::size_t>(index)));
          },
          py::arg("index"), "A copy of one servo as it is now, with all of its history.");
}

void bind_answers(py::class_<GuardedBatch>& c) {
  const auto array = [&](const char* name, auto get, std::vector<py::ssize_t> width, const char* doc) {
    c.def_property_readonly(
        name,
        [get, width](const py::object& object) {
          auto& self = object.cast<GuardedBatch&>();
          std::vector<py::ssize_t> shape{self.size()};
          for (const py::ssize_t length : width) shape.push_back(length == 0 ? self.dof() : length);
          return view(object, get(self.batch()), std::move(shape));
        },
        doc);
  };
  array(
      "q", [](ServoBatch& b) { return b.q(); }, {0},
      "(B, n) position commands [rad or m]; NaN before the first reset.");
  array(
      "qdot", [](ServoBatch& b) { return b.qdot(); }, {0}, "(B, n) velocity commands over the last dt [rad/s or m/s].");
  array("status", [](ServoBatch& b) { return b.status(); }, {}, "(B,) int8, a Status for each servo.");
  array(
      "pose_error", [](ServoBatch& b) { return b.pose_error(); }, {6},
      "(B, 6) [m, rad] target minus tip before the cycle; zero for twists.");
  array("achieved_twist", [](ServoBatch& b) { return b.achieved_twist(); }, {6}, "(B, 6) J q̇ [m/s, rad/s].");
  array("pose", [](ServoBatch& b) { return b.tips(); }, {4, 4}, "(B, 4, 4) the tips in the base, at q.");
}

}  // namespace

void bind_servo_batch(py::module_& m) {
  py::class_<GuardedBatch> c(
      m, "ServoBatch",
      "Many servos of one arm, rule and options, a cycle of all of them in one call, without the GIL.\n\n"
      "    batch = sk.ServoBatch(arm, None, 1e-2, 1024, threads=2)\n"
      "    batch.reset(home)                       # (n,) for all; batch.reset(q, mask) starts some of them again\n"
      "    batch.update(poses)                     # (B, 4, 4)\n"
      "    batch.q, batch.qdot, batch.status       # (B, n), (B, n), (B,)\n\n"
      "Each servo does, to the last bit, what a Servo alone would do, and holds all limits. q, qdot, status, "
      "pose_error,\n"
      "achieved_twist and pose are views on arrays that the batch owns: each cycle overwrites them, `.copy()` keeps "
      "them, and\n"
      "what is written into them moves no servo. numpy.from_dlpack, torch.from_dlpack and others take them without a "
      "copy.");
  def_init<BatchOptions>(
      c,
      std::tuple{parameter<Chain>("chain"),
                 parameter<std::optional<Method>>("method", "None: JParse(), the best that there is.")},
      3, "Warns (ModelWarning) of velocity and acceleration limits that joints lack.",
      [](const Chain& chain, const std::optional<Method>& method, const BatchOptions& options) {
        auto batch = std::make_unique<GuardedBatch>(chain, method.value_or(JParse{}), options);
        warn(missing_limits(chain, options.servo.limits));
        return batch;
      });
  def_options(c);
  bind_calls(c);
  bind_answers(c);
  c.def_property_readonly("chain", [](const GuardedBatch& self) { return self.first().chain(); })
      .def_property_readonly("method", [](const GuardedBatch& self) { return self.first().method(); })
      .def_property_readonly(
          "dt", [](const GuardedBatch& self) { return self.options().servo.dt; }, "[s]")
      .def_property_readonly("size", &GuardedBatch::size, "B.")
      .def_property_readonly(
          "threads", [](GuardedBatch& self) { return self.batch().threads(); }, "Threads that work at once.")
      .def("__len__", &GuardedBatch::size)
      .def("__repr__", [](const GuardedBatch& self) {
        return record("ServoBatch", {{"", py::cast(self.first().chain())},
                                     {"", method_to_python(self.first().method())},
                                     {"dt", py::cast(self.options().servo.dt)},
                                     {"size", py::cast(self.size())}});
      });
}

}  // namespace sigmaik::bindings
