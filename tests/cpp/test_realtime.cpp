// Eigen's own checks, over the library's sources: this executable compiles them itself, with assertions on and with
// EIGEN_RUNTIME_NO_MALLOC. An allocation, a size that does not fit a bounded type or an index out of range aborts.
// test_solver.cpp and test_servo.cpp count the heap calls of the library as it is shipped.
#include <doctest/doctest.h>

#include <sigmaik/sigmaik.hpp>

#include "random.hpp"

#if !defined(EIGEN_RUNTIME_NO_MALLOC) || defined(NDEBUG)
#error "this test needs Eigen's run-time checks"
#endif

namespace {

// No allocation by Eigen while it lives.
class NoMalloc {
 public:
  NoMalloc() { Eigen::internal::set_is_malloc_allowed(false); }
  ~NoMalloc() { Eigen::internal::set_is_malloc_allowed(true); }
};

const sigmaik::Method kMethods[] = {sigmaik::PseudoInverse{},
                                    sigmaik::DampedLeastSquares{},
                                    sigmaik::AdaptiveDampedLeastSquares{},
                                    sigmaik::AdaptiveDampedLeastSquares{sigmaik::DampingRule::Manipulability},
                                    sigmaik::SelectivelyDampedLeastSquares{},
                                    sigmaik::JParse{.gain_linear = 2.0},
                                    sigmaik::JacobianProjection{},
                                    sigmaik::JacobianSafety{},
                                    sigmaik::JacobianSafetyProjection{}};

}  // namespace

TEST_CASE("Eigen's check is on") {
  CHECK(Eigen::internal::is_malloc_allowed());
  const NoMalloc none;
  CHECK_FALSE(Eigen::internal::is_malloc_allowed());
}

TEST_CASE("decompositions and rules of every size pass Eigen's checks") {
  test::Random random(1);
  for (int m = 1; m <= sigmaik::kMaxTask; ++m) {
    for (int n = 1; n <= sigmaik::kMaxJoints; ++n) {
      const Eigen::MatrixXd regular = random.matrix(m, n), zero = Eigen::MatrixXd::Zero(m, n);
      const Eigen::VectorXd twist = random.vector(m), posture = random.vector(n);
      for (const sigmaik::Method& method : kMethods) {
        sigmaik::VelocitySolver solver(method, 0.5);
        double sum = 0.0;
        {
          const NoMalloc none;
          for (const Eigen::MatrixXd* j : {&regular, &zero, &regular}) {
            sum += solver.solve(*j, twist).qdot.sum() + solver.solve(*j, twist, posture).qdot.sum();
          }
        }
        CHECK(std::isfinite(sum));
      }
    }
  }
}

TEST_CASE("servos of every size pass Eigen's checks") {
  test::Random random(2);
  for (int n = 1; n <= sigmaik::kMaxJoints; ++n) {
    const sigmaik::Chain chain = random.chain(n, 0.3);
    const sigmaik::JointVector q = random.configuration(n);
    for (const sigmaik::Method& method : kMethods) {
      for (const sigmaik::Task& task :
           {sigmaik::Task{}, sigmaik::Task{{true, true, true, true, true, false}, sigmaik::Frame::Tool}}) {
        sigmaik::Servo servo(chain, method, {.posture = q, .posture_gain = 1.0, .length_scale = 0.4, .task = task});
        servo.reset(random.configuration(n));
        const sigmaik::Pose target = random.pose();
        const sigmaik::Twist twist = random.vector(6);
        sigmaik::ChainState state;
        static sigmaik::JacobianGradient gradient;
        double sum = 0.0;
        {
          const NoMalloc none;
          for (int cycle = 0; cycle < 20; ++cycle) {
            sum += servo.update(target).qdot.sum() + servo.update_twist(twist).qdot.sum();
          }
          update(chain, q, state);
          sigmaik::jacobian_gradient(state.jacobian, gradient);
          sum += pose(chain, q).translation().sum() + gradient[0].sum();
        }
        CHECK(std::isfinite(sum));
      }
    }
  }
}
