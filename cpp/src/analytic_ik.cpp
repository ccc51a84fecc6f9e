#include <sigmaik/analytic_ik.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include <sigmaik/pose.hpp>

#include "message.hpp"

namespace sigmaik {
namespace {

using detail::message;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi, kTurn = 2.0 * std::numbers::pi;
constexpr double kMeet = 1e-9;    // coincidences of the geometry: rad, or of the arm's size
constexpr double kApart = 1e-3;   // what must differ: rad, or of the planar arm's length
constexpr double kMerge = 1e-12;  // two branches are one: rad, or of the arm's size
constexpr double kClose = 1e-4;   // to where branches are one, of the distance: rounding moves them by more than itself
constexpr double kLimit = 1e-12;  // beyond a limit by rounding [rad]
constexpr double kLargestAngle = 1e9;  // of q: beyond, an angle has no digits left

// cos and angle where the sine is k/16.
constexpr double kNodes[12][2] = {{1.0, 0.0},
                                  {0.998044963916957, 0.06254076179649139},
                                  {0.9921567416492215, 0.1253278311680654},
                                  {0.982264602843857, 0.1886163861754041},
                                  {0.9682458365518543, 0.25268025514207865},
                                  {0.9499177595981665, 0.31782370392788073},
                                  {0.9270248108869579, 0.3843967744956391},
                                  {0.899218410621135, 0.4528165947449256},
                                  {0.8660254037844386, 0.5235987755982989},
                                  {0.8267972847076845, 0.5974064166453502},
                                  {0.7806247497997998, 0.6751315329370317},
                                  {0.7261843774138906, 0.758040765426236}};

// From the angle in the first octant to that in the others of the half turn: no branches, which nothing would predict.
constexpr double kOctants[4][2] = {{0.0, 1.0}, {0.5 * kPi, -1.0}, {kPi, -1.0}, {0.5 * kPi, 1.0}};

// Angle in [−π, π] of a unit vector (c, s), to a unit or two in the last place. An answer has two dozen of them, and
// atan2, which serves vectors of any length, would add a quarter to its time. The angle from the nearest node is small,
// and its sine is known.
inline double angle_of(double c, double s) noexcept {
  const double x = std::abs(c), y = std::abs(s);
  const double large = std::max(x, y), small = std::min(x, y);
  const int k = small < 0.71 ? static_cast<int>(16.0 * small + 0.5) : 11;
  const double d = small * kNodes[k][0] - large * (0.0625 * k), t = d * d;
  const double series = t * (1.0 / 6.0 +
                             t * (3.0 / 40.0 + t * (15.0 / 336.0 + t * (105.0 / 3456.0 + t * (945.0 / 42240.0)))));
  const auto& octant = kOctants[static_cast<int>(y > x) + 2 * static_cast<int>(c < 0.0)];
  return std::copysign(octant[0] + octant[1] * (kNodes[k][1] + (d + d * series)), s);
}

// A rotation in a plane. Products add angles, and take no trigonometry.
struct Turn {
  double c = 1.0, s = 0.0;

