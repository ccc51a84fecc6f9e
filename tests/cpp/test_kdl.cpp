// KDL as the oracle: poses, Jacobians and their derivatives of random and of shipped arms; and the way to KDL and back.

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <random>

#include <kdl/chaindynparam.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainjnttojacsolver.hpp>

#include <sigmaik/error.hpp>
#include <sigmaik/kdl.hpp>
#include <sigmaik/kinematics.hpp>

namespace {

using sigmaik::Chain;
using sigmaik::JointType;
using sigmaik::JointVector;
using sigmaik::Pose;
using sigmaik::Segment;

constexpr unsigned kSeed = 7;
constexpr double kTolerance = 1e-12;  // m, and entries of rotations; chains are some 10 m long at most

// ---- Random arms ---------------------------------------------------------------------------------------------------

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  int integer(int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine_); }
  bool chance(double p) { return uniform(0.0, 1.0) < p; }
  Eigen::Vector3d vector(double size) { return {uniform(-size, size), uniform(-size, size), uniform(-size, size)}; }

  // Axes as arms have them: often a coordinate axis, sometimes almost a coordinate axis, of any length.
  Eigen::Vector3d axis() {
    Eigen::Vector3d axis = vector(1.0);
    if (chance(0.5)) {
      axis = Eigen::Vector3d::Unit(integer(0, 2)) * (chance(0.5) ? 1.0 : -1.0);
      if (chance(0.5)) axis += vector(std::pow(10.0, uniform(-17.0, -3.0)));
    }
    return axis * (chance(0.5) ? 1.0 : uniform(0.1, 10.0));
  }

  Pose pose() {
    Pose pose = Pose::Identity();
    if (chance(0.8)) {
      std::normal_distribution<double> normal;
      const Eigen::Vector4d wxyz = Eigen::Vector4d::NullaryExpr([&] { return normal(engine_); }).normalized();
      pose.linear() = Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]).toRotationMatrix();
    }
    if (chance(0.8)) pose.translation() = vector(1.0);
    return pose;
  }

  sigmaik::Inertia inertia() {
    const Eigen::Matrix3d root = Eigen::Matrix3d::NullaryExpr([this] { return uniform(-0.3, 0.3); });
    return {uniform(0.1, 10.0), vector(0.5), root * root.transpose()};
  }

  JointVector positions(int n) {
    return JointVector::NullaryExpr(n, [this] { return uniform(-3.2, 3.2); });
  }

 private:
  std::mt19937_64 engine_;
};

std::vector<Segment> random_segments(Random& random, int joints) {
  std::vector<Segment> segments;
  for (int movable = 0; movable < joints || random.chance(0.3);) {
    Segment s;
    s.joint_name = "j" + std::to_string(segments.size());
    s.link_name = "l" + std::to_string(segments.size());
    s.origin = random.pose();
    if (movable < joints && random.chance(0.7)) {
      const double kind = random.uniform(0.0, 1.0);
      s.type = kind < 0.6 ? JointType::Revolute : kind < 0.7 ? JointType::Continuous : JointType::Prismatic;
      s.axis = random.axis();
      ++movable;
    }
    if (random.chance(0.7)) s.inertia = random.inertia();
    segments.push_back(s);
  }
  return segments;
}

// ---- The oracle ----------------------------------------------------------------------------------------------------

KDL::Vector vector_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

KDL::Frame frame_of(const Pose& pose) {
  const Eigen::Matrix3d r = pose.linear();
  return {KDL::Rotation(r(0, 0), r(0, 1), r(0, 2), r(1, 0), r(1, 1), r(1, 2), r(2, 0), r(2, 1), r(2, 2)),
          vector_of(pose.translation())};
}

// The oracle does not use to_kdl(): each origin is a fixed segment, each joint is at zero.
KDL::Chain oracle(const std::vector<Segment>& segments) {
  KDL::Chain chain;
  for (const Segment& s : segments) {
    chain.addSegment(KDL::Segment("", KDL::Joint(KDL::Joint::None), frame_of(s.origin)));
    if (s.type == JointType::Fixed) continue;
    const bool slides = s.type == JointType::Prismatic;
    chain.addSegment(KDL::Segment(
        "", KDL::Joint(KDL::Vector::Zero(), vector_of(s.axis), slides ? KDL::Joint::TransAxis : KDL::Joint::RotAxis)));
  }
  return chain;
}

