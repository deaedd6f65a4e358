#!/bin/sh
# Brings what is missing: the Rust target of the boards, and QEMU. Quick and silent when all is there.
set -eu

target=thumbv7em-none-eabihf

command -v cargo >/dev/null || {
    echo "setup: Rust is missing; install it from https://rustup.rs and try again" >&2
    exit 1
}

if [ ! -d "$(rustc --print sysroot)/lib/rustlib/$target/lib" ]; then
    if command -v rustup >/dev/null; then
        echo "setup: adding the Rust target $target" >&2
        rustup target add "$target" >&2
    else
        echo "setup: the Rust target $target is missing, and there is no rustup to add it: install it by the system's means" >&2
        exit 1
    fi
fi

if ! command -v qemu-system-arm >/dev/null; then
    as_root=
    [ "$(id -u)" = 0 ] || as_root=sudo
    if command -v apt-get >/dev/null && { [ -z "$as_root" ] || command -v sudo >/dev/null; }; then
        echo "setup: installing qemu-system-arm" >&2
        $as_root apt-get update -qq >&2
        $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends qemu-system-arm >&2
    else
        echo "setup: qemu-system-arm is missing; install it (macOS: brew install qemu; Fedora: dnf install qemu-system-arm; Arch: pacman -S qemu-system-arm)" >&2
        exit 1
    fi
fi