  static Turn of(double angle) noexcept { return {std::cos(angle), std::sin(angle)}; }
  double angle() const noexcept { return angle_of(c, s); }
  Turn inverse() const noexcept { return {c, -s}; }
};

inline Turn operator*(const Turn& a, const Turn& b) noexcept { return {a.c * b.c - a.s * b.s, a.s * b.c + a.c * b.s}; }

// The turn that takes the direction of (x, y) to that of (u, v).
inline Turn between(double x, double y, double u, double v) noexcept {
  const double c = x * u + y * v, s = x * v - y * u;
  const double scale = 1.0 / std::sqrt(c * c + s * s);
  return {c * scale, s * scale};
}

// Half an angle from the squares of its cosine and sine, up to a common factor.
inline Turn half_turn(double cosine, double sine) noexcept {
  const double scale = 1.0 / (cosine + sine);
  return {std::sqrt(cosine * scale), std::sqrt(sine * scale)};
}

// Back by `turn` about z.
inline Vector3d back_z(const Turn& turn, const Vector3d& v) noexcept {
  return {turn.c * v[0] + turn.s * v[1], turn.c * v[1] - turn.s * v[0], v[2]};
}

// Back about y.
inline Vector3d back_y(double c, double s, const Vector3d& v) noexcept {
  return {c * v[0] - s * v[2], v[1], s * v[0] + c * v[2]};
}

double angle_between(const Vector3d& a, const Vector3d& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }
// Of two lines without direction, in [0, π/2].
double inclination(const Vector3d& a, const Vector3d& b) { return std::atan2(a.cross(b).norm(), std::abs(a.dot(b))); }

// Axes whose z is `z`, with `towards` in the plane of x (its positive side) and z.
Matrix3d axes_along(const Vector3d& z, const Vector3d& towards) {
  Matrix3d axes;
  axes.col(2) = z;
  axes.col(1) = z.cross(towards).normalized();
  axes.col(0) = axes.col(1).cross(z);
  return axes;
}

// The rotation nearest to one that is_pose() has accepted (polar factor by Newton).
Matrix3d orthonormal(Matrix3d r) noexcept {
  for (int i = 0; i < 3; ++i) {
    const Matrix3d defect = r.transpose().lazyProduct(r) - Matrix3d::Identity();
    if (defect.cwiseAbs().maxCoeff() < 1e-14) break;
    r -= 0.5 * r.lazyProduct(defect);
  }
  return r;
}

}  // namespace

const char* to_string(AnalyticStatus status) noexcept {
  switch (status) {
    case AnalyticStatus::Ok: return "ok";
    case AnalyticStatus::Unreachable: return "unreachable";
    case AnalyticStatus::BadInput: return "bad input";
  }
  return "unknown";
}

AnalyticIk::AnalyticIk(const Chain& chain) : chain_(chain) {
  detail::require(chain.dof() == 6, "closed-form inverse kinematics needs 6 joints; from '", chain.base(), "' to '",
                  chain.tip(), "' there are ", chain.dof());

  // Axes and tip at q = 0, in the frame of joint 1. Far mounting must not cost digits here.
  std::array<Vector3d, 6> h, o;
  Pose at = Pose::Identity();
  double size = 0.0;
  for (std::size_t i = 0; i < 6; ++i) {
    const JointConstants& c = chain.constants()[i];
    detail::require(!c.prismatic, "closed-form inverse kinematics needs revolute joints; joint '",
                    chain.joint_names()[i], "' is prismatic");
    if (i > 0) {
      at.translation() += at.linear() * c.translation;
      at.linear() = at.linear() * c.rotation;
      size += c.translation.norm();
    }
    h[i] = at.linear().col(2);
    o[i] = at.translation();
  }
  at = at * chain.tool();
  size += chain.tool().translation().norm();

  std::string faults;
  const auto fault = [&faults](const auto&... parts) { faults += (faults.empty() ? "" : "; ") + message(parts...); };
  const auto slant = [&h](std::size_t i, std::size_t j) { return inclination(h[i - 1], h[j - 1]); };
  if (slant(2, 3) > kMeet) {
    fault("axes 2 and 3 are ", slant(2, 3), " rad from parallel, a geometry that is not covered");
  }
  for (const auto& [i, j] : {std::pair<std::size_t, std::size_t>{1, 2}, {4, 5}, {5, 6}}) {
    if (slant(i, j) < kApart) fault("axes ", i, " and ", j, " are parallel (", slant(i, j), " rad apart)");
  }
  Vector3d centre = o[4];
  if (slant(4, 5) >= kApart) {
    const Vector3d normal = h[3].cross(h[4]), from = o[4] - o[3];
    const double miss = std::abs(normal.dot(from)) / normal.norm();
    if (miss > kMeet * size) fault("axes 4 and 5 miss each other by ", miss, " m");
    centre += h[4] * h[3].cross(from).dot(-normal) / normal.squaredNorm();  // on axis 5, closest to axis 4
    const double distance = h[5].cross(centre - o[5]).norm();
    if (distance > kMeet * size) fault("axis 6 misses the point where axes 4 and 5 meet by ", distance, " m");
  }

  // Shoulder: z along axis 1, axis 2 leant towards x. Its own axes, of the planar arm, have z along axis 2.
  const double lean = angle_between(h[0], h[1]);
  const Matrix3d shoulder = axes_along(h[0], h[1]);
  Matrix3d plane;
  plane << shoulder * Vector3d(std::cos(lean), 0.0, -std::sin(lean)), shoulder.col(1), h[1];
  const Vector3d second = plane.transpose() * (o[1] - o[0]);
  const Vector3d upper = plane.transpose() * (o[2] - o[1]), fore = plane.transpose() * (centre - o[2]);
  elbow_.upper = upper.head<2>().norm();
  elbow_.fore = fore.head<2>().norm();
  if (faults.empty()) {
    const double least = kApart * (elbow_.upper + elbow_.fore);
    if (elbow_.upper <= least) fault("axes 2 and 3 are one line (", elbow_.upper, " m apart)");
    if (elbow_.fore <= least) fault("the wrist centre lies on axis 3 (", elbow_.fore, " m off)");
  }
  detail::require(faults.empty(),
                  "closed-form inverse kinematics needs a spherical wrist after parallel axes 2 and 3; '", chain.base(),
                  "' to '", chain.tip(), "': ", faults);

  const JointConstants& first = chain.constants()[0];
  shoulder_.from_base = (first.rotation * shoulder).transpose();
  shoulder_.origin = first.translation;
  shoulder_.c12 = std::cos(lean);
  shoulder_.s12 = std::sin(lean);
  shoulder_.height = second[2] + upper[2] + fore[2];
  shoulder_.x = second[0];
  shoulder_.y = second[1];
  elbow_.sign3 = h[1].dot(h[2]) > 0.0 ? 1.0 : -1.0;
  const double upper_angle = std::atan2(upper[1], upper[0]), fore_angle = std::atan2(fore[1], fore[0]);
  elbow_.zero2 = upper_angle;
  elbow_.zero3 = fore_angle - upper_angle;

  const Matrix3d wrist = axes_along(h[3], h[4]), hand = axes_along(h[4], h[5]);
  double angle45 = angle_between(h[3], h[4]), angle56 = angle_between(h[4], h[5]);
  // Axes 4 and 6 can be one line or cannot: rounding is not to decide.
  if (std::abs(angle45 - angle56) < kMeet) angle45 = angle56 = 0.5 * (angle45 + angle56);
  if (const double over = angle45 + angle56 - kPi; std::abs(over) < kMeet) {
    angle45 -= 0.5 * over;
    angle56 -= 0.5 * over;
  }
  Matrix3d fore_axes;  // x along the forearm
  fore_axes << plane * Vector3d(std::cos(fore_angle), std::sin(fore_angle), 0.0),
      plane * Vector3d(-std::sin(fore_angle), std::cos(fore_angle), 0.0), h[1];
  wrist_.from_fore = wrist.transpose() * fore_axes;
  wrist_.c45 = std::cos(angle45);
  wrist_.s45 = std::sin(angle45);
  wrist_.c56 = std::cos(angle56);
  wrist_.s56 = std::sin(angle56);
  wrist_.c_sum = std::cos(0.5 * (angle45 + angle56));
  wrist_.s_sum = std::sin(0.5 * (angle45 + angle56));
  wrist_.c_diff = std::cos(0.5 * (angle45 - angle56));
  wrist_.s_diff = std::sin(0.5 * (angle45 - angle56));
  wrist_.perpendicular = std::abs(wrist_.c45) < 1e-15 && std::abs(wrist_.c56) < 1e-15;
  // From x of axes 5 as seen from 4 to x of axes 5 as seen from 6, both normal to axis 5.
  const Vector3d leaving = wrist * Vector3d(wrist_.c45, 0.0, -wrist_.s45);
  wrist_.zero5 = std::atan2(wrist.col(1).dot(hand.col(0)), leaving.dot(hand.col(0)));

  const Vector3d hand_x = hand * Vector3d(wrist_.c56, 0.0, -wrist_.s56);
  tip_ << at.inverse() * centre, at.linear().transpose() * hand_x, at.linear().transpose() * h[5];
  reach_ = second.norm() + upper.norm() + fore.norm();
  tolerance_ = kMerge * (size + first.translation.norm());
  lower_ = chain.limits().lower;
  upper_ = chain.limits().upper;
}

// Goes through the branches. A rule says where angles go: place() puts one on its turn, and adds to the branch's cost;
// free() tells one that the pose leaves open; hopeless() ends a branch early; done() takes one that is complete.
//
// Where branches are one to the tolerance, they are taken as one. That, and rounding close to there, moves the posture
// by up to a root of it, 1e-6; which is too far where the next stage is at the end of its own reach. Then both are
// tried apart, as given, and as near and as far as the tolerance hides. Each stage returns whether anything came of it.
struct AnalyticWalk {
  struct Branch : AnalyticBranch {
    double cost = 0.0;
  };

