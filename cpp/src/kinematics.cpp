#include <sigmaik/kinematics.hpp>

#include "walk.hpp"

namespace sigmaik {
namespace {

using detail::FrameColumns;

// To the tip.
template <typename Visit>
Pose walk_to_tip(const Chain& chain, const JointRef& q, Visit joint) noexcept {
  FrameColumns f = detail::walk(chain, q, joint);
  f.append(chain.tool().linear(), chain.tool().translation());
  Pose tip;
  tip.matrix() << f.x, f.y, f.z, f.p;
  tip.makeAffine();
  return tip;
}

}  // namespace

bool update(const Chain& chain, const JointRef& q, ChainState& state) noexcept {
  if (q.size() != chain.dof() || !q.allFinite()) return false;
  state.jacobian.resize(6, chain.dof());
  double* const columns = state.jacobian.data();
  state.tip = walk_to_tip(chain, q, [columns](int i, const FrameColumns& f) {
    for (int k = 0; k < 3; ++k) {
      columns[6 * i + k] = f.p[k];  // v follows when the tip is known
      columns[6 * i + 3 + k] = f.z[k];
    }
  });
  const Eigen::Vector3d tip = state.tip.translation();
  for (int i = 0; i < chain.dof(); ++i) {
    auto column = state.jacobian.col(i);
    const Eigen::Vector3d axis = column.tail<3>();
    if (chain.constants()[static_cast<std::size_t>(i)].prismatic) {
      column << axis, Eigen::Vector3d::Zero();
    } else {
      column.head<3>() = axis.cross(tip - column.head<3>());
    }
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
    const Eigen::Vector3d v_k = jacobian.col(k).head<3>(), w_k = jacobian.col(k).tail<3>();
    for (Eigen::Index i = 0; i < n; ++i) {
      const Eigen::Vector3d v_i = jacobian.col(i).head<3>(), w_i = jacobian.col(i).tail<3>();
      if (k <= i) {
        d.col(i) << w_k.cross(v_i), w_k.cross(w_i);
      } else {
        d.col(i) << w_i.cross(v_k), Eigen::Vector3d::Zero();
      }
    }
  }
}

}  // namespace sigmaik
