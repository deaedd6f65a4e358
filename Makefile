# The two commands that matter: `make find` finds north in QEMU, `make test` checks everything.

TARGET := thumbv7em-none-eabihf
BUILD := $(or $(CARGO_TARGET_DIR),target)
QEMU_BOARD := --target $(TARGET) --no-default-features --features mps2 --target-dir $(BUILD)/qemu
F405_BOARD := --target $(TARGET) --target-dir $(BUILD)/f405

.PHONY: find test lint fmt firmware bench flash setup help

## find: build the firmware, run it in QEMU with the simulated instrument, show the fix (ARGS="--scenario windy-tripod")
find: setup
	@cargo run --release -p north -- find $(ARGS)

## test: format, lints, both firmware images, all tests
test: setup lint firmware
	cargo test --workspace --quiet

## lint: format check and clippy, warnings are errors, for the host and both boards
lint: setup
	cargo fmt --all --check
	cargo clippy --quiet --workspace --all-targets -- -D warnings
	cargo clippy --quiet $(QEMU_BOARD) -- -D warnings
	cargo clippy --quiet $(F405_BOARD) -- -D warnings

## fmt: format everything
fmt:
	cargo fmt --all

## firmware: the images of both boards
firmware: setup
	cargo build --quiet --profile firmware $(QEMU_BOARD) --bin firmware
	cargo build --quiet --profile firmware $(F405_BOARD) --bin firmware

## bench: accuracy, calibration, diagnosis and cost, as the README's tables (takes some ten minutes)
bench: setup
	cargo run --release -p north -- bench accuracy
	cargo run --release -p north -- bench calibration
	cargo run --release -p north -- bench diagnose --campaigns 30
	cargo run --release -p north -- bench cost

## flash: build for the STM32F405, flash it and show its log (needs probe-rs and a probe)
flash: setup
	@command -v probe-rs >/dev/null || { echo "probe-rs is missing: cargo install probe-rs-tools --locked"; exit 1; }
	cargo run --profile firmware $(F405_BOARD) --bin firmware

## setup: bring the Rust target and QEMU where they are missing
setup:
	@scripts/setup.sh

## help: this list
help:
	@sed -n 's/^## /  /p' Makefile
