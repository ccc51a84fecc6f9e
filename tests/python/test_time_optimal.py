"""Time-optimal motions: oracle, constraints, IPOPT, clearance, refusals."""

import math
import threading

import numpy as np
import pytest

import sigmaik as sk
from sigmaik.planning import time_optimal

WEIGHT = 600.0


def pairs(arm, count, seed=0):
    rng = np.random.default_rng(seed)
    low, high = np.maximum(arm.limits.lower, -np.pi), np.minimum(arm.limits.upper, np.pi)
    return [(rng.uniform(low, high), rng.uniform(low, high)) for _ in range(count)]


def violation(arm, plan, start, goal):
    """The largest violation of a constraint."""
    h = plan.duration / len(plan.t)
    limits = arm.limits
    return max(
        np.abs(plan.q[:-1] + h * plan.qdot[:-1] + 0.5 * h**2 * plan.qddot[:-1] - plan.q[1:]).max(),
        np.abs(plan.qdot[:-1] + h * plan.qddot[:-1] - plan.qdot[1:]).max(),
        np.max(limits.lower - plan.q),
        np.max(plan.q - limits.upper),
        np.max(np.abs(plan.qdot) - limits.velocity),
        np.max(np.abs(plan.qddot) - limits.acceleration),
        np.abs(plan.q[0] - start).max(),
        np.abs(plan.q[-1] - goal).max(),
        np.abs(plan.qdot[[0, -1]]).max(),
        np.abs(plan.t - h * np.arange(len(plan.t))).max(),
    )


def test_limits_of_position_hold_between_the_nodes():
    # Pushed against a limit by what it avoids, a joint's velocity changes its sign there.
    arm = sk.robots.load("franka_panda")
    rng = np.random.default_rng(7)
    overshoot = 0.0
    for _ in range(30):
        start, goal = (rng.uniform(arm.limits.lower, arm.limits.upper) for _ in range(2))
        for between in (True, False):
            plan = time_optimal(arm, start, goal, "manipulability", time_weight=WEIGHT, between_nodes=between)
            q = plan.sample(np.linspace(0.0, plan.t[-1], 1000))[0]
            beyond = max(np.max(arm.limits.lower - q), np.max(q - arm.limits.upper))
            if between:
                assert beyond < 1e-12
            overshoot = max(overshoot, beyond)
    assert overshoot > 1e-5


def test_closed_form_without_limits():
    # t_F⁵ = 4 N⁴ ‖Δq‖²/S with S = m(m² − 1)/12, m = N − 1
    free = sk.robots.load("franka_panda").with_limits(
        lower=-math.inf, upper=math.inf, velocity=math.inf, acceleration=math.inf
    )
    for nodes in (5, 10, 30, 31, 200):
        for start, goal in pairs(free, 5, nodes):
            plan = time_optimal(free, start, goal, nodes=nodes)
            m = nodes - 1
            expected = (4 * nodes**4 * np.sum((goal - start) ** 2) / (m * (m * m - 1) / 12)) ** 0.2
            assert plan.status == "optimal"
            assert plan.duration == pytest.approx(expected, rel=1e-7)
            assert plan.cost == pytest.approx(1.25 * expected, rel=1e-9)
            assert violation(free, plan, start, goal) < 1e-9


@pytest.mark.parametrize("avoid", [None, "manipulability", "potential"])
@pytest.mark.parametrize("weight", [1.0, WEIGHT])
@pytest.mark.parametrize("name", sk.singularities.names())
def test_constraints_and_objective(name, weight, avoid):
    arm = sk.robots.load(name)
    sing = sk.singularities.load(name)
    for start, goal in pairs(arm, 12):
        plan = time_optimal(arm, start, goal, avoid, time_weight=weight)
        assert plan.status in ("optimal", "feasible")
        assert violation(arm, plan, start, goal) < 1e-6
        cost = weight * plan.duration + np.sum(plan.qddot**2)
        if avoid == "potential":
            cost += 100.0 * np.sum(sing.potential(plan.q))
        elif avoid == "manipulability":
            cost += 100.0 * np.sum(1.0 / (sing.manipulability(plan.q) + 1e-6))
        assert plan.cost == pytest.approx(cost, rel=1e-9)
        assert plan.solve_time > 0.0


