"""Obstacles, arms as spheres, and the costs of small distances between them."""

import importlib.util
import math
import threading

import numpy as np
import pytest
from scipy.optimize import minimize

import sigmaik as sk

P = sk.planning


def random_pose(rng):
    pose = np.eye(4)
    pose[:3, :3] = sk.rotation_exp(rng.normal(size=3))
    pose[:3, 3] = rng.uniform(-0.3, 0.3, 3)
    return pose


def random_shapes(rng):
    return [
        P.Box(size=rng.uniform(0.05, 0.4, 3), pose=random_pose(rng)),
        P.Cylinder(radius=rng.uniform(0.05, 0.2), length=rng.uniform(0.05, 0.5), pose=random_pose(rng)),
        P.Sphere(radius=rng.uniform(0.05, 0.3), center=rng.uniform(-0.3, 0.3, 3)),
    ]


def on_surface(shape, rng, count):
    """Points of a shape's surface, dense everywhere on it, and a test whether points lie inside."""
    if isinstance(shape, P.Sphere):
        direction = rng.normal(size=(count, 3))
        points = shape.center + shape.radius * direction / np.linalg.norm(direction, axis=1)[:, None]
        return points, lambda p: np.linalg.norm(p - shape.center, axis=1) < shape.radius
    if isinstance(shape, P.Box):
        half = 0.5 * np.asarray(shape.size)
        local = rng.uniform(-half, half, (count, 3))
        axis = rng.integers(3, size=count)
        local[np.arange(count), axis] = half[axis] * rng.choice([-1.0, 1.0], count)

        def inside(p):
            return np.all(np.abs(p) < half, axis=1)

    else:
        half = 0.5 * shape.length
        angle = rng.uniform(-np.pi, np.pi, count)
        end = rng.uniform(size=count) < 0.5
        radius = np.where(end, shape.radius * np.sqrt(rng.uniform(size=count)), shape.radius)
        z = np.where(end, half * rng.choice([-1.0, 1.0], count), rng.uniform(-half, half, count))
        local = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)

        def inside(p):
            return (np.hypot(p[:, 0], p[:, 1]) < shape.radius) & (np.abs(p[:, 2]) < half)

    turn, at = shape.pose[:3, :3], shape.pose[:3, 3]
    return local @ turn.T + at, lambda p: inside((p - at) @ turn)


def test_distances_of_shapes_against_their_surfaces():
    rng = np.random.default_rng(0)
    for _ in range(5):
        for shape in random_shapes(rng):
            surface, inside = on_surface(shape, rng, 40_000)
            assert np.abs(shape.distance(surface)).max() < 1e-12
            points = rng.uniform(-0.8, 0.8, (100, 3))
            got = shape.distance(points)
            nearest = np.array([np.linalg.norm(surface - p, axis=1).min() for p in points])
            # Sampled surfaces are farther away, by the gaps between the samples at most.
            assert np.all(np.abs(got) <= nearest + 1e-12)
            assert np.all(nearest - np.abs(got) < 0.02)
            assert np.array_equal(got < 0.0, inside(points))
            low, high = shape.bounds
            assert np.all(surface >= low - 1e-12)
            assert np.all(surface <= high + 1e-12)
            assert surface.min(axis=0) == pytest.approx(low, abs=0.02)
            assert surface.max(axis=0) == pytest.approx(high, abs=0.02)


def test_distances_in_closed_form():
    box = P.Box(size=(2.0, 4.0, 6.0), pose=(1.0, 0.0, 0.0))
    for point, expected in [
        ((1.0, 0.0, 0.0), -1.0),
        ((1.5, 1.75, 0.0), -0.25),
        ((5.0, 0.0, 0.0), 3.0),
        ((5.0, 6.0, 0.0), 5.0),
        ((5.0, 4.0, 9.0), 7.0),
    ]:
        assert box.distance(point) == pytest.approx(expected)
    can = P.Cylinder(radius=1.0, length=4.0, pose=np.eye(4))
    for point, expected in [
        ((0, 0, 0), -1.0),
        ((0, 0, 1.5), -0.5),
        ((3, 4, 0), 4.0),
        ((0, 0, 5), 3.0),
        ((3, 4, 5), 5.0),
    ]:
        assert can.distance(point) == pytest.approx(expected)
    assert P.Sphere(radius=1.0, center=(1, 2, 2)).distance((0, 0, 0)) == pytest.approx(2.0)


