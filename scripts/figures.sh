#!/bin/sh
# Writes docs/figures: what the figures of README and docs are from, each file by the command beside it. The published recordings (docs/comparison.md
# says where they are) are looked for in the folder NORTH_FINDER_DATA; a file whose recording is not there stays as it is. `figures.sh FILE…` writes these
# files of tables alone: all of them take some four hours on two cores, most of that composed-inside, composed-outside and board-loop.
set -eu
only=" $* "
for file in "$@"; do
    grep -q "^ *bench $file \|^ *write $file\.json \|^ *tables $file\.md " "$0" || { echo "figures: there is no file \"$file\"" >&2; exit 2; }
done
cd "$(dirname "$0")/.."
data=${NORTH_FINDER_DATA:-../shared/data}
out=docs/figures
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cargo build --quiet --release -p north
north=${CARGO_TARGET_DIR:-target}/release/north

# file: whether it is one of those that were asked for
is_wanted() {
    case $only in "  " | *" $1 "*) ;; *) return 1 ;; esac
}

# file command: runs the command, whose machine-readable result becomes the file
write() {
    file=$1; shift
    is_wanted "${file%.json}" || return 0
    echo "$file"
    # A run without an azimuth is a result, too: what counts is the file.
    "$@" --json "$work/$file" >/dev/null 2>&1 || [ -s "$work/$file" ]
    mv "$work/$file" "$out/$file"
}

# bench file arguments: what the bench prints becomes a file of tables, its machine-readable result the one beside it
bench() {
    file=$1; shift
    is_wanted "$file" || return 0
    echo "$file"
    "$north" bench "$@" --json "$work/$file.json" > "$work/$file.md" 2>/dev/null || [ -s "$work/$file.json" ]
    mv "$work/$file.md" "$work/$file.json" "$out"
}

# tables file command: the tables that a test prints
tables() {
    file=$1; shift
    is_wanted "${file%.md}" || return 0
    echo "$file"
    "$@" -- --nocapture --test-threads 1 2>/dev/null | grep -e '^|' -e '^$' > "$work/$file"
    mv "$work/$file" "$out"
}

bench accuracy accuracy
bench orders orders --fixes 100
bench repeat repeat
bench adaptive adaptive --fixes 200
bench adaptive-white adaptive --fixes 2000 --time 60 --time 240
bench gates gates --fixes 100
bench calibration calibration
bench voyage voyage
bench ageing ageing --trials 4000
bench watch watch
bench diagnose-speed diagnose-speed
bench hidden-named diagnose --group named --campaigns 1 --seed 7
bench composed-inside diagnose --group composed --kind inside --campaigns 16 --seed 11801
bench composed-outside diagnose --group composed --kind outside --campaigns 16 --seed 10807
bench board-loop board-loop --instruments 30 --seed 2
bench attitude attitude
bench alignment alignment --trials 20
bench gyros gyros --fixes 6
bench hold hold --trials 100
bench faults faults
bench aiding aiding --trials 60
bench esg esg --trials 4
bench field field
tables motion.md cargo test --quiet --lib fix::motion

triad=$data/ring-laser-triad/increments_100hz.csv
if [ -f "$triad" ]; then
    "$north" import --map cli/maps/psins-counts-csv.toml "$triad" --out "$work/parked" >/dev/null 2>&1
    write parked-vehicle.json "$north" diagnose "$work/parked" --model-out "$work/vehicle.toml"
    write parked-vehicle-plain.json "$north" solve "$work/parked"
    write parked-vehicle-solved.json "$north" solve "$work/parked" --model "$work/vehicle.toml"
    tables parked-windows.md cargo test --quiet -p acceptance parked_vehicle
fi
counts=$data/mems-multi-position/counts_100hz.csv
if [ -f "$counts" ]; then
    write many-positions.json "$north" calibrate ellipsoid "$counts" --gravity 9.81744
fi
NORTH_FIGURES=write cargo test --quiet -p acceptance figures
cargo test --quiet -p acceptance figures