@pytest.mark.parametrize("avoid", [None, "potential"])
@pytest.mark.parametrize("name", sk.singularities.names())
def test_no_worse_than_ipopt(name, avoid):
    pytest.importorskip("casadi")
    arm = sk.robots.load(name)
    ours, theirs = [], []
    for start, goal in pairs(arm, 20, 1):
        plan = time_optimal(arm, start, goal, avoid, time_weight=WEIGHT, between_nodes=False)
        other = time_optimal(arm, start, goal, avoid, time_weight=WEIGHT, solver="ipopt", restarts=False)
        assert plan.status == "optimal"
        if other.status != "optimal":
            continue
        assert violation(arm, other, start, goal) < 1e-6
        if avoid is None:  # the problem has one minimum
            assert plan.cost == pytest.approx(other.cost, rel=1e-6)
        ours.append(plan.cost)
        theirs.append(other.cost)
    assert len(theirs) >= 18
    # Local minima differ pair by pair; bench/time_optimal.py compares over many.
    assert np.mean(ours) <= np.mean(theirs) * (1.0 + 1e-4)


def test_ipopt_takes_manipulability_both_ways():
    pytest.importorskip("casadi")
    arm = sk.robots.load("kuka_lbr_iiwa_14_r820")
    start, goal = pairs(arm, 1, 5)[0]
    plans = [
        time_optimal(arm, start, goal, "manipulability", nodes=10, generic_manipulability=generic, solver=solver)
        for solver in ("ipopt", "sigmaik")
        for generic in (False, True)
    ]
    assert all(plan.status == "optimal" for plan in plans)
    assert plans[0].cost == pytest.approx(plans[1].cost, rel=1e-3)  # local minima may differ
    assert plans[2].cost == pytest.approx(plans[3].cost, rel=1e-3)


def test_manipulability_for_any_arm():
    arm = sk.robots.load("ufactory_xarm7")
    start, goal = pairs(arm, 1, 2)[0]
    free = time_optimal(arm, start, goal, acceleration=10.0, time_weight=WEIGHT)
    clear = time_optimal(arm, start, goal, "manipulability", acceleration=10.0, time_weight=WEIGHT)
    assert clear.status == "optimal"
    m_free, m_clear = (sk.indices.evaluate(arm, p.q, "manipulability") for p in (free, clear))
    assert np.mean(m_clear) > np.mean(m_free)
    assert clear.clearance.names == ()
    assert clear.clearance.nearest_set is None
    assert clear.clearance.min_psi == math.inf
    assert clear.clearance.min_manipulability == clear.clearance.manipulability.min()


def test_given_velocities_at_the_ends():
    arm = sk.robots.load("franka_panda")
    start, goal = sk.robots.home("franka_panda"), sk.robots.home("franka_panda") + 0.5
    v0, v1 = np.full(7, 0.3), np.full(7, -0.2)
    plan = time_optimal(arm, start, goal, time_weight=WEIGHT, start_velocity=v0, goal_velocity=v1)
    assert plan.status == "optimal"
    assert plan.qdot[0] == pytest.approx(v0)
    assert plan.qdot[-1] == pytest.approx(v1)
    assert np.all(np.abs(plan.qdot) <= arm.limits.velocity)


def test_samples_between_nodes():
    arm = sk.robots.load("franka_panda")
    start, goal = pairs(arm, 1)[0]
    plan = time_optimal(arm, start, goal, time_weight=WEIGHT)
    assert plan.t[-1] == pytest.approx(plan.duration * 29 / 30)
    for x, y in zip(plan.sample(plan.t), (plan.q, plan.qdot, plan.qddot), strict=True):
        assert x == pytest.approx(y, abs=1e-12)
    q, qdot, _ = plan.sample([-1.0, plan.duration + 1.0])
    assert q[0] == pytest.approx(start)
    assert q[1] == pytest.approx(goal, abs=1e-12)
    h = 1e-6
    t = np.linspace(0.1, plan.t[-1] - 0.1, 50)
    assert (plan.sample(t + h)[0] - plan.sample(t - h)[0]) / (2 * h) == pytest.approx(plan.sample(t)[1], abs=1e-4)
    with pytest.raises(ValueError, match="finite"):
        plan.sample([math.nan])


