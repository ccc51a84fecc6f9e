#include <sigmaik/analytic_ik.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include <sigmaik/pose.hpp>

#include "analytic_walk.hpp"
#include "message.hpp"

namespace sigmaik {
namespace {

using detail::message;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi, kTurn = 2.0 * std::numbers::pi;
constexpr double kMeet = 1e-9;         // axes that must meet or be parallel: rad, or part of the arm's size
constexpr double kApart = 1e-3;        // axes that must differ: rad, or part of the planar arm's length
constexpr double kLimit = 1e-12;       // a limit is exceeded by more than this [rad]
constexpr double kLargestAngle = 1e9;  // of q: above, rounding of q exceeds 1e-7 rad

double angle_between(const Vector3d& a, const Vector3d& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }
// The angle between two lines without direction, in [0, π/2].
double inclination(const Vector3d& a, const Vector3d& b) { return std::atan2(a.cross(b).norm(), std::abs(a.dot(b))); }

// A frame whose z axis is `z`, and whose x axis lies in the plane of `z` and `towards`, on the side of `towards`.
Matrix3d axes_along(const Vector3d& z, const Vector3d& towards) {
  Matrix3d axes;
  axes.col(2) = z;
  axes.col(1) = z.cross(towards).normalized();
  axes.col(0) = axes.col(1).cross(z);
  return axes;
}

// Moves an angle to the turn nearest to `near` within [lower, upper]. If no turn is within, moves the angle to the turn
// nearest to `near` and returns false.
inline bool on_turn(double& angle, double near, double lower, double upper) noexcept {
  if (std::abs(near - angle) > kPi) angle += kTurn * std::floor((near - angle) / kTurn + 0.5);
  const double least = lower - kLimit, most = upper + kLimit;
  double x = angle;
  if (x < least) {
    x += kTurn;
    if (x < least) x += kTurn * std::ceil((least - x) / kTurn);
  } else if (x > most) {
    x -= kTurn;
    if (x > most) x -= kTurn * std::ceil((x - most) / kTurn);
  }
  if (x < least || x > most) return false;
  angle = std::clamp(x, lower, upper);
  return true;
}

using Walked = AnalyticWalk::Branch;

// Collects every branch, each joint on the turn nearest to 0.
struct Every {
  const SixJoints& lower;
  const SixJoints& upper;
  AnalyticSolutions& out;

  double free(int joint) const noexcept { return std::clamp(0.0, lower[joint], upper[joint]); }
  void place(int joint, double angle, Walked& branch) const noexcept {
    angle -= kTurn * (static_cast<int>(angle > kPi) - static_cast<int>(angle <= -kPi));
    const bool fits = on_turn(angle, 0.0, lower[joint], upper[joint]);
    branch.within_limits = (joint == 0 || branch.within_limits) && fits;
    branch.q[joint] = angle;
  }
  bool hopeless(const Walked& /*branch*/) const noexcept { return false; }
  void done(const Walked& branch) noexcept { out.branches[static_cast<std::size_t>(out.count++)] = branch; }
};

// Keeps the one branch nearest to q.
struct NearestOf {
  const SixJoints& lower;
  const SixJoints& upper;
  const SixJoints& q;
  bool found = false;
  Walked best{};

  double free(int joint) const noexcept { return std::clamp(q[joint], lower[joint], upper[joint]); }
  void place(int joint, double angle, Walked& branch) const noexcept {
    const bool fits = on_turn(angle, q[joint], lower[joint], upper[joint]);
    branch.within_limits = (joint == 0 || branch.within_limits) && fits;
    branch.q[joint] = angle;
    branch.cost += (angle - q[joint]) * (angle - q[joint]);
  }
  // A cost only grows, and a branch that has left the limits stays outside.
  bool hopeless(const Walked& branch) const noexcept {
    if (!found) return false;
    if (branch.within_limits != best.within_limits) return best.within_limits;
    return branch.cost >= best.cost;
  }
  void done(const Walked& branch) noexcept {
    if (hopeless(branch)) return;
    best = branch;
    found = true;
  }
};

}  // namespace

const char* to_string(AnalyticStatus status) noexcept {
  switch (status) {
    case AnalyticStatus::Ok: return "ok";
    case AnalyticStatus::Unreachable: return "unreachable";
    case AnalyticStatus::BadInput: return "bad input";
  }
  return "unknown";
}

// Sets up an AnalyticIk from the arm's axes at q = 0. The frames are those of analytic_ik.hpp.
struct AnalyticSetup {
  AnalyticIk& ik;
  std::array<Vector3d, 6> h, o;  // directions and origins of the axes, in the frame of joint 1
  Pose tip = Pose::Identity();   // in the frame of joint 1
  double size = 0.0;             // sum of the distances between the joints' frames, from joint 1 to the tip [m]
  Vector3d centre;               // the wrist centre, in the frame of joint 1
  std::string faults;            // what the arm lacks

