"""Costs written in Python: planners ask for values in batches, and pass on the exceptions of a cost."""

import gc
import re
import threading
import weakref
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import sigmaik as sk
from sigmaik import _core

PLANNERS = (sk.planning.gradient, sk.planning.stochastic)


class Values:
    """A cost of the core's behind Python's interface, without gradients."""

    def __init__(self, cost):
        self.cost, self.shapes, self.threads = cost, [], set()

    def value(self, q):
        self.shapes.append(q.shape)
        self.threads.add(threading.get_ident())
        return self.cost.values(q)


class Slopes(Values):
    def gradient(self, q):
        return self.cost.gradients(q)


class Answers:
    """Returns the given answers, or raises them."""

    def __init__(self, value=None, gradient=None):
        self.answers = (value, gradient)

    def _answer(self, which, q):
        answer = self.answers[which]
        if isinstance(answer, BaseException):
            raise answer
        if callable(answer):
            return answer(q)
        return np.zeros(q.shape[: which + 1])

    def value(self, q):
        return self._answer(0, q)

    def gradient(self, q):
        return self._answer(1, q)


def tasks(count, seed=0):
    arm = sk.robots.load("kuka_lbr_iiwa_14_r820")
    rng = np.random.default_rng(seed)
    return arm, [(arm.random_configuration(rng), arm.random_configuration(rng)) for _ in range(count)]


@pytest.mark.parametrize("planner", PLANNERS)
def test_the_same_plan_as_in_the_core(planner):
    arm, ends = tasks(5)
    core = _core.geometry_aware_cost(arm, 6.0, 1.0)
    for start, goal in ends:
        expected = planner(arm, start, goal, index=None, costs=(core,))
        cost = Slopes(core)
        plan = planner(arm, start, goal, index=None, costs=(cost,))
        assert np.array_equal(plan.q, expected.q)
        assert plan.cost == expected.cost
        assert plan.status == expected.status
        assert set(cost.shapes) == {(19, 7)}
        assert cost.threads == {threading.get_ident()}


def test_differences_find_the_minimum():
    arm, ends = tasks(5, 1)
    core = _core.log_manipulability_cost(arm, 1.0)
    for start, goal in ends:
        options = {"index": None, "tolerance": 1e-10, "max_iterations": 500}
        expected = sk.planning.gradient(arm, start, goal, costs=(core,), **options)
        cost = Values(core)
        plan = sk.planning.gradient(arm, start, goal, costs=(cost,), **options)
        assert plan.cost == pytest.approx(expected.cost, rel=1e-6)
        assert plan.q == pytest.approx(expected.q, abs=1e-3)
        assert set(cost.shapes) == {(19, 7), (2 * 19 * 7, 7)}


def test_differences_are_gradients():
    # One step of the search from the straight line, of a cost whose gradient is known in closed form.
    arm, ends = tasks(1, 2)
    target = np.linspace(-1.0, 1.0, 7)

    def value(q):
        return np.sum(np.cosh(q - target), axis=1)

    class Plain:
        def value(self, q):
            return value(q)

    exact = Answers(value, lambda q: np.sinh(q - target))
    plans = [
        sk.planning.gradient(arm, *ends[0], index=None, costs=(cost,), max_iterations=1) for cost in (Plain(), exact)
    ]
    assert plans[0].q == pytest.approx(plans[1].q, abs=1e-8)
    assert np.max(np.abs(plans[0].q - np.linspace(*ends[0], 21))) > 1e-3


def test_added_to_the_index_obstacles_and_each_other():
    arm, ends = tasks(3, 3)
    limits = sk.planning.joint_limit_cost(arm, margin=0.5, weight=20.0)
    log = _core.log_manipulability_cost(arm, 2.0)
    # A ball out of reach: it costs nothing, and goes through the sum like any other.
    obstacles = sk.planning.Obstacles([sk.planning.Sphere(radius=0.1, center=(3.0, 0.0, 0.0))])
    for start, goal in ends:
        expected = sk.planning.gradient(arm, start, goal, obstacles, costs=(limits, log))
        plan = sk.planning.gradient(arm, start, goal, obstacles, costs=(Slopes(limits), Slopes(log)))
        # The same terms, added in another order.
        assert plan.cost == pytest.approx(expected.cost, rel=1e-6)
        assert plan.q == pytest.approx(expected.q, abs=1e-3)


