"""Cart motions: the paper's experiment, optimality, an independent solver, refusals, whole trajectories, the
command."""

import csv
import math

import numpy as np
import pytest

import sigmaik as sk
from sigmaik import _core
from sigmaik.planning import CartError, cart_motion, cart_trajectory, evaluate_cart_motion, shoulder_cylinder
from sigmaik_lab.__main__ import main
from sigmaik_lab.cart import experiment as cart

quadprog = pytest.importorskip("quadprog")

# Σ(Δx)² [mm²], highest cart position [m], touching samples, end of the region in s, top speed [mm/s], acceleration
# [mm/s²]
REFERENCE = {
    "fk": (24.359793, 0.7781139, (2362, 3605), 0.794411, 2.31573, 0.13714),
    "paper": (36.072246, 0.8297348, (2378, 4177), 0.859339, 2.48162, 0.39435),
}


@pytest.fixture(scope="module", params=cart.VARIANTS)
def taught(request):
    return cart.load(request.param)


def exact(e, **options):
    return cart_motion(
        e.flange_xy, 0.5, 0.75, 0.2, **{"turn": e.turn, "cart_range": (0, 1), "duration": 200.0, **options}
    )


def wave(rng, samples, waves):
    s = np.linspace(0.0, 1.0, samples)
    a, b, f, g = rng.uniform(0, 6), rng.uniform(0, 6), rng.uniform(0.5, 1.5) * waves, rng.uniform(0, waves)
    return np.column_stack(
        [0.4 * np.sin(2 * np.pi * g * s + b) + rng.uniform(-1, 1) * s, np.cos(2 * np.pi * f * s + a)]
    )


# --- the experiment


def test_reference(taught):
    energy, top, touching, region, speed, acceleration = REFERENCE[taught.variant]
    m = exact(taught)
    assert 1e6 * m.energy == pytest.approx(energy, abs=1e-6)
    assert m.energy == pytest.approx(np.sum(np.diff(m.x) ** 2), rel=1e-12)
    assert m.x.max() == pytest.approx(top, abs=1e-7)
    held = np.flatnonzero(np.abs(m.multipliers) > 1e-15)
    assert (held[0], held[-1]) == touching
    assert m.regions[0].last / 5067 == pytest.approx(region, abs=1e-6)
    assert [r.side for r in m.regions] == [1]
    assert 1e3 * m.max_speed == pytest.approx(speed, abs=1e-5)
    assert 1e3 * m.max_acceleration == pytest.approx(acceleration, abs=1e-5)
    assert (m.admissible, m.inside, m.time_inside) == (True, 0, 0.0)
    assert m.turn == pytest.approx(2.47, abs=1e-3)
    # Between samples the chord dips below the border by max|Δ²λ|/8 at most.
    assert 0.2 - 8e-8 < m.clearance <= 0.2


def test_karush_kuhn_tucker(taught):
    m = exact(taught)
    mu = 2 * m.x[1:-1] - m.x[:-2] - m.x[2:]
    gap = np.where(m.lower < m.upper, m.x - m.upper, math.inf)[1:-1]
    free = (m.lower > m.upper)[1:-1]
    assert gap.min() >= 0.0
    assert mu.min() >= -1e-12
    assert np.max(mu[~free] * gap[~free]) < 1e-12
    assert np.abs(mu[free]).max() < 1e-12
    assert np.abs(mu - m.multipliers[1:-1]).max() < 1e-12
    assert np.all(m.sides[m.lower < m.upper] == 1)
    assert np.all(m.sides[m.lower > m.upper] == 0)


def test_intervals_are_the_roots(taught):
    m = exact(taught)
    some = np.flatnonzero(m.lower < m.upper)
    x, y = m.flange_xy[some].T
    for root in (m.lower[some], m.upper[some]):
        assert np.abs(root**2 - 2 * x * root + x**2 + y**2 - 0.2**2).max() < 1e-15
    assert np.all(np.abs(m.flange_xy[m.lower > m.upper, 1]) >= 0.2)


