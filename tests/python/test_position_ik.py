"""PositionIk from Python: solutions inside the limits, the nearest one, all of them, batches, masks, refusals."""

import threading

import numpy as np
import pytest

import sigmaik as sk


def sample(chain, rng, size=None):
    """Configurations inside the limits, within ±π where there is none."""
    lower = np.where(np.isfinite(chain.limits.lower), chain.limits.lower, -np.pi)
    upper = np.where(np.isfinite(chain.limits.upper), chain.limits.upper, np.pi)
    return rng.uniform(lower, upper, (chain.dof,) if size is None else (size, chain.dof))


def miss(chain, q, target):
    error = sk.pose_error(chain.pose(q), target)
    return np.linalg.norm(error[:3]), np.linalg.norm(error[3:])


def inside(chain, q):
    return np.all((chain.limits.lower <= q) & (q <= chain.limits.upper))


@pytest.fixture(params=sk.robots.names())
def chain(request):
    return sk.robots.load(request.param)


@pytest.fixture
def ur10():
    return sk.robots.load("ur10")


# Solutions ----------


def test_every_pose_of_a_shipped_arm_is_solved_inside_the_limits(chain):
    ik = sk.PositionIk(chain)
    rng = np.random.default_rng(1)
    for q in sample(chain, rng, 200):
        target = chain.pose(q)
        r = ik.solve(target)
        assert r.status == sk.PositionIkStatus.OK
        assert max(miss(chain, r.q, target)) < 1.001e-6
        assert inside(chain, r.q)
        np.testing.assert_allclose(r.error, sk.pose_error(chain.pose(r.q), target), atol=1e-14)
        assert 0 < r.solve_time < 1


def test_near_gives_the_configuration_itself(chain):
    ik = sk.PositionIk(chain)
    for q in sample(chain, np.random.default_rng(2), 30):
        r = ik.solve(chain.pose(q), near=q)
        assert r.status == sk.PositionIkStatus.OK
        np.testing.assert_allclose(r.q, q, atol=1e-5)


def test_near_is_the_least_travel_time_of_all_branches(ur10):
    ik = sk.PositionIk(ur10)
    rng = np.random.default_rng(3)
    speed = ur10.limits.velocity

    def travel(q, near):
        turns = [q + 2 * np.pi * k for k in (-2, -1, 0, 1, 2)]
        allowed = [np.where((ur10.limits.lower <= t) & (t <= ur10.limits.upper), abs(t - near), np.inf) for t in turns]
        return np.max(np.min(allowed, axis=0) / speed)

    for q, near in zip(sample(ur10, rng, 50), sample(ur10, rng, 50), strict=True):
        target = ur10.pose(q)
        r = ik.solve(target, near)
        least = min(travel(other, near) for other in ik.solve_all(target))
        assert np.max(np.abs(r.q - near) / speed) <= least + 1e-4


def test_all_solutions_reach_the_pose_and_the_farthest_from_the_limits_comes_first(chain):
    ik = sk.PositionIk(chain)
    for q in sample(chain, np.random.default_rng(4), 5):
        target = chain.pose(q)
        every, branches = ik.solve_all(target), ik.branches(target)
        assert every.shape == (len(branches), chain.dof)
        assert every.dtype == np.float64
        assert len(every) > 0
        for found, branch in zip(every, branches, strict=True):
            np.testing.assert_array_equal(found, branch.q)
            assert inside(chain, found)
            assert max(miss(chain, found, target)) < 1.001e-6
            assert branch.sigma_min >= 0
        margins = [branch.margin for branch in branches]
        assert margins == sorted(margins, reverse=True)


def test_a_batch_is_solve_for_each_pose_and_nan_where_none_is_found(chain):
    ik = sk.PositionIk(chain)
    poses = chain.pose(sample(chain, np.random.default_rng(5), 20))
    poses[3, :3, 3] += 30.0
    found = ik.solve_batch(poses)
    assert found.shape == (20, chain.dof)
    assert np.all(np.isnan(found[3]))
    for k in set(range(20)) - {3}:
        np.testing.assert_array_equal(found[k], ik.solve(poses[k]).q)
    np.testing.assert_array_equal(found, ik.solve_batch(poses, threads=3))
    assert ik.solve_batch(np.empty((0, 4, 4))).shape == (0, chain.dof)


