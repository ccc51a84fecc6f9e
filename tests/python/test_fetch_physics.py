"""The task in MuJoCo: contacts hold the cup, and pictures show the scene."""

import subprocess
import sys
import warnings

import numpy as np
import pytest

import sigmaik as sk

pytest.importorskip("gymnasium")
pytest.importorskip("mujoco")

from gymnasium.utils.env_checker import check_env  # noqa: E402

from sigmaik_lab.learn.demonstrator import STEADY, Demonstrator  # noqa: E402
from sigmaik_lab.learn.episode import layout  # noqa: E402
from sigmaik_lab.learn.fetch import Fetch  # noqa: E402
from sigmaik_lab.learn.scene import CUP, GRIPPER  # noqa: E402


def test_friction_holds_the_cup_all_the_way_and_a_seed_decides_all():
    ends = []
    for _ in range(2):
        env, parts = Fetch(physics="mujoco"), layout(7)
        state, _ = env.reset(seed=0)
        demonstrator, highest = Demonstrator(env.task, seed=0, hand=STEADY), 0.0
        for _ in range(200):
            state, _, terminated, truncated, info = env.step(demonstrator(state))
            if info["phase"] == "carry":
                highest = max(highest, float(state[parts.cup][2]))
                assert state[parts.gripper] == pytest.approx(2.0 * CUP.radius / GRIPPER.stroke, abs=0.03)
            if terminated or truncated:
                break
        assert info["success"]
        assert info["limits_broken"] == 0
        assert highest > env.task.goal[2] + 0.02
        ends.append(state)
    np.testing.assert_array_equal(*ends)


def test_a_cup_that_is_knocked_over_is_lost():
    env = Fetch(physics="mujoco")
    env.reset(seed=0, options={"cup": env.task.cup - [0.1, 0.0, 0.0]})
    over = env.task.hold(env.task.cup - [0.1, 0.0, -0.03])
    for k in range(60):
        across = over.copy()
        across[:3, 3] += (0.12 - 0.01 * k) * over[:3, 1]
        action = np.concatenate([across[:3, 3], across[:3, :2].T.ravel(), [0.0]]).astype(np.float32)
        _, reward, terminated, _, info = env.step(action)
        if terminated:
            break
    assert info["lost"]
    assert reward == 0.0


def test_physics_satisfies_gymnasiums_checker():
    check_env(Fetch(physics="mujoco"), skip_render_check=True)


def test_an_arm_without_inertias_has_no_physics():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sk.ModelWarning)
        with pytest.raises(sk.Error, match="inertia"):
            Fetch("kuka_kr6_r900", physics="mujoco")


IMAGES = """
import sys
import numpy as np
from gymnasium.utils.env_checker import check_env
from sigmaik_lab.learn.fetch import Fetch

env = Fetch(image=True, render_mode="rgb_array")
try:
    env.reset(seed=0)
except OSError as error:
    sys.exit(str(error))
centres = []
for y in (-0.045, 0.045):
    seen, _ = env.reset(seed=0, options={"cup": env.task.cup + [0.0, y, 0.0]})
    assert seen["image"].shape == (96, 96, 3) and seen["image"].dtype == np.uint8
    red, green, blue = np.moveaxis(seen["image"].astype(int), 2, 0)
    rows, columns = np.nonzero((red > 90) & (green < 60) & (blue < 60))
    centres.append((len(rows), rows.mean(), columns.mean()))
assert env.render().shape == (480, 480, 3)
check_env(Fetch(image=True), skip_render_check=True)
print(*centres[0], *centres[1])
"""


def test_images_show_the_cup_where_the_cup_is():
    # In a process of its own: MuJoCo decides on OpenGL once, when it is imported.
    run = subprocess.run([sys.executable, "-W", "ignore", "-c", IMAGES], capture_output=True, text=True)
    if "finds no OpenGL" in run.stderr:
        pytest.skip(run.stderr)
    assert run.returncode == 0, run.stderr
    pixels, row, column, same, other_row, other_column = map(float, run.stdout.split())
    assert pixels > 8
    assert same > 8
    assert np.hypot(row - other_row, column - other_column) > 3.0
