// A ServoLoop whose samples are read as a structured numpy array.

#include <pybind11/native_enum.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <optional>

#include <sigmaik/servo_loop.hpp>

#include "values.hpp"

namespace sigmaik::bindings {

template <>
struct Fields<ServoLoopOptions> {
  static constexpr std::tuple all{
      field("history", &ServoLoopOptions::history, "samples kept for read(), a power of 2."),
      field("priority", &ServoLoopOptions::priority, "of SCHED_FIFO, 1 to 99; 0 is the ordinary scheduler."),
      field("max_missed", &ServoLoopOptions::max_missed,
            "cycles left out in one go, beyond which the arm stops with a fault; None: the cycles of one second."),
      field("max_following_error", &ServoLoopOptions::max_following_error,
            "(n,) [rad or m]: a joint measured farther than this from its command stops the arm with a fault; None: no "
            "check."),
      field("measure_timeout", &ServoLoopOptions::measure_timeout,
            "[s]: this time without measure(), from start() on, stops the arm with a fault; None: no check."),
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
  add("state", "i1");
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
  record.put(static_cast<std::int8_t>(s.state));
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
bool stop(ServoLoop& loop, std::optional<double> timeout) {
  const py::gil_scoped_release release;
  return timeout ? loop.stop(*timeout) : loop.stop();
}

// None: nobody's.
LoopToken token_of(const std::optional<LoopToken>& token) { return token.value_or(LoopToken{}); }

void bind_state(py::module_& m) {
  py::native_enum<LoopState>(m, "LoopState", "enum.IntEnum",
                             "What a ServoLoop does.\n\n"
                             "DISABLED: no thread runs. HOLDING: no command, or a stale one. FOLLOWING: a command.\n"
                             "STOPPING: stop(), halt() or a fault brings the arm to rest. STOPPED: at rest after "
                             "halt(), until release().\n"
                             "FAULTED: at rest after a fault, until acknowledge().")
      .value("DISABLED", LoopState::Disabled)
      .value("HOLDING", LoopState::Holding)
      .value("FOLLOWING", LoopState::Following)
      .value("STOPPING", LoopState::Stopping)
      .value("STOPPED", LoopState::Stopped)
      .value("FAULTED", LoopState::Faulted)
      .finalize();
}

void bind_value(py::class_<LoopFault> c) {
  const auto parts = [](const LoopFault& f) {
    return py::make_tuple(static_cast<int>(f.kind), f.text, f.time, f.joint);
  };
  def_pickle(
      c, 4, parts,
      [](const py::tuple& s) {
        const int kind = s[0].cast<int>();
        if (kind < 1 || kind > 4) throw Error("the pickle of a LoopFault has no kind " + std::to_string(kind));
        return LoopFault{static_cast<LoopFaultKind>(kind), s[1].cast<std::string>(), s[2].cast<double>(),
                         s[3].cast<int>()};
      },
      [parts](const LoopFault& a, const LoopFault& b) { return parts(a).equal(parts(b)); });
  c.def("__hash__", [parts](const LoopFault& f) { return py::hash(parts(f)); });
}

void bind_value(py::class_<LoopStatistics> c) {
  const auto parts = [](const LoopStatistics& s) {
    return py::make_tuple(s.cycles, s.missed, s.unread, s.sink_errors, s.rough_targets, s.worst_delay, s.elapsed);
  };
  def_pickle(
      c, 7, parts,
      [](const py::tuple& s) {
        const auto count = [&](std::size_t i) { return s[i].cast<std::int64_t>(); };
        return LoopStatistics{count(0),           count(1), count(2), count(3), count(4), s[5].cast<double>(),
                              s[6].cast<double>()};
      },
      [parts](const LoopStatistics& a, const LoopStatistics& b) { return parts(a).equal(parts(b)); });
  c.def("__hash__", [parts](const LoopStatistics& s) { return py::hash(parts(s)); });
}

void bind_fault(py::module_& m) {
  py::native_enum<LoopFaultKind>(m, "LoopFaultKind", "enum.IntEnum",
                                 "Why a ServoLoop stopped the arm by itself.\n\n"
                                 "SINK: the function that sends the commands threw. LATE: more than max_missed cycles "
                                 "were left out in one go.\n"
                                 "FOLLOWING_ERROR: a joint was measured too far from its command. UNMEASURED: no "
                                 "measure() came in time.")
      .value("SINK", LoopFaultKind::Sink)
      .value("LATE", LoopFaultKind::Late)
      .value("FOLLOWING_ERROR", LoopFaultKind::FollowingError)
      .value("UNMEASURED", LoopFaultKind::Unmeasured)
      .finalize();
  py::class_<LoopFault>(m, "LoopFault", "The first fault of a ServoLoop since the last acknowledge().")
      .def_readonly("kind", &LoopFault::kind)
      .def_readonly("text", &LoopFault::text, "The cause with its figures.")
      .def_readonly("time", &LoopFault::time, "[s] since start().")
      .def_readonly("joint", &LoopFault::joint, "of a following error; else −1.")
      .def("__repr__", [](const LoopFault& f) {
        return record("LoopFault", {{"kind", py::str(to_string(f.kind))},
                                    {"text", py::cast(f.text)},
                                    {"time", py::cast(f.time)},
                                    {"joint", py::cast(f.joint)}});
      });
  bind_value(bound<LoopFault>(m, "LoopFault"));
  py::class_<LoopToken>(m, "LoopToken", "Names the owner of an arm to its ServoLoop: see ServoLoop.take.")
      .def("__eq__", [](const LoopToken& a,
                        const py::object& b) { return py::isinstance<LoopToken>(b) && a == b.cast<LoopToken>(); })
      .def("__hash__", [](const LoopToken& t) { return t.number; })
      .def("__repr__", [](const LoopToken& t) { return record("LoopToken", {{"number", py::cast(t.number)}}); });
}

bool measure(ServoLoop& loop, const ArrayLike& q, const MaybeArray& qdot) {
  return loop.measure(joint_argument(q, "q", loop.dof()), optional_joint_argument(object_of(qdot), "qdot", loop.dof()));
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
      .def_readonly("rough_targets", &LoopStatistics::rough_targets,
                    "Poses of follow() whose rotation was off by more than rounding, and was made one.")
      .def_readonly("unread", &LoopStatistics::unread, "Samples lost, as nobody read them in time.")
      .def_readonly("sink_errors", &LoopStatistics::sink_errors, "Exceptions of the sink.")
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
  bind_value(bound<LoopStatistics>(m, "LoopStatistics"));
}

void bind_thread(py::class_<ServoLoop>& c) {
  def_init<ServoLoopOptions>(c, std::tuple{parameter<Servo>("servo", "has started (reset); it is copied.")}, 0, "",
                             [](const Servo& servo, const ServoLoopOptions& options) {
                               return std::make_unique<ServoLoop>(servo, ServoLoop::Sink{}, options);
                             });
  c.def("start", &ServoLoop::start,
        "Starts the thread. The arm rests until a command comes: commands from before are forgotten.\n\n"
        "Raises Error where the loop runs already, a fault is not acknowledged, or the system refuses the priority.")
      .def("stop", &stop, py::arg("timeout") = py::none(),
           "Brings the arm to rest by the fastest stop that its limits allow, and then ends the thread.\n\n"
           "Waits for `timeout` [s], 0 to 60, at most; None: `stop_time`. Returns whether the arm rests and no thread "
           "runs; where it\n"
           "does not, the thread goes on stopping the arm, and ends by itself.")
      .def_property_readonly("stop_time", &ServoLoop::stop_time,
                             "[s] for which stop() waits at most, from the arm's limits.")
      .def_property_readonly("running", &ServoLoop::running, "Whether the thread runs, in this process.")
      .def_property_readonly("state", &ServoLoop::state,
                             "The LoopState that the last cycle and the calls since have left.");
}

void bind_safety(py::class_<ServoLoop>& c) {
  c.def("halt", &ServoLoop::halt,
        "Stops the arm as fast as its limits allow, and latches: the arm rests until release(), whoever commands.")
      .def(
          "release", [](ServoLoop& loop, const std::optional<LoopToken>& token) { loop.release(token_of(token)); },
          py::arg("token") = py::none(),
          "Opens the latch of halt(), or of a fault that is acknowledged. The arm rests until a new command comes.\n\n"
          "Raises Error where the arm does not rest yet, a fault is not acknowledged, or somebody else owns the arm.")
      .def_property_readonly("halted", &ServoLoop::halted,
                             "Whether the latch of halt(), or of a fault, is closed: also while no thread runs.")
      .def_property_readonly("fault", &ServoLoop::fault,
                             "The fault that stopped the arm, until acknowledge(); or None.")
      .def("acknowledge", &ServoLoop::acknowledge,
           "Forgets the fault. The arm stays halted, until release(). Raises Error where the arm does not rest yet.")
      .def("measure", &measure, py::arg("q"), py::arg("qdot") = py::none(),
           "Tells the loop where the arm is: q and qdot (n,), as often as they are measured, from one thread.\n\n"
           "The next cycle compares q with the command (max_following_error), and gives both to Servo.measure.\n"
           "Returns False where the loop does not run, or another thread is just measuring.");
}

void bind_owner(py::class_<ServoLoop>& c) {
  c.def(
       "take", [](ServoLoop& loop, const Text& name, bool take_over) { return loop.take(name, take_over); },
       py::arg("name"), py::arg("take_over") = false,
       "Makes the caller the arm's owner; a live command is forgotten.\n\n"
       "Until give_back(), follow(), follow_twist(), configure() and release() need the token that is returned; "
       "anyone may\n"
       "stop(), halt() and hold() the arm. Raises Error where the arm has an owner, unless it is taken over.")
      .def("give_back", &ServoLoop::give_back, py::arg("token"),
           "Gives the arm back, and stops it. Returns False where the token is not the owner's, and changes nothing.")
      .def_property_readonly("owner", &ServoLoop::owner, "The owner's name; '' where nobody owns the arm.");
}

void bind_targets(py::class_<ServoLoop>& c) {
  c.def(
       "follow",
       [](ServoLoop& loop, const py::object& target, double timeout, const std::optional<LoopToken>& token) {
         loop.follow(pose_argument(target, "target"), timeout, token_of(token));
       },
       py::arg("target"), py::arg("timeout"), py::arg("token") = py::none(),
       "Follows a pose (4, 4) of the tip in the base, for `timeout` [s] (up to 60) unless it is said again.\n\n"
       "Raises Error where the loop does not run, is halted, stopping or faulted, or somebody else owns the arm.")
      .def(
          "follow_twist",
          [](ServoLoop& loop, const ArrayLike& twist, double timeout, const std::optional<LoopToken>& token) {
            loop.follow_twist(twist_argument(twist, "twist"), timeout, token_of(token));
          },
          py::arg("twist"), py::arg("timeout"), py::arg("token") = py::none(),
          "Follows a twist (6,) [v; ω], base axes, at the tip's origin, for `timeout` [s] (up to 60) unless it is said "
          "again.\n\n"
          "Raises Error as follow() does.")
      .def(
          "set_tool",
          [](ServoLoop& loop, const py::object& tool, const std::optional<LoopToken>& token) {
            loop.set_tool(pose_argument(tool, "tool"), token_of(token));
          },
          py::arg("tool"), py::arg("token") = py::none(),
          "Puts a tool (4, 4) on the tip from the next cycle on, without a jump: see Servo.set_tool.\n\n"
          "The live command goes on, and is then the tool's.")
      .def("hold", &ServoLoop::hold, "Stops as fast as limits allow, and rests until the next command.")
      .def(
          "configure",
          [](ServoLoop& loop, const Servo& servo, bool restart, const std::optional<LoopToken>& token) {
            return loop.configure(servo, restart, token_of(token));
          },
          py::arg("servo"), py::arg("restart") = false, py::arg("token") = py::none(),
          "Goes on with another servo (a copy) of the same arm and dt: other rule, other options.\n\n"
          "The new servo takes over the motion. With `restart` it starts where it was reset to: in simulation, or\n"
          "where the arm rests there already. Any other arm jumps.\n"
          "Returns a number, one more each time, by which samples tell it; 0 is the first servo's.");
}

void bind_records(py::class_<ServoLoop>& c) {
  c.def("read", &read,
        "(N,) structured array: what was done in each cycle since the last call.\n\n"
        "cycle, time [s] since start(), command (LoopCommand), configuration, state (LoopState), restarted, status "
        "(Status), q and qdot (n,), target and\n"
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
            {{"dof", py::cast(loop.dof())}, {"dt", py::cast(loop.dt())}, {"state", py::str(to_string(loop.state()))}});
      });
}

void bind_context(py::class_<ServoLoop>& c) {
  c.def("__enter__",
        [](const py::object& self) {
          self.cast<ServoLoop&>().start();
          return self;
        })
      .def(
          "__exit__",
          [](ServoLoop& loop, const py::object& type, const py::object&, const py::object&) {
            if (stop(loop, {}) || !type.is_none() || !loop.running()) return;
            throw Error("the arm does not rest yet: the loop goes on stopping it");
          },
          py::arg("type"), py::arg("value"), py::arg("traceback"));
}

}  // namespace

void bind_servo_loop(py::module_& m) {
  bind_command(m);
  bind_state(m);
  bind_fault(m);
  bind_statistics(m);
  py::class_<ServoLoop> c(
      m, "ServoLoop",
      "A servo in a thread of its own, at its own rate, whatever Python does meanwhile.\n\n"
      "Commands hold until they are stale: an arm whose commander hangs, or is gone, stops by itself, within its\n"
      "limits. Late cycles are counted and left out, never made up for by a burst; where too many are late, the arm "
      "stops.\n\n"
      "No motion without a new command: start(), release(), take() and give_back() forget the earlier ones. After\n"
      "os.fork() no loop runs in the child.",
      py::release_gil_before_calling_cpp_dtor());
  bind_thread(c);
  bind_safety(c);
  bind_owner(c);
  bind_targets(c);
  bind_records(c);
  bind_context(c);
}

}  // namespace sigmaik::bindings
