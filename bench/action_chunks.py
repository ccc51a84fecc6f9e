"""Chunks of a policy through ActionChunks, beside what else is done with them: action_chunks.py [SEEDS].

A policy of the usual kind (ACT, diffusion policy): it looks at the scene, thinks for 50 to 300 ms, and sends 16 poses
at 10 Hz, for the time of the look and after it; every chunk is wrong by a noise of its own, 2 mm and 5 mrad, and each
action by another 0.5 mm; one chunk in ten does not come. The plan is a figure of eight with changing orientation. An
xArm7 follows at 1 kHz by a Servo of default options, or, for PlaCo, by the one-step inverse kinematics that LeRobot's
RobotKinematics makes of each action. Prints a Markdown table.

error: tip from plan, mean [mm]. delay: of the largest correlation of tip and plan [ms]. jerk: rms of the tip
[m/s³] and of the joints [rad/s³]. limits: cycles in which a joint's speed, or its acceleration, is beyond its limit.
"""

import sys
from pathlib import Path

import numpy as np

import sigmaik as sk

NAME, DT, RATE, LENGTH, SECONDS = "ufactory_xarm7", 1e-3, 10.0, 16, 20.0
HOME = np.asarray(sk.robots.home(NAME))


def plan(start, t):
    pose = start.copy()
    pose[:3, 3] += [0.05 * np.sin(2 * t), 0.12 * np.sin(t), 0.06 * np.sin(2 * t)]
    pose[:3, :3] = sk.rotation_exp([0.2 * np.sin(t), 0.0, 0.3 * np.sin(0.7 * t)]) @ pose[:3, :3]
    return pose


def chunks_of(start, seed):
    """(arrival, stamp, poses) of each chunk that comes."""
    rng = np.random.default_rng(seed)
    out, now = [], 0.0
    while now < SECONDS:
        latency = rng.uniform(0.05, 0.3)
        actions = np.array([plan(start, now + i / RATE) for i in range(LENGTH)])
        actions[:, :3, 3] += rng.normal(0.0, 2e-3, 3) + rng.normal(0.0, 5e-4, (LENGTH, 3))
        turn = sk.rotation_exp(rng.normal(0.0, 5e-3, 3))
        actions[:, :3, :3] = turn @ actions[:, :3, :3]
        if not out or rng.uniform() > 0.1:
            out.append((now + latency, now, actions))
        now += max(latency, 0.4)
    return out


class Newest:
    """The newest chunk, and its action at a time."""

    def __init__(self, start):
        self.stamp, self.actions = 0.0, start[None]

    def push(self, stamp, actions):
        self.stamp, self.actions = stamp, actions

    def clock(self, now):
        return np.clip((now - self.stamp) * RATE, 0.0, len(self.actions) - 1.0)


class Hold(Newest):
    """The nearest action is held."""

    def at(self, now):
        return self.actions[round(float(self.clock(now)))], np.zeros(6)


class Linear(Newest):
    """Linear between two actions of the newest chunk."""

    def at(self, now):
        i = min(int(self.clock(now)), len(self.actions) - 2)
        if len(self.actions) < 2:
            return self.actions[0], np.zeros(6)
        a, b, u = self.actions[i], self.actions[i + 1], self.clock(now) - i
        way = sk.pose_error(a, b)
        pose = a.copy()
        pose[:3, 3] += u * way[:3]
        pose[:3, :3] = sk.rotation_exp(u * way[3:]) @ a[:3, :3]
        return pose, way * RATE


class FromArrival(Newest):
    """The first action of a chunk when the chunk comes, one after the other: time stamps are not looked at."""

    def __init__(self, start):
        super().__init__(start)
        self.came = None

    def push(self, stamp, actions):
        super().push(stamp, actions)
        self.came = None

    def at(self, now):
        self.came = now if self.came is None else self.came
        return self.actions[min(int((now - self.came) * RATE), len(self.actions) - 1)], np.zeros(6)


class Ours:
    """ActionChunks of default options."""

    def __init__(self, start):
        self.chunks = sk.ActionChunks(1.0 / RATE)
        self.chunks.reset(start)

    def push(self, stamp, actions):
        self.chunks.push(stamp, actions)

    def at(self, now):
        target = self.chunks.at(now)
        return target.pose, target.twist


