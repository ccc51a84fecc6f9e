#!/usr/bin/env bash
# Builds and runs the consumer project tests/install twice: against an installed copy of the given build tree, by
# find_package, and against the sources, by add_subdirectory. check_install.sh BUILD_DIR
set -euo pipefail
cd "$(dirname "$0")/.."
build=$1
prefix=$PWD/build/install/prefix
robot=python/sigmaik/robots/ufactory_xarm7.urdf

# The compiler and the warnings of the build tree: then ccache, where there is one, compiles nothing twice.
cached() { sed -n "s/^$1:[A-Z]*=//p" "$build/CMakeCache.txt"; }
options=(-G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_COMPILER="$(cached CMAKE_CXX_COMPILER)")

rm -rf "$prefix"
cmake --install "$build" --prefix "$prefix" >/dev/null
cmake -S tests/install -B build/install/find_package "${options[@]}" -DCMAKE_PREFIX_PATH="$prefix" >/dev/null
cmake --build build/install/find_package
echo -n "find_package: " && build/install/find_package/controller "$robot"

cmake -S tests/install -B build/install/add_subdirectory "${options[@]}" \
      -DSIGMAIK_SOURCE_DIR="$PWD" -DSIGMAIK_WERROR="$(cached SIGMAIK_WERROR)" >/dev/null
cmake --build build/install/add_subdirectory
echo -n "add_subdirectory: " && build/install/add_subdirectory/controller "$robot"
