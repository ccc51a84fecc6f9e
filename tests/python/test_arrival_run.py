"""The benchmark of arrivals: peers behind one interface, any executor, and runs that resume."""

import concurrent.futures
import csv
import dataclasses
import math
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pytest

import sigmaik as sk
from sigmaik_lab.__main__ import main
from sigmaik_lab.arrival import peers, run
from sigmaik_lab.arrival.experiment import ArrivalSettings, arrivals, draw_trials, drive, drive_trial
from sigmaik_lab.arrival.judge import TrialRow, held_limits
from sigmaik_lab.arrival.peers.urdf import chain_urdf, roll_pitch_yaw
from sigmaik_lab.arrival.servos import check_servo, make_driven
from sigmaik_lab.arrival.summary import summarize_arrivals
from sigmaik_lab.row_file import read_rows

SETTINGS = ArrivalSettings(trials=3, time=1.0, rate=200.0, seed=2)
PLAN = run.Plan((run.ArmSource("ur10"), run.ArmSource("puma560")), ("default", "dls"), SETTINGS)


def timeless(rows):
    return [dataclasses.replace(row, cycle=0.0) for row in rows]


# --- peers


class Newton:
    """A peer of a few lines: a whole Newton step in each cycle, without any limit."""

    settings, version, led = "damped Newton", "newton 1.0", False

    def __init__(self, chain, dt, breaks_after=None):
        self._chain, self._dt, self._left = chain, dt, breaks_after
        self.q = np.zeros(chain.dof)

    def reset(self, q):
        self.q = q.copy()

    def put(self, q):
        self.q = q.copy()

    def update(self, target):
        if self._left is not None:
            self._left -= 1
            if self._left < 0:
                raise RuntimeError("no solution")
        J = self._chain.jacobian(self.q)
        step = J.T @ np.linalg.solve(J @ J.T + 1e-8 * np.eye(6), sk.pose_error(self._chain.pose(self.q), target))
        self.q = self.q + step
        return step / self._dt


def driven(servo, chain, settings=SETTINGS):
    trials = draw_trials(chain, settings)
    return arrivals([drive_trial(chain, trial, servo, settings, ("x", "y", k)) for k, trial in enumerate(trials)])


def test_a_peer_is_driven_and_judged_like_our_servos():
    chain = sk.robots.load("ur10")
    done = driven(Newton(chain, 1.0 / SETTINGS.rate), chain)
    row = summarize_arrivals("ur10", "near", "newton", done)
    assert row.arrived == 1.0
    assert row.median_time <= 0.05  # Newton needs a few cycles, and breaks the limits for it
    assert row.over > 0.1
    assert row.jump > 10.0
    assert row.excess == pytest.approx(row.jump - 1.0)
    assert row.failed == 0.0
    assert row.cycle > 0.0


def test_a_clipped_peer_holds_velocity_and_acceleration_limits():
    chain = sk.robots.load("ur10")
    clipped = peers.Clipped(Newton(chain, 1.0 / SETTINGS.rate), chain, 1.0 / SETTINGS.rate)
    clipped.reset(sk.robots.home("ur10"))
    velocity, acceleration, _ = held_limits(chain)
    last, q = np.zeros(6), clipped.q
    for _ in range(300):
        qdot = clipped.update(chain.pose(sk.robots.home("ur10") + 1.0))
        assert np.all(np.abs(qdot) <= velocity * (1.0 + 1e-12))
        assert np.all(np.abs(qdot - last) * SETTINGS.rate <= acceleration * (1.0 + 1e-9))
        np.testing.assert_allclose(clipped.q, q + qdot / SETTINGS.rate, atol=1e-15)
        last, q = qdot, clipped.q
    assert np.abs(qdot).max() > 0.1
    assert driven(clipped, chain).jump.max() <= 1.0 + 1e-9


@pytest.mark.parametrize("after", [0, 5, 190])
def test_a_peer_that_raises_an_error_has_not_arrived_and_stands_still(after):
    chain = sk.robots.load("ur10")
    trial = draw_trials(chain, SETTINGS)[0]
    row = drive_trial(chain, trial, Newton(chain, 5e-3, breaks_after=after), SETTINGS, ("", "", 0))
    assert row.failed
    assert row.time == math.inf
    assert row.speed == 0.0
    if after == 0:
        assert (row.jump, row.over, row.cycle) == (0.0, 0.0, 0.0)
    whole = drive_trial(chain, trial, Newton(chain, 5e-3), SETTINGS, ("", "", 0))
    assert row.jump in (0.0, whole.jump)  # the stop is not the servo's command
    nan = Newton(chain, 5e-3)
    nan.update = lambda target: np.full(6, math.nan)
    row = drive_trial(chain, trial, nan, SETTINGS, ("", "", 0))
    assert row.failed
    assert np.isfinite([row.position, row.over, row.jump, row.departure]).all()


