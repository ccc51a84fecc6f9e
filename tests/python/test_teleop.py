"""Sessions, recordings, devices and drawings without a browser; the page itself is tested in tests/browser."""

import json
import sys
import time
import types

import numpy as np
import pytest

import sigmaik as sk
from sigmaik.teleop import Episode, Session, Settings, devices, gauges
from sigmaik_lab.__main__ import main
from sigmaik_lab.drill.experiment import ROBOTS, drill


def until(condition, seconds=20.0):
    """Waits for the condition; machines may be busy."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.01)


def latest(session):
    session.read()
    return session.latest


@pytest.fixture
def session():
    with Session("franka_panda", rate=500.0) as running:
        until(lambda: latest(running) is not None)
        yield running


def moved(session, dx, dy, dz):
    pose = latest(session)["pose"].copy()
    pose[:3, 3] += (dx, dy, dz)
    return pose


# --- commands


def test_a_pose_is_followed_and_a_stale_one_stops(session):
    session.pose_timeout = 0.3
    target = moved(session, 0.0, 0.3, 0.0)
    session.follow(target)
    until(lambda: latest(session)["command"] == sk.LoopCommand.STALE)
    until(lambda: not latest(session)["qdot"].any())
    assert latest(session)["status"] == sk.Status.HOLDING
    session.refresh()  # the watcher repeats the pose
    assert session.goal is not None
    until(lambda: latest(session)["command"] == sk.LoopCommand.POSE)
    session.pose_timeout = 30.0
    session.refresh()
    until(lambda: np.linalg.norm(latest(session)["pose"][:3, 3] - target[:3, 3]) < 1e-3)


def test_a_twist_moves_only_while_it_is_said(session):
    session.start_recording()
    session.twist([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    until(lambda: latest(session)["command"] == sk.LoopCommand.STALE)
    until(lambda: not latest(session)["qdot"].any())
    episode = session.stop_recording()
    said = episode["command"] == sk.LoopCommand.TWIST
    assert said.any()
    assert np.diff(episode["time"][said]).sum() < session.twist_timeout + 0.1
    session.refresh()  # there is no pose to repeat
    time.sleep(0.05)
    assert latest(session)["command"] == sk.LoopCommand.STALE


def test_refused_commands_leave_all_as_it_is(session):
    for wrong, why in (
        (np.eye(3), "4×4 pose"),
        (np.full((4, 4), np.nan), "finite"),
        (2.0 * np.eye(4), "not a pose"),
        ("here", "could not convert"),
    ):
        with pytest.raises(ValueError, match=why):
            session.follow(wrong)
    far = np.eye(4)
    far[0, 3] = 1e3
    with pytest.raises(ValueError, match="100 m"):
        session.follow(far)
    with pytest.raises(ValueError, match="twist"):
        session.twist([0.0] * 5)
    assert session.goal is None
    assert latest(session)["command"] == sk.LoopCommand.HOLD


# --- settings


def test_settings_change_without_a_kick(session):
    session.start_recording()
    session.follow(moved(session, 2.0, 0.0, 0.0))
    changes = [{"method": name} for name in sk.methods.ALL]
    changes += [{"gamma": 0.3}, {"on_limit": "scale"}, {"mask": (True,) * 3 + (False,) * 3}, {"gain_linear": 15.0}]
    for change in changes:
        session.configure(**change)
        time.sleep(0.08)
        session.read()
    episode = session.stop_recording()
    assert len(np.unique(episode["configuration"])) >= len(changes) / 2
    assert episode.broken_limits() == {"position": 0, "velocity": 0, "acceleration": 0}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"method": "magic"}, "unknown method"),
        ({"gamma": float("nan")}, "gamma"),
        ({"gamma": 2.0}, "gamma"),
        ({"gain_linear": -1.0}, "gain_linear"),
        ({"gain_linear": "fast"}, "gain_linear"),
        ({"gain_linear": True}, "gain_linear"),
        ({"gain_linear": None}, "gain_linear"),
        ({"max_linear_error": 0.0}, "max_linear_error"),
        ({"max_linear_error": "far"}, "max_linear_error must be a finite number or None"),
        ({"length_scale": float("inf")}, "length_scale must be a finite number or None"),
        ({"assumed_acceleration": 0.0}, "assumed_acceleration"),
        ({"on_limit": "break"}, "on_limit"),
        ({"on_limit": 3}, "on_limit"),
        ({"limits": "no"}, "limits"),
        ({"guided": "yes"}, "guided"),
        ({"guided": 1}, "guided"),
        ({"mask": (False,) * 6}, "mask"),
        ({"mask": (1, 2)}, "mask"),
        ({"frame": "world"}, "frame"),
        ({"colour": "red"}, "no setting 'colour'"),
    ],
)
def test_refused_settings_leave_all_as_it_is(session, change, words):
    before = session.settings
    with pytest.raises(ValueError, match=words):
        session.configure(**change)
    assert session.settings == before


@pytest.mark.parametrize("wrong", [{"rate": 0.0}, {"rate": 1e6}, {"pose_timeout": -1.0}])
def test_refused_sessions(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Session("ur10", **wrong)


def test_accelerations_that_nobody_gave_are_assumed_and_named():
    session = Session("ur10")
    assert session.assumed == session.chain.joint_names
    assert session.settings.assumed_acceleration == sk.Servo(session.chain).options["assumed_acceleration"] == 10.0
    assert Session("franka_panda").assumed == ()
    for wrong in (0.0, -1.0, float("nan"), "fast", True):
        with pytest.raises(ValueError, match="assumed_acceleration"):
            Session("ur10", settings=Settings(assumed_acceleration=wrong))


def test_accelerations_that_are_assumed_are_held_and_counted():
    with Session("ur10", rate=500.0, settings=Settings(assumed_acceleration=3.0)) as session:
        until(lambda: latest(session) is not None)
        session.start_recording()
        session.follow(moved(session, 0.0, 0.2, 0.2))
        until(lambda: np.abs(latest(session)["qdot"]).max() > 0.1)
        session.configure(assumed_acceleration=float("inf"))
        time.sleep(0.1)
        session.configure(assumed_acceleration=3.0)
        time.sleep(0.1)
        episode = session.stop_recording()
    assert episode.broken_limits()["acceleration"] == 0
    held = np.array([episode.settings[c].assumed_acceleration for c in episode["configuration"].tolist()]) == 3.0
    change = np.abs(np.diff(episode["qdot"], axis=0)).max(axis=1) / episode.dt
    assert 2.9 < change[held[1:] & held[:-1]].max() < 3.0 * (1.0 + 1e-6)
    samples = episode.samples.copy()
    samples["qdot"][np.flatnonzero(held)[2], 0] += 1.0
    assert (
        Episode(samples, episode.arm, episode.dt, episode.settings, episode.before).broken_limits()["acceleration"] > 0
    )


def test_settings_are_the_servos_defaults():
    arm = sk.robots.load("ufactory_xarm7")
    servo = Settings().servo(arm, 1e-3, sk.robots.home("ufactory_xarm7"))
    ours, product = servo.options, sk.Servo(arm).options
    others = {name for name in ours if not np.array_equal(ours[name], product[name])}
    assert others == {"posture", "posture_gain", "guided"}
    assert servo.method == sk.JParse()
    session = Session("ufactory_xarm7")
    assert session.length_scale == servo.length_scale == arm.characteristic_length
    session.configure(length_scale=0.5)
    assert session.length_scale == 0.5
    session.configure(length_scale=None, max_linear_error=0.1)
    assert session.length_scale == arm.characteristic_length


# --- recordings


@pytest.fixture(scope="module")
def episode():
    """A pose, changes under way, a restart, a twist and a rest."""
    with Session("ufactory_xarm7", rate=500.0) as session:
        until(lambda: latest(session) is not None)
        session.follow(moved(session, 0.1, 0.2, 0.1))
        time.sleep(0.2)
        session.start_recording()
        time.sleep(0.2)
        session.configure(method="dls:damping=0.05", gain_linear=9.0)
        time.sleep(0.2)
        session.restart()
        session.twist([0.1, 0.0, 0.1, 0.3, 0.0, 0.0])
        time.sleep(0.4)
        return session.stop_recording()


def test_a_recording_has_every_cycle(episode):
    assert len(episode) > 200
    assert len(episode.runs) == 2
    for run in episode.runs:
        assert (np.diff(episode["cycle"][run]) == 1).all()
        np.testing.assert_allclose(
            np.diff(episode["q"][run], axis=0), episode["qdot"][run][1:] * episode.dt, atol=1e-12
        )
    assert set(episode["command"]) >= {sk.LoopCommand.POSE, sk.LoopCommand.TWIST, sk.LoopCommand.STALE}
    assert [s.method for s in episode.settings.values()][0] == "jparse"
    assert [s.method for s in episode.settings.values()][-1] == "dls:damping=0.05"


def test_a_recording_plays_again_to_the_bit(episode, tmp_path):
    np.testing.assert_array_equal(episode.play(), episode["q"])
    loaded = Episode.load(episode.save(tmp_path / "e.npz"))
    assert loaded.samples.dtype == episode.samples.dtype
    for name in episode.samples.dtype.names:
        np.testing.assert_array_equal(loaded[name], episode[name])
    assert dict(loaded.settings) == dict(episode.settings)
    np.testing.assert_array_equal(loaded.play(), episode["q"])
    # What was recorded is what plays: another rule gives other positions.
    other = {number: Settings(method="safety", gain_linear=2.0) for number in loaded.settings}
    changed = Episode(loaded.samples, loaded.arm, loaded.dt, other, loaded.before)
    assert np.abs(changed.play() - episode["q"]).max() > 1e-3


def test_missing_cycles_are_said(episode):
    holed = Episode(np.delete(episode.samples, 50), episode.arm, episode.dt, episode.settings, episode.before)
    assert len(holed.runs) == 3
    with pytest.raises(ValueError, match="are missing"):
        holed.play()


def test_broken_limits_are_counted(episode):
    assert sum(episode.broken_limits().values()) == 0
    samples = episode.samples.copy()
    samples["q"][10, 0] = 10.0
    samples["qdot"][20, 1] = 10.0
    broken = Episode(samples, episode.arm, episode.dt, episode.settings, episode.before).broken_limits()
    assert broken == {"position": 1, "velocity": 1, "acceleration": 2}


def test_what_is_no_recording_is_refused(tmp_path):
    (tmp_path / "text.npz").write_text("not a zip")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    for name in ("text.npz", "other.npz"):
        with pytest.raises(ValueError, match="not a recording"):
            Episode.load(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        Episode.load(tmp_path / "none.npz")


def test_recording_has_a_beginning_an_end_and_a_longest():
    with Session("ur10", rate=500.0, longest_recording=50) as session:
        with pytest.raises(ValueError, match="not recording"):
            session.stop_recording()
        session.start_recording()
        with pytest.raises(ValueError, match="already"):
            session.start_recording()
        until(lambda: (session.read(), session.recording_full)[1])
        assert len(session.stop_recording()) == 50


# --- the guide


def beyond_the_branch(session):
    """A pose behind a PUMA 560 that the tool's own way misses by more than 5 cm."""
    pose = latest(session)["pose"].copy()
    pose[:3, 3] = -0.3, -0.15, 0.9
    return pose