@pytest.mark.parametrize(
    ("variant", "samples_inside", "range_inside", "nearest"),
    [("paper", 3480, (794, 4273), 0.0906), ("fk", 2984, (1042, 4025), 0.1020)],
)
def test_linear_law(variant, samples_inside, range_inside, nearest):
    e = cart.load(variant)
    m = evaluate_cart_motion(e.flange_xy, np.linspace(0.5, 0.75, 5068), 0.2, duration=200.0)
    inside = np.flatnonzero(np.hypot(e.flange_xy[:, 0] - m.x, e.flange_xy[:, 1]) < 0.2)
    assert (m.inside, inside[0], inside[-1]) == (samples_inside, *range_inside)
    assert m.clearance == pytest.approx(nearest, abs=5e-5)
    assert 1e6 * m.energy == pytest.approx(12.334715, abs=1e-6)
    assert not m.admissible
    assert m.time_inside == pytest.approx(samples_inside * 200 / 5067)


def test_margin_keeps_off(taught):
    m = exact(taught, margin=0.01)
    assert m.clearance == pytest.approx(0.21, abs=1e-6)
    assert m.energy > exact(taught).energy


# --- against a solver of quadratic programs


def quadratic_program(start, end, lower, upper, acceleration=math.inf, at_rest=False):
    """min Σ(Δx)² over the samples between two ends, in a tube, with bounds on second differences; None if
    infeasible."""
    m = len(lower)
    n = m - 2
    hessian = 2.0 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    linear = np.zeros(n)
    linear[0] += 2.0 * start
    linear[-1] += 2.0 * end
    step = np.diff(np.eye(m), axis=0)
    rows = [np.eye(m)[1:-1], np.diff(step, axis=0)] + ([step[[0, -1]]] if at_rest else [])
    low = np.concatenate([lower[1:-1], np.full(n + 2 * at_rest, -acceleration)])
    high = np.concatenate([upper[1:-1], np.full(n + 2 * at_rest, acceleration)])
    c = np.vstack(rows)
    c, b = np.vstack([c, -c]), np.concatenate([low, -high])
    b -= c[:, 0] * start + c[:, -1] * end
    some = np.isfinite(b)
    if not np.any(some):
        return np.concatenate([[start], np.linalg.solve(hessian, linear), [end]])
    try:
        x = quadprog.solve_qp(hessian, linear, c[some, 1:-1].T, b[some])[0]
    except ValueError:
        return None
    return np.concatenate([[start], x, [end]])


def test_agrees_with_a_qp_solver_on_both_sides_of_several_regions():
    rng = np.random.default_rng(1)
    compared = both = 0
    for _ in range(600):
        path = wave(rng, int(rng.integers(20, 120)), rng.uniform(0.3, 2.5))
        start, end, radius = rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(0.02, 0.4)
        cart_range = (-1.0, 1.0) if rng.random() < 0.5 else (-math.inf, math.inf)
        try:
            m = cart_motion(path, start, end, radius, cart_range=cart_range)
        except CartError:
            continue
        if np.any(m.corners % 1.0):
            continue  # at a region's tip, which is no sample
        low = np.where(m.sides > 0, np.maximum(m.upper, cart_range[0]), cart_range[0])
        high = np.where(m.sides < 0, np.minimum(m.lower, cart_range[1]), cart_range[1])
        assert np.abs(quadratic_program(start, end, low, high) - m.x).max() < 1e-9
        compared += 1
        both += len(m.regions) > 1 and {r.side for r in m.regions} == {1, -1}
    assert compared > 300
    assert both > 50


