#pragma once
// The branches of a pose, for analytic_ik.cpp. The header analytic_ik.hpp names the frames.

#include <algorithm>
#include <cmath>
#include <numbers>

#include <sigmaik/analytic_ik.hpp>
#include <sigmaik/pose.hpp>

#include "turn.hpp"

namespace sigmaik {

// Enumerates the branches, stage by stage: shoulder (joint 1), elbow (joints 2 and 3), wrist (joints 4, 5, 6).
//
// A Rule decides what becomes of a branch: place() puts a joint angle on its turn and adds to the branch's cost; free()
// chooses an angle that the pose leaves free; hopeless() cuts a branch off early; done() receives a complete branch.
//
// Two branches that coincide within the tolerance are merged. The merge, and rounding close to the merge, moves the
// posture by up to the square root of the tolerance, 1e-6. This is too far if the next stage is at the limit of its own
// reach. Both branches are then tried separately: at the given distance from the singularity, and at the smallest and
// the largest distance that the tolerance allows. Each stage returns whether it has found a branch.
struct AnalyticWalk {
  using Matrix3d = Eigen::Matrix3d;
  using Vector3d = Eigen::Vector3d;
  using Turn = detail::Turn;

  // Two branches closer than this are one [rad, or part of the arm's size].
  static constexpr double kMerge = 1e-12;
  // Closer to the singularity than this part of the reach, rounding moves the two branches by more than itself.
  static constexpr double kClose = 1e-4;

  struct Branch : AnalyticBranch {
    double cost = 0.0;
  };

  const AnalyticIk& ik;

  template <typename Rule>
  void run(const Pose& pose, Rule& rule) const noexcept {
    const Matrix3d rotation = nearest_rotation(pose.linear());
    const Matrix3d seen = ik.shoulder_.from_base.lazyProduct(rotation).lazyProduct(ik.tip_);
    const Vector3d centre = ik.shoulder_.from_base.lazyProduct(pose.translation() - ik.shoulder_.origin) + seen.col(0);
    const double reach = ik.reach_ + ik.tolerance_;
    if (!(centre.squaredNorm() <= reach * reach)) return;
    shoulders(centre, seen.col(1), seen.col(2), rule);
  }

 private:
  static constexpr int kTries = 32;  // values tried of a free angle

  // The i-th value to try of a free angle: `wish`, then values further and further from `wish`, around the circle.
  static double attempt(double wish, int i) noexcept {
    const int k = (i + 1) / 2;
    return wish + (i % 2 == 0 ? k : -k) * (2.0 * std::numbers::pi / kTries);
  }

  // Tries both solutions of a stage, the cheaper one first. `gap` is the distance from the singularity at which the two
  // coincide; way(i, spread(gap), branch) starts the i-th solution, and next(way, branch) runs the next stage.
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

  // Joint 1: the wrist centre has the given height along axis 2, axis 2 · R1ᵀ centre = height, which is the equation
  // a cos q1 + b sin q1 = along.
  template <typename Rule>
  bool shoulders(const Vector3d& centre, const Vector3d& hand_x, const Vector3d& hand_z, Rule& rule) const noexcept {
    const auto& s = ik.shoulder_;
    const double a = centre[0], b = centre[1], radius = std::sqrt(a * a + b * b);
    const double along = (s.height - s.c12 * centre[2]) / s.s12;
    const double gap = radius - std::abs(along);
    if (gap < -ik.tolerance_) return false;
    const bool one = gap <= ik.tolerance_;
    const double x = s.c12 * along - s.s12 * centre[2] -
                     s.x;  // wrist centre from axis 2, in the plane normal to axis 2

    struct Way {
      Turn turn;
      double y;
    };
    const auto next = [&](const Way& way, const Branch& branch) noexcept {
      const auto turned = [&](const Vector3d& v) { return detail::back_y(s.c12, s.s12, detail::back_z(way.turn, v)); };
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
      const Turn turn = detail::between(along, side, a, b);
      return Way{begin(turn, turn.angle(), branch), side - s.y};
    };
    return both<Way>(gap, ik.tolerance_, gap < kClose * radius, rule, spread, start, next);
  }

