#include <sigmaik/chain.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <sstream>

#include "message.hpp"
#include "mimic.hpp"
#include "numbers.hpp"
#include "rigid_body.hpp"

namespace sigmaik {
namespace {

using detail::kInfinity;
using detail::require;
// A larger number is a mistake or has a wrong unit.
constexpr double kLargestOffset = 1e6;  // m
constexpr double kLargestLimit = 1e9;   // rad, rad/s, …; infinity means "no limit"

std::string label(const Segment& segment) { return "joint '" + segment.joint_name + "'"; }

void check_bound(const Segment& s, const char* what, double value) {
  require(!std::isnan(value), label(s), ": ", what, " is not a number");
  require(std::isinf(value) || std::abs(value) <= kLargestLimit, label(s), ": ", what, " = ", value,
          " is absurd (more than ", kLargestLimit, ")");
}

void check_limits(const Segment& s) {
  check_bound(s, "lower", s.lower);
  check_bound(s, "upper", s.upper);
  require(s.lower <= s.upper, label(s), ": lower = ", s.lower, " is above upper = ", s.upper);
  require(s.lower < kInfinity && s.upper > -kInfinity, label(s), ": no position lies between lower = ", s.lower,
          " and upper = ", s.upper);
  const std::pair<const char*, double> positive[] = {{"velocity", s.velocity},
                                                     {"acceleration", s.acceleration},
                                                     {"deceleration", s.deceleration},
                                                     {"jerk", s.jerk},
                                                     {"effort", s.effort}};
  for (const auto& [what, value] : positive) {
    check_bound(s, what, value);
    require(value > 0.0, label(s), ": ", what, " limit must be above 0 (infinite for none), got ", value);
  }
}

void check_inertia(const Segment& s) {
  if (!s.inertia) return;
  const Inertia& inertia = *s.inertia;
  require(std::isfinite(inertia.mass) && inertia.mass >= 0.0, "link '", s.link_name, "': mass = ", inertia.mass,
          " kg must be finite and not negative");
  require(inertia.center_of_mass.allFinite() && inertia.tensor.allFinite(), "link '", s.link_name,
          "': its inertia has an entry that is not finite");
  const double least = detail::least_moment(inertia);
  require(
      least >= 0.0, "link '", s.link_name, "': a principal moment of its inertia is ", least,
      " kg m², and no body has a negative one; correct the tensor, or leave the inertia out: only dynamics need it");
}

void check_origin(const Segment& s) {
  const auto& matrix = s.origin.matrix();
  require(matrix.allFinite(), label(s), ": its origin has an entry that is not finite");
  const Eigen::Matrix3d r = s.origin.linear();
  require((r.transpose() * r - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-9 && r.determinant() > 0.0,
          label(s), ": its origin is not a rotation and a translation");
  require(s.origin.translation().cwiseAbs().maxCoeff() <= kLargestOffset, label(s), ": its origin lies ",
          s.origin.translation().norm(), " m away, which is absurd");
}

// A rotation from z to `axis` (Duff et al. 2017, "Building an orthonormal basis, revisited"). The rotation is exact for
// coordinate axes, the identity for z, and accurate close to −z, where the shortest rotation loses its digits.
Eigen::Matrix3d from_z(const Eigen::Vector3d& axis) {
  const double x = axis.x(), y = axis.y(), z = axis.z();
  const double sign = std::copysign(1.0, z);
  const double a = -1.0 / (sign + z), b = x * y * a;
  Eigen::Matrix3d r;
  r << 1.0 + sign * x * x * a, b, x, sign * b, sign + y * y * a, y, -sign * x, -y, z;
  return r;
}

// Normalises a movable joint's axis and clears a continuous joint's position limits. Throws if a value is not usable.
void prepare_joint(Segment& s) {
  const double length = s.axis.norm();
  require(s.axis.allFinite() && length > 1e-9 && length < kLargestOffset, label(s), ": axis (", s.axis.transpose(),
          ") has no direction");
  // A unit vector stays as it is, to the last digit: the segments of a chain make the same chain again.
  if (std::abs(length - 1.0) > 4.0 * std::numeric_limits<double>::epsilon()) s.axis /= length;
  if (s.type == JointType::Continuous) {
    s.lower = -kInfinity;
    s.upper = kInfinity;
  }
  check_limits(s);
}

// Checks all segments, and prepares the movable joints.
void prepare(const std::string& base, std::vector<Segment>& segments) {
  require(!base.empty(), "the base link needs a name");
  require(!segments.empty(), "a chain needs at least one segment");
  std::set<std::string> joints, links{base};
  std::size_t movable = 0;
  for (Segment& s : segments) {
    require(!s.joint_name.empty(), "the joint before link '", s.link_name, "' needs a name");
    require(!s.link_name.empty(), label(s), ": the link that it carries needs a name");
    require(joints.insert(s.joint_name).second, label(s), ": the name is used twice");
    require(links.insert(s.link_name).second, label(s), ": link '", s.link_name, "' is used twice");
    check_origin(s);
    check_inertia(s);
    if (s.type == JointType::Fixed) continue;
    prepare_joint(s);
    ++movable;
  }
  require(movable > 0, "no movable joint between '", base, "' and '", segments.back().link_name, "'");
  require(movable <= kMaxJoints, movable, " movable joints between '", base, "' and '", segments.back().link_name,
          "'; at most ", kMaxJoints, " are supported");
}

// See Chain::characteristic_length(). From the tip to the base: mean and second moment of the vector from a joint's
// origin to the tip, in this joint's frame, averaged over a full turn of the joints after it.
double lever_arm(const std::array<JointConstants, kMaxJoints>& joints, int moving,
                 const std::array<Coupling, kMaxJoints>& couplings, const Pose& tool, const JointLimits& limits) {
  Eigen::Vector3d mean = tool.translation();
  Eigen::Matrix3d moment = mean * mean.transpose();
  double sum = 0.0;
  int turning = 0;
  for (int i = moving - 1; i >= 0; --i) {
    const JointConstants& joint = joints[static_cast<std::size_t>(i)];
    if (joint.prismatic) {
      const Coupling& c = couplings[static_cast<std::size_t>(i)];
      const double low = limits.lower[c.joint], high = limits.upper[c.joint];
      const bool bounded = std::isfinite(low) && std::isfinite(high);
      const double middle = bounded ? c.multiplier * (0.5 * (low + high)) + c.offset : 0.0;
      const double range = bounded ? c.multiplier * (high - low) : 0.0;
      const Eigen::Vector3d slide = middle * Eigen::Vector3d::UnitZ();
      moment += mean * slide.transpose() + slide * mean.transpose() + slide * slide.transpose();
      moment(2, 2) += range * range / 12.0;
      mean += slide;
    } else {
      const double lever = moment(0, 0) + moment(1, 1);
      sum += lever;
      ++turning;
      mean = Eigen::Vector3d(0.0, 0.0, mean.z());
      moment = Eigen::Vector3d(0.5 * lever, 0.5 * lever, moment(2, 2)).asDiagonal();
    }
    const Eigen::Vector3d turned = joint.rotation * mean;
    moment = (joint.rotation * moment * joint.rotation.transpose() + turned * joint.translation.transpose() +
              joint.translation * turned.transpose() + joint.translation * joint.translation.transpose())
                 .eval();
    mean = turned + joint.translation;
  }
  const double length = turning > 0 ? std::sqrt(sum / turning) : 0.0;
  return length > 1e-9 ? length : 1.0;
}

}  // namespace

const char* to_string(JointType type) noexcept {
  switch (type) {
    case JointType::Fixed: return "fixed";
    case JointType::Revolute: return "revolute";
    case JointType::Continuous: return "continuous";
    case JointType::Prismatic: return "prismatic";
  }
  return "unknown";
}

Chain::Chain(std::string base, std::vector<Segment> segments) {
  prepare(base, segments);
  auto model = std::make_shared<Model>();
  for (const Segment& s : segments) {
    model->warnings.insert(model->warnings.end(), s.notes.begin(), s.notes.end());
    if (const std::string defect = s.inertia ? detail::inertia_defect(*s.inertia) : ""; !defect.empty()) {
      model->warnings.push_back("link '" + s.link_name + "': its inertia is no rigid body's: " + defect);
    }
  }
  const std::vector<Coupling> couplings = detail::couplings_of(segments);
  detail::fold_limits(couplings, segments);
  // The number in q of each segment's joint, where the joint moves by itself.
  std::vector<int> number(segments.size(), -1);
  for (std::size_t k = 0; k < segments.size(); ++k) {
    if (segments[k].type == JointType::Fixed) continue;
    ++model->moving;
    if (!segments[k].mimic) number[k] = model->dof++;
  }
  JointLimits& limits = model->limits;
  for (JointVector* v : {&limits.lower, &limits.upper, &limits.velocity, &limits.acceleration, &limits.deceleration,
                         &limits.jerk, &limits.effort}) {
    v->resize(model->dof);
  }

  // All origins between two movable joints become one constant transform, in frames whose z lies along the axis.
  Pose placement = Pose::Identity();
  std::size_t moved = 0;
  for (std::size_t k = 0; k < segments.size(); ++k) {
    const Segment& s = segments[k];
    placement = placement * s.origin;
    if (s.type == JointType::Fixed) continue;
    const Eigen::Matrix3d turn = from_z(s.axis);
    placement.linear() = placement.linear() * turn;
    model->couplings[moved] = {number[static_cast<std::size_t>(couplings[k].joint)], couplings[k].multiplier,
                               couplings[k].offset};
    JointConstants& c = model->constants[moved++];
    c.rotation = placement.linear();
    c.translation = placement.translation();
    c.prismatic = s.type == JointType::Prismatic;
    placement = Pose::Identity();
    placement.linear() = turn.transpose();
    const int i = number[k];
    if (i < 0) continue;
    limits.lower[i] = s.lower;
    limits.upper[i] = s.upper;
    limits.velocity[i] = s.velocity;
    limits.acceleration[i] = s.acceleration;
    limits.deceleration[i] = s.deceleration;
    limits.jerk[i] = s.jerk;
    limits.effort[i] = s.effort;
    model->joint_names.push_back(s.joint_name);
    model->joint_types.push_back(s.type);
  }
  model->tool = placement;
  model->characteristic_length = lever_arm(model->constants, model->moving, model->couplings, placement, limits);
  model->base = std::move(base);
  model->segments = std::move(segments);
  model_ = std::move(model);
}

Chain Chain::with_limits(const JointLimits& limits) const {
  const std::pair<const char*, const JointVector*> all[] = {
      {"lower", &limits.lower},       {"upper", &limits.upper},
      {"velocity", &limits.velocity}, {"acceleration", &limits.acceleration},
      {"jerk", &limits.jerk},         {"effort", &limits.effort}};
  for (const auto& [what, values] : all) {
    require(values->size() == dof(), what, " has ", values->size(), " entries, the chain ", dof(), " joints");
  }
  const auto given = limits.deceleration.size();
  require(given == 0 || given == dof(), "deceleration has ", given, " entries, the chain ", dof(), " joints");
  std::vector<Segment> segments = model_->segments;
  int i = 0;
  for (Segment& s : segments) {
    if (s.type == JointType::Fixed || s.mimic) continue;
    // With a bound a joint's positions are not the same modulo 2π any more.
    const bool bounded = limits.lower[i] != -kInfinity || limits.upper[i] != kInfinity;
    if (s.type == JointType::Continuous && bounded) s.type = JointType::Revolute;
    s.lower = limits.lower[i];
    s.upper = limits.upper[i];
    s.velocity = limits.velocity[i];
    s.acceleration = limits.acceleration[i];
    s.deceleration = given != 0 ? limits.deceleration[i] : kInfinity;
    s.jerk = limits.jerk[i];
    s.effort = limits.effort[i];
    s.notes.clear();  // the notes are about the limits that the new ones replace
    ++i;
  }
  Chain out(model_->base, std::move(segments));
  out.urdf_ = urdf_;
  return out;
}

std::vector<std::string> Chain::missing_limits(bool velocity, bool acceleration) const {
  std::vector<std::string> sentences;
  const auto look = [&](const char* kind, const JointVector& values, const char* consequence) {
    std::string joints;
    int missing = 0;
    for (int i = 0; i < dof(); ++i) {
      if (std::isfinite(values[i])) continue;
      joints += (missing++ > 0 ? ", '" : "'") + joint_names()[static_cast<std::size_t>(i)] + "'";
    }
    if (missing == 0) return;
    if (missing == dof()) joints = "the joints";
    sentences.push_back(joints + (missing == 1 && dof() > 1 ? " has" : " have") + " no " + kind +
                        " limit: " + consequence + "; Chain.with_limits(" + kind + "=…) gives limits");
  };
  if (velocity) look("velocity", limits().velocity, "nothing bounds how fast a command moves them");
  if (acceleration) look("acceleration", limits().acceleration, "10 rad/s² or m/s² are assumed (assumed_acceleration)");
  return sentences;
}

std::vector<std::string> Chain::far_outside_limits(const JointRef& q) const {
  require(q.size() == dof(), "q has ", q.size(), " entries, the chain ", dof(), " joints");
  std::vector<std::string> sentences;
  for (int i = 0; i < dof(); ++i) {
    const double beyond = std::max(limits().lower[i] - q[i], q[i] - limits().upper[i]);
    if (!(beyond > 1.0)) continue;
    const bool angle = joint_types()[static_cast<std::size_t>(i)] != JointType::Prismatic;
    std::ostringstream text;
    text.imbue(std::locale::classic());
    text << "joint '" << joint_names()[static_cast<std::size_t>(i)] << "' starts at " << q[i]
         << (angle ? " rad, " : " m, ") << beyond << " outside its limits [" << limits().lower[i] << ", "
         << limits().upper[i] << "]" << (angle ? "; are these degrees?" : "; are these millimetres?");
    sentences.push_back(text.str());
  }
  return sentences;
}

}  // namespace sigmaik