KDL::JntArray array_of(const JointVector& q) {
  KDL::JntArray array(static_cast<unsigned>(q.size()));
  array.data = q;
  return array;
}

Eigen::MatrixXd kdl_jacobian(const KDL::Chain& chain, const JointVector& q) {
  KDL::ChainJntToJacSolver solver(chain);
  KDL::Jacobian jacobian(chain.getNrOfJoints());
  REQUIRE(solver.JntToJac(array_of(q), jacobian) >= 0);
  return jacobian.data;
}

Eigen::Matrix4d kdl_pose(const KDL::Chain& chain, const JointVector& q, int segments = -1) {
  KDL::ChainFkSolverPos_recursive solver(chain);
  KDL::Frame frame;
  REQUIRE(solver.JntToCart(array_of(q), frame, segments) >= 0);
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 4; ++j) pose(i, j) = j < 3 ? frame.M(i, j) : frame.p(i);
  }
  return pose;
}

double largest(const Eigen::MatrixXd& difference) { return difference.cwiseAbs().maxCoeff(); }

void check_kinematics(const Chain& chain, const KDL::Chain& expected, const JointVector& q) {
  sigmaik::ChainState state;
  REQUIRE(static_cast<int>(expected.getNrOfJoints()) == chain.dof());
  REQUIRE(sigmaik::update(chain, q, state));
  CHECK(largest(state.tip.matrix() - kdl_pose(expected, q)) < kTolerance);
  CHECK(largest(sigmaik::pose(chain, q).matrix() - kdl_pose(expected, q)) < kTolerance);
  CHECK(largest(state.jacobian - kdl_jacobian(expected, q)) < kTolerance);
}

// Five-point central differences.
void check_gradient(const Chain& chain, const KDL::Chain& expected, const JointVector& q) {
  sigmaik::ChainState state;
  REQUIRE(sigmaik::update(chain, q, state));
  sigmaik::JacobianGradient gradient;
  sigmaik::jacobian_gradient(state.jacobian, gradient);
  constexpr double h = 1e-3;
  for (int k = 0; k < chain.dof(); ++k) {
    const auto at = [&](double step) {
      JointVector moved = q;
      moved[k] += step * h;
      return kdl_jacobian(expected, moved);
    };
    const Eigen::MatrixXd difference = (8.0 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12.0 * h);
    CHECK(largest(gradient[static_cast<std::size_t>(k)] - difference) < 1e-10);
  }
}

void check_dynamics(const KDL::Chain& a, const KDL::Chain& b, const JointVector& q, const JointVector& qdot) {
  const unsigned n = a.getNrOfJoints();
  REQUIRE(b.getNrOfJoints() == n);
  const KDL::Vector g(0.3, -0.4, -9.81);
  KDL::ChainDynParam dynamics_a(a, g), dynamics_b(b, g);
  KDL::JntSpaceInertiaMatrix mass_a(n), mass_b(n);
  REQUIRE(dynamics_a.JntToMass(array_of(q), mass_a) >= 0);
  REQUIRE(dynamics_b.JntToMass(array_of(q), mass_b) >= 0);
  const double scale = 1.0 + mass_a.data.cwiseAbs().maxCoeff();
  CHECK(largest(mass_a.data - mass_b.data) < kTolerance * scale);
  KDL::JntArray torque_a(n), torque_b(n);
  REQUIRE(dynamics_a.JntToGravity(array_of(q), torque_a) >= 0);
  REQUIRE(dynamics_b.JntToGravity(array_of(q), torque_b) >= 0);
  CHECK(largest(torque_a.data - torque_b.data) < kTolerance * 10.0 * scale);
  REQUIRE(dynamics_a.JntToCoriolis(array_of(q), array_of(qdot), torque_a) >= 0);
  REQUIRE(dynamics_b.JntToCoriolis(array_of(q), array_of(qdot), torque_b) >= 0);
  CHECK(largest(torque_a.data - torque_b.data) < kTolerance * 100.0 * scale);
}

// ---- Kinematics ----------------------------------------------------------------------------------------------------

