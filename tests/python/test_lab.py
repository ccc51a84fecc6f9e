"""The laboratory: studies are found by name, take any arm, need little, and say what they do."""

from __future__ import annotations

import argparse
import inspect
import io
import os
import pathlib
import re
import subprocess
import sys

import pytest

import sigmaik as sk
from sigmaik_lab import output, report, runner, study
from sigmaik_lab.__main__ import main

STUDIES = [name for name in study.names() if study.find_study(name) is not None]
DRAWING = [name for name in STUDIES if name not in ("drill", "reaching", "stress")]
FIXED = {"axis5": "kuka_kr6_r900", "cart": "ur10", "round-table": "kuka_lbr_iiwa_14_r820"}

#: Packages that a plain `pip install .` does not bring.
EXTRAS = (
    "rich",
    "matplotlib",
    "PIL",
    "scipy",
    "casadi",
    "mujoco",
    "viser",
    "yourdfpy",
    "pyarrow",
    "gymnasium",
    "torch",
    "distributed",
    "pygame",
    "rclpy",
)
PLAIN = f"""
import sys

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {EXTRAS!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Blocker())
from sigmaik_lab.__main__ import main
code = main(sys.argv[1:])
print("loaded:", *sorted(sys.modules), file=sys.stderr)
sys.exit(code)
"""


