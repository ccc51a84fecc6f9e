"""Prints the packages that pyproject.toml asks for: requirements.py build | EXTRA."""

import re
import sys
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    from pip._vendor import tomli as tomllib


def requirements(what: str) -> list[str]:
    config = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))
    if what == "build":
        return config["build-system"]["requires"] + config["project"]["dependencies"]
    project = config["project"]

    def resolve(extra: str) -> list[str]:
        found: list[str] = []
        for requirement in project["optional-dependencies"][extra]:
            own = re.fullmatch(project["name"] + r"\[(.*)\]", requirement)
            found += [r for e in own[1].split(",") for r in resolve(e)] if own else [requirement]
        return found

    return project["dependencies"] + resolve(what)


print("\n".join(requirements(sys.argv[1])))
