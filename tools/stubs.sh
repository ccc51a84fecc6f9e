#!/usr/bin/env bash
# Writes python/sigmaik/_core.pyi, _rules.py and planning/_options.py from the module installed in .venv, or with --check
# compares them.
set -euo pipefail
cd "$(dirname "$0")/.."
out=build/stubs
rm -rf "$out"
mkdir -p "$out/sigmaik/planning"
.venv/bin/python -m pybind11_stubgen sigmaik._core --output-dir "$out" --exit-code

# What pybind11-stubgen does not know: how a stub spells the members of an enum, that an enum's methods are Enum's (and
# differ from one Python to the next), and that CMakeLists.txt is the only place with the version.
sed -zEi '
  s/\n    ([A-Z_]+): typing\.ClassVar\[\w+\]/\n    \1 = .../g
  s/(\n    [A-Z_]+ = \.\.\.\n)((    @\w+\n)*    def [^\n]*\n(        [^\n]*\n)+)+/\1/g
  s/\n__version__: str = [^\n]*/\n__version__: str/
  s/__hash__: typing\.ClassVar\[None\] = None\n/__hash__: typing.ClassVar[None] = None  # type: ignore[assignment]\n/g
  s/\(self, arg0: tuple\)/(self, arg0: tuple[typing.Any, ...])/g
  s/ -> tuple:\n/ -> tuple[typing.Any, ...]:\n/g
  s/ +\n/\n/g' "$out/sigmaik/_core.pyi"
# Both files in sections by topic: the order in which branches were merged makes no difference.
.venv/bin/python tools/stub_sections.py "$out/sigmaik/_core.pyi" python/sigmaik/_core.pyi

.venv/bin/python - > "$out/sigmaik/_rules.py" <<'EOF'
from sigmaik import _core

names = sorted((rule.__name__ for rule in _core.rules()), key=str.casefold)
print('"""The classes of the rules, as sigmaik::Rules lists them. Written by `make stubs`."""\n')
print("from ._core import (", *(f"    {name}," for name in names), ")", "", sep="\n")
print("__all__ = [", *(f'    "{name}",' for name in names), "]", sep="\n")
EOF

.venv/bin/python - > "$out/sigmaik/planning/_options.py" <<'EOF'
import textwrap

from sigmaik import _core

print('"""The planners\' options by keyword, as the C++ structs of the same names have them. Written by `make stubs`."""\n')
print("from __future__ import annotations\n\nimport typing\n\nimport numpy.typing\n")
tables = _core.planner_options()
print("__all__ = [", *(f'    "{name}",' for name in tables), "]", sep="\n")
for name, table in tables.items():
    print(f'\n\nclass {name}(typing.TypedDict, total=False):\n    """Each option that is left out has its default."""\n')
    for keyword, annotation, default, doc in table:
        text = textwrap.fill(f'"""{doc} Default: {default}."""', 116)
        print(textwrap.indent(f"{keyword}: {annotation}\n{text}", "    "))
EOF

for file in _core.pyi _rules.py planning/_options.py; do
  if [[ ${1:-} != --check ]]; then
    cp "$out/sigmaik/$file" "python/sigmaik/$file"
  elif ! diff -u "python/sigmaik/$file" "$out/sigmaik/$file"; then
    echo "python/sigmaik/$file is not what the module says: run make stubs, and commit it" >&2
    exit 1
  fi
done
