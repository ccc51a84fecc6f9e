#!/usr/bin/env bash
# Runs two commands side by side, each a line for the shell: together.sh FIRST SECOND
# Prints the output of the first while it runs, and then that of the second. Fails where one of them does.
set -uo pipefail
set -m  # a process group for the second command, so that all of its processes can be stopped
log=$(mktemp)
trap 'rm -f "$log"' EXIT

bash -c "$2" >"$log" 2>&1 &
second=$!
if ! bash -c "$1"; then
  kill -TERM -- "-$second" 2>/dev/null
  cat "$log"
  exit 1
fi
wait "$second"
status=$?
cat "$log"
exit "$status"