def at_rest(session, target):
    """Whether the arm follows the target and hardly moves any more, at the target or elsewhere."""
    sample = latest(session)
    return np.array_equal(sample["target"], target) and np.abs(sample["qdot"]).max() < 1e-3


def distance(sample, target):
    return np.linalg.norm(sample["pose"][:3, 3] - target[:3, 3])


def recorded_way(guided):
    """A recording from rest on, until the arm rests again. Also the distance at the end, and the newest sample."""
    with Session("puma560", rate=500.0, pose_timeout=60.0, settings=Settings(guided=guided)) as session:
        until(lambda: latest(session) is not None)
        target = beyond_the_branch(session)
        session.start_recording()
        session.follow(target)
        until(lambda: np.abs(latest(session)["qdot"]).max() > 0.1)
        until(lambda: at_rest(session, target))
        last = session.latest.copy()
        return session.stop_recording(), distance(last, target), last


@pytest.fixture(scope="module")
def guided():
    return recorded_way(True)


@pytest.fixture(scope="module")
def unguided():
    return recorded_way(False)


def test_the_guide_leads_where_the_tools_own_way_does_not_arrive(guided, unguided):
    episode, left, last = guided
    assert left < 1e-3
    assert sk.GuideState.CHANGING_BRANCH in episode["guide"]
    assert last["guide"] == sk.GuideState.DIRECT
    assert episode.broken_limits() == {"position": 0, "velocity": 0, "acceleration": 0}
    episode, left, _ = unguided
    assert left > 0.05
    assert set(episode["guide"]) == {sk.GuideState.OFF}
    assert not episode["guide_joints"].any()