def test_limited_acceleration_agrees_with_a_qp_solver():
    rng = np.random.default_rng(5)
    done = refused = 0
    for _ in range(300):
        m = int(rng.integers(20, 90))
        path, (start, end) = wave(rng, m, rng.uniform(0.3, 1.5)), rng.uniform(-1, 1, 2)
        keep = {"radius": rng.uniform(0.02, 0.3), "duration": m - 1.0}
        try:
            free = cart_motion(path, start, end, **keep)
        except CartError:
            continue
        if np.any(free.corners % 1.0):
            continue
        most, at_rest = free.max_acceleration * rng.uniform(0.2, 1.5) + 1e-9, bool(rng.random() < 0.5)
        low = np.where(free.sides > 0, free.upper, -math.inf)
        high = np.where(free.sides < 0, free.lower, math.inf)
        expected = quadratic_program(start, end, low, high, most, at_rest)
        if expected is None:
            with pytest.raises(CartError, match="acceleration"):
                cart_motion(path, start, end, **keep, max_acceleration=most, at_rest=at_rest)
            refused += 1
            continue
        limited = cart_motion(path, start, end, **keep, max_acceleration=most, at_rest=at_rest)
        assert np.abs(limited.x - expected).max() < 1e-6
        assert limited.admissible
        assert limited.max_acceleration <= most * (1.0 + 1e-9)
        assert limited.energy >= free.energy * (1.0 - 1e-9)
        done += 1
    assert done > 100
    assert refused > 50


def test_from_rest_to_rest(taught):
    m = exact(taught, max_acceleration=1e-3, at_rest=True, max_speed=2.6e-3)
    assert m.admissible
    assert m.max_acceleration <= 1e-3 * (1 + 1e-6)
    assert np.abs(np.diff(m.x)[[0, -1]]).max() <= 1e-3 * (200 / 5067) ** 2 * (1 + 1e-9)
    assert m.max_speed <= 2.6e-3
    assert 1.0 < m.energy / exact(taught).energy < 1.01
    with pytest.raises(CartError, match="duration of") as refusal:
        exact(taught, max_acceleration=2e-5, at_rest=True)
    longer = float(str(refusal.value).split("a duration of ")[1].split()[0])
    assert exact(taught, max_acceleration=2e-5, at_rest=True, duration=longer).admissible


def test_least_top_speed():
    # The limit that a linear program finds is the string's own.
    linprog = pytest.importorskip("scipy.optimize").linprog
    rng = np.random.default_rng(2)
    for _ in range(30):
        path = wave(rng, 60, 1.0)
        try:
            m = cart_motion(path, rng.uniform(-1, 1), rng.uniform(-1, 1), 0.3, duration=59.0)
        except CartError:
            continue
        if np.any(m.corners % 1.0):
            continue
        low = np.where(m.sides > 0, m.upper, -math.inf)
        high = np.where(m.sides < 0, m.lower, math.inf)
        low[[0, -1]] = high[[0, -1]] = m.x[[0, -1]]
        step = np.column_stack([np.eye(60, k=1)[:-1] - np.eye(60)[:-1], -np.ones(59)])
        back = np.column_stack([-step[:, :-1], -np.ones(59)])
        best = linprog(
            np.eye(61)[-1], np.vstack([step, back]), np.zeros(118), bounds=[*zip(low, high, strict=True), (0, None)]
        )
        assert m.max_speed == pytest.approx(best.fun, rel=1e-7)


# --- properties


def test_scale_and_time():
    rng = np.random.default_rng(3)
    for _ in range(50):
        path = wave(rng, 100, 1.5)
        start, end = rng.uniform(-1, 1, 2)
        try:
            m = cart_motion(path, start, end, 0.2)
        except CartError:
            continue
        mm = cart_motion(1e3 * path, 1e3 * start, 1e3 * end, 200.0, duration=7.0)
        assert np.abs(mm.x - 1e3 * m.x).max() < 1e-9
        assert mm.clearance == pytest.approx(1e3 * m.clearance)
        assert mm.max_speed == pytest.approx(1e3 * m.max_speed / 7.0)
        assert mm.sample(np.linspace(-1, 9, 50))[[0, -1]] == pytest.approx([1e3 * start, 1e3 * end])
        assert m.sample(m.t) == pytest.approx(m.x, abs=1e-12)


