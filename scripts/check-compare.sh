#!/usr/bin/env bash
# Error rates of `compare --against` on this machine: N comparisons of one
# program with itself, and N with a build that asks every 20th query of the octree
# twice, 5 % more work. A line for each comparison, then the sums.
# usage: scripts/check-compare.sh [N] [options of compare, e.g. --threshold 3%]
set -euo pipefail
cd "$(dirname "$0")/.."
n=${1:-40}
shift || true
cargo build --release
cp target/release/cullbench target/compare-old
CULLBENCH_SLOWED=${CULLBENCH_SLOWED:-octree:20} cargo build --release --target-dir target/slowed
found=target/compare-runs
rm -rf "$found"
mkdir -p "$found"
# One of each in turns, so that both meet the same hours of the machine.
for i in $(seq "$n"); do
    for side in same slowed; do
        new=target/compare-old
        [ "$side" = slowed ] && new=target/slowed/release/cullbench
        code=0 began=$SECONDS
        "$new" compare --against target/compare-old --seed "$i" --all --format json "$@" \
            >"$found/$side-$i.json" || code=$?
        echo "$side $i: exit $code, $((SECONDS - began)) s, $(grep '"head"' "$found/$side-$i.json")"
    done
done | tee "$found/log"
python3 scripts/check-compare.py "$found"
