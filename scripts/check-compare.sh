#!/usr/bin/env bash
# Error rates of `compare --against` on this machine: N comparisons of one
# program with itself, and N with a build whose octree does 5 % more work.
# usage: scripts/check-compare.sh [N] [options of compare, e.g. --threshold 3%]
set -euo pipefail
cd "$(dirname "$0")/.."
n=${1:-40}
shift || true
cargo build --release
cp target/release/cullbench target/compare-old
CULLBENCH_SLOWED=${CULLBENCH_SLOWED:-octree:20} cargo build --release --target-dir target/slowed
for side in same slowed; do
    new=target/compare-old
    [ "$side" = slowed ] && new=target/slowed/release/cullbench
    for i in $(seq "$n"); do
        code=0
        "$new" compare --against target/compare-old --seed "$i" --all --format json "$@" \
            >"target/compare-$side-$i.json" || code=$?
        echo "$side $i: exit $code"
    done
done
