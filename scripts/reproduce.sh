#!/bin/sh
# Builds the loader and the images of both slots twice, in two folders below homes of their own, and compares them byte for byte.
#
# The commit is built, not what was changed since. What cargo has downloaded is copied, so that no network is needed where that is enough.
set -eu

top=$(cd "$(dirname "$0")/.." && pwd)
downloaded=${CARGO_HOME:-$HOME/.cargo}/registry
RUSTUP_HOME=${RUSTUP_HOME:-$HOME/.rustup}
export RUSTUP_HOME
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for home in first a/second/home; do
	mkdir -p "$folder/$home/.cargo/registry"
	cp -R "$downloaded/cache" "$downloaded/index" "$folder/$home/.cargo/registry/"
	git clone --quiet "$top" "$folder/$home/north"
	HOME="$folder/$home" CARGO_HOME="$folder/$home/.cargo" "$folder/$home/north/scripts/update.sh" "$folder/$home/images"
done
for image in loader slot-a slot-b; do
	cmp "$folder/first/images/$image.bin" "$folder/a/second/home/images/$image.bin"
	echo "$image.bin: $(wc -c <"$folder/first/images/$image.bin") bytes, the same twice"
done