class ByServo:
    def __init__(self, arm):
        self.servo = sk.Servo(arm, dt=DT)
        self.servo.reset(HOME)

    def step(self, pose, twist):
        return self.servo.update(pose, twist).q


class ByPlaco:
    """One step of PlaCo's frame task for each action, as LeRobot's RobotKinematics makes it; held in between."""

    def __init__(self, arm):
        import placo

        self.robot = placo.RobotWrapper(
            str(Path(sk.robots.__file__).parent / f"{NAME}.urdf"), placo.Flags.ignore_collisions
        )
        self.solver = placo.KinematicsSolver(self.robot)
        self.solver.mask_fbase(True)
        self.names = list(arm.joint_names)
        for name, q in zip(self.names, HOME, strict=True):
            self.robot.set_joint(name, q)
        self.robot.update_kinematics()
        self.task = self.solver.add_frame_task(arm.tip, np.eye(4))
        self.task.configure(arm.tip, "soft", 1.0, 0.01)
        self.last = None

    def step(self, pose, twist):
        if self.last is None or not np.array_equal(pose, self.last):
            self.last = pose.copy()
            self.task.T_world_frame = pose
            self.solver.solve(True)
            self.robot.update_kinematics()
        return np.array([self.robot.get_joint(name) for name in self.names])


def run(arm, source, follower, seed):
    start = arm.pose(HOME)
    target, driver = source(start), follower(arm)
    queue = chunks_of(start, seed)
    q = [HOME]
    for cycle in range(int(SECONDS / DT)):
        now = DT * cycle
        while queue and queue[0][0] <= now:
            target.push(*queue.pop(0)[1:])
        q.append(driver.step(*target.at(now)))
    return np.array(q)


def judge(arm, q):
    start = arm.pose(HOME)
    tip = arm.pose(q)[:, :3, 3]
    times = DT * np.arange(len(q))
    wanted = np.array([plan(start, t)[:3, 3] for t in times])
    late = int(2.0 / DT)
    error = np.linalg.norm(tip[late:] - wanted[late:], axis=1)
    lags = np.arange(0, 600, 5)
    fit = [np.linalg.norm(tip[late:] - wanted[late - k : len(wanted) - k], axis=1).mean() for k in lags]
    speed = np.diff(q, axis=0) / DT
    acceleration = np.diff(speed, axis=0) / DT
    most = np.where(np.isfinite(arm.limits.acceleration), arm.limits.acceleration, 10.0)
    return [
        1e3 * error.mean(),
        float(lags[int(np.argmin(fit))]),
        np.sqrt(np.mean(np.sum((np.diff(tip, 3, axis=0) / DT**3)[late:] ** 2, axis=1))),
        np.sqrt(np.mean((np.diff(acceleration, axis=0) / DT)[late:] ** 2)),
        float((np.abs(speed) > arm.limits.velocity * (1 + 1e-9)).any(axis=1).sum()),
        float((np.abs(acceleration) > most * (1 + 1e-6)).any(axis=1).sum()),
    ]


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    arm = sk.robots.load(NAME)
    ways = [
        ("ActionChunks, servo", Ours, ByServo),
        ("linear, servo", Linear, ByServo),
        ("nearest action held, servo", Hold, ByServo),
        ("played from arrival, servo", FromArrival, ByServo),
        ("linear, PlaCo each cycle", Linear, ByPlaco),
        ("nearest action held, PlaCo one step", Hold, ByPlaco),
    ]
    print("| | error mm | delay ms | tip jerk | joint jerk | over speed | over acceleration |")
    print("|---|---|---|---|---|---|---|")
    for name, source, follower in ways:
        try:
            rows = [judge(arm, run(arm, source, follower, seed)) for seed in range(seeds)]
        except ImportError as error:
            print(f"| {name} | {error}: pip install placo | | | | | |")
            continue
        print(f"| {name} | " + " | ".join(f"{value:.3g}" for value in np.median(rows, axis=0)) + " |")


if __name__ == "__main__":
    main()
