#!/usr/bin/env bash
# Checks format, style, types and spelling, and that what the repository says of itself is true. Says all that is wrong,
# not only the first. .pre-commit-config.yaml runs the same.
set -uo pipefail
cd "$(dirname "$0")/.."
export PATH="$PWD/.venv/bin:$PATH"
failed=()
check() {  # NAME COMMAND…
  local name=$1
  shift
  "$@" || failed+=("$name")
}

mapfile -t sources < <(git ls-files '*.cpp' '*.hpp')
check clang-format clang-format --dry-run --Werror --ferror-limit=3 "${sources[@]}"
check "ruff check" ruff check --quiet
check "ruff format" ruff format --check --quiet
check mypy mypy --no-error-summary
check codespell codespell $(git ls-files)
check "the map of sigmaik.hpp" python tools/check_map.py
check "workflows and hooks" python tools/check_ci.py

((${#failed[@]} == 0)) || { printf 'lint: %s\n' "${failed[@]/#/failed: }" >&2; exit 1; }
