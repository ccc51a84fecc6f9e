#pragma once
/// \file collisions.hpp
/// Clear of itself and of the world: an arm as capsules, obstacles, and what a servo may do near contact.
///
/// *Bodies.* A capsule is all points within its radius of a segment. A link's shapes are convex, and so is a capsule:
/// the capsule contains a shape if it contains the shape's corners (of a cylinder's end: a polygon around the circle).
/// Distances between capsules, and from a capsule to a sphere, box, cylinder or half-space, are exact.
///
/// *Approach.* d(q) is the distance of a pair of bodies, n the direction from one nearest point to the other, J_a and
/// J_b the Jacobians of these points: ḋ = nᵀ(J_a − J_b) q̇ = g·q̇. A motion q̇ can be braked by all joints in proportion:
/// its part p ∈ [0, 1] falls under |ṗ| ≤ a = min_i A_i/|q̇_i| and |p̈| ≤ j = min_i J_i/|q̇_i|. The approach speed s = −g·q̇
/// then takes the distance s D(1) until the stop, D the stopping distance of LimitTracker::arrival() for the limits a
/// and j. So the heading is bound by one linear row a pair:
///
///     −g·q̇ ≤ min(s D⁻¹(d'/s), k d'),   d' = d − margin − reserve,     k half of the bandwidth of the arm's limits
///
/// with D and its reserve (a half of the acceleration, an eighth of the jerk) as for an arrival at a target. The second
/// term makes the way into contact smooth. Where d' < 0 the row asks for a motion outwards, and where an obstacle moves
/// with a known twist, its approach speed is taken from the bound. Pairs have rows at the nearest points, and at the
/// ends of the segments as well: where nearest points switch from one end to the other, both ends have been in the
/// problem before. The rows are the inequalities of LeastSquares: inside them the answer is the nearest to the rule's
/// (OnLimit::Redistribute), or the largest part of it (OnLimit::Scale), and where they exclude each other, they are
/// missed as little as possible.
///
/// *Proof.* Rows are the first order, and acceleration limits delay the answer. Hence each command is verified before
/// it is sent: the fastest stop of all joints after this command (limits.hpp, with jerk limits too) must keep every
/// pair at the margin. Where it does not, the command is moved towards the next cycle of the stop that the last cycle
/// verified:
///     - this stop may always be continued (limits.hpp), and the rest of a verified stop is verified;
///     - a resting arm is its own stop.
/// By induction the arm never comes nearer than the margin to anything that rests, whatever the command, from every
/// start that is at rest outside the margin, and never moves nearer to anything that moves as was told. The rows lead
/// the arm away from an obstacle that comes towards it, as fast as the joints can; an obstacle may be faster. Where
/// the margin is broken already, or will be, each pair keeps at least the distance that the stop and the rest after it
/// leave in the time of the command's path.
///
/// A stop is verified at some of its configurations, with a bound of what happens between them. A point of a body has
/// |∂²x/∂q_i∂q_k| ≤ R_max(i,k), R_k its largest distance from joint k. Between two configurations that differ by Δ, h
/// seconds apart, joint i is at most e_i = A_i h²/8 away from the chord, so a point is at most
///
///     ε = ⅛ Σ_ik R_max(i,k) |Δ_i| |Δ_k| + Σ_i R_i e_i
///
/// away from its own chord, and as a norm is convex, d ≥ min(d at both ends) − ε in between. Intervals in which this is
/// not enough are halved, down to single cycles. Only the joints between two bodies count.

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <sigmaik/chain.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/types.hpp>

namespace sigmaik::detail {
struct CollisionModel;
}  // namespace sigmaik::detail

namespace sigmaik {

inline constexpr int kMaxCarried = 4;     ///< most capsules of a carried object
inline constexpr int kMaxCapsules = 28;   ///< most capsules of an arm
inline constexpr int kMaxObstacles = 32;  ///< most obstacles of an arm

/// All points within `radius` of the segment from a to b; a sphere where a = b.
struct Capsule {
  Eigen::Vector3d a = Eigen::Vector3d::Zero();  ///< [m]
  Eigen::Vector3d b = Eigen::Vector3d::Zero();  ///< [m]
  double radius = 0.0;                          ///< [m] > 0
};

/// A capsule that is fixed to a link.
struct LinkCapsule {
  std::string link;  ///< the link's name
  Capsule capsule;   ///< in the link frame
  /// [m], how far the capsule stands out from the shapes that it covers, at most; 0 where it was given.
  double excess = 0.0;
};

/// A body of the world. Its pose is in the axes of the arm's base.
struct Obstacle {
  /// What the obstacle is, in its own axes.
  enum class Shape : std::int8_t {
    Sphere,     ///< about the origin
    Capsule,    ///< along z
    Box,        ///< about the origin
    Cylinder,   ///< along z, with flat ends
    HalfSpace,  ///< z ≤ 0
  };
  Shape shape = Shape::Sphere;   ///< in its own frame
  Pose pose = Pose::Identity();  ///< of this frame in base
  /// [m] sphere: radius; capsule: radius, length of the segment; box: sides; cylinder: radius, length.
  Eigen::Vector3d size = Eigen::Vector3d::Zero();
  std::string name{};                ///< empty: "obstacle i"
  std::vector<std::string> links{};  ///< the links that have to keep clear; empty: all links that a joint moves

