#!/bin/sh
# The command with the emulated board's image in it, packed: scripts/release.sh IMAGE.
set -eu

image=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
cd "$(dirname "$0")/.."
NORTH_FIRMWARE=$image cargo build --quiet --release -p north
host=$(rustc -vV | sed -n 's/^host: //p')
out=${CARGO_TARGET_DIR:-target}/release/north
[ -f "$out.exe" ] && out=$out.exe
tar -czf "${CARGO_TARGET_DIR:-target}/north-$host.tar.gz" -C "$(dirname "$out")" "$(basename "$out")" -C "$PWD" README.md LICENSE-MIT LICENSE-APACHE
echo "${CARGO_TARGET_DIR:-target}/north-$host.tar.gz"
