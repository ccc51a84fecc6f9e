#!/usr/bin/env bash
# Installs the Debian or Ubuntu packages that the build needs and that are missing: setup_system.sh [PYTHON [COMMAND…]].
# The commands are needed, too, from packages of the same name; libfuzzer stands for clang's fuzzer.
# Says nothing where all is there.
set -euo pipefail
python=${1:-python3}
shift || true

need() { command -v "$1" >/dev/null || missing+=("${2:-$1}"); }
missing=()

need g++
need cmake
need ninja ninja-build
need ccache
for command in "$@"; do
  if [[ $command == libfuzzer ]]; then  # a package with clang's version in its name; needs clang
    echo 'extern "C" int LLVMFuzzerTestOneInput(const char*, unsigned long) { return 0; }' |
      clang++ -x c++ -fsanitize=fuzzer,address -o /dev/null - 2>/dev/null ||
      missing+=("libclang-rt-$(clang++ -dumpversion | cut -d. -f1)-dev")
  else
    need "$command"
  fi
done

libraries=(libeigen3-dev liborocos-kdl-dev liburdfdom-dev libconsole-bridge-dev libtinyxml2-dev
           doctest-dev libbenchmark-dev)
if command -v dpkg-query >/dev/null; then
  installed=$(dpkg-query -W -f '${db:Status-Abbrev} ${Package}\n' "${libraries[@]}" 2>/dev/null || true)
  for library in "${libraries[@]}"; do
    grep -qx "ii  $library" <<<"$installed" || missing+=("$library")
  done
fi

if [[ ! -x .venv/bin/python ]]; then
  if ! command -v "$python" >/dev/null; then
    missing+=("$python" "$python-venv" "$python-dev")
  elif ! "$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))'; then
    echo "sigmaik needs Python 3.10 or later, and $python is $("$python" --version): use make PYTHON=python3.X" >&2
    exit 1
  else
    # Debian splits these off; other builds of Python have them.
    version=$("$python" -c 'import sys; print("python%d.%d" % sys.version_info[:2])')
    "$python" -c 'import ensurepip, venv' 2>/dev/null || missing+=("$version-venv")
    "$python" -c 'import os, sys, sysconfig
sys.exit(not os.path.exists(sysconfig.get_path("include") + "/Python.h"))' || missing+=("$version-dev")
  fi
fi

((${#missing[@]})) || exit 0

sudo=()
((EUID == 0)) || sudo=(sudo)
if ! command -v apt-get >/dev/null || ! command -v "${sudo[@]:-env}" >/dev/null; then
  echo "sigmaik needs packages that cannot be installed from here (no apt-get, or neither root nor sudo):" \
       "${missing[*]}" >&2
  exit 1
fi
echo "installing ${missing[*]}"
export DEBIAN_FRONTEND=noninteractive
"${sudo[@]}" apt-get update -qq
"${sudo[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}"