def test_tip_between_samples():
    # Down past the region at once after its end: the law bends at the tip, which is no sample.
    path = np.column_stack([np.zeros(60), np.linspace(0.1, -0.2025, 60)])
    m = cart_motion(path, 0.3, -0.6, 0.2)
    tip = m.regions[0].last
    assert tip % 1.0 != 0.0
    assert tip in m.corners
    assert m.sample(tip / 59) == pytest.approx(0.0, abs=1e-9)
    # Clearance and energy belong to the chords through the corners, and not to the samples alone.
    assert m.clearance == pytest.approx(0.2, abs=2e-3)
    assert m.energy == pytest.approx(np.sum(np.diff(m.corner_x) ** 2 / np.diff(m.corners)))


# --- refusals


def test_what_cannot_be_done_is_told_apart():
    through = np.column_stack([np.zeros(101), np.linspace(0.5, -0.5, 101)])
    over = 0.3 * through
    cases = [
        ("start inside", over, 0.1, 0.5, {}, math.hypot(0.1, 0.15)),
        ("end inside", over, 0.5, -0.1, {}, 0.15),
        ("opposite sides", over, 0.5, -0.5, {}, 0.15),
        ("range", through, 0.02, 0.02, {"cart_range": (-0.1, 0.12)}, 0.12),
        ("winding", through, 0.02, 0.02, {"turn": 9.0}, math.nan),
        ("speed", through, 0.0, 0.0, {"max_speed": 1e-3}, None),
        ("acceleration", through, 0.0, 0.0, {"max_acceleration": 1e-3}, math.nan),
    ]
    for reason, path, start, end, options, feasible in cases:
        with pytest.raises(CartError, match=reason) as refusal:
            cart_motion(path, start, end, 0.2, **options)
        assert isinstance(refusal.value, sk.Error)
        assert isinstance(refusal.value, ValueError)
        assert refusal.value.reason == reason
        if feasible is not None:
            assert refusal.value.feasible_radius == pytest.approx(feasible, rel=1e-8, nan_ok=True)
        if math.isfinite(refusal.value.feasible_radius):
            cart_motion(path, start, end, refusal.value.feasible_radius, **options)
    assert cart_motion(through, 0.02, 0.02, 0.2, turn=math.pi).regions[0].side == 1
    assert cart_motion(through, 0.02, 0.02, 0.2, turn=-math.pi).regions[0].side == -1


def test_the_taught_turn_excludes_the_other_side(taught):
    with pytest.raises(CartError) as refusal:
        exact(taught, turn=taught.turn - 2 * math.pi)
    assert refusal.value.reason == "winding"


@pytest.mark.parametrize(
    "bad",
    [
        {"radius": 0.0},
        {"radius": math.nan},
        {"margin": -0.1},
        {"duration": 0.0},
        {"start": 2.0, "cart_range": (0.0, 1.0)},
        {"cart_range": (1.0, 0.0)},
        {"max_speed": 0.0},
        {"turn": math.inf},
        {"method": "magic"},
        {"flange_xy": np.zeros((1, 2))},
        {"flange_xy": np.zeros((5, 3))},
        {"flange_xy": np.full((5, 2), math.nan)},
        {"method": "gradient", "alpha": 0.0},
        {"method": "gradient", "step": 25.0},
        {"method": "gradient", "max_iterations": 0},
        {"method": "gradient", "first_guess": "wild"},
        {"method": "gradient", "first_guess": np.zeros(3)},
        {"method": "gradient", "first_guess": np.ones(5)},
    ],
)
def test_bad_arguments(bad):
    path = np.column_stack([np.zeros(5), np.linspace(0.5, -0.5, 5)])
    with pytest.raises(ValueError, match=r"."):
        cart_motion(**{"flange_xy": path, "start": 0.0, "end": 0.0, "radius": 0.2, **bad})


# --- gradient descent


@pytest.mark.parametrize(
    ("variant", "penalty", "smoothness", "inside"),
    [("paper", 19.370, 19.415, (3512, 3571, 58)), ("fk", 5.758, 6.061, (3968, 3984, 17))],
)
def test_the_published_descent_ends_inside(variant, penalty, smoothness, inside):
    e = cart.load(variant)
    m = cart_motion(e.flange_xy, 0.5, 0.75, 0.2, "gradient")
    assert m.iterations == 53707
    assert not m.admissible
    deep = np.flatnonzero((m.x > m.lower) & (m.x < m.upper))
    assert (deep[0], deep[-1], m.inside) == inside
    h = sum(cart.density(m.x[i], m.lower[i], m.upper[i]) for i in deep)
    assert h == pytest.approx(penalty, abs=1e-3)
    assert 0.01 * 1e6 * m.energy == pytest.approx(smoothness, abs=1e-3)


