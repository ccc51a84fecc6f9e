#pragma once
/// \file chain.hpp
/// The arm: a serial chain of segments, immutable once made.

#include <array>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sigmaik/layout.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik {

class Chain;

namespace detail {
inline const std::string kNoText;

// A chain that was read from this text, or was made again of the parts of such a chain.
Chain with_urdf(Chain chain, std::string text);
}  // namespace detail

/// Kind of a joint. A continuous joint turns without position limits; its positions are the same modulo 2π.
enum class JointType { Fixed, Revolute, Continuous, Prismatic };

/// "fixed", "revolute", "continuous", "prismatic".
const char* to_string(JointType type) noexcept;

/// Mass distribution of a link. The tensor is about the centre of mass, in the link's axes.
struct Inertia {
  double mass = 0.0;                                         ///< [kg]
  Eigen::Vector3d center_of_mass = Eigen::Vector3d::Zero();  ///< [m], in the link frame
  Eigen::Matrix3d tensor = Eigen::Matrix3d::Zero();          ///< [kg·m²]
};

/// The joint turns or slides with another joint of the chain: its position is multiplier · (position of `joint`) +
/// offset.
struct Mimic {
  std::string joint;        ///< a movable joint of the chain, which may mimic another joint itself
  double multiplier = 1.0;  ///< finite, not 0
  double offset = 0.0;      ///< [rad or m], finite
};

/// A joint and the link that it carries. The link frame is the joint frame after the motion:
/// parent ← origin · motion(axis, q).
struct Segment {
  std::string joint_name;                                         ///< unique in the chain
  std::string link_name;                                          ///< unique in the chain
  JointType type = JointType::Fixed;                              ///< kind of the joint
  Pose origin = Pose::Identity();                                 ///< joint frame in the parent link, at q = 0
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();                ///< in the joint frame; normalised by Chain
  double lower = -std::numeric_limits<double>::infinity();        ///< [rad or m]
  double upper = std::numeric_limits<double>::infinity();         ///< [rad or m]
  double velocity = std::numeric_limits<double>::infinity();      ///< [rad/s or m/s], > 0
  double acceleration = std::numeric_limits<double>::infinity();  ///< [rad/s² or m/s²], > 0
  double deceleration = std::numeric_limits<double>::infinity();  ///< > 0, of braking; infinite: as the acceleration
  double jerk = std::numeric_limits<double>::infinity();          ///< [rad/s³ or m/s³], > 0
  double effort = std::numeric_limits<double>::infinity();        ///< [N·m or N], > 0
  std::optional<Inertia> inertia;                                 ///< of the link, where it is known
  std::optional<Mimic> mimic;                                     ///< none: the joint moves by itself
  /// How a reader took values that have no meaning, one sentence each: warnings() of the chain contains these notes.
  std::vector<std::string> notes;
};

/// Limits of the movable joints, base to tip, infinite where there is none.
struct JointLimits {
  JointVector lower;         ///< [rad or m]
  JointVector upper;         ///< [rad or m]
  JointVector velocity;      ///< [rad/s or m/s]
  JointVector acceleration;  ///< [rad/s² or m/s²]
  JointVector jerk;          ///< [rad/s³ or m/s³]
  JointVector effort;        ///< [N·m or N]
  /// [rad/s² or m/s²], of a joint that becomes slower. Infinite, or an empty vector: as the acceleration.
  JointVector deceleration{};

  /// (n,) [rad/s² or m/s²]: the deceleration, or the acceleration where none is given.
  JointVector braking() const;
};

/// How a joint that moves depends on the joint positions q: its position is multiplier · q[joint] + offset.
struct Coupling {
  int joint = 0;            ///< of q
  double multiplier = 1.0;  ///< not 0
  double offset = 0.0;      ///< [rad or m]
};

/// Constants of a movable joint for the kinematics, laid out for one flat pass. Fixed joints are folded in, and frames
/// are turned so that every axis is z.
struct JointConstants {
  Eigen::Matrix3d rotation;     ///< this joint's frame in the frame of the joint before
  Eigen::Vector3d translation;  ///< [m]
  bool prismatic;               ///< true: slides along z; false: turns about z
};

/// A serial arm. A value: cheap to copy (copies share one immutable model), safe to use from many threads.
class Chain {
 public:
  /// \param base name of the base link
  /// \param segments base to tip, fixed joints included; 1 to 16 of them movable. Joints that mimic others are not
  ///     joints of q; their limits become limits of the joint that they mimic: with position m·q + b, q is held in
  ///     (their position limits − b)/m, and |q̇|, |q̈| and the jerk below their limits over |m|. Their effort stays.
  /// \throws Error with the joint and the value, where a name is empty or used twice, an axis is zero, a
  ///     number is not finite or absurd, or limits contradict each other
  Chain(std::string base, std::vector<Segment> segments);

  /// Reads a URDF (through urdfdom).
  /// \param source a file's path, or the XML itself
  /// \param base, tip link names; empty: the root, the only leaf
  /// \param acceleration [rad/s² or m/s²], one a movable joint; empty: the URDF's own, where its `limit`
  ///     elements carry the attribute `acceleration` (URDF 1.2), else infinite
  /// \throws Error for anything that is not a usable serial arm, with the facts
  static Chain from_urdf(const std::string& source, const std::string& base = "", const std::string& tip = "",
                         const std::vector<double>& acceleration = {});