  const AnalyticIk& ik;

  template <typename Rule>
  void run(const Pose& pose, Rule& rule) const noexcept {
    const Matrix3d rotation = orthonormal(pose.linear());
    const Matrix3d seen = ik.shoulder_.from_base.lazyProduct(rotation).lazyProduct(ik.tip_);
    const Vector3d centre = ik.shoulder_.from_base.lazyProduct(pose.translation() - ik.shoulder_.origin) + seen.col(0);
    const double reach = ik.reach_ + ik.tolerance_;
    if (!(centre.squaredNorm() <= reach * reach)) return;
    shoulders(centre, seen.col(1), seen.col(2), rule);
  }

 private:
  static constexpr int kTries = 32;  // of a free angle

  // `wish`, then angles further and further from it, all around.
  static double attempt(double wish, int i) noexcept {
    const int k = (i + 1) / 2;
    return wish + (i % 2 == 0 ? k : -k) * (kTurn / kTries);
  }

  // Both ways of a stage, the cheaper one first. `gap` is the distance to where they are one; way(i, spread(gap),
  // branch) starts the i-th.
  template <typename Way, typename Rule, typename Spread, typename Start, typename Next>
  static bool both(double gap, double tolerance, bool close, const Rule& rule, Spread spread, Start way,
                   Next next) noexcept {
    Way ways[2];
    Branch branches[2];
    const auto given = spread(gap > 0.0 ? gap : gap + tolerance);
    for (int i = 0; i < 2; ++i) ways[i] = way(i, given, branches[i]);
    const int first = branches[1].cost < branches[0].cost ? 1 : 0;
    bool any = false;
    for (const int i : {first, 1 - first}) {
      bool reached = rule.hopeless(branches[i]) || next(ways[i], branches[i]);
      for (const double other : {gap - tolerance, gap + tolerance}) {
        if (reached || !close || other <= 0.0) continue;
        Branch branch;
        const Way moved = way(i, spread(other), branch);
        reached = rule.hopeless(branch) || next(moved, branch);
      }
      any = any || reached;
    }
    return any;
  }

