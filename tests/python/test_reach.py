"""The J-PARSE paper's experiments: what must come out, and the tools around them."""

from __future__ import annotations

import csv
import functools
import json
import math

import numpy as np
import pytest

import sigmaik as sk
from sigmaik.files import write_atomically
from sigmaik_lab import csv_file
from sigmaik_lab.reach import experiment as ex
from sigmaik_lab.reach import files, methods, paths
from sigmaik_lab.reach.settings import ReachSettings
from sigmaik_lab.reach.summary import Summary, settling_time, summarize

XARM, GEN3, PUMA = "ufactory_xarm7", "kinova_gen3_7dof", "puma560"
JPARSE_PUBLISHED = "jparse:gain=2,continuous=false"


@functools.cache
def load(robot: str, path: str, **changes: float) -> ex.Experiment:
    return ex.load(robot, path, **changes)


@functools.cache
def drive(robot: str, path: str, method: str, limits: bool = False, **changes: float) -> ex.Run:
    experiment = load(robot, path, **changes)
    return ex.run(experiment, methods.parse_method(method, experiment.settings), limits)


def rows(robot: str, path: str, method: str, limits: bool = False, **changes: float) -> list[Summary]:
    return summarize(drive(robot, path, method, limits, **changes))


def settled(*args: object, **changes: float) -> list[float]:
    """Settled position errors in mm."""
    return [1e3 * row.position_error for row in rows(*args, **changes)]


# --- xArm7: line and ellipse

# Settled position errors per waypoint [mm] of an independent NumPy simulation (Euler, 50 Hz, no limits).
LINE, ELLIPSE = "extended-line", "extended-ellipse"
EXPECTED = [
    (LINE, "jparse", (327.9, 0.0, 0.0)),
    (LINE, "jparse:gain=1", (327.9, 0.0, 0.0)),
    (LINE, JPARSE_PUBLISHED, (327.9, 0.0, 0.0)),
    (LINE, "dls:damping=0.1", (329.3, 21.7, 22.3)),
    (LINE, "dls:damping=0.8", (589.0, 325.0, 404.0)),
    (LINE, "safety", (329.8, 0.0, 0.0)),
    (LINE, "safety-projection", (492.0, 55.0, 164.0)),
    (ELLIPSE, "jparse", (0.0, 177.8, 0.0, 177.8)),
    (ELLIPSE, "jparse:gain=1", (0.0, 177.8, 0.0, 177.8)),
    (ELLIPSE, JPARSE_PUBLISHED, (0.0, 177.8, 0.0, 177.8)),
    (ELLIPSE, "dls:damping=0.1", (16.6, 182.7, 14.5, 182.7)),
    (ELLIPSE, "dls:damping=0.8", (248.0, 547.0, 159.0, 547.0)),
    (ELLIPSE, "safety", (0.0, 178.5, 0.0, 178.3)),
    (ELLIPSE, "safety-projection", (57.0, 422.0, 235.0, 426.0)),
]


@pytest.mark.parametrize(("path", "method", "expected"), EXPECTED)
def test_xarm7_settles_where_an_independent_simulation_does(path, method, expected):
    assert settled(XARM, path, method) == pytest.approx(expected, abs=1.0)


def test_the_papers_threshold_is_fixed():
    assert not methods.parse_method("jparse").method.adaptive
    assert not any(m.method.adaptive for m in methods.singular_gain_sweep((1.0, 2.0), gamma=0.1))
    assert methods.parse_method("jparse:adaptive=true").method.adaptive
    assert load(XARM, LINE).settings.length_scale == 1.0


@pytest.mark.parametrize("path", [LINE, ELLIPSE])
def test_pseudo_inverse_explodes(path):
    assert max(row.max_joint_speed for row in rows(XARM, path, "pinv")) > 100.0


