// A ServoLoop whose samples are read as a structured numpy array.

#include <pybind11/native_enum.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include <sigmaik/servo_loop.hpp>

#include "fields.hpp"

namespace sigmaik::bindings {

template <>
struct Fields<ServoLoopOptions> {
  static constexpr std::tuple all{
      field("history", &ServoLoopOptions::history, "samples kept for read(), a power of 2."),
      field("priority", &ServoLoopOptions::priority, "of SCHED_FIFO, 1 to 99; 0 is the ordinary scheduler."),
  };
};

namespace {

// Writes one sample's fields into a record, in the order in which dtype() names them.
class Record {
 public:
  explicit Record(char* at) : at_(at) {}

  template <typename Number>
  void put(Number value) {
    std::memcpy(at_, &value, sizeof value);
    at_ += sizeof value;
  }
  template <typename Derived>
  void put_all(const Eigen::MatrixBase<Derived>& values) {
    for (Eigen::Index i = 0; i < values.rows(); ++i) {
      for (Eigen::Index j = 0; j < values.cols(); ++j) put(static_cast<double>(values(i, j)));
    }
  }
  // Six columns; NaN where there are fewer.
  void put_columns(const TwistColumns& values) {
    for (Eigen::Index i = 0; i < 6; ++i) {
      for (Eigen::Index j = 0; j < 6; ++j)
        put(j < values.cols() ? values(i, j) : std::numeric_limits<double>::quiet_NaN());
    }
  }
  // NaN where there are fewer.
  void put_some(const TaskVector& values, int count) {
    for (int i = 0; i < count; ++i) put(i < values.size() ? values[i] : std::numeric_limits<double>::quiet_NaN());
  }

