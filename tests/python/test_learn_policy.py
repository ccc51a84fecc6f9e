"""The policy: what it sees is relative to the tool, the diffusion's equations, and training that can be interrupted."""

from __future__ import annotations

import argparse

import numpy as np
import pytest

import sigmaik as sk
from sigmaik_lab.learn.episode import Episode, layout, rotation_6d, rotation_of_6d
from sigmaik_lab.learn.windows import FEATURES, WIDTH, absolute_chunks, features, relative_chunks, windows

DOF = 7


def rotation(rng):
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def reach(seed, length=30):
    """A stand-in for the task: the tool goes to the cup on a line, and the gripper closes there."""
    rng = np.random.default_rng(seed)
    parts = layout(DOF)
    start, cup = rng.uniform(-0.2, 0.2, 3), np.array([0.5, 0.0, 0.1]) + rng.uniform(-0.05, 0.05, 3)
    part = np.minimum(np.arange(length + 1) / (length - 5.0), 1.0)[:, None]
    tool = start + part * (cup - start)
    state = np.zeros((length, parts.size), dtype=np.float32)
    state[:, parts.tool], state[:, parts.rotation] = tool[:-1], [1, 0, 0, 0, 1, 0]
    state[:, parts.cup], state[:, parts.goal] = cup, [0.2, 0.3, 0.1]
    state[:, parts.gripper] = 1.0
    grip = (part[1:] < 1.0).astype(float)
    action = np.concatenate([tool[1:], np.tile([1, 0, 0, 0, 1, 0], (length, 1)), grip], axis=1).astype(np.float32)
    return Episode(np.arange(length) / 10.0, state, action, np.array(["approach"] * length), True)


# --- relative to the tool


def test_chunks_are_relative_to_the_tool_and_back():
    rng = np.random.default_rng(0)
    parts = layout(DOF)
    states = rng.normal(size=(6, parts.size)).astype(np.float32)
    actions = rng.normal(size=(6, 4, WIDTH)).astype(np.float32)
    for b in range(6):
        states[b, parts.rotation] = rotation_6d(rotation(rng))
        for k in range(4):
            actions[b, k, 3:9] = rotation_6d(rotation(rng))
    relative = relative_chunks(states, actions)
    np.testing.assert_allclose(absolute_chunks(states, relative), actions, atol=1e-5)
    # By homogeneous matrices, one at a time.
    for b, k in ((0, 0), (3, 2), (5, 3)):
        tool, there = np.eye(4), np.eye(4)
        tool[:3, :3], tool[:3, 3] = rotation_of_6d(states[b, parts.rotation]), states[b, parts.tool]
        there[:3, :3], there[:3, 3] = rotation_of_6d(actions[b, k, 3:9]), actions[b, k, :3]
        between = np.linalg.inv(tool) @ there
        np.testing.assert_allclose(relative[b, k, :3], between[:3, 3], atol=1e-5)
        np.testing.assert_allclose(rotation_of_6d(relative[b, k, 3:9]), between[:3, :3], atol=1e-5)
        assert relative[b, k, 9] == actions[b, k, 9]


def test_offsets_do_not_change_when_everything_is_moved():
    rng = np.random.default_rng(1)
    parts = layout(DOF)
    state = rng.normal(scale=0.1, size=parts.size).astype(np.float32)
    state[parts.rotation] = rotation_6d(rotation(rng))
    moved, turn, shift = state.copy(), rotation(rng), rng.normal(size=3)
    for part in (parts.tool, parts.cup, parts.goal):
        moved[part] = turn @ state[part] + shift
    moved[parts.rotation] = rotation_6d(turn @ rotation_of_6d(state[parts.rotation]))
    offsets = slice(0, FEATURES - 11)
    np.testing.assert_allclose(features(moved)[offsets], features(state)[offsets], atol=1e-5)
    assert (
        np.abs(features(moved)[FEATURES - 11 : FEATURES - 8] - features(state)[FEATURES - 11 : FEATURES - 8]).max()
        > 0.1
    )


