"""What an import loads, and what a missing package says."""

import pathlib
import re
import subprocess
import sys

import numpy as np
import pytest

import sigmaik as sk
from sigmaik import _extras

_LOADED = "import sys; import {module}; print('\\n'.join(sys.modules))"


def _modules(module):
    done = subprocess.run(
        [sys.executable, "-c", _LOADED.format(module=module)], capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


def test_import_loads_numpy_and_no_command_line():
    ours = _modules("sigmaik") - _modules("numpy")
    tops = {name.partition(".")[0] for name in ours}
    assert "sigmaik" in tops
    assert tops <= {"sigmaik", "numpy"} | set(sys.stdlib_module_names)
    assert not tops & {"argparse", "sigmaik_lab", "concurrent", "multiprocessing", "webbrowser", "xml", "http"}


def test_library_knows_nothing_of_the_laboratory():
    files = list(pathlib.Path(sk.__file__).parent.rglob("*.py"))
    assert len(files) > 20
    for file in files:
        assert not re.search(r"sigmaik_lab|\bimport (argparse|rich)\b|from rich", file.read_text(encoding="utf-8")), (
            file
        )


def test_planning_and_figures_make_no_circle():
    ours = _modules("sigmaik.planning")
    assert not {
        name for name in ours if name.startswith(("matplotlib", "sigmaik.planning.figure", "sigmaik._plotting"))
    }


def test_missing_package_says_a_command_that_works():
    with pytest.raises(
        sk.Error, match=r"^no_such_module is not installed; pip install no_such_module brings it$"
    ) as info:
        _extras.need("numpy", "no_such_module")
    assert isinstance(info.value, ImportError)
    with pytest.raises(
        _extras.MissingPackage, match=r"are not installed; pip install no_such_a no_such_b brings them$"
    ):
        _extras.need("no_such_a", "no_such_b")
    _extras.need("numpy")


def test_missing_package_is_found_missing_where_the_import_is_blocked(monkeypatch):
    class Blocker:
        def find_spec(self, name, path=None, target=None):
            if name == "mujoco":
                raise ModuleNotFoundError(name)

    monkeypatch.setattr(sys, "meta_path", [Blocker(), *sys.meta_path])
    monkeypatch.delitem(sys.modules, "mujoco", raising=False)
    with pytest.raises(_extras.MissingPackage, match=r"pip install 'mujoco>=3'"):
        _extras.need("mujoco")


def test_open_takes_names_and_files(tmp_path):
    arm = sk.robots.open("ur10")
    assert (arm.name, arm.path) == ("ur10", sk.robots.path("ur10"))
    np.testing.assert_array_equal(arm.home, sk.robots.home("ur10"))
    file = tmp_path / "mine.urdf"
    file.write_text(sk.robots.path("ur10").read_text(encoding="utf-8"), encoding="utf-8")
    mine = sk.robots.open(file, tip="flange")
    assert (mine.name, mine.path) == ("mine", file)
    assert mine.chain.joint_names == arm.chain.joint_names
    sigma = np.linalg.svd(mine.chain.jacobian(mine.home), compute_uv=False)
    assert sigma[-1] > 0.02 * sigma[0]
    with pytest.raises(ValueError, match="no shipped arm and no URDF file 'nobody'"):
        sk.robots.open("nobody")
