"""Motions under a Gaussian-process prior: by gradient and by samples."""

import math

import numpy as np
import pytest
import scipy.interpolate
import scipy.optimize

import sigmaik as sk
from sigmaik import _core

ARMS = ("ur10", "kinova_jaco2_7dof_spherical", "kuka_lbr_iiwa_14_r820")
PLANNERS = (sk.planning.gradient, sk.planning.stochastic)


def pairs(name, count, seed=0):
    arm = sk.robots.load(name)
    rng = np.random.default_rng(seed)
    low, high = np.maximum(arm.limits.lower, -np.pi), np.minimum(arm.limits.upper, np.pi)
    low, high = np.minimum(low, high), np.maximum(low, high)
    return arm, [(rng.uniform(low, high), rng.uniform(low, high)) for _ in range(count)]


def covariance(states):
    """K̄ of the interior states, from the double integral that defines it: Brownian velocity, both end positions
    known."""
    s = np.linspace(0.0, 1.0, states)
    # Positions of an integrated Brownian motion from rest: cov(s, u) = s²(3u − s)/6, and a free first velocity.
    a, b = np.minimum.outer(s, s), np.maximum.outer(s, s)
    full = a**2 * (3 * b - a) / 6.0 + 1e9 * np.outer(s, s)
    inner = full[1:-1, 1:-1] - np.outer(full[1:-1, -1], full[-1, 1:-1]) / full[-1, -1]
    return inner / inner.diagonal().max()


def objective(arm, plan, prior_weight, k=6.0):
    line = plan.q[0] + np.linspace(0, 1, len(plan.q))[:, None] * (plan.q[-1] - plan.q[0])
    off = (plan.q - line)[1:-1]
    index = sk.indices.evaluate(arm, plan.q[1:-1], "geometry_aware", k=k)
    distance = np.sum(off * np.linalg.solve(covariance(len(plan.q)), off))
    return np.sum(np.minimum(index, 2000.0)) + prior_weight * distance


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("name", ARMS)
def test_objective_is_what_is_said_and_better_than_the_line(name, planner):
    arm, tasks = pairs(name, 10)
    for start, goal in tasks:
        plan = planner(arm, start, goal, prior_weight=10.0, whole_turns=True)
        line = start + np.linspace(0, 1, 21)[:, None] * (goal - start)
        straight = np.sum(np.minimum(sk.indices.evaluate(arm, line[1:-1], "geometry_aware"), 2000.0))
        assert plan.cost <= straight
        assert plan.cost == pytest.approx(objective(arm, plan, 10.0), rel=1e-3)
        assert plan.q[0] == pytest.approx(start)
        assert plan.q[-1] == pytest.approx(goal)


def test_gradient_finds_what_scipy_finds():
    arm, tasks = pairs("ur10", 4, 1)
    factor = np.linalg.cholesky(covariance(21))
    for start, goal in tasks:
        plan = sk.planning.gradient(arm, start, goal, prior_weight=100.0, tolerance=1e-10, max_iterations=500)
        line = start + np.linspace(0, 1, 21)[1:-1, None] * (goal - start)

        def function(x, line=line, arm=arm):
            q = line + factor @ x.reshape(line.shape)
            value = sk.indices.evaluate(arm, q, "geometry_aware")
            slope = sk.indices.gradient(arm, q, "geometry_aware")
            return np.sum(value) + 100.0 * x @ x, (factor.T @ slope).ravel() + 200.0 * x

        off = np.linalg.solve(factor, plan.q[1:-1] - line)
        other = scipy.optimize.minimize(function, off.ravel(), jac=True, method="L-BFGS-B")
        assert plan.cost == pytest.approx(other.fun, rel=1e-5)


@pytest.mark.parametrize("planner", PLANNERS)
def test_limits_hold_between_the_states(planner):
    for name in ("franka_panda", "kuka_lbr_iiwa_14_r820", "comau_racer_7_1_4"):
        arm = sk.robots.load(name)
        rng = np.random.default_rng(3)
        for _ in range(15):
            start, goal = arm.random_configuration(rng), arm.random_configuration(rng)
            start[2] = arm.limits.upper[2]  # on a limit
            plan = planner(arm, start, goal, prior_weight=1.0)
            t = np.linspace(0.0, plan.duration, 4001)
            q, qdot, qddot = plan.sample(t)
            assert np.all(q >= arm.limits.lower - 1e-12)
            assert np.all(q <= arm.limits.upper + 1e-12)
            assert np.all(np.abs(qdot) <= arm.limits.velocity * (1 + 1e-9))
            assert np.all(np.abs(qddot) <= arm.limits.acceleration * (1 + 1e-9))
            # As fast as they allow.
            most = np.max(np.abs(qdot) / arm.limits.velocity)
            assert max(most, np.max(np.sqrt(np.abs(qddot) / arm.limits.acceleration))) > 0.99