@pytest.mark.parametrize(("path", "beyond"), [(LINE, {0}), (ELLIPSE, {1, 3})])
@pytest.mark.parametrize("limits", [False, True])
@pytest.mark.parametrize("method", ["jparse", "jparse:gain=1", JPARSE_PUBLISHED])
def test_jparse_reaches_what_can_be_reached_and_stretches_out_to_the_rest(path, beyond, limits, method):
    for i, row in enumerate(rows(XARM, path, method, limits)):
        if i in beyond:
            assert row.position_error > 0.1
            assert row.min_inverse_condition < 1e-3
            assert not math.isnan(row.settling_time)
        else:
            assert row.position_error < 1e-4
            assert row.orientation_error < 1e-4


@pytest.mark.parametrize("limits", [False, True])
def test_dls_keeps_an_error_at_reachable_targets_that_grows_with_the_damping(limits):
    errors = [settled(XARM, LINE, f"dls:damping={damping}", limits)[1:] for damping in (0.05, 0.1, 0.2, 0.4, 0.8)]
    assert errors[0][0] > 1.0
    assert errors[0][1] > 1.0
    assert np.all(np.diff(errors, axis=0) > 0.0)


def test_the_error_of_dls_comes_from_the_posture():
    assert settled(XARM, LINE, "dls:damping=0.1", posture_gain=0.0)[1:] == pytest.approx([0.0, 0.0], abs=0.1)


@pytest.mark.parametrize("method", ["projection", "safety-projection"])
def test_projections_stay_out_of_the_singular_region_and_off_the_target_in_it(method):
    line = rows(XARM, LINE, method)
    assert min(row.min_inverse_condition for row in line) > 0.08  # γ = 0.1, less an Euler step
    assert line[0].position_error > 1.4 * rows(XARM, LINE, "jparse")[0].position_error
    assert line[1].position_error > 0.03  # its σ_min/σ_max is 0.079


def test_safety_alone_commands_motion_that_the_arm_cannot_do():
    # The safety rule never comes to rest at the unreachable target, where J-PARSE without a posture comes to rest.
    assert rows(XARM, LINE, "safety", posture_gain=0.0)[0].rest_speed > 1.0
    assert rows(XARM, LINE, "jparse", posture_gain=0.0)[0].rest_speed < 0.01


def test_a_larger_singular_gain_leaves_the_singularity_faster():
    experiment = load(XARM, LINE)
    times = [
        summarize(ex.run(experiment, method))[1].settling_time
        for method in methods.singular_gain_sweep((0.25, 1.0, 4.0), gamma=0.1)
    ]
    assert np.all(np.diff(times) < 0.0)


@pytest.mark.parametrize("method", methods.ALL_METHODS)
def test_speed_limits_hold(method):
    for path in (LINE, ELLIPSE):
        run = drive(XARM, path, method, True)
        assert np.all(np.abs(run.qdot) <= run.experiment.chain.limits.velocity * (1.0 + 1e-12))


def test_overhead_is_reached():
    assert settled(XARM, "overhead", "jparse", True) == pytest.approx([0.0] * 4, abs=0.1)


# --- Gen3


def test_gen3_line():
    jparse = rows(GEN3, LINE, "jparse")
    assert [row.position_error for row in jparse[1:]] == pytest.approx([0.0, 0.0], abs=1e-3)
    assert jparse[0].min_inverse_condition < 1e-3
    mild, hard = (rows(GEN3, LINE, f"dls:damping={damping}") for damping in (0.1, 0.8))
    for i in range(3):
        assert jparse[i].position_error < mild[i].position_error < hard[i].position_error
    assert jparse[0].min_inverse_condition < min(r[0].min_inverse_condition for r in (mild, hard))


def sign_changes(values: np.ndarray) -> int:
    return int(np.count_nonzero(np.diff(np.signbit(values))))


def test_gen3_passes_its_internal_singularity_twice_a_cycle():
    run = drive(GEN3, "internal-singularity", "jparse")
    for cycle in range(3):
        assert sign_changes(run.q[run.segment == cycle, 1]) == 2
    assert all(row.min_inverse_condition < 0.01 for row in summarize(run))


