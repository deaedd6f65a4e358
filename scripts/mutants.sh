#!/bin/sh
# Builds the image with each of the faults in scripts/mutants.txt, one at a time, and runs the emulated chip's tests that can notice it. Tells which
# faults nobody noticed. Exit code 1 where that are more than 5 %, or where a fault is no change of its file any more.
#
#     scripts/mutants.sh FOLDER [NAME…]      (FOLDER is for intermediate files; without names all of them)
set -u
unset CARGO_BUILD_BUILD_DIR
root=$(cd "$(dirname "$0")/.." && pwd)
mkdir -p "$1"
folder=$(cd "$1" && pwd)
shift
tree=$folder/tree
chip="--quiet --manifest-path $root/chip/Cargo.toml --ignore-rust-version --target-dir $folder/../chip"
image=$folder/target/thumbv7em-none-eabihf/mutants/firmware

# A copy of the sources, for nothing here may be left changed.
mkdir -p "$tree"
(cd "$root" && git ls-files -z --cached --others --exclude-standard | xargs -0 -r tar cf - --ignore-failed-read 2>/dev/null) | (cd "$tree" && tar xmf -)

build() { (cd "$tree" && cargo build --quiet --profile mutants --target thumbv7em-none-eabihf --target-dir "$folder/target" --bin firmware); }
# A test that fails has noticed; one that takes too long says nothing of the fault, and ends this.
notices() {
    NORTH_CHIP_IMAGE=$image timeout 600 cargo test $chip -- "$1" >"$folder/log" 2>&1
    case $? in
    0) return 1 ;;
    124) echo "$1 takes more than 600 s" && exit 2 ;;
    esac
}

began=$(date +%s)
build || exit 2
for test in $(sed -n 's/^[^#].*| *//p' "$root/scripts/mutants.txt" | sort -u); do
    if notices "$test"; then
        cat "$folder/log"
        echo "the image without a fault fails $test"
        exit 2
    fi
done

all=0
killed=0
survivors=
while IFS='|' read -r name rest; do
    name=$(echo $name)
    case $name in '' | '#'*) continue ;; esac
    [ $# = 0 ] || case " $* " in *" $name "*) ;; *) continue ;; esac
    file=$(echo ${rest%%|*})
    rest=${rest#*|}
    change=$(echo "${rest%|*}" | sed 's/^ *//; s/ *$//')
    tests=${rest##*|}
    all=$((all + 1))
    sed "$change" "$root/$file" >"$tree/$file"
    if cmp -s "$root/$file" "$tree/$file"; then
        echo "$name: changes nothing of $file"
        survivors="$survivors $name"
        continue
    fi
    by=
    if build 2>"$folder/log"; then
        for test in $tests; do
            if notices "$test"; then
                by=$test
                break
            fi
        done
    else
        by="nobody: it does not compile"
        survivors="$survivors $name"
        killed=$((killed - 1))
        cat "$folder/log"
    fi
    if [ -n "$by" ]; then
        killed=$((killed + 1))
        echo "$name: noticed by $by"
    else
        survivors="$survivors $name"
        echo "$name: NOT NOTICED by$tests"
    fi
    cp "$root/$file" "$tree/$file"
done <"$root/scripts/mutants.txt"

echo "$killed of $all faults noticed in $(($(date +%s) - began)) s"
[ -z "$survivors" ] || echo "not noticed:$survivors"
[ $((100 * killed)) -ge $((95 * all)) ]
