#include <doctest/doctest.h>

#include <sigmaik/error.hpp>
#include <sigmaik/planning/time_optimal.hpp>

#include "arms.hpp"
#include "oracles.hpp"
#include "random.hpp"

using namespace sigmaik;
using namespace sigmaik::planning;
using test::Random;

namespace {

// Hills Σ_j height_j exp(−½ |(q − c_j)/width_j|²): a cost whose derivatives are easily written down.
class Hills final : public JointCost {
 public:
  struct Hill {
    JointVector center;
    double height, width;
  };
  Hills(int n, std::vector<Hill> hills) : n_(n), hills_(std::move(hills)) {}
  int dof() const noexcept override { return n_; }
  double value(const JointRef& q) const noexcept override {
    double sum = 0.0;
    for (const Hill& h : hills_) sum += h.height * std::exp(-0.5 * (q - h.center).squaredNorm() / (h.width * h.width));
    return sum;
  }
  double model(const JointRef& q, JointVector& gradient, JointMatrix& hessian) const noexcept override {
    gradient.setZero(n_);
    hessian.setZero(n_, n_);
    for (const Hill& h : hills_) {
      const JointVector d = (q - h.center) / (h.width * h.width);
      const double v = h.height * std::exp(-0.5 * (q - h.center).squaredNorm() / (h.width * h.width));
      gradient -= v * d;
      hessian += v * (d * d.transpose());
      hessian.diagonal().array() -= v / (h.width * h.width);
    }
    return value(q);
  }

