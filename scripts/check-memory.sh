#!/usr/bin/env bash
# Builds and culls ten million boxes with every structure and holds the peak
# of resident memory to 3 GB. Needs GNU time (Debian package `time`).
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --quiet
limit_kb=$((3 * 1000 * 1000 * 1000 / 1024))
measure() {
    local peak
    peak=$(/usr/bin/time -f %M target/release/cullbench "$@" 2>&1 >/dev/null | tail -n 1)
    echo "cullbench $*: peak $((peak / 1024)) MiB"
    [ "$peak" -le "$limit_kb" ] || { echo "more than 3 GB" >&2; exit 1; }
}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
measure query --scene uniform:n=10000000 --cameras flythrough:frames=4,visible=2% --structure all
measure run --scene uniform:n=10000000 --path flythrough:frames=8,visible=2% --structure linear,bvh --out "$out/run"
