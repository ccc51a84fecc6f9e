"""ActionChunks: from a policy's chunks to a servo."""

import numpy as np
import pytest

import sigmaik as sk


def line(times, speed=0.2):
    poses = np.tile(np.eye(4), (len(times), 1, 1))
    poses[:, 0, 3] = speed * np.asarray(times)
    return poses


def test_late_chunks_of_one_plan_are_followed_exactly():
    chunks = sk.ActionChunks(0.1)
    for k in range(300):
        now = 0.2 + 0.01 * k
        if k % 40 == 0:
            stamp = now - 0.2
            assert chunks.push(stamp, line(stamp + 0.1 * np.arange(16))) == sk.ChunkStatus.ACCEPTED
        pose, twist, status = chunks.at(now)
        np.testing.assert_allclose(pose[0, 3], 0.2 * now, atol=1e-12)
        np.testing.assert_allclose(twist, [0.2, 0, 0, 0, 0, 0], atol=1e-12)
        assert status == sk.ActionStatus.TRACKING
    assert chunks.counts.accepted == 8


def test_without_chunks_it_rests_at_the_last_action():
    chunks = sk.ActionChunks(0.1, stop_time=0.2)
    chunks.push(0.0, line(0.1 * np.arange(11)))
    seen = [chunks.at(0.01 * k).status for k in range(200)]
    assert sorted(set(seen)) == [sk.ActionStatus.TRACKING, sk.ActionStatus.LATE, sk.ActionStatus.STARVED]
    assert seen == sorted(seen)
    target = chunks.at(2.0)
    np.testing.assert_allclose(target.pose, line([1.0])[0], atol=1e-12)
    np.testing.assert_allclose(target.twist, 0.0, atol=1e-12)
    np.testing.assert_allclose(target.behind, 0.0, atol=1e-12)
    assert target.age == 2.0
    assert target.left == pytest.approx(-1.0)


def test_twists_start_where_the_target_is():
    chunks = sk.ActionChunks(0.05)
    assert chunks.push_twists(0.0, np.zeros((4, 6))) == sk.ChunkStatus.INVALID
    start = np.eye(4)
    start[:3, 3] = [0.1, 0.2, 0.3]
    chunks.reset(start)
    assert chunks.at(0.0).status == sk.ActionStatus.WAITING
    for k in range(1, 400):
        now = 0.01 * k
        if k % 20 == 1:
            assert chunks.push_twists(now - 0.1, np.tile([0, 0, 0.1, 0, 0, 0.5], (12, 1))) == sk.ChunkStatus.ACCEPTED
        target = chunks.at(now)
    np.testing.assert_allclose(target.twist, [0, 0, 0.1, 0, 0, 0.5], atol=1e-8)
    np.testing.assert_allclose(target.pose[:2, 3], [0.1, 0.2], atol=1e-9)


def test_what_is_wrong_is_refused():
    chunks = sk.ActionChunks(0.1, max_actions=8)
    for bad in (np.eye(4), np.zeros((2, 4, 4)), np.full((2, 4, 4), np.nan), "abc", np.zeros((2, 7))):
        with pytest.raises(sk.Error):
            chunks.push(0.0, bad)
    with pytest.raises(sk.Error, match=r"poses\[1\]"):
        chunks.push(0.0, [np.eye(4), 2 * np.eye(4)])
    for bad in (np.zeros(6), np.full((2, 6), np.inf), np.zeros((2, 5))):
        with pytest.raises(sk.Error):
            chunks.push_twists(0.0, bad)
    with pytest.raises(sk.Error, match="stamp"):
        chunks.push(np.nan, line([0.0]))
    assert chunks.push(0.0, line(np.zeros(9))) == sk.ChunkStatus.INVALID
    assert chunks.push(0.0, line(np.zeros(8))) == sk.ChunkStatus.ACCEPTED
    assert chunks.push(0.0, line([0.0])) == sk.ChunkStatus.OUT_OF_ORDER
    chunks.at(3.0)
    assert chunks.push(1.0, line([0.0])) == sk.ChunkStatus.EXPIRED
    for option, value in (("dt_action", 0.0), ("smoothing", -1.0), ("max_speed", np.nan), ("max_actions", 0)):
        with pytest.raises(sk.Error, match=option):
            sk.ActionChunks(**{option: value})


def test_a_servo_follows_noisy_chunks_inside_every_limit():
    arm = sk.robots.load("ufactory_xarm7")
    servo = sk.Servo(arm, dt=1e-2)
    servo.reset(sk.robots.home("ufactory_xarm7"))
    home = servo.pose
    rng = np.random.default_rng(1)

    def plan(t):
        pose = home.copy()
        pose[1, 3] += 0.1 * np.sin(t)
        pose[2, 3] += 0.1 * (1.0 - np.cos(t))
        return pose

    chunks = sk.ActionChunks(0.1, max_speed=0.5)
    chunks.reset(home)
    errors, queue = [], []
    velocity = arm.limits.velocity
    for k in range(1000):
        now = 0.01 * k
        if k % 30 == 0:
            actions = np.array([plan(now + 0.1 * i) for i in range(16)])
            actions[:, :3, 3] += rng.normal(0.0, 2e-3, 3) + rng.normal(0.0, 5e-4, (16, 3))
            queue.append((now + rng.uniform(0.05, 0.3), now, actions))
        while queue and queue[0][0] <= now:
            _, stamp, actions = queue.pop(0)
            chunks.push(stamp, actions)
        target = chunks.at(now)
        step = servo.update(target.pose, target.twist)
        assert (np.abs(step.qdot) <= velocity * (1 + 1e-9)).all()
        if now > 2.0:
            errors.append(np.linalg.norm(servo.pose[:3, 3] - plan(now + 0.01)[:3, 3]))
    assert np.mean(errors) < 5e-3
    assert chunks.counts.accepted > 30
