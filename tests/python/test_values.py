"""Objects as values: ==, hash, copies and pickles, also in other processes; pickles that are no pickles of ours."""

import concurrent.futures
import copy
import enum
import multiprocessing
import pickle
import re
from pathlib import Path

import numpy as np
import pytest

import sigmaik as sk

ARM = "ufactory_xarm7"


def started(chain, **options):
    servo = sk.Servo(chain, sk.JParse(0.2), **options)
    servo.reset(sk.robots.home(ARM))
    for _ in range(30):
        servo.update_twist([0.1, 0.0, -0.1, 0.0, 0.2, 0.0])
    return servo


def constrained(chain):
    ik = sk.ConstrainedIk(chain, gamma=1.0)
    ik.reset(sk.robots.home(ARM))
    target = ik.pose.copy()
    target[0, 3] += 0.1
    for _ in range(10):
        ik.update(target)
    return ik


def stream():
    out = sk.TargetStream("interpolate", latency=0.05)
    pose = np.eye(4)
    for k in range(20):
        pose[0, 3] = 0.01 * k
        out.push(0.02 * k, pose)
        out.at(0.02 * k)
    return out


def solver(chain):
    out = sk.VelocitySolver(sk.DampedLeastSquares(0.05), 0.5)
    out.solve(chain.jacobian(sk.robots.home(ARM)), np.ones(6))
    return out


def values():
    """Immutable: one object of each class, by name."""
    chain, home = sk.robots.load(ARM), sk.robots.home(ARM)
    puma = sk.robots.load("puma560")
    pose = chain.pose(home)
    torque = sk.ComputedTorque(chain)
    position = sk.PositionIk(chain, (1e-5, 1e-4), cone=((0, 0, 1), 0.2), ranges=[0.1] * 3 + [0.0] * 3)
    all_of_them = [
        chain,
        chain.limits,
        chain.segments[2],
        sk.Inertia(1.5, (0.0, 0.1, 0.0), np.diag([1.0, 1.0, 1.5])),
        started(chain).update_twist(np.ones(6)),
        constrained(chain).update(pose),
        stream().at(0.5),
        stream().counts,
        solver(chain).solve(chain.jacobian(home), np.ones(6)),
        sk.least_squares(np.eye(2), [1.0, 2.0]),
        sk.AnalyticIk(puma),
        sk.AnalyticIk(puma).branches(puma.pose(sk.robots.home("puma560")))[0],
        position,
        position.solve(pose),
        sk.PositionIk(chain).branches(pose)[0],
        sk.Dynamics(chain, (0.0, 0.0, -1.6), sk.Inertia(0.5)),
        torque,
        torque.update(home, 0 * home, home, 0 * home, 0 * home),
        sk.ServoLoop(started(chain)).statistics,
        sk.singularities.load("franka_panda"),
        *map(sk.methods.parse, sk.methods.ALL),
    ]
    return {type(one).__name__: one for one in all_of_them}


def objects():
    """Mutable: one object of each class, by name."""
    chain = sk.robots.load(ARM)
    spectrum = sk.Spectrum()
    spectrum.decompose(chain.jacobian(sk.robots.home(ARM)))
    plan = sk.planning.time_optimal(chain, sk.robots.home(ARM), sk.robots.home(ARM) + 0.2)
    return {
        type(one).__name__: one
        for one in (started(chain), constrained(chain), stream(), solver(chain), spectrum, plan, plan.clearance)
    }


VALUES, OBJECTS = values(), objects()
ALL = {**VALUES, **OBJECTS}
COPIES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    **{f"pickle {p}": lambda one, p=p: pickle.loads(pickle.dumps(one, p)) for p in (2, 4, pickle.HIGHEST_PROTOCOL)},
}