def test_descent_from_an_admissible_guess(taught):
    best = exact(taught)
    m = cart_motion(
        taught.flange_xy, 0.5, 0.75, 0.2, "gradient", first_guess="admissible", cart_range=(0, 1), max_iterations=2000
    )
    assert m.admissible
    assert m.energy > best.energy
    # The exact law stays where it is, a minimum of (10) for this alpha, but for hops of step/h = 0.13 mm at the border.
    stays = cart_motion(taught.flange_xy, 0.5, 0.75, 0.2, "gradient", first_guess=best.x, max_iterations=20000)
    assert stays.admissible
    assert np.abs(stays.x - best.x).max() < 3e-4


def test_descent_that_succeeds():
    path = np.column_stack([np.zeros(3000), np.linspace(0.5, -0.5, 3000)])
    m = cart_motion(path, 0.1, 0.15, 0.2, "gradient")
    assert m.admissible
    assert m.iterations < 53707
    assert m.energy >= cart_motion(path, 0.1, 0.15, 0.2).energy


# --- the arm


def test_shoulder_cylinder():
    ur10 = sk.robots.load("ur10")
    c = shoulder_cylinder(ur10)
    assert c.radius == pytest.approx(0.163941, abs=1e-9)
    assert c.point == pytest.approx([0, 0, -0.0922], abs=1e-9)
    rng = np.random.default_rng(4)
    # |det J| = a2 a3 |s3 s5 g|, and the point is √(g² + d4²) from axis 1.
    for q in rng.uniform(-3, 3, (500, 6)):
        pose = ur10.pose(q)
        distance = np.linalg.norm((pose @ np.append(c.point, 1.0))[:2])
        g = math.sqrt(max(0.0, distance**2 - c.radius**2))
        expected = 0.612 * 0.5723 * abs(math.sin(q[2]) * math.sin(q[4])) * g
        assert abs(np.linalg.det(ur10.jacobian(q))) == pytest.approx(expected, abs=1e-8)
        assert distance > c.radius - 1e-12
    puma = shoulder_cylinder(sk.robots.load("puma560"))
    assert puma.radius == pytest.approx(0.15005, abs=1e-9)
    assert shoulder_cylinder(sk.robots.load("kuka_kr6_r900")).radius == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(ValueError, match="six joints"):
        shoulder_cylinder(sk.robots.load("franka_panda"))


def placed(e, q):
    pose = e.mount @ e.chain.pose(q[1:]) @ e.tool
    pose[0, 3] += q[0]
    return pose


def planned(e, **options):
    return cart_trajectory(
        e.chain, e.taught, 0.2, mount=e.mount, tool=e.tool, point=e.tool[:3, 3], poses=e.poses,
        **{"durations": 200.0, "samples": 5068, "cart_range": (0.0, 1.0), **options},
    )  # fmt: skip


def test_the_arm_arrives_at_the_taught_joints(taught):
    plan = planned(taught)
    tight = taught.variant == "fk"
    assert np.abs(plan.q[0] - taught.taught[0]).max() < 1e-12
    assert np.abs(plan.q[-1] - taught.taught[1]).max() < (1e-6 if tight else 1e-4)
    assert plan.joint_error < (1e-6 if tight else 1e-4)
    assert np.abs(plan.q[:, 0] - exact(taught).x).max() < 1e-12
    line = taught.poses[0, :3, 3] + np.linspace(0, 1, 5068)[:, None] * (taught.poses[1] - taught.poses[0])[:3, 3]
    for q, want, point in zip(plan.q[::50], plan.poses[::50], line[::50], strict=True):
        assert np.abs(sk.pose_error(placed(taught, q), want)).max() < 1e-9
        assert np.abs(placed(taught, q)[:3, 3] - point).max() < 1e-9
    assert np.abs(np.diff(plan.q, axis=0)).max() < 2e-3
    assert plan.min_singular_value.min() == pytest.approx(0.115 if tight else 0.158, abs=2e-3)
    assert np.abs(plan.qdot[:, 1:]).max() == pytest.approx(0.022 if tight else 0.025, abs=1e-3)
    assert plan.taught_at == (0, 5067)