TEST_CASE("random arms move as in KDL") {
  Random random(kSeed);
  for (int i = 0; i < 4000; ++i) {
    CAPTURE(i);
    const std::vector<Segment> segments = random_segments(random, random.integer(1, 9));
    const Chain chain("base", segments);
    const KDL::Chain expected = oracle(segments);
    for (int k = 0; k < 3; ++k) check_kinematics(chain, expected, random.positions(chain.dof()));
    if (i % 20 == 0) check_gradient(chain, expected, random.positions(chain.dof()));
  }
}

TEST_CASE("axes close to a coordinate axis") {
  Random random(kSeed);
  for (double offset = 1e-18; offset < 0.1; offset *= 1.7) {
    CAPTURE(offset);
    for (int k = 0; k < 6; ++k) {
      Segment s;
      s.joint_name = "j";
      s.link_name = "l";
      s.type = JointType::Revolute;
      s.axis = Eigen::Vector3d::Unit(k % 3) * (k < 3 ? 1.0 : -1.0) + offset * random.vector(1.0);
      Segment tip;
      tip.joint_name = "to_tip";
      tip.link_name = "tip";
      tip.origin = random.pose();
      check_kinematics(Chain("base", {s, tip}), oracle({s, tip}), random.positions(1));
    }
  }
}