def test_a_batch_lets_other_threads_run(ur10):
    ik = sk.PositionIk(ur10)
    poses = np.tile(ur10.pose(np.zeros(6)), (300, 1, 1))
    poses[:, :3, 3] += 30.0  # out of reach: all starts of the search
    done = threading.Event()
    thread = threading.Thread(target=lambda: (ik.solve_batch(poses), done.set()))
    thread.start()
    steps = 0
    while not done.is_set():
        steps += 1
    thread.join()
    assert steps > 100


def test_out_of_reach_says_so_with_the_nearest_pose(chain):
    target = np.eye(4)
    target[:3, 3] = 4.0, 3.0, 0.5
    r = sk.PositionIk(chain, mask=(1, 1, 1, 0, 0, 0)).solve(target)
    assert r.status == sk.PositionIkStatus.UNREACHABLE
    assert inside(chain, r.q)
    tips = chain.pose(sample(chain, np.random.default_rng(6), 2000))[:, :3, 3]
    assert np.linalg.norm(r.error[:3]) <= np.min(np.linalg.norm(tips - target[:3, 3], axis=1)) + 1e-9


# Options ----------


def test_a_mask_leaves_rows_free(ur10):
    ik = sk.PositionIk(ur10, mask=(1, 1, 1, 1, 1, 0), frame="tool")  # rotation about the tool's z axis is free
    rng = np.random.default_rng(7)
    for q in sample(ur10, rng, 30):
        target = ur10.pose(q)
        r = ik.solve(target, near=sample(ur10, rng))
        assert r.status == sk.PositionIkStatus.OK
        tip = ur10.pose(r.q)
        assert np.linalg.norm(tip[:3, 3] - target[:3, 3]) < 1.001e-6
        assert np.linalg.norm(tip[:3, 2] - target[:3, 2]) < 1.1e-6


def test_errors_inside_ranges_are_allowed(ur10):
    ranges = (0, 0, 0.01, np.radians(5), 0, 0)  # ±10 mm in z, ±5° about x
    ik = sk.PositionIk(ur10, ranges=ranges)
    rng = np.random.default_rng(8)
    used = 0
    for q in sample(ur10, rng, 30):
        target = ur10.pose(q)
        r = ik.solve(target, near=sample(ur10, rng))
        assert r.status == sk.PositionIkStatus.OK
        assert inside(ur10, r.q)
        assert np.all(np.abs(r.error) <= np.array(ranges) + 1.001e-6)
        used += np.linalg.norm(r.error) > 1e-3
    assert used > 20  # the nearest solution makes use of the ranges


def test_ranges_may_be_one_sided(ur10):
    ranges = np.zeros((6, 2))
    ranges[2] = -0.05, 0.0  # target minus tip: the tip may be above the target
    ik = sk.PositionIk(ur10, ranges=ranges)
    rng = np.random.default_rng(9)
    for q in sample(ur10, rng, 30):
        target = ur10.pose(q)
        r = ik.solve(target, near=sample(ur10, rng))
        assert r.status == sk.PositionIkStatus.OK
        assert -1e-6 < ur10.pose(r.q)[2, 3] - target[2, 3] < 0.05 + 1e-6


def test_a_cone_lets_an_axis_tilt_and_turn(ur10):
    ik = sk.PositionIk(ur10, cone=((0, 0, 1), 0.3))
    rng = np.random.default_rng(10)
    for q in sample(ur10, rng, 30):
        target = ur10.pose(q)
        r = ik.solve(target, near=sample(ur10, rng))
        tip = ur10.pose(r.q)
        assert r.status == sk.PositionIkStatus.OK
        assert np.linalg.norm(tip[:3, 3] - target[:3, 3]) < 1.001e-6
        assert np.arccos(np.clip(tip[:3, 2] @ target[:3, 2], -1, 1)) < 0.3 + 1e-6


