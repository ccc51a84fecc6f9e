"""The worked example of a rule in CONTRIBUTING.md, as it stands: two files, and the library has the rule."""

import pathlib
import re
import shutil
import subprocess
import textwrap

import pytest

ROOT = pathlib.Path(__file__).parents[2]
EIGEN = pathlib.Path("/usr/include/eigen3")
USE = """
#include <sigmaik/velocity_solver.hpp>
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
"""


@pytest.mark.skipif(shutil.which("c++") is None or not EIGEN.exists(), reason="needs a compiler and Eigen")
def test_the_rule_of_the_example_is_two_files(tmp_path):
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    name, block = re.search(r"For example, `rules/(\w+\.hpp)`:\n\n   ```cpp\n(.*?)   ```", text, re.S).groups()
    include = tmp_path / "include"
    shutil.copytree(ROOT / "cpp" / "include", include)
    (include / "sigmaik" / "rules" / name).write_text(textwrap.dedent(block), encoding="utf-8")
    rules = include / "sigmaik" / "rules.hpp"
    listed = rules.read_text(encoding="utf-8")
    for old, new in (
        ("#include <sigmaik/rules/rule.hpp>", f"#include <sigmaik/rules/{name}>\n#include <sigmaik/rules/rule.hpp>"),
        ("using Rules = TypeList<", "using Rules = TypeList<JacobianTranspose, "),
    ):
        assert listed.count(old) == 1
        listed = listed.replace(old, new)
    rules.write_text(listed, encoding="utf-8")
    use = tmp_path / "use.cpp"
    use.write_text(USE, encoding="utf-8")
    command = [
        "c++",
        "-std=c++20",
        "-fsyntax-only",
        "-Wall",
        "-Wextra",
        "-Werror",
        f"-I{include}",
        f"-isystem{EIGEN}",
        use,
    ]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