@pytest.mark.parametrize("resolution", [0.1, 0.03])
def test_field_of_shapes(resolution):
    rng = np.random.default_rng(1)
    for _ in range(3):
        shapes = random_shapes(rng)
        obstacles = P.Obstacles(shapes, resolution=resolution)
        low, high = obstacles.bounds
        corners = np.array([shape.bounds for shape in shapes])
        assert np.all(low <= corners[:, 0].min(axis=0) - 0.3 + 1e-9)
        assert np.all(high >= corners[:, 1].max(axis=0) + 0.3 - 1e-9)
        points = rng.uniform(low, high, (20_000, 3))
        exact = np.min([shape.distance(points) for shape in shapes], axis=0)
        bound = 0.5 * math.sqrt(3.0) * resolution
        assert np.abs(obstacles.distance(points) - exact).max() < bound
        away = rng.uniform(-3.0, 3.0, (20_000, 3))
        exact = np.min([shape.distance(away) for shape in shapes], axis=0)
        assert np.all(obstacles.distance(away) < exact + bound)
        outside = np.any((away < low) | (away > high), axis=1)
        assert np.all(obstacles.distance(away[outside]) > 0.3 - bound)
        # The gradient, away from the cells' faces.
        cells = (away - obstacles.field.origin) / resolution
        smooth = away[np.all(np.abs(cells - np.round(cells)) > 1e-3, axis=1)]
        for axis, step in enumerate(1e-6 * np.eye(3)):
            slope = (obstacles.distance(smooth + step) - obstacles.distance(smooth - step)) / 2e-6
            assert np.abs(obstacles.gradient(smooth)[:, axis] - slope).max() < 1e-6
        assert obstacles.distance(points[7]) == obstacles.distance(points)[7]
        assert np.array_equal(obstacles.gradient(points[7]), obstacles.gradient(points)[7])


def test_bounds_cut_a_floor():
    floor = P.Box(size=(100.0, 100.0, 1.0), pose=(0.0, 0.0, -0.5))
    obstacles = P.Obstacles([floor], bounds=[[-0.5, -0.5, -0.2], [0.5, 0.5, 1.0]], resolution=0.05)
    assert obstacles.distance([0.1, 0.2, 0.7]) == pytest.approx(0.7, abs=1e-6)
    assert obstacles.distance([0.1, 0.2, -0.1]) == pytest.approx(-0.1, abs=1e-6)
    with pytest.raises(sk.Error, match=r"nodes.*give bounds"):
        P.Obstacles([floor])


def test_occupancy_grid():
    rng = np.random.default_rng(2)
    cell = 0.04
    axes = [np.arange(-12, 13) * cell] * 3
    centers = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    # Boxes along the axes, with faces between the cells' centres: exact there.
    box = P.Box(size=(6 * cell, 9 * cell, 4 * cell), pose=(0.5 * cell, 0.0, 0.5 * cell))
    obstacles = P.Obstacles.from_occupancy(box.distance(centers) < 0.0, (-12 * cell,) * 3, cell)
    points = rng.uniform(-0.45, 0.45, (5000, 3))
    error = obstacles.distance(points) - box.distance(points)
    assert np.abs(error).max() < 1.3 * cell
    beside = np.array([[0.35, 0.0, 0.0], [0.0, 0.4, 0.02], [0.02, 0.0, -0.3], [0.02, 0.0, 0.04]])
    assert obstacles.distance(beside) == pytest.approx(box.distance(beside), abs=1e-6)
    # Any shape: the error is at most the error of the voxels plus the error of the grid.
    ball = P.Sphere(radius=0.25, center=(0.05, 0.02, -0.03))
    obstacles = P.Obstacles.from_occupancy(ball.distance(centers) < 0.0, (-12 * cell,) * 3, cell)
    assert np.abs(obstacles.distance(points) - ball.distance(points)).max() < 1.5 * cell
    assert np.array_equal(obstacles.bounds, [[-12 * cell] * 3, [12 * cell] * 3])
    for bad in (np.zeros((3, 3, 3)), np.ones((3, 3, 3)), np.zeros((3, 3)), np.linspace(0, 1, 27).reshape(3, 3, 3)):
        with pytest.raises(sk.Error):
            P.Obstacles.from_occupancy(bad, (0, 0, 0), 0.1)