std::vector<std::string> shipped_arms() {
  std::vector<std::string> paths;
  for (const auto& entry : std::filesystem::directory_iterator(SIGMAIK_ROBOTS_DIR)) {
    if (entry.path().extension() == ".urdf") paths.push_back(entry.path().string());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

TEST_CASE("the shipped arms move as in KDL, there and back") {
  Random random(kSeed);
  const std::vector<std::string> paths = shipped_arms();
  CHECK(paths.size() >= 9);
  for (const std::string& path : paths) {
    CAPTURE(path);
    const Chain chain = Chain::from_urdf(path);
    const KDL::Chain expected = oracle(chain.segments()), there = sigmaik::to_kdl(chain);
    const Chain back = sigmaik::from_kdl(there, chain.base());
    const KDL::Chain again = sigmaik::to_kdl(back);
    CHECK(back.joint_names() == chain.joint_names());
    CHECK(back.tip() == chain.tip());
    CHECK(back.segments().size() == chain.segments().size());
    for (int k = 0; k < 100; ++k) {
      const JointVector q = random.positions(chain.dof());
      check_kinematics(chain, expected, q);
      check_kinematics(chain, there, q);
      check_kinematics(back, expected, q);
      check_dynamics(there, again, q, random.positions(chain.dof()));
      if (k % 10 == 0) check_gradient(chain, expected, q);
    }
  }
}

// ---- to_kdl --------------------------------------------------------------------------------------------------------

TEST_CASE("to KDL, segment for segment") {
  Random random(kSeed);
  for (int i = 0; i < 500; ++i) {
    CAPTURE(i);
    const Chain chain("base", random_segments(random, random.integer(1, 9)));
    const KDL::Chain kdl = sigmaik::to_kdl(chain);
    REQUIRE(kdl.getNrOfSegments() == chain.segments().size());
    REQUIRE(static_cast<int>(kdl.getNrOfJoints()) == chain.dof());
    for (unsigned k = 0; k < kdl.getNrOfSegments(); ++k) {
      const Segment& s = chain.segments()[k];
      const KDL::Segment& segment = kdl.getSegment(k);
      CHECK(segment.getName() == s.link_name);
      CHECK(segment.getJoint().getName() == s.joint_name);
      CHECK(KDL::Equal(segment.getFrameToTip(), frame_of(s.origin), 1e-15));
      const double q = random.uniform(-3.0, 3.0);
      Pose motion = Pose::Identity();
      if (s.type == JointType::Prismatic) motion.translation() = q * s.axis;
      if (s.type == JointType::Revolute || s.type == JointType::Continuous) {
        motion.linear() = Eigen::AngleAxisd(q, s.axis).toRotationMatrix();
      }
      CHECK(KDL::Equal(segment.pose(q), frame_of(s.origin * motion), kTolerance));
      CHECK(segment.getInertia().getMass() == (s.inertia ? s.inertia->mass : 0.0));
    }
    const JointVector q = random.positions(chain.dof()), qdot = random.positions(chain.dof());
    check_kinematics(chain, kdl, q);

    const Chain back = sigmaik::from_kdl(kdl);
    REQUIRE(back.segments().size() == chain.segments().size());
    for (std::size_t k = 0; k < back.segments().size(); ++k) {
      const Segment &a = chain.segments()[k], &b = back.segments()[k];
      CHECK(a.joint_name == b.joint_name);
      CHECK(a.link_name == b.link_name);
      CHECK(largest(a.origin.matrix() - b.origin.matrix()) < 1e-15);
      CHECK((a.type == JointType::Fixed || (a.axis - b.axis).norm() < 2e-15));
      CHECK(a.inertia.has_value() == b.inertia.has_value());
      if (a.inertia) CHECK(largest(a.inertia->tensor - b.inertia->tensor) < kTolerance);
    }
    check_kinematics(back, kdl, q);
    check_dynamics(kdl, sigmaik::to_kdl(back), q, qdot);
  }
}

// ---- from_kdl ------------------------------------------------------------------------------------------------------

KDL::RigidBodyInertia kdl_inertia(const sigmaik::Inertia& inertia) {
  const Eigen::Matrix3d& t = inertia.tensor;
  return KDL::RigidBodyInertia(inertia.mass, vector_of(inertia.center_of_mass),
                               KDL::RotationalInertia(t(0, 0), t(1, 1), t(2, 2), t(0, 1), t(0, 2), t(1, 2)));
}

TEST_CASE("from KDL: every joint type, offset, direction and tip") {
  using KDL::Joint;
  constexpr std::array kTypes{Joint::RotAxis, Joint::RotX,   Joint::RotY,   Joint::RotZ, Joint::TransAxis,
                              Joint::TransX,  Joint::TransY, Joint::TransZ, Joint::None};
  Random random(kSeed);
  for (int i = 0; i < 1500; ++i) {
    CAPTURE(i);
    KDL::Chain kdl;
    std::vector<sigmaik::Inertia> inertias;
    const int count = random.integer(1, 9);
    while (static_cast<int>(kdl.getNrOfSegments()) < count || kdl.getNrOfJoints() == 0) {
      const Joint::JointType type = kTypes[static_cast<std::size_t>(random.integer(0, 8))];
      const double scale = random.chance(0.5) ? 1.0 : -1.0;
      const double offset = random.chance(0.5) ? 0.0 : random.uniform(-2.0, 2.0);
      const std::string number = std::to_string(kdl.getNrOfSegments());
      const bool free_axis = type == Joint::RotAxis || type == Joint::TransAxis;
      const Joint joint = free_axis ? Joint("j" + number, vector_of(random.vector(1.0)), vector_of(random.axis()), type,
                                            scale, offset)
                                    : Joint("j" + number, type, scale, offset);
      inertias.push_back(random.inertia());
      kdl.addSegment(KDL::Segment("l" + number, joint, frame_of(random.pose()), kdl_inertia(inertias.back())));
    }
    const Chain chain = sigmaik::from_kdl(kdl);
    for (int k = 0; k < 3; ++k) {
      const JointVector q = random.positions(chain.dof());
      check_kinematics(chain, kdl, q);
      check_dynamics(kdl, sigmaik::to_kdl(chain), q, random.positions(chain.dof()));
    }

    // Links keep their names, their frames and their inertias; joints their names.
    const JointVector q = random.positions(chain.dof());
    const KDL::Chain there = sigmaik::to_kdl(chain);
    std::vector<std::string> joints;
    for (unsigned k = 0; k < kdl.getNrOfSegments(); ++k) {
      const KDL::Segment& segment = kdl.getSegment(k);
      if (segment.getJoint().getType() != Joint::None) joints.push_back(segment.getJoint().getName());
      std::size_t at = 0;
      while (at < chain.segments().size() && chain.segments()[at].link_name != segment.getName()) ++at;
      REQUIRE(at < chain.segments().size());
      const Segment& s = chain.segments()[at];
      CHECK(largest(kdl_pose(kdl, q, static_cast<int>(k) + 1) - kdl_pose(there, q, static_cast<int>(at) + 1)) <
            kTolerance);
      REQUIRE(s.inertia.has_value());
      CHECK(s.inertia->mass == inertias[k].mass);
      CHECK((s.inertia->center_of_mass - inertias[k].center_of_mass).norm() < 1e-15);
      CHECK(largest(s.inertia->tensor - inertias[k].tensor) < 1e-14);
    }
    CHECK(chain.joint_names() == joints);
    CHECK(chain.tip() == kdl.getSegment(kdl.getNrOfSegments() - 1).getName());
  }
}

TEST_CASE("from KDL: no names, no limits") {
  KDL::Chain kdl;  // the first three joints of KDL's own Puma 560
  kdl.addSegment(KDL::Segment());
  kdl.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::RotZ), KDL::Frame::DH(0.0, M_PI_2, 0.0, 0.0)));
  kdl.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::RotZ), KDL::Frame::DH(0.4318, 0.0, 0.0, 0.0)));
  kdl.addSegment(KDL::Segment("joint4", KDL::Joint("joint4", KDL::Joint::TransZ), KDL::Frame::DH(0.0, 1.0, 0.1, 0.0)));
  kdl.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::RotZ)));
  const Chain chain = sigmaik::from_kdl(kdl, "link5");
  CHECK(chain.base() == "link5");
  CHECK(chain.joint_names() == std::vector<std::string>{"joint2", "joint3", "joint4", "joint5"});
  std::vector<std::string> links;
  for (const Segment& s : chain.segments()) {
    links.push_back(s.link_name);
    CHECK_FALSE(s.inertia.has_value());
  }
  // Only the tip of the third segment lies off its joint's axis.
  CHECK(links == std::vector<std::string>{"link1", "link2", "link3_joint", "link3", "joint4", "link5_"});
  CHECK(chain.joint_types() ==
        std::vector<JointType>{JointType::Revolute, JointType::Revolute, JointType::Prismatic, JointType::Revolute});
  for (const JointVector* limit : {&chain.limits().upper, &chain.limits().velocity, &chain.limits().acceleration,
                                   &chain.limits().jerk, &chain.limits().effort}) {
    CHECK((limit->array() == std::numeric_limits<double>::infinity()).all());
  }
  CHECK((chain.limits().lower.array() == -std::numeric_limits<double>::infinity()).all());
  JointVector q(4);
  q << 0.1, -0.7, 0.3, 1.1;
  check_kinematics(chain, kdl, q);
}

