"""Checks what a public CI and pre-commit are told: check_ci.py [REPOSITORY].

Each make target that a workflow names exists, each tool of pre-commit has the version of pyproject.toml's extra `lint`,
and each file that a hook runs is there.
"""

import re
import sys
from pathlib import Path

import yaml

if sys.version_info >= (3, 11):
    import tomllib
else:
    from pip._vendor import tomli as tomllib


def commands(node: object) -> list[str]:
    """Every `run` of a workflow."""
    if isinstance(node, dict):
        own = [node["run"]] if isinstance(node.get("run"), str) else []
        return own + [c for value in node.values() for c in commands(value)]
    return [c for value in node for c in commands(value)] if isinstance(node, list) else []


def workflow_findings(path: Path, targets: set[str]) -> list[str]:
    try:
        workflow = yaml.safe_load(path.read_text(encoding="utf-8"))
    except yaml.YAMLError as error:
        return [f"{path.name}: {error}"]
    if not isinstance(workflow, dict) or "jobs" not in workflow:
        return [f"{path.name}: no jobs"]
    # YAML 1.1 reads the key `on` as true.
    found = [] if {"on", True} & set(workflow) else [f"{path.name}: nothing starts it"]
    named = [word for command in commands(workflow["jobs"]) for word in make_targets(command)]
    found += [f"{path.name}: the Makefile has no target {word}" for word in named if word not in targets]
    return found if named else [*found, f"{path.name}: calls no make target"]


def make_targets(command: str) -> list[str]:
    """The targets of `make TARGET… NAME=VALUE…` in a shell command."""
    found = []
    for call in re.findall(r"^\s*make\b([^\n;&|#]*)", re.sub(r"\$\{\{.*?\}\}", "VALUE", command), re.MULTILINE):
        found += [word for word in call.split() if "=" not in word and not word.startswith("-")]
    return found


def hook_findings(repository: Path) -> list[str]:
    file = ".pre-commit-config.yaml"
    config = yaml.safe_load((repository / file).read_text(encoding="utf-8"))
    project = tomllib.loads((repository / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    pinned = project["optional-dependencies"]["lint"]
    hooks = [hook for repo in config["repos"] for hook in repo["hooks"]]
    wanted = [dependency for hook in hooks for dependency in hook.get("additional_dependencies", [])]
    found = [f"{file}: {w} is not what pyproject.toml's extra lint says" for w in wanted if w not in pinned]
    found += [f"{file}: no hook uses {p}" for p in pinned if "==" in p and p not in wanted]
    scripts = [word for hook in hooks for word in hook["entry"].split() if word.startswith("tools/")]
    return found + [f"{file}: there is no {s}" for s in scripts if not (repository / s).is_file()]


def findings(repository: Path) -> list[str]:
    makefile = (repository / "Makefile").read_text(encoding="utf-8")
    targets = {word for line in re.findall(r"^([a-z][a-z -]*):(?!=)", makefile, re.MULTILINE) for word in line.split()}
    workflows = sorted((repository / ".github" / "workflows").glob("*.y*ml"))
    found = [] if workflows else ["no workflow in .github/workflows"]
    for path in workflows:
        found += workflow_findings(path, targets)
    return found + hook_findings(repository)


if __name__ == "__main__":
    wrong = findings(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1])
    for line in wrong:
        print(line)
    sys.exit(bool(wrong))
