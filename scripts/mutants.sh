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
images=$folder/images
image=$folder/target/thumbv7em-none-eabihf/mutants/firmware
processors=$(getconf _NPROCESSORS_ONLN)
began=$(date +%s)

# A copy of the sources, for nothing here may be left changed. What is the same keeps its time, and is not built again.
rm -rf "$images"
mkdir -p "$tree" "$images"
(cd "$root" && git ls-files --cached --others --exclude-standard) | while read -r file; do
    if [ -f "$root/$file" ] && ! cmp -s "$root/$file" "$tree/$file"; then
        mkdir -p "$(dirname "$tree/$file")"
        cp "$root/$file" "$tree/$file"
    fi
done

build() { (cd "$tree" && cargo build --quiet --profile mutants --target thumbv7em-none-eabihf --target-dir "$folder/target" --bin firmware); }
tests=$(cd "$root" && cargo test --quiet --manifest-path chip/Cargo.toml --ignore-rust-version --target-dir "$folder/../chip" --test chip \
    --no-run --message-format json | sed -n '/"kind":\["test"\]/s/.*"executable":"\([^"]*\)".*/\1/p')
[ -x "$tests" ] && build || exit 2
cp "$image" "$images/without-a-fault"
ready=$(date +%s)

# Whether the test of this name fails with this image; a test that takes too long says nothing of the fault.
notices() {
    NORTH_CHIP_IMAGE=$images/$1 timeout 600 "$tests" --include-ignored "$2" >"$images/$1-$2.log" 2>&1
    case $? in 0 | 124) return 1 ;; esac
}

# Tries every so many-th line of a list, from one on.
try() {
    awk -v of="$2" -v this="$1" 'NR % of == this' "$images/list" | while read -r name candidates; do
        by=
        for test in $candidates; do
            if notices "$name" "$test"; then
                by=$test
                break
            fi
        done
        if [ "$name" = without-a-fault ]; then
            [ -z "$by" ] || echo "the image without a fault fails $by" | tee -a "$images/bad"
        elif [ -n "$by" ]; then
            echo "$name: noticed by $by"
            rm "$images/$name"
        else
            echo "$name: NOT NOTICED by $candidates"
            echo "$name" >>"$images/survivors"
        fi
    done
}

# The images first, one after the other: each is a small change of the one before.
: >"$images/survivors"
while IFS='|' read -r name rest; do
    name=$(echo $name)
    case $name in '' | '#'*) continue ;; esac
    [ $# = 0 ] || case " $* " in *" $name "*) ;; *) continue ;; esac
    file=$(echo ${rest%%|*})
    rest=${rest#*|}
    change=$(printf '%s\n' "${rest%|*}" | sed 's/^ *//; s/ *$//')
    sed "$change" "$root/$file" >"$tree/$file"
    if cmp -s "$root/$file" "$tree/$file"; then
        echo "$name: changes nothing of $file" | tee -a "$images/survivors"
    elif build 2>"$images/$name.log"; then
        cp "$image" "$images/$name"
        echo "$name ${rest##*|}" >>"$images/list"
        for test in ${rest##*|}; do echo "without-a-fault $test" >>"$images/good"; done
    else
        cat "$images/$name.log"
        echo "$name: does not compile" | tee -a "$images/survivors"
    fi
    cp "$root/$file" "$tree/$file"
done <"$root/scripts/mutants.txt"

built=$(date +%s)
# Nobody may notice anything of the image without a fault.
sort -u "$images/good" >>"$images/list"
worker=0
while [ $worker -lt "$processors" ]; do
    try $worker "$processors" &
    worker=$((worker + 1))
done
wait

survivors=$(wc -l <"$images/survivors")
all=$(($(grep -vc "^without-a-fault" "$images/list") + $(grep -c : "$images/survivors")))
ended=$(date +%s)
echo "$((all - survivors)) of $all faults noticed in $((ended - began)) s: the tests themselves $((ready - began)) s, images" \
    "$((built - ready)) s, tests $((ended - built)) s"
[ "$survivors" = 0 ] || { echo "not noticed:" && cat "$images/survivors"; }
[ ! -e "$images/bad" ] && [ $((100 * survivors)) -le $((5 * all)) ]