def test_between_the_states_is_the_natural_spline():
    arm, tasks = pairs("ur10", 3)
    for start, goal in tasks:
        plan = sk.planning.gradient(arm, start, goal, duration=2.0)
        spline = scipy.interpolate.CubicSpline(plan.t, plan.q, bc_type="natural")
        t = np.linspace(0.0, 2.0, 500)
        for order, got in enumerate(plan.sample(t)):
            assert got == pytest.approx(spline(t, order), abs=1e-9)
    with pytest.raises(ValueError, match="duration"):
        sk.planning.gradient(arm, start, goal, duration=-1.0)


def test_seeds():
    arm, tasks = pairs("kuka_lbr_iiwa_14_r820", 1)
    plans = [sk.planning.stochastic(arm, *tasks[0], seed=seed) for seed in (1, 1, 2)]
    assert np.array_equal(plans[0].q, plans[1].q)
    assert not np.array_equal(plans[0].q, plans[2].q)


def test_refined_is_no_worse_and_claims_a_minimum():
    arm, tasks = pairs("ur10", 5, 2)
    for start, goal in tasks:
        rough, fine = (sk.planning.stochastic(arm, start, goal, refine=refine) for refine in (False, True))
        assert rough.status == "feasible"
        assert fine.status == "optimal"
        assert fine.cost <= rough.cost * (1 + 1e-9)


def test_manipulability_and_costs_of_ones_own():
    arm, tasks = pairs("kuka_lbr_iiwa_14_r820", 5, 4)
    for start, goal in tasks:
        plan = sk.planning.gradient(arm, start, goal, index="manipulability", prior_weight=0.1)
        line = start + np.linspace(0, 1, 21)[:, None] * (goal - start)
        before, after = (np.mean(np.log(sk.indices.evaluate(arm, q[1:-1], "manipulability"))) for q in (line, plan.q))
        assert after > before
        alone = sk.planning.gradient(arm, start, goal, index=None, costs=(_core.geometry_aware_cost(arm, 6.0, 1.0),))
        assert alone.cost == pytest.approx(sk.planning.gradient(arm, start, goal).cost, rel=1e-12)


def test_costs():
    arm = sk.robots.load("kuka_lbr_iiwa_14_r820")
    rng = np.random.default_rng(0)
    geometry, log = _core.geometry_aware_cost(arm, 6.0, 2.0), _core.log_manipulability_cost(arm, 3.0)
    both = _core.sum_of_costs([geometry, log])
    for _ in range(50):
        q = arm.random_configuration(rng)
        assert geometry.value(q) == pytest.approx(2.0 * min(sk.indices.evaluate(arm, q, "geometry_aware"), 2000.0))
        assert log.value(q) == pytest.approx(-3.0 * math.log(sk.indices.evaluate(arm, q, "manipulability")))
        assert both.value(q) == pytest.approx(geometry.value(q) + log.value(q))
        if sk.indices.evaluate(arm, q, "min_singular_value") < 0.05:
            continue
        value, gradient, hessian = both.model(q)
        assert value == pytest.approx(both.value(q))
        for k, step in enumerate(1e-6 * np.eye(7)):
            difference = (both.value(q + step) - both.value(q - step)) / 2e-6
            assert gradient[k] == pytest.approx(difference, rel=1e-5, abs=1e-5)
            slope = (both.model(q + step)[1] - both.model(q - step)[1]) / 2e-6
            assert hessian[k] == pytest.approx(slope, rel=1e-3, abs=1e-2)
    q[3] = 0.0
    assert geometry.value(q) == 4000.0
    assert np.array_equal(geometry.model(q)[1], np.zeros(7))
    with pytest.raises(ValueError, match="no cost"):
        _core.sum_of_costs([])


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"index": "speed"}, "index = 'speed'"),
        ({"index": None}, "no cost"),
        ({"states": 2}, "states = 2"),
        ({"goal": np.full(7, 9.0)}, "goal of joint 'joint1' is 9"),
        ({"start": np.zeros(6)}, "start"),
        ({"prior_weight": -1.0}, "prior_weight"),
        ({"max_iterations": 0}, "max_iterations"),
        ({"tolerance": -1.0}, "tolerance"),
    ],
)
def test_refusals(planner, change, text):
    home = sk.robots.home("franka_panda")
    with pytest.raises(ValueError, match=text):
        planner(sk.robots.load("franka_panda"), **{"start": home, "goal": home + 0.1, **change})


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"samples": 1}, "samples"),
        ({"deviation": 0.0}, "deviation"),
        ({"decay": 1.5}, "decay"),
        ({"temperature": 0.0}, "temper"),
    ],
)
def test_refusals_of_the_stochastic_one(change, text):
    home = sk.robots.home("franka_panda")
    with pytest.raises(ValueError, match=text):
        sk.planning.stochastic(sk.robots.load("franka_panda"), home, home + 0.1, **change)


# A table in front of the arm: from under it to above it.
@pytest.fixture(scope="module")
def table():
    arm = sk.robots.load("kuka_lbr_iiwa_14_r820")
    obstacles = sk.planning.Obstacles([sk.planning.Box(size=(0.5, 1.0, 0.04), pose=(0.65, 0.0, 0.45))])
    spheres = sk.planning.arm_spheres(arm)
    rng = np.random.default_rng(0)

    def configuration(low, high):
        while True:
            q = arm.random_configuration(rng)
            x, y, z = arm.pose(q)[:3, 3]
            near = 0.45 < x < 0.8 and abs(y) < 0.3 and low < z < high
            if near and sk.planning.min_distance(spheres, obstacles, q) > 0.03:
                return q

    return arm, obstacles, spheres, [(configuration(0.1, 0.3), configuration(0.55, 0.9)) for _ in range(6)]


