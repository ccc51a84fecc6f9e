#!/usr/bin/env bash
# Writes python/sigmaik/_core.pyi from the module installed in .venv, or with --check compares the two.
set -euo pipefail
cd "$(dirname "$0")/.."
out=build/stubs
rm -rf "$out"
.venv/bin/python -m pybind11_stubgen sigmaik._core --output-dir "$out" --exit-code

# What pybind11-stubgen does not know: how a stub spells the members of an enum, that an enum's methods are Enum's (and
# differ from one Python to the next), and that CMakeLists.txt is the only place with the version.
sed -zEi '
  s/\n    ([A-Z_]+): typing\.ClassVar\[\w+\]/\n    \1 = .../g
  s/(\n    [A-Z_]+ = \.\.\.\n)((    @\w+\n)*    def [^\n]*\n(        [^\n]*\n)+)+/\1/g
  s/\n__version__: str = [^\n]*/\n__version__: str/
  s/ +\n/\n/g' "$out/sigmaik/_core.pyi"
# Both files in sections by topic: the order in which branches were merged makes no difference.
.venv/bin/python tools/stub_sections.py "$out/sigmaik/_core.pyi" python/sigmaik/_core.pyi

if [[ ${1:-} == --check ]]; then
  if ! diff -u python/sigmaik/_core.pyi "$out/sigmaik/_core.pyi"; then
    echo "python/sigmaik/_core.pyi is not what the module says: run make stubs, and commit it" >&2
    exit 1
  fi
else
  cp "$out/sigmaik/_core.pyi" python/sigmaik/_core.pyi
fi
