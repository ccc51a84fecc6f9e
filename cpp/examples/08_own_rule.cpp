// A rule of one's own: the solver and the servo take any small struct that says what to do with one singular direction.
#include <cstdio>

#include <sigmaik/sigmaik.hpp>

// Exact down to a threshold, and from there on along a straight line through zero: σ/t² instead of 1/σ. That is J-PARSE
// with unit gains, but with a threshold in the units of σ.
struct StraightToZero {
  double threshold = 0.05;

  static constexpr const char* kName = "StraightToZero";
  void check() const {  // when a solver or a servo is made of it
    if (!(threshold > 0.0)) throw sigmaik::Error("StraightToZero: threshold must be above 0");
  }
  // In the loop from here: noexcept, no heap, no unbounded loop.
  double relative_threshold() const noexcept { return 0.1; }  // of σ_max: where a servo counts a direction as weak
  sigmaik::Direction at(double sigma, const sigmaik::SpectrumSummary&) const noexcept {
    if (sigma > threshold) return {.inverse = 1.0 / sigma, .projector = 1.0, .regular = true};
    return {.inverse = sigma / (threshold * threshold), .projector = 1.0, .regular = false};
  }
};

int main(int argc, char** argv) try {
  if (argc != 2) return std::fprintf(stderr, "usage: %s ROBOT.urdf\n", argv[0]), 2;
  const auto arm = sigmaik::Chain::from_urdf(argv[1]);
  sigmaik::Servo servo(arm, StraightToZero{.threshold = 0.08});
  servo.reset(sigmaik::JointVector::Constant(arm.dof(), 0.4));
  sigmaik::Pose far = servo.tip();
  far.translation() *= 10.0;

  sigmaik::ServoStep step;
  for (int cycle = 0; cycle < 15000; ++cycle) step = servo.update(far);
  std::printf("%s: %s, smallest singular value %.4f, fastest joint %.6f rad/s\n", name(servo.method()),
              to_string(step.status), step.singular_values[step.singular_values.size() - 1],
              step.qdot.cwiseAbs().maxCoeff());
  return 0;
} catch (const sigmaik::Error& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
