#pragma once
// The direction of an interior-point step: the model at the iterate, and its minimum.

#include <algorithm>
#include <cmath>

#include "../symmetric_eigen.hpp"
#include "interior_point.hpp"

namespace sigmaik::planning::detail {

template <int W>
void InteriorPoint<W>::evaluate() noexcept {
  for (int k = 1; k < count_ - 1; ++k) {
    Node<W>& x = node(k);
    x.gradient = {};
    x.hessian = {};
    x.cost = 0.0;
    x.is_convex = true;
    if (!cost_) continue;
    std::copy_n(x.q.at, n_, joints_.data());
    x.cost = cost_->model(joints_, joint_gradient_, joint_hessian_);
    for (int j = 0; j < n_; ++j) {
      x.gradient[j] = joint_gradient_[j];
      for (int i = 0; i < n_; ++i) x.hessian.at[j][i] = joint_hessian_(i, j);
    }
    x.is_convex = false;
  }
}

// Positive parts of the Hessians, where they are not known yet.
template <int W>
void InteriorPoint<W>::convexify() noexcept {
  for (int k = 1; k < count_ - 1; ++k) {
    Node<W>& x = node(k);
    if (x.is_convex) {
      x.convex = x.hessian;
      continue;
    }
    for (int j = 0; j < n_; ++j) {
      for (int i = 0; i < n_; ++i) joint_hessian_(i, j) = x.hessian.at[j][i];
    }
    x.convex = x.hessian;
    const double size = joint_hessian_.cwiseAbs().maxCoeff();
    if (size > 1e-9 * options_.time_weight) {
      const auto [values, vectors] = sigmaik::detail::symmetric_eigen(joint_hessian_);
      if (values[0] < 0.0) {
        joint_hessian_ = vectors.lazyProduct(values.cwiseMax(0.0).asDiagonal() * vectors.transpose());
        for (int j = 0; j < n_; ++j) {
          for (int i = 0; i < n_; ++i) x.convex.at[j][i] = joint_hessian_(i, j);
        }
      }
    }
    x.is_convex = true;
  }
}

// The model of the Lagrangian's barrier problem at the iterate. For each constraint c with slack s, multiplier z and
// miss r = c − s it has z/s ∇c∇cᵀ and −(μ/s − z/s r) ∇c.
template <int W>
void InteriorPoint<W>::assemble(double mu, bool convex) noexcept {
  const double effort = 2.0 * options_.effort_weight / (h_ * h_ * h_ * h_);
  for (int k = 0; k < count_ - 1; ++k) {
    Node<W>& x = node(k);
    Stage<W>& s = stage(k);
    for (int f = 0; f < kFamilies; ++f) {
      const Row<W>& on = active(f, k);
      for (int i = 0; i < W; ++i) {
        const double inverse = 1.0 / x.slack[f][i];
        x.weight[f][i] = x.dual[f][i] * inverse;
        x.force[f][i] = on[i] * (mu * inverse) - x.weight[f][i] * x.miss[f][i];
      }
    }
    s.qq = convex ? x.convex : x.hessian;
    for (int i = 0; i < W; ++i) {
      const double a = 2.0 * h_ * acceleration_[i];
      const double between = x.weight[kLowerBetween][i] + x.weight[kUpperBetween][i];
      const double inward = x.force[kUpperBetween][i] - x.force[kLowerBetween][i];
      s.qq.at[i][i] += x.weight[kLower][i] + x.weight[kUpper][i] + between;
      s.gq[i] = x.gradient[i] + x.force[kUpper][i] - x.force[kLower][i] + inward;
      s.qp[i] = 0.5 * between;
      s.pp[i] = x.weight[kBackward][i] + x.weight[kForward][i] + 0.25 * between;
      s.ph[i] = velocity_[i] * (x.weight[kBackward][i] - x.weight[kForward][i]);
      s.gp[i] = x.force[kForward][i] - x.force[kBackward][i] + 0.5 * inward;
      s.aa[i] = effort + x.weight[kBrake][i] + x.weight[kPush][i];
      s.ah[i] = -4.0 * effort / h_ * x.a[i] + a * (x.weight[kBrake][i] - x.weight[kPush][i]);
      s.ga[i] = effort * x.a[i] + x.force[kPush][i] - x.force[kBrake][i];
    }
    for (int i = n_; i < W; ++i) s.qq.at[i][i] = s.pp[i] = s.aa[i] = 1.0;
  }
}

// Adds what the limits, the effort and the cost's gradient say at node k. Constraint by constraint, as near the
// solution large numbers cancel.
template <int W>
void InteriorPoint<W>::add_motion(int k, double effort, StepModel& model) const noexcept {
  const Node<W>& x = node(k);
  const Stage<W>& s = stage(k);
  Row<W> ds0[kFamilies], ds1[kFamilies], sum_along{}, sum_curvature{};
  slack_changes(k, s.dq[0], s.dp[0], s.da[0], 0.0, ds0);
  slack_changes(k, s.dq[1], s.dp[1], s.da[1], 1.0, ds1);
  for (int f = 0; f < kFamilies; ++f) {
    for (int i = 0; i < W; ++i) {
      sum_along[i] += (x.weight[f][i] * ds0[f][i] - x.force[f][i]) * ds1[f][i];
      sum_curvature[i] += x.weight[f][i] * ds1[f][i] * ds1[f][i];
    }
  }
  const double bow = -4.0 * effort / h_;
  for (int i = 0; i < W; ++i) {
    sum_along[i] += x.gradient[i] * s.dq[1][i] + effort * (x.a[i] + s.da[0][i]) * s.da[1][i] +
                    bow * x.a[i] * s.da[0][i];
    sum_curvature[i] += effort * s.da[1][i] * s.da[1][i] + 2.0 * bow * x.a[i] * s.da[1][i] -
                        2.0 * acceleration_[i] * (x.dual[kBrake][i] + x.dual[kPush][i]);
  }
  for (int i = 0; i < W; ++i) {
    model.along += sum_along[i];
    model.curvature += sum_curvature[i];
  }
}

// Adds what the cost's Hessian says at node k.
template <int W>
void InteriorPoint<W>::add_cost(int k, bool convex, StepModel& model) const noexcept {
  const Stage<W>& s = stage(k);
  const Square<W>& hessian = convex ? node(k).convex : node(k).hessian;
  for (int j = 0; j < W; ++j) {
    double row = 0.0;
    for (int i = 0; i < W; ++i) row += hessian.at[j][i] * s.dq[1][i];
    model.along += row * s.dq[0][j];
    model.curvature += row * s.dq[1][j];
  }
}

template <int W>
typename InteriorPoint<W>::StepModel InteriorPoint<W>::model_of_step(double mu, bool convex) const noexcept {
  const double effort = 2.0 * options_.effort_weight / (h_ * h_ * h_ * h_), h_slack = h_ - kLeastStep;
  StepModel model{options_.time_weight * count_ - mu / h_slack, h_dual_ / h_slack, 0.0};
  double squares = 0.0;
  for (int k = 0; k < count_ - 1; ++k) {
    add_motion(k, effort, model);
    squares += dot_rows(node(k).a, node(k).a);
    if (k > 0 && cost_) add_cost(k, convex, model);
  }
  model.along -= 2.0 * effort * squares / h_;
  model.effort_curvature = 10.0 * effort * squares / (h_ * h_);
  model.curvature += model.effort_curvature;
  return model;
}

// The direction, of the recursion's two solutions and the step's change.
template <int W>
void InteriorPoint<W>::combine_solutions() noexcept {
  for (int k = 0; k < count_ - 1; ++k) {
    const Stage<W>& s = stage(k);
    Node<W>& x = node(k);
    for (int i = 0; i < W; ++i) {
      x.dq[i] = s.dq[0][i] + dh_ * s.dq[1][i];
      x.dp[i] = s.dp[0][i] + dh_ * s.dp[1][i];
      x.da[i] = s.da[0][i] + dh_ * s.da[1][i];
    }
    slack_changes(k, x.dq, x.dp, x.da, dh_, x.dslack);
    if (feasible_) continue;
    for (int f = 0; f < kFamilies; ++f) {
      for (int i = 0; i < W; ++i) x.dslack[f][i] += x.miss[f][i];
    }
  }
}

// Solves the model. False where it has no minimum for a given step. Where it has none in the step, one is made up.
template <int W>
bool InteriorPoint<W>::find_direction(double mu, bool convex) noexcept {
  if (!kernels<W>().factorise(stages_, count_)) return false;
  kernels<W>().solve(stages_, count_, start_, end_);
  const StepModel model = model_of_step(mu, convex);
  double curvature = model.curvature;
  bent_ = !(curvature > 0.0);
  if (bent_) {
    curvature = std::max(-curvature, kBentCurvature * model.effort_curvature + h_dual_ / (h_ - kLeastStep));
  }
  dh_ = -model.along / curvature;
  combine_solutions();
  return std::isfinite(dh_);
}

// A direction of descent: by the Hessian as it is, or by its positive part. `exact` says whether the model had a
// minimum as it was. False where there is no direction.
template <int W>
bool InteriorPoint<W>::find_descent(double mu, bool& exact) noexcept {
  assemble(mu, false);
  exact = find_direction(mu, false);
  if (!exact) {
    convexify();
    assemble(mu, true);
    if (!find_direction(mu, true)) return false;
  }
  exact = exact && !bent_;
  return true;
}

}  // namespace sigmaik::planning::detail