def test_it_does_what_it_is_for():
    arm, ends = tasks(1, 4)

    class NearHome:
        def value(self, q):
            return 50.0 * np.sum(q**2, axis=1)

    plain, near = (sk.planning.gradient(arm, *ends[0], costs=costs) for costs in ((), (NearHome(),)))
    assert np.sum(near.q**2) < 0.8 * np.sum(plain.q**2)


@pytest.mark.parametrize("planner", PLANNERS)
def test_what_it_raises_comes_through(planner):
    arm, ends = tasks(1)
    raised = ZeroDivisionError("at my own")
    for error in (raised, KeyboardInterrupt()):
        with pytest.raises(type(error)) as caught:
            planner(arm, *ends[0], costs=(Answers(error),))
        assert caught.value is error
        assert "value" in [entry.name for entry in caught.traceback]
    later = iter([np.zeros(19)])
    with pytest.raises(StopIteration):
        planner(arm, *ends[0], costs=(Answers(lambda q: next(later)),))
    # A failed plan leaves no trace.
    assert planner(arm, *ends[0]).q == pytest.approx(planner(arm, *ends[0], costs=(Answers(),)).q, abs=1e-9)


def test_what_is_refused():
    arm, ends = tasks(1)
    nan = np.zeros(19)
    nan[4] = np.nan
    slopes = np.zeros((19, 7))
    slopes[3, 2] = -np.inf
    for cost, text in (
        (Answers(lambda q: np.zeros((19, 1))), "Answers.value has shape (19, 1), needs (19,)"),
        (Answers(lambda q: 0.0), "Answers.value has shape (), needs (19,)"),
        (Answers(lambda q: None), "Answers.value holds object, needs real numbers"),
        (Answers(lambda q: np.zeros(19, complex)), "Answers.value holds complex128, needs real numbers"),
        (Answers(lambda q: nan), "Answers.value[4] = nan is not finite"),
        (Answers(None, lambda q: np.zeros((7, 19))), "Answers.gradient has shape (7, 19), needs (19, 7)"),
        (Answers(None, lambda q: np.zeros(19)), "Answers.gradient has shape (19,), needs (19, 7)"),
        (Answers(None, lambda q: slopes), "Answers.gradient[3, 2] = -inf is not finite"),
        (object(), "a cost of type 'object' has no method value(q)"),
        (type("Number", (), {"value": 3.0})(), "Number.value cannot be called"),
        (type("Number", (Values,), {"gradient": 3.0})(None), "Number.gradient cannot be called"),
    ):
        with pytest.raises(sk.Error, match="^" + re.escape(text)):
            sk.planning.gradient(arm, *ends[0], costs=(cost,))
    other = _core.geometry_aware_cost(sk.robots.load("ur10"), 6.0, 1.0)
    with pytest.raises(sk.Error, match="the cost is for 6 joints, the chain has 7"):
        sk.planning.gradient(arm, *ends[0], index=None, costs=(other, Answers()))


def test_arrays_are_its_own():
    arm, ends = tasks(1)
    kept = []

    def spoil(q):
        kept.append((q, q.copy()))
        q += 1.0
        return np.zeros(len(q))

    plan = sk.planning.stochastic(arm, *ends[0], costs=(Answers(spoil),))
    assert np.array_equal(plan.q, sk.planning.stochastic(arm, *ends[0]).q)
    for now, then in kept:
        assert np.array_equal(now, then + 1.0)


def test_threads():
    arm, ends = tasks(8, 5)
    core = _core.geometry_aware_cost(arm, 6.0, 1.0)
    expected = [sk.planning.gradient(arm, *task, index=None, costs=(core,)) for task in ends]
    cost = Slopes(core)
    with ThreadPoolExecutor(4) as pool:
        plans = list(pool.map(lambda task: sk.planning.gradient(arm, *task, index=None, costs=(cost,)), ends * 3))
        failed = [pool.submit(sk.planning.gradient, arm, *task, costs=(Answers(OSError("no")),)) for task in ends]
    for plan, other in zip(plans, expected * 3, strict=True):
        assert np.array_equal(plan.q, other.q)
    for future in failed:
        with pytest.raises(OSError, match="no"):
            future.result()


def test_costs_are_let_go():
    arm, ends = tasks(1)
    cost = Values(_core.log_manipulability_cost(arm, 1.0))
    gone = weakref.ref(cost)
    sk.planning.gradient(arm, *ends[0], costs=(cost,))
    del cost
    gc.collect()
    assert gone() is None
