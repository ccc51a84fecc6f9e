"""The command line."""

from __future__ import annotations

import csv
import importlib.util
import pathlib
import subprocess
import sys

import numpy as np
import pytest

import sigmaik as sk
from sigmaik_lab.__main__ import main

WAYPOINTS = "x,y,z,roll,pitch,yaw,duration\n0.4,0,0.4,3.14159265,0,0,1\n0.5,0.1,0.3,3.14159265,0,0,1\n"


@pytest.fixture
def waypoints(tmp_path):
    file = tmp_path / "way.csv"
    file.write_text(WAYPOINTS)
    return str(file)


def refused(capsys, *arguments):
    """The line on stderr of a command that must be refused."""
    assert main(list(arguments)) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("sigmaik: ")
    assert captured.err.count("\n") == 1
    return captured.err


def test_version(capsys):
    with pytest.raises(SystemExit) as exit_:
        main(["--version"])
    assert exit_.value.code == 0
    assert capsys.readouterr().out == f"sigmaik {sk.__version__}\n"


@pytest.mark.parametrize(
    "arguments", [[], ["reach", "--help"], ["limits", "--help"], ["cart", "--help"], ["info", "--help"]]
)
def test_help(capsys, arguments):
    with pytest.raises(SystemExit) as exit_:
        main(arguments)
    captured = capsys.readouterr()
    assert exit_.value.code == (0 if arguments else 2)
    assert "usage: sigmaik" in captured.out + captured.err


def test_robots(capsys):
    assert main(["robots"]) == 0
    out = capsys.readouterr().out
    for name in sk.robots.names():
        assert name in out
    assert "wrist-lock" in out


@pytest.mark.parametrize("robot", sk.robots.names())
def test_info(capsys, robot):
    assert main(["info", robot, "--samples", "50"]) == 0
    out = capsys.readouterr().out
    chain = sk.robots.load(robot)
    for joint in chain.joint_names:
        assert joint in out
    sigma = np.linalg.svd(chain.jacobian(sk.robots.home(robot)), compute_uv=False)
    assert f"σ_min/σ_max: {sigma[-1] / sigma[0]:.4g}" in out


def test_info_of_a_file_at_a_configuration(capsys):
    file = str(sk.robots.path("puma560"))
    assert main(["info", file, "--tip", "link_3", "--q=-0.1,0.2,0", "--samples", "10"]) == 0
    out = capsys.readouterr().out
    assert "3 joints from 'base' to 'link_3'" in out
    # 0.67183 to the shoulder and 0.4318 to the elbow
    assert "at most 1.104 m" in out


def test_info_reach_of_a_prismatic_arm(capsys, tmp_path):
    file = tmp_path / "slide.urdf"
    file.write_text(
        '<robot name="slide"><link name="a"/><link name="b"/><joint name="j" type="prismatic">'
        '<parent link="a"/><child link="b"/><origin xyz="0 0 0.5"/><axis xyz="0 0 1"/>'
        '<limit lower="0" upper="0.3" velocity="1" effort="1"/></joint></robot>'
    )
    assert main(["info", str(file), "--samples", "10"]) == 0
    assert "at most 0.800 m" in capsys.readouterr().out


def test_reach(capsys, tmp_path, waypoints):
    out = tmp_path / "out"
    assert main(["reach", "--path", waypoints, "--method", "jparse,dls:damping=0.8", "--out", str(out)]) == 0
    printed = capsys.readouterr().out.splitlines()
    png = pathlib.Path(printed[-1])
    assert png == out / "ufactory_xarm7-way.png"
    assert png.read_bytes().startswith(b"\x89PNG")
    assert max(map(len, printed[:-3])) <= 80
    assert sum("(0.5,0.1,0.3)" in line for line in printed) == 4  # two methods, limits off and on
    with (out / "ufactory_xarm7-way.csv").open(newline="") as stream:
        table = list(csv.DictReader(stream))
    assert len(table) == 8
    assert {row["velocity_limits"] for row in table} == {"True", "False"}
    assert len(list(out.glob("*.npz"))) == 4
    with np.load(out / "ufactory_xarm7-way-dls_damping_0.8-limits.npz") as data:
        assert data["t"].shape == (100,)
        assert bool(data["velocity_limits"])