@pytest.mark.parametrize("how", COPIES)
@pytest.mark.parametrize("name", ALL)
def test_a_copy_is_equal(name, how):
    one = ALL[name]
    other = COPIES[how](one)
    assert type(other) is type(one)
    assert other == one
    assert not other != one  # noqa: SIM202
    assert repr(other) == repr(one)
    assert one != repr(one)
    assert one != None  # noqa: E711
    if name in VALUES:
        assert hash(other) == hash(one)
        assert len({one, other}) == 1
    else:
        with pytest.raises(TypeError, match="unhashable"):
            hash(one)


def test_nothing_is_equal_to_an_object_of_another_class():
    for name, one in ALL.items():
        assert [other for other in ALL if ALL[other] == one] == [name]


def test_what_differs_is_not_equal():
    chain = sk.robots.load(ARM)
    assert chain == sk.robots.load(ARM)
    limited = chain.with_limits(velocity=chain.limits.velocity * 0.999)
    assert chain != limited
    assert chain.limits != limited.limits
    assert chain.limits == sk.robots.load(ARM).limits
    assert sk.Servo(chain) == sk.Servo(sk.robots.load(ARM))
    for options in ({"gain_linear": 9.0}, {"guided": True}, {"exact": (1, 1, 1, 0, 0, 0)}, {"posture": [0.1] * 7}):
        assert sk.Servo(chain) != sk.Servo(chain, **options)
        assert sk.Servo(chain, **options) == sk.Servo(chain, **options)
    assert sk.Servo(chain) != sk.Servo(chain, "dls")
    assert sk.Servo(chain) != sk.Servo(limited)
    one, other = started(chain), started(chain)
    assert one == other
    assert one.hold() == other.hold()
    one.hold()
    assert one != other
    other.hold()
    assert one == other
    assert sk.Dynamics(chain) != sk.Dynamics(chain, (0, 0, -1.6))
    assert sk.Dynamics(chain) != sk.Dynamics(chain, payload=sk.Inertia(1.0))
    assert sk.PositionIk(chain) != sk.PositionIk(chain, cone=((0, 0, 1), 0.1))
    assert sk.TargetStream() != sk.TargetStream("hold")


def goes_on(servo, target):
    """The next steps of a servo."""
    return [servo.update(target) for _ in range(300)]


SERVOS = {
    "default": {},
    "guided": {"guided": True},
    "exact": {"exact": (1, 1, 1, 0, 0, 0)},
    "scale": {"on_limit": "scale"},
    "posture": {"posture_gain": 2.0, "avoid": "manipulability"},
}


@pytest.mark.parametrize("options", SERVOS.values(), ids=SERVOS)
@pytest.mark.parametrize("jerk", [np.inf, 2000.0])
def test_a_servo_in_another_process_goes_on_bit_by_bit(options, jerk, pool):
    chain = sk.robots.load(ARM).with_limits(jerk=jerk)
    servo = started(chain, **options)
    servo.measure(servo.q + 0.01)
    rng = np.random.default_rng(1)
    target = chain.pose(chain.random_configuration(rng))
    for _ in range(150):
        servo.update(target)
    there = pool.submit(goes_on, copy.copy(servo), target)  # a thread pickles it later
    here = goes_on(servo, target)
    for one, other in zip(here, there.result(60.0), strict=True):
        np.testing.assert_array_equal(one.q, other.q)
        assert one == other
    assert np.abs(here[-1].q - here[0].q).max() > 1e-3


@pytest.fixture(scope="module")
def pool():
    with concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as executor:
        yield executor


def echo(objects):
    return {name: (repr(one), one) for name, one in objects.items()}


def test_a_worker_process_takes_all_of_them(pool):
    for name, (text, other) in pool.submit(echo, ALL).result(60.0).items():
        assert text == repr(ALL[name])
        assert other == ALL[name]


class Named(sk.Servo):
    """A user's own."""


def test_a_class_that_derives_from_ours_stays_itself():
    servo = Named(sk.robots.load(ARM))
    servo.reset(sk.robots.home(ARM))
    for other in (copy.copy(servo), copy.deepcopy(servo), pickle.loads(pickle.dumps(servo))):
        assert type(other) is Named
        assert other == servo


