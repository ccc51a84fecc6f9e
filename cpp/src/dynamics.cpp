#include <sigmaik/dynamics.hpp>

#include <string>

#include <kdl/chaindynparam.hpp>

#include <sigmaik/kdl.hpp>

#include "message.hpp"

namespace sigmaik {
namespace {

KDL::JntArray joints(const Eigen::VectorXd& values, int n, const char* what) {
  detail::require(values.size() == n, what, " has ", values.size(), " entries, the chain ", n, " joints");
  KDL::JntArray array;
  array.data = values;
  return array;
}

}  // namespace

struct Dynamics::Model {
  KDL::Chain chain;  // before the solver, which keeps a reference
  KDL::ChainDynParam solver;
  int dof;
  KDL::JntArray q, qdot, torque;  // scratch of evaluate()
  KDL::JntSpaceInertiaMatrix mass;

  Model(const Chain& arm, const Eigen::Vector3d& gravity)
      : chain(to_kdl(arm)),
        solver(chain, KDL::Vector(gravity.x(), gravity.y(), gravity.z())),
        dof(arm.dof()),
        q(size()),
        qdot(size()),
        torque(size()),
        mass(size()) {}
  unsigned size() const { return static_cast<unsigned>(dof); }
};

Dynamics::Dynamics(const Chain& chain, const Eigen::Vector3d& gravity) {
  std::string waiting;  // a movable joint whose links so far have no inertia
  const auto check = [&] {
    detail::require(waiting.empty(), "joint '", waiting, "' carries no link whose inertia is known: no dynamics");
  };
  for (const Segment& s : chain.segments()) {
    if (s.type != JointType::Fixed) {
      check();
      waiting = s.joint_name;
    }
    if (s.inertia) waiting.clear();
  }
  check();
  model_ = std::make_unique<Model>(chain, gravity);
}

Dynamics::~Dynamics() = default;
Dynamics::Dynamics(Dynamics&&) noexcept = default;
Dynamics& Dynamics::operator=(Dynamics&&) noexcept = default;

int Dynamics::dof() const noexcept { return model_->dof; }

void Dynamics::evaluate(const JointRef& q, const JointRef& qdot, DynamicsTerms& terms) noexcept {
  Model& m = *model_;
  m.q.data = q;
  m.qdot.data = qdot;
  m.solver.JntToMass(m.q, m.mass);
  terms.mass = m.mass.data;
  m.solver.JntToCoriolis(m.q, m.qdot, m.torque);
  terms.bias = m.torque.data;
  m.solver.JntToGravity(m.q, m.torque);
  terms.bias += m.torque.data;
}

Eigen::MatrixXd Dynamics::mass_matrix(const Eigen::VectorXd& q) const {
  KDL::JntSpaceInertiaMatrix mass(model_->size());
  model_->solver.JntToMass(joints(q, model_->dof, "q"), mass);
  return mass.data;
}

Eigen::VectorXd Dynamics::coriolis(const Eigen::VectorXd& q, const Eigen::VectorXd& qdot) const {
  KDL::JntArray torque(model_->size());
  model_->solver.JntToCoriolis(joints(q, model_->dof, "q"), joints(qdot, model_->dof, "qdot"), torque);
  return torque.data;
}

Eigen::VectorXd Dynamics::gravity(const Eigen::VectorXd& q) const {
  KDL::JntArray torque(model_->size());
  model_->solver.JntToGravity(joints(q, model_->dof, "q"), torque);
  return torque.data;
}

}  // namespace sigmaik
