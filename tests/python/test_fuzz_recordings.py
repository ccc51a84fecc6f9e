"""A short run of tests/fuzz/fuzz_recording.py, with its own seed; `make fuzz` runs it for longer."""

import importlib.util
from pathlib import Path

spec = importlib.util.spec_from_file_location(
    "fuzz_recording", Path(__file__).parents[1] / "fuzz" / "fuzz_recording.py"
)
fuzz_recording = importlib.util.module_from_spec(spec)
spec.loader.exec_module(fuzz_recording)


def test_mutated_recordings_are_refused_or_work():
    count, reason = fuzz_recording.run(seed=7, mutations=60)
    assert reason is None
    assert count == 60


def test_a_broken_property_is_found(monkeypatch):
    monkeypatch.setattr(fuzz_recording.Episode, "check", lambda episode: None)
    assert fuzz_recording.run(seed=7, mutations=400)[1] is not None