def test_scipy_missing_names_the_command(monkeypatch):
    real = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *package: None if name == "scipy" else real(name, *package)
    )
    with pytest.raises(sk.Error, match="pip install scipy"):
        P.Obstacles.from_occupancy(np.eye(3)[:, :, None] * [1, 0], (0, 0, 0), 0.1)
    P.Obstacles([P.Sphere(0.1, (0, 0, 0))])  # shapes need no SciPy


@pytest.fixture(scope="module")
def scene():
    arm = sk.robots.load("kuka_lbr_iiwa_14_r820")
    spheres = P.arm_spheres(arm, sk.robots.path("kuka_lbr_iiwa_14_r820"))
    table = P.Box(size=(0.6, 1.0, 0.04), pose=(0.6, 0.0, 0.4))
    ball = P.Sphere(radius=0.15, center=(-0.4, 0.3, 0.8))
    return arm, spheres, P.Obstacles([table, ball])


def test_spheres_of_an_arm(scene):
    arm, spheres, _ = scene
    rng = np.random.default_rng(3)
    q = np.array([arm.random_configuration(rng) for _ in range(20)])
    centers = spheres.centers(q)
    assert centers.shape == (20, len(spheres), 3)
    assert np.array_equal(centers[4], spheres.centers(q[4]))
    parts = {}
    for i, link in enumerate(spheres.links):
        if link == arm.base:
            assert i < spheres.first_moving
            assert np.array_equal(centers[0, i], spheres.local_centers[i])
            continue
        if link not in parts:
            parts[link] = sk.Chain.from_urdf(sk.robots.path("kuka_lbr_iiwa_14_r820"), tip=link)
        part = parts[link]
        pose = part.pose(q[:, : part.dof])
        expected = pose[:, :3, :3] @ spheres.local_centers[i] + pose[:, :3, 3]
        assert centers[:, i] == pytest.approx(expected, abs=1e-12)
    jacobians = spheres.jacobians(q)
    for k, step in enumerate(1e-6 * np.eye(7)):
        slope = (spheres.centers(q + step) - spheres.centers(q - step)) / 2e-6
        assert jacobians[..., k] == pytest.approx(slope, abs=1e-7)
    same = P.ArmSpheres(arm, list(spheres.links), spheres.local_centers, spheres.radii)
    assert np.array_equal(same.centers(q), centers)
    assert len(P.arm_spheres(arm, radius=0.02)) > len(P.arm_spheres(arm))


def test_collision_cost(scene):
    arm, spheres, obstacles = scene
    rng = np.random.default_rng(4)
    q = np.array([arm.random_configuration(rng) for _ in range(500)])
    clearance, weight = 0.1, 3.0
    cost = P.collision_cost(spheres, obstacles, clearance, weight)
    moving = slice(spheres.first_moving, None)
    d = np.array([obstacles.distance(c) for c in spheres.centers(q)[:, moving]]) - spheres.radii[moving]
    near = (clearance - d) ** 2 / (2.0 * clearance)
    expected = weight * np.where(d < 0.0, 0.5 * clearance - d, np.where(d < clearance, near, 0.0)).sum(axis=1)
    assert np.count_nonzero(expected) > 100
    assert cost.values(q) == pytest.approx(expected, rel=1e-10)
    assert P.min_distance(spheres, obstacles, q) == pytest.approx(d.min(axis=1), abs=1e-12)
    assert P.min_distance(spheres, obstacles, q[3]) == pytest.approx(d[3].min(), abs=1e-12)
    assert np.array_equal(P.min_distance(spheres, obstacles, q, threads=3), P.min_distance(spheres, obstacles.field, q))
    for some, gradient in zip(q[:50], cost.gradients(q[:50]), strict=True):
        value, slope, hessian = cost.model(some)
        assert value == pytest.approx(cost.value(some), rel=1e-12)
        assert np.array_equal(gradient, slope)
        assert np.array_equal(hessian, hessian.T)
        assert np.linalg.eigvalsh(hessian).min() > -1e-9 * max(1.0, np.abs(hessian).max())