def test_unavoidable_crossings_are_told():
    arm, sing = sk.robots.load("kuka_lbr_iiwa_14_r820"), sk.singularities.load("kuka_lbr_iiwa_14_r820")
    start, goal = np.array([0.3, 0.8, 0.2, -1.0, 0.5, 1.0, 0.0]), np.array([-0.3, 1.0, 0.3, 1.2, 0.1, 0.8, 0.5])
    plan = time_optimal(arm, start, goal, "potential", time_weight=WEIGHT)
    crossing = next(c for c in plan.clearance.crossings if c.name == "elbow")
    assert not crossing.avoidable
    assert crossing in plan.clearance.unavoidable
    assert abs(crossing.q[3]) < 0.01
    assert plan.sample([crossing.t])[0][0] == pytest.approx(crossing.q, abs=0.05)
    # Between the nodes m is far smaller than at them.
    assert plan.clearance.min_manipulability < 0.3 * sing.manipulability(plan.q).min()
    assert plan.clearance.nearest_set == "elbow"
    goal[3] = -1.2
    assert not time_optimal(arm, start, goal, "potential", time_weight=WEIGHT).clearance.unavoidable


def test_a_wall_is_not_crossed_twice_where_it_need_not_be():
    # The straight line goes through the shoulder's wall and back.
    arm, sing = sk.robots.load("comau_racer_7_1_4"), sk.singularities.load("comau_racer_7_1_4")
    rng = np.random.default_rng(0)
    tried = 0
    while tried < 5:
        start, goal = (rng.uniform(arm.limits.lower, arm.limits.upper) for _ in range(2))
        start[5] = goal[5] = 0.0
        goal[4] = start[4]
        line = start + np.linspace(0, 1, 200)[:, None] * (goal - start)
        shoulder, elbow = sing.signed_residuals(line)[:, 2], sing.signed_residuals(line)[:, 1]
        if shoulder[0] * shoulder[-1] < 0 or elbow[0] * elbow[-1] < 0 or np.all(shoulder * shoulder[0] > 0):
            continue
        if min(sing.residuals(line)[[0, -1]].min(axis=1)) < 0.02:
            continue
        tried += 1
        free = time_optimal(arm, start, goal, time_weight=WEIGHT)
        plan = time_optimal(arm, start, goal, "potential", time_weight=WEIGHT)
        assert violation(arm, plan, start, goal) < 1e-6
        assert len(plan.clearance.avoidable) <= len(free.clearance.avoidable)


def test_node_on_a_singular_set_gets_off_it():
    arm = sk.robots.load("kuka_lbr_iiwa_14_r820")
    start = np.array([0.0, 0.0, np.pi / 2, 1.0, 0.0, 1.0, 0.0])  # on the shoulder's set, half-way too
    start[1] = -1.0
    goal = start.copy()
    goal[1] = 1.0
    plan = time_optimal(arm, start, goal, "potential", nodes=31, time_weight=WEIGHT)
    assert plan.status == "optimal"
    assert plan.clearance.psi[:, 1].min() > 1e-3