@pytest.mark.parametrize("limits", [False, True])
def test_gen3_leaves_the_line_far_less_with_jparse(limits):
    jparse, mild, hard = (
        max(row.max_deviation for row in rows(GEN3, "internal-singularity", method, limits))
        for method in ("jparse", "dls:damping=0.1", "dls:damping=0.8")
    )
    assert jparse < 0.003
    assert jparse < 0.1 * mild < mild < hard


# --- PUMA 560


def test_puma_waypoints_are_at_their_locks():
    chain = sk.robots.load(PUMA)
    for name, q in paths.puma_locks().items():
        sigma = np.linalg.svd(chain.jacobian(q), compute_uv=False)
        lost = {"regular": 0, "shoulder lock": 1}.get(name, 2)
        assert np.count_nonzero(sigma / sigma[0] < 1e-9) == lost
        assert np.all(q >= chain.limits.lower)
        assert np.all(q <= chain.limits.upper)


@pytest.mark.parametrize("limits", [False, True])
def test_puma_reaches_every_lock(limits):
    for row in rows(PUMA, "shoulder-elbow-wrist", "jparse", limits):
        assert row.position_error < 1e-3
        assert row.orientation_error < 1e-3
        assert row.max_joint_speed < 10.0
        assert row.rest_speed < 0.01


def test_puma_passes_wrist_lock_twice_a_cycle():
    run = drive(PUMA, "wrist-lock", "jparse")
    limits = run.experiment.chain.limits
    for cycle in range(3):
        assert sign_changes(run.q[run.segment == cycle, 4]) == 2
    assert all(row.min_inverse_condition < 1e-3 for row in summarize(run))
    assert np.all((run.q > limits.lower) & (run.q < limits.upper))


def test_puma_on_the_line_through_wrist_lock():
    # In the singular direction J-PARSE acts like a damping of γσ_max/√K (0.18 here at K = 1) and DLS like λ.
    largest = {
        method: max(row.max_deviation for row in rows(PUMA, "wrist-lock", method))
        for method in ("jparse", "jparse:gain=4", "dls:damping=0.1", "dls:damping=0.8")
    }
    assert largest["jparse"] < 0.006
    assert largest["jparse"] < 0.2 * largest["dls:damping=0.8"]
    assert largest["jparse:gain=4"] < largest["dls:damping=0.1"] < largest["jparse"]


# --- any arm


@pytest.mark.parametrize("robot", sk.robots.names())
def test_every_arm_has_a_line(robot):
    assert LINE in paths.names(robot)
    if robot in (XARM, GEN3):
        pytest.skip("has a published one")
    out, home, _ = rows(robot, LINE, "jparse", True)
    assert out.position_error > 0.05
    assert out.min_inverse_condition < 0.03
    assert home.position_error < 1e-3


@pytest.mark.parametrize(("robot", "path"), [(r, p) for r in (XARM, GEN3, PUMA) for p in paths.names(r)])
def test_paths_that_move_start_where_the_arm_is(robot, path):
    experiment = load(robot, path)
    assert experiment.path.duration == pytest.approx(sum(s.duration for s in experiment.path.segments))
    if experiment.path.start is not None and experiment.path.moves:
        error = sk.pose_error(experiment.chain.pose(experiment.start), experiment.path.segments[0].target(0.0))
        assert np.linalg.norm(error) < 1e-3


def test_slow_line_is_the_line_through_the_internal_singularity():
    assert load(PUMA, "slow-line").path.name == "wrist-lock"
    assert load(GEN3, "slow-line").path.name == "internal-singularity"


def test_urdf_file(tmp_path):
    file = tmp_path / "mine.urdf"
    file.write_text(sk.robots.path(PUMA).read_text())
    experiment = ex.load(str(file), LINE)
    assert experiment.robot == "mine"
    assert experiment.settings == ReachSettings()
    limits = experiment.chain.limits
    assert np.all((experiment.start >= limits.lower) & (experiment.start <= limits.upper))
    assert ex.load(str(file), LINE, tip="link_3").chain.dof == 3