  explicit AnalyticSetup(AnalyticIk& result) : ik(result) {}

  void run() {
    read_axes();
    check_directions();
    find_wrist_centre();
    const Arm arm = planar_arm();
    const Chain& chain = ik.chain_;
    detail::require(faults.empty(),
                    "closed-form inverse kinematics needs a spherical wrist after parallel axes 2 and 3; '",
                    chain.base(), "' to '", chain.tip(), "': ", faults);
    set_shoulder(arm);
    set_elbow(arm);
    set_wrist(arm);
    ik.reach_ = arm.second.norm() + arm.upper.norm() + arm.fore.norm();
    ik.tolerance_ = AnalyticWalk::kMerge * (size + chain.constants()[0].translation.norm());
    ik.lower_ = chain.limits().lower;
    ik.upper_ = chain.limits().upper;
  }

 private:
  // The planar arm of joints 2 and 3. Vectors are in the axes of {p}, at q = 0.
  struct Arm {
    double lean;           // from axis 1 to axis 2 [rad]
    Matrix3d shoulder;     // axes of {s} in the frame of joint 1
    Matrix3d plane;        // axes of {p} in the frame of joint 1
    Vector3d second;       // from joint 1 to joint 2 [m]
    Vector3d upper, fore;  // from joint 2 to joint 3, and from joint 3 to the wrist centre [m]
    double upper_angle() const { return std::atan2(upper[1], upper[0]); }
    double fore_angle() const { return std::atan2(fore[1], fore[0]); }
  };

  template <typename... Parts>
  void fault(const Parts&... parts) {
    faults += (faults.empty() ? "" : "; ") + message(parts...);
  }

  double slant(std::size_t i, std::size_t j) const { return inclination(h[i - 1], h[j - 1]); }

  // In the frame of joint 1, so that a far mounting of the arm costs no digits.
  void read_axes() {
    const Chain& chain = ik.chain_;
    for (std::size_t i = 0; i < 6; ++i) {
      const JointConstants& c = chain.constants()[i];
      detail::require(!c.prismatic, "closed-form inverse kinematics needs revolute joints; joint '",
                      chain.joint_names()[i], "' is prismatic");
      if (i > 0) {
        tip.translation() += tip.linear() * c.translation;
        tip.linear() = tip.linear() * c.rotation;
        size += c.translation.norm();
      }
      h[i] = tip.linear().col(2);
      o[i] = tip.translation();
    }
    tip = tip * chain.tool();
    size += chain.tool().translation().norm();
  }

  void check_directions() {
    if (slant(2, 3) > kMeet) {
      fault("axes 2 and 3 are ", slant(2, 3), " rad from parallel, a geometry that is not covered");
    }
    for (const auto& [i, j] : {std::pair<std::size_t, std::size_t>{1, 2}, {4, 5}, {5, 6}}) {
      if (slant(i, j) < kApart) fault("axes ", i, " and ", j, " are parallel (", slant(i, j), " rad apart)");
    }
  }

  // The point of axis 5 closest to axis 4, which axes 4 and 6 must contain.
  void find_wrist_centre() {
    centre = o[4];
    if (slant(4, 5) < kApart) return;
    const Vector3d normal = h[3].cross(h[4]), from = o[4] - o[3];
    const double miss = std::abs(normal.dot(from)) / normal.norm();
    if (miss > kMeet * size) fault("axes 4 and 5 miss each other by ", miss, " m");
    centre += h[4] * h[3].cross(from).dot(-normal) / normal.squaredNorm();
    const double distance = h[5].cross(centre - o[5]).norm();
    if (distance > kMeet * size) fault("axis 6 misses the point where axes 4 and 5 meet by ", distance, " m");
  }

  Arm planar_arm() {
    Arm arm;
    arm.lean = angle_between(h[0], h[1]);
    arm.shoulder = axes_along(h[0], h[1]);
    arm.plane << arm.shoulder * Vector3d(std::cos(arm.lean), 0.0, -std::sin(arm.lean)), arm.shoulder.col(1), h[1];
    arm.second = arm.plane.transpose() * (o[1] - o[0]);
    arm.upper = arm.plane.transpose() * (o[2] - o[1]);
    arm.fore = arm.plane.transpose() * (centre - o[2]);
    ik.elbow_.upper = arm.upper.head<2>().norm();
    ik.elbow_.fore = arm.fore.head<2>().norm();
    if (faults.empty()) {
      const double least = kApart * (ik.elbow_.upper + ik.elbow_.fore);
      if (ik.elbow_.upper <= least) fault("axes 2 and 3 are one line (", ik.elbow_.upper, " m apart)");
      if (ik.elbow_.fore <= least) fault("the wrist centre lies on axis 3 (", ik.elbow_.fore, " m off)");
    }
    return arm;
  }