def test_samples_say_what_the_servos_guide_does(guided):
    episode, _, _ = guided
    (settings,) = episode.settings.values()
    assert settings.guided
    twin = settings.servo(episode.arm.chain, episode.dt, episode.arm.home)
    twin.reset(*episode.before)
    joints = set()
    for sample in episode.samples:
        step = twin.update(sample["target"]) if sample["command"] == sk.LoopCommand.POSE else twin.hold()
        assert sample["guide"] == step.guide
        assert [i for i in range(16) if sample["guide_joints"] >> i & 1] == list(step.guide_joints)
        joints |= set(step.guide_joints)
    assert joints


def test_a_guided_recording_plays_again_to_the_bit(guided, tmp_path):
    episode, _, _ = guided
    loaded = Episode.load(episode.save(tmp_path / "guided.npz"))
    assert dict(loaded.settings) == dict(episode.settings)
    for field in ("guide", "guide_joints"):
        assert loaded[field].dtype == episode[field].dtype
        np.testing.assert_array_equal(loaded[field], episode[field])
    np.testing.assert_array_equal(loaded.play(), episode["q"])


def test_a_recording_that_begins_and_switches_while_the_guide_leads_plays_again_to_the_bit():
    with Session("puma560", rate=500.0, pose_timeout=60.0, settings=Settings(assumed_acceleration=2.0)) as session:
        until(lambda: latest(session) is not None)
        session.follow(beyond_the_branch(session))
        until(lambda: latest(session)["guide"] == sk.GuideState.CHANGING_BRANCH)
        session.start_recording()
        until(lambda: latest(session)["guide"] == sk.GuideState.CHANGING_BRANCH and session.recorded > 0)
        session.configure(guided=False)
        until(lambda: latest(session)["guide"] == sk.GuideState.OFF)
        session.configure(guided=True)
        until(lambda: latest(session)["guide"] == sk.GuideState.CHANGING_BRANCH)
        session.twist([0.0, 0.0, 0.05, 0.0, 0.0, 0.0])  # a twist is never overruled
        until(lambda: latest(session)["command"] == sk.LoopCommand.TWIST)
        assert latest(session)["guide"] == sk.GuideState.OFF
        episode = session.stop_recording()
    assert [s.guided for s in episode.settings.values()] == [True, False, True]
    assert episode.broken_limits() == {"position": 0, "velocity": 0, "acceleration": 0}
    np.testing.assert_array_equal(episode.play(), episode["q"])


