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

}  // namespace

struct Dynamics::Model {
  Chain arm;  // as given, for copies
  Eigen::Vector3d given_gravity;
  std::optional<Inertia> given_payload;
  KDL::Chain chain;  // declared before the solvers, which keep a reference to the chain
  KDL::ChainDynParam solver;
  KDL::ChainIdSolver_RNE recursion;
  // With joints that mimic others, θ = A q + offset are the positions of all joints that move, which KDL knows: then
  // τ = Aᵀ τ_θ and M = Aᵀ M_θ A (the principle of virtual work).
  bool mimics;
  int dof;
  JointMatrix coupling;
  JointVector offset;
  KDL::JntArray q, qdot, qddot, torque;  // memory of the real-time calls
  KDL::JntSpaceInertiaMatrix mass;
  const KDL::Wrenches no_wrenches;
  DynamicsTerms terms;

  Model(const Chain& of, const Eigen::Vector3d& gravity, const std::optional<Inertia>& payload)
      : arm(of),
        given_gravity(gravity),
        given_payload(payload),
        chain(loaded(arm, payload)),
        solver(chain, KDL::Vector(gravity.x(), gravity.y(), gravity.z())),
        recursion(chain, KDL::Vector(gravity.x(), gravity.y(), gravity.z())),
        mimics(arm.has_mimics()),
        dof(arm.dof()),
        coupling(arm.coupling_matrix()),
        offset(arm.moving()),
        q(size()),
        qdot(size()),
        qddot(size()),
        torque(size()),
        mass(size()),
        no_wrenches(chain.getNrOfSegments(), KDL::Wrench::Zero()) {
    for (int i = 0; i < arm.moving(); ++i) offset[i] = arm.couplings()[static_cast<std::size_t>(i)].offset;
  }
  unsigned size() const { return static_cast<unsigned>(coupling.rows()); }

  void put_positions(const JointRef& from, KDL::JntArray& to) const {
    put(from, to);
    if (mimics) entries(to) += offset;
  }
  // Velocities or accelerations.
  void put(const JointRef& from, KDL::JntArray& to) const {
    if (mimics) {
      entries(to) = coupling.lazyProduct(from);
    } else {
      entries(to) = from;
    }
  }
  JointVector torque_of(const Eigen::Map<Eigen::VectorXd>& from) const {
    return mimics ? JointVector(coupling.transpose().lazyProduct(from)) : JointVector(from);
  }
  JointMatrix mass_of(const Eigen::Map<Eigen::MatrixXd>& from) const {
    if (!mimics) return from;
    const JointMatrix half = from.lazyProduct(coupling), whole = coupling.transpose().lazyProduct(half);
    return 0.5 * (whole + whole.transpose());
  }
  KDL::JntArray checked(const JointRef& values, const char* what, bool positions) const {
    detail::require(values.size() == dof, what, " has ", values.size(), " entries, the chain ", dof, " joints");
    KDL::JntArray array(size());
    positions ? put_positions(values, array) : put(values, array);
    return array;
  }

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
  model_ = std::make_unique<Model>(chain, gravity, payload);
}

// KDL's solvers refer to their chain: a copy has solvers of its own.
Dynamics::Dynamics(const Dynamics& other)
    : model_(std::make_unique<Model>(other.model_->arm, other.model_->given_gravity, other.model_->given_payload)) {}
Dynamics& Dynamics::operator=(const Dynamics& other) {
  if (this != &other) *this = Dynamics(other);
  return *this;
}

Dynamics::~Dynamics() = default;
Dynamics::Dynamics(Dynamics&&) noexcept = default;
Dynamics& Dynamics::operator=(Dynamics&&) noexcept = default;

int Dynamics::dof() const noexcept { return model_->dof; }
const Chain& Dynamics::chain() const noexcept { return model_->arm; }
const Eigen::Vector3d& Dynamics::gravity() const noexcept { return model_->given_gravity; }
const std::optional<Inertia>& Dynamics::payload() const noexcept { return model_->given_payload; }

void Dynamics::evaluate(const JointRef& q, const JointRef& qdot, DynamicsTerms& terms) noexcept {
  Model& m = *model_;
  m.put_positions(q, m.q);
  m.put(qdot, m.qdot);
  m.solver.JntToMass(m.q, m.mass);
  terms.mass = m.mass_of(entries(m.mass));
  entries(m.qddot).setZero();
  terms.bias = m.torque_of(m.recurse());
}

void Dynamics::inverse_dynamics(const JointRef& q, const JointRef& qdot, const JointRef& qddot,
                                JointVector& torque) noexcept {
  Model& m = *model_;
  m.put_positions(q, m.q);
  m.put(qdot, m.qdot);
  m.put(qddot, m.qddot);
  torque = m.torque_of(m.recurse());
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
  model_->solver.JntToMass(model_->checked(q, "q", true), mass);
  return model_->mass_of(entries(mass));
}

JointVector Dynamics::coriolis(const JointRef& q, const JointRef& qdot) const {
  KDL::JntArray torque(model_->size());
  model_->solver.JntToCoriolis(model_->checked(q, "q", true), model_->checked(qdot, "qdot", false), torque);
  return model_->torque_of(entries(torque));
}

JointVector Dynamics::gravity(const JointRef& q) const {
  KDL::JntArray torque(model_->size());
  model_->solver.JntToGravity(model_->checked(q, "q", true), torque);
  return model_->torque_of(entries(torque));
}

}  // namespace sigmaik
