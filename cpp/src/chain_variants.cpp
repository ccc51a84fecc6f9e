// The same arm with a tool, or with joints that do not move any more.

#include <algorithm>
#include <cmath>

#include <sigmaik/chain.hpp>
#include <sigmaik/pose.hpp>

#include "message.hpp"
#include "mimic.hpp"
#include "rigid_body.hpp"

namespace sigmaik {
namespace {

using detail::require;

// The name, with "_" behind it until no segment has it.
std::string unused(std::string name, const Chain& chain) {
  const auto taken = [&] {
    return name == chain.base() || std::any_of(chain.segments().begin(), chain.segments().end(), [&](const Segment& s) {
             return s.joint_name == name || s.link_name == name;
           });
  };
  while (taken()) name += '_';
  return name;
}

std::string quoted(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "'" : ", '") + name + "'";
  return text;
}

// A segment whose joint stays at this position.
Segment fixed_at(double position, const Segment& segment) {
  Segment s = segment;
  if (s.type == JointType::Prismatic) {
    s.origin.translate(Eigen::Vector3d(position * s.axis));
  } else {
    s.origin.linear() = nearest_rotation(s.origin.linear() * rotation_exp(position * s.axis));
  }
  const Segment still;
  s.type = JointType::Fixed;
  s.axis = still.axis;
  s.lower = still.lower;
  s.upper = still.upper;
  s.velocity = still.velocity;
  s.acceleration = still.acceleration;
  s.deceleration = still.deceleration;
  s.jerk = still.jerk;
  s.effort = still.effort;
  s.mimic.reset();
  s.notes.clear();
  return s;
}

}  // namespace

Chain Chain::with_tool(const Pose& pose, const std::optional<Inertia>& inertia) const {
  require(is_pose(pose.matrix()), "the tool's pose is not a pose");
  if (inertia) {
    const std::string defect = detail::inertia_defect(*inertia);
    require(defect.empty(), "the tool's inertia is no rigid body's: ", defect);
  }
  Segment tool;
  tool.link_name = unused("tool", *this);
  tool.joint_name = unused(tool.link_name + "_joint", *this);
  tool.origin = nearest_pose(pose);
  tool.inertia = inertia;
  std::vector<Segment> segments = model_->segments;
  segments.push_back(std::move(tool));
  Chain out(model_->base, std::move(segments));
  out.urdf_ = urdf_;
  return out;
}

Chain Chain::lock(const std::map<std::string, double>& positions) const {
  for (const auto& [name, position] : positions) {
    const auto at = std::find(joint_names().begin(), joint_names().end(), name);
    require(at != joint_names().end(), "there is no joint '", name, "' that moves by itself; the chain has ",
            quoted(joint_names()));
    const auto i = at - joint_names().begin();
    const double lower = limits().lower[i], upper = limits().upper[i];
    require(std::isfinite(position), "joint '", name, "': the position is not finite");
    require(position >= lower && position <= upper, "joint '", name, "' cannot be locked at ", position,
            ", outside its limits [", lower, ", ", upper, "]");
  }
  require(positions.size() < joint_names().size(), "every joint would be locked; a chain needs a joint that moves");
  std::vector<Segment> segments = model_->segments;
  const std::vector<Coupling> couplings = detail::couplings_of(segments);
  for (std::size_t i = 0; i < segments.size(); ++i) {
    if (model_->segments[i].type == JointType::Fixed) continue;
    const auto lock = positions.find(model_->segments[static_cast<std::size_t>(couplings[i].joint)].joint_name);
    if (lock == positions.end()) continue;
    segments[i] = fixed_at(couplings[i].multiplier * lock->second + couplings[i].offset, segments[i]);
  }
  Chain out(model_->base, std::move(segments));
  out.urdf_ = urdf_;
  return out;
}

JointMatrix Chain::coupling_matrix() const {
  JointMatrix matrix = JointMatrix::Zero(moving(), dof());
  for (int i = 0; i < moving(); ++i) {
    const Coupling& c = couplings()[static_cast<std::size_t>(i)];
    matrix(i, c.joint) = c.multiplier;
  }
  return matrix;
}

JointVector JointLimits::braking() const {
  if (deceleration.size() == 0) return acceleration;
  return (deceleration.array() < std::numeric_limits<double>::infinity()).select(deceleration, acceleration);
}

}  // namespace sigmaik