  void set_shoulder(const Arm& arm) {
    const JointConstants& first = ik.chain_.constants()[0];
    auto& s = ik.shoulder_;
    s.from_base = (first.rotation * arm.shoulder).transpose();
    s.origin = first.translation;
    s.c12 = std::cos(arm.lean);
    s.s12 = std::sin(arm.lean);
    s.height = arm.second[2] + arm.upper[2] + arm.fore[2];
    s.x = arm.second[0];
    s.y = arm.second[1];
  }

  void set_elbow(const Arm& arm) {
    ik.elbow_.sign3 = h[1].dot(h[2]) > 0.0 ? 1.0 : -1.0;
    ik.elbow_.zero2 = arm.upper_angle();
    ik.elbow_.zero3 = arm.fore_angle() - arm.upper_angle();
  }

  void set_wrist(const Arm& arm) {
    const Matrix3d frame4 = axes_along(h[3], h[4]), frame5b = axes_along(h[4], h[5]);
    double angle45 = angle_between(h[3], h[4]), angle56 = angle_between(h[4], h[5]);
    // Whether axes 4 and 6 can lie on one line must not depend on rounding.
    if (std::abs(angle45 - angle56) < kMeet) angle45 = angle56 = 0.5 * (angle45 + angle56);
    if (const double over = angle45 + angle56 - kPi; std::abs(over) < kMeet) {
      angle45 -= 0.5 * over;
      angle56 -= 0.5 * over;
    }
    auto& w = ik.wrist_;
    const double fore_angle = arm.fore_angle();
    Matrix3d fore_axes;  // x along the forearm, z along axis 2
    fore_axes << arm.plane * Vector3d(std::cos(fore_angle), std::sin(fore_angle), 0.0),
        arm.plane * Vector3d(-std::sin(fore_angle), std::cos(fore_angle), 0.0), h[1];
    w.from_fore = frame4.transpose() * fore_axes;
    w.c45 = std::cos(angle45);
    w.s45 = std::sin(angle45);
    w.c56 = std::cos(angle56);
    w.s56 = std::sin(angle56);
    w.c_sum = std::cos(0.5 * (angle45 + angle56));
    w.s_sum = std::sin(0.5 * (angle45 + angle56));
    w.c_diff = std::cos(0.5 * (angle45 - angle56));
    w.s_diff = std::sin(0.5 * (angle45 - angle56));
    w.perpendicular = std::abs(w.c45) < 1e-15 && std::abs(w.c56) < 1e-15;
    const Vector3d x5a = frame4 * Vector3d(w.c45, 0.0, -w.s45);  // {4} Ry(α45)
    w.zero5 = std::atan2(frame4.col(1).dot(frame5b.col(0)), x5a.dot(frame5b.col(0)));

    const Vector3d x6 = frame5b * Vector3d(w.c56, 0.0, -w.s56);  // {5b} Ry(α56)
    ik.tip_ << tip.inverse() * centre, tip.linear().transpose() * x6, tip.linear().transpose() * h[5];
  }
};

AnalyticIk::AnalyticIk(const Chain& chain) : chain_(chain) {
  detail::require(chain.dof() == 6, "closed-form inverse kinematics needs 6 joints; from '", chain.base(), "' to '",
                  chain.tip(), "' there are ", chain.dof());
  detail::require(!chain.has_mimics(), "closed-form inverse kinematics needs joints that move by themselves");
  AnalyticSetup(*this).run();
}

AnalyticSolutions AnalyticIk::solve(const Pose& pose) const noexcept {
  AnalyticSolutions out;
  if (!is_pose(pose.matrix())) return out;
  Every rule{lower_, upper_, out};
  AnalyticWalk{*this}.run(pose, rule);
  out.status = out.count > 0 ? AnalyticStatus::Ok : AnalyticStatus::Unreachable;
  return out;
}

AnalyticNearest AnalyticIk::nearest(const Pose& pose, const JointRef& q) const noexcept {
  AnalyticNearest out;
  if (q.size() != 6 || !q.allFinite() || q.cwiseAbs().maxCoeff() > kLargestAngle || !is_pose(pose.matrix())) return out;
  const SixJoints near = q;
  NearestOf rule{lower_, upper_, near};
  AnalyticWalk{*this}.run(pose, rule);
  out.status = rule.found ? AnalyticStatus::Ok : AnalyticStatus::Unreachable;
  if (rule.found) out.branch = rule.best;
  return out;
}

}  // namespace sigmaik
