#!/usr/bin/env bash
# Instructions a query, of two builds, by valgrind's callgrind: they repeat to
# some millionths where times do not, but say nothing of caches and branches. A
# difference is a warning; the clock (`compare --against`) decides.
# usage: scripts/check-instructions.sh OLD NEW [STRUCTURE..]
set -euo pipefail
old=$1 new=$2
shift 2
[ $# -gt 0 ] || set -- linear bsp octree quadtree bvh wide
command -v valgrind >/dev/null || { echo "valgrind is not installed" >&2; exit 2; }
scene=city:n=20000 path=orbit:frames=64
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Instructions in timed laps / queries of those laps.
count() { # program structure
    rm -rf "$work/run" "$work"/out.*
    valgrind --tool=callgrind --trace-children=yes --collect-atstart=no \
        --toggle-collect='*timing::TaskTimer::time*' --callgrind-out-file="$work/out.%p" \
        "$1" run --suite compare --processes 1 --scene "$scene" --path "$path" \
        --structure "$2" --out "$work/run" >"$work/log" 2>&1 || { cat "$work/log" >&2; exit 2; }
    total=$(cat "$work"/out.* | awk '/^totals:/ { sum += $2 } END { printf "%d", sum }')
    awk -F, -v total="$total" '
        NR == 1 { for (i = 1; i <= NF; i++) if ($i == "queries") column = i; next }
        { queries += $column }
        END { if (queries == 0 || total == 0) exit 1; printf "%.1f", total / queries }' \
        "$work/run/samples.csv"
}

printf '%-16s %14s %14s %9s\n' structure old new change
for structure; do
    a=$(count "$old" "$structure") b=$(count "$new" "$structure")
    awk -v s="$structure" -v a="$a" -v b="$b" 'BEGIN {
        change = 100 * (b / a - 1)
        printf "%-16s %14.1f %14.1f %+8.2f%%%s\n", s, a, b, change, (change > 0.1 ? "  warning: more work" : "")
    }'
done