  // axis 2 · R1ᵀ centre = height: a cos q1 + b sin q1 = along.
  template <typename Rule>
  bool shoulders(const Vector3d& centre, const Vector3d& hand_x, const Vector3d& hand_z, Rule& rule) const noexcept {
    const auto& s = ik.shoulder_;
    const double a = centre[0], b = centre[1], radius = std::sqrt(a * a + b * b);
    const double along = (s.height - s.c12 * centre[2]) / s.s12;
    const double gap = radius - std::abs(along);
    if (gap < -ik.tolerance_) return false;
    const bool one = gap <= ik.tolerance_;
    const double x = s.c12 * along - s.s12 * centre[2] - s.x;  // of the wrist centre from axis 2, in its normal plane

    struct Way {
      Turn turn;
      double y;
    };
    const auto next = [&](const Way& way, const Branch& branch) noexcept {
      const auto turned = [&](const Vector3d& v) { return back_y(s.c12, s.s12, back_z(way.turn, v)); };
      return elbows(x, way.y, turned(hand_x), turned(hand_z), rule, branch);
    };
    const auto begin = [&](const Turn& turn, double angle, Branch& branch) noexcept {
      branch.singular = one ? kShoulderSingular : 0;
      rule.place(0, angle, branch);
      return turn;
    };
    if (radius <= ik.tolerance_) {
      const double wish = rule.free(0);
      for (int i = 0; i < kTries; ++i) {
        const double angle = attempt(wish, i);
        Branch branch;
        const Turn turn = begin(Turn::of(angle), angle, branch);
        if (rule.hopeless(branch) || next(Way{turn, -s.y}, branch)) return true;
      }
      return false;
    }
    if (one) {
      const double scale = 1.0 / std::copysign(radius, along);
      const Turn turn{a * scale, b * scale};
      Branch branch;
      begin(turn, turn.angle(), branch);
      if (rule.hopeless(branch) || next(Way{turn, -s.y}, branch)) return true;
    }
    const auto spread = [&](double room) noexcept { return std::sqrt(room * (radius + std::abs(along))); };
    const auto start = [&](int i, double across, Branch& branch) noexcept {
      const double side = i == 0 ? -across : across;
      const Turn turn = between(along, side, a, b);
      return Way{begin(turn, turn.angle(), branch), side - s.y};
    };
    return both<Way>(gap, ik.tolerance_, gap < kClose * radius, rule, spread, start, next);
  }