def test_windows_hold_the_last_action():
    episode = reach(0)
    seen, said = windows([episode, reach(1, 25)], 16)
    assert seen.shape == (55, FEATURES)
    assert said.shape == (55, 16, WIDTH)
    np.testing.assert_array_equal(seen[30], features(reach(1, 25).state[0]))
    back = absolute_chunks(episode.state, said[:30])
    np.testing.assert_allclose(back[28, 1:], np.tile(episode.action[29], (15, 1)), atol=1e-6)
    np.testing.assert_allclose(back[3], episode.action[3:19], atol=1e-6)
    np.testing.assert_allclose(back[29, 0], episode.action[29], atol=1e-6)


# --- the rest needs torch

torch = pytest.importorskip("torch")

from sigmaik_lab.learn.diffusion import Diffusion  # noqa: E402
from sigmaik_lab.learn.network import NoiseNet  # noqa: E402
from sigmaik_lab.learn.policy import Policy, Scale, Shape, load_policy  # noqa: E402
from sigmaik_lab.learn.training import Trainer, Training  # noqa: E402

SMALL = Shape(horizon=8, channels=(16, 16), hidden=16, levels=20)


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def test_noise_that_is_known_is_taken_away():
    """With the true noise (57) ends at the chunk itself."""
    diffusion = Diffusion(100)
    chunk = torch.randn(3, 8, WIDTH, generator=torch.Generator().manual_seed(0))

    def oracle(noisy, level, seen):
        kept = diffusion.kept[level][:, None, None].double()
        noise = (noisy - kept.sqrt() * chunk) / (1.0 - kept).sqrt()
        return (kept.sqrt() * noise - (1.0 - kept).sqrt() * chunk).float()

    noise = torch.randn(3, 8, WIDTH, generator=torch.Generator().manual_seed(1))
    for steps in (1, 5, 50):
        found = diffusion.sample(oracle, noise, torch.zeros(3, 1), steps, torch.full((8, WIDTH), 10.0))
        torch.testing.assert_close(found, chunk, atol=1e-4, rtol=0.0)
    assert float(diffusion.losses(oracle, chunk, chunk[:, 0], torch.Generator().manual_seed(2))[0]) < 1e-6


def test_samples_have_the_distribution_of_the_data():
    """The best network for normally distributed chunks is known; samples have their mean and standard deviation."""
    diffusion, mean, std = Diffusion(100), 0.5, 0.3

    def best(noisy, level, seen):
        kept = diffusion.kept[level][:, None, None]
        noise = (1.0 - kept).sqrt() * (noisy - kept.sqrt() * mean) / (kept * std**2 + 1.0 - kept)
        clean = mean + kept.sqrt() * std**2 * (noisy - kept.sqrt() * mean) / (kept * std**2 + 1.0 - kept)
        return kept.sqrt() * noise - (1.0 - kept).sqrt() * clean

    noise = torch.randn(4000, 1, 1, generator=torch.Generator().manual_seed(0))
    found = diffusion.sample(best, noise, torch.zeros(4000, 1), 100, torch.full((1, 1), 10.0))
    assert abs(float(found.mean()) - mean) < 0.03
    assert abs(float(found.std()) - std) < 0.03
    data, seen = mean + std * noise, torch.zeros(4000, 1)
    trained, told = diffusion.losses(best, data, seen, torch.Generator().manual_seed(1))
    worse, _ = diffusion.losses(lambda *known: best(*known) + 1.0, data, seen, torch.Generator().manual_seed(1))
    assert float(worse) == pytest.approx(float(trained) + 1.0, abs=0.15)
    # (58) of the best network: ᾱσ²/(ᾱσ² + 1 − ᾱ), the mean over the levels.
    left = diffusion.kept * std**2
    assert float(told) == pytest.approx(float((left / (left + 1.0 - diffusion.kept)).mean()), abs=0.04)


