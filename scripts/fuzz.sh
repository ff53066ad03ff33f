#!/usr/bin/env bash
# Every reader of input, by fuzz/ on the stable toolchain: first what fuzz/corpus holds, then
# mutations of it. What is found stays in target/fuzz/NAME: a crash stops the script, and
# inputs that reach more code are where the next call begins.
#
# usage: scripts/fuzz.sh [SECONDS] [READER..]   (default: 10 seconds, all of them; 0: replay only)
#        FUZZ_LEVEL=2 scripts/fuzz.sh 600       (optimised: worth it from a minute on)
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-10}
readers=("${@:2}")
[ ${#readers[@]} -gt 0 ] || mapfile -t readers < <(ls fuzz/corpus)
level=${FUZZ_LEVEL:-0}
target=$(rustc --print host-tuple)

# What libFuzzer follows. With a --target, macros and build scripts are compiled without it,
# and are those of the other builds in this folder.
coverage=(--cfg fuzzing -Cpasses=sancov-module)
for argument in level=4 inline-8bit-counters pc-table trace-compares; do
    coverage+=("-Cllvm-args=-sanitizer-coverage-$argument")
done
RUSTFLAGS="${coverage[*]}" CARGO_INCREMENTAL=0 cargo build \
    --manifest-path fuzz/Cargo.toml --target "$target" --target-dir target \
    --config "profile.dev.package.cullbench.opt-level=$level"

# In memory if there is such a place: runs are written and synchronised.
scratch=$(mktemp -d -p /dev/shm 2>/dev/null || mktemp -d)
trap 'rm -rf "$scratch"' EXIT
for reader in "${readers[@]}"; do
    found=target/fuzz/$reader
    # Words to put in whole, such as names of columns.
    grep -aohE '[A-Za-z_][A-Za-z_0-9-]{2,30}' -r "fuzz/corpus/$reader" |
        sort -u | sed 's/.*/"&"/' >"$scratch/words"
    run=(env TMPDIR="$scratch" FUZZ_READER="$reader" "target/$target/debug/fuzz"
        -timeout=10 -rss_limit_mb=2048 -max_len=16384 -dict="$scratch/words"
        -artifact_prefix="$found/")
    mapfile -t corpus < <(find "fuzz/corpus/$reader" -type f)
    mkdir -p "$found/corpus"
    log=$found/log
    mutate=("${run[@]}" -max_total_time="$seconds" "$found/corpus" "fuzz/corpus/$reader")
    [ "$seconds" -gt 0 ] || mutate=(true)
    { "${run[@]}" "${corpus[@]}" && "${mutate[@]}"; } >"$log" 2>&1 || { cat "$log" && exit 1; }
    echo "$reader: ${#corpus[@]} inputs replayed; $(sed -n 's/^Done //p' "$log")"
done
