#include <sigmaik/avoidance.hpp>

#include <cmath>

#include "message.hpp"

namespace sigmaik {

Avoidance::Avoidance(const Chain& chain, const AvoidanceOptions& options)
    : options_(options),
      chain_(chain),
      sets_(options.what == Avoid::None ? std::nullopt : SingularSets::of(chain)),
      index_(Index::Manipulability) {
  const auto number = [](const char* name, double value, bool zero_allowed) {
    detail::require(std::isfinite(value) && (value > 0.0 || (zero_allowed && value == 0.0)), name, " = ", value,
                    " must be finite and ", zero_allowed ? "at least 0" : "above 0");
  };
  number("avoid_gain", options.gain, true);
  detail::require(options.max_speed > 0.0, "avoid_max_speed = ", options.max_speed, " must be above 0");
  if (options.what != Avoid::Potential) return;
  number("eta2", options.potential.eta2, false);
  detail::require(std::isfinite(options.potential.eta1) && options.potential.eta1 <= 100.0,
                  "eta1 = ", options.potential.eta1, " must be at most 100");
  detail::require(sets_.has_value(), "the singular sets of this arm are not known; Manipulability needs none");
}

JointVector Avoidance::velocity(const JointRef& q) const noexcept {
  JointVector out = JointVector::Zero(chain_.dof());
  if (!active()) return out;
  if (options_.what == Avoid::Potential) {
    sets_->potential(q, options_.potential, out);
    out *= -options_.gain;
  } else {
    if (sets_) {
      sets_->manipulability(q, out);
    } else {
      index_.value(chain_, q, out);
    }
    out *= options_.gain;
  }
  const double fastest = out.cwiseAbs().maxCoeff();
  if (fastest > options_.max_speed) out *= options_.max_speed / fastest;
  return out;
}

}  // namespace sigmaik