def test_load_refuses():
    with pytest.raises(ValueError, match="no shipped arm and no URDF file 'nobody'"):
        ex.load("nobody", LINE)
    with pytest.raises(ValueError, match="no path 'moon' for 'ur10'.*extended-line"):
        ex.load("ur10", "moon")
    with pytest.raises(ValueError, match="start has 2 values, but the arm has 6 joints"):
        ex.load("ur10", LINE, start=(0.0, 1.0))
    with pytest.raises(ValueError, match="rate must be positive"):
        ex.load("ur10", LINE, rate=0.0)


# --- runs and summaries


def test_run_is_consistent():
    run = drive(XARM, LINE, "jparse", True)
    experiment = run.experiment
    n = experiment.samples
    assert run.t.shape == (n,) == run.position_error.shape == run.inverse_condition.shape
    assert run.t[-1] == pytest.approx(experiment.path.duration - 1.0 / experiment.settings.rate)
    np.testing.assert_array_equal(run.q[0], experiment.start)
    np.testing.assert_allclose(run.q[1:], run.q[:-1] + run.qdot[:-1] / experiment.settings.rate, atol=1e-12)
    for k in (0, n // 2, n - 1):
        np.testing.assert_allclose(run.tip[k], experiment.chain.pose(run.q[k])[:3, 3], atol=1e-12)
    assert run.deviation is None
    assert set(np.unique(run.status)) <= {sk.Status.OK, sk.Status.DAMPED, sk.Status.LIMITED}
    assert run.scale.min() < 1.0 == run.scale.max()


def test_progress_counts_the_cycles():
    counted = []
    experiment = load(XARM, LINE)
    ex.run(experiment, methods.parse_method("dls"), progress=counted.append)
    assert sum(counted) == experiment.samples


def test_settling_time():
    t = np.arange(0.0, 10.0, 0.01)
    zero = np.zeros_like(t)
    # 2 % of 0.5 m is 10 mm: exp(-t) falls below that at ln 50.
    assert settling_time(0.5 * np.exp(-t), zero, 100.0) == pytest.approx(math.log(50.0), abs=0.02)
    assert settling_time(zero, 0.5 * np.exp(-t), 100.0) == pytest.approx(math.log(50.0), abs=0.02)
    assert settling_time(zero + 0.3, zero, 100.0) == 0.0
    assert settling_time(1e-4 * np.cos(t), zero, 100.0) == 0.0  # below 1 mm
    assert math.isnan(settling_time(0.1 + 0.05 * np.cos(20.0 * t), zero, 100.0))


def test_deviation_is_the_distance_from_the_line():
    line = paths.Line(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(line.deviation(np.array([[1.0, 9.0, 0.0], [4.0, -2.0, 4.0]])), [0.0, 5.0], atol=1e-15)


# --- methods by name


def test_method_names():
    assert methods.parse_method("dls:damping=0.8").method.damping == 0.8
    method = methods.parse_method("jparse:gain_linear=3,continuous=false").method
    assert (method.gain_linear, method.gain_angular, method.continuous) == (3.0, 1.0, False)
    assert methods.parse_method("jparse:gain=4").method.gain_angular == 4.0
    settings = ReachSettings(gamma=0.2, singular_gain=3.0)
    assert methods.parse_method("jparse", settings).method.gain_linear == 3.0
    assert methods.parse_method("safety", settings).method.gamma == 0.2
    assert methods.parse_method("adaptive-dls:rule=manipulability,relative=no").label.startswith("adaptive-dls:rule")
    # Buss and Kim's 45° an update.
    assert methods.parse_method("sdls", ReachSettings(rate=50.0)).method.max_speed == pytest.approx(12.5 * math.pi)


def test_lists_of_methods():
    labels = [m.label for m in methods.parse_methods(["jparse:gain_linear=2,gain_angular=2,dls:damping=0.8", "pinv"])]
    assert labels == ["jparse:gain_linear=2,gain_angular=2", "dls:damping=0.8", "pinv"]
    assert [m.label for m in methods.parse_methods(["all"])] == list(methods.ALL_METHODS)
    assert len(methods.parse_methods(["all", "jparse"])) == len(methods.ALL_METHODS)


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("magic", "unknown method 'magic'; there are jparse, pinv, dls"),
        ("dls:lambda=1", "method 'dls' has no parameter 'lambda=1'; it has damping=0.1"),
        ("dls:damping", "no parameter 'damping'"),
        ("dls:damping=much", "damping is a number, not 'much'"),
        ("jparse:continuous=perhaps", "continuous is true or false"),
        ("jparse:gamma=2", "method 'jparse:gamma=2': "),
        ("", "unknown method ''"),
    ],
)
def test_wrong_methods(spec, message):
    with pytest.raises(ValueError, match=message):
        methods.parse_method(spec)


