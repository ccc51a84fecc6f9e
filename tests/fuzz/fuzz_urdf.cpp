// Any text is an arm or is refused with a sigmaik::Error. What is read is an arm: finite, inside its own limits' rules,
// and the same arm once more.
#include <string>

#include <sigmaik/chain.hpp>
#include <sigmaik/dynamics.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/planning/arm_spheres.hpp>

#include "bytes.hpp"

using namespace sigmaik;

namespace {

void use(const Chain& chain, const std::string& text) {
  fuzz::demand(chain.dof() >= 1 && chain.dof() <= kMaxJoints, "1 to 16 joints");
  const JointVector q = JointVector::Constant(chain.dof(), 0.3);
  ChainState state;
  fuzz::demand(update(chain, q, state) && state.jacobian.allFinite(), "finite kinematics");
  fuzz::demand((chain.limits().lower.array() <= chain.limits().upper.array()).all(), "lower ≤ upper");
  fuzz::demand((chain.limits().velocity.array() > 0.0).all(), "velocity limits above 0");
  fuzz::demand(chain.with_limits(chain.limits()).dof() == chain.dof(), "its own limits are accepted");
  const Chain again = Chain::from_urdf(text);
  fuzz::demand(pose(again, q).matrix() == state.tip.matrix(), "the same arm once more");
  try {
    planning::ArmSpheres::from_urdf(chain, text);
  } catch (const Error&) {
  }
  try {
    Dynamics dynamics(chain);
    dynamics.mass_matrix(q);
  } catch (const Error&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string text(reinterpret_cast<const char*>(data), size);
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  if (first == std::string::npos || text[first] != '<') text.insert(0, "<robot name='r'>");  // no path of a file
  try {
    use(Chain::from_urdf(text), text);
  } catch (const Error&) {
  }
  return 0;
}
