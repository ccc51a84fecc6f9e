"""The task of fetching a cup at the end of reach: one arm, many arms, contacts, pictures and the demonstrator."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest

import sigmaik as sk

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import sigmaik_lab.envs  # noqa: E402, F401
from sigmaik_lab.learn import motion  # noqa: E402
from sigmaik_lab.learn.demonstrator import STEADY, Demonstrator, Hand  # noqa: E402
from sigmaik_lab.learn.drives import make_drive, sigma_ratio  # noqa: E402
from sigmaik_lab.learn.episode import action_names, layout, rotation_of_6d, state_names  # noqa: E402
from sigmaik_lab.learn.fetch import Fetch  # noqa: E402
from sigmaik_lab.learn.scene import CUP, GRIPPER, task  # noqa: E402
from sigmaik_lab.learn.vector import FetchVector  # noqa: E402
from sigmaik_lab.learn.world import AT_GOAL, World  # noqa: E402

#: Not the SO-101, whose five joints cannot hold a cup in each direction, nor the UR3e, which reaches past the edge with
#: its wrist turned over.
ARMS = [name for name in sk.robots.names() if name not in ("so101", "ur3e")]
FAST = 1e-2  # [s] a cycle, where the cycle does not matter


def drive(env, demonstrators, steps=300):
    """Drives a vector environment until each of its environments has ended. Returns the information at the ends."""
    states, _ = env.reset(seed=list(range(1000, 1000 + env.num_envs)))
    ends = [None] * env.num_envs
    for _ in range(steps):
        actions = np.stack([one(state) for one, state in zip(demonstrators, states, strict=True)])
        states, _, terminated, truncated, info = env.step(actions)
        for b in np.flatnonzero(terminated | truncated):
            ends[b] = ends[b] or {name: value[b] for name, value in info.items()}
        if all(ends):
            break
    return ends


def play(rule=None, size=12, hand=None, **options):
    env = FetchVector(size, rule=rule, **options)
    action = options.get("action", "pose")
    return drive(env, [Demonstrator(env.task, action, 1000 + b, hand) for b in range(size)])


# --- the scene


@pytest.mark.parametrize("robot", ARMS)
def test_every_shipped_arm_fetches_a_cup_from_where_it_is_singular(robot):
    found = task(robot)
    far = found.cup + [0.007, 0.0, 0.0]
    solved = sk.PositionIk(found.chain).solve(found.hold(far), near=found.start)
    assert solved.status == sk.PositionIkStatus.OK
    assert sigma_ratio(found.chain, solved.q[None], found.chain.characteristic_length)[0] < 0.045
    beyond = sk.PositionIk(found.chain).solve(found.hold(found.cup + [0.03, 0.0, 0.0]), near=found.start)
    assert beyond.status == sk.PositionIkStatus.UNREACHABLE
    (end,) = play(size=1, hand=STEADY, robot=robot, dt=FAST)
    assert end["success"]
    assert end["limits_broken"] == 0


def test_cups_are_at_the_end_of_reach_and_within_5_cm_of_their_centre():
    found, rng = task("ufactory_xarm7"), np.random.default_rng(0)
    draws = [found.draw(rng) for _ in range(300)]
    cups, goals = np.array([d.cup for d in draws]), np.array([d.goal for d in draws])
    assert (np.linalg.norm(cups - found.cup, axis=1) <= 0.05).all()
    assert (np.linalg.norm(goals - found.goal, axis=1) <= 0.05).all()
    inside = found.reach - np.linalg.norm(cups[:, :2], axis=1)
    assert inside.min() >= 0.003
    assert inside.max() <= 0.017
    assert np.ptp(cups[:, 1]) > 0.09
    assert np.ptp(goals[:, 0]) > 0.08


def test_a_region_that_an_arm_does_not_have_is_told():
    with pytest.raises(ValueError, match="kuka_lbr_iiwa_14_r820 with a gripper finds no way"):
        task("kuka_lbr_iiwa_14_r820", "overhead")
    with pytest.raises(ValueError, match="no region 'under'; there are edge, overhead"):
        task("ur10", "under")


# --- Gymnasium's rules


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"action": "twist"},
        {"rule": "stop"},
        {"rule": "position_ik"},
        {"region": "overhead"},
        {"rule": "dls:damping=0.2"},
    ],
    ids=str,
)
def test_gymnasiums_checker_finds_nothing(options):
    env = gymnasium.make("sigmaik/Fetch-v0", **options)
    check_env(env.unwrapped, skip_render_check=True)


@pytest.mark.parametrize(
    ("imports", "prefix"),
    [("gymnasium", "sigmaik_lab.envs:"), ("gymnasium, sigmaik", ""), ("sigmaik_lab.envs, gymnasium", "")],
)
def test_the_environment_is_found(imports, prefix):
    code = f"import {imports}; print(gymnasium.make('{prefix}sigmaik/Fetch-v0').reset(seed=1)[0].shape)"
    run = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "(31,)\n"


def test_the_same_seed_gives_the_same_episode_and_another_seed_another():
    def states(seed):
        env = Fetch()
        seen, _ = env.reset(seed=seed)
        env.action_space.seed(0)
        return [seen, *(env.step(env.action_space.sample())[0] for _ in range(5))]

    np.testing.assert_array_equal(states(4), states(4))
    assert not np.array_equal(states(4), states(5))


def test_states_and_actions_have_the_entries_that_their_names_say():
    env = Fetch("ur10")
    state, _ = env.reset(seed=0)
    parts, world = layout(6), env.world
    assert len(state_names(env.task.chain.joint_names)) == parts.size == len(state)
    np.testing.assert_allclose(state[parts.tool], world.pose[0, :3, 3], rtol=1e-6)
    np.testing.assert_allclose(state[parts.rotation], world.pose[0, :3, :2].T.ravel(), atol=1e-6)
    np.testing.assert_allclose(state[parts.q], world.q[0], rtol=1e-6)
    assert state[parts.gripper] == 1.0
    assert len(action_names("pose")) == env.action_space.shape[0] == 10
    assert len(action_names("twist")) == 7


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"rule": "no-such"}, "unknown method 'no-such'"),
        ({"action": "joints"}, "action is 'pose' or 'twist'"),
        ({"physics": "real"}, "physics is 'kinematic' or 'mujoco'"),
        ({"dt": 3e-3}, "dt = 0.003"),
        ({"max_steps": 0}, "max_steps = 0"),
        ({"robot": "no-arm"}, "no shipped arm"),
        ({"render_mode": "human"}, "render_mode"),
    ],
)
def test_wrong_options_are_told(options, text):
    with pytest.raises((ValueError, TypeError), match=text):
        Fetch(**options)


def test_an_action_that_is_not_finite_is_refused():
    env = Fetch()
    env.reset(seed=0)
    action = env.action_space.sample()
    action[2] = np.nan
    with pytest.raises(ValueError, match="finite"):
        env.step(action)


# --- many environments


@pytest.mark.parametrize("rule", [None, "stop", "position_ik"])
@pytest.mark.parametrize("action", ["pose", "twist"])
def test_many_environments_do_what_single_ones_do_to_the_last_bit(rule, action):
    size, options = 3, {"rule": rule, "action": action, "max_steps": 4, "dt": 5e-3}
    many = gymnasium.make_vec("sigmaik/Fetch-v0", num_envs=size, threads=2, **options)
    single = gymnasium.vector.SyncVectorEnv([lambda: Fetch(**options)] * size)
    many.single_action_space.seed(0)
    for (seen, info), (same, told) in [(many.reset(seed=7), single.reset(seed=7))]:
        np.testing.assert_array_equal(seen, same)
        np.testing.assert_array_equal(info["sigma_ratio"], told["sigma_ratio"])
    for _ in range(11):  # through two autoresets
        actions = np.stack([many.single_action_space.sample() for _ in range(size)])
        for ours, theirs in zip(many.step(actions)[:4], single.step(actions)[:4], strict=True):
            np.testing.assert_array_equal(ours, theirs)


def test_an_episode_that_ended_begins_again_with_the_next_step_which_does_nothing_else():
    env = FetchVector(2, max_steps=3, dt=FAST)
    first, _ = env.reset(seed=0)
    actions = env.action_space.sample()
    for _ in range(3):
        _, _, terminated, truncated, _ = env.step(actions)
    assert truncated.all()
    assert not terminated.any()
    again, reward, terminated, truncated, info = env.step(actions)
    assert not (terminated | truncated).any()
    assert not reward.any()
    parts = layout(7)
    np.testing.assert_array_equal(again[:, parts.qdot], 0.0)
    assert (again[:, parts.cup] != first[:, parts.cup]).any()
    assert not info["limits_broken"].any()


# --- limits


def test_limits_are_counted_from_positions_alone():
    found = task("ufactory_xarm7")
    world = World(found, make_drive(found.chain, None, FAST, 1, 1), "pose", 1)
    world.reset([found.draw(np.random.default_rng(0))])
    limits, dt = found.chain.limits, FAST
    q = np.repeat(world.q[None], 10, axis=0)
    velocity, acceleration = limits.velocity[0], limits.acceleration[0]
    way = np.zeros(10)
    way[4:] = velocity * 1.01 * dt * np.arange(1, 7)  # a jump of velocity in one cycle, then seven per mille too fast
    q[:, 0, 0] += way
    world._count(q)
    assert world.limits.velocity == 6
    assert world.limits.acceleration == 1
    assert world.limits.position == 0
    q[:, 0, 3] = limits.upper[3] + 0.1
    world._count(q)
    assert world.limits.position == 10
    assert acceleration * dt < velocity


def test_the_servo_breaks_no_limit_under_random_actions_and_position_ik_does():
    broken = {}
    for rule in (None, "dls", "stop", "position_ik"):
        env = FetchVector(8, rule=rule, max_steps=15)
        env.reset(seed=0)
        env.action_space.seed(0)
        for _ in range(15):
            *_, info = env.step(env.action_space.sample())
        broken[rule] = info["limits_broken"].sum(), info["velocity_limits_broken"].sum()
    assert broken[None] == broken["dls"] == broken["stop"] == (0, 0)
    assert broken["position_ik"][0] > 100
    assert broken["position_ik"][1] == 0


# --- the gripper and the cup


def hold(env, pose, opening, steps):
    six = pose[:3, :2].T.ravel()
    for _ in range(steps):
        result = env.step(np.array([*pose[:3, 3], *six, opening], dtype=np.float32))
    return result


def test_a_gripper_around_the_cup_holds_it_and_one_beside_the_cup_closes_on_nothing():
    env = Fetch(dt=FAST)
    env.reset(seed=0, options={"cup": env.task.cup - [0.1, 0.0, 0.0]})
    parts, at = layout(7), env.task.hold(env.task.cup - [0.1, 0.0, 0.0])
    aside = at.copy()
    aside[:3, 3] += 0.04 * at[:3, 1]
    state, *_ = hold(env, aside, 1.0, 20)
    state, *_ = hold(env, aside, 0.0, 10)
    assert state[parts.gripper] == 0.0
    state, *_ = hold(env, at, 1.0, 20)
    state, _, _, _, info = hold(env, at, 0.0, 10)
    assert state[parts.gripper] == pytest.approx(2.0 * CUP.radius / GRIPPER.stroke)
    assert info["reached"] == "grasp"
    up = at.copy()
    up[2, 3] += 0.1
    state, *_ = hold(env, up, 0.0, 20)
    np.testing.assert_allclose(state[parts.cup], state[parts.tool], atol=2e-3)
    _, reward, terminated, _, info = hold(env, up, 1.0, 4)  # lets it fall
    assert info["lost"]
    assert terminated
    assert reward == 0.0


def test_the_episode_succeeds_where_the_cup_is_let_go_at_the_goal_and_not_beside_it():
    for off, success in ((0.8 * AT_GOAL, True), (1.3 * AT_GOAL, False)):
        env = Fetch(dt=FAST)
        goal = env.task.cup - [0.25, 0.0, 0.0]
        env.reset(seed=0, options={"cup": env.task.cup - [0.1, 0.0, 0.0], "goal": goal})
        at = env.task.hold(env.task.cup - [0.1, 0.0, 0.0])
        hold(env, at, 1.0, 25)
        hold(env, at, 0.0, 6)
        hold(env, env.task.hold(goal + [off, 0.0, 0.0]), 0.0, 30)
        _, reward, terminated, _, info = hold(env, env.task.hold(goal + [off, 0.0, 0.0]), 1.0, 3)
        assert (info["success"], terminated, reward) == (success, success, float(success))


# --- rules


def test_stopping_at_singularities_gets_no_cup_and_the_default_rule_gets_them_all():
    ours, stop = play(size=8), play("stop", size=8, dt=FAST, max_steps=120)
    assert sum(end["success"] for end in ours) == 8
    assert sum(end["success"] for end in stop) == 0
    assert min(end["sigma_ratio"] for end in stop) > 0.02
    assert not sum(end["limits_broken"] for end in ours + stop)


def test_stop_stands_before_the_singularity_and_leaves_it_again():
    def condition(env):
        return np.linalg.cond(env.task.chain.jacobian(env.world.q[0]))

    kappa = {}
    for rule in (None, "stop"):
        env = Fetch(rule=rule, dt=FAST)
        env.reset(seed=0)
        hold(env, env.task.hold(env.task.cup), 1.0, 60)
        kappa[rule] = condition(env)
    assert 27.0 < kappa["stop"] < 31.0
    assert kappa[None] > 40.0
    *_, info = hold(env, env.task.hold(env.task.cup), 1.0, 1)
    assert np.linalg.norm(info["achieved_twist"]) < 1e-3
    hold(env, env.task.hold(env.task.cup - [0.15, 0.0, 0.0]), 1.0, 20)
    assert condition(env) < 20.0


def test_twists_and_the_overhead_region_are_done_too():
    assert sum(end["success"] for end in play(size=8, action="twist", dt=FAST)) == 8
    assert sum(end["success"] for end in play(size=8, region="overhead", dt=FAST)) == 8


# --- the demonstrator


def test_a_demonstrator_without_noise_is_a_function_of_the_state():
    env = Fetch(dt=FAST)
    state, _ = env.reset(seed=3)
    old = Demonstrator(env.task, seed=1, hand=STEADY)
    for _ in range(40):
        action = old(state)
        np.testing.assert_array_equal(action, Demonstrator(env.task, seed=2, hand=STEADY)(state))
        state, *_ = env.step(action)


def test_the_demonstrator_fetches_a_cup_that_is_moved_away_under_its_hand():
    env = Fetch(dt=FAST)
    state, _ = env.reset(seed=3)
    demonstrator, moved = Demonstrator(env.task, seed=3), False
    for _ in range(300):
        if not moved and env.world.opening[0] < 0.95:  # just as the gripper closes
            env.world.cup[0, 1] -= 0.05
            state, moved = env.world.state()[0], True
        state, _, terminated, truncated, info = env.step(demonstrator(state))
        if terminated or truncated:
            break
    assert moved
    assert info["success"]


def test_demonstrations_show_a_gripper_that_closed_on_nothing_and_opens_again():
    hand = dataclasses.replace(Hand(), misses=1.0)
    env = Fetch(dt=FAST)
    state, _ = env.reset(seed=5)
    demonstrator, parts, least = Demonstrator(env.task, seed=5, hand=hand), layout(7), 1.0
    for _ in range(300):
        state, _, terminated, truncated, info = env.step(demonstrator(state))
        least = min(least, float(state[parts.gripper][0]))
        if terminated or truncated:
            break
    assert least < 0.3
    assert info["success"]


# --- rotations


def test_rotations_of_many_vectors_are_those_of_the_library():
    rng = np.random.default_rng(0)
    axes = rng.normal(size=(300, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    angles = np.concatenate([rng.uniform(0.0, np.pi, 295), [0.0, 1e-12, 1e-6, 3.14159, np.pi - 1e-9]])
    vectors = axes * angles[:, None]
    found = motion.rotations(vectors)
    np.testing.assert_allclose(found, [sk.rotation_exp(v) for v in vectors], atol=1e-14)
    np.testing.assert_allclose(motion.rotation_vectors(found), [sk.rotation_log(r) for r in found], atol=1e-12)


def test_six_numbers_always_give_a_rotation():
    six = np.random.default_rng(0).normal(size=(200, 6))
    six[0], six[1, :3], six[2, 3:], six[3, 3:] = 0.0, 0.0, 0.0, six[3, :3] * 2.0
    rotation = rotation_of_6d(six)
    np.testing.assert_allclose(rotation @ np.swapaxes(rotation, 1, 2), np.tile(np.eye(3), (200, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(rotation), 1.0)
