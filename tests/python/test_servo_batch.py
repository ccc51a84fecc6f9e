"""ServoBatch: single servos to the last bit, in arrays of its own, and without the GIL."""

import threading
import time

import numpy as np
import pytest

import sigmaik as sk

ARM = sk.robots.load("ufactory_xarm7")
HOME = np.asarray(sk.robots.home("ufactory_xarm7"))


def starts(seed, count):
    return HOME + np.random.default_rng(seed).uniform(-0.3, 0.3, (count, 7))


def targets(q):
    poses = np.array([ARM.pose(row) for row in q])
    poses[:, :3, 3] += np.random.default_rng(len(q)).uniform(-0.2, 0.2, (len(q), 3))
    return poses


@pytest.mark.parametrize("threads", [1, 2])
def test_bit_for_bit_single_servos(threads):
    options = {"gain_linear": 5.0, "posture_gain": 1.0, "on_limit": "scale", "mask": [1, 1, 1, 0, 0, 1]}
    batch = sk.ServoBatch(ARM, sk.JParse(gamma=0.2), 1e-2, 5, threads=threads, **options)
    servos = [sk.Servo(ARM, sk.JParse(gamma=0.2), 1e-2, **options) for _ in range(5)]
    q = starts(1, 5)
    batch.reset(q)
    for servo, row in zip(servos, q, strict=True):
        servo.reset(row)
    poses, twists = targets(q), np.random.default_rng(2).normal(size=(5, 6))
    for cycle in range(40):
        if cycle % 3:
            steps = [servo.update(pose, 0.1 * twist) for servo, pose, twist in zip(servos, poses, twists, strict=True)]
            batch.update(poses, 0.1 * twists)
        else:
            steps = [servo.update_twist(twist, frame="tool") for servo, twist in zip(servos, twists, strict=True)]
            batch.update_twist(twists, frame="tool")
        for name in ("q", "qdot", "status", "pose_error", "achieved_twist"):
            np.testing.assert_array_equal(getattr(batch, name), [getattr(step, name) for step in steps])
        np.testing.assert_array_equal(batch.pose, [servo.pose for servo in servos])


def test_a_copy_of_a_servo_goes_on_as_the_batch_does():
    batch = sk.ServoBatch(ARM, None, 1e-2, 3)
    q = starts(3, 3)
    batch.reset(q)
    poses = targets(q)
    for _ in range(10):
        batch.update(poses)
    servo = batch.servo(1)
    for _ in range(10):
        np.testing.assert_array_equal(servo.update(poses[1]).q, batch.update(poses).q[1])
    with pytest.raises(IndexError):
        batch.servo(3)


def test_every_option_of_a_servo_is_one_of_the_batch():
    options = sk.Servo(ARM).options
    batch = sk.ServoBatch(ARM, **options, size=2)
    assert set(batch.options) == set(options) | {"size", "threads"}
    with pytest.raises(sk.Error, match="gain_linear"):
        sk.ServoBatch(ARM, None, 1e-3, 2, gain_linear=-1.0)
    with pytest.raises(TypeError):
        sk.ServoBatch(ARM, None, 1e-3, 2, no_such_option=1)
    for size in (0, -1):
        with pytest.raises((sk.Error, TypeError)):
            sk.ServoBatch(ARM, None, 1e-3, size)


def test_the_arrays_are_the_same_memory_in_every_cycle_and_outlive_the_batch():
    batch = sk.ServoBatch(ARM, None, 1e-2, 4)
    batch.reset(HOME)
    q, qdot = batch.q, batch.qdot
    assert q.shape == (4, 7)
    assert q.flags.c_contiguous
    assert batch.status.dtype == np.int8
    poses = targets(np.tile(HOME, (4, 1)))
    before = q.copy()
    assert batch.update(poses) is batch
    assert q.ctypes.data == batch.q.ctypes.data
    assert not np.array_equal(q, before)
    q[:] = 7.0  # moves no servo
    batch.update(poses)
    assert np.abs(q - before).max() < 0.2
    last = qdot.copy()
    del batch
    np.testing.assert_array_equal(qdot, last)


def test_dlpack_shares_the_memory():
    batch = sk.ServoBatch(ARM, None, 1e-2, 4)
    batch.reset(HOME)
    shared = np.from_dlpack(batch.q)
    batch.update(targets(np.tile(HOME, (4, 1))))
    np.testing.assert_array_equal(shared, batch.q)
    assert np.shares_memory(shared, batch.q)


