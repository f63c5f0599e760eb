#!/bin/sh
# Counts the instructions of the longest updates of regen-control on an emulated Cortex-M4.
#
#     sh tests/tools/cortex/count.sh
#
# Needs what run.sh needs, and rustup target add thumbv7em-none-eabihf.
set -eu
cd "$(dirname "$0")/../../.."
here=tests/tools/cortex
work="${CARGO_TARGET_DIR:-target}/cortex-count"
mkdir -p "$work"
cargo build --quiet --release --target thumbv7em-none-eabihf --manifest-path "$here/cycle/Cargo.toml" \
    --target-dir "$work"
arm-none-eabi-gcc -std=c99 -O1 -Wall -Wextra -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 \
    --specs=rdimon.specs -T "$here/link.ld" -nostartfiles -o "$work/count.elf" "$here/start.c" "$here/count.c" \
    "$work/thumbv7em-none-eabihf/release/libcycle.a" -lm
timeout 300 qemu-system-arm -M mps2-an386 -icount shift=0 -display none -monitor none -serial none \
    -semihosting-config enable=on,target=native -kernel "$work/count.elf"
