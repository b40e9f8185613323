#!/usr/bin/env bash
# Compares what simulations do with what they did when tests/pins/pins.txt was written, byte for byte: the log of every
# scenario in scenarios.txt beside this file, for a number of seeds each. A change that is meant to keep behaviour keeps
# all of them; one that changes it writes them anew, in a commit that says why.
#
#   tests/pins/pins.sh check BINARY [SEEDS]     compares; SEEDS = how many seeds of each scenario (default 20)
#   tests/pins/pins.sh write BINARY [SEEDS]     writes pins.txt anew
#   tests/pins/pins.sh print BINARY [SEEDS]     prints, to be compared by other means
#
# Lines of pins.txt: scenario, seed, SHA-256 of run.log. A run may end as failed: its log counts all the same.
set -euo pipefail
what="${1:?check, write or print}" binary="$(realpath "${2:?a binary of tomoswarm}")" seeds="${3:-20}"
here="$(cd "$(dirname "$0")" && pwd)"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$here/../.."

one() {
    local scenario="$1" seed="$2" binary="$3" work="$4"
    local out="$work/$(echo "$scenario" | tr / _)-$seed"
    # A failed mission ends with 1; what was refused leaves no log.
    "$binary" sim "$scenario" --seed "$seed" --no-pictures --out "$out" >"$out.said" 2>&1 || true
    [ -s "$out/run.log" ] || { echo "$scenario $seed: no log" >&2; cat "$out.said" >&2; exit 1; }
    echo "$scenario $seed $(sha256sum "$out/run.log" | cut -d ' ' -f 1)"
    rm -rf "$out"
}
export -f one

list() {
    grep -v '^#' "$here/scenarios.txt" | while read -r scenario; do
        for seed in $(seq 1 "$seeds"); do echo "$scenario $seed"; done
    done
}

hashes() {
    list | BINARY="$binary" WORK="$work" xargs -P "$(nproc)" -L 1 bash -c 'one "$0" "$1" "$BINARY" "$WORK"' \
        | sort -k 1,1 -k 2,2n
}

case "$what" in
    print) hashes ;;
    write) hashes >"$work/pins" && mv "$work/pins" "$here/pins.txt" && wc -l "$here/pins.txt" ;;
    check)
        hashes >"$work/now"
        awk -v seeds="$seeds" '$2 <= seeds' "$here/pins.txt" >"$work/then"
        if diff "$work/then" "$work/now" >"$work/diff"; then
            echo "pins: all $(wc -l <"$work/now") logs are byte for byte as pinned"
        else
            cat "$work/diff"
            echo "pins: $(grep -c '^>' "$work/diff") of $(wc -l <"$work/now") logs differ" >&2
            exit 1
        fi
        ;;
    *) echo "check, write or print" >&2; exit 2 ;;
esac