def test_the_model_of_the_peers_is_the_chain():
    """Read again, the URDF has the same poses, limits and joints, exactly at a pitch of 90° too."""
    rng = np.random.default_rng(3)
    for name in sk.robots.names():
        chain = sk.robots.load(name)
        text = chain_urdf(chain)
        again = sk.Chain.from_urdf(text)
        assert (again.joint_names, again.base, again.tip) == (chain.joint_names, chain.base, chain.tip)
        bounded = np.isfinite(chain.limits.lower)
        np.testing.assert_array_equal(again.limits.lower[bounded], chain.limits.lower[bounded])
        np.testing.assert_array_equal(again.limits.velocity, np.minimum(chain.limits.velocity, 1e3))
        for _ in range(5):
            q = chain.random_configuration(rng)
            np.testing.assert_allclose(again.pose(q), chain.pose(q), atol=2e-8)
    for pitch in (90.0, -90.0, 89.9999, 30.0):
        rotation = sk.rotation_exp([0.0, math.radians(pitch), 0.0]) @ sk.rotation_exp([0.4, 0.0, 0.0])
        roll, tilt, yaw = roll_pitch_yaw(rotation)
        back = sk.rotation_exp([0, 0, yaw]) @ sk.rotation_exp([0, tilt, 0]) @ sk.rotation_exp([roll, 0, 0])
        np.testing.assert_allclose(back, rotation, atol=2e-8)
    assert not ET.fromstring(text).findall(".//visual")


def test_a_peer_that_is_not_installed_ends_the_command_with_a_command_of_pip(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "placo", None)
    with pytest.raises(sk.Error, match=r"pip install 'placo>=0.10'"):
        make_driven("placo", sk.robots.load("ur10"), 100.0)
    arguments = ["arrival", "--servo", "default,placo+clip", "--no-plot", "--out", str(tmp_path)]
    assert main(arguments) == 2
    error = capsys.readouterr().err.strip()
    assert "pip install 'placo>=0.10'" in error
    assert len(error.splitlines()) == 1
    check_servo("placo", installed=False)


@pytest.mark.parametrize("name", ["placo+fast", "jparse-robotics+acceleration", "embodik+clip", "magic", "magic+clip"])
def test_servos_that_there_are_not(name):
    with pytest.raises(ValueError, match="no servo"):
        check_servo(name, installed=False)


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # of numpy.matrix, in jparse-robotics
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of hppfcl, in pinocchio 3
@pytest.mark.parametrize(
    "name",
    [
        *peers.PEERS,
        *(f"{name}+clip" for name, peer in peers.PEERS.items() if peer.clips),
        *(f"{name}+acceleration" for name, peer in peers.PEERS.items() if peer.accelerates),
    ],
)
def test_installed_peers_move_the_tool_towards_the_target(name):
    try:
        peers.need_peer(name.partition("+")[0])
    except sk.Error as missing:
        pytest.skip(str(missing))
    chain = sk.robots.load("franka_panda")
    home = sk.robots.home("franka_panda")
    servo = make_driven(name, chain, 1000.0)
    servo.reset(home)
    np.testing.assert_allclose(servo.q, home, atol=1e-12)
    target = chain.pose(home)
    target[:3, 3] += (0.02, -0.01, 0.03)
    q, errors = home, []
    for _ in range(600):
        qdot = servo.update(target)
        q = q + 1e-3 * qdot
        np.testing.assert_allclose(servo.q, q, atol=1e-9)  # the command is the motion
        q = servo.q
        errors.append(np.linalg.norm(sk.pose_error(chain.pose(q), target)[:3]))
    # A peer with acceleration limits may swing about the target, and has been near it all the same.
    assert min(errors) < 0.3 * np.linalg.norm([0.02, 0.01, 0.03])
    assert servo.settings
    assert servo.version
    servo.reset(home)
    np.testing.assert_allclose(servo.q, home, atol=1e-12)


# --- the run


@pytest.fixture(scope="module")
def expected():
    return timeless(run.run_trials(PLAN))