def test_inputs_of_any_layout_and_type():
    q = starts(4, 6)
    poses = targets(q).astype(np.float32)
    answers = []
    for given in (
        poses.astype(float),
        poses,
        poses.tolist(),
        np.asfortranarray(poses),
        np.repeat(poses, 2, axis=0)[::2],
    ):
        batch = sk.ServoBatch(ARM, None, 1e-2, 6)
        batch.reset(q)
        answers.append(batch.update(given).q.copy())
    for answer in answers:
        np.testing.assert_array_equal(answer, answers[0])


def test_bad_rows_stop_their_own_servo():
    batch, clean = (sk.ServoBatch(ARM, None, 1e-2, 5) for _ in range(2))
    q = starts(5, 5)
    poses = targets(q)
    for b in (batch, clean):
        b.reset(q)
        for _ in range(20):
            b.update(poses)
    broken = poses.copy()
    broken[1, 0, 0] = np.nan
    broken[3] = 0.0
    for _ in range(100):
        batch.update(broken)
        clean.update(poses)
    assert list(batch.status == sk.Status.BAD_INPUT) == [False, True, False, True, False]
    np.testing.assert_array_equal(batch.qdot[[1, 3]], 0.0)
    np.testing.assert_array_equal(batch.q[[0, 2, 4]], clean.q[[0, 2, 4]])


def test_reset_by_mask():
    batch = sk.ServoBatch(ARM, None, 1e-2, 3)
    with pytest.raises(sk.Error, match="start"):
        batch.update(np.tile(np.eye(4), (3, 1, 1)))
    q = starts(6, 3)
    q[1] = np.nan
    batch.reset(q, mask=[True, False, True])
    assert np.isnan(batch.q[1]).all()
    batch.update(targets(starts(6, 3)))
    assert batch.status[1] == sk.Status.BAD_INPUT
    moved = batch.q.copy()
    batch.reset(HOME, mask=np.array([False, True, False]))
    np.testing.assert_array_equal(batch.q, [moved[0], HOME, moved[2]])
    with pytest.raises(sk.Error, match="row 1"):
        batch.reset(q)
    np.testing.assert_array_equal(batch.q, [moved[0], HOME, moved[2]])
    batch.reset(HOME, qdot=np.full(7, 0.1))
    np.testing.assert_array_equal(batch.qdot, 0.1)
    for mask in ([True], [1, 0, 1], np.ones((3, 1), bool), "abc"):
        with pytest.raises(sk.Error, match="mask"):
            batch.reset(HOME, mask)


@pytest.mark.parametrize(
    ("poses", "twists", "q"),
    [((4, 4), (6,), (6,)), ((2, 4, 4), (2, 6), (2, 7)), ((3, 3, 4), (3, 5), (3, 6)), ((3, 16), (3, 6, 1), (3, 7, 1))],
)
def test_shapes_that_do_not_fit_are_refused(poses, twists, q):
    batch = sk.ServoBatch(ARM, None, 1e-2, 3)
    batch.reset(HOME)
    for call in (
        lambda: batch.update(np.zeros(poses)),
        lambda: batch.update_twist(np.zeros(twists)),
        lambda: batch.update(np.tile(np.eye(4), (3, 1, 1)), np.zeros(twists)),
        lambda: batch.reset(np.zeros(q)),
    ):
        with pytest.raises(sk.Error, match="shape"):
            call()


def test_other_threads_run_meanwhile_and_callers_wait_for_each_other():
    batch = sk.ServoBatch(ARM, None, 1e-2, 2000)
    batch.reset(HOME)
    twists = np.random.default_rng(7).normal(size=(2000, 6))
    done = threading.Event()

    def work():
        for _ in range(20):
            batch.update_twist(twists)
        done.set()

    workers = [threading.Thread(target=work) for _ in range(2)]
    for worker in workers:
        worker.start()
    ticks = 0
    while not done.is_set():
        time.sleep(1e-4)
        ticks += 1
    for worker in workers:
        worker.join()
    assert ticks > 5  # with the GIL held there would be one or two a cycle at most
    other = sk.ServoBatch(ARM, None, 1e-2, 2000)
    other.reset(HOME)
    for _ in range(40):
        other.update_twist(twists)
    np.testing.assert_array_equal(batch.q, other.q)
