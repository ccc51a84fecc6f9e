#!/usr/bin/env bash
# Builds and runs the consumer project tests/install: against an installed copy of the given build tree, by find_package
# and by pkg-config, and against the sources, by add_subdirectory. Then with the flags that controllers are built with,
# by every compiler that is found: the answers must be those of the plain program, to 1e-9. Last, programs whose types
# differ from the library's, which must not link. check_install.sh BUILD_DIR
set -euo pipefail
cd "$(dirname "$0")/.."
build=$1
prefix=$PWD/build/install/prefix
robot=python/sigmaik/robots/ufactory_xarm7.urdf
panda=python/sigmaik/robots/franka_panda.urdf

# The compiler and the warnings of the build tree: then ccache, where there is one, compiles nothing twice.
cached() { sed -n "s/^$1:[A-Z]*=//p" "$build/CMakeCache.txt"; }
compiler=$(cached CMAKE_CXX_COMPILER)
options=(-G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_COMPILER="$compiler")

rm -rf "$prefix"
cmake --install "$build" --prefix "$prefix" >/dev/null
cmake -S tests/install -B build/install/find_package "${options[@]}" -DCMAKE_PREFIX_PATH="$prefix" >/dev/null
cmake --build build/install/find_package
echo -n "find_package: " && build/install/find_package/controller "$robot"

cmake -S tests/install -B build/install/add_subdirectory "${options[@]}" \
      -DSIGMAIK_SOURCE_DIR="$PWD" -DSIGMAIK_WERROR="$(cached SIGMAIK_WERROR)" >/dev/null
cmake --build build/install/add_subdirectory
echo -n "add_subdirectory: " && build/install/add_subdirectory/controller "$robot"

if command -v pkg-config >/dev/null; then
  pc=$(dirname "$(find "$prefix" -name sigmaik.pc)")
  [[ $(PKG_CONFIG_PATH=$pc pkg-config --modversion sigmaik) == "$(cached CMAKE_PROJECT_VERSION)" ]]
  read -ra flags <<<"$(PKG_CONFIG_PATH=$pc pkg-config --cflags --libs sigmaik)"
  "$compiler" -std=c++20 -O1 tests/install/main.cpp -o build/install/pkg_config "${flags[@]}"
  echo -n "pkg-config: " && LD_LIBRARY_PATH=$(dirname "$pc") build/install/pkg_config "$robot"
fi

# same REFERENCE OTHER: whether two files of words and numbers differ by no more than 1e-9 of a number, or of 1.
same() {
  awk 'NR == FNR { line[FNR] = $0; lines = FNR; next }
       { n = split(line[FNR], want)
         if (n != NF) { print "line " FNR ": " $0; bad = 1; exit }
         for (i = 1; i <= n; ++i) {
           if ($i == want[i]) continue
           d = $i - want[i]; size = want[i] < 0 ? -want[i] : want[i]
           if ($i !~ /^-?[0-9]/ || d > 1e-9 * (1 + size) || -d > 1e-9 * (1 + size)) {
             print "line " FNR ", " $1 ": " $i " for " want[i]; bad = 1; exit
           }
         } }
       END { exit bad || FNR != lines }' "$1" "$2"
}
reference=build/install/answers.txt
rm -f "$reference"
for cxx in "$compiler" g++ clang++; do
  command -v "$cxx" >/dev/null || continue
  version=$("$cxx" --version | head -1 | cut -d" " -f2-)
  [[ ${seen:=} == *"[$version]"* ]] && continue  # by another name: c++ is g++ or clang++
  seen+="[$version]"
  tree=build/install/answers-$(basename "$cxx")
  other=$PWD/build/install/other_headers
  cmake -S tests/install -B "$tree" -G Ninja -DCMAKE_BUILD_TYPE=None -DCMAKE_CXX_COMPILER="$cxx" \
        -DCMAKE_PREFIX_PATH="$prefix" -DOTHER_HEADERS="$other" >/dev/null
  cmake --build "$tree" --target answers
  [[ -e $reference ]] || "$tree/answers_plain" "$panda" >"$reference"
  for program in "$tree"/answers_*; do
    if [[ $program == *avx2* ]] && ! grep -q avx2 /proc/cpuinfo; then continue; fi
    "$program" "$panda" >"$tree/output.txt"
    same "$reference" "$tree/output.txt" || { echo "$program: other answers than $reference"; exit 1; }
  done
  echo "the same $(wc -l <"$reference") lines of answers with all flags: $version"
done

# Headers of a version whose ServoOptions has one more member.
rm -rf "$other"
cp -r cpp/include "$other"
sed -i 's/^struct ServoOptions {/&\n  double one_more = 0.0;/' "$other/sigmaik/servo.hpp"
for name in index row_major headers; do
  log=build/install/mismatch_$name.log
  if cmake --build "$tree" --target "mismatch_$name" >"$log" 2>&1 || ! grep -q "Layout<.*in_library" "$log"; then
    echo "mismatch_$name: must fail to link, and say which layout is missing; see $log" && exit 1
  fi
done
echo "programs with other types do not link: $(grep -o -m1 'undefined.*ServoOptions, [0-9]*ul>' "$log")…"