def test_chains_of_a_copy_share_nothing_that_changes():
    servo = started(sk.robots.load(ARM))
    other = copy.copy(servo)
    servo.hold()
    assert other != servo
    other.hold()
    assert other == servo


# --- what is no value: docs/copies.md


def no_values():
    chain, home = sk.robots.load(ARM), sk.robots.home(ARM)
    chunks = sk.ActionChunks(0.1)
    chunks.reset(chain.pose(home))
    capsule = sk.Capsule((0, 0, 0), (0, 0, 0.1), 0.1)
    loop = sk.ServoLoop(started(chain))
    all_of_them = [
        chunks,
        chunks.at(0.0),
        chunks.counts,
        sk.ServoBatch(chain, None, 1e-2, 2),
        sk.Obstacle.sphere((1, 1, 1), 0.1),
        capsule,
        sk.LinkCapsule("link3", capsule),
        loop,
        loop.take("somebody"),
        sk.Collisions(chain),
    ]
    return {type(one).__name__: one for one in all_of_them}


def test_the_page_of_copies_names_every_class():
    page = (Path(__file__).resolve().parents[2] / "docs" / "copies.md").read_text(encoding="utf-8")
    head, none, rest = re.split(r"^## What is no value$|^## What a servo remembers$", page, flags=re.MULTILINE)
    classes = {
        name
        for name in sk.__all__
        if isinstance(one := getattr(sk, name), type) and not issubclass(one, (enum.Enum, Exception))
    }
    rules = {type(sk.methods.parse(name)).__name__ for name in sk.methods.ALL}
    values = set(ALL) | {"LoopFault", "Crossing"}
    assert classes <= values | set(no_values()) | {"Method"}
    for name in values - rules:
        assert f"`{name}`" in head
    for name in no_values():
        assert f"`{name}`" in none


def test_what_is_no_value_is_not_copied():
    for name, one in no_values().items():
        ways = [pickle.dumps] if name == "Collisions" else [pickle.dumps, copy.copy, copy.deepcopy]
        for way in ways:
            with pytest.raises(TypeError, match="cannot pickle"):
                way(one)
        assert one == one  # noqa: PLR0124
        assert isinstance(hash(one), int)
    batch = sk.ServoBatch(sk.robots.load(ARM), None, 1e-2, 2)
    batch.reset(sk.robots.home(ARM))
    assert pickle.loads(pickle.dumps(batch.servo(1))) == batch.servo(1)


@pytest.mark.parametrize("how", [copy.copy, copy.deepcopy])
def test_a_copy_of_collisions_shares_the_obstacles_and_is_not_equal(how):
    chain, home = sk.robots.load(ARM), sk.robots.home(ARM)
    collisions = sk.Collisions(chain, [sk.Obstacle.sphere((3, 3, 3), 0.1)], self_collision=False)
    other = how(collisions)
    assert other != collisions
    before = other.distance(home)
    collisions.move(0, (0.9, 0.0, 0.3))
    assert other.distance(home) == collisions.distance(home) < before
    again = sk.Collisions(chain, [sk.Obstacle.sphere((3, 3, 3), 0.1)], self_collision=False)
    assert sk.Servo(chain, collisions=collisions) == sk.Servo(chain, collisions=other)
    assert sk.Servo(chain, collisions=collisions) != sk.Servo(chain, collisions=again)
    with pytest.raises(TypeError, match="cannot pickle"):
        pickle.dumps(sk.Servo(chain, collisions=collisions))


# --- pickles that are none of ours