def test_a_recording_from_before_the_guide_plays_unguided_to_the_bit(unguided, tmp_path):
    episode, _, _ = unguided
    with np.load(episode.save(tmp_path / "new.npz")) as data:
        arrays = {name: data[name] for name in data.files if not name.startswith("guide")}
    meta = json.loads(str(arrays["meta"]))
    for settings in meta["settings"].values():
        del settings["guided"]
    np.savez(tmp_path / "old.npz", **{**arrays, "meta": np.array(json.dumps(meta))})
    old = Episode.load(tmp_path / "old.npz")
    assert [s.guided for s in old.settings.values()] == [False]
    assert old.samples.dtype == episode.samples.dtype
    assert not old["guide"].any()
    np.testing.assert_array_equal(old.play(), episode["q"])
    # With a guide the recording would play another motion.
    settings = {number: s.with_(guided=True) for number, s in old.settings.items()}
    assert np.abs(Episode(old.samples, old.arm, old.dt, settings, old.before).play() - episode["q"]).max() > 0.1


# --- through singularities


def test_every_method_drives_five_arms_through_their_singularities_within_limits():
    rows = drill(seconds=2.0, rate=250.0)
    assert {(row.robot, row.method) for row in rows} == {(r, m) for r in ROBOTS for m in sk.methods.ALL}
    for row in rows:
        assert row.cycles > 100
        assert row.broken == 0, f"{row.robot} {row.method}: {row.episode.broken_limits()}"
    for robot in ROBOTS:
        assert min(row.smallest_ratio for row in rows if row.robot == robot) < 0.02


