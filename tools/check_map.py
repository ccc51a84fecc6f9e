"""Checks that the map of the headers in sigmaik.hpp is true: check_map.py [INCLUDE_DIRECTORY].

The map has a line for each public header, NAME  WHAT IT HOLDS, in two sections: what sigmaik.hpp includes, and what it
does not. Each header needs only those above it. A NAME that ends in / is a directory, whose headers need no lines.
"""

import re
import sys
from pathlib import Path

INCLUDED = "Included here:"
BY_NAME = "To include by name:"


def map_lines(text: str) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """(header, what it holds) of both sections, in the map's order."""
    sections: dict[str, list[tuple[str, str]]] = {INCLUDED: [], BY_NAME: []}
    section = None
    for line in text.splitlines():
        words = line.removeprefix("///").strip()
        if words in sections:
            section = sections[words]
        elif not line.startswith("///    "):
            section = section if line.strip() == "///" else None
        elif section is not None:
            name, _, what = words.partition(" ")
            section.append((name, what.strip()))
    return sections[INCLUDED], sections[BY_NAME]


def findings(directory: Path) -> list[str]:
    """What is wrong with the map of directory/sigmaik/sigmaik.hpp."""
    root = directory / "sigmaik"
    headers = {p.relative_to(root).as_posix(): p.read_text(encoding="utf-8") for p in root.rglob("*.hpp")}
    umbrella = headers.pop("sigmaik.hpp")

    def includes(text: str) -> list[str]:
        return re.findall(r"^#include <sigmaik/(.*)>", text, re.MULTILINE)

    def reached(name: str, seen: set[str]) -> set[str]:
        if name not in seen:
            seen.add(name)
            for other in includes(headers.get(name, "")):
                reached(line_of(other), seen)
        return seen

    included, by_name = map_lines(umbrella)
    names = [name for name, _ in included + by_name]
    for name in [name for name in names if name.endswith("/")]:
        files = [header for header in headers if header.startswith(name)]
        if not files:
            continue  # there is no such header
        headers[name] = "\n".join(headers[file] for file in files)
        for file in files:
            del headers[file]

    def line_of(header: str) -> str:
        return next((name for name in names if name.endswith("/") and header.startswith(name)), header)

    found = [f"{name} has {names.count(name)} lines" for name in sorted(set(names)) if names.count(name) > 1]
    found += [f"{name} has no line" for name in sorted(set(headers) - set(names))]
    found += [f"{name} has a line, but there is no such header" for name in names if name not in headers]
    for above, (name, what) in enumerate(included + by_name):
        text = headers.get(name, "")
        needed = {line_of(i) for i in includes(text)} - {line_of(name)}
        found += [f"{name} needs {i}, which stands below it" for i in sorted(needed) if i not in names[:above]]
        declared = re.findall(r"[A-Za-z_][A-Za-z_0-9]+", what.partition(":")[0]) if ":" in what else []
        found += [f"{name} does not speak of {word}" for word in declared if not re.search(rf"\b{word}\b", text)]
        if not what:
            found.append(f"the line of {name} does not say what it holds")

    actual = includes(umbrella)
    found += [
        f"{name} is said to be included, and is not" for name, _ in included if name not in actual and name[-1] != "/"
    ]
    found += [f"{name} is included, and is said not to be" for name in actual if name not in dict(included)]
    everything: set[str] = set()
    for name in actual:
        reached(name, everything)
    found += [f"{name} is included through another header" for name, _ in by_name if name in everything - set(actual)]
    found += [f"{name} includes KDL" for name in sorted(everything) if "#include <kdl/" in headers.get(name, "")]
    return found


if __name__ == "__main__":
    include = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1] / "cpp" / "include"
    wrong = findings(include)
    for line in wrong:
        print(f"sigmaik.hpp: {line}")
    sys.exit(bool(wrong))