 private:
  int n_;
  std::vector<Hill> hills_;
};

Chain with_accelerations(const Chain& chain, double acceleration) {
  JointLimits limits = chain.limits();
  limits.acceleration.setConstant(acceleration);
  return chain.with_limits(limits);
}

// n revolute joints in a row, with limits.
Chain row_of_joints(int n, double position, double velocity, double acceleration) {
  std::vector<Segment> segments;
  for (int i = 0; i < n; ++i) {
    Segment s;
    s.joint_name = "j" + std::to_string(i);
    s.link_name = "l" + std::to_string(i);
    s.type = JointType::Revolute;
    s.origin.translation().z() = 0.2;
    s.axis = i % 2 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitZ();
    s.lower = -position;
    s.upper = position;
    s.velocity = velocity;
    s.acceleration = acceleration;
    segments.push_back(s);
  }
  return Chain("base", segments);
}

JointVector between(Random& random, const JointVector& lower, const JointVector& upper) {
  JointVector q(lower.size());
  for (int i = 0; i < q.size(); ++i) q[i] = random.uniform(std::max(lower[i], -3.0), std::min(upper[i], 3.0));
  return q;
}

// The largest violation of dynamics, ends and limits.
double violation(const Chain& chain, const TimeOptimalProblem& problem, const TimeOptimalResult& r) {
  const int n = chain.dof(), nodes = static_cast<int>(r.q.size()) / n;
  const auto row = [n](const std::vector<double>& x, int k) {
    return Eigen::Map<const Eigen::VectorXd>(x.data() + k * n, n);
  };
  const double h = r.duration / nodes;
  const JointLimits& l = chain.limits();
  double worst = 0.0;
  const auto take = [&worst](const auto& x) { worst = std::max(worst, x.maxCoeff()); };
  for (int k = 0; k < nodes; ++k) {
    const auto q = row(r.q, k), v = row(r.qdot, k), a = row(r.qddot, k);
    take(l.lower - q);
    take(q - l.upper);
    take(v.cwiseAbs() - l.velocity);
    take(a.cwiseAbs() - l.acceleration);
    if (k + 1 == nodes) break;
    take((q + h * v + 0.5 * h * h * a - row(r.q, k + 1)).cwiseAbs());
    take((v + h * a - row(r.qdot, k + 1)).cwiseAbs());
    for (double t = 0.05 * h; t < h; t += 0.05 * h) {
      take(l.lower - (q + t * v + 0.5 * t * t * a));
      take((q + t * v + 0.5 * t * t * a) - l.upper);
    }
  }
  const JointVector rest = JointVector::Zero(n);
  take((row(r.q, 0) - problem.start).cwiseAbs());
  take((row(r.q, nodes - 1) - problem.goal).cwiseAbs());
  take((row(r.qdot, 0) - (problem.start_velocity.size() ? problem.start_velocity : rest)).cwiseAbs());
  take((row(r.qdot, nodes - 1) - (problem.goal_velocity.size() ? problem.goal_velocity : rest)).cwiseAbs());
  return worst;
}

double objective(const TimeOptimalResult& r, int n, const TimeOptimalOptions& options, const JointCost* cost) {
  double sum = options.time_weight * r.duration;
  for (const double a : r.qddot) sum += options.effort_weight * a * a;
  for (std::size_t k = 0; cost && k < r.q.size(); k += static_cast<std::size_t>(n)) {
    sum += cost->value(Eigen::Map<const Eigen::VectorXd>(r.q.data() + k, n));
  }
  return sum;
}

// Stationarity, without the method's own linear algebra: over all motions that keep dynamics and ends, and that stay
// off the limits which this motion touches, the objective's gradient vanishes except for the part that pushes into
// these limits. The motions are parametrised by (h, q̈_0 … q̈_{N-2}); limits and ends give one row each; non-negative
// least squares gives the multipliers.
struct Kkt {
  double residual;  // of the gradient, relative to its largest entry
};
Kkt stationarity(const Chain& chain, const TimeOptimalResult& r, const TimeOptimalOptions& options,
                 const JointCost* cost) {
  const int n = chain.dof(), nodes = options.nodes, size = 1 + n * (nodes - 1);
  const double h = r.duration / nodes;
  const JointLimits& l = chain.limits();
  const auto at = [n](const std::vector<double>& x, int k, int i) { return x[static_cast<std::size_t>(k * n + i)]; };
  // Sensitivities of q_k, q̇_k of one joint to h and to its own accelerations.
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(size);
  gradient[0] = options.time_weight * nodes;
  std::vector<Eigen::VectorXd> free_rows, one_sided;
  const auto index = [n](int k, int i) { return 1 + k * n + i; };
  for (int i = 0; i < n; ++i) {
    Eigen::VectorXd dq = Eigen::VectorXd::Zero(size), dv = Eigen::VectorXd::Zero(size);
    for (int k = 0; k < nodes; ++k) {
      if (k > 0) {
        const double v = at(r.qdot, k - 1, i), a = at(r.qddot, k - 1, i);
        dq += h * dv;
        dq[0] += v + h * a;
        dq[index(k - 1, i)] += 0.5 * h * h;
        dv[0] += a;
        dv[index(k - 1, i)] += h;
      }
      const double tolerance = 1e-6;
      const double q = at(r.q, k, i), v = at(r.qdot, k, i), a = at(r.qddot, k, i);
      if (k > 0 && k < nodes - 1) {
        if (cost) {
          JointVector g(n);
          JointMatrix hessian(n, n);
          cost->model(Eigen::Map<const Eigen::VectorXd>(r.q.data() + k * n, n), g, hessian);
          gradient += g[i] * dq;
        }
        if (q - l.lower[i] < tolerance) one_sided.push_back(dq);
        if (l.upper[i] - q < tolerance) one_sided.push_back(-dq);
        if (l.velocity[i] + v < tolerance) one_sided.push_back(dv);
        if (l.velocity[i] - v < tolerance) one_sided.push_back(-dv);
      }
      // The point between the nodes: in the first step only h moves this point, in the last step the same holds from
      // the end.
      const double end_velocity = at(r.qdot, nodes - 1, i);
      Eigen::VectorXd between = dq + 0.5 * h * dv;
      between[0] += 0.5 * v;
      const double middle = q + 0.5 * h * v;
      if (k < nodes - 1 && (k > 0 || v != 0.0)) {
        const bool last = k == nodes - 2;
        if (middle - l.lower[i] < tolerance && !(last && !(end_velocity > 0.0))) one_sided.push_back(between);
        if (l.upper[i] - middle < tolerance && !(last && !(end_velocity < 0.0))) one_sided.push_back(-between);
      }
      if (k < nodes - 1) {
        gradient[index(k, i)] += 2.0 * options.effort_weight * a;
        Eigen::VectorXd da = Eigen::VectorXd::Zero(size);
        da[index(k, i)] = 1.0;
        if (l.acceleration[i] + a < tolerance) one_sided.push_back(da);
        if (l.acceleration[i] - a < tolerance) one_sided.push_back(-da);
      } else {
        free_rows.push_back(dq);
        free_rows.push_back(dv);
      }
    }
  }
  // Least squares in all multipliers first; a clearly negative multiplier of a limit would be a failure.
  Eigen::MatrixXd rows(size, static_cast<Eigen::Index>(free_rows.size() + one_sided.size()));
  for (std::size_t j = 0; j < free_rows.size(); ++j) rows.col(static_cast<Eigen::Index>(j)) = free_rows[j];
  for (std::size_t j = 0; j < one_sided.size(); ++j) {
    rows.col(static_cast<Eigen::Index>(free_rows.size() + j)) = one_sided[j];
  }
  const Eigen::VectorXd multipliers = test::least_squares(rows, gradient);
  double residual = (gradient - rows * multipliers).cwiseAbs().maxCoeff() / gradient.cwiseAbs().maxCoeff();
  // If the set of active rows is dependent, the signs are not determined: then only the residual counts.
  if (rows.cols() == test::rank(rows)) {
    for (std::size_t j = 0; j < one_sided.size(); ++j) {
      const double z = multipliers[static_cast<Eigen::Index>(free_rows.size() + j)];
      residual = std::max(residual, -z * one_sided[j].cwiseAbs().maxCoeff() / gradient.cwiseAbs().maxCoeff());
    }
  }
  return {residual};
}

}  // namespace

