"""The worked examples of CONTRIBUTING.md, as they stand: as many files as the page says, and the library has it all."""

import importlib.util
import pathlib
import re
import shutil
import subprocess
import sysconfig
import textwrap

import numpy as np
import pytest

import sigmaik as sk
from sigmaik.planning import costs

ROOT = pathlib.Path(__file__).parents[2]
EIGEN = pathlib.Path("/usr/include/eigen3")
PYTHON = pathlib.Path(sysconfig.get_paths()["include"])
needs_compiler = pytest.mark.skipif(
    shutil.which("c++") is None or not EIGEN.exists(), reason="needs a compiler and Eigen"
)
# One file for the rule, the option and the Python name of the status: the headers are most of the compiler's work.
USE = """
#include <pybind11/native_enum.h>
#include <string_view>
#include <sigmaik/servo.hpp>
#include <sigmaik/velocity_solver.hpp>
#include "servo_options.hpp"
using namespace sigmaik;
static_assert(Rule<JacobianTranspose> && std::is_convertible_v<JacobianTranspose, Method>);
constexpr bool listed = [] {
  bool found = false;
  Rules::for_each([&]<typename R>(const R&) { found = found || std::is_same_v<R, JacobianTranspose>; });
  return found;
}();
static_assert(listed);
Solution solve(const TaskJacobian& j, const TaskVector& x) {
  return VelocitySolver(JacobianTranspose{.alpha = 0.5}).solve(j, x);
}
constexpr bool told = std::apply(
    [](const auto&... fields) {
      const auto is_it = [](const auto& f) {
        if constexpr (requires { f.name; }) return std::string_view(f.name) == "hand_speed";
        return false;
      };
      return (is_it(fields) || ...);
    },
    bindings::Fields<ServoOptions>::all);
static_assert(told);
double speed(const ServoOptions& options) { return options.hand_speed; }
namespace py = pybind11;
void bind(py::module_& m) {
  BINDING
}
"""
USE_OF_STATUS = """
#include <cstring>
#include <sigmaik/status.hpp>
using sigmaik::Status;
static_assert(Status::Limited < Status::Waiting && Status::Waiting < Status::Holding);
static_assert(Status::Holding < Status::BadInput);
int main() { return std::strcmp(sigmaik::to_string(Status::Waiting), "waiting"); }
"""


def page():
    return (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def blocks(heading, language):
    """The code blocks below a heading of the page."""
    section = page().split(f"### {heading}")[1].split("\n### ")[0].split("\n## ")[0]
    return re.findall(rf"^```{language}\n(.*?)^```", section, re.S | re.M)


def tree(tmp_path):
    """A copy of the headers and bindings."""
    for folder in ("cpp/include", "bindings"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    (tmp_path / "cpp/src").mkdir()
    shutil.copy(ROOT / "cpp/src/status.cpp", tmp_path / "cpp/src")
    return tmp_path


def put(file, *changes):
    text = file.read_text(encoding="utf-8")
    for old, new in changes:
        assert text.count(old) == 1, (file, old)
        text = text.replace(old, new)
    file.write_text(text, encoding="utf-8")


def compiles(root, source, *options):
    command = ["c++", "-std=c++20", "-Wall", "-Wextra", "-Werror", f"-I{root / 'cpp/include'}", f"-isystem{EIGEN}"]
    run = subprocess.run([*command, *options, source], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr


def with_bindings(root):
    """Options of the compiler for a file of the bindings."""
    pybind11 = pytest.importorskip("pybind11")
    if not (PYTHON / "Python.h").exists():
        pytest.skip("needs the headers of Python")
    version = '-DSIGMAIK_VERSION="0"'
    return [f"-I{root / 'bindings'}", f"-isystem{PYTHON}", f"-isystem{pybind11.get_include()}", version]


def add_rule(root):
    """Two files."""
    name, block = re.search(r"For example, `rules/(\w+\.hpp)`:\n\n   ```cpp\n(.*?)   ```", page(), re.S).groups()
    include = root / "cpp/include/sigmaik"
    (include / "rules" / name).write_text(textwrap.dedent(block), encoding="utf-8")
    put(
        include / "rules.hpp",
        ("#include <sigmaik/rules/rule.hpp>", f"#include <sigmaik/rules/{name}>\n#include <sigmaik/rules/rule.hpp>"),
        ("using Rules = TypeList<", "using Rules = TypeList<JacobianTranspose, "),
    )


def add_option(root):
    """Two files."""
    member, field = blocks("An option of the servo", "cpp")
    put(root / "cpp/include/sigmaik/servo.hpp", ("struct ServoOptions {\n", f"struct ServoOptions {{\n{member}"))
    table = "struct Fields<ServoOptions> {\n  static constexpr std::tuple all{\n"
    put(root / "bindings/servo_options.hpp", (table, table + field))


def add_status(root):
    """Three files."""
    value, text, name = blocks("A status", "cpp")
    put(
        root / "cpp/include/sigmaik/status.hpp",
        ("  Holding = 3,", f"{value}  Holding = 4,"),
        ("BadInput = 4,", "BadInput = 5,"),
    )
    put(root / "cpp/src/status.cpp", ("    case Status::Holding:", f"{text}    case Status::Holding:"))
    put(root / "bindings/module.cpp", ('.value("HOLDING"', f'{name}.value("HOLDING"'))


@needs_compiler
def test_the_examples_of_rule_option_and_status_compile(tmp_path):
    root = tree(tmp_path)
    for add in (add_rule, add_option, add_status):
        add(root)
    module = (root / "bindings/module.cpp").read_text(encoding="utf-8")
    (binding,) = re.findall(r"py::native_enum<Status>.*?\.finalize\(\);", module, re.S)
    assert '"WAITING"' in binding
    use = tmp_path / "use.cpp"
    use.write_text(USE.replace("BINDING", binding), encoding="utf-8")
    compiles(root, use, "-fsyntax-only", *with_bindings(root))


@needs_compiler
def test_the_status_of_the_example_has_its_text_and_its_place(tmp_path):
    root = tree(tmp_path)
    add_status(root)
    use = tmp_path / "use.cpp"
    use.write_text(USE_OF_STATUS, encoding="utf-8")
    compiles(root, use, str(root / "cpp/src/status.cpp"), "-o", str(tmp_path / "use"))
    assert subprocess.run([tmp_path / "use"]).returncode == 0


def test_the_cost_of_the_example_is_a_file_and_a_name_in_a_list(tmp_path):
    (block,) = blocks("A cost of the planners", "python")
    file = tmp_path / "height.py"
    file.write_text(block, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(f"{costs.__name__}.height", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    chain = sk.robots.load("ur10")
    _, (bound,) = (2.0 * module.Height(weight=3.0)).bind(chain)
    rng = np.random.default_rng(1)
    q = rng.uniform(-1.0, 1.0, (5, 6))
    np.testing.assert_allclose(bound.value(q), [6.0 * chain.pose(row)[2, 3] for row in q])
    step = 1e-6
    for j in range(6):
        ahead, behind = q.copy(), q.copy()
        ahead[:, j] += step
        behind[:, j] -= step
        expected = (bound.value(ahead) - bound.value(behind)) / (2.0 * step)
        np.testing.assert_allclose(bound.gradient(q)[:, j], expected, atol=1e-8)
    plan = sk.planning.gradient(chain, q[0], q[1], cost=module.Height())
    assert np.isfinite(plan.q).all()
