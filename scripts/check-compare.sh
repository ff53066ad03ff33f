#!/usr/bin/env bash
# Error rates of `compare --against` on this machine: N comparisons of one
# program with itself, and N with a copy of it that asks every 20th query of the
# octree twice, 5 % more work. A line for each comparison, then the sums.
# usage: [SLOWED=octree:20] [SIDES="same slowed"] scripts/check-compare.sh [N] [options of compare, e.g. --threshold 3%]
set -euo pipefail
cd "$(dirname "$0")/.."
n=${1:-40}
shift || true
slowed=${SLOWED:-octree:20}
sides=${SIDES:-same slowed}
cargo build --release --example slowed
found=target/compare-runs/${slowed/:/-}
rm -rf "$found"
mkdir -p "$found"
for side in same slowed; do cp target/release/examples/slowed "$found/$side"; done
echo "$slowed" >"$found/slowed.slowed"
# One of each in turns, so that both meet the same hours of the machine.
for i in $(seq "$n"); do
    for side in $sides; do
        code=0 began=$SECONDS
        "$found/$side" compare --against "$found/same" --seed "$i" --all --format json "$@" \
            >"$found/$side-$i.json" || code=$?
        echo "$side $i: exit $code, $((SECONDS - began)) s, $(grep '"head"' "$found/$side-$i.json")"
    done
done | tee "$found/log"
python3 scripts/check-compare.py "$found"