# --- files


def test_waypoints_from_files(tmp_path):
    table = tmp_path / "way.csv"
    table.write_text(
        "# two poses\nname, x, y, z, roll, pitch, yaw, duration\n"
        "there, 0.5, 0, 0.4, 3.14159265, 0, 0, 2\n, 0.4, 0.1, 0.3, 0, 0.5, 0, 1.5\n"
    )
    path = paths.read_waypoints(table)
    assert [s.name for s in path.segments] == ["there", "(0.4,0.1,0.3)"]
    assert path.duration == 3.5
    np.testing.assert_allclose(path.segments[0].pose[:3, :3], np.diag([1.0, -1.0, -1.0]), atol=1e-8)
    np.testing.assert_allclose(path.segments[1].pose[:3, 3], [0.4, 0.1, 0.3])

    numbers = [0.4, 0.1, 0.3, 0.0, 0.5, 0.0, 1.5]
    for i, content in enumerate(([numbers], {"waypoints": [dict(zip(paths.COLUMNS, numbers, strict=True), name="a")]})):
        file = tmp_path / f"way{i}.json"
        file.write_text(json.dumps(content))
        read = paths.read_waypoints(file)
        np.testing.assert_allclose(read.segments[0].pose, path.segments[1].pose, atol=1e-15)
    experiment = ex.load(XARM, table, rate=20.0)
    assert ex.run(experiment, methods.parse_method("jparse")).t.shape == (70,)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("w.csv", "x,y,z,roll,pitch,yaw\n", "no column duration"),
        ("w.csv", "", "no column x, y, z"),
        ("w.csv", "x,y,z,roll,pitch,yaw,duration\n", "there are none"),
        (
            "w.csv",
            "x,y,z,roll,pitch,yaw,duration\n1,2,3,0,0,0,1\n1,2,three,0,0,0,1\n",
            "line 3: z must be a finite",
        ),
        ("w.csv", "x,y,z,roll,pitch,yaw,duration\n1,2,3,0,0\n", "line 2: yaw is missing"),
        ("w.csv", "x,y,z,roll,pitch,yaw,duration\n1,2,nan,0,0,0,1\n", "z must be a finite number, not 'nan'"),
        ("w.csv", "x,y,z,roll,pitch,yaw,duration\n1,2,3,0,0,0,0\n", "duration must be positive"),
        ("w.json", "[[1,2]]", "waypoint 1: 2 numbers"),
        ("w.json", "[", "line 1"),
        ("w.json", "3", "a list of waypoints"),
        ("w.json", "[3]", "neither an object nor a list"),
        ("w.json", '[{"x": 1}]', "waypoint 1: y is missing"),
        ("w.json", "[[1,2,3,0,0,0,null]]", "duration is missing"),
    ],
)
def test_wrong_waypoints(tmp_path, name, content, message):
    file = tmp_path / name
    file.write_text(content)
    with pytest.raises(ValueError, match=message) as error:
        paths.read_waypoints(file)
    assert str(file) in str(error.value)


def test_waypoints_that_are_not_there(tmp_path):
    with pytest.raises(ValueError, match="No such file"):
        paths.read_waypoints(tmp_path / "none.csv")


def test_rotation_turns_about_fixed_axes():
    # Roll first, about x: the tool's z axis comes to -y; then yaw about the fixed z brings it to x.
    np.testing.assert_allclose(
        paths.rotation_rpy(math.pi / 2, 0.0, math.pi / 2) @ [0.0, 0.0, 1.0], [1, 0, 0], atol=1e-15
    )