def test_a_run_is_that_of_drive(expected):
    assert [(row.robot, row.servo, row.trial) for row in expected] == [
        (arm, servo, k) for arm in ("ur10", "puma560") for servo in ("default", "dls") for k in range(3)
    ]
    chain = sk.robots.load("puma560")
    done = drive(chain, draw_trials(chain, SETTINGS), "dls", SETTINGS)
    np.testing.assert_array_equal(done.position, [row.position for row in expected[9:]])


@pytest.mark.parametrize("kind", [concurrent.futures.ThreadPoolExecutor, concurrent.futures.ProcessPoolExecutor])
def test_executors(kind, expected, tmp_path):
    with kind(2) as pool:
        assert timeless(run.run_trials(PLAN, tmp_path / "rows.csv", pool, 2)) == expected


def test_dask(expected):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        assert timeless(run.run_trials(PLAN, pool=client.get_executor(), jobs=1)) == expected


def test_a_run_resumes_and_computes_nothing_twice(expected, tmp_path, monkeypatch):
    file = tmp_path / "rows.csv"
    run.run_trials(dataclasses.replace(PLAN, servos=("dls",)), file)
    text = file.read_text()
    file.write_text(text[: text.rindex("puma560") + 20])  # cut off in the last row
    done = []
    work = run.drive_chunk
    monkeypatch.setattr(run, "drive_chunk", lambda task: done.append((task[0].name, *task[1::2])) or work(task))
    assert timeless(run.run_trials(PLAN, file)) == expected
    assert done == [("ur10", "default", (0, 1, 2)), ("puma560", "default", (0, 1, 2)), ("puma560", "dls", (2,))]
    done.clear()
    again = run.run_trials(PLAN, file)
    assert again == sorted(read_rows(file, TrialRow)[1], key=lambda r: again.index(r))
    assert not done
    # Fewer trials are a part of the file, and more trials go on from the file.
    fewer = dataclasses.replace(PLAN, settings=dataclasses.replace(SETTINGS, trials=2))
    assert timeless(run.run_trials(fewer, file)) == [row for row in expected if row.trial < 2]
    more = dataclasses.replace(PLAN, servos=("dls",), settings=dataclasses.replace(SETTINGS, trials=4))
    assert len(run.run_trials(more, file)) == 8
    assert done == [("ur10", "dls", (3,)), ("puma560", "dls", (3,))]


def test_rows_of_other_settings_are_refused(tmp_path):
    file = tmp_path / "rows.csv"
    run.known_rows(PLAN, file)
    for change in ({"seed": 3}, {"rate": 100.0}, {"jerk": 50.0}, {"time": 2.0}, {"targets": "random"}):
        other = dataclasses.replace(PLAN, settings=dataclasses.replace(SETTINGS, **change))
        with pytest.raises(ValueError, match="another study"):
            run.known_rows(other, file)


def test_rows_of_a_peer_need_no_peer(monkeypatch, tmp_path, capsys):
    """The rows that one environment has computed are reported in another one, where the peer cannot be imported."""
    file = tmp_path / "rows.csv"
    plan = run.Plan((run.ArmSource("ur10"),), ("default",), SETTINGS)
    run.run_trials(plan, file)
    file.write_text(file.read_text().replace("ur10,default", "ur10,placo").replace("sigmaik 0", "placo 0"))
    monkeypatch.setitem(sys.modules, "placo", None)
    arguments = ["arrival", "--robot", "ur10", "--trials", "3", "--time", "1", "--rate", "200", "--seed", "2"]
    arguments += ["--no-plot", "--out", str(tmp_path), "--resume", str(file)]
    assert main([*arguments, "--servo", "default,placo"]) == 0
    assert "placo 0" in capsys.readouterr().out
    with (tmp_path / "ur10-arrival-near.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["servo"] for row in rows] == ["default", "placo"]
    assert rows[0]["median_time"] == rows[1]["median_time"]
    assert main([*arguments, "--servo", "default,placo", "--trials", "4"]) == 2
    assert main([*arguments, "--seed", "9"]) == 2
    assert "another study" in capsys.readouterr().err


def test_a_foreign_urdf_runs_in_processes(tmp_path, capsys):
    file = tmp_path / "mine.urdf"
    file.write_text(chain_urdf(sk.robots.load("puma560")))
    arguments = ["arrival", "--robot", str(file), "--trials", "2", "--time", "0.5", "--rate", "100", "--jobs", "2"]
    assert main([*arguments, "--tip", "flange", "--no-plot", "--out", str(tmp_path)]) == 0
    assert "mine" in capsys.readouterr().out
    assert main([*arguments, "--jobs", "0"]) == 2
