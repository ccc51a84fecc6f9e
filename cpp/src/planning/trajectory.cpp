#include <sigmaik/planning/trajectory.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <sstream>
#include <utility>

#include "../message.hpp"

namespace sigmaik::planning {
namespace {

using sigmaik::detail::require;

constexpr const char* kTitle = "# sigmaik trajectory 1";

void require_samples(const Trajectory& plan) {
  require(!plan.t.empty(), "this trajectory is empty: its plan ", to_string(plan.status));
  const std::size_t numbers = plan.t.size() * static_cast<std::size_t>(std::max(plan.dof, 0));
  require(numbers > 0 && plan.q.size() == numbers && plan.qdot.size() == numbers && plan.qddot.size() == numbers,
          "a trajectory of ", plan.t.size(), " samples of ", plan.dof, " joints has ", plan.q.size(), " positions, ",
          plan.qdot.size(), " velocities and ", plan.qddot.size(), " accelerations");
}

std::string text(double value) {
  char buffer[64];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, value).ptr;
  return {buffer, end};
}

// Reads `word`, which must be a number as a whole.
template <typename Number>
bool read(std::string_view word, Number& out) {
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), out);
  return error == std::errc() && end == word.data() + word.size();
}

// Appends a line of comma-separated numbers to `out`. Returns false if one of them is not a number.
bool read_row(std::string_view line, std::vector<double>& out) {
  while (true) {
    const std::size_t comma = line.find(',');
    if (!read(line.substr(0, comma), out.emplace_back())) return false;
    if (comma == std::string_view::npos) return true;
    line.remove_prefix(comma + 1);
  }
}

// Reads a line "# name value" of the head. Returns false if the value is not valid.
bool read_fact(const std::string& name, const std::string& value, Trajectory& plan) {
  int cubic = 0;
  if (name == "status") return plan.status = plan_status(value), true;
  if (name == "dof") return read(value, plan.dof) && plan.dof >= 1;
  if (name == "duration") return read(value, plan.duration);
  if (name == "cost") return read(value, plan.cost);
  if (name == "solve_time") return read(value, plan.solve_time);
  if (name == "iterations") return read(value, plan.iterations);
  if (name == "starts") return read(value, plan.starts);
  if (name == "cubic") return read(value, cubic) && (plan.cubic = cubic != 0, true);
  return true;  // a later version wrote this line
}

}  // namespace

const char* to_string(PlanStatus status) noexcept {
  switch (status) {
    case PlanStatus::Optimal: return "optimal";
    case PlanStatus::Feasible: return "feasible";
    default: return "failed";
  }
}

PlanStatus plan_status(const std::string& word) {
  for (const PlanStatus status : {PlanStatus::Optimal, PlanStatus::Feasible, PlanStatus::Failed}) {
    if (word == to_string(status)) return status;
  }
  throw Error("status = '" + word + "' must be 'optimal', 'feasible' or 'failed'");
}

JointSamples Trajectory::sample(const std::vector<double>& times) const {
  require_samples(*this);
  const auto n = static_cast<std::size_t>(dof), count = t.size();
  JointSamples out;
  for (std::vector<double>* rows : {&out.q, &out.qdot, &out.qddot}) rows->resize(times.size() * n);
  for (std::size_t i = 0; i < times.size(); ++i) {
    require(std::isfinite(times[i]), "t must be finite; entry ", i, " is ", times[i]);
    const auto after = std::upper_bound(t.begin(), t.end(), times[i]) - t.begin();
    const auto k = static_cast<std::size_t>(
        std::clamp<std::ptrdiff_t>(after - 1, 0, static_cast<std::ptrdiff_t>(count) - 1));
    const std::size_t next = std::min(k + 1, count - 1);
    const double s = std::clamp(times[i], t.front(), t.back()) - t[k], step = std::max(t[next] - t[k], 1e-300);
    for (std::size_t j = 0; j < n; ++j) {
      const double q0 = q[k * n + j], v0 = qdot[k * n + j], a0 = qddot[k * n + j];
      double& at = out.q[i * n + j];
      double& speed = out.qdot[i * n + j];
      double& acceleration = out.qddot[i * n + j];
      if (!cubic) {
        at = q0 + s * (v0 + 0.5 * s * a0);
        speed = v0 + s * a0;
        acceleration = a0;
        continue;
      }
      const double jerk = (qddot[next * n + j] - a0) / step;
      at = q0 + s * (v0 + s * (0.5 * a0 + s * jerk / 6.0));
      speed = v0 + s * (a0 + 0.5 * s * jerk);
      acceleration = a0 + s * jerk;
    }
  }
  return out;
}