  /// Number n of joints that move by themselves, 1 to 16: of q.
  int dof() const noexcept { return model_->dof; }
  /// Name of the base link.
  const std::string& base() const noexcept { return model_->base; }
  /// Name of the tip link.
  const std::string& tip() const noexcept { return model_->segments.back().link_name; }
  /// Names of the movable joints, base to tip.
  const std::vector<std::string>& joint_names() const noexcept { return model_->joint_names; }
  /// Types of the movable joints, base to tip.
  const std::vector<JointType>& joint_types() const noexcept { return model_->joint_types; }
  /// Limits of the movable joints, (n,) each.
  const JointLimits& limits() const noexcept { return model_->limits; }
  /// All segments, fixed joints included.
  const std::vector<Segment>& segments() const noexcept { return model_->segments; }

  /// The same arm with other limits. A continuous joint that gets a position limit (a cable) becomes a revolute joint.
  /// \throws Error where sizes or values do not fit
  Chain with_limits(const JointLimits& limits) const;

  /// The same arm with a tool: a fixed segment is added after the tip, and its frame is the new tip.
  /// \param pose of the tool's frame in the tip
  /// \param inertia of the tool, in the tool's frame; none: the tool weighs nothing that is known
  /// \throws Error where the pose is not a pose, or no body has the inertia
  Chain with_tool(const Pose& pose, const std::optional<Inertia>& inertia = {}) const;

  /// The same arm with joints that do not move any more: they become fixed segments, and q has fewer entries. Joints
  /// that mimic a locked joint are fixed with it. Links, shapes and inertias stay.
  /// \param positions [rad or m], of the joints by name
  /// \throws Error where a joint is not in joint_names(), its position is outside its limits, or no joint is left
  Chain lock(const std::map<std::string, double>& positions) const;

  /// Faults of the model that do not keep the arm from moving, one sentence each: limits of zero in a URDF, which count
  /// as no limit, and inertias that no rigid body has. Python warns of these faults when it reads a URDF.
  const std::vector<std::string>& warnings() const noexcept { return model_->warnings; }

  /// Velocity and acceleration limits that joints lack, so that a servo cannot hold them: one sentence for each kind of
  /// limit. Python warns of missing limits where a servo is made.
  /// \param velocity, acceleration whether the kind matters
  std::vector<std::string> missing_limits(bool velocity = true, bool acceleration = true) const;

  /// One sentence for each joint that is outside its position limits by more than 1 rad or 1 m at q (n,): such a start
  /// is more likely a mistake of units than a posture. Python warns of these joints where a servo is reset.
  /// \throws Error where the size is wrong
  std::vector<std::string> far_outside_limits(const JointRef& q) const;

  /// [m] > 0, the lever arm of the joints that turn: the root of the mean square of the distance from a joint's axis to
  /// the tip's origin, over these joints and over all turns of the joints after each, which are taken as equally
  /// likely. One length makes twists, Jacobians and errors homogeneous: Angeles (Fundamentals of Robotic Mechanical
  /// Systems, 4th ed., §5.3) calls this length the characteristic length, and shows that the mean square of the lever
  /// arms takes this place at an isotropic posture. The mean over all turns does not depend on a posture, is a closed
  /// form, and scales with the arm. 1 where no joint moves the tip by turning.
  double characteristic_length() const noexcept { return model_->characteristic_length; }

  /// Number of joints that move, at most 16: dof(), and the joints that mimic these.
  int moving() const noexcept { return model_->moving; }
  /// Whether joints mimic others: then constants() has more joints than q.
  bool has_mimics() const noexcept { return model_->moving != model_->dof; }
  /// Of each of moving() joints, base to tip.
  const std::array<Coupling, kMaxJoints>& couplings() const noexcept { return model_->couplings; }
  /// (moving(), n), the matrix A of the couplings: the positions of all joints that move are A q + offsets.
  JointMatrix coupling_matrix() const;

  /// Constants of the kinematics: moving() joints, then the tip's frame in the last joint's.
  const std::array<JointConstants, kMaxJoints>& constants() const noexcept { return model_->constants; }
  /// The tip in the last movable joint's frame, at any q.
  const Pose& tool() const noexcept { return model_->tool; }
  /// The XML of the URDF that the chain was read from; empty where the chain was made in another way.
  const std::string& urdf() const noexcept { return urdf_ != nullptr ? *urdf_ : detail::kNoText; }

 private:
  struct Model {
    std::string base;
    std::vector<Segment> segments;
    std::vector<std::string> joint_names;
    std::vector<JointType> joint_types;
    std::vector<std::string> warnings;
    JointLimits limits;
    int dof = 0, moving = 0;
    std::array<Coupling, kMaxJoints> couplings;
    double characteristic_length = 1.0;
    std::array<JointConstants, kMaxJoints> constants;
    Pose tool = Pose::Identity();
  };
  friend Chain detail::with_urdf(Chain chain, std::string text);

  std::shared_ptr<const Model> model_;
  std::shared_ptr<const std::string> urdf_;  // null: none
};

SIGMAIK_SAME_LAYOUT(Chain, Inertia, Segment, JointLimits, JointConstants, Coupling);

}  // namespace sigmaik
