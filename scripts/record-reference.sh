#!/usr/bin/env bash
# Records the committed reference run: the quick suite, without the samples.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --quiet
fresh=$(mktemp -d)
trap 'rm -rf "$fresh"' EXIT
target/release/cullbench run --out "$fresh/run"
rm -rf results/reference
mkdir -p results/reference
cp "$fresh/run/report.json" "$fresh/run/summary.csv" results/reference/
