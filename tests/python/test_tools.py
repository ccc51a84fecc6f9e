"""The checks of `make lint` find what they are for."""

import ast
import pathlib
import re
import shutil
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).parents[2]


def check(tool, directory):
    run = subprocess.run([sys.executable, ROOT / "tools" / tool, directory], capture_output=True, text=True)
    assert not run.stderr
    assert run.returncode == (1 if run.stdout else 0)
    return run.stdout


@pytest.fixture
def headers(tmp_path):
    shutil.copytree(ROOT / "cpp" / "include", tmp_path / "include")
    return tmp_path / "include"


def test_the_map_of_the_headers_is_true(headers):
    assert check("check_map.py", headers) == ""


@pytest.mark.parametrize(
    ("old", "new", "finding"),
    [
        ("///     task.hpp  ", "///     tusk.hpp  ", "task.hpp has no line"),
        ("///     task.hpp  ", "///     tusk.hpp  ", "tusk.hpp has a line, but there is no such header"),
        ("///     types.hpp  ", "///     chain.hpp  ", "chain.hpp has 2 lines"),
        ("///     types.hpp  ", "///     later.hpp  ", "chain.hpp needs types.hpp, which stands below it"),
        ("///     rules/  ", "///     roles/  ", "rules/jparse.hpp has no line"),
        ("Task: which", "Tusk: which", "task.hpp does not speak of Tusk"),
        ("#include <sigmaik/batch.hpp>\n", "", "batch.hpp is said to be included, and is not"),
        ("#include <sigmaik/task", "#include <sigmaik/kdl.hpp>\n#include <sigmaik/task", "kdl.hpp includes KDL"),
        ("#include <sigmaik/task", "#include <sigmaik/kdl.hpp>\n#include <sigmaik/task", "kdl.hpp is included, and is"),
    ],
)
def test_what_is_untrue_in_the_map_is_found(headers, old, new, finding):
    umbrella = headers / "sigmaik" / "sigmaik.hpp"
    text = umbrella.read_text(encoding="utf-8")
    assert old in text
    umbrella.write_text(text.replace(old, new), encoding="utf-8")
    assert finding in check("check_map.py", headers)


def test_a_header_that_comes_through_another_is_found(headers):
    task = headers / "sigmaik" / "task.hpp"
    task.write_text("#include <sigmaik/servo_loop.hpp>\n" + task.read_text(encoding="utf-8"), encoding="utf-8")
    found = check("check_map.py", headers)
    assert "servo_loop.hpp is included through another header" in found
    assert "task.hpp needs servo_loop.hpp, which stands below it" in found


def test_a_header_of_a_directory_that_needs_what_stands_below_it_is_found(headers):
    rule = headers / "sigmaik" / "rules" / "jparse.hpp"
    rule.write_text("#include <sigmaik/servo.hpp>\n" + rule.read_text(encoding="utf-8"), encoding="utf-8")
    assert "rules/ needs servo.hpp, which stands below it" in check("check_map.py", headers)


@pytest.fixture
def repository(tmp_path):
    for file in ("Makefile", "pyproject.toml", ".pre-commit-config.yaml", ".github/workflows/ci.yml"):
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, tmp_path / file)
    shutil.copytree(ROOT / "tools", tmp_path / "tools")
    return tmp_path


def test_workflows_and_hooks_say_what_there_is(repository):
    assert check("check_ci.py", repository) == ""


@pytest.mark.parametrize(
    ("file", "old", "new", "finding"),
    [
        ("Makefile", "test-tsan", "test-threads", "ci.yml: the Makefile has no target test-tsan"),
        (".github/workflows/ci.yml", "run: make lint", "run: make lynt", "the Makefile has no target lynt"),
        (".github/workflows/ci.yml", "jobs:", "jobs: [", "ci.yml: while parsing"),
        ("pyproject.toml", "ruff==", "ruff==0", "is not what pyproject.toml's extra lint says"),
        (
            ".pre-commit-config.yaml",
            "additional_dependencies: [codespell",
            "unused: [codespell",
            "no hook uses codespell",
        ),
        (".pre-commit-config.yaml", "tools/check_map.py", "tools/map.py", "there is no tools/map.py"),
    ],
)
def test_what_is_untrue_in_workflows_and_hooks_is_found(repository, file, old, new, finding):
    text = (repository / file).read_text(encoding="utf-8")
    assert old in text
    (repository / file).write_text(text.replace(old, new), encoding="utf-8")
    assert finding in check("check_ci.py", repository)


def test_a_stub_is_grouped_by_the_topics_of_the_bindings(tmp_path):
    stub = tmp_path / "_core.pyi"
    shutil.copy(ROOT / "python" / "sigmaik" / "_core.pyi", stub)
    before = stub.read_text(encoding="utf-8")

    def group():
        subprocess.run([sys.executable, ROOT / "tools" / "stub_sections.py", stub], check=True)
        return stub.read_text(encoding="utf-8")

    once = group()
    assert group() == once

    def content(text):
        return sorted(line for line in text.splitlines() if line and not line.startswith("# ----"))

    assert content(once) == content(before)
    ast.parse(once)
    sections = [section.split(" ---", 1) for section in once.split("# ---- ")[1:]]
    found = {
        name: title for title, text in sections for name in re.findall(r"^(?:class|def) (\w+)", text, re.MULTILINE)
    }
    assert found["Chain"] == found["Inertia"] == "Chain"
    assert found["JParse"] == found["PseudoInverse"] == "Methods"
    assert found["solve_batch"] == found["VelocitySolver"] == "Solver"
    assert "Other" not in found.values()
