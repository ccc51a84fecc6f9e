#include <pybind11/native_enum.h>

#include "values.hpp"

namespace sigmaik::bindings {

template <>
struct Words<StreamMode> {
  static constexpr std::array all{Word<StreamMode>{"hold", StreamMode::Hold},
                                  Word<StreamMode>{"interpolate", StreamMode::Interpolate},
                                  Word<StreamMode>{"predict", StreamMode::Predict}};
};

template <>
struct Fields<TargetStreamOptions> {
  using O = TargetStreamOptions;
  static constexpr std::tuple all{
      field("mode", &O::mode,
            "where the target is between samples, and after the last one. 'hold': at the last sample, for devices that "
            "send only changes; 'interpolate': on a smooth curve through the samples, `latency` ago; 'predict': where "
            "a constant-velocity Kalman filter expects it now."),
      field("max_speed", &O::max_speed, "[m/s] > 0: nothing is faster; a sample that would have to be is an outlier."),
      field("max_angular_speed", &O::max_angular_speed, "[rad/s] > 0, likewise."),
      field("smoothing", &O::smoothing,
            "[s] ≥ 0, time constant of the way from where the target is to where a new sample says it is; at 0 the "
            "twist jumps."),
      field("latency", &O::latency,
            "[s] ≥ 0: 'interpolate' plays so late: the sensor's delay, and one or two samples."),
      field("horizon", &O::horizon, "[s] ≥ 0: so long after its last sample the target moves on as it did, …"),
      field("timeout", &O::timeout, "[s] ≥ horizon, > 0: … and by then it has come to rest, and the stream is stale."),
      field("noise_linear", &O::noise_linear, "[m] > 0, standard deviation of a sample, each axis."),
      field("noise_angular", &O::noise_angular, "[rad] > 0, likewise."),
      field("acceleration_linear", &O::acceleration_linear,
            "[m/s²] > 0, standard deviation of what the target may do between samples."),
      field("acceleration_angular", &O::acceleration_angular, "[rad/s²] > 0, likewise."),
      field("relocate", &O::relocate, "≥ 1: so many refused samples in a row that agree with each other are believed."),
  };
};

namespace {

double time_argument(double time) {
  if (!std::isfinite(time)) throw Error("time is not finite");
  return time;
}

void bind_statuses(py::module_& m) {
  py::native_enum<StreamStatus>(m, "StreamStatus", "enum.IntEnum",
                                "What a target is, ordered from the best to the worst.")
      .value("TRACKING", StreamStatus::Tracking, "as the samples say, or within the horizon of the last one")
      .value("COASTING", StreamStatus::Coasting, "longer without a sample than the horizon: coming to rest")
      .value("STALE", StreamStatus::Stale, "longer than the timeout, or a clock has stepped: holding still")
      .value("WAITING", StreamStatus::Waiting, "no sample yet: where reset() said, or nowhere")
      .finalize();
  py::native_enum<SampleStatus>(m, "SampleStatus", "enum.IntEnum", "What became of a sample.")
      .value("ACCEPTED", SampleStatus::Accepted)
      .value("RELOCATED", SampleStatus::Relocated,
             "accepted after a run of refused ones: the target is elsewhere, or a clock was set")
      .value("OUTLIER", SampleStatus::Outlier, "refused: too far from the last one for max_speed or max_angular_speed")
      .value("OUT_OF_ORDER", SampleStatus::OutOfOrder, "refused: its stamp is not later than the last one's")
      .value("INVALID", SampleStatus::Invalid, "refused: more than 10⁹ m away; what is not a pose raises")
      .value("AHEAD", SampleStatus::Ahead, "refused: its stamp is later than the time of at() by more than the timeout")
      .finalize();
}

void bind_answers(py::module_& m) {
  py::class_<SampleCounts>(m, "SampleCounts", "How many samples had which fate.")
      .def_readonly("accepted", &SampleCounts::accepted, "Relocated ones included.")
      .def_readonly("relocated", &SampleCounts::relocated)
      .def_readonly("outliers", &SampleCounts::outliers)
      .def_readonly("out_of_order", &SampleCounts::out_of_order)
      .def_readonly("invalid", &SampleCounts::invalid)
      .def_readonly("ahead", &SampleCounts::ahead, "Samples whose stamp was ahead of the clock of at().")
      .def_readonly("clock_steps", &SampleCounts::clock_steps,
                    "Steps of the clock of at(), and of the stamps against this clock.")
      .def_readonly("rough", &SampleCounts::rough, "Samples whose rotation was off by more than rounding.")
      .def("__repr__", [](const SampleCounts& c) {
        return "SampleCounts(accepted=" + std::to_string(c.accepted) + ", relocated=" + std::to_string(c.relocated) +
               ", outliers=" + std::to_string(c.outliers) + ", out_of_order=" + std::to_string(c.out_of_order) +
               ", invalid=" + std::to_string(c.invalid) + ")";
      });
  def_value(bound<SampleCounts>(m, "SampleCounts"));

  py::class_<Target>(m, "Target", "Where to be now, and how to move: servo.update(target.pose, target.twist).")
      .def_property_readonly(
          "pose", [](const Target& t) { return to_numpy(t.pose.matrix()); }, "(4, 4) in base.")
      .def_property_readonly(
          "twist", [](const Target& t) { return to_numpy(t.twist); },
          "(6,) derivative of the pose: [v; ω], base axes, at its origin.")
      .def_readonly("status", &Target::status, "See StreamStatus.")
      .def_readonly("age", &Target::age, "[s] since the newest sample was taken; 0 before the first.")
      .def("__repr__", [](const Target& t) {
        return std::string("Target(status=") + to_string(t.status) +
               ", age=" + py::str(py::float_(t.age)).cast<std::string>() + ")";
      });
  def_value(bound<Target>(m, "Target"));
}

void bind_value(py::class_<TargetStream>& c) {
  def_state(
      c, 1, [](const TargetStream& s) { return py::make_tuple(to_dict(s.options())); },
      [](const py::tuple& s) { return TargetStream(from_dict<TargetStreamOptions>(s[0].cast<py::dict>())); },
      [](const TargetStream& a, const TargetStream& b) { return equal(a.options(), b.options()); });
}

void bind_stream(py::module_& m) {
  py::class_<TargetStream> c(
      m, "TargetStream",
      "The way from a sensor to a servo: stamped samples of a pose in, one smooth target a cycle out.\n\n"
      "    stream.push(stamp, pose)                     # whenever there is one: stamp = when it was taken\n"
      "    target = stream.at(now)                      # each cycle, on the same clock\n"
      "    servo.update(target.pose, target.twist)\n\n"
      "Samples may come late, doubled, wrong or not at all. Targets are continuous, with their twist, and never "
      "faster\n"
      "than max_speed and max_angular_speed: not when a sample arrives, not when the stream stops or starts again, "
      "not\n"
      "when the target is found elsewhere.");
  def_init<TargetStreamOptions>(c, std::tuple{}, 1, "",
                                [](const TargetStreamOptions& options) { return TargetStream(options); });
  def_options(c);
  c.def(
       "reset",
       [](TargetStream& s, const py::object& start) {
         if (start.is_none()) {
           s.reset();
         } else {
           s.reset(pose_argument(start, "start"));
         }
       },
       py::arg("start") = py::none(),
       "Forgets everything. The next target is at `start` (4, 4), such as the tip's pose, and goes to the samples "
       "from\n"
       "there; with None it is where the first sample is.")
      .def(
          "push",
          [](TargetStream& s, double time, const py::object& pose) {
            return s.push(time_argument(time), pose_argument(pose, "pose"));
          },
          py::arg("time"), py::arg("pose"),
          "A sample: when it was taken [s], and the pose (4, 4) then. Raises Error where it is not a pose.")
      .def(
          "at", [](TargetStream& s, double time) { return s.at(time_argument(time)); }, py::arg("time"),
          "The target at a time [s]. Where the clock steps, back or forth, the target holds still: STALE, twist zero;\n"
          "samples of the new clock lead on from there.")
      .def_property_readonly("counts", &TargetStream::counts, py::return_value_policy::copy,
                             "How many samples had which fate.")
      .def("__repr__", [](const TargetStream& s) {
        return record("TargetStream",
                      {{"mode", Argument<StreamMode>::to(s.options().mode)}, {"", py::cast(s.counts())}});
      });
  bind_value(c);
}

}  // namespace

void bind_target_stream(py::module_& m) {
  bind_statuses(m);
  bind_answers(m);
  bind_stream(m);
}

}  // namespace sigmaik::bindings
