"""Costs put together: sums, factors, costs of a user's own, and how planners take them."""

import copy
import inspect
import pickle

import numpy as np
import pytest

import sigmaik as sk
from sigmaik.planning import costs

NAMES = (
    "Collision",
    "GeometryAware",
    "JointLimits",
    "LogManipulability",
    "Manipulability",
    "Potential",
    "SelfCollision",
)


@pytest.fixture(scope="module")
def arm():
    return sk.robots.load("kuka_lbr_iiwa_14_r820")


@pytest.fixture(scope="module")
def ends(arm):
    rng = np.random.default_rng(3)
    return [(arm.random_configuration(rng), arm.random_configuration(rng)) for _ in range(4)]


@pytest.fixture(scope="module")
def ball():
    return sk.planning.Obstacles([sk.planning.Sphere(radius=0.12, center=(0.5, 0.2, 0.6))])


class NearHome:
    """The smallest cost of a user's own."""

    def value(self, q):
        return 0.5 * np.sum(q**2, axis=1)


class WithSlope(NearHome):
    def gradient(self, q):
        return q


def test_the_list_is_whole(arm, ball):
    assert set(NAMES) <= set(costs.__all__)
    rng = np.random.default_rng(0)
    q = np.array([arm.random_configuration(rng) for _ in range(5)])
    for name in NAMES:
        kind = getattr(costs, name)
        term = kind(ball) if name == "Collision" else kind()
        smooth, others = term.bind(arm)
        assert not others
        assert smooth.values(q).shape == (5,)
        assert repr(term).startswith(f"{name}(")
        assert f"2 * {name}(" in repr(2.0 * term)


def test_sums_and_factors(arm):
    rng = np.random.default_rng(1)
    q = np.array([arm.random_configuration(rng) for _ in range(20)])
    given = sk._core.log_manipulability_cost(arm, 3.0)
    cost = costs.Potential() + 2.0 * costs.Manipulability(weight=3.0) * 0.5 + given
    smooth, others = cost.bind(arm)
    assert others == ()
    sets = sk.singularities.of(arm)
    parts = [
        sk._core.potential_cost(sets, 1e2, costs.ETA1, costs.ETA2),
        sk._core.manipulability_cost(sets, 3.0, 1e-6),
        given,
    ]
    assert smooth.values(q) == pytest.approx(sum(part.values(q) for part in parts), rel=1e-12)
    assert smooth.gradients(q) == pytest.approx(sum(part.gradients(q) for part in parts), rel=1e-10, abs=1e-9)
    doubled = (2.0 * costs.Cost.of(given)).bind(arm)[0]
    for got, expected in zip(doubled.model(q[0]), given.model(q[0]), strict=True):
        assert got == pytest.approx(2.0 * np.asarray(expected))
    for factor in (-1.0, np.nan, np.inf):
        with pytest.raises(sk.Error, match="factor"):
            factor * costs.Potential()
    with pytest.raises(sk.Error, match="no method value"):
        costs.Potential() + 3.0


@pytest.mark.parametrize("kind", [NearHome, WithSlope])
def test_a_cost_of_a_users_own(arm, ends, kind):
    for start, goal in ends:
        plain = sk.planning.gradient(arm, start, goal)
        near = sk.planning.gradient(arm, start, goal, cost=costs.GeometryAware() + 100.0 * costs.Cost.of(kind()))
        assert np.sum(near.q**2) < np.sum(plain.q**2)
        both = [sk.planning.gradient(arm, start, goal, cost=c) for c in (kind() + costs.LogManipulability(), kind())]
        assert both[0].cost != both[1].cost
    with pytest.raises(sk.Error, match="Hessian"):
        sk.planning.time_optimal(arm, *ends[0], cost=costs.Potential() + kind())


def test_the_old_keywords_are_these_costs(arm, ends):
    for start, goal in ends:
        for avoid, cost in (("potential", costs.Potential()), ("manipulability", costs.Manipulability())):
            plans = [
                sk.planning.time_optimal(arm, start, goal, time_weight=600.0, **how)
                for how in ({"avoid": avoid}, {"cost": avoid}, {"cost": cost})
            ]
            for plan in plans[1:]:
                assert np.array_equal(plan.q, plans[0].q)
        for index, cost in (("geometry_aware", costs.GeometryAware()), ("manipulability", costs.LogManipulability())):
            for planner in (sk.planning.gradient, sk.planning.stochastic):
                old, new = planner(arm, start, goal, index=index), planner(arm, start, goal, cost=cost)
                assert np.array_equal(old.q, new.q)


