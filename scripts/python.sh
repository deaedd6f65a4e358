#!/bin/sh
# Builds the Python package in an environment of its own and runs its tests: scripts/python.sh FOLDER.
set -eu

cd "$(dirname "$0")/.."
folder=$1
command -v python3 >/dev/null || { echo "python: python3 is missing; install it, 3.10 or newer, with its module venv" >&2; exit 1; }
cargo build --quiet --release -p north
[ -x "$folder/bin/python" ] || python3 -m venv "$folder"
"$folder/bin/pip" install --quiet --disable-pip-version-check "./python[test]"
# A cluster where there is a package for this Python; without one its test is skipped.
"$folder/bin/pip" install --quiet --disable-pip-version-check ray pyarrow fsspec duckdb ||
    echo "python: there is no package of Ray for this Python: the test on a cluster is skipped"
NORTH="$(realpath "${CARGO_TARGET_DIR:-target}/release/north")" "$folder/bin/python" -m pytest --quiet python/tests