def test_saved_runs_read_back(tmp_path):
    run = drive(XARM, LINE, "jparse", True)
    with np.load(files.save_run(run, tmp_path / "deep" / "run.npz")) as data:
        for name in (
            "t",
            "q",
            "qdot",
            "target",
            "pose_error",
            "singular_values",
            "status",
            "scale",
            "segment",
        ):
            np.testing.assert_array_equal(data[name], getattr(run, name))
        assert str(data["method"]) == "jparse"
        assert json.loads(str(data["settings"]))["rate"] == 50.0
        assert data["joint_names"].tolist() == list(run.experiment.chain.joint_names)
    with files.save_run(run, tmp_path / "run.csv", "csv").open(newline="") as stream:
        table = list(csv.DictReader(stream))
    assert len(table) == run.experiment.samples
    assert float(table[7]["q_joint3"]) == run.q[7, 2]
    assert float(table[7]["error_rz"]) == run.pose_error[7, 5]
    with csv_file.save_rows(summarize(run), tmp_path / "sum.csv").open(newline="") as stream:
        summary = list(csv.DictReader(stream))
    assert [float(row["position_error"]) for row in summary] == [row.position_error for row in summarize(run)]


def test_files_are_written_whole_or_not_at_all(tmp_path):
    file = tmp_path / "data.csv"
    file.write_text("before")

    def fail(stream):
        stream.write(b"half")
        raise RuntimeError("disk")

    with pytest.raises(RuntimeError, match="disk"):
        write_atomically(file, fail)
    assert file.read_text() == "before"
    assert list(tmp_path.iterdir()) == [file]


# --- pictures


def test_figure(tmp_path):
    figure_ = pytest.importorskip("sigmaik_lab.reach.figure")
    from sigmaik._plotting import save_figure

    runs = [drive(XARM, LINE, method, limits) for method in methods.ALL_METHODS for limits in (False, True)]
    figure = figure_.reach_figure(runs)
    axes = figure.axes
    assert len(axes) == 8
    assert len(axes[0].get_lines()) >= len(methods.ALL_METHODS)
    file = save_figure(figure, tmp_path / "a.png")
    assert 10_000 < file.stat().st_size < 200_000
    assert file.read_bytes().startswith(b"\x89PNG")


def test_figure_of_a_line_shows_the_distance_from_it():
    figure_ = pytest.importorskip("sigmaik_lab.reach.figure")
    run = drive(PUMA, "wrist-lock", "jparse")
    figure = figure_.reach_figure([run])
    assert len(figure.axes) == 4
    assert "line" in figure.axes[0].get_ylabel()
    with pytest.raises(ValueError, match="no run"):
        figure_.reach_figure([])


# --- the real arm


def test_the_real_arms_setting_reaches_what_is_within_reach():
    """Figures 20 and 21: rest at the poses within reach, and the singularity at the others."""
    e = ex.load("ufactory_xarm7", "extended-line", setting="real")
    s = e.settings
    assert (s.gain_linear, s.gain_angular, s.max_position_error, s.rate) == (1.0, 1.0, 0.1, 50.0)
    assert [segment.duration for segment in e.path.segments] == [40.0] * 3
    rows = summarize(ex.run(e, methods.parse_method("jparse", s)))
    assert rows[0].position_error > 0.3
    assert rows[0].min_inverse_condition < 1e-4
    assert all(row.position_error < 1e-5 and row.rest_speed < 1e-3 for row in rows[1:])
    assert max(row.max_speed_ratio for row in rows) < 0.2


def test_only_the_papers_real_arm_has_a_real_setting():
    with pytest.raises(ValueError, match="there is ufactory_xarm7"):
        ex.load("puma560", "wrist-lock", setting="real")
    with pytest.raises(ValueError, match="moves, and waits nowhere"):
        ex.load("ufactory_xarm7", "overhead-line", setting="real")
    with pytest.raises(ValueError, match="no setting 'dreamt'"):
        ex.load("ufactory_xarm7", "extended-line", setting="dreamt")