  // (x, y) = R(q2) (upper + R(q3) fore). Half of the elbow's angle, from distances to the ends of the reach, keeps its
  // digits there.
  template <typename Rule>
  bool elbows(double x, double y, const Vector3d& hand_x, const Vector3d& hand_z, Rule& rule,
              const Branch& base) const noexcept {
    const auto& e = ik.elbow_;
    const double distance = std::sqrt(x * x + y * y);
    const double longest = e.upper + e.fore, shortest = std::abs(e.upper - e.fore);
    const double inside = longest - distance, outside = distance - shortest;
    if (inside < -ik.tolerance_ || outside < -ik.tolerance_) return false;
    const bool stretched = inside <= ik.tolerance_, folded = outside <= ik.tolerance_, one = stretched || folded;

    struct Way {
      Turn turn2, turn3;
    };
    const auto next = [&](const Way& way, const Branch& branch) noexcept {
      const Turn turn = way.turn2 * way.turn3;
      return wrists(ik.wrist_.from_fore.lazyProduct(back_z(turn, hand_x)),
                    ik.wrist_.from_fore.lazyProduct(back_z(turn, hand_z)), rule, branch);
    };
    const auto begin = [&](const Turn& turn2, double angle2, const Turn& turn3, double bend, Branch& branch) noexcept {
      branch = base;
      if (one) branch.singular |= kElbowSingular;
      rule.place(1, angle2, branch);
      rule.place(2, e.sign3 * (bend - e.zero3), branch);
      return Way{turn2, turn3};
    };
    const auto bent = [&](const Turn& turn3, double bend, Branch& branch) noexcept {
      const Turn turn2 = between(e.upper + e.fore * turn3.c, e.fore * turn3.s, x, y);
      return begin(turn2, turn2.angle() - e.zero2, turn3, bend, branch);
    };
    if (distance <= ik.tolerance_) {
      const double wish = rule.free(1);
      for (int i = 0; i < kTries; ++i) {
        const double angle = attempt(wish, i);
        Branch branch;
        const Way way = begin(Turn::of(angle + e.zero2), angle, {-1.0, 0.0}, kPi, branch);
        if (rule.hopeless(branch) || next(way, branch)) return true;
      }
      return false;
    }
    if (one) {
      Branch branch;
      const Way way = folded ? bent({-1.0, 0.0}, kPi, branch) : bent({1.0, 0.0}, 0.0, branch);
      if (rule.hopeless(branch) || next(way, branch)) return true;
    }
    struct Bend {
      Turn turn;
      double angle;
    };
    const bool nearly_folded = outside < inside;
    const double gap = nearly_folded ? outside : inside;
    const auto spread = [&](double room) noexcept {
      const Turn half = half_turn((nearly_folded ? room : outside) * (distance + shortest),
                                  (nearly_folded ? inside : room) * (longest + distance));
      return Bend{half * half, 2.0 * half.angle()};
    };
    const auto start = [&](int i, const Bend& bend, Branch& branch) noexcept {
      return i == 0 ? bent(bend.turn, bend.angle, branch) : bent(bend.turn.inverse(), -bend.angle, branch);
    };
    return both<Way>(gap, ik.tolerance_, gap < kClose * longest, rule, spread, start, next);
  }

