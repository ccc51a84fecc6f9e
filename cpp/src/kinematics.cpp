#include <sigmaik/kinematics.hpp>

#include <cmath>

namespace sigmaik {
namespace {

// Walks from the base to the tip. `joint(i, rotation, position)` sees every joint's frame, whose z is its axis.
template <typename Visit>
Pose walk(const Chain& chain, const JointRef& q, Visit joint) noexcept {
  const auto& constants = chain.constants();
  Eigen::Matrix3d r = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  for (int i = 0; i < chain.dof(); ++i) {
    const JointConstants& c = constants[static_cast<std::size_t>(i)];
    p += r * c.translation;
    r = r * c.rotation;
    if (c.prismatic) {
      p += q[i] * r.col(2);
    } else {
      const double cosine = std::cos(q[i]), sine = std::sin(q[i]);
      const Eigen::Vector3d x = r.col(0);
      r.col(0) = cosine * x + sine * r.col(1);
      r.col(1) = cosine * r.col(1) - sine * x;
    }
    joint(i, r, p);
  }
  Pose tip;
  tip.linear() = r * chain.tool().linear();
  tip.translation() = p + r * chain.tool().translation();
  tip.makeAffine();
  return tip;
}

}  // namespace

bool update(const Chain& chain, const JointRef& q, ChainState& state) noexcept {
  if (q.size() != chain.dof() || !q.allFinite()) return false;
  state.jacobian.resize(6, chain.dof());
  state.tip = walk(chain, q, [&state](int i, const Eigen::Matrix3d& r, const Eigen::Vector3d& p) {
    state.jacobian.col(i) << p, r.col(2);  // v follows when the tip is known
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
  return walk(chain, q, [](int, const Eigen::Matrix3d&, const Eigen::Vector3d&) {});
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