def plain(*arguments, path=""):
    """A command in a Python that has no package but numpy."""
    environment = dict(os.environ)
    if path:
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, (str(path), environment.get("PYTHONPATH"))))
    return subprocess.run(
        [sys.executable, "-c", PLAIN, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
        timeout=300,
    )


def options_of(name):
    parser = argparse.ArgumentParser()
    study.find_study(name).options(parser)
    return parser


# --- the protocol


def test_all_commands_are_found():
    assert set(STUDIES) == {
        "arrival", "axis5", "cart", "drill", "execute", "limits", "montecarlo", "reach", "reaching", "round-table",
        "solvers", "stress", "track",
    }  # fmt: skip
    assert set(study.names()) - set(STUDIES) == {"info", "learn", "robots", "ros2", "ros2-arm", "teleop"}
    for name in study.names():
        first, rest = study.describe(name)
        assert 10 < len(first) < 80
        assert rest


@pytest.mark.parametrize("name", STUDIES)
def test_study_has_the_functions_of_the_protocol(name):
    found = study.find_study(name)
    for function, count in (("options", 1), ("load", 1), ("run", 2), ("report", 2)):
        assert len(inspect.signature(getattr(found, function)).parameters) == count, function


@pytest.mark.parametrize("name", STUDIES)
def test_arm_and_output_are_asked_for_in_the_same_words(name):
    options = options_of(name)._option_string_actions
    if name == "stress":  # its arms are random
        assert "--out" in options
        return
    assert {"--robot", "--base", "--tip"} <= set(options)
    if name == "drill":  # prints a table, and writes nothing
        return
    assert "--out" in options
    assert ("--no-plot" in options) == (name in DRAWING)
    for text in options:
        if text == "--no-plots":  # as axis5 once had it
            assert options[text].help == argparse.SUPPRESS
            assert options[text].dest == options["--no-plot"].dest == "no_plot"
    assert name not in ("reach", "limits", "axis5", "track") or "none" in options["--format"].choices


def test_a_new_study_is_one_folder(tmp_path):
    """The example of CONTRIBUTING.md, as it stands."""
    text = (pathlib.Path(__file__).parents[2] / "CONTRIBUTING.md").read_text(encoding="utf-8")
    example = re.search(r"^### A study: 1 folder$.*?^```python$\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    folder = tmp_path / "sigmaik_lab" / "tiny_wobble"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text('"""how an arm wobbles\n\nTurns all joints a little.\n"""\n')
    (folder / "study.py").write_text(example[1], encoding="utf-8")
    done = plain("--help", path=tmp_path)
    assert done.returncode == 0
    assert "tiny-wobble" in done.stdout
    assert "how an arm wobbles" in done.stdout
    done = plain("tiny-wobble", "--times", "3", "--out", tmp_path / "out", path=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "ur10 wobbles" in done.stdout
    assert done.stdout.splitlines()[-1] == str(tmp_path / "out" / "wobble.csv")
    assert len((tmp_path / "out" / "wobble.csv").read_text().splitlines()) == 4
    done = plain("tiny-wobble", "--times", "0", path=tmp_path)
    assert done.returncode == 2
    assert done.stderr.splitlines()[0] == "sigmaik: --times must be positive"


# --- what a command loads, and what it needs


@pytest.mark.parametrize("arguments", [["--help"], ["robots"], ["--version"]])
def test_light_commands_load_no_study(arguments):
    code = (
        "import sys, sigmaik_lab.__main__ as m\ntry: m.main(sys.argv[1:])\nexcept SystemExit: pass\nprint(*sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.splitlines()[-1].split())
    assert "sigmaik_lab.study" in loaded
    assert not {name for name in loaded if name.startswith("sigmaik_lab.") and name.count(".") > 1} - {
        "sigmaik_lab.reach.paths",
        "sigmaik_lab.robots.command",
    }
    assert not {"matplotlib", "mujoco", "scipy", "casadi", "concurrent.futures", "sigmaik.teleop"} & loaded


def test_plain_install_lists_arms_and_describes_them():
    done = plain("robots")
    assert done.returncode == 0, done.stderr
    assert all(name in done.stdout for name in sk.robots.names())
    assert "wrist-lock" in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 80
    done = plain("info", "kuka_lbr_iiwa_14_r820", "--samples", "10")
    assert done.returncode == 0, done.stderr
    for text in (*sk.robots.load("kuka_lbr_iiwa_14_r820").joint_names, "reach from the base's origin", "codim."):
        assert text in done.stdout


@pytest.mark.parametrize(
    "command",
    [
        "reach --robot ur10 --method dls --limits on --rate 5 --format none --no-plot",
        "limits --robot ur10 --rate 100 --seconds 1 --pace 0.02 --trials 1 --no-plot",
        "axis5 --example 2 --dt 0.02 --format none --no-plot",
        "cart --variant fk --method linear --samples 50 --no-plot",
        "reaching --robot ur10 --tasks 1 --method straight,gradient",
        "montecarlo --robot franka_panda --samples 1 --jobs 1 --objective none --no-plot",
        "track --robot ur10 --target line --duration 4 --rate 200 --method dls --mode predict --format none --no-plot",
    ],
)
def test_studies_run_in_a_plain_install(command, tmp_path):
    done = plain(*command.split(), "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].endswith(".csv")
    assert list(tmp_path.glob("*.csv"))
    assert "rich" not in done.stderr.partition("loaded:")[2].split()


@pytest.mark.parametrize(
    ("command", "hint"),
    [
        *((f"{name} {'--example 1' if name == 'axis5' else ''}", "matplotlib") for name in DRAWING),
        ("execute --no-plot", "'mujoco>=3'"),
        ("reach --no-plot --physics", "'mujoco>=3'"),
        ("montecarlo --no-plot --solver ipopt", "casadi"),
        ("montecarlo --no-plot --dask tcp://127.0.0.1:1", "'dask[distributed]'"),
        ("teleop", "'viser>=1' yourdfpy"),
        (
            "ros2 --robot ur10",
            "ros-rclpy ros-rmw-fastrtps-cpp ros-diagnostic-msgs ros-geometry-msgs ros-sensor-msgs ros-std-srvs "
            "ros-trajectory-msgs",
        ),
    ],
)  # fmt: skip
def test_what_is_missing_is_named_with_a_command_that_works(command, hint):
    done = plain(*command.split())
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("sigmaik: ")
    assert f"pip install {hint} brings" in done.stderr.splitlines()[0]
    assert "sigmaik[" not in done.stderr.splitlines()[0]


# --- any arm


@pytest.fixture
def mine(tmp_path):
    """A UR10 as a file of its own."""
    file = tmp_path / "mine.urdf"
    file.write_text(sk.robots.path("ur10").read_text(encoding="utf-8"), encoding="utf-8")
    return str(file)


@pytest.mark.parametrize(
    "command",
    [
        "reach --method dls --limits on --rate 5 --format none --no-plot",
        "limits --rate 100 --seconds 1 --pace 0.02 --trials 1 --no-plot",
        "track --target line --duration 4 --rate 200 --method jparse --mode predict --format none --no-plot",
        "reaching --tasks 1 --method straight,gradient",
        "montecarlo --samples 1 --jobs 1 --objective none,manipulability --no-plot",
    ],
)
def test_studies_take_any_urdf(command, mine, tmp_path, capsys):
    out = tmp_path / "out"
    assert main([*command.split(), "--robot", mine, "--base", "base_link", "--tip", "flange", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert printed.splitlines()[-1].endswith(".csv")
    assert "mine" in printed


def test_execute_takes_any_urdf(mine, tmp_path, capsys):
    pytest.importorskip("mujoco")
    assert (
        main(["execute", "--robot", mine, "--tip", "flange", "--pace", "0.5", "--no-plot", "--out", str(tmp_path)]) == 0
    )
    assert capsys.readouterr().out.splitlines()[-1] == str(tmp_path / "mine-execute.csv")


def test_drill_takes_any_urdf(mine, capsys):
    assert main(["drill", "--robot", mine, "--tip", "flange", "--seconds", "0.3"]) == 0
    assert "mine" in capsys.readouterr().out


@pytest.mark.parametrize(("name", "robot"), FIXED.items())
def test_studies_of_one_arm_say_so(name, robot, mine, capsys):
    extra = ["--example", "1"] if name == "axis5" else []
    for other in (["--robot", mine], ["--robot", "franka_panda"], ["--tip", "flange"]):
        assert main([name, *extra, "--no-plot", *other]) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        assert captured.err.startswith(f"sigmaik: --robot is {robot} here")
        assert captured.err.count("\n") == 1


def test_potential_of_an_arm_whose_singular_sets_are_unknown(mine, capsys):
    assert main(["montecarlo", "--no-plot", "--robot", mine]) == 2
    assert "no objective potential for 'mine'" in capsys.readouterr().err


# --- what is said


def test_progress_is_a_line_now_and_then():
    now, stream = 0.0, io.StringIO()
    lines = output.Lines("wobble", stream, every=10.0, clock=lambda: now)
    lines.expect(200)
    lines.say("first")
    for _ in range(99):
        now += 0.09
        lines.advance()
    assert stream.getvalue() == ""  # a short run says nothing
    now = 10.5
    lines.advance()
    lines.advance()
    now = 20.6
    lines.say("second")
    assert stream.getvalue() == "sigmaik wobble: first, 50 %\nsigmaik wobble: second, 50 %\n"


@pytest.mark.parametrize("name", [n for n in STUDIES if n not in ("execute", "drill", "cart", "stress")])
def test_every_study_says_how_far_it_is(name, tmp_path):
    words = {
        "arrival": "--robot ur10 --trials 2 --time 0.5 --rate 100",
        "axis5": "--example 2 --dt 0.02",
        "limits": "--robot ur10 --rate 100 --seconds 1 --pace 0.02 --trials 1",
        "montecarlo": "--robot franka_panda --samples 2 --jobs 1 --objective none",
        "reach": "--robot ur10 --method dls --limits on --rate 50",
        "reaching": "--robot ur10 --tasks 2 --method straight",
        "solvers": "--trials 1 --solver PositionIk",
        "track": "--robot ur10 --target line --duration 5 --rate 200 --method jparse --mode predict,hold",
    }.get(name, "")
    args = runner.parsed(name, [*words.split(), "--out", str(tmp_path)])
    said, parts = [], []

    class Progress:
        def expect(self, total):
            parts.append([total, 0.0])

        def say(self, what):
            said.append(what)

        def advance(self, done=1.0):
            parts[-1][1] += done

    for experiment in study.find_study(name).load(args):
        study.find_study(name).run(experiment, Progress())
    assert said
    for total, done in parts:
        assert 0.5 * total <= done <= 1.5 * total


def test_plain_table():
    table = report.Table("a title", "name")
    table.add_numbers("long\nhead")
    table.add_column("words", wrap=True)
    table.add_row("one", report.red("1.25", True), "a " * 40)
    table.add_row("two", end_section=True)
    lines = str(table).splitlines()
    assert lines[:3] == ["a title", "     long", "name head words"]
    assert lines[4].startswith("one  1.25 a a a")
    assert max(map(len, lines)) <= 80
    assert lines[-1] == "two"


def test_hidden_spelling_of_no_plot():
    assert runner.parsed("axis5", ["--example", "1", "--no-plots"]).no_plot
    assert "--no-plots" not in options_of("axis5").format_help()
