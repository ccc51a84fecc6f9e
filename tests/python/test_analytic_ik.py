"""AnalyticIk from Python: postures against chain.pose and a search, limits, singular poses, refusals."""

import numpy as np
import pytest

import sigmaik as sk

ARMS = ["comau_racer_7_1_4", "kuka_kr6_r900", "puma560"]


@pytest.fixture(params=ARMS)
def chain(request):
    return sk.robots.load(request.param)


@pytest.fixture
def kuka():
    return sk.robots.load("kuka_kr6_r900")


def apart(a, b):
    """Largest difference of joints; whole turns do not count."""
    difference = np.asarray(a) - b
    return np.max(np.abs(difference - 2 * np.pi * np.round(difference / (2 * np.pi))), axis=-1)


def miss(chain, q, T):
    return np.max(np.abs(chain.pose(q) - T))


def is_regular(chain, q):
    return np.linalg.svd(chain.jacobian(q), compute_uv=False)[-1] > 1e-3


# Every posture ----------


def test_every_posture_reaches_the_pose(chain):
    ik = sk.AnalyticIk(chain)
    rng = np.random.default_rng(1)
    for q in filter(lambda q: is_regular(chain, q), rng.uniform(-3, 3, (300, 6))):
        T = chain.pose(q)
        found = ik.solve(T)
        assert found.shape in ((4, 6), (8, 6))
        assert found.dtype == np.float64
        assert miss(chain, found, T) < 1e-12
        assert np.min(apart(found, q)) < 1e-9
        for i in range(len(found)):
            assert np.all(apart(found[:i], found[i]) > 1e-6)


def test_no_posture_is_missed(kuka):
    """Newton's method from many starts, with the singular value decomposition for its steps."""
    ik = sk.AnalyticIk(kuka)
    rng = np.random.default_rng(2)
    T = kuka.pose([0.3, -1.2, 1.4, 0.7, 0.9, -0.4])
    found, hits = ik.solve(T), np.zeros(8, dtype=int)
    assert len(found) == 8
    for q in rng.uniform(-3, 3, (250, 6)):
        for _ in range(60):
            error = sk.pose_error(kuka.pose(q), T)
            step = np.linalg.pinv(kuka.jacobian(q), rcond=1e-3) @ error
            q = q + step * min(1.0, 0.5 / max(np.linalg.norm(step), 1e-300))
        if np.linalg.norm(error) > 1e-10:
            continue
        assert np.min(apart(found, q)) < 1e-8
        hits[np.argmin(apart(found, q))] += 1
    assert np.all(hits > 0)


def test_limits(chain):
    ik = sk.AnalyticIk(chain)
    lower, upper = chain.limits.lower, chain.limits.upper
    rng = np.random.default_rng(3)
    dropped = 0
    for q in rng.uniform(np.maximum(lower, -3), np.minimum(upper, 3), (200, 6)):
        T = chain.pose(q)
        every, within = ik.solve(T), ik.solve(T, within_limits=True)
        inside = np.all((lower <= every) & (every <= upper), axis=1)
        np.testing.assert_array_equal(every[inside], within)
        assert len(within) >= 1
        dropped += len(every) - len(within)
        branches = ik.branches(T)
        np.testing.assert_array_equal([b.q for b in branches], every)
        np.testing.assert_array_equal([b.within_limits for b in branches], inside)
        assert all(b.within_limits for b in ik.branches(T, within_limits=True))
        outside = every[~inside]
        turned = outside[(outside < lower) | (outside > upper)]
        assert np.all((turned > -np.pi) & (turned <= np.pi))
    assert dropped > 0


def test_out_of_reach(chain):
    ik = sk.AnalyticIk(chain)
    T = np.eye(4)
    T[:3, 3] = [10.0, 0.0, 0.0]
    assert ik.solve(T).shape == (0, 6)
    assert ik.branches(T) == []
    assert ik.nearest(T, np.zeros(6)) is None
    assert ik.singular(T) == ()


# The nearest posture ----------


def test_nearest_is_the_nearest(chain):
    free = chain.with_limits(lower=-np.inf, upper=np.inf)
    ik = sk.AnalyticIk(free)
    rng = np.random.default_rng(4)
    for q in filter(lambda q: is_regular(chain, q), rng.uniform(-3, 3, (200, 6))):
        T, near = chain.pose(q), q + rng.normal(size=6)
        found = ik.nearest(T, near)
        assert found.shape == (6,)
        assert miss(chain, found, T) < 1e-12
        every = ik.solve(T)
        every += 2 * np.pi * np.round((near - every) / (2 * np.pi))
        least = np.min(np.linalg.norm(every - near, axis=1))
        assert np.linalg.norm(found - near) == pytest.approx(least, abs=1e-9)
        np.testing.assert_allclose(ik.nearest(T, q), q, rtol=0, atol=1e-9)


