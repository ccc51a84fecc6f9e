#include <sigmaik/kdl.hpp>

#include <cmath>
#include <set>

#include "message.hpp"

namespace sigmaik {
namespace {

using detail::require;

Eigen::Vector3d to_eigen(const KDL::Vector& v) { return {v.x(), v.y(), v.z()}; }

KDL::Vector to_kdl_vector(const Eigen::Vector3d& v) { return KDL::Vector(v.x(), v.y(), v.z()); }

Pose to_eigen(const KDL::Frame& frame) {
  Pose pose = Pose::Identity();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) pose(i, j) = frame.M(i, j);
  }
  pose.translation() = to_eigen(frame.p);
  return pose;
}

KDL::Frame to_kdl_frame(const Pose& pose) {
  KDL::Frame frame;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) frame.M(i, j) = pose(i, j);
  }
  frame.p = to_kdl_vector(pose.translation());
  return frame;
}

// KDL's tensor is about the origin of the frame, the tensor of an Inertia about the centre of mass. The difference is
// m (c·c I − c cᵀ) (Steiner's theorem).
std::optional<Inertia> to_inertia(const KDL::RigidBodyInertia& from) {
  Inertia inertia;
  inertia.mass = from.getMass();
  inertia.center_of_mass = to_eigen(from.getCOG());
  const KDL::RotationalInertia tensor = from.getRotationalInertia();
  inertia.tensor = Eigen::Map<const Eigen::Matrix3d>(
      tensor.data);  // symmetric: row-major and column-major are the same
  const Eigen::Vector3d& c = inertia.center_of_mass;
  inertia.tensor -= inertia.mass * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
  if (inertia.mass == 0.0 && inertia.tensor.isZero(0.0)) return std::nullopt;
  return inertia;
}

// Makes a unique name for every link and joint that has no name in KDL.
class Names {
 public:
  explicit Names(std::string base) : used_{std::move(base)} {}
  void take(const std::string& name) { used_.insert(name); }
  static bool given(const std::string& name) { return !name.empty() && name != "NoName"; }  // KDL's default name
  std::string make(std::string name) {
    while (!used_.insert(name).second) name += '_';
    return name;
  }

 private:
  std::set<std::string> used_;
};

JointType type_of(const KDL::Joint& joint) {
  switch (joint.getType()) {
    case KDL::Joint::RotAxis:
    case KDL::Joint::RotX:
    case KDL::Joint::RotY:
    case KDL::Joint::RotZ: return JointType::Revolute;
    case KDL::Joint::TransAxis:
    case KDL::Joint::TransX:
    case KDL::Joint::TransY:
    case KDL::Joint::TransZ: return JointType::Prismatic;
    default: return JointType::Fixed;
  }
}

// +1 or −1: the scale of the joint. KDL has no getter for the scale, which is how far the joint moves for q = 1.
double direction_of(const KDL::Joint& joint, const Eigen::Vector3d& axis, const std::string& name) {
  require(axis.allFinite(), "joint '", name, "': its axis has no direction");
  const KDL::Twist twist = joint.twist(1.0);
  const double scale = axis.dot(to_eigen(type_of(joint) == JointType::Revolute ? twist.rot : twist.vel));
  require(std::abs(std::abs(scale) - 1.0) < 1e-12, "joint '", name, "': scale = ", scale,
          ", but only 1 and -1 are supported: a joint position is an angle or a length");
  return scale > 0.0 ? 1.0 : -1.0;
}

}  // namespace

Chain from_kdl(const KDL::Chain& chain, const std::string& base) {
  Names joints(""), links(base);
  for (const KDL::Segment& from : chain.segments) {
    if (Names::given(from.getJoint().getName())) joints.take(from.getJoint().getName());
    if (Names::given(from.getName())) links.take(from.getName());
  }

  std::vector<Segment> segments;
  int number = 0;
  for (const KDL::Segment& from : chain.segments) {
    ++number;
    const KDL::Joint& joint = from.getJoint();
    Segment s;
    s.joint_name = Names::given(joint.getName()) ? joint.getName() : joints.make("joint" + std::to_string(number));
    s.link_name = Names::given(from.getName()) ? from.getName() : links.make("link" + std::to_string(number));
    s.type = type_of(joint);
    s.origin = to_eigen(from.getFrameToTip());  // the tip at q = 0, including the joint's offset
    s.inertia = to_inertia(from.getInertia());
    if (s.type != JointType::Fixed) {
      Eigen::Vector3d axis = to_eigen(joint.JointAxis());
      axis *= direction_of(joint, axis, s.joint_name);
      s.axis = s.origin.linear().transpose() * axis;

      // In a Chain the frame of a link lies on the axis of the link's joint; in KDL the frame can lie anywhere on the
      // link. A fixed segment from the axis to the frame makes up the difference.
      const Eigen::Vector3d arm = s.origin.translation() - to_eigen(joint.JointOrigin());
      const Eigen::Vector3d lever = arm - axis.dot(arm) * axis;
      if (s.type == JointType::Revolute && lever.norm() > 1e-15 * (1.0 + arm.norm())) {
        Segment tip;
        tip.joint_name = joints.make(s.joint_name + "_tip");
        tip.link_name = s.link_name;
        tip.origin.translation() = s.origin.linear().transpose() * lever;
        tip.inertia = s.inertia;
        s.link_name = links.make(s.link_name + "_joint");
        s.origin.translation() -= lever;
        s.inertia.reset();
        segments.push_back(s);
        segments.push_back(tip);
        continue;
      }
    }
    segments.push_back(s);
  }
  return Chain(base, std::move(segments));
}

KDL::RigidBodyInertia to_kdl(const Inertia& inertia) {
  const Eigen::Matrix3d& t = inertia.tensor;
  return KDL::RigidBodyInertia(inertia.mass, to_kdl_vector(inertia.center_of_mass),
                               KDL::RotationalInertia(t(0, 0), t(1, 1), t(2, 2), t(0, 1), t(0, 2), t(1, 2)));
}

KDL::Chain to_kdl(const Chain& chain) {
  KDL::Chain result;
  for (const Segment& s : chain.segments()) {
    const KDL::Frame origin = to_kdl_frame(s.origin);
    KDL::Joint joint(s.joint_name, KDL::Joint::None);
    if (s.type != JointType::Fixed) {
      joint = KDL::Joint(s.joint_name, origin.p, origin.M * to_kdl_vector(s.axis),
                         s.type == JointType::Prismatic ? KDL::Joint::TransAxis : KDL::Joint::RotAxis);
    }
    result.addSegment(
        KDL::Segment(s.link_name, joint, origin, s.inertia ? to_kdl(*s.inertia) : KDL::RigidBodyInertia::Zero()));
  }
  return result;
}

}  // namespace sigmaik
