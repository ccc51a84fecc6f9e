#include <sigmaik/kinematics.hpp>

#include "walk.hpp"

namespace sigmaik {
namespace {

using detail::FrameColumns;

// Walks along the whole chain, to the tip.
template <typename Visit>
Pose walk_to_tip(const Chain& chain, const JointRef& q, Visit joint) noexcept {
  FrameColumns f = detail::walk(chain, q, joint);
  f.append(chain.tool().linear(), chain.tool().translation());
  Pose tip;
  tip.matrix() << f.x, f.y, f.z, f.p;
  tip.makeAffine();
  return tip;
}

// a × b. (Eigen's cross of the columns of an unaligned matrix takes a third more time.)
void cross(const double* a, const double* b, double* out) noexcept {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

// The tip's pose and the Jacobian of all joints that move, with those that mimic others.
Pose columns_of_moving(const Chain& chain, const JointRef& q, Jacobian& jacobian) noexcept {
  jacobian.resize(6, chain.moving());
  double* const columns = jacobian.data();
  const Pose pose = walk_to_tip(chain, q, [columns](int i, const FrameColumns& f) {
    for (int k = 0; k < 3; ++k) {
      columns[6 * i + k] = f.p[k];  // v follows when the tip is known
      columns[6 * i + 3 + k] = f.z[k];
    }
  });
  const double* const tip = pose.matrix().data() + 12;
  for (int i = 0; i < chain.moving(); ++i) {
    double* const v = columns + 6 * i;
    double* const axis = v + 3;
    if (chain.constants()[static_cast<std::size_t>(i)].prismatic) {
      for (int k = 0; k < 3; ++k) {
        v[k] = axis[k];
        axis[k] = 0.0;
      }
    } else {
      const double lever[] = {tip[0] - v[0], tip[1] - v[1], tip[2] - v[2]};
      cross(axis, lever, v);
    }
  }
  return pose;
}

// J A: the sum of the columns of the joints that move with each joint of q.
void gather(const Chain& chain, const Jacobian& moving, Jacobian& out) noexcept {
  out.setZero(6, chain.dof());
  for (int i = 0; i < chain.moving(); ++i) {
    const Coupling& c = chain.couplings()[static_cast<std::size_t>(i)];
    out.col(c.joint) += c.multiplier * moving.col(i);
  }
}

}  // namespace

bool update(const Chain& chain, const JointRef& q, ChainState& state) noexcept {
  if (q.size() != chain.dof() || !q.allFinite()) return false;
  if (chain.has_mimics()) {
    Jacobian moving;
    state.tip = columns_of_moving(chain, q, moving);
    gather(chain, moving, state.jacobian);
  } else {
    state.tip = columns_of_moving(chain, q, state.jacobian);
  }
  return true;
}

Pose pose(const Chain& chain, const JointRef& q) noexcept {
  return walk_to_tip(chain, q, [](int, const FrameColumns&) {});
}

void jacobian_gradient(const Jacobian& jacobian, JacobianGradient& gradient) noexcept {
  const auto n = jacobian.cols();
  for (Eigen::Index k = 0; k < n; ++k) {
    Jacobian& d = gradient[static_cast<std::size_t>(k)];
    d.resize(6, n);
    const double* const of_k = jacobian.data() + 6 * k;
    for (Eigen::Index i = 0; i < n; ++i) {
      const double* const of_i = jacobian.data() + 6 * i;
      double* const out = d.data() + 6 * i;
      if (k <= i) {
        cross(of_k + 3, of_i, out);
        cross(of_k + 3, of_i + 3, out + 3);
      } else {
        cross(of_i + 3, of_k, out);
        out[3] = out[4] = out[5] = 0.0;
      }
    }
  }
}

// ∂(J A)/∂q_k = Σ_b A_bk (∂J/∂θ_b) A, with θ = A q + offsets.
void jacobian_gradient(const Chain& chain, const JointRef& q, const Jacobian& jacobian,
                       JacobianGradient& gradient) noexcept {
  if (!chain.has_mimics()) return jacobian_gradient(jacobian, gradient);
  Jacobian moving, part;
  columns_of_moving(chain, q, moving);
  JacobianGradient of_moving;
  jacobian_gradient(moving, of_moving);
  for (int k = 0; k < chain.dof(); ++k) gradient[static_cast<std::size_t>(k)].setZero(6, chain.dof());
  for (int b = 0; b < chain.moving(); ++b) {
    const auto at = static_cast<std::size_t>(b);
    gather(chain, of_moving[at], part);
    const Coupling& c = chain.couplings()[at];
    gradient[static_cast<std::size_t>(c.joint)] += c.multiplier * part;
  }
}

}  // namespace sigmaik
