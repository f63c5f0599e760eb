#!/bin/sh
# Runs a robot's C on an emulated Cortex-M4 and compares it with this machine's.
#
#     sh tests/tools/cortex/run.sh [SPEC]
#
# Needs gcc, arm-none-eabi-gcc with newlib, and qemu-system-arm (Debian: gcc-arm-none-eabi
# libnewlib-arm-none-eabi qemu-system-arm). Says so and ends with 0 where one is missing. CORTEX_REGEN
# names a command to use instead of building it.
set -eu
cd "$(dirname "$0")/../../.."
spec="${1:-robots/3rps.yaml}"
for tool in gcc arm-none-eabi-gcc qemu-system-arm; do
    if ! command -v "$tool" > /dev/null; then
        echo "left out: there is no $tool"
        exit 0
    fi
done
here=tests/tools/cortex
work="${CARGO_TARGET_DIR:-target}/cortex"
rm -rf "$work"
mkdir -p "$work"
if [ -n "${CORTEX_REGEN:-}" ]; then
    "$CORTEX_REGEN" generate "$spec" --target c --out "$work" > /dev/null
else
    cargo run --quiet --bin regen -- generate "$spec" --target c --out "$work" > /dev/null
fi
name="$(basename "$work"/*.h .h)"
upper="$(printf '%s' "$name" | tr '[:lower:]' '[:upper:]')"
sed -e "s/ROBOT/$upper/g" -e "s/robot/$name/g" "$here/main.c" > "$work/main.c"
warnings="-std=c99 -O1 -Wall -Wextra -Wpedantic -Wconversion -Werror"
# this machine's without fused products, which the emulated one has in single precision only
# shellcheck disable=SC2086
gcc $warnings -ffp-contract=off -o "$work/host" "$work/main.c" "$work/$name.c" -lm
# shellcheck disable=SC2086
arm-none-eabi-gcc $warnings -ffp-contract=off -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 \
    --specs=rdimon.specs -T "$here/link.ld" -nostartfiles \
    -o "$work/board.elf" "$here/start.c" "$work/main.c" "$work/$name.c" -lm
"$work/host" > "$work/host.txt"
timeout 120 qemu-system-arm -M mps2-an386 -display none -monitor none -serial none \
    -semihosting-config enable=on,target=native -kernel "$work/board.elf" > "$work/board.txt"
lines="$(wc -l < "$work/board.txt")"
if [ "$lines" -lt 10 ]; then
    echo "the emulated machine printed $lines lines only" >&2
    exit 1
fi
paste -d ' ' "$work/host.txt" "$work/board.txt" | awk -v robot="$name" '
    $1 != $4 || $2 != $5 { print "different lines: " $0; bad = 1; next }
    {
        apart = $3 - $6
        apart = apart < 0 ? -apart : apart
        kind = $1 ~ /_f$/ ? "float" : "double"
        if (!(apart <= (kind == "float" ? 1e-5 : 1e-13))) { print "apart: " $0; bad = 1 }
        if (apart > worst[kind]) { worst[kind] = apart }
        count[kind] += 1
    }
    END {
        for (kind in count) {
            printf "%s on %s: %d numbers, largest difference %.1e of the largest entry\n", robot, kind, count[kind], worst[kind]
        }
        exit bad
    }'
size=$(arm-none-eabi-size -A "$work/board.elf" | awk '$1 == ".text" { print $2 }')
echo "text of the whole program: $size bytes"