def test_options_are_one_object_or_keywords(arm, ends):
    start, goal = ends[0]
    options = sk.planning.TimeOptimalOptions(nodes=12, time_weight=600.0)
    plan = sk.planning.time_optimal(arm, start, goal, options=options)
    assert len(plan) == 12
    assert np.array_equal(plan.q, sk.planning.time_optimal(arm, start, goal, nodes=12, time_weight=600.0).q)
    assert len(sk.planning.time_optimal(arm, start, goal, options=options, nodes=9)) == 9  # the keyword comes first
    assert len(sk.planning.gradient(arm, start, goal, options=sk.planning.GradientOptions(states=11))) == 11
    assert len(sk.planning.stochastic(arm, start, goal, options=sk.planning.StochasticOptions(states=11))) == 11
    for planner in (sk.planning.time_optimal, sk.planning.gradient, sk.planning.stochastic):
        with pytest.raises(TypeError, match=r"has no option 'weights'; it has .*max_iterations"):
            planner(arm, start, goal, weights=1.0)
    with pytest.raises(TypeError, match=r"has no option 'rang'; it has turn, .*cart_range"):
        sk.planning.cart_motion(np.zeros((3, 2)), 1.0, 1.0, 0.2, rang=(0, 1))


def test_no_function_has_more_than_eight_parameters():
    for name in sk.planning.__all__:
        thing = getattr(sk.planning, name)
        if inspect.isfunction(thing):
            assert len(inspect.signature(thing).parameters) <= 8, name


def test_round_obstacles_in_little_time(arm):
    rng = np.random.default_rng(5)
    spheres = sk.planning.arm_spheres(arm)
    blocked = found = 0
    for _ in range(40):
        start, goal = arm.random_configuration(rng), arm.random_configuration(rng)
        center = arm.pose(0.5 * (start + goal))[:3, 3]
        scene = sk.planning.Obstacles([sk.planning.Sphere(radius=0.12, center=center)])
        if np.min(sk.planning.min_distance(spheres, scene, np.array([start, goal]))) < 0.03:
            continue
        blocked += 1
        plan = sk.planning.time_optimal(arm, start, goal, obstacles=scene, time_weight=10.0)
        if plan.status == "failed":
            assert plan.q.shape == (0, 7)
            continue
        found += 1
        dense = plan.sample(np.linspace(0.0, plan.t[-1], 1000))[0]
        assert np.min(sk.planning.min_distance(spheres, scene, dense)) > -2e-3
    assert blocked > 10
    assert found > blocked / 2


def test_status_is_an_enum_and_its_text(arm, ends, tmp_path):
    plan = sk.planning.time_optimal(arm, *ends[0])
    assert plan.status is sk.planning.PlanStatus.OPTIMAL
    assert plan.status == "optimal"
    assert f"{plan.status}" == str(plan.status) == "optimal"
    again = pickle.loads(pickle.dumps(plan))
    assert np.array_equal(again.q, plan.q)
    assert again.status is plan.status
    assert [c.name for c in again.clearance.crossings] == [c.name for c in plan.clearance.crossings]
    assert repr(plan).startswith("Trajectory(optimal, 30 samples of 7 joints, ")
    text = sk.planning.Trajectory.load(plan.save(tmp_path / "plan.csv"))
    for name in ("t", "q", "qdot", "qddot"):
        assert np.array_equal(getattr(text, name), getattr(plan, name))
    assert text.duration == plan.duration
    (tmp_path / "other.csv").write_text("t,q1\n")
    with pytest.raises(sk.Error, match="not the file of a trajectory"):
        sk.planning.Trajectory.load(tmp_path / "other.csv")


def test_modules_and_functions_have_names_of_their_own():
    import importlib
    import pkgutil

    for module in pkgutil.iter_modules(sk.planning.__path__):
        loaded = importlib.import_module(f"sigmaik.planning.{module.name}")
        assert getattr(sk.planning, module.name) is loaded, module.name


@pytest.mark.parametrize("name", [name for name in NAMES if name != "Collision"])
def test_a_copy_of_a_term_is_equal(name):
    one = getattr(costs, name)(weight=2.5)
    for other in (copy.copy(one), copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
        assert other == one
        assert hash(other) == hash(one)
        assert repr(other) == repr(one)
        assert repr(other + one) == repr(one + one)