Trajectory Trajectory::retimed(double longer) const {
  require_samples(*this);
  require(std::isfinite(longer) && longer > 0.0, "duration = ", longer, " must be finite and greater than 0");
  Trajectory out = *this;
  const double f = longer / duration;
  const auto scale = [f](std::vector<double>& times) {
    for (double& time : times) time *= f;
  };
  scale(out.t);
  for (double& v : out.qdot) v /= f;
  for (double& a : out.qddot) a /= f * f;
  out.duration = longer;
  if (out.clearance) {
    scale(out.clearance->t);
    for (Crossing& crossing : out.clearance->crossings) crossing.t *= f;
  }
  return out;
}

void Trajectory::save(const std::string& file) const {
  std::ostringstream out;
  out.imbue(std::locale::classic());
  out << kTitle << "\n# status " << to_string(status) << "\n# dof " << dof << "\n# duration " << text(duration)
      << "\n# cost " << text(cost) << "\n# solve_time " << text(solve_time) << "\n# iterations " << iterations
      << "\n# starts " << starts << "\n# cubic " << cubic << "\nt";
  for (const char* name : {"q", "qdot", "qddot"}) {
    for (int j = 1; j <= dof; ++j) out << ',' << name << j;
  }
  out << '\n';
  if (!t.empty()) require_samples(*this);
  const auto n = static_cast<std::size_t>(dof);
  for (std::size_t k = 0; k < t.size(); ++k) {
    out << text(t[k]);
    for (const std::vector<double>* rows : {&q, &qdot, &qddot}) {
      for (std::size_t j = 0; j < n; ++j) out << ',' << text((*rows)[k * n + j]);
    }
    out << '\n';
  }
  // The file is written beside its place and then moved there, so that no reader sees half of the file.
  const std::string beside = file + ".part";
  {
    std::ofstream stream(beside, std::ios::binary | std::ios::trunc);
    stream << out.str();
    stream.close();
    if (stream && std::rename(beside.c_str(), file.c_str()) == 0) return;
  }
  std::remove(beside.c_str());
  throw Error("'" + file + "' cannot be written");
}

Trajectory Trajectory::load(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw Error("'" + file + "' cannot be read");
  Trajectory plan;
  plan.dof = 0;
  std::string line;
  const auto refuse = [&] {
    throw Error("'" + file + "' is not the file of a trajectory: \"" + line.substr(0, 60) + "\"");
  };
  if (!std::getline(stream, line) || line != kTitle) refuse();
  while (std::getline(stream, line) && line.starts_with("# ")) {
    const std::size_t space = line.find(' ', 2);
    if (space == std::string::npos || !read_fact(line.substr(2, space - 2), line.substr(space + 1), plan)) refuse();
  }
  if (plan.dof < 1 || !line.starts_with("t,")) refuse();
  const auto n = static_cast<std::ptrdiff_t>(plan.dof);
  std::vector<double> row;
  while (std::getline(stream, line)) {
    row.clear();
    if (!read_row(line, row) || row.size() != static_cast<std::size_t>(1 + 3 * n)) refuse();
    plan.t.push_back(row.front());
    auto from = row.begin() + 1;
    for (std::vector<double>* rows : {&plan.q, &plan.qdot, &plan.qddot}) {
      rows->insert(rows->end(), from, from + n);
      from += n;
    }
  }
  return plan;
}

JointVector nearest_turn(const Chain& chain, const JointRef& start, const JointRef& goal) {
  require(start.size() == chain.dof() && goal.size() == chain.dof(), "start has ", start.size(), " entries, goal ",
          goal.size(), ", the chain ", chain.dof(), " joints");
  JointVector out = goal;
  for (int i = 0; i < chain.dof(); ++i) {
    if (chain.joint_types()[static_cast<std::size_t>(i)] != JointType::Continuous) continue;
    const double turns = std::round((goal[i] - start[i]) / (2.0 * std::numbers::pi));
    if (turns != 0.0) out[i] -= 2.0 * std::numbers::pi * turns;
  }
  return out;
}

}  // namespace sigmaik::planning
