#include "natural_spline.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <sigmaik/planning/support_states.hpp>

#include "../message.hpp"
#include "samples.hpp"

namespace sigmaik::planning {

// A tridiagonal system: v_{i−1} + 4 v_i + v_{i+1} = 3 (q_{i+1} − q_{i−1})/h, and 2 v_0 + v_1 = 3 (q_1 − q_0)/h at the
// ends.
std::vector<double> spline_velocities(const std::vector<double>& q, int states, int dof) {
  sigmaik::detail::require(states >= 2 && dof >= 1 && q.size() == static_cast<std::size_t>(states * dof),
                           "the motion has ", q.size(), " numbers, needs ", states, " × ", dof);
  const double h = 1.0 / (states - 1.0);
  const auto at = [&](int i, int j) { return q[static_cast<std::size_t>(i * dof + j)]; };
  std::vector<double> v(q.size()), upper(static_cast<std::size_t>(states));
  for (int j = 0; j < dof; ++j) {
    for (int i = 0; i < states; ++i) {
      const bool first = i == 0, last = i == states - 1;
      const double diagonal = first || last ? 2.0 : 4.0;
      const double right = 3.0 / h * (at(last ? i : i + 1, j) - at(first ? i : i - 1, j));
      const double before = first ? 0.0 : upper[static_cast<std::size_t>(i - 1)];
      const double pivot = diagonal - before;
      upper[static_cast<std::size_t>(i)] = 1.0 / pivot;
      const double carried = first ? 0.0 : v[static_cast<std::size_t>((i - 1) * dof + j)];
      v[static_cast<std::size_t>(i * dof + j)] = (right - carried) / pivot;
    }
    for (int i = states - 2; i >= 0; --i) {
      v[static_cast<std::size_t>(i * dof + j)] -= upper[static_cast<std::size_t>(i)] *
                                                  v[static_cast<std::size_t>((i + 1) * dof + j)];
    }
  }
  return v;
}

namespace detail {
namespace {

// s is a root of a s² + b s + c, or −b/(2a); the answer is s if s is within the step, else 0.
double inside(double s) { return s > 0.0 && s < 1.0 ? s : 0.0; }

}  // namespace

NaturalSpline::NaturalSpline(std::vector<double> q, int states, int dof)
    : states_(states),
      dof_(dof),
      h_(1.0 / (states - 1.0)),
      q_(std::move(q)),
      qdot_(spline_velocities(q_, states, dof)),
      qddot_(q_.size()) {
  // In a step from q0 to q1: q̈0 = (6 (q1 − q0)/h − 4 q̇0 − 2 q̇1)/h. At both ends q̈ is zero.
  const auto n = static_cast<std::size_t>(dof);
  for (std::size_t i = n; i + n < q_.size(); ++i) {
    qddot_[i] = (6.0 * (q_[i + n] - q_[i]) / h_ - 4.0 * qdot_[i] - 2.0 * qdot_[i + n]) / h_;
  }
}

NaturalSpline::Step NaturalSpline::step(int k, int joint) const {
  const auto i = static_cast<std::size_t>(k * dof_ + joint), next = i + static_cast<std::size_t>(dof_);
  const double bend = qddot_[next] - qddot_[i];
  return {q_[i], qdot_[i], qddot_[i], bend / h_, 0.5 * h_ * bend, h_ * qddot_[i], qdot_[i]};
}

void NaturalSpline::extremes(JointVector& low, JointVector& high) const {
  low = high = joints(q_, 0, static_cast<std::size_t>(dof_));
  for (int joint = 0; joint < dof_; ++joint) {
    const auto include = [&](double q) {
      low[joint] = std::min(low[joint], q);
      high[joint] = std::max(high[joint], q);
    };
    for (int k = 1; k < states_; ++k) include(q_[static_cast<std::size_t>(k * dof_ + joint)]);
    for (int k = 0; k + 1 < states_; ++k) {
      const Step p = step(k, joint);
      const double root = std::sqrt(p.b * p.b - 4.0 * p.a * p.c);
      for (const double s : {(-p.b + root) / (2.0 * p.a), (-p.b - root) / (2.0 * p.a), -p.c / p.b}) {
        const double t = inside(s) * h_;
        include(p.q + t * (p.qdot + t * (0.5 * p.qddot + t * p.jerk / 6.0)));
      }
    }
  }
}

JointVector NaturalSpline::fastest() const {
  JointVector out = JointVector::Zero(dof_);
  for (int joint = 0; joint < dof_; ++joint) {
    for (int k = 0; k < states_; ++k) {
      out[joint] = std::max(out[joint], std::abs(qdot_[static_cast<std::size_t>(k * dof_ + joint)]));
    }
    for (int k = 0; k + 1 < states_; ++k) {
      const Step p = step(k, joint);
      const double s = inside(-p.b / (2.0 * p.a));
      out[joint] = std::max(out[joint], std::abs((p.a * s + p.b) * s + p.c));
    }
  }
  return out;
}

double NaturalSpline::shortest(const JointLimits& limits) const {
  const JointVector speeds = fastest();
  double duration = 0.0;
  for (int joint = 0; joint < dof_; ++joint) {
    double hardest = 0.0;
    for (int k = 0; k < states_; ++k) {
      hardest = std::max(hardest, std::abs(qddot_[static_cast<std::size_t>(k * dof_ + joint)]));
    }
    duration = std::max(
        {duration, speeds[joint] / limits.velocity[joint], std::sqrt(hardest / limits.acceleration[joint])});
  }
  return duration > 0.0 ? duration : 1.0;
}

NaturalSpline NaturalSpline::within(const JointLimits& limits, const std::vector<double>& q, int states, int dof) {
  const auto n = static_cast<std::size_t>(dof), count = static_cast<std::size_t>(states);
  const std::vector<double> s = evenly(0.0, 1.0, count);
  std::vector<double> line(q.size());
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t j = 0; j < n; ++j) line[k * n + j] = q[j] + s[k] * (q[(count - 1) * n + j] - q[j]);
  }
  const auto part_way = [&](double part) {
    std::vector<double> out(q.size());
    for (std::size_t i = 0; i < q.size(); ++i) out[i] = line[i] + part * (q[i] - line[i]);
    return NaturalSpline(std::move(out), states, dof);
  };
  const auto keeps = [&](double part) {
    JointVector lowest, highest;
    part_way(part).extremes(lowest, highest);
    return (lowest.array() >= limits.lower.array()).all() && (highest.array() <= limits.upper.array()).all();
  };
  if (keeps(1.0)) return {q, states, dof};
  double low = 0.0, high = 1.0;
  for (int i = 0; i < 30; ++i) {
    const double middle = 0.5 * (low + high);
    (keeps(middle) ? low : high) = middle;
  }
  return part_way(low);
}

Trajectory NaturalSpline::over(double duration) const {
  Trajectory out;
  out.dof = dof_;
  out.duration = duration;
  out.cubic = true;
  out.t = evenly(0.0, duration, static_cast<std::size_t>(states_));
  out.q = q_;
  out.qdot = qdot_;
  out.qddot = qddot_;
  for (double& v : out.qdot) v /= duration;
  for (double& a : out.qddot) a /= duration * duration;
  return out;
}

}  // namespace detail
}  // namespace sigmaik::planning