def test_redundancy_misses_the_taught_joints(taught):
    run = cart.run(cart.load(taught.variant), "redundancy")
    assert np.abs(run.joint_error[1:]).max() > 0.5
    assert run.motion.inside > 0


def test_linear_law_is_out_of_reach():
    run = cart.run(cart.load("fk"), "linear")
    assert run.followed == pytest.approx(0.380, abs=1e-3)
    assert np.all(np.isnan(run.joint_error))


@pytest.mark.parametrize("shape", ["line", "arc", "spline"])
@pytest.mark.parametrize("profile", ["constant", "smooth"])
def test_several_motions(shape, profile):
    e = cart.load("fk")
    c = shoulder_cylinder(e.chain)
    middle = np.array([0.62, 0.3, -1.75, 0.8, -0.95, 1.5, 0.1])
    stops = np.array([e.taught[0], middle, e.taught[1], middle])
    poses = np.array([placed(e, q) for q in stops])
    via = None
    if shape == "arc":
        via = [0.5 * (poses[0] + poses[1])[:3, 3] + [0.0, 0.01, 0.03], None, None]
    plan = cart_trajectory(
        e.chain, stops, c.radius, point=c.point, margin=0.01, mount=e.mount, durations=[20.0, 10.0, 10.0],
        samples=[300, 200, 150], via=via, shape="spline" if shape == "spline" else "line", profile=profile,
    )  # fmt: skip
    assert plan.joint_error < 1e-8
    assert plan.t[-1] == pytest.approx(40.0)
    assert np.all(np.diff(plan.t) > 0)
    for at, q in zip(plan.taught_at, stops, strict=True):
        assert plan.q[at] == pytest.approx(q, abs=1e-8)
    for q, want in zip(plan.q, plan.poses, strict=True):
        assert np.abs(sk.pose_error(placed(e, q), want)).max() < 1e-9
        seen = placed(e, q) @ np.append(c.point, 1.0)
        assert math.hypot(seen[0] - q[0], seen[1]) > c.radius + 0.009
    if shape == "arc":
        to_via = np.linalg.norm(plan.poses[: plan.taught_at[1], :3, 3] - via[0], axis=1)
        assert to_via.min() < 2e-3
    if profile == "smooth":
        for at in plan.taught_at:
            assert np.abs(plan.qdot[at]).max() < 1e-2
    if shape == "spline":
        positions = plan.poses[:, :3, 3]
        at = plan.taught_at[1]
        ahead, behind = positions[at + 1] - positions[at], positions[at] - positions[at - 1]
        assert ahead @ behind > 0.999 * np.linalg.norm(ahead) * np.linalg.norm(behind)


def test_the_frame_may_be_turned_upside_down():
    # The same motion with z down: y and z change their signs, and joint 1 turns the other way about z.
    e = cart.load("fk")
    flip = np.diag([1.0, -1.0, -1.0, 1.0])
    plan = cart_trajectory(e.chain, e.taught, 0.2, mount=flip @ e.mount, durations=200.0, samples=500)
    same = cart_trajectory(e.chain, e.taught, 0.2, mount=e.mount, durations=200.0, samples=500)
    assert np.abs(plan.q - same.q).max() < 1e-9
    # And where the first axis does not stand at the cart's origin.
    aside = e.mount.copy()
    aside[:2, 3] = 0.3, -0.2
    moved = cart_trajectory(e.chain, e.taught, 0.2, mount=aside, durations=200.0, samples=500)
    assert np.abs(moved.q - same.q).max() < 1e-9