def test_descent_leaves_contact(scene):
    arm, spheres, obstacles = scene
    rng = np.random.default_rng(5)
    cost = P.sum_of_costs(
        [
            P.collision_cost(spheres, obstacles, 0.05),
            P.self_collision_cost(spheres),
            P.joint_limit_cost(arm, 0.05),
        ]
    )
    left = tried = 0
    while tried < 20:
        q = arm.random_configuration(rng)
        if P.min_distance(spheres, obstacles, q) > -0.02:
            continue
        tried += 1
        found = minimize(lambda x: cost.model(x)[:2], q, jac=True, method="L-BFGS-B", tol=1e-12).x
        left += P.min_distance(spheres, obstacles, found) > 0.0
    assert left >= 18


def test_arms_at_home_do_not_touch_themselves():
    for name in sk.robots.names():
        arm = sk.robots.load(name)
        spheres = P.arm_spheres(arm, sk.robots.path(name))
        pairs = P.self_collision_pairs(spheres)
        home = sk.robots.home(name)
        assert P.self_collision_cost(spheres, pairs, 0.005).value(home) == 0.0, name
        assert P.self_collision_cost(spheres).value(home) == P.self_collision_cost(spheres, pairs).value(home)
        c = spheres.centers(home)
        d = np.linalg.norm(c[pairs[:, 0]] - c[pairs[:, 1]], axis=1) - spheres.radii[pairs].sum(axis=1)
        assert d.min() > 0.005, name


@pytest.mark.parametrize("make", ["collision", "self", "limits", "potential", "manipulability", "generic"])
def test_batches_are_one_by_one(scene, make):
    arm, spheres, obstacles = scene
    cost = {
        "collision": lambda: P.collision_cost(spheres, obstacles),
        "self": lambda: P.self_collision_cost(spheres),
        "limits": lambda: P.joint_limit_cost(arm),
        "potential": lambda: sk._core.potential_cost(sk.singularities.of(arm), 1.0, 0.0, 10.0),
        "manipulability": lambda: sk._core.manipulability_cost(sk.singularities.of(arm), 1.0, 1e-2),
        "generic": lambda: sk._core.manipulability_cost(arm, 1.0, 1e-2),
    }[make]()
    rng = np.random.default_rng(6)
    q = rng.uniform(-3.0, 3.0, (301, 7))
    values, gradients = cost.values(q), cost.gradients(q)
    assert values.shape == (301,)
    assert gradients.shape == (301, 7)
    assert np.array_equal(values, [cost.value(x) for x in q])
    assert gradients == pytest.approx(np.array([cost.model(x)[1] for x in q]), rel=1e-9, abs=1e-9)
    assert np.array_equal(values, cost.values(q, threads=4))
    assert np.array_equal(gradients, cost.gradients(q, threads=4))
    found = {}
    threads = [threading.Thread(target=lambda k=k: found.update({k: cost.values(q)})) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(found[k], values) for k in range(4))
    assert cost.values(np.empty((0, 7))).shape == (0,)
    assert cost.gradients(np.empty((0, 7))).shape == (0, 7)
    for bad in (q[0], q[:, :6], np.full((2, 7), np.nan), "text"):
        with pytest.raises(sk.Error):
            cost.values(bad)
        with pytest.raises(sk.Error):
            cost.gradients(bad)
    with pytest.raises(sk.Error, match="threads = 0"):
        cost.values(q, threads=0)