void check_refused(const KDL::Chain& kdl, const std::vector<std::string>& facts) {
  std::string text;
  try {
    sigmaik::from_kdl(kdl);
  } catch (const sigmaik::Error& e) {
    text = e.what();
  }
  INFO("the message: ", text);
  CHECK_FALSE(text.empty());
  for (const std::string& fact : facts) {
    INFO("the fact: ", fact);
    CHECK(text.find(fact) != std::string::npos);
  }
}

TEST_CASE("from KDL: what is refused") {
  using KDL::Joint;
  const auto chain_of = [](const Joint& joint) {
    KDL::Chain kdl;
    kdl.addSegment(KDL::Segment("l", joint));
    return kdl;
  };
  check_refused(KDL::Chain(), {"at least one segment"});
  check_refused(chain_of(Joint("j", Joint::None)), {"no movable joint"});
  for (const double scale : {2.0, -0.5, 0.0, 1.0 + 1e-9, std::nan("")}) {
    for (const Joint::JointType type : {Joint::RotX, Joint::TransY}) {
      check_refused(chain_of(Joint("j", type, scale)), {"'j'", "scale", "1 and -1"});
    }
  }
  check_refused(chain_of(Joint("j", Joint::RotZ, 2.5)), {"scale = 2.5"});
  check_refused(chain_of(Joint("j", KDL::Vector::Zero(), KDL::Vector::Zero(), Joint::RotAxis)), {"'j'", "axis"});
  check_refused(chain_of(Joint("j", Joint::RotZ, 1.0, std::nan(""))), {"'j'", "not finite"});
  KDL::Chain twice = chain_of(Joint("j", Joint::RotZ));
  twice.addSegment(KDL::Segment("k", Joint("j", Joint::RotZ)));
  check_refused(twice, {"'j'", "used twice"});
  KDL::Chain long_chain;
  for (int i = 0; i < 17; ++i) long_chain.addSegment(KDL::Segment(Joint(Joint::RotZ)));
  check_refused(long_chain, {"17 movable joints"});
}

}  // namespace
