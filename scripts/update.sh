#!/bin/sh
# The images of both slots and the loader, as they are in flash, and with a key the signed file of an update: scripts/update.sh FOLDER [KEY].
#
# Paths of this machine are replaced in what the compiler writes down, so that equal sources give equal bytes in every folder.
set -eu

mkdir -p "$1"
out=$(cd "$1" && pwd)
key=${2:+$(cd "$(dirname "$2")" && pwd)/$(basename "$2")}
cd "$(dirname "$0")/.."
target=thumbv7em-none-eabihf
objcopy=$(find "$(rustc --print sysroot)" \( -name rust-objcopy -o -name llvm-objcopy \) -type f | head -n 1)
[ -n "$objcopy" ] || { echo "llvm-objcopy is missing: rustup component add llvm-tools"; exit 1; }
export LD_LIBRARY_PATH="$(rustc --print sysroot)/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
registry=${CARGO_HOME:-$HOME/.cargo}/registry/src
build() {
	cargo build --quiet --locked --profile firmware --target $target --target-dir "$out/build" \
		--config "target.$target.rustflags=[\"--remap-path-prefix=$PWD=/north\",\"--remap-path-prefix=$registry=/crates\"]" "$@"
}
for slot in a b; do
	NORTH_SLOT=$slot build --bin firmware
	"$objcopy" -O binary "$out/build/$target/firmware/firmware" "$out/slot-$slot.bin"
done
build --package north-boot --bin loader
"$objcopy" -O binary "$out/build/$target/firmware/loader" "$out/loader.bin"
if [ -n "$key" ]; then
	rm -f "$out/north-f405.update"
	cargo run --quiet --release -p north -- update sign --key "$key" --out "$out/north-f405.update" \
		--revision "$(git rev-parse --short=10 HEAD 2>/dev/null || true)" "$out/slot-a.bin" "$out/slot-b.bin"
fi
ls -l "$out"/*.bin
