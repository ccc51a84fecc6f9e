"""Groups a stub's classes and functions by topic: a section for each file of bindings/, in the order of module.cpp.

tools/stub_sections.py python/sigmaik/_core.pyi …    # in place

The title of a section is the comment behind the call in module.cpp (`bind_chain(m);  // The arm`), or else the file's
name. A name that no file of bindings/ binds goes with its base class, or else to the section "Other". Grouping a
grouped file changes nothing.
"""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path

BINDINGS = Path(__file__).parents[1] / "bindings"
RULE = "# ---- "


def topics(bindings: Path = BINDINGS) -> dict[str, str]:
    """The title of the section of every name that a file of bindings/ binds, in the order of module.cpp."""
    module = (bindings / "module.cpp").read_text(encoding="utf-8")
    titles: dict[str, str] = {}
    for part, comment in re.findall(r"^  bind_(\w+)\(m\);(?:  // (.+))?$", module, re.MULTILINE):
        file = bindings / f"bind_{part}.cpp"
        text = file.read_text(encoding="utf-8") if file.exists() else module
        for name in re.findall(r'\bm(?:\.def\(|\.attr\(|,)\s*"(\w+)"', text):
            titles.setdefault(name, comment or part.replace("_", " ").capitalize().replace(" ik", " IK"))
    return titles


def grouped(stub: str, titles: dict[str, str]) -> str:
    """The stub with a comment before each topic. What is neither class nor function stays in front."""
    lines = stub.splitlines()
    head: list[str] = []
    sections: dict[str, list[str]] = {title: [] for title in [*titles.values(), "Other"]}
    end = 0
    for node in ast.parse(stub).body:
        named = isinstance(node, ast.ClassDef | ast.FunctionDef)
        first = min([node.lineno, *(d.lineno for d in node.decorator_list)]) if named else node.lineno
        assert node.end_lineno is not None
        between = [line for line in lines[end : first - 1] if line.strip() and not line.startswith(RULE)]
        end = node.end_lineno
        text = between + lines[first - 1 : end]
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            bases = [ast.unparse(base) for base in getattr(node, "bases", [])]
            known = [titles[name] for name in [node.name, *bases] if name in titles]
            sections[known[0] if known else "Other"] += text
        else:
            head += text
    out = head
    for title, text in sections.items():
        if text:
            out += ["", RULE + title + " " + "-" * (113 - len(title)), *text]
    return "\n".join(out) + "\n"


def main(files: list[str]) -> None:
    titles = topics()
    for file in files:
        path = Path(file)
        path.write_text(grouped(path.read_text(encoding="utf-8"), titles), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