  // Joints 2 and 3, the planar arm: (x, y) = R(q2) (upper + R(q3) fore). Half of the elbow's angle is computed from the
  // distances to the outer and the inner limit of the reach, which keeps all digits near these limits.
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
      return wrists(ik.wrist_.from_fore.lazyProduct(detail::back_z(turn, hand_x)),
                    ik.wrist_.from_fore.lazyProduct(detail::back_z(turn, hand_z)), rule, branch);
    };
    const auto begin = [&](const Turn& turn2, double angle2, const Turn& turn3, double bend, Branch& branch) noexcept {
      branch = base;
      if (one) branch.singular |= kElbowSingular;
      rule.place(1, angle2, branch);
      rule.place(2, e.sign3 * (bend - e.zero3), branch);
      return Way{turn2, turn3};
    };
    const auto bent = [&](const Turn& turn3, double bend, Branch& branch) noexcept {
      const Turn turn2 = detail::between(e.upper + e.fore * turn3.c, e.fore * turn3.s, x, y);
      return begin(turn2, turn2.angle() - e.zero2, turn3, bend, branch);
    };
    if (distance <= ik.tolerance_) {
      const double wish = rule.free(1);
      for (int i = 0; i < kTries; ++i) {
        const double angle = attempt(wish, i);
        Branch branch;
        const Way way = begin(Turn::of(angle + e.zero2), angle, {-1.0, 0.0}, std::numbers::pi, branch);
        if (rule.hopeless(branch) || next(way, branch)) return true;
      }
      return false;
    }
    if (one) {
      Branch branch;
      const Way way = folded ? bent({-1.0, 0.0}, std::numbers::pi, branch) : bent({1.0, 0.0}, 0.0, branch);
      if (rule.hopeless(branch) || next(way, branch)) return true;
    }
    struct Bend {
      Turn turn;
      double angle;
    };
    const bool nearly_folded = outside < inside;
    const double gap = nearly_folded ? outside : inside;
    const auto spread = [&](double room) noexcept {
      const Turn half = detail::half_turn((nearly_folded ? room : outside) * (distance + shortest),
                                          (nearly_folded ? inside : room) * (longest + distance));
      return Bend{half * half, 2.0 * half.angle()};
    };
    const auto start = [&](int i, const Bend& bend, Branch& branch) noexcept {
      return i == 0 ? bent(bend.turn, bend.angle, branch) : bent(bend.turn.inverse(), -bend.angle, branch);
    };
    return both<Way>(gap, ik.tolerance_, gap < kClose * longest, rule, spread, start, next);
  }

  // Joints 4, 5, 6: Rz(q4) Ry(α45) Rz(q5) Ry(α56) Rz(q6) = [x · z], the hand in the wrist's frame {4}. Axes 4, 5, 6
  // form a spherical triangle, whose sides give half of q5.
  template <typename Rule>
  bool wrists(const Vector3d& x, const Vector3d& z, Rule& rule, const Branch& base) const noexcept {
    const auto& w = ik.wrist_;
    const double sine = std::sqrt(z[0] * z[0] + z[1] * z[1]);  // of the angle from axis 4 to axis 6, the third side
    Turn side;                                                 // half of the third side
    if (z[2] >= 0.0) {
      side.c = std::sqrt(0.5 + 0.5 * z[2]);
      side.s = 0.5 * sine / side.c;
    } else {
      side.s = std::sqrt(0.5 - 0.5 * z[2]);
      side.c = 0.5 * sine / side.s;
    }
    // Sines of half of: α45 + α56 ± the third side, the third side ± (α45 − α56).
    const double sum_plus = w.s_sum * side.c + w.c_sum * side.s, sum_minus = w.s_sum * side.c - w.c_sum * side.s;
    const double diff_plus = side.s * w.c_diff + side.c * w.s_diff, diff_minus = side.s * w.c_diff - side.c * w.s_diff;
    const double least_sum = std::min(sum_plus, sum_minus), least_diff = std::min(diff_plus, diff_minus);
    if (least_sum < -kMerge || least_diff < -kMerge) return false;
    Turn half;  // of the angle of joint 5
    const bool one = least_sum <= kMerge || least_diff <= kMerge;
    if (least_diff <= kMerge) {
      half = {0.0, 1.0};
    } else if (!one) {
      half = detail::half_turn(diff_plus * diff_minus, sum_plus * sum_minus);
    }
    const double bend = 2.0 * half.angle();
    Turn turn5 = half * half;
    double angle4 = 0.0, angle6 = 0.0;
    for (int i = 0; i < (one ? 1 : 2); ++i) {
      Branch branch = base;
      if (one) branch.singular |= kWristSingular;
      if (i == 1 && w.perpendicular) {  // the second solution: joints 4 and 6 differ by half a turn
        angle4 -= std::copysign(std::numbers::pi, angle4);
        angle6 -= std::copysign(std::numbers::pi, angle6);
      } else {
        Turn turn4;
        if (one && sine <= 4.0 * kMerge) {  // axes 4 and 6 lie on one line
          angle4 = rule.free(3);
          turn4 = Turn::of(angle4);
        } else {
          turn4 = detail::between(w.c45 * w.s56 * turn5.c + w.s45 * w.c56, w.s56 * turn5.s, z[0], z[1]);
          angle4 = turn4.angle();
        }
        // From the rotation that is left, so that joint 6 compensates the error of joint 4 if both axes almost
        // coincide.
        const Vector3d left = detail::back_z(turn5, detail::back_y(w.c45, w.s45, detail::back_z(turn4, x)));
        angle6 = detail::angle_of(w.c56 * left[0] - w.s56 * left[2], left[1]);
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

}  // namespace sigmaik
