#!/usr/bin/env bash
# Runs every fuzzer for its part of SECONDS: fuzz.sh SECONDS. What the fuzzers learn stays in build/fuzz/corpus; an input
# that breaks a property is written to build/fuzz/found, and fails the run.
set -uo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-600}
jobs=$(nproc)
names=(urdf servo stream least_squares)
each=$((seconds / (${#names[@]} + 1)))
((each > 0)) || each=1
failed=()
mkdir -p build/fuzz/found
for name in "${names[@]}"; do
  mkdir -p "build/fuzz/corpus/$name"
  options=(-max_total_time="$each" -timeout=20 -rss_limit_mb=2048 -print_final_stats=1
           -artifact_prefix="build/fuzz/found/$name-")
  [[ $name == urdf ]] && options+=(-dict=tests/fuzz/urdf.dict -max_len=20000) || options+=(-max_len=4096)
  echo "fuzz: $name, $each s, $jobs at once"
  build/fuzz/sigmaik_fuzz_"$name" "${options[@]}" -fork="$jobs" -ignore_crashes=0 "build/fuzz/corpus/$name" \
    "tests/fuzz/corpus/$name" 2>"build/fuzz/$name.log" || failed+=("$name")
  tail -n 1 "build/fuzz/$name.log"
done
echo "fuzz: recordings, $each s"
.venv/bin/python tests/fuzz/fuzz_recording.py --seconds "$each" --found build/fuzz/found || failed+=(recordings)

((${#failed[@]} == 0)) || { echo "fuzz: broken: ${failed[*]}; the inputs are in build/fuzz/found, the logs in build/fuzz" >&2; exit 1; }