def test_trajectory_refusals():
    e = cart.load("fk", 300)

    def refused(match, taught=e.taught, radius=0.2, chain=e.chain, **options):
        with pytest.raises(ValueError, match=match):
            cart_trajectory(chain, taught, radius, **{"mount": e.mount, "samples": 300, "durations": 200.0, **options})

    other = e.taught.copy()
    other[1, 1] -= 2 * math.pi
    refused("winding", other)
    elsewhere = e.taught.copy()
    elsewhere[1, 4] += 0.01
    refused("pose 1", elsewhere, poses=e.poses)
    wrapped = e.taught.copy()
    wrapped[1, 6] += 2 * math.pi
    refused("arrives at the joints", wrapped)
    refused("start inside", radius=0.35)
    refused("exceeds its velocity", durations=1.0)
    refused("six joints", chain=sk.robots.load("franka_panda"))
    refused("parallel to z", mount=np.eye(4)[[0, 2, 1, 3]] * [1, 1, -1, 1])
    refused("at least 2", e.taught[:1])
    refused("durations", durations=[1.0, 2.0])
    refused("shape", shape="circle")
    refused("via", via=[])
    refused("one line", via=[0.5 * (e.poses[0] + e.poses[1])[:3, 3]])
    refused("accelerates", profile="smooth", max_acceleration=1e-6)
    refused("cannot follow", radius=0.1)  # the wrist would have to be nearer than the shoulder allows


# --- the command


def test_command(tmp_path, capsys):
    arguments = ["cart", "--samples", "200", "--iterations", "50", "--out", str(tmp_path)]
    assert main(arguments) == 0
    lines = capsys.readouterr().out.strip().splitlines()
    assert lines[-1] == str(tmp_path / "cart-paper-joints.png")
    for variant in cart.VARIANTS:
        for name in ("laws", "plane", "joints"):
            assert (tmp_path / f"cart-{variant}-{name}.png").stat().st_size > 10_000
        with (tmp_path / f"cart-{variant}.csv").open() as stream:
            rows = {row["method"]: row for row in csv.DictReader(stream)}
        assert list(rows) == list(cart.METHODS)
        assert float(rows["exact"]["followed"]) == 1.0
        assert float(rows["plane"]["followed"]) == 1.0
        assert int(rows["plane"]["inside"]) == 0
        assert float(rows["plane"]["energy"]) < float(rows["exact"]["energy"])
        assert int(rows["exact"]["inside"]) == 0
        assert int(rows["linear"]["inside"]) > 0
    assert (
        main(["cart", "--variant", "fk", "--method", "exact", "--samples", "100", "--no-plot", "--out", str(tmp_path)])
        == 0
    )
    assert capsys.readouterr().out.strip().splitlines()[-1] == str(tmp_path / "cart-fk.csv")


@pytest.mark.parametrize("bad", [["--method", "magic"], ["--samples", "3"], ["--iterations", "0"]])
def test_command_refuses(bad, tmp_path, capsys):
    assert main(["cart", "--no-plot", "--out", str(tmp_path), *bad]) == 2
    assert capsys.readouterr().err.startswith("sigmaik: ")


def test_kernel_refuses_bad_tubes():
    string = _core.taut_string
    x, corners = string([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], [0.0, math.inf, 0.0])
    assert x.tolist() == [0.0, 1.0, 0.0]
    assert corners == [0, 1, 2]
    for at, lower, upper in (
        ([0.0, 0.0, 1.0], [0.0] * 3, [0.0] * 3),
        ([0.0, 1.0, 2.0], [0.0, 2.0, 0.0], [0.0, 1.0, 0.0]),
        ([0.0, 1.0, 2.0], [0.0, math.nan, 0.0], [0.0, 1.0, 0.0]),
        ([0.0, 1.0, 2.0], [0.0] * 3, [1.0] * 3),
        ([0.0, 1.0], [0.0] * 3, [0.0] * 3),
        ([0.0], [0.0], [0.0]),
    ):
        with pytest.raises(sk.Error):
            string(at, lower, upper)
