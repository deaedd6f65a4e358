#!/bin/sh
# Brings what the build and the tests need: the target of the firmware and QEMU. Silent and quick when all is there.
set -eu

target=thumbv7em-none-eabihf

if ! command -v cargo >/dev/null 2>&1; then
    echo "cargo is not there: install Rust with rustup, https://rustup.rs" >&2
    exit 1
fi
if [ ! -d "$(rustc --print sysroot)/lib/rustlib/$target" ]; then
    if ! command -v rustup >/dev/null 2>&1; then
        echo "the Rust target $target is not there, and no rustup to add it: install it with your toolchain" >&2
        exit 1
    fi
    rustup target add "$target"
fi

command -v qemu-system-arm >/dev/null 2>&1 && exit 0
if ! command -v apt-get >/dev/null 2>&1; then
    echo "qemu-system-arm is not there: install QEMU for ARM (Fedora: qemu-system-arm, Arch: qemu-system-arm, macOS: brew install qemu)" >&2
    exit 1
fi
root=
if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null 2>&1 || { echo "qemu-system-arm is not there: as root, apt-get install qemu-system-arm" >&2; exit 1; }
    root=sudo
fi
echo "installing qemu-system-arm" >&2
export DEBIAN_FRONTEND=noninteractive
# The package lists may be old or absent; only then are they fetched.
$root apt-get install -y -qq --no-install-recommends qemu-system-arm >/dev/null 2>&1 || {
    $root apt-get update -qq
    $root apt-get install -y -qq --no-install-recommends qemu-system-arm >/dev/null
}
