#!/usr/bin/env bash
# Writes python/sigmaik/_core.pyi from the module installed in .venv, or with --check compares the two.
set -euo pipefail
cd "$(dirname "$0")/.."
out=build/stubs
rm -rf "$out"
.venv/bin/python -m pybind11_stubgen sigmaik._core --output-dir "$out" --exit-code
sed -i "s/^__version__: str = .*/__version__: str/" "$out/sigmaik/_core.pyi"  # CMakeLists.txt has the version

if [[ ${1:-} == --check ]]; then
  if ! diff -ru python/sigmaik/_core.pyi "$out/sigmaik/_core.pyi"; then
    echo "python/sigmaik/_core.pyi is not what the module says: run make stubs, and commit it" >&2
    exit 1
  fi
else
  cp "$out/sigmaik/_core.pyi" python/sigmaik/_core.pyi
fi