def test_plans_in_threads_do_not_disturb_each_other():
    arm = sk.robots.load("franka_panda")
    cases = pairs(arm, 8)
    alone = [time_optimal(arm, a, b, "potential").cost for a, b in cases]
    together = [None] * len(cases)

    def work(i):
        together[i] = time_optimal(arm, *cases[i], "potential").cost

    threads = [threading.Thread(target=work, args=(i,)) for i in range(len(cases))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert together == alone


def test_an_unfinished_solve_says_so_and_breaks_nothing():
    arm = sk.robots.load("franka_panda")
    for start, goal in pairs(arm, 10):
        plan = time_optimal(arm, start, goal, "potential", time_weight=WEIGHT, max_iterations=2, restarts=False)
        assert plan.status == "feasible"
        assert violation(arm, plan, start, goal) < 1e-6


def test_a_failed_solve_returns_nothing():
    # No room to stop: towards the limit at full speed, close to it.
    arm = sk.robots.load("franka_panda")
    start = sk.robots.home("franka_panda")
    start[0] = arm.limits.upper[0] - 0.01
    plan = time_optimal(arm, start, sk.robots.home("franka_panda"), start_velocity=[2.0, 0, 0, 0, 0, 0, 0])
    assert plan.status == "failed"
    assert plan.q.shape == (0, 7)
    assert plan.t.size == 0
    assert math.isnan(plan.cost)
    assert plan.clearance is None
    with pytest.raises(ValueError, match="failed"):
        plan.sample([0.0])


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"avoid": "everything"}, "avoid = 'everything'"),
        ({"solver": "magic"}, "solver = 'magic'"),
        ({"nodes": 3}, "nodes = 3"),
        ({"time_weight": -1.0}, "time_weight"),
        ({"avoid": "potential", "eta2": 0.0}, "eta2"),
        ({"avoid": "manipulability", "epsilon": 0.0}, "epsilon"),
        ({"start": np.zeros(6)}, "start"),
        ({"goal": np.full(7, 9.0)}, "goal of joint 'joint1' is 9"),
        ({"start_velocity": np.full(7, 9.0)}, "start_velocity of joint"),
        ({"acceleration": -1.0}, "acceleration"),
    ],
)
def test_refusals(change, text):
    home = sk.robots.home("franka_panda")
    arguments = {"start": home, "goal": home + 0.1, **change}
    with pytest.raises(ValueError, match=text):
        time_optimal(sk.robots.load("franka_panda"), **arguments)


def test_potential_needs_known_sets():
    with pytest.raises(ValueError, match="not known; .*franka_panda"):
        time_optimal(sk.robots.load("ur10"), np.zeros(6), np.ones(6), "potential")


def test_saved_and_loaded(tmp_path):
    arm = sk.robots.load("kuka_lbr_iiwa_14_r820")
    for planner in (time_optimal, sk.planning.gradient):
        for start, goal in pairs(arm, 4, 8):
            plan = planner(arm, start, goal)
            again = sk.planning.Trajectory.load(plan.save(tmp_path / "plan.npz"))
            for name in ("t", "q", "qdot", "qddot"):
                assert np.array_equal(getattr(plan, name), getattr(again, name))
            assert (again.status, again.cost, again.duration, again.cubic) == (
                plan.status,
                plan.cost,
                plan.duration,
                plan.cubic,
            )
            assert again.clearance.names == plan.clearance.names
            assert np.array_equal(again.clearance.psi, plan.clearance.psi)
            assert [c.name for c in again.clearance.crossings] == [c.name for c in plan.clearance.crossings]
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    (tmp_path / "text.npz").write_text("text")
    for other in ("other.npz", "text.npz"):
        with pytest.raises(ValueError, match="not the file of a trajectory"):
            sk.planning.Trajectory.load(tmp_path / other)


def test_retimed():
    arm = sk.robots.load("franka_panda")
    start, goal = pairs(arm, 1)[0]
    for plan in (time_optimal(arm, start, goal), sk.planning.gradient(arm, start, goal)):
        slow = plan.retimed(3.0 * plan.duration)
        t = np.linspace(0.0, plan.duration, 100)
        for got, expected, f in zip(slow.sample(3.0 * t), plan.sample(t), (1.0, 3.0, 9.0), strict=True):
            assert got == pytest.approx(expected / f, abs=1e-12)
        assert slow.clearance.min_manipulability == plan.clearance.min_manipulability
        with pytest.raises(ValueError, match="duration"):
            plan.retimed(0.0)
