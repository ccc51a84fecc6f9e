"""Every Python example runs, and has a C++ twin of the same name."""

import pathlib
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "python" / "examples").glob("*.py"))


def test_examples_come_in_pairs():
    twins = {path.stem for path in (ROOT / "cpp" / "examples").glob("*.cpp")}
    assert EXAMPLES
    assert {path.stem for path in EXAMPLES} == twins


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(example):
    run = subprocess.run([sys.executable, "-W", "error", example], capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr
    assert run.stdout
