"""A cart with two linear axes against closed forms, dynamic programming on a grid, a general solver, and the exact law
of one axis."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize

import sigmaik as sk
from sigmaik.planning import CartError, cart_motion, cart_motion_plane, evaluate_cart_motion_plane
from sigmaik_lab.cart import experiment as cart


def wave(rng, samples, size=0.4):
    """A smooth path of the point about the origin."""
    s = np.linspace(0.0, 1.0, samples)[:, None]
    a, b = rng.uniform(0, 6, (2, 1, 2))
    f, g = rng.uniform(0, 2 * math.pi, 2), rng.uniform(0, 3.5 * math.pi, 2)
    return size * (np.sin(f * s + a) + 0.5 * np.sin(g * s + b)) + s * rng.uniform(-0.5, 0.5, 2)


def ends(rng, path, radius, span=0.6):
    """Random start and end, out of the disc."""
    out = []
    for p in (path[0], path[-1]):
        angle = rng.uniform(-math.pi, math.pi)
        out.append(p + (radius + rng.uniform(0.01, span)) * np.array([math.cos(angle), math.sin(angle)]))
    return out


def energy(c):
    return float(np.sum(np.diff(c, axis=0) ** 2))


def turns(c, path):
    d = c - path
    a, b = d[:-1], d[1:]
    return float(np.sum(np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], np.sum(a * b, axis=1))))


def length_round(a, b, turn, r):
    """Length of tangent, arc and tangent round a disc, or of the straight line where the line is clear of the disc."""
    la, lb = (math.sqrt(v @ v - r * r) for v in (a, b))
    arc = abs(turn) - math.atan2(la, r) - math.atan2(lb, r)
    return float(np.linalg.norm(b - a)) if arc <= 0.0 else la + r * arc + lb


@pytest.mark.parametrize("seed", range(6))
def test_uniform_flange_has_the_closed_form(seed):
    rng = np.random.default_rng(seed)
    for _ in range(5):
        r, n = rng.uniform(0.1, 0.3), 400
        first, last = rng.uniform(-0.5, 0.5, (2, 2))
        path = first + np.linspace(0, 1, n + 1)[:, None] * (last - first)
        start, end = ends(rng, path, r)
        a, b = start - first, end - last
        least = math.atan2(a[0] * b[1] - a[1] * b[0], a @ b)
        by_turn = {}
        for more in (0, 1, -1, 2):
            turn = least + 2 * math.pi * more
            m = cart_motion_plane(path, start, end, r, turn=turn)
            # Σ|Δc|² = Σ|Δd|² + 2 Σ Δd·Δf + Σ|Δf|², Δf the same in all steps
            by_turn[more] = (
                length_round(a, b, turn, r) ** 2 + 2 * (last - first) @ (b - a) + (last - first) @ (last - first)
            ) / n
            assert m.energy == pytest.approx(by_turn[more], rel=2e-4, abs=1e-9)
            assert m.turn == pytest.approx(turn)
            assert m.admissible
        free = cart_motion_plane(path, start, end, r)
        assert free.energy == pytest.approx(min(by_turn.values()), rel=2e-4, abs=1e-9)


def optimal(m, r, outer=math.inf):
    """Karush, Kuhn and Tucker: the path bends only where it touches the disc, and away from the disc."""
    c, d = m.xy, m.xy - m.flange_xy
    force = 2 * c[1:-1] - c[2:] - c[:-2]
    distance = np.linalg.norm(d, axis=1)
    n = d[1:-1] / distance[1:-1, None]
    normal = np.sum(force * n, axis=1)
    # A kink would be as large as a step.
    unit = 1e-4 * math.sqrt(m.energy / len(c))
    assert np.abs(force - normal[:, None] * n).max() < unit
    touching, away = distance[1:-1] < r * (1 + 1e-6), distance[1:-1] > outer - 1e-6 * r
    assert np.abs(normal[~touching & ~away]).max(initial=0.0) < unit
    assert np.all(normal[touching & ~away] > -unit)
    assert np.all(normal[away & ~touching] < unit)
    assert m.push[1:-1][touching] == pytest.approx(np.maximum(normal[touching], 0.0), abs=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_conditions_of_optimality(seed):
    rng = np.random.default_rng(100 + seed)
    touched = 0
    for _ in range(15):
        r = rng.uniform(0.1, 0.3)
        path = wave(rng, 300)
        start, end = ends(rng, path, r)
        m = cart_motion_plane(path, start, end, r)
        assert m.clearance > r * (1 - 1e-2)
        assert m.inside == 0
        assert np.array_equal(m.xy[[0, -1]], [start, end])
        assert m.energy == pytest.approx(energy(m.xy))
        assert m.turn == pytest.approx(turns(m.xy, path))
        optimal(m, r)
        touched += bool(np.any(m.push > 0.0))
    assert touched > 2


def test_no_farther_than_the_arm_reaches():
    rng = np.random.default_rng(7)
    limited = 0
    for _ in range(40):
        r, outer = 0.2, 0.45
        path = wave(rng, 200)
        start, end = ends(rng, path, r, 0.2)
        m = cart_motion_plane(path, start, end, r, max_radius=outer)
        assert m.farthest < outer * (1 + 1e-8)
        assert m.admissible
        optimal(m, r, outer)
        limited += m.farthest > outer * (1 - 1e-8)
    assert limited > 12


# --- beside one axis


@pytest.mark.parametrize("seed", range(4))
def test_a_pinned_axis_is_the_exact_law(seed):
    rng = np.random.default_rng(200 + seed)
    compared = 0
    for _ in range(40):
        path = wave(rng, 300)
        r = rng.uniform(0.1, 0.3)
        start, end = path[[0, -1], 0] + rng.uniform(-0.6, 0.6, 2)
        try:
            one = cart_motion(path, start, end, r)
        except CartError:
            continue
        if np.any(one.corners % 1.0):
            continue  # the law of one axis knows tips between samples
        pinned = cart_motion_plane(path, (start, 0.0), (end, 0.0), r, y_range=(0.0, 0.0), turn=one.turn)
        assert pinned.energy == pytest.approx(one.energy, rel=1e-6)
        assert np.abs(pinned.xy[:, 0] - one.x).max() < 1e-5
        assert np.all(pinned.xy[:, 1] == 0.0)
        free = cart_motion_plane(path, (start, 0.0), (end, 0.0), r, turn=one.turn)
        assert free.energy <= one.energy * (1 + 1e-9)
        compared += 1
    assert compared > 10


@pytest.mark.parametrize("variant", cart.VARIANTS)
def test_the_papers_experiment(variant):
    e = cart.load(variant)
    one = cart_motion(e.flange_xy, 0.5, 0.75, 0.2, turn=e.turn)
    pinned = cart_motion_plane(e.flange_xy, (0.5, 0), (0.75, 0), 0.2, turn=e.turn, y_range=(0, 0))
    assert np.abs(pinned.xy[:, 0] - one.x).max() < 1e-9
    free = cart_motion_plane(e.flange_xy, (0.5, 0), (0.75, 0), 0.2, turn=e.turn)
    optimal(free, 0.2)
    assert free.energy < one.energy
    # The flange's speed is constant: tangent, arc, tangent.
    f = e.flange_xy[-1] - e.flange_xy[0]
    a, b = np.array([0.5, 0]) - e.flange_xy[0], np.array([0.75, 0]) - e.flange_xy[-1]
    closed = (length_round(a, b, free.turn, 0.2) ** 2 + 2 * f @ (b - a) + f @ f) / (e.samples - 1)
    assert free.energy == pytest.approx(closed, rel=1e-6)


# --- against others


def on_a_grid(path, start, end, r, cells, half):
    """Least energy by winding over a grid of cart positions, no step nearer than 0.9 r, by dynamic programming."""
    axis = np.linspace(-half, half, cells)
    grid = np.array(np.meshgrid(axis, axis)).reshape(2, -1).T
    layers = [start[None]] + [grid[np.linalg.norm(grid - p, axis=1) >= r] for p in path[1:-1]] + [end[None]]
    sheets = np.arange(-2, 3)
    cost = np.where(sheets == 0, 0.0, math.inf)[:, None]
    for before, after, p, q in zip(layers[:-1], layers[1:], path[:-1], path[1:], strict=True):
        a, b = (before - p)[:, None], (after - q)[None]
        step = b - a
        along = np.clip(-np.sum(a * step, axis=2) / np.maximum(np.sum(step**2, axis=2), 1e-300), 0, 1)
        clear = np.linalg.norm(a + along[:, :, None] * step, axis=2) >= 0.9 * r
        paid = np.where(clear, np.sum((after[None] - before[:, None]) ** 2, axis=2), math.inf)
        turned = np.arctan2(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], np.sum(a * b, axis=2))
        azimuth = np.arctan2(a[..., 1], a[..., 0]) + turned
        over = np.where(azimuth > math.pi, 1, np.where(azimuth <= -math.pi, -1, 0))
        out = np.full((5, len(after)), math.inf)
        for shift in (-1, 0, 1):
            here = np.where(over == shift, paid, math.inf)
            for sheet in range(max(0, -shift), min(5, 5 - shift)):
                out[sheet + shift] = np.minimum(out[sheet + shift], np.min(cost[sheet][:, None] + here, axis=0))
        cost = out
    a, b = start - path[0], end - path[-1]
    ends = math.atan2(b[1], b[0]) - math.atan2(a[1], a[0])
    return {ends + 2 * math.pi * int(s): float(v[0]) for s, v in zip(sheets, cost, strict=True)}


@pytest.mark.parametrize("seed", range(12))
def test_no_way_on_a_grid_is_better(seed):
    rng = np.random.default_rng(300 + seed)
    r = 0.25
    path = wave(rng, 16, 0.3)
    start, end = ends(rng, path, r, 0.3)
    found = on_a_grid(path, start, end, r, 23, 1.1)
    best = min(found.values())
    m = cart_motion_plane(path, start, end, r)
    assert m.energy <= best * (1 + 1e-9)
    for turn, value in found.items():
        if value < 3 * best:
            assert cart_motion_plane(path, start, end, r, turn=turn).energy <= value * (1 + 1e-9)


@pytest.mark.parametrize("limited", [False, True])
def test_a_general_solver_finds_nothing_better(limited):
    rng = np.random.default_rng(11)
    same = 0
    for _ in range(20 if limited else 12):
        n, r = 18, 0.25
        path = wave(rng, n, 0.3)
        start, end = ends(rng, path, r, 0.3)
        best = cart_motion_plane(path, start, end, r, duration=n - 1)
        options = {}
        rows = []
        if limited:
            if best.energy < 1e-6 or not np.any(best.push):
                continue
            options = {"max_speed": 1.02 * best.max_speed, "max_acceleration": 0.8 * best.max_acceleration}
            try:
                best = cart_motion_plane(path, start, end, r, duration=n - 1, turn=best.turn, **options)
            except CartError:
                continue
            rows = [
                lambda z, most=options["max_speed"]: (most - np.abs(np.diff(whole(z), axis=0))).ravel(),
                lambda z, most=options["max_acceleration"]: (most - np.abs(np.diff(whole(z), 2, axis=0))).ravel(),
            ]

        def whole(z, start=start, end=end):
            return np.vstack([start, z.reshape(-1, 2), end])

        def apart(z, path=path, r=r):
            return np.sum((whole(z) - path)[1:-1] ** 2, axis=1) - r * r

        for noise in (0.0, 0.02, 0.1):
            guess = (best.xy[1:-1] + noise * rng.standard_normal((n - 2, 2))).ravel()
            other = minimize(
                lambda z: energy(whole(z)), guess, method="SLSQP", options={"maxiter": 300, "ftol": 1e-14},
                constraints=[{"type": "ineq", "fun": f} for f in (apart, *rows)],
            )  # fmt: skip
            there = whole(other.x)
            ok = other.success and apart(other.x).min() > -1e-7 and all(f(other.x).min() > -1e-7 for f in rows)
            if (
                ok
                and evaluate_cart_motion_plane(path, there, r).clearance > 0.9 * r
                and abs(turns(there, path) - best.turn) < 1
            ):
                assert best.energy <= other.fun * (1 + 1e-5)
                same += other.fun < best.energy * (1 + 1e-5)
    assert same > 8


# --- properties


def test_turned_mirrored_scaled_and_backwards():
    rng = np.random.default_rng(5)
    for _ in range(15):
        path = wave(rng, 150)
        start, end = ends(rng, path, 0.2)
        m = cart_motion_plane(path, start, end, 0.2)
        a = rng.uniform(-3, 3)
        turn = np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]])
        for name, matrix in (("turned", turn), ("mirrored", np.diag([1.0, -1.0])), ("scaled", 1e3 * np.eye(2))):
            scale = 1e3 if name == "scaled" else 1.0
            sign = -1 if name == "mirrored" else 1
            other = cart_motion_plane(path @ matrix.T, matrix @ start, matrix @ end, 0.2 * scale, turn=sign * m.turn)
            assert np.abs(other.xy - m.xy @ matrix.T).max() < 1e-5 * scale, name
        back = cart_motion_plane(path[::-1], end, start, 0.2, turn=-m.turn)
        assert np.abs(back.xy[::-1] - m.xy).max() < 1e-5


def test_limits_in_range():
    e = cart.load("paper", 800)
    keep = (e.flange_xy, (0.5, 0.0), (0.75, 0.0), 0.2)
    free = cart_motion_plane(*keep, turn=e.turn, duration=200.0)
    m = cart_motion_plane(
        *keep,
        turn=e.turn,
        duration=200.0,
        max_acceleration=(1e-3, 2e-3),
        at_rest=True,
        y_range=(-0.04, 0.06),
        margin=0.01,
    )
    assert np.all(m.max_acceleration <= [1e-3, 2e-3])
    assert np.all(np.abs(m.xy[1] - m.xy[0]) <= np.array([1e-3, 2e-3]) * (200.0 / 799) ** 2)
    assert m.xy[:, 1].min() > -0.04 - 1e-9
    assert m.xy[:, 1].max() < 0.06 + 1e-9
    assert m.clearance > 0.21 - 1e-5
    assert m.energy > free.energy
    quick = cart_motion_plane(*keep, turn=e.turn, duration=200.0, max_speed=0.99 * free.max_speed)
    assert np.all(quick.max_speed <= 0.99 * free.max_speed)
    assert quick.energy >= free.energy
    assert m.sample([-1.0, 100.0, 300.0])[[0, 2]] == pytest.approx(np.array([[0.5, 0.0], [0.75, 0.0]]))
    assert m.sample(m.t) == pytest.approx(m.xy)


def test_either_side_turns_by_one_turn_more():
    through = np.column_stack([np.zeros(201), np.linspace(0.5, -0.5, 201)])
    left, right = (cart_motion_plane(through, (0, 0), (0, 0), 0.2, turn=turn) for turn in (math.pi, -math.pi))
    assert left.turn - right.turn == pytest.approx(2 * math.pi)
    assert left.energy == pytest.approx(right.energy)
    assert left.xy[100, 0] * right.xy[100, 0] < 0
    still = cart_motion_plane(through + [1.0, 0.0], (0, 0), (0, 0), 0.2)
    assert still.energy < 1e-18
    assert not evaluate_cart_motion_plane(through, np.zeros((201, 2)), 0.2).admissible


# --- refusals


def test_what_cannot_be_done_is_told_apart():
    through = np.column_stack([np.zeros(101), np.linspace(0.5, -0.5, 101)])
    pinned = {"x_range": (-0.05, 0.05), "y_range": (0, 0)}
    cases = [
        ("start inside", (0.0, 0.4), (0.0, 0.0), {}),
        ("end inside", (0.0, 0.0), (0.0, -0.45), {}),
        ("range", (0.0, 0.0), (0.0, 0.0), pinned),
        ("range", (0.0, 0.0), (0.0, 0.0), {"max_radius": 0.3}),
        ("winding", (0.0, 0.0), (0.0, 0.0), {"turn": 3 * math.pi, "y_range": (-0.01, 0.01)}),
        ("speed", (0.0, 0.0), (0.0, 0.0), {"max_speed": 1e-3}),
        ("acceleration", (0.0, 0.0), (0.0, 0.0), {"max_acceleration": 1e-3, "at_rest": True}),
    ]
    for reason, start, end, options in cases:
        with pytest.raises(CartError, match=reason) as refusal:
            cart_motion_plane(through, start, end, 0.2, **options)
        assert isinstance(refusal.value, sk.Error)
        assert refusal.value.reason == reason
    with pytest.raises(CartError, match="start inside") as refusal:
        cart_motion_plane(through, (0.0, 0.4), (0.0, 0.0), 0.2)
    assert refusal.value.feasible_radius == pytest.approx(0.1)
    with pytest.raises(CartError, match=r"a duration of [\d.]+ s would do") as refusal:
        cart_motion_plane(through, (0, 0), (0, 0), 0.2, max_acceleration=1.0, at_rest=True)
    longer = float(str(refusal.value).split("duration of ")[1].split(" s")[0])
    cart_motion_plane(through, (0, 0), (0, 0), 0.2, max_acceleration=1.0, at_rest=True, duration=longer)


@pytest.mark.parametrize(
    "bad",
    [
        {"radius": 0.0},
        {"radius": math.nan},
        {"margin": -0.1},
        {"max_radius": 0.2},
        {"duration": 0.0},
        {"start": (2.0, 0.0), "x_range": (-1.0, 1.0)},
        {"y_range": (1.0, 0.0)},
        {"x_range": (math.nan, 0.0)},
        {"max_speed": 0.0},
        {"max_speed": (1.0, 1.0, 1.0)},
        {"max_acceleration": (1.0, math.nan)},
        {"turn": math.inf},
        {"start": (0.0, 0.0, 0.0)},
        {"start": 0.0},
        {"start": (math.nan, 0.0)},
        {"flange_xy": np.zeros((2, 2))},
        {"flange_xy": np.zeros((5, 3))},
        {"flange_xy": np.full((5, 2), math.nan)},
    ],
)
def test_bad_arguments(bad):
    path = np.column_stack([np.zeros(50), np.linspace(0.5, -0.5, 50)])
    with pytest.raises(ValueError, match=r"."):
        cart_motion_plane(**{"flange_xy": path, "start": (0.0, 0.0), "end": (0.0, 0.0), "radius": 0.2, **bad})


def test_too_few_samples_are_told():
    path = np.column_stack([np.zeros(3), [0.5, 0.0, -0.5]])
    with pytest.raises(CartError, match="more samples"):
        cart_motion_plane(path, (0.0, 0.0), (0.0, 0.0), 0.4)
    with pytest.raises(ValueError, match="shape"):
        evaluate_cart_motion_plane(path, np.zeros((4, 2)), 0.1)
