#!/bin/sh
# What the diagnosis and its effects are made of: lines of Rust without tests, and constants that decide.
set -e
without_tests() { awk '/^#\[cfg\(test\)\]/ { exit } { print }' "$1"; }
total_lines=0
total_constants=0
printf '%-22s %7s %10s\n' room lines constants
for room in src/effects learn/src cli/src/diagnose; do
	lines=0
	constants=0
	for file in $(find "$room" -name '*.rs' ! -name 'tests.rs'); do
		lines=$((lines + $(without_tests "$file" | wc -l)))
		constants=$((constants + $(without_tests "$file" | grep -cE '^ *(pub(\([a-z]+\))? )?const [A-Z_]+: (f32|f64|u8|usize|\[f64)' || true)))
	done
	printf '%-22s %7d %10d\n' "$room" "$lines" "$constants"
	total_lines=$((total_lines + lines))
	total_constants=$((total_constants + constants))
done
printf '%-22s %7d %10d\n' together "$total_lines" "$total_constants"
