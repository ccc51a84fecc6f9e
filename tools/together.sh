#!/usr/bin/env bash
# Runs two commands side by side, each a line for the shell: together.sh FIRST SECOND
# Prints the output of the first while it runs, and then that of the second. Fails where one of them does; where the
# first fails, or the script is interrupted, the second is stopped.
set -uo pipefail
set -m  # a process group for the second command, so that all of its processes can be stopped
log=$(mktemp)
trap '[[ -z ${second:-} ]] || kill -TERM -- "-$second" 2>/dev/null; rm -f "$log"' EXIT

bash -c "$2" >"$log" 2>&1 &
second=$!
bash -c "$1" || exit
wait "$second"
status=$?
second=
cat "$log"
exit "$status"