@pytest.mark.parametrize("refine", [False, True])
def test_around_a_table(table, refine):
    arm, obstacles, spheres, tasks = table
    means = []
    for start, goal in tasks:
        line = start + np.linspace(0, 1, 200)[:, None] * (goal - start)
        for index in ("geometry_aware", None):
            plan = sk.planning.stochastic(
                arm, start, goal, obstacles, spheres=spheres, index=index, max_iterations=100, refine=refine
            )
            assert plan.status != "failed"
            # Ten times finer than what the planner looks at.
            q = plan.sample(np.linspace(0.0, plan.duration, 2001))[0]
            assert np.min(sk.planning.min_distance(spheres, obstacles, q)) > -1e-3
            means.append(np.mean(plan.clearance.manipulability))
        assert np.min(sk.planning.min_distance(spheres, obstacles, line)) < 0.05
    assert np.mean(means[0::2]) > 1.2 * np.mean(means[1::2])


def test_what_touches_is_refused_or_fails(table):
    arm, obstacles, spheres, tasks = table
    start, goal = tasks[0]
    inside = next(
        q
        for q in (arm.random_configuration(seed) for seed in range(10_000))
        if sk.planning.min_distance(spheres, obstacles, q) < -0.01
    )
    for planner in PLANNERS:
        with pytest.raises(ValueError, match="the goal is in collision"):
            planner(arm, start, inside, obstacles, spheres=spheres)
    # Where obstacles cost almost nothing, the motion goes through an obstacle, and the plan has failed.
    for start, goal in tasks:
        line = start + np.linspace(0, 1, 200)[:, None] * (goal - start)
        if np.min(sk.planning.min_distance(spheres, obstacles, line)) > -0.02:
            continue
        plan = sk.planning.gradient(
            arm, start, goal, obstacles, spheres=spheres, obstacle_weight=1e-9, prior_weight=1e4
        )
        assert plan.status == "failed"
        assert plan.q.shape == (0, 7)
        assert plan.clearance is None
        break
    else:
        pytest.fail("no task leads through the table")


def test_restarts_where_the_straight_line_leads_into_an_obstacle(table):
    arm, obstacles, spheres, tasks = table
    stuck = 0
    for start, goal in tasks:
        once, plan, again = (
            sk.planning.gradient(arm, start, goal, obstacles, spheres=spheres, restarts=restarts)
            for restarts in (0, 8, 8)
        )
        assert np.array_equal(plan.q, again.q)
        assert plan.status != "failed"
        q = plan.sample(np.linspace(0.0, plan.duration, 2001))[0]
        assert np.min(sk.planning.min_distance(spheres, obstacles, q)) > -1e-3
        if once.status == "failed":
            stuck += 1
            # More restarts give no worse plan.
            few = sk.planning.gradient(arm, start, goal, obstacles, spheres=spheres, restarts=4)
            assert few.status == "failed" or plan.cost <= few.cost
        else:
            assert np.array_equal(plan.q, once.q)
    assert stuck > 0
    with pytest.raises(ValueError, match="restarts = -1"):
        sk.planning.gradient(arm, *tasks[0], restarts=-1)


def test_first_guesses_are_from_the_prior():
    arm, tasks = pairs("ur10", 1)
    start, goal = tasks[0]
    start, goal = 0.1 * start, 0.1 * goal  # far from limits
    cost = _core.geometry_aware_cost(arm, 6.0, 1.0)
    line = np.linspace(start, goal, 11)

    def draw(deviation, seed):
        return _core.draw_from_prior(arm, cost, 11, start, goal, deviation=deviation, seed=seed)

    drawn = [draw(0.5, seed) for seed in range(4000)]
    off = np.array(drawn) - line
    assert np.all(off[:, [0, -1]] == 0.0)
    off = off[:, 1:-1].transpose(0, 2, 1).reshape(-1, 9)
    # A covariance of 24 000 draws is known to 1 % of the variances, 0.25 at most; joints are independent, so are seeds.
    assert off.T @ off / len(off) == pytest.approx(0.25 * covariance(11), abs=0.25 * 0.05)
    assert np.mean(off, axis=0) == pytest.approx(np.zeros(9), abs=0.02)
    assert np.array_equal(draw(0.5, 7), drawn[7])
    assert draw(0.0, 0) == pytest.approx(line)
    with pytest.raises(sk.Error, match="deviation"):
        draw(-1.0, 0)


def test_self_collision_may_be_switched_on():
    arm = sk.robots.load("franka_panda")
    rng = np.random.default_rng(1)
    start, goal = arm.random_configuration(rng), arm.random_configuration(rng)
    plan = sk.planning.gradient(arm, start, goal, self_collision=True)
    assert plan.status in ("optimal", "feasible")