@pytest.mark.parametrize("name", [name for name in ALL if hasattr(ALL[name], "__setstate__")])
def test_a_malformed_state_is_refused(name):
    one = ALL[name]
    if name in ("Trajectory", "Clearance"):
        pytest.skip("their pickles are the constructors' arguments")
    state = one.__getstate__()
    assert state[0] == 1
    wrong = [
        (),
        (1,),
        ("1", *state[1:]),
        (2, *state[1:]),
        (*state, 0),
        state[:-1],
        (1, *(None for _ in state[1:])),
        (1, *(b"" for _ in state[1:])),
        (1, *(b"x" * 100 for _ in state[1:])),
        (1, *({"dt": "soon"} for _ in state[1:])),
    ]
    if isinstance(state[-1], bytes):
        wrong += [(*state[:-1], state[-1][:-1]), (*state[:-1], state[-1] + b"x"), (*state[:-1], b"z" + state[-1][1:])]
    for bad in wrong:
        new = type(one).__new__(type(one))
        with pytest.raises((sk.Error, TypeError)):
            new.__setstate__(bad)
    with pytest.raises(sk.Error, match=f"a {name} has version 2; this sigmaik reads version 1"):
        type(one).__new__(type(one)).__setstate__((2, *state[1:]))


def test_bytes_of_random_changes_are_refused():
    rng = np.random.default_rng(2)
    servo = started(sk.robots.load(ARM), guided=True)
    data, state = pickle.dumps(servo), servo.__getstate__()[-1]
    at = data.index(state)
    for _ in range(300):
        bad = bytearray(data)
        bad[at + rng.integers(len(state))] ^= 1 << rng.integers(8)
        with pytest.raises(sk.Error, match="the bytes of a value are refused"):
            pickle.loads(bytes(bad))


def test_options_of_a_later_version_are_refused():
    state = started(sk.robots.load(ARM)).__getstate__()
    with pytest.raises(sk.Error, match="options that this version of sigmaik does not know"):
        sk.Servo.__new__(sk.Servo).__setstate__((*state[:3], {**state[3], "teleport": True}, state[4]))


# --- bad input in the middle of a loop


NO_POSES = {
    "scaled": lambda t: t @ np.diag([1.01, 1.01, 1.01, 1.0]),
    "sheared": lambda t: t + 1e-2 * np.eye(4, k=1) * [1, 1, 1, 0],
    "mirrored": lambda t: t @ np.diag([1.0, 1.0, -1.0, 1.0]),
    "another last row": lambda t: t + np.outer([0, 0, 0, 1], [0, 0, 0.1, 0]),
    "quaternion off by 1e-3": lambda t: t @ np.diag([1.002, 1.002, 1.002, 1.0]),
}


@pytest.mark.parametrize("kind", NO_POSES)
@pytest.mark.parametrize("make", [sk.Servo, sk.ConstrainedIk])
def test_a_target_that_is_no_pose_stops_the_arm_without_an_exception(kind, make):
    chain, home = sk.robots.load(ARM), sk.robots.home(ARM)
    loose, strict = make(chain), make(chain, strict=True)
    assert strict.options["strict"] is True
    assert loose.options["strict"] is False
    target = chain.pose(home)
    target[:3, 3] += [0.05, 0.2, 0.1]
    for one in (loose, strict):
        one.reset(home)
        for _ in range(200):
            step = one.update(target)
    assert np.abs(step.qdot).max() > 0.05
    wrong = NO_POSES[kind](target)
    with pytest.raises(sk.Error, match="target is not a pose"):
        strict.update(wrong)
    np.testing.assert_array_equal(strict.q, loose.q)  # an exception is no cycle
    last = step.qdot
    for _ in range(1000):
        step = loose.update(wrong)
        assert step.status == sk.Status.BAD_INPUT
        assert np.all(np.abs(step.qdot - last) <= 1e-3 * chain.limits.acceleration * (1 + 1e-9))
        last = step.qdot
    assert not last.any()
    assert loose.update(target).status != sk.Status.BAD_INPUT  # and goes on with a pose
    for one in (loose, strict):
        for program_error in (np.eye(3), np.full((4, 4), np.nan), "pose", None):
            with pytest.raises(sk.Error, match="target"):
                one.update(program_error)
