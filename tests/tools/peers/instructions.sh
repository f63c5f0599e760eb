#!/bin/sh
# Instructions of one evaluation of each base regressor, counted by valgrind: the difference
# between a program that evaluates it 2000 times and one that does so 1000 times.
#
#     tests/tools/peers/instructions.sh
#
# Built for x86-64-v3, which valgrind knows; AVX-512 it does not.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
target=$here/../../../target/peers/instructions
RUSTFLAGS="-C target-cpu=x86-64-v3" CARGO_TARGET_DIR=$target \
    cargo build --quiet --release --manifest-path "$here/ours/Cargo.toml"
count() {
    valgrind --tool=none --quiet true 2>/dev/null || { echo "valgrind is missing" >&2; exit 1; }
    valgrind --tool=callgrind --callgrind-out-file=/dev/null \
        "$target/release/peers-ours" calls "$1" "$2" 2>&1 | sed -n 's/.*Collected : *//p'
}
for robot in puma560 ur5e rx90 panda iiwa14 rps3 stewart; do
    echo "$robot $(( ($(count $robot 2000) - $(count $robot 1000)) / 1000 ))"
done