 private:
  char* at_;
};

py::dtype sample_dtype(int dof) {
  py::list fields;
  const auto add = [&](const char* name, const char* type) { fields.append(py::make_tuple(name, type)); };
  const auto add_array = [&](const char* name, py::tuple shape) { fields.append(py::make_tuple(name, "<f8", shape)); };
  add("cycle", "<i8");
  add("time", "<f8");
  add("command", "i1");
  add("configuration", "<i4");
  add("restarted", "?");
  add("status", "i1");
  add_array("q", py::make_tuple(dof));
  add_array("qdot", py::make_tuple(dof));
  add_array("target", py::make_tuple(4, 4));
  add_array("pose", py::make_tuple(4, 4));
  add_array("pose_error", py::make_tuple(6));
  add_array("asked_twist", py::make_tuple(6));
  add_array("achieved_twist", py::make_tuple(6));
  add_array("singular_values", py::make_tuple(std::min(6, dof)));
  add("singular", "u1");
  add_array("singular_directions", py::make_tuple(6, 6));
  add("limiting_joints", "<u2");
  add("scale", "<f8");
  add("guide", "i1");
  add("guide_joints", "<u2");
  return py::dtype::from_args(fields);
}

void write(const LoopSample& s, int dof, char* at) {
  Record record(at);
  record.put(s.cycle);
  record.put(s.time);
  record.put(static_cast<std::int8_t>(s.command));
  record.put(static_cast<std::int32_t>(s.configuration));
  record.put(s.restarted);
  record.put(static_cast<std::int8_t>(s.step.status));
  record.put_all(s.step.q);
  record.put_all(s.step.qdot);
  record.put_all(s.target.matrix());
  record.put_all(s.tip.matrix());
  record.put_all(s.step.pose_error);
  record.put_all(s.step.asked_twist);
  record.put_all(s.step.achieved_twist);
  record.put_some(s.step.singular_values, std::min(6, dof));
  record.put(s.step.singular);
  record.put_columns(s.step.singular_directions);
  record.put(s.step.limiting_joints);
  record.put(s.step.scale);
  record.put(static_cast<std::int8_t>(s.step.guide));
  record.put(s.step.guide_joints);
}

py::array read(ServoLoop& loop) {
  constexpr std::size_t kBlock = 256;
  std::vector<LoopSample> samples;
  for (;;) {
    const std::size_t there = samples.size();
    samples.resize(there + kBlock);
    const std::size_t count = loop.read(std::span(samples).subspan(there));
    samples.resize(there + count);
    if (count < kBlock) break;
  }
  const py::dtype dtype = sample_dtype(loop.dof());
  py::array out(dtype, static_cast<py::ssize_t>(samples.size()));
  char* at = static_cast<char*>(out.mutable_data());
  for (const LoopSample& sample : samples) {
    write(sample, loop.dof(), at);
    at += dtype.itemsize();
  }
  return out;
}

// Python's other threads run on while the arm comes to rest.
void stop(ServoLoop& loop) {
  const py::gil_scoped_release release;
  loop.stop();
}

void bind_command(py::module_& m) {
  py::native_enum<LoopCommand>(m, "LoopCommand", "enum.IntEnum", "What a cycle of a ServoLoop followed.")
      .value("HOLD", LoopCommand::Hold)
      .value("POSE", LoopCommand::FollowPose)
      .value("TWIST", LoopCommand::FollowTwist)
      .value("STALE", LoopCommand::Stale)
      .finalize();
}

void bind_statistics(py::module_& m) {
  py::class_<LoopStatistics>(m, "LoopStatistics", "How a ServoLoop keeps its rate.")
      .def_readonly("cycles", &LoopStatistics::cycles)
      .def_readonly("missed", &LoopStatistics::missed, "Cycles left out, as their time had passed.")
      .def_readonly("unread", &LoopStatistics::unread, "Samples lost, as nobody read them in time.")
      .def_readonly("worst_delay", &LoopStatistics::worst_delay, "[s] from when a cycle was due to its start.")
      .def_readonly("elapsed", &LoopStatistics::elapsed, "[s] since start(), or from start() to stop().")
      .def_property_readonly("rate", &LoopStatistics::rate, "[Hz] cycles a second.")
      .def("__repr__", [](const LoopStatistics& s) {
        return record("LoopStatistics", {{"cycles", py::cast(s.cycles)},
                                         {"missed", py::cast(s.missed)},
                                         {"unread", py::cast(s.unread)},
                                         {"worst_delay", py::cast(s.worst_delay)},
                                         {"rate", py::cast(s.rate())}});
      });
}

void bind_thread(py::class_<ServoLoop>& c) {
  def_init<ServoLoopOptions>(c, std::tuple{parameter<Servo>("servo", "has started (reset); it is copied.")}, 0, "",
                             [](const Servo& servo, const ServoLoopOptions& options) {
                               return std::make_unique<ServoLoop>(servo, ServoLoop::Sink{}, options);
                             });
  c.def("start", &ServoLoop::start,
        "Starts the thread. Raises Error where it runs already, or the system refuses the priority.")
      .def("stop", &stop, "Brings the arm to rest, in a second at most, and ends the thread.")
      .def_property_readonly("running", &ServoLoop::running);
}

void bind_targets(py::class_<ServoLoop>& c) {
  c.def(
       "follow",
       [](ServoLoop& loop, const py::object& target, double timeout) {
         loop.follow(pose_argument(target, "target"), timeout);
       },
       py::arg("target"), py::arg("timeout"),
       "Follows a pose (4, 4) of the tip in the base, for `timeout` [s] unless it is said again.")
      .def(
          "follow_twist",
          [](ServoLoop& loop, const ArrayLike& twist, double timeout) {
            loop.follow_twist(twist_argument(twist, "twist"), timeout);
          },
          py::arg("twist"), py::arg("timeout"),
          "Follows a twist (6,) [v; ω], base axes, at the tip's origin, for `timeout` [s] unless it is said again.")
      .def("hold", &ServoLoop::hold, "Stops as fast as limits allow, and rests.")
      .def("configure", &ServoLoop::configure, py::arg("servo"), py::arg("restart") = false,
           "Goes on with another servo (a copy) of the same arm and dt: other rule, other options.\n\n"
           "The new servo takes over the motion. With `restart` it starts where it was reset to, in simulation only:\n"
           "a real arm would jump.\n"
           "Returns a number, one more each time, by which samples tell it; 0 is the first servo's.");
}

void bind_records(py::class_<ServoLoop>& c) {
  c.def("read", &read,
        "(N,) structured array: what was done in each cycle since the last call.\n\n"
        "cycle, time [s] since start(), command (LoopCommand), configuration, restarted, status (Status), q and "
        "qdot (n,), target and\n"
        "pose (4, 4) of the tip, pose_error, asked_twist and achieved_twist (6,), singular_values (NaN while "
        "holding),\n"
        "singular (bits), singular_directions (6, 6) (ServoStep's columns, NaN beyond them), limiting_joints "
        "(bits),\n"
        "scale, guide (GuideState), guide_joints (bits).")
      .def_property_readonly("statistics", &ServoLoop::statistics)
      .def_property_readonly("dt", &ServoLoop::dt, "[s]")
      .def("__repr__", [](const ServoLoop& loop) {
        return record(
            "ServoLoop",
            {{"dof", py::cast(loop.dof())}, {"dt", py::cast(loop.dt())}, {"running", py::cast(loop.running())}});
      });
}

void bind_context(py::class_<ServoLoop>& c) {
  c.def("__enter__",
        [](const py::object& self) {
          self.cast<ServoLoop&>().start();
          return self;
        })
      .def(
          "__exit__", [](ServoLoop& loop, const py::object&, const py::object&, const py::object&) { stop(loop); },
          py::arg("type"), py::arg("value"), py::arg("traceback"));
}

}  // namespace

void bind_servo_loop(py::module_& m) {
  bind_command(m);
  bind_statistics(m);
  py::class_<ServoLoop> c(
      m, "ServoLoop",
      "A servo in a thread of its own, at its own rate, whatever Python does meanwhile.\n\n"
      "Commands hold until they are stale: an arm whose commander hangs, or is gone, stops by itself, within its\n"
      "limits. Late cycles are counted and left out, never made up for by a burst.");
  bind_thread(c);
  bind_targets(c);
  bind_records(c);
  bind_context(c);
}

}  // namespace sigmaik::bindings