# --- devices


class FakePad:
    axes, buttons = [0.0, -1.0, 0.0, 0.05], [0, 0, 0, 0, 1]

    def __init__(self, _):
        pass

    def get_instance_id(self):
        return 3

    def get_name(self):
        return "fake"

    def get_numaxes(self):
        return len(self.axes)

    def get_numbuttons(self):
        return len(self.buttons)

    def get_axis(self, i):
        return self.axes[i]

    def get_button(self, i):
        return self.buttons[i]


def fake_pygame(monkeypatch, pads, events=()):
    nothing = types.SimpleNamespace(init=lambda: None, quit=lambda: None)
    module = types.ModuleType("pygame")
    module.display = nothing
    module.joystick = types.SimpleNamespace(
        init=lambda: None, quit=lambda: None, get_count=lambda: pads, Joystick=FakePad
    )
    module.event = types.SimpleNamespace(get=lambda: list(events))
    module.JOYDEVICEREMOVED = 1
    monkeypatch.setitem(sys.modules, "pygame", module)
    monkeypatch.setattr(devices, "need", lambda *_: None)


def test_a_gamepad(monkeypatch):
    fake_pygame(monkeypatch, 1)
    pad = devices.open_device("gamepad")
    reading = pad.read()
    assert pad.name == "gamepad fake"
    assert reading.held
    np.testing.assert_array_equal(
        reading.twist, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    )  # ahead; the dead zone swallows the rest


def test_a_gamepad_that_is_not_there_or_goes_away(monkeypatch):
    fake_pygame(monkeypatch, 0)
    with pytest.raises(devices.DeviceError, match="no gamepad"):
        devices.open_device("gamepad")
    fake_pygame(monkeypatch, 1, [types.SimpleNamespace(type=1, instance_id=3)])
    pad = devices.open_device("gamepad")
    with pytest.raises(devices.DeviceError, match="gone"):
        pad.read()


def test_a_spacemouse(monkeypatch):
    state = types.SimpleNamespace(x=0.0, y=1.0, z=0.5, roll=0.0, pitch=0.0, yaw=-2.0, buttons=[1, 0])
    mouse = types.SimpleNamespace(name="fake", read=lambda: state, close=lambda: None)
    module = types.ModuleType("pyspacemouse")
    module.open = lambda: mouse
    monkeypatch.setitem(sys.modules, "pyspacemouse", module)
    monkeypatch.setattr(devices, "need", lambda *_: None)
    reading = devices.open_device("spacemouse").read()
    assert reading.held
    np.testing.assert_allclose(reading.twist, [1.0, 0.0, 0.5, 0.0, 0.0, 1.0])

    def absent():
        raise RuntimeError("no device")

    module.open = absent
    with pytest.raises(devices.DeviceError, match="no device"):
        devices.open_device("spacemouse")


