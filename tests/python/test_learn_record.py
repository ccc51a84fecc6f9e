"""`sigmaik learn record`: a scripted demonstrator's episodes become a data set, and an interrupted run goes on."""

import numpy as np
import pytest

import sigmaik as sk

pytest.importorskip("gymnasium")
pytest.importorskip("pyarrow")

from sigmaik_lab.__main__ import main  # noqa: E402
from sigmaik_lab.learn import dataset  # noqa: E402
from sigmaik_lab.learn.episode import PHASES, layout  # noqa: E402
from sigmaik_lab.learn.play import Scenes, demonstrate  # noqa: E402
from sigmaik_lab.learn.record import record  # noqa: E402


class Silent:
    def expect(self, total): ...
    def say(self, what): ...
    def advance(self, done=1.0): ...


def same(a, b):
    assert len(a) == len(b)
    for one, other in zip(a, b, strict=True):
        assert one.scene == other.scene
        for name in ("times", "state", "action", "phase"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_an_interrupted_recording_goes_on_to_the_same_data_set(tmp_path):
    class Interrupts(Silent):
        def advance(self, done=1.0):
            self.left = getattr(self, "left", 3) - 1
            if self.left == 0:
                raise KeyboardInterrupt

    record(Scenes(), tmp_path / "whole", 4, 10, "scripted", Silent())
    with pytest.raises(KeyboardInterrupt):
        record(Scenes(), tmp_path / "parts", 4, 10, "scripted", Interrupts())
    record(Scenes(), tmp_path / "parts", 4, 10, "scripted", Silent())
    whole, parts = dataset.read(tmp_path / "whole"), dataset.read(tmp_path / "parts")
    assert [episode.scene["seed"] for episode in whole] == list(range(10, 14))
    same(whole, parts)
    assert record(Scenes(), tmp_path / "parts", 4, 10, "scripted", Silent()) == []
    with pytest.raises(sk.Error, match="has demonstrations with region edge, not overhead"):
        record(Scenes(region="overhead"), tmp_path / "parts", 5, 10, "scripted", Silent())


def test_an_episode_does_not_depend_on_the_scenes_beside_it():
    alone = [demonstrate(Scenes(), [seed])[0][0] for seed in (3, 4)]
    together = [episode for episode, _ in demonstrate(Scenes(), [3, 9, 4])]
    same(alone, [together[0], together[2]])


def test_an_episode_has_all_phases_in_their_order_and_ends_with_the_open_gripper():
    ((episode, broken),) = demonstrate(Scenes(), [0], "steady")
    assert broken == 0
    assert episode.success
    numbers = [PHASES.index(phase) for phase in episode.phase]
    assert numbers == sorted(numbers)
    assert set(numbers) == {0, 1, 2, 3}
    assert episode.action[-1, -1] == 1.0
    assert np.allclose(np.diff(episode.times), 0.1)
    np.testing.assert_allclose(episode.state[0, layout(7).cup], episode.scene["cup"], rtol=1e-6)


def test_the_command_tells_what_was_tried_and_where_it_is(tmp_path, capsys):
    words = ["learn", "record", "--episodes", "2", "--out", str(tmp_path)]
    assert main(words) == 0
    assert "demonstrations: lengths in s" in capsys.readouterr().out
    assert main(words) == 0
    assert "has 2 demonstrations already" in " ".join(capsys.readouterr().out.split())
    assert main(["learn", "record", "--episodes", "0"]) == 2
    assert main(["learn", "record", "--rule", "nothing"]) == 2


def test_a_demonstrator_that_always_fails_is_given_up(tmp_path):
    with pytest.raises(ValueError, match="5 of 5 demonstrations failed; .* keeps the 0 others"):
        record(Scenes(rule="stop", max_steps=10), tmp_path, 1, 0, "scripted", Silent())


def test_speed_tells_actions_and_cycles_a_second(capsys):
    words = ["learn", "speed", "--envs", "2", "--threads", "1", "--seconds", "0.1"]
    assert main([*words, "--cycle", "10"]) == 0
    *_, last = capsys.readouterr().out.strip().splitlines()
    cycle, envs, threads, actions, cycles, *_ = map(float, last.split())
    assert (cycle, envs, threads) == (10.0, 2.0, 1.0)
    assert cycles == pytest.approx(10.0 * actions, rel=0.01)
    assert main([*words, "--cycle", "ten"]) == 2