  // Rz(q4) Ry(45) Rz(q5) Ry(56) Rz(q6) = [x · z]. The spherical triangle of axes 4, 5, 6: half of q5 from its sides.
  template <typename Rule>
  bool wrists(const Vector3d& x, const Vector3d& z, Rule& rule, const Branch& base) const noexcept {
    const auto& w = ik.wrist_;
    const double sine = std::sqrt(z[0] * z[0] + z[1] * z[1]);  // of the angle from axis 4 to axis 6
    Turn side;                                                 // half of it
    if (z[2] >= 0.0) {
      side.c = std::sqrt(0.5 + 0.5 * z[2]);
      side.s = 0.5 * sine / side.c;
    } else {
      side.s = std::sqrt(0.5 - 0.5 * z[2]);
      side.c = 0.5 * sine / side.s;
    }
    // sin of half of: sum ± side, side ± difference of the other two sides
    const double sum_plus = w.s_sum * side.c + w.c_sum * side.s, sum_minus = w.s_sum * side.c - w.c_sum * side.s;
    const double diff_plus = side.s * w.c_diff + side.c * w.s_diff, diff_minus = side.s * w.c_diff - side.c * w.s_diff;
    const double least_sum = std::min(sum_plus, sum_minus), least_diff = std::min(diff_plus, diff_minus);
    if (least_sum < -kMerge || least_diff < -kMerge) return false;
    Turn half;  // of q5
    const bool one = least_sum <= kMerge || least_diff <= kMerge;
    if (least_diff <= kMerge) {
      half = {0.0, 1.0};
    } else if (!one) {
      half = half_turn(diff_plus * diff_minus, sum_plus * sum_minus);
    }
    const double bend = 2.0 * half.angle();
    Turn turn5 = half * half;
    double angle4 = 0.0, angle6 = 0.0;
    for (int i = 0; i < (one ? 1 : 2); ++i) {
      Branch branch = base;
      if (one) branch.singular |= kWristSingular;
      if (i == 1 && w.perpendicular) {  // the other way round is half a turn off at both ends
        angle4 -= std::copysign(kPi, angle4);
        angle6 -= std::copysign(kPi, angle6);
      } else {
        Turn turn4;
        if (one && sine <= 4.0 * kMerge) {  // axes 4 and 6 are one line
          angle4 = rule.free(3);
          turn4 = Turn::of(angle4);
        } else {
          turn4 = between(w.c45 * w.s56 * turn5.c + w.s45 * w.c56, w.s56 * turn5.s, z[0], z[1]);
          angle4 = turn4.angle();
        }
        // From what is left, so that it makes up for joint 4 where the two are nearly one.
        const Vector3d left = back_z(turn5, back_y(w.c45, w.s45, back_z(turn4, x)));
        angle6 = angle_of(w.c56 * left[0] - w.s56 * left[2], left[1]);
      }
      rule.place(3, angle4, branch);
      rule.place(4, (i == 0 ? bend : -bend) - w.zero5, branch);
      rule.place(5, angle6, branch);
      rule.done(branch);
      turn5 = turn5.inverse();
    }
    return true;
  }
};

namespace {

// On the turn nearest to `near` within [lower, upper]; where there is none, nearest to `near`, and false.
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

// Every branch, by the turns nearest to 0.
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

// The one branch nearest to q.
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
  // Costs only grow, and what is outside the limits stays outside.
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