def test_exact_rows_are_met_where_the_whole_pose_is_out_of_reach():
    whole = sk.robots.load("ur10")
    arm = sk.Chain.from_urdf(sk.robots.path("ur10"), tip=whole.segments[4].link_name)
    assert arm.dof == 5
    ik = sk.PositionIk(arm, exact=(1, 1, 1, 0, 0, 0))
    either = sk.PositionIk(arm)
    rng = np.random.default_rng(11)
    far = 0
    for q in sample(arm, rng, 20):
        target = arm.pose(q)
        target[:3, :3] = sk.rotation_exp(rng.normal(size=3)) @ target[:3, :3]
        r = ik.solve(target)
        assert inside(arm, r.q)
        assert np.linalg.norm(r.error[:3]) < 1.001e-6
        far += np.linalg.norm(either.solve(target).error[:3]) > 1e-3
    assert far > 10  # without `exact`, position and orientation share the error


def test_options_are_given_back(ur10):
    both = sk.PositionIk(ur10, exact=(1, 1, 1, 0, 0, 0), ranges=(0.1, 0, np.inf, 0, 0, 0), cone=((0, 1, 0), 0.2))
    options = sk.PositionIk(ur10, **both.options).options
    assert list(options["exact"]) == [True] * 3 + [False] * 3
    np.testing.assert_array_equal(options["ranges"][:3], [[-0.1, 0.1], [0, 0], [-np.inf, np.inf]])
    np.testing.assert_array_equal(options["cone"][0], [0, 1, 0])
    assert options["cone"][1] == 0.2
    ik = sk.PositionIk(ur10, (1e-4, 1e-3), mask=(1, 1, 1, 0, 0, 0), starts=20)
    again = sk.PositionIk(ur10, **ik.options)
    assert again.options["tolerance"] == (1e-4, 1e-3)
    assert again.options["starts"] == 20
    assert list(again.options["mask"]) == [True] * 3 + [False] * 3
    assert again.chain.dof == 6


def test_what_is_refused(ur10):
    with pytest.raises(sk.Error, match="tolerance"):
        sk.PositionIk(ur10, tolerance=(0.0, 1e-6))
    with pytest.raises(sk.Error, match=r"tolerance has shape \(3,\)"):
        sk.PositionIk(ur10, tolerance=(1.0, 1.0, 1.0))
    with pytest.raises(sk.Error, match="starts = 0"):
        sk.PositionIk(ur10, starts=0)
    with pytest.raises(sk.Error, match="no row"):
        sk.PositionIk(ur10, mask=(0, 0, 0, 0, 0, 0))
    with pytest.raises(sk.Error, match=r"ranges must have shape \(6,\)"):
        sk.PositionIk(ur10, ranges=(0.1, 0.1))
    with pytest.raises(sk.Error, match=r"ranges\[1\]"):
        sk.PositionIk(ur10, ranges=(0, -0.1, 0, 0, 0, 0))
    with pytest.raises(sk.Error, match="cone must be a pair"):
        sk.PositionIk(ur10, cone=0.2)
    with pytest.raises(sk.Error, match="axis of the cone has shape"):
        sk.PositionIk(ur10, cone=((0, 1), 0.2))
    with pytest.raises(sk.Error, match="angle"):
        sk.PositionIk(ur10, cone=((0, 0, 1), 4.0))
    ik = sk.PositionIk(ur10)
    good = ur10.pose(np.full(6, 0.3))
    bad = good.copy()
    bad[1, 3] = np.nan
    for call in (ik.solve, ik.solve_all, ik.branches):
        with pytest.raises(sk.Error, match="not finite"):
            call(bad)
    with pytest.raises(sk.Error, match=r"poses\[1\] is not a pose"):
        ik.solve_batch(np.stack([good, 2 * good]))
    with pytest.raises(sk.Error, match=r"poses has shape \(4, 4\)"):
        ik.solve_batch(good)
    with pytest.raises(sk.Error, match="threads = 0"):
        ik.solve_batch(good[np.newaxis], threads=0)
    with pytest.raises(sk.Error, match=r"near has shape \(5,\)"):
        ik.solve(good, near=np.zeros(5))
    with pytest.raises(sk.Error, match="too large"):
        ik.solve(good, near=np.full(6, 1e10))


def test_the_text_of_answers_is_short(ur10):
    ik = sk.PositionIk(ur10)
    target = ur10.pose(np.full(6, 0.3))
    assert repr(ik) == f"PositionIk('{ur10.base}' → '{ur10.tip}')"
    assert repr(ik.solve(target)).startswith("PositionIkResult(q=[")
    assert repr(ik.branches(target)[0]).startswith("PositionIkBranch(q=[")
