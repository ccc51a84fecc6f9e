#include <sigmaik/dynamics.hpp>

#include <cmath>
#include <string>

#include <Eigen/Cholesky>
#include <kdl/chaindynparam.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>

#include <sigmaik/kdl.hpp>

#include "message.hpp"
#include "rigid_body.hpp"

namespace sigmaik {
namespace {

// KDL's arrays belong to the Eigen that KDL's library was compiled with: their storage may be less aligned than the
// options of this file promise (-mavx), and padded otherwise (AddressSanitizer). So KDL's library allocates and frees
// them, and they are read and written through maps that assume no alignment.
Eigen::Map<Eigen::VectorXd> entries(KDL::JntArray& array) { return {array.data.data(), array.data.size()}; }
Eigen::Map<Eigen::MatrixXd> entries(KDL::JntSpaceInertiaMatrix& matrix) {
  return {matrix.data.data(), matrix.data.rows(), matrix.data.cols()};
}

KDL::JntArray joints(const JointRef& values, int n, const char* what) {
  detail::require(values.size() == n, what, " has ", values.size(), " entries, the chain ", n, " joints");
  KDL::JntArray array(static_cast<unsigned>(n));
  entries(array) = values;
  return array;
}

}  // namespace

struct Dynamics::Model {
  KDL::Chain chain;  // declared before the solvers, which keep a reference to the chain
  KDL::ChainDynParam solver;
  KDL::ChainIdSolver_RNE recursion;
  int dof;
  KDL::JntArray q, qdot, qddot, torque;  // memory of the real-time calls
  KDL::JntSpaceInertiaMatrix mass;
  const KDL::Wrenches no_wrenches;
  DynamicsTerms terms;

  Model(const Chain& arm, const KDL::Vector& gravity, const std::optional<Inertia>& payload)
      : chain(loaded(arm, payload)),
        solver(chain, gravity),
        recursion(chain, gravity),
        dof(arm.dof()),
        q(size()),
        qdot(size()),
        qddot(size()),
        torque(size()),
        mass(size()),
        no_wrenches(chain.getNrOfSegments(), KDL::Wrench::Zero()) {}
  unsigned size() const { return static_cast<unsigned>(dof); }

  // The payload becomes an additional link that is fixed to the tip.
  static KDL::Chain loaded(const Chain& arm, const std::optional<Inertia>& payload) {
    KDL::Chain chain = to_kdl(arm);
    if (payload) {
      chain.addSegment(KDL::Segment("payload", KDL::Joint(KDL::Joint::None), KDL::Frame::Identity(), to_kdl(*payload)));
    }
    return chain;
  }

  // Torques for the members q, qdot and qddot.
  Eigen::Map<Eigen::VectorXd> recurse() {
    recursion.CartToJnt(q, qdot, qddot, no_wrenches, torque);
    return entries(torque);
  }
};

Dynamics::Dynamics(const Chain& chain, const Eigen::Vector3d& gravity, const std::optional<Inertia>& payload) {
  detail::require(gravity.allFinite(), "gravity has an entry that is not finite");
  if (payload) {
    const std::string defect = detail::inertia_defect(*payload);
    detail::require(defect.empty(), "payload: ", defect);
  }
  std::string waiting;  // the last movable joint, if no link after the joint has an inertia yet
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
  if (payload && payload->mass > 0.0) waiting.clear();
  check();
  model_ = std::make_unique<Model>(chain, KDL::Vector(gravity.x(), gravity.y(), gravity.z()), payload);
}

Dynamics::~Dynamics() = default;
Dynamics::Dynamics(Dynamics&&) noexcept = default;
Dynamics& Dynamics::operator=(Dynamics&&) noexcept = default;

int Dynamics::dof() const noexcept { return model_->dof; }

void Dynamics::evaluate(const JointRef& q, const JointRef& qdot, DynamicsTerms& terms) noexcept {
  Model& m = *model_;
  entries(m.q) = q;
  entries(m.qdot) = qdot;
  m.solver.JntToMass(m.q, m.mass);
  terms.mass = entries(m.mass);
  entries(m.qddot).setZero();
  terms.bias = m.recurse();
}

void Dynamics::inverse_dynamics(const JointRef& q, const JointRef& qdot, const JointRef& qddot,
                                JointVector& torque) noexcept {
  Model& m = *model_;
  entries(m.q) = q;
  entries(m.qdot) = qdot;
  entries(m.qddot) = qddot;
  torque = m.recurse();
}

bool Dynamics::forward_dynamics(const JointRef& q, const JointRef& qdot, const JointRef& torque,
                                JointVector& qddot) noexcept {
  DynamicsTerms& terms = model_->terms;
  evaluate(q, qdot, terms);
  const Eigen::LLT<JointMatrix> factor(terms.mass);
  const bool definite = factor.info() == Eigen::Success;
  qddot = JointVector::Zero(dof());
  if (definite) qddot = factor.solve(torque - terms.bias);
  return definite;
}

JointMatrix Dynamics::mass_matrix(const JointRef& q) const {
  KDL::JntSpaceInertiaMatrix mass(model_->size());
  model_->solver.JntToMass(joints(q, model_->dof, "q"), mass);
  return entries(mass);
}

JointVector Dynamics::coriolis(const JointRef& q, const JointRef& qdot) const {
  KDL::JntArray torque(model_->size());
  model_->solver.JntToCoriolis(joints(q, model_->dof, "q"), joints(qdot, model_->dof, "qdot"), torque);
  return entries(torque);
}

JointVector Dynamics::gravity(const JointRef& q) const {
  KDL::JntArray torque(model_->size());
  model_->solver.JntToGravity(joints(q, model_->dof, "q"), torque);
  return entries(torque);
}

}  // namespace sigmaik