def test_unknown_devices_and_missing_packages():
    with pytest.raises(ValueError, match="gamepad, spacemouse"):
        devices.open_device("theremin")


# --- what is drawn


def test_gauges_say_what_a_sample_says(session):
    session.twist([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    until(lambda: latest(session)["command"] == sk.LoopCommand.TWIST)
    sample = session.latest
    text = gauges.status_text(sample, session.chain, "J-<PARSE>", session.statistics, session.rate)
    assert "0.100 m/s" in text
    assert "data-command='TWIST'" in text
    assert "J-&lt;PARSE&gt;" in text
    bars = gauges.singular_bars(np.array([2.0, 1.0, 0.1]), 0.1)
    assert bars.count("σ") == 4
    assert "= 0.200" in bars
    joints = gauges.joint_bars(sample["q"], sample["qdot"], session.chain, 0b100)
    assert joints.count("<span") == 2 * 7


@pytest.mark.parametrize(
    ("state", "joints", "words"),
    [
        (sk.GuideState.OFF, 0b1, "–"),
        (sk.GuideState.DIRECT, 0b1, "direct"),
        (sk.GuideState.SEARCHING, 0, "searching"),
        (sk.GuideState.POSTURE, 0, "posture"),
        (sk.GuideState.CHANGING_BRANCH, 0b1010, "changing branch: joints 2, 4"),
        (sk.GuideState.CHANGING_BRANCH, 0b1000, "changing branch: joint 4"),
        (sk.GuideState.CHANGING_BRANCH, 0, "changing branch"),
        (sk.GuideState.UNREACHABLE, 0b1, "unreachable"),
    ],
)
def test_the_page_says_what_the_guide_does(session, state, joints, words):
    sample = latest(session).copy()
    sample["guide"], sample["guide_joints"] = state, joints
    text = gauges.status_text(sample, session.chain, "J-PARSE", session.statistics, session.rate)
    assert f"data-guide='{state.name}'" in text
    assert f">{words}</span>" in text


def test_the_page_shows_a_status_that_it_has_no_words_for(session, monkeypatch):
    monkeypatch.setattr(gauges, "_WORDS", {})
    monkeypatch.setattr(gauges, "_COLOURS", {})
    sample = latest(session)
    text = gauges.status_text(sample, session.chain, "J-PARSE", session.statistics, session.rate)
    assert sk.Status(int(sample["status"])).name.lower() in text


def test_links_without_meshes_get_shapes():
    from sigmaik.teleop.drawing import drawable

    text = """<robot name="r">
      <link name="a"><visual><geometry><mesh filename="package://none/a.stl"/></geometry></visual></link>
      <link name="b"><visual><geometry><mesh filename="b.stl"/></geometry></visual>
        <collision><geometry><box size="1 1 1"/></geometry></collision></link>
      <link name="c"><visual><geometry><sphere radius="0.1"/></geometry></visual></link>
      <joint name="j" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.3 0 0.4"/></joint>
      <joint name="k" type="fixed"><parent link="b"/><child link="c"/></joint>
    </robot>"""
    drawn, missing = drawable(text, lambda name: name)
    assert missing == ["package://none/a.stl", "b.stl"]
    assert drawn.count("<cylinder") == 1
    assert 'length="0.5"' in drawn
    assert drawn.count("<box") == 2
    assert "mesh" not in drawn


def test_a_target_is_checked_once_and_then_passed_on(session, monkeypatch):
    from sigmaik.teleop.target import TargetPose

    target = TargetPose.of(moved(session, 0.01, 0.0, 0.0))
    sheared, scaled = np.eye(4), np.diag([2.0, 1.0, 1.0, 1.0])
    sheared[3, 0] = 1.0
    for wrong in (np.eye(3), np.full((4, 4), np.nan), sheared, scaled):
        with pytest.raises(ValueError, match="target"):
            TargetPose.of(wrong)
    monkeypatch.setattr(sk, "pose_error", None)  # a second check would fail
    session.follow(target)
    np.testing.assert_array_equal(session.goal, target.matrix)


def test_settings_parse_a_method_once():
    settings = Settings(method="dls:damping=0.05")
    assert settings.rule() is settings.rule()
    assert settings.with_(gamma=0.2).rule() is not settings.rule()
    assert settings.rule(500.0) is not settings.rule(1000.0)


def test_the_pages_target_is_checked():
    pytest.importorskip("viser")
    from sigmaik.teleop.target import TargetPose

    target = TargetPose.from_page((1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0))
    np.testing.assert_allclose(target.matrix[:3, 3], (1.0, 2.0, 3.0))
    np.testing.assert_allclose(target.moved_to((4.0, 5.0, 6.0)).matrix[:3, 3], (4.0, 5.0, 6.0))
    for position in ((0.0, 0.0), (0.0, np.inf, 0.0), (0.0, 0.0, 101.0)):
        with pytest.raises(ValueError, match="target"):
            target.moved_to(position)
    for position, wxyz in (((1.0, np.nan, 0.0), (1, 0, 0, 0)), ((0, 0, 0), (0, 0, 0, 0)), ((0, 0), (1, 0, 0, 0))):
        with pytest.raises(ValueError, match="page's target"):
            TargetPose.from_page(position, wxyz)


@pytest.mark.parametrize("method", [sk.PseudoInverse(), sk.DampedLeastSquares(), sk.JParse()], ids=repr)
def test_the_lines_drawn_are_the_rules_singular_directions(method):
    from sigmaik.teleop.scene import singular_lines, task_singular_values

    arm, q, length_scale = sk.robots.load("franka_panda"), np.array([0.0, 0.0, 0.0, -0.2, 0.0, 0.1, 0.0]), 0.4
    settings = Settings(mask=(True, True, True, False, True, True), frame="tool", length_scale=length_scale)
    servo = sk.Servo(arm, method, mask=settings.mask, frame=settings.frame, length_scale=length_scale)
    servo.reset(q)
    rotation = servo.pose[:3, :3]
    step = servo.update_twist([0.01, 0.0, 0.0, 0.0, 0.0, 0.0])
    sample = np.full((6, 6), np.nan)
    sample[:, : step.singular_directions.shape[1]] = step.singular_directions
    linear, angular = singular_lines(sample, length_scale)
    assert len(linear) + len(angular) >= step.singular.sum()
    for part in (*linear, *angular):
        assert 0.1 < np.linalg.norm(part) <= 1.0 + 1e-12
    if not step.singular.any():
        assert len(linear) == len(angular) == 0
    values = task_singular_values(arm.jacobian(q), rotation, settings, servo.length_scale)
    np.testing.assert_allclose(values, step.singular_values, rtol=1e-9, atol=1e-12)


def test_the_bars_are_red_where_the_rule_says_so():
    from sigmaik.teleop.gauges import singular_bars

    sigma = np.array([1.0, 0.5, 0.05])
    assert [singular_bars(sigma, 0.1, bits).count("#d6336c") for bits in (None, 0, 0b100, 0b110)] == [1, 0, 1, 2]
    assert singular_bars(sigma, None).count("#d6336c") == 0


# --- the command


def test_wrong_options(capsys, tmp_path):
    for arguments in (
        ["--robot", "nobody"],
        ["--port", "70000"],
        ["--rate", "0"],
        ["--method", "magic"],
        ["--gamma", "-1"],
        ["--for", "0"],
        ["--replay", str(tmp_path / "none.npz")],
    ):
        assert main(["teleop", *arguments]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_the_page_starts_and_ends(capsys, tmp_path):
    pytest.importorskip("viser")
    assert main(["teleop", "--robot", "puma560", "--port", "0", "--for", "0.5", "--out", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "http://127.0.0.1:" in out
    assert "drives puma560" in out