TEST_CASE("without limits and costs the optimum has a closed form") {
  // t_F⁵ = 4 N⁴ ‖Δq‖² w_e/(S w_t), S = m(m² − 1)/12, m = N − 1: accelerations are a line in time.
  Random random(1);
  for (int trial = 0; trial < 200; ++trial) {
    const int n = random.integer(1, 16);
    TimeOptimalOptions options;
    options.nodes = random.integer(5, 60);
    options.time_weight = random.decades(-2, 3);
    options.effort_weight = random.decades(-2, 2);
    const double infinity = std::numeric_limits<double>::infinity();
    TimeOptimal planner(row_of_joints(n, infinity, infinity, infinity), nullptr, options);
    TimeOptimalProblem problem;
    problem.start = random.vector(n);
    problem.goal = random.vector(n);
    const TimeOptimalResult r = planner.solve(problem);
    REQUIRE(r.status == PlanStatus::Optimal);
    const double m = options.nodes - 1, s = m * (m * m - 1.0) / 12.0;
    const double expected = std::pow(4.0 * std::pow(options.nodes, 4) * (problem.goal - problem.start).squaredNorm() *
                                         options.effort_weight / (s * options.time_weight),
                                     0.2);
    CHECK(r.duration == doctest::Approx(expected).epsilon(1e-7));
    CHECK(r.cost == doctest::Approx(1.25 * options.time_weight * expected).epsilon(1e-9));
  }
}

TEST_CASE("constraints hold, the objective is the stated one, and the motion is stationary") {
  Random random(2);
  int optimal = 0, moving = 0;
  for (const auto& [key, arm] : test::arms()) {
    const std::string& name = key;
    const Chain chain = with_accelerations(arm, 10.0);
    const int n = chain.dof();
    for (int trial = 0; trial < 12; ++trial) {
      CAPTURE(name);
      CAPTURE(trial);
      TimeOptimalOptions options;
      options.time_weight = trial % 2 ? 600.0 : 1.0;
      options.nodes = trial % 3 ? 30 : 17;
      TimeOptimalProblem problem{between(random, chain.limits().lower, chain.limits().upper),
                                 between(random, chain.limits().lower, chain.limits().upper),
                                 {},
                                 {},
                                 {}};
      std::shared_ptr<Hills> hills;
      if (trial >= 4) {
        std::vector<Hills::Hill> list;
        for (int j = 0; j < 3; ++j) {
          const double part = random.uniform(0.2, 0.8);
          list.push_back({(1.0 - part) * problem.start + part * problem.goal + 0.1 * random.vector(n),
                          random.decades(0, 4), random.uniform(0.05, 0.5)});
        }
        hills = std::make_shared<Hills>(n, list);
      }
      TimeOptimal planner(chain, hills, options);
      const TimeOptimalResult r = planner.solve(problem);
      REQUIRE(r.status != PlanStatus::Failed);
      CHECK(violation(chain, problem, r) < 1e-9);
      CHECK(r.cost == doctest::Approx(objective(r, n, options, hills.get())).epsilon(1e-9));
      if (r.status != PlanStatus::Optimal) continue;
      ++optimal;
      CHECK(stationarity(chain, r, options, hills.get()).residual < 1e-3);
      moving += r.duration > 0.1;
    }
  }
  CHECK(optimal >= 105);  // of 108
  CHECK(moving == optimal);
}

TEST_CASE("ends that move") {
  Random random(3);
  int solved = 0, cases = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const int n = random.integer(1, 9);
    const Chain chain = row_of_joints(n, 2.5, 1.5, 6.0);
    TimeOptimalOptions options;
    options.time_weight = random.decades(0, 3);
    TimeOptimal planner(chain, nullptr, options);
    TimeOptimalProblem problem;
    problem.start = between(random, JointVector::Constant(n, -1.8), JointVector::Constant(n, 1.8));
    problem.goal = between(random, JointVector::Constant(n, -1.8), JointVector::Constant(n, 1.8));
    problem.start_velocity = between(random, JointVector::Constant(n, -1.2), JointVector::Constant(n, 1.2));
    problem.goal_velocity = between(random, JointVector::Constant(n, -1.2), JointVector::Constant(n, 1.2));
    const TimeOptimalResult r = planner.solve(problem);
    ++cases;
    if (r.status == PlanStatus::Failed) {
      CHECK(r.q.empty());
      continue;
    }
    ++solved;
    CAPTURE(trial);
    CHECK(violation(chain, problem, r) < 1e-9);
    CHECK(stationarity(chain, r, options, nullptr).residual < 1e-3);
  }
  MESSAGE(solved << " of " << cases);
  CHECK(solved >= cases * 95 / 100);  // 0.7 rad is room to stop 1.2 rad/s at 6 rad/s²; a grid may still be too coarse
}