def test_nearest_prefers_what_is_within_limits(kuka):
    q = np.array([0.3, -1.2, 1.4, 0.7, 0.9, -0.4])
    T = kuka.pose(q)
    lower, upper = kuka.limits.lower.copy(), kuka.limits.upper.copy()
    lower[4], upper[4] = -2.0, 0.0  # the wrist has to turn over
    found = sk.AnalyticIk(kuka.with_limits(lower=lower, upper=upper)).nearest(T, q)
    np.testing.assert_allclose(found, q + [0, 0, 0, -np.pi, -1.8, np.pi], atol=1e-12)
    lower[4], upper[4] = -0.5, 0.5  # the limits exclude both angles of axis 5
    ik = sk.AnalyticIk(kuka.with_limits(lower=lower, upper=upper))
    np.testing.assert_allclose(ik.nearest(T, q), q, atol=1e-12)
    branches = ik.branches(T)
    assert not any(b.within_limits for b in branches if apart(b.q[:3], q[:3]) < 1e-9)
    lower[0], upper[0] = 1.5, 1.6  # joint 1 is at 0.3, or half a turn off
    ik = sk.AnalyticIk(kuka.with_limits(lower=lower, upper=upper))
    assert ik.solve(T, within_limits=True).shape == (0, 6)
    assert ik.nearest(T, q, within_limits=True) is None
    assert ik.nearest(T, q) is not None


def test_nearest_keeps_turns(kuka):
    q = np.array([0.3, -1.2, 1.4, -3.2, 0.9, 5.5])
    np.testing.assert_allclose(sk.AnalyticIk(kuka).nearest(kuka.pose(q), q), q, atol=1e-12)


# Singular poses ----------


def test_wrist(kuka):
    ik = sk.AnalyticIk(kuka)
    q = np.array([0.3, -1.2, 1.4, 0.7, 0.0, -0.4])
    T = kuka.pose(q)
    assert ik.singular(T) == ("wrist",)
    assert sorted(b.singular for b in ik.branches(T)) == [()] * 6 + [("wrist",)]
    np.testing.assert_allclose(ik.nearest(T, q), q, atol=1e-12)
    # The pose determines the sum of joints 4 and 6 only.
    found = ik.nearest(T, q + [0, 0, 0, 0.5, 0, 0])
    np.testing.assert_allclose(found, q + [0, 0, 0, 0.5, 0, -0.5], atol=1e-12)


def test_path_through_the_wrist(kuka):
    ik = sk.AnalyticIk(kuka)
    q = np.array([0.3, -1.2, 1.4, 0.7, -0.1, -0.4])
    last = q.copy()
    for angle in np.arange(-50, 51) * 0.002:
        q[4] = angle
        last = ik.nearest(kuka.pose(q), last)
        np.testing.assert_allclose(last, q, atol=1e-10)


def test_elbow_and_shoulder(kuka):
    ik = sk.AnalyticIk(kuka)
    bend = np.arctan2(0.035, 0.42)
    q = np.array([0.3, -0.5, bend, 0.7, 0.9, -0.4])
    T = kuka.pose(q)
    assert ik.singular(T) == ("elbow",)
    assert ik.solve(T).shape == (2, 6)
    np.testing.assert_allclose(ik.nearest(T, q), q, atol=1e-9)

    q[2] = 1.4
    forearm = 0.455 + np.hypot(0.42, 0.035) * np.exp(1j * (1.4 - bend))
    q[1] = -np.angle(forearm) - np.arccos(-0.025 / abs(forearm))
    T = kuka.pose(q)  # wrist centre on axis 1
    assert ik.singular(T) == ("shoulder",)
    assert miss(kuka, ik.solve(T), T) < 1e-12
    np.testing.assert_allclose(ik.nearest(T, q), q, atol=1e-9)
    assert ik.singular(kuka.pose([0.3, -1.2, 1.4, 0.7, 0.9, -0.4])) == ()


# What is refused ----------


def test_other_arms():
    with pytest.raises(sk.Error, match="axis 6 misses the point where axes 4 and 5 meet by 0.11"):
        sk.AnalyticIk(sk.robots.load("ur10"))
    with pytest.raises(ValueError, match="needs 6 joints.*there are 7"):
        sk.AnalyticIk(sk.robots.load("franka_panda"))


@pytest.mark.parametrize("call", ["solve", "branches", "singular", "nearest"])
def test_bad_pose(kuka, call):
    ik = sk.AnalyticIk(kuka)
    more = (np.zeros(6),) if call == "nearest" else ()
    for bad, text in [
        (np.eye(3), r"pose has shape \(3, 3\), needs \(4, 4\)"),
        (np.full((4, 4), np.nan), "is not finite"),
        (2 * np.eye(4), "pose is not a pose"),
        ("pose", "pose holds <U4, needs real numbers"),
    ]:
        with pytest.raises(sk.Error, match=text):
            getattr(ik, call)(bad, *more)


def test_bad_configuration(kuka):
    ik, T = sk.AnalyticIk(kuka), kuka.pose(np.full(6, 0.5))
    with pytest.raises(sk.Error, match=r"q has shape \(7,\), needs \(6,\)"):
        ik.nearest(T, np.zeros(7))
    with pytest.raises(sk.Error, match=r"q\[2\] = nan is not finite"):
        ik.nearest(T, [0, 0, np.nan, 0, 0, 0])
    with pytest.raises(sk.Error, match="q is too large"):
        ik.nearest(T, np.full(6, 1e12))
    with pytest.raises(TypeError):
        ik.solve(T, True)


def test_names(kuka):
    ik = sk.AnalyticIk(kuka)
    assert ik.chain.joint_names == kuka.joint_names
    assert repr(ik) == f"AnalyticIk('{kuka.base}' → '{kuka.tip}')"
    assert repr(ik.branches(kuka.pose(np.full(6, 0.5)))[0]).startswith("AnalyticBranch(q=[")