  /// A ball, in base [m].
  static Obstacle sphere(const Eigen::Vector3d& center, double radius);
  /// The points within `radius` of the segment from a to b, in base [m].
  static Obstacle capsule(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius);
  /// A box about the origin of `pose` [m].
  static Obstacle box(const Pose& pose, const Eigen::Vector3d& sides);
  /// A cylinder along z of `pose`, about its origin [m].
  static Obstacle cylinder(const Pose& pose, double radius, double length);
  /// The side of the plane through `point` that `normal` points away from: a floor, a wall, a side of a work space.
  static Obstacle half_space(const Eigen::Vector3d& point, const Eigen::Vector3d& normal);
};

/// Settings of Collisions.
struct CollisionOptions {
  double margin = 0.01;        ///< [m] ≥ 0: no pair of bodies comes closer
  bool self_collision = true;  ///< whether the arm's capsules keep clear of each other
  /// URDF with the links' shapes: a file's path or the XML; empty: the URDF that the chain was read from. Without a
  /// URDF capsules of `radius` run from each link's frame to the next.
  std::string source{};
  /// SRDF whose `disable_collisions` name pairs of links that need no check: a file's path or the XML; empty: none.
  std::string srdf{};
  double radius = 0.05;  ///< [m] > 0, of links with meshes, and without a URDF
  int capsules = 0;      ///< most capsules of the arm, at least one a link; 0: three more than joints
  std::vector<std::pair<std::string, std::string>> ignore{};  ///< more pairs of links that need no check
};

/// The nearest pair of bodies. Bodies are numbered: capsules of the arm, carried capsules, obstacles
/// (Collisions::body_names()).
struct Proximity {
  double distance = std::numeric_limits<double>::infinity();  ///< [m], below 0: contact; infinite: there is no pair
  int body = -1;                                              ///< the body that more joints move
  int other = -1;                                             ///< the other body, or the obstacle
  Eigen::Vector3d point = Eigen::Vector3d::Zero();            ///< [m] on `body`, in base
  Eigen::Vector3d other_point = Eigen::Vector3d::Zero();      ///< [m] on `other`, in base
};

/// What an arm must not touch: itself, and obstacles. Copies share the obstacles and the carried object: one that the
/// application keeps moves the obstacles of the servo that has another.
///
/// Pairs of capsules are checked where two or more joints lie between their links, but for pairs that are nearer than
/// the margin in nine of ten configurations over the joints' ranges, which are so by design or by the capsules' excess,
/// pairs of `ignore` and of the SRDF. Obstacles are checked against each capsule that a joint moves.
class Collisions {
 public:
  /// Covers the arm's links by capsules, as few as `options.capsules`, each as small as a search finds.
  /// \throws Error where a number is out of its range, a link does not exist, there are too many bodies, or the URDF
  ///     gives a link no shape that can be read
  explicit Collisions(const Chain& chain, const std::vector<Obstacle>& obstacles = {},
                      const CollisionOptions& options = {});
  /// The same with capsules of the application's own.
  static Collisions with_capsules(const Chain& chain, const std::vector<LinkCapsule>& arm,
                                  const std::vector<Obstacle>& obstacles = {}, const CollisionOptions& options = {});

  /// Moves obstacle i, from any thread. Takes a lock that no servo waits for.
  /// \param twist [v; ω] of the obstacle's origin, base axes: until the next call it goes on like this, for at most
  ///     0.2 s
  /// \throws Error where there is no obstacle i, a number is not finite, or the pose is none
  void move(int i, const Pose& pose, const Twist& twist = Twist::Zero());

  /// Attaches an object to the tip, in place of the one that the arm carries; from any thread. Its capsules keep clear
  /// of obstacles and of the links that at least two joints separate from the tip.
  /// \param object up to kMaxCarried capsules, in the tip's frame
  /// \throws Error where there are too many, or a number is out of its range
  void attach(const std::vector<Capsule>& object);
  /// Lets go of the object.
  void detach() { attach({}); }

  /// The least distance at q (n,), with the obstacles where they are now. Real time.
  Proximity nearest(const JointRef& q) const noexcept;

  /// The arm.
  const Chain& chain() const noexcept;
  /// The settings, as given.
  const CollisionOptions& options() const noexcept;
  /// The arm's capsules, base to tip.
  const std::vector<LinkCapsule>& capsules() const noexcept;
  /// Names of all bodies: the capsules' links (with "/2", … for more capsules of a link), "carried 1", …, the
  /// obstacles.
  const std::vector<std::string>& body_names() const noexcept;
  /// Pairs of the arm's own capsules that are checked, the one that more joints move first.
  std::vector<std::pair<int, int>> self_pairs() const;
  /// The obstacles, as given.
  const std::vector<Obstacle>& obstacles() const noexcept;

  /// For the servo.
  const std::shared_ptr<detail::CollisionModel>& model() const noexcept { return model_; }

 private:
  explicit Collisions(std::shared_ptr<detail::CollisionModel> model) noexcept : model_(std::move(model)) {}

  std::shared_ptr<detail::CollisionModel> model_;
};

SIGMAIK_SAME_LAYOUT(Collisions, Capsule, LinkCapsule, Obstacle, CollisionOptions, Proximity);

}  // namespace sigmaik
