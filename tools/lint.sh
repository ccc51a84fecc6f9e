#!/usr/bin/env bash
# Checks format, style, types and spelling, and that what the repository says of itself is true. Says all that is wrong,
# not only the first. .pre-commit-config.yaml runs the same.
set -uo pipefail
cd "$(dirname "$0")/.."
export PATH="$PWD/.venv/bin:$PATH"
failed=()
check() { "$@" || failed+=("$1 $2"); }

mapfile -t sources < <(git ls-files '*.cpp' '*.hpp')
check clang-format --dry-run --Werror "${sources[@]}"
check ruff check --quiet
check ruff format --check --quiet
check mypy --no-error-summary
check codespell $(git ls-files)
check python tools/check_map.py
check python tools/check_ci.py

((${#failed[@]} == 0)) || { printf 'lint: %s\n' "${failed[@]/#/failed: }" >&2; exit 1; }