def test_noise_levels_go_from_little_to_all():
    kept = Diffusion(50).kept
    assert kept[0] > 0.99
    assert kept[-1] < 1e-3
    assert (kept[1:] < kept[:-1]).all()


def test_the_network_sees_observation_level_and_time():
    torch.manual_seed(0)
    network = NoiseNet(WIDTH, 12, (16, 32, 32), 16).eval()
    chunks, level, seen = torch.randn(2, 16, WIDTH), torch.tensor([3, 3]), torch.randn(2, 12)
    out = network(chunks, level, seen)
    assert out.shape == chunks.shape
    assert (network(chunks, level, seen + 1.0) - out).abs().max() > 1e-3
    assert (network(chunks, level + 9, seen) - out).abs().max() > 1e-3
    assert (network(chunks.flip(1), level, seen).flip(1) - out).abs().max() > 1e-3  # convolution, and not a sum


# --- training


def trainer(steps=12, seed=0, episodes=4, **changes):
    return Trainer(
        "ufactory_xarm7", [reach(k) for k in range(episodes)], Training(steps, 16, seed=seed, **changes), SMALL
    )


def weights(policy):
    return torch.cat([p.detach().reshape(-1) for p in policy.network.parameters()])


def test_an_interrupted_run_ends_with_the_same_weights(tmp_path):
    whole = trainer().run(every=3)
    file = tmp_path / "checkpoint"
    trainer().run(file, every=3, until=6)
    resumed = trainer()
    policy = resumed.run(file, every=3)
    assert torch.equal(weights(policy), weights(whole))
    assert [line.step for line in resumed.losses] == [3, 6, 9, 12]
    assert policy.facts["steps"] == 12
    assert not torch.equal(weights(trainer(seed=1).run()), weights(whole))
    again = trainer()
    assert torch.equal(weights(again.run(file, every=3)), weights(whole))  # nothing is left to do


@pytest.mark.parametrize(
    ("changes", "said"), [({"steps": 13}, "training"), ({"seed": 2}, "training"), ({"episodes": 3}, "data")]
)
def test_a_checkpoint_of_another_run_is_refused(tmp_path, changes, said):
    file = tmp_path / "checkpoint"
    trainer().run(file, every=3, until=3)
    with pytest.raises(sk.Error, match=f"another {said}"):
        trainer(**changes).run(file, every=3)


def test_a_policy_learns_to_go_to_the_cup():
    episodes = [reach(k) for k in range(40)]
    shape = Shape(horizon=8, channels=(16, 32), hidden=32, levels=20)
    found = Trainer("ufactory_xarm7", episodes, Training(250, 64, 3e-3), shape)
    policy = found.run(every=50)
    assert found.losses[-1].held_out < 0.8 * found.losses[0].held_out
    test = reach(99)
    rng = np.random.default_rng(0)
    states = test.state[[8, 14]]
    chunks = policy.chunks(states, 0.5 * rng.standard_normal((2, 8, WIDTH), dtype=np.float32))
    tool, there = states[:, layout(DOF).tool], test.action[[11, 17], :3]
    assert np.linalg.norm(chunks[:, 3, :3] - there) < 0.5 * np.linalg.norm(tool - there)
    assert (chunks[:, :4, 9] == 1.0).all()  # the gripper is open on the way


def test_scenes_do_not_depend_on_their_neighbours():
    policy = trainer().run()
    rng = np.random.default_rng(0)
    states = np.concatenate([reach(k).state[5:7] for k in range(5)])
    noise = rng.standard_normal((10, 8, WIDTH), dtype=np.float32)
    together = policy.chunks(states, noise)
    alone = np.concatenate([policy.chunks(states[k : k + 1], noise[k : k + 1]) for k in range(10)])
    np.testing.assert_allclose(alone, together, atol=1e-4)


