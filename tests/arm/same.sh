#!/usr/bin/env bash
# Shows that a Raspberry Pi computes what a desk does: the same scenario, simulated by this machine's program and by one for
# 64-bit ARM in an emulator, leaves the same files, byte for byte. Core only: what speaks to networks and devices is left out.
#
#   tests/arm/same.sh BINARY [SCENARIO] [SIM OPTIONS...]
#
# BINARY was built here without default features; SCENARIO is the bundled default if left out. Says what is missing and ends
# with 0 when the emulator, the linker or Rust's library for ARM is not there, unless MUST_RUN is set.
set -euo pipefail
binary="$(realpath "${1:?a binary of tomoswarm, built with --no-default-features}")"
shift
cd "$(dirname "$0")/../.."
triple=aarch64-unknown-linux-gnu

without() {
    echo "skipped: no $1 ($2)"
    [ -z "${MUST_RUN:-}" ] || exit 1
    exit 0
}
qemu="$(command -v qemu-aarch64-static || command -v qemu-aarch64)" \
    || without "emulator of ARM" "sudo apt install qemu-user-static"
command -v aarch64-linux-gnu-gcc >/dev/null \
    || without "linker for ARM" "sudo apt install gcc-aarch64-linux-gnu"
[ -d "$(rustc --print sysroot)/lib/rustlib/$triple" ] \
    || without "library of Rust for ARM" "rustup target add $triple"

target="${CARGO_TARGET_DIR:-target}"
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
cargo build --release --locked --no-default-features --target "$triple" --target-dir "$target"

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
"$binary" sim "$@" --out "$work/here" >"$work/here.txt"
"$qemu" -L /usr/aarch64-linux-gnu "$target/$triple/release/tomoswarm" sim "$@" --out "$work/arm" >"$work/arm.txt"

compared=0
# summary.json holds how long it took.
for file in "$work/here"/*; do
    name="${file##*/}"
    [ "$name" != summary.json ] || continue
    cmp "$file" "$work/arm/$name"
    compared=$((compared + 1))
done
[ "$compared" -ge 8 ] || { echo "only $compared files to compare"; exit 1; }
echo "ARM = $(uname -m): $compared files are the same, byte for byte"
