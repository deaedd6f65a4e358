# The two commands that matter: `make find` finds north in QEMU, `make test` runs every test but those of many seeds and the longest searches and runs, which are `make proofs`.

TARGET := thumbv7em-none-eabihf
BUILD := $(or $(CARGO_TARGET_DIR),target)
# What boards, page and emulated chip have in common is built once: they share the folder of intermediate files (cargo 1.91; older ones build more).
export CARGO_BUILD_BUILD_DIR := $(abspath $(BUILD))
# Where cargo keeps no state for incremental builds yet, as on a machine of continuous integration, none is written: a build of everything is quicker.
ifeq ($(wildcard $(BUILD)/debug/incremental),)
export CARGO_INCREMENTAL ?= 0
endif
QEMU_BOARD := --target $(TARGET) --no-default-features --features mps2 --target-dir $(BUILD)/qemu
F405_BOARD := --target $(TARGET) --target-dir $(BUILD)/f405
LOADER := --target $(TARGET) --package north-boot --bin loader --target-dir $(BUILD)/loader
NUCLEO_BOARD := --target $(TARGET) --no-default-features --features nucleo-f446 --target-dir $(BUILD)/nucleo
# The emulated chip: a workspace of its own, whose emulator asks for a newer compiler than it needs.
CHIP := --quiet --manifest-path chip/Cargo.toml --ignore-rust-version --target-dir $(BUILD)/chip

# Cargo counts its own jobs: it can take none of make's, and is not told of them.
ALONE := env -u MAKEFLAGS -u MFLAGS

.PHONY: find chip mutants test test-host test-acceptance test-units test-chip proofs lint fmt firmware bench page python release update hardware flash count figures setup help

## find: build the firmware, run it in QEMU with the simulated instrument, show the fix (ARGS="--scenario windy-tripod")
find: setup
	@cargo run --release -p north -- find $(ARGS)

## chip: the image that is flashed finds north on an emulated chip (ARGS="windy-tripod 2")
chip: setup
	@cargo run $(CHIP) -- $(ARGS)

## mutants: are single faults of the board and the drivers noticed by the emulated chip's tests (ARGS="a fault's name")
mutants: setup
	@scripts/mutants.sh $(BUILD)/mutants $(ARGS)

## test: all tests but those of many seeds and long searches: on the host, of the images in QEMU, of the page, of the flashed image on the emulated chip
test: setup
	@cargo fmt --all --check
	@mkdir -p $(BUILD) # Two cargos that make it at the same time can take it from each other.
	@$(MAKE) --no-print-directory -j2 --output-sync=target test-host test-chip

test-host:
	@$(ALONE) scripts/page.sh $(BUILD)/page || [ $$? = 3 ]
	@$(ALONE) cargo test --workspace --quiet --no-run
	@$(ALONE) $(MAKE) --no-print-directory -j2 --output-sync=target test-acceptance test-units

# Cargo runs one test program after the other, each of which leaves a core idle at its end: two rows of them, which together are all.
test-acceptance:
	$(ALONE) cargo test --workspace --quiet --test acceptance

test-units:
	$(ALONE) cargo test --workspace --quiet --lib --bins --examples --test '[!a]*'
	$(ALONE) cargo test --workspace --quiet --doc

test-chip:
	$(ALONE) cargo test $(CHIP)

## proofs: the tests of many seeds, the longest searches and runs of the emulated chip, and what the image costs
proofs: setup
	cargo test --release --workspace -- --ignored
	cargo test $(CHIP) -- --ignored

## lint: format check, clippy for the host and all boards, and the documentation's links; warnings are errors
lint: setup
	cargo fmt --all --check
	cargo fmt --manifest-path chip/Cargo.toml --check
	cargo clippy --quiet --workspace --all-targets -- -D warnings
	cargo clippy --quiet $(QEMU_BOARD) -- -D warnings
	cargo clippy --quiet $(F405_BOARD) -- -D warnings
	cargo clippy --quiet $(NUCLEO_BOARD) -- -D warnings
	cargo clippy --quiet $(LOADER) -- -D warnings
	cargo clippy $(CHIP) --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --quiet --no-deps --workspace

## fmt: format everything
fmt:
	cargo fmt --all
	cargo fmt --manifest-path chip/Cargo.toml

## firmware: the images of all boards, and the loader
firmware: setup
	cargo build --quiet --profile firmware $(QEMU_BOARD) --bin firmware
	cargo build --quiet --profile firmware $(F405_BOARD) --bin firmware
	cargo build --quiet --profile firmware $(NUCLEO_BOARD) --bin firmware
	cargo build --quiet --profile firmware $(LOADER)

## bench: the tables of the README and of docs (takes an hour and more)
bench: setup
	@for table in accuracy adaptive orders gyros repeat gates "faults --trials 4000" calibration voyage ageing "diagnose --campaigns 3" experiment \
		diagnose-speed attitude alignment hold "hold --whole" aiding esg field watch "fleet --types 1 --units 20 --tests 4" cost; do \
		echo "north bench $$table"; cargo run --quiet --release -p north -- bench $$table || missed="$$missed; $$table"; done; \
		[ -z "$$missed" ] || { echo "beyond their limits, or not run$$missed"; exit 1; }

## page: the instrument in a browser: one folder, opened from anywhere (installs the WebAssembly target of Rust)
page:
	@scripts/page.sh $(BUILD)/page
	@echo "open $(BUILD)/page/index.html"

## release: the command with the emulated board's image in it, packed: it needs QEMU, and neither sources nor cargo
release: firmware
	@scripts/release.sh $(BUILD)/qemu/$(TARGET)/firmware/firmware

## python: the Python package, built, installed into an environment of its own and tested
python: setup
	@scripts/python.sh $(BUILD)/python

## update: the images of both slots, and the file for north update, signed with KEY=FILE; the same bytes wherever it is built
update: setup
	@scripts/update.sh $(BUILD)/update $(KEY)

## hardware: connection table, bill of materials and wiring diagram, made of hardware/instrument.toml
hardware:
	@cargo run --quiet -p hardware

## flash: build for the STM32F405, flash it and show its log (needs probe-rs and a probe)
flash: setup
	@command -v probe-rs >/dev/null || { echo "probe-rs is missing: cargo install probe-rs-tools --locked"; exit 1; }
	cargo run --profile firmware $(F405_BOARD) --bin firmware

## count: lines of Rust and constants of the diagnosis and its effects
count:
	@scripts/count.sh

## figures: the files of docs/figures, and the documents by them (published recordings in NORTH_FINDER_DATA, ../shared/data without it)
figures: setup
	@scripts/figures.sh

## setup: bring the Rust target and QEMU where they are missing
setup:
	@scripts/setup.sh

## help: this list
help:
	@sed -n 's/^## /  /p' Makefile