TEST_CASE("starts and goals on a limit, and no way to go at all") {
  const Chain chain = row_of_joints(7, 1.0, 1.0, 5.0);
  TimeOptimal planner(chain, nullptr, {.time_weight = 600.0});
  TimeOptimalProblem problem;
  problem.start = JointVector::Constant(7, 1.0);
  problem.goal = problem.start;
  problem.goal[0] = -1.0;  // six joints stay on their limit
  TimeOptimalResult r = planner.solve(problem);
  CHECK(r.status != PlanStatus::Failed);
  CHECK(violation(chain, problem, r) < 1e-9);
  CHECK(r.duration == doctest::Approx(2.3).epsilon(0.1));

  problem.goal = problem.start;  // the motion stands still, on the limits
  r = planner.solve(problem);
  CHECK(r.status != PlanStatus::Failed);
  CHECK(violation(chain, problem, r) < 1e-9);
  CHECK(r.duration < 0.1);

  problem.goal = problem.start = JointVector::Zero(7);
  r = planner.solve(problem);
  CHECK(r.status == PlanStatus::Optimal);
  CHECK(violation(chain, problem, r) < 1e-9);
  CHECK(r.duration < 1e-6);
}

TEST_CASE("a node on top of a hill does not stay there") {
  // The straight line's middle node is the summit: no force, and a second start has to find the way down.
  const int n = 7;
  const Chain chain = row_of_joints(n, 3.0, 2.0, 10.0);
  TimeOptimalProblem problem;
  problem.start = JointVector::Constant(n, -1.0);
  problem.goal = JointVector::Constant(n, 1.0);
  const auto hill = std::make_shared<Hills>(n, std::vector<Hills::Hill>{{JointVector::Zero(n), 1e5, 0.1}});
  TimeOptimal planner(chain, hill, {.nodes = 31, .time_weight = 600.0});
  const TimeOptimalResult r = planner.solve(problem);
  CHECK(r.status == PlanStatus::Optimal);
  CHECK(r.starts == 3);
  CHECK(r.cost < 3000.0);
  CHECK(violation(chain, problem, r) < 1e-9);
}

TEST_CASE("what is refused") {
  const Chain chain = row_of_joints(3, 1.0, 1.0, 5.0);
  const auto refuse = [&](const TimeOptimalOptions& options) {
    CHECK_THROWS_AS(TimeOptimal(chain, nullptr, options), Error);
  };
  refuse({.nodes = 4});
  refuse({.time_weight = 0.0});
  refuse({.effort_weight = -1.0});
  refuse({.tolerance = 0.0});
  refuse({.max_iterations = 0});
  refuse({.time_weight = std::nan("")});
  const double infinity = std::numeric_limits<double>::infinity();
  CHECK_THROWS_AS(TimeOptimal(row_of_joints(3, 1.0, 1.0, infinity), nullptr, {.effort_weight = 0.0}), Error);
  CHECK_THROWS_AS(TimeOptimal(chain, std::make_shared<Hills>(4, std::vector<Hills::Hill>{})), Error);

  TimeOptimal planner(chain, nullptr);
  const JointVector zero = JointVector::Zero(3);
  CHECK_THROWS_AS(planner.solve({JointVector::Zero(2), zero, {}, {}, {}}), Error);
  CHECK_THROWS_AS(planner.solve({zero, JointVector::Constant(3, 1.1), {}, {}, {}}), Error);
  CHECK_THROWS_AS(planner.solve({zero, JointVector::Constant(3, std::nan("")), {}, {}, {}}), Error);
  CHECK_THROWS_AS(planner.solve({zero, zero, JointVector::Constant(3, 1.1), {}, {}}), Error);
  CHECK_THROWS_AS(planner.solve({zero, zero, {}, JointVector::Zero(4), {}}), Error);
  CHECK_THROWS_WITH(planner.solve({zero, JointVector::Constant(3, 1.5), {}, {}, {}}),
                    "goal of joint 'j0' is 1.5, outside [-1, 1] rad or m");
}
