#!/bin/sh
# Builds the page: the instrument as WebAssembly in base 64, beside the page's own files. `page.sh FOLDER`; brings the Rust target where it is missing,
# and ends with 3 where it cannot.
set -eu

folder=$1
target=wasm32-unknown-unknown
top=$(cd "$(dirname "$0")/.." && pwd)
build=${CARGO_TARGET_DIR:-$top/target}

if [ ! -d "$(rustc --print sysroot)/lib/rustlib/$target/lib" ]; then
    command -v rustup >/dev/null || {
        echo "page: the Rust target $target is missing, and there is no rustup to add it: install it by the system's means" >&2
        exit 3
    }
    echo "page: adding the Rust target $target" >&2
    rustup --quiet target add "$target" >&2 || {
        echo "page: the Rust target $target cannot be added" >&2
        exit 3
    }
fi

cargo rustc --quiet --release --manifest-path "$top/page/Cargo.toml" --target "$target" --crate-type cdylib -- -C strip=symbols
mkdir -p "$folder"
cp "$top"/page/www/* "$folder"
{
    printf '"use strict";\nconst NORTH_WASM = "'
    base64 < "$build/$target/release/page.wasm" | tr -d '\n'
    printf '";\n'
} > "$folder/wasm.js"