def test_reach_with_every_option(capsys, tmp_path, waypoints):
    out = tmp_path / "out"
    arguments = (
        "--robot ufactory_xarm7 --base link_base --tip link7 --method all --limits on --rate 25 "
        "--gain-linear 2 --gain-angular 3 --max-position-error 0.2 --max-orientation-error 0.5 "
        "--gamma 0.05 --singular-gain 2 --posture zero --posture-gain 1 --posture-max-speed 0.6 "
        "--length-scale 0.5 --start home --format csv --no-plot"
    )
    assert main(["reach", "--path", waypoints, "--out", str(out), *arguments.split()]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == str(out / "ufactory_xarm7-way.csv")
    assert len(list(out.glob("*.csv"))) == 1 + 8
    assert not list(out.glob("*.png"))
    header = (out / "ufactory_xarm7-way-jparse-limits.csv").read_text().splitlines()
    assert header[0].startswith("t,segment,q_joint1")
    assert len(header) == 1 + 50


def test_reach_sweeps_the_singular_gain(capsys, tmp_path, waypoints):
    out = tmp_path / "out"
    arguments = ["--gains", "0.5,2", "--limits", "off", "--format", "none", "--out", str(out)]
    assert main(["reach", "--path", waypoints, *arguments]) == 0
    printed = capsys.readouterr().out
    assert "jparse gain 0.5" in printed
    assert "jparse gain 2" in printed
    assert printed.splitlines()[-1].endswith("way-gains.png")
    assert not list(out.glob("*.npz"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--robot", "nobody"], "no shipped arm and no URDF file 'nobody'"),
        (
            ["--path", "moon"],
            "no path 'moon' for 'ufactory_xarm7', and no such file; there are extended-line",
        ),
        (["--path", "moon.csv"], "moon.csv': No such file"),
        (["--method", "magic"], "unknown method 'magic'"),
        (["--method", "dls:damping=-1"], "method 'dls:damping=-1'"),
        (["--posture", "1,2"], "--posture has 2 values, but the arm has 7 joints"),
        (["--start", "1,x"], "--start is a comma list of numbers; 'x' is none"),
        (["--gains", "1,,2"], "--gains is a comma list of numbers"),
        (["--rate", "0"], "rate must be positive"),
        (["--posture-gain", "-1"], "posture_gain"),
        (["--tip", "hand"], "hand"),
    ],
)
def test_reach_refuses(capsys, arguments, message):
    assert message in refused(capsys, "reach", *arguments)


def test_limits(capsys, tmp_path):
    out = tmp_path / "out"
    arguments = "--robot franka_panda --rate 250 --seconds 2 --pace 0.1 --trials 1 --seed 3 --jerk 5000 --format npz"
    assert main(["limits", "--out", str(out), *arguments.split()]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[-1] == str(out / "franka_panda-limits.csv")
    assert len([line for line in printed if line.startswith("picture: ")]) == 3
    assert max(len(line) for line in printed if not line.startswith(("picture:", "time series:", str(out)))) <= 100
    assert len(list(out.glob("*.png"))) == 3
    assert len(list(out.glob("*.npz"))) == 15
    with (out / "franka_panda-limits.csv").open(newline="") as stream:
        table = list(csv.DictReader(stream))
    assert len(table) == 15
    for row in table:
        assert row["non_finite"] == "0"
        if row["variant"] in ("redistribute", "position first", "scale"):
            assert {row[f"{kind}_broken"] for kind in ("position", "speed", "acceleration", "jerk")} == {"0"}


def test_limits_without_pictures(capsys, tmp_path):
    arguments = "--robot ur10 --method dls:damping=0.2 --rate 200 --seconds 1 --pace 0.05 --trials 1 --no-plot"
    assert main(["limits", "--out", str(tmp_path), *arguments.split()]) == 0
    assert "came" in capsys.readouterr().out
    assert [file.name for file in tmp_path.iterdir()] == ["ur10-limits.csv"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--robot", "nobody"], "no shipped arm"),
        (["--method", "magic"], "unknown method"),
        (["--rate", "0"], "rate must be positive"),
        (["--trials", "0"], "trials must be positive"),
        (["--jerk", "-1"], "jerk must be positive"),
    ],
)
def test_limits_refuses(capsys, arguments, message):
    assert message in refused(capsys, "limits", *arguments)


def test_info_refuses(capsys, tmp_path):
    assert "nobody" in refused(capsys, "info", "nobody")
    assert "--q has 1 values" in refused(capsys, "info", "ur10", "--q", "1")
    assert "--samples" in refused(capsys, "info", "ur10", "--samples", "0")
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot")
    assert "broken.urdf" in refused(capsys, "info", str(broken))


def test_output_folder_that_cannot_be(capsys, tmp_path, waypoints):
    (tmp_path / "file").write_text("")
    out = str(tmp_path / "file" / "out")
    assert main(["reach", "--path", waypoints, "--method", "dls", "--out", out]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(("package", "arguments"), [("mujoco", ["execute", "--no-plot"]), ("matplotlib", ["reach"])])
def test_missing_extras_are_named(capsys, monkeypatch, package, arguments):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == package else find(name))
    hint = {"mujoco": "'mujoco>=3'"}.get(package, package)
    assert refused(capsys, *arguments) == f"sigmaik: {package} is not installed; pip install {hint} brings it\n"


def test_a_closed_pipe_is_no_error():
    command = f"{sys.executable} -m sigmaik_lab info ur10 --samples 10 | true"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert done.stderr == ""