def test_a_plan_around_a_ball(scene):
    """These costs are what `TimeOptimal` takes: a motion through a ball becomes one around it."""
    arm, spheres, _ = scene
    start, goal = np.array([-1.0, 0.9, 0.0, -1.2, 0.0, 0.6, 0.0]), np.array([1.0, 0.9, 0.0, -1.2, 0.0, 0.6, 0.0])
    tip = arm.pose(0.5 * (start + goal))[:3, 3]
    obstacles = P.Obstacles([P.Sphere(radius=0.08, center=tip + (0.0, 0.0, 0.03))])
    line = start + np.linspace(0.0, 1.0, 200)[:, None] * (goal - start)
    assert np.min(P.min_distance(spheres, obstacles, line)) < -0.05
    cost = P.collision_cost(spheres, obstacles, 0.1, 1e4)
    planner = sk._core.TimeOptimal(arm.with_limits(acceleration=10.0), cost, nodes=40, time_weight=600.0)
    result = planner.solve(start, goal)
    assert result.status != "failed"
    assert np.min(P.min_distance(spheres, obstacles, result.nodes(7)[0])) > 0.0


def test_refusals(scene):
    arm, spheres, obstacles = scene
    ball = P.Sphere(0.1, (0, 0, 0))
    for bad in (
        lambda: P.Sphere(0.0, (0, 0, 0)),
        lambda: P.Sphere(0.1, (0, 0)),
        lambda: P.Sphere(0.1, (0, math.nan, 0)),
        lambda: P.Box((1, 1, 0), (0, 0, 0)),
        lambda: P.Box((1, 1), (0, 0, 0)),
        lambda: P.Box((1, 1, 1), 2.0 * np.eye(4)),
        lambda: P.Box((1, 1, 1), np.diag([1.0, 1.0, -1.0, 1.0])),
        lambda: P.Cylinder(0.1, -1.0, (0, 0, 0)),
        lambda: P.Cylinder(math.inf, 1.0, (0, 0, 0)),
        lambda: P.Obstacles([]),
        lambda: P.Obstacles(["box"]),
        lambda: P.Obstacles([ball], resolution=0.0),
        lambda: P.Obstacles([ball], margin=-0.1),
        lambda: P.Obstacles([ball], bounds=[[0, 0, 0], [1, 1, 0]]),
        lambda: P.Obstacles([ball], bounds=[0, 1]),
        lambda: ball.distance([1.0, 2.0]),
        lambda: obstacles.distance([[1.0, 2.0]]),
        lambda: obstacles.gradient([math.nan, 0.0, 0.0]),
        lambda: P.DistanceField(np.zeros((2, 2)), (0, 0, 0), 0.1),
        lambda: P.DistanceField(np.zeros((2, 2, 1)), (0, 0, 0), 0.1),
        lambda: P.DistanceField(np.zeros((2, 2, 2)), (0, 0), 0.1),
        lambda: P.arm_spheres(arm, radius=0.0),
        lambda: P.arm_spheres(arm, sk.robots.path("ur10")),
        lambda: P.ArmSpheres(arm, ["link_1"], [[0, 0, 0], [1, 1, 1]], [0.1]),
        lambda: P.ArmSpheres(arm, ["link_1"], [[0, 0, 0]], [0.0]),
        lambda: P.collision_cost(spheres, obstacles, clearance=0.0),
        lambda: P.collision_cost(spheres, obstacles, weight=-1.0),
        lambda: P.self_collision_cost(spheres, [[0, 1, 2]]),
        lambda: P.self_collision_cost(spheres, [[0, len(spheres)]]),
        lambda: P.self_collision_cost(spheres, [[0, 1.5]]),
        lambda: P.self_collision_pairs(spheres, 0.02, 2.0),
        lambda: P.joint_limit_cost(arm, margin=-1.0),
        lambda: P.sum_of_costs([]),
        lambda: P.min_distance(spheres, obstacles, np.zeros(6)),
        lambda: P.min_distance(spheres, obstacles, np.zeros(7), threads=0),
    ):
        with pytest.raises(sk.Error):
            bad()
    with pytest.raises(sk.Error, match=r"'hand' is not a link of the arm; links: 'link_0', 'link_1'"):
        P.ArmSpheres(arm, ["hand"], [[0, 0, 0]], [0.1])
