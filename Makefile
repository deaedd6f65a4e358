# make find   the firmware in QEMU finds north in a simulated instrument; ARGS="--scenario creep --seed 7"
# make test   everything that must hold before a change goes in
# make flash  onto an STM32F405 by a debug probe (needs probe-rs)
# make bench  accuracy and cost; the tables of the documents come from here

TARGET := thumbv7em-none-eabihf
CARGO ?= cargo
# North builds the image for QEMU by itself, with these.
MPS2 := --no-default-features --features mps2

.PHONY: find test setup bench flash images lint

find: setup
	@$(CARGO) run --quiet --release -p north -- find $(ARGS)

test: setup lint images
	$(CARGO) test --workspace

setup:
	@scripts/setup.sh

lint: setup
	$(CARGO) fmt --all --check
	$(CARGO) clippy --workspace --all-targets -- -D warnings
	$(CARGO) clippy --target $(TARGET) --bin firmware -- -D warnings
	$(CARGO) clippy --target $(TARGET) --bin firmware $(MPS2) -- -D warnings

images: setup
	$(CARGO) build --profile firmware --target $(TARGET) --bin firmware

bench: setup
	$(CARGO) run --release -p north -- bench accuracy
	$(CARGO) run --release -p north -- bench cost

flash: setup
	@command -v probe-rs >/dev/null || { echo "probe-rs is not there: see https://probe.rs" >&2; exit 1; }
	$(CARGO) run --profile firmware --target $(TARGET) --bin firmware
