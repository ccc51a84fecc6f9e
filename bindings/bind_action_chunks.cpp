#include <pybind11/native_enum.h>

#include "fields.hpp"

namespace sigmaik::bindings {

template <>
struct Fields<ActionChunksOptions> {
  using O = ActionChunksOptions;
  static constexpr std::tuple all{
      field("dt_action", &O::dt_action, "[s] > 0, from one action of a chunk to the next."),
      field("first", &O::first,
            "[s] from the stamp of a chunk to the time of its first action: 0 where the first action is for the time "
            "of the observation, dt_action where it is for the step after it."),
      field("smoothing", &O::smoothing,
            "[s] ≥ 0: the difference that a new chunk makes decays to a tenth in 3.9 smoothing; the jerk is at most "
            "4.2 max_speed/smoothing²."),
      field("max_speed", &O::max_speed, "[m/s] > 0: the target is never faster."),
      field("max_angular_speed", &O::max_angular_speed, "[rad/s] > 0, likewise."),
      field("stop_time", &O::stop_time,
            "[s] ≥ 0: so long takes the stop at the last action of a chunk that no other has replaced; it begins half "
            "as long before that action."),
      field("max_actions", &O::max_actions, "1 to 10000: longer chunks are refused."),
  };
};

namespace {

double stamp_argument(double time, const char* what) {
  if (!std::isfinite(time)) throw Error(std::string(what) + " is not finite");
  return time;
}

void bind_statuses(py::module_& m) {
  py::native_enum<ActionStatus>(m, "ActionStatus", "enum.IntEnum",
                                "What the target of ActionChunks does, ordered from the best to the worst.")
      .value("TRACKING", ActionStatus::Tracking, "on the newest chunk")
      .value("BLENDING", ActionStatus::Blending,
             "on the way to it: from an older chunk, from rest, or because its actions are too fast")
      .value("LATE", ActionStatus::Late, "the newest chunk is nearly used up: coming to rest at its last action")
      .value("STARVED", ActionStatus::Starved, "the newest chunk is used up: holding its last action")
      .value("WAITING", ActionStatus::Waiting, "no chunk yet: where reset() said, or nowhere")
      .finalize();
  py::native_enum<ChunkStatus>(m, "ChunkStatus", "enum.IntEnum", "What became of a chunk of actions.")
      .value("ACCEPTED", ChunkStatus::Accepted)
      .value("EXPIRED", ChunkStatus::Expired, "refused: the time of its last action is over")
      .value("OUT_OF_ORDER", ChunkStatus::OutOfOrder,
             "refused: its stamp is not later than that of a chunk that was accepted")
      .value("INVALID", ChunkStatus::Invalid,
             "refused: empty, too long, more than 10⁹ m away, or twists without a start; what is not a pose raises")
      .finalize();
}

void bind_answers(py::module_& m) {
  py::class_<ChunkCounts>(m, "ChunkCounts", "How many chunks and actions had which fate.")
      .def_readonly("accepted", &ChunkCounts::accepted)
      .def_readonly("expired", &ChunkCounts::expired)
      .def_readonly("out_of_order", &ChunkCounts::out_of_order)
      .def_readonly("invalid", &ChunkCounts::invalid)
      .def_readonly("missed", &ChunkCounts::missed,
                    "Actions of accepted chunks whose time was over when the chunk came.")
      .def_readonly("fast", &ChunkCounts::fast,
                    "Actions that need more than max_speed or max_angular_speed: they are followed late.")
      .def_readonly("rough", &ChunkCounts::rough, "Actions whose rotation was off by more than rounding.")
      .def("__repr__", [](const ChunkCounts& c) {
        return record("ChunkCounts", {{"accepted", py::cast(c.accepted)},
                                      {"expired", py::cast(c.expired)},
                                      {"out_of_order", py::cast(c.out_of_order)},
                                      {"invalid", py::cast(c.invalid)},
                                      {"missed", py::cast(c.missed)},
                                      {"fast", py::cast(c.fast)}});
      });

  py::class_<ActionTarget>(
      m, "ActionTarget",
      "Where to be now, and how to move: servo.update(target.pose, target.twist); or pose, twist, status = target.")
      .def_property_readonly(
          "pose", [](const ActionTarget& t) { return to_numpy(t.pose.matrix()); }, "(4, 4) in base.")
      .def_property_readonly(
          "twist", [](const ActionTarget& t) { return to_numpy(t.twist); },
          "(6,) derivative of the pose: [v; ω], base axes, at its origin.")
      .def_readonly("status", &ActionTarget::status, "See ActionStatus.")
      .def_property_readonly(
          "behind", [](const ActionTarget& t) { return to_numpy(t.behind); },
          "(6,) [m, rad] what is not done: from the target to where the newest chunk is at this time, base axes.")
      .def_readonly("age", &ActionTarget::age, "[s] since the stamp of the chunk; 0 before the first.")
      .def_readonly("left", &ActionTarget::left, "[s] until the last action of the chunk; negative after it.")
      .def("__iter__",
           [](const ActionTarget& t) -> py::typing::Iterator<py::object> {
             return py::iter(py::make_tuple(to_numpy(t.pose.matrix()), to_numpy(t.twist), py::cast(t.status)));
           })
      .def("__repr__", [](const ActionTarget& t) {
        return std::string("ActionTarget(status=") + to_string(t.status) +
               ", age=" + py::str(py::float_(t.age)).cast<std::string>() +
               ", left=" + py::str(py::float_(t.left)).cast<std::string>() + ")";
      });
}

ChunkStatus push(ActionChunks& self, double stamp, const ArrayLike& poses) {
  const Array actions = array_argument(poses, "poses", {-1, 4, 4}, "(k, 4, 4)");
  std::vector<Pose> chunk(static_cast<std::size_t>(actions.shape(0)));
  for (std::size_t i = 0; i < chunk.size(); ++i) {
    chunk[i].matrix() = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(actions.data() + 16 * i);
    if (!is_pose(chunk[i].matrix())) throw Error("poses[" + std::to_string(i) + "] is not a pose");
  }
  return self.push(stamp_argument(stamp, "stamp"), chunk);
}

ChunkStatus push_twists(ActionChunks& self, double stamp, const ArrayLike& twists) {
  const Array actions = array_argument(twists, "twists", {-1, 6}, "(k, 6)");
  std::vector<Twist> chunk(static_cast<std::size_t>(actions.shape(0)));
  for (std::size_t i = 0; i < chunk.size(); ++i) {
    chunk[i] = Eigen::Map<const Eigen::Matrix<double, 6, 1>>(actions.data() + 6 * i);
  }
  return self.push_twists(stamp_argument(stamp, "stamp"), chunk);
}

}  // namespace

void bind_action_chunks(py::module_& m) {
  bind_statuses(m);
  bind_answers(m);
  py::class_<ActionChunks> c(
      m, "ActionChunks",
      "The way from a policy to a servo: chunks of actions in, one smooth target a cycle out.\n\n"
      "    chunks = sk.ActionChunks(0.1)                # actions at 10 Hz\n"
      "    chunks.reset(servo.pose)\n"
      "    chunks.push(stamp, poses)                    # (k, 4, 4); stamp = when the observation was made\n"
      "    pose, twist, status = chunks.at(now)         # each cycle, on the same clock\n"
      "    servo.update(pose, twist)\n\n"
      "Chunks may come late, overlap, or not at all. Action i is for the time stamp + first + i dt_action: what is "
      "over\n"
      "is not done again. Pose, twist and acceleration of the target are continuous, speed, acceleration and jerk are\n"
      "bounded, and where no chunk comes the target comes to rest at the last action.");
  def_init<ActionChunksOptions>(c, std::tuple{}, 1, "",
                                [](const ActionChunksOptions& options) { return ActionChunks(options); });
  def_options(c);
  c.def(
       "reset",
       [](ActionChunks& s, const py::object& start) {
         if (start.is_none()) {
           s.reset();
         } else {
           s.reset(pose_argument(start, "start"));
         }
       },
       py::arg("start") = py::none(),
       "Forgets everything. The next target is at `start` (4, 4), such as the tip's pose, and goes to the chunks from\n"
       "there; with None it is where the first chunk is.")
      .def("push", &push, py::arg("stamp"), py::arg("poses"),
           "A chunk of poses (k, 4, 4) of the tip in base. stamp: [s] when its observation was made.\n\n"
           "Raises Error where a pose is none; what else is refused the answer says.")
      .def("push_twists", &push_twists, py::arg("stamp"), py::arg("twists"),
           "A chunk of twists (k, 6) [v; ω], base axes, at the tip's origin; it starts where the target is.\n\n"
           "Twist i is the mean from stamp + first + i dt_action to the next. It needs a start: reset(start), or a "
           "chunk of\n"
           "poses before it.")
      .def(
          "at", [](ActionChunks& s, double time) { return s.at(stamp_argument(time, "time")); }, py::arg("time"),
          "The target at a time [s] not before that of the last call; else the last one again.")
      .def_property_readonly("counts", &ActionChunks::counts, py::return_value_policy::copy,
                             "How many chunks and actions had which fate.")
      .def("__repr__", [](const ActionChunks& s) {
        return record("ActionChunks", {{"dt_action", py::cast(s.options().dt_action)}, {"", py::cast(s.counts())}});
      });
}

}  // namespace sigmaik::bindings
