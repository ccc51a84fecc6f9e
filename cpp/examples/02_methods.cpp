// What every method makes of one twist close to a singularity. The same as 02_methods.py.
#include <cstdio>

#include <sigmaik/sigmaik.hpp>

int main(int argc, char** argv) try {
  if (argc != 2) return std::fprintf(stderr, "usage: %s ROBOT.urdf\n", argv[0]), 2;
  const auto arm = sigmaik::Chain::from_urdf(argv[1]);
  sigmaik::ChainState state;
  update(arm, sigmaik::JointVector::Constant(arm.dof(), 0.02), state);  // nearly stretched out
  sigmaik::Twist twist;
  twist << 0.1, 0, 0.1, 0, 0, 0;

  const sigmaik::Method methods[] = {sigmaik::PseudoInverse{},
                                     sigmaik::DampedLeastSquares{.damping = 0.1},
                                     sigmaik::AdaptiveDampedLeastSquares{},
                                     sigmaik::SelectivelyDampedLeastSquares{},
                                     sigmaik::JParse{},
                                     sigmaik::JacobianProjection{},
                                     sigmaik::JacobianSafety{},
                                     sigmaik::JacobianSafetyProjection{}};
  for (const sigmaik::Method& method : methods) {
    sigmaik::VelocitySolver solver(method);
    const sigmaik::Solution s = solver.solve(state.jacobian, twist);
    std::printf("%-29s %-7s fastest joint %7.3f rad/s, twist missed by %.4f\n", name(method), to_string(s.status),
                s.qdot.cwiseAbs().maxCoeff(), (s.achieved_twist - twist).norm());
  }
  return 0;
} catch (const sigmaik::Error& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
