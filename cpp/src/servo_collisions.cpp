// Collisions change the rule's answer: rows bound the heading, and the stop after each command is verified.

#include <algorithm>
#include <memory>

#include <sigmaik/servo.hpp>

#include "collision_guard.hpp"
#include "message.hpp"
#include "owner.hpp"

namespace sigmaik {

namespace detail {
template class Owner<CollisionGuard>;
}

// The gain of an approach: a half of the bandwidth that the arm's limits leave a loop.
void Servo::set_collisions() {
  if (!options_.collisions) return;
  const Collisions& collisions = *options_.collisions;
  const Chain& covered = collisions.chain();
  bool same = covered.dof() == chain_.dof() && covered.joint_names() == chain_.joint_names();
  for (std::size_t i = 0; same && i < static_cast<std::size_t>(chain_.dof()); ++i) {
    const JointConstants &a = covered.constants()[i], &b = chain_.constants()[i];
    same = a.prismatic == b.prismatic && a.rotation.isApprox(b.rotation, 1e-9) &&
           (a.translation - b.translation).norm() <= 1e-9 * (1.0 + a.translation.norm());
  }
  detail::require(same, "collisions were made for another arm than the servo's: of ", covered.dof(), " joints to '",
                  covered.tip(), "'");
  const double bandwidth = solver_.length_scale() / solver_.pace().lag;
  guard_ = detail::Owner<detail::CollisionGuard>(
      std::make_unique<detail::CollisionGuard>(collisions.model(), 0.5 * bandwidth));
}

void Servo::look_around(ServoStep* step, double dt) noexcept {
  if (!guard_) return;
  if (step == nullptr) guard_->restart();
  guard_->look(tracker_.q(), dt);
  if (step == nullptr) return;
  step->clearance = guard_->clearance();
  const Proximity nearest = guard_->proximity();
  step->nearest = {static_cast<std::int16_t>(nearest.body), static_cast<std::int16_t>(nearest.other)};
}

// Whether the rows are met. Where they are not, the rows of collisions are those of redistribute().
bool Servo::clears(const JointVector& qdot) noexcept { return !guard_ || guard_->allows(qdot, tracker_); }

// The heading inside the bounds and the rows: solved with the rows that the last answer breaks, until none is broken.
void Servo::head_clear(const JointVector& asked, const VelocityBounds& heading, ServoStep& step) noexcept {
  constexpr int kPasses = 4;
  step.limited_by_collisions = true;
  step.qdot = asked;
  if (options_.on_limit == OnLimit::Scale) {
    double part = 1.0;
    for (int i = 0; i < guard_->rows(); ++i) {
      const double speed = guard_->row(i).dot(asked);
      if (speed * part > guard_->bound(i)) part = guard_->bound(i) / speed;
    }
    if (part >= 0.0) {
      step.qdot *= part;
      if (clears(step.qdot)) return;
    }
  }
  for (int pass = 0; pass < kPasses; ++pass) {
    step.qdot = redistribute(asked, heading, step);
    if (clears(step.qdot)) return;
  }
}

// Adds the rows of collisions to a problem in x = q̇ − begin, and slacks.
void Servo::add_clear_rows(const JointVector& begin) noexcept {
  const int count = guard_ ? guard_->rows() : 0;
  const auto n = begin.size();
  problem_.G.setZero(count, count > 0 ? problem_.C.cols() : 0);
  problem_.h.resize(count);
  for (int i = 0; i < count; ++i) {
    problem_.G.row(i).head(n) = guard_->row(i).transpose();
    problem_.h[i] = guard_->bound(i) - guard_->row(i).dot(begin);
  }
}

// The command is sent only where the arm can stop clear of everything after it.
bool Servo::shield(const JointVector& asked, ServoStep& step) noexcept {
  if (!guard_ || step.qdot == tracker_.stop() || !guard_->shield(tracker_, step.qdot)) return false;
  step.limited_by_collisions = true;
  judge(asked, step);
  return true;
}

}  // namespace sigmaik