def test_entries_that_never_change_do_no_harm():
    seen, said = windows([reach(k) for k in range(3)], 8)
    scale = Scale.of(seen, said)
    assert scale.seen_std.min() > 0.0
    assert scale.said_std.min() > 0.0
    assert np.isfinite((said - scale.said_mean) / scale.said_std).all()


# --- files


def test_a_policy_survives_its_file(tmp_path):
    policy = trainer().run()
    again = load_policy(policy.save(tmp_path / "policy.pt"))
    assert (again.robot, again.shape) == (policy.robot, policy.shape)
    assert again.facts["steps"] == policy.facts["steps"] == 12
    states, noise = reach(3).state[:4], np.random.default_rng(0).standard_normal((4, 8, WIDTH), dtype=np.float32)
    np.testing.assert_array_equal(again.chunks(states, noise), policy.chunks(states, noise))


class Harm:
    def __reduce__(self):
        return (print, ("run",))


def test_files_that_are_no_policies_are_refused(tmp_path, capsys):
    (tmp_path / "text.pt").write_text("no policy")
    torch.save({"file": Harm()}, tmp_path / "harm.pt")
    torch.save({"file": "other"}, tmp_path / "other.pt")
    for name in ("text.pt", "harm.pt", "other.pt"):
        with pytest.raises(sk.Error):
            load_policy(tmp_path / name)
    assert "run" not in capsys.readouterr().out
    with pytest.raises(FileNotFoundError):
        load_policy(tmp_path / "nothing.pt")


def test_training_says_what_is_missing():
    with pytest.raises(sk.Error, match="needs an episode"):
        Trainer("ufactory_xarm7", [])
    twist = reach(0)
    twist.action = twist.action[:, :7]
    with pytest.raises(sk.Error, match="pose actions"):
        Trainer("ufactory_xarm7", [twist])


def test_untrained_policies_depend_on_the_seed_alone():
    seen, said = windows([reach(0)], 8)
    scale = Scale.of(seen, said)
    torch.manual_seed(5)
    a = Policy.make("ufactory_xarm7", SMALL, scale, 3)
    torch.manual_seed(6)
    b = Policy.make("ufactory_xarm7", SMALL, scale, 3)
    assert torch.equal(weights(a), weights(b))


def test_train_makes_a_policy_for_each_seed_once(tmp_path, capsys, monkeypatch):
    pytest.importorskip("pyarrow")
    from sigmaik_lab.learn import dataset, train
    from sigmaik_lab.learn.episode import action_names, state_names

    writer = dataset.Writer(
        tmp_path / "demonstrations",
        10,
        "ufactory_xarm7",
        state_names([f"joint{k}" for k in range(DOF)]),
        action_names("pose"),
    )
    for k in range(3):
        writer.add(reach(k))
    writer.close()
    parser = argparse.ArgumentParser()
    train.options(parser)
    words = ["--out", str(tmp_path), "--steps", "2", "--batch", "8", "--seed", "3,5", "--jobs", "1"]
    assert train.run(parser.parse_args(words)) == 0
    assert capsys.readouterr().out.split()[-2:] == [str(tmp_path / f"policy-{seed}.pt") for seed in (3, 5)]
    three, five = (load_policy(tmp_path / f"policy-{seed}.pt") for seed in (3, 5))
    assert (three.facts["seed"], five.facts["seed"]) == (3, 5)
    assert not torch.equal(weights(three), weights(five))

    def never(self):
        raise AssertionError

    monkeypatch.setattr(Trainer, "_advance", never)
    assert train.run(parser.parse_args(words)) == 0  # nothing is left to do
    for wrong, said in (
        (["--seed", "0,0"], "different"),
        (["--steps", "0"], "positive"),
        (["--data", "none"], "no data set"),
    ):
        with pytest.raises(ValueError, match=said):
            train.run(parser.parse_args([*words, *wrong]))
