#!/usr/bin/env bash
# Every reader of input, by fuzz/ on the stable toolchain: first what fuzz/corpus holds, then
# mutations of it, one reader on each processor. What is found stays in target/fuzz/NAME: inputs
# that fail, and those that reach more code, where the next call begins.
#
# usage: scripts/fuzz.sh [SECONDS] [READER..]   (default: 10 seconds, all of them; 0: replay only)
#        FUZZ_LEVEL=2 scripts/fuzz.sh 600       (optimised: worth it from a minute on)
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-10}
readers=("${@:2}")
[ ${#readers[@]} -gt 0 ] || mapfile -t readers < <(ls fuzz/corpus)
target=$(rustc --print host-tuple)

# What libFuzzer follows. With a --target, macros and build scripts are compiled without it,
# and are those of the other builds in this folder.
coverage=(--cfg fuzzing -Cpasses=sancov-module)
for argument in level=4 inline-8bit-counters pc-table trace-compares; do
    coverage+=("-Cllvm-args=-sanitizer-coverage-$argument")
done
RUSTFLAGS="${coverage[*]}" CARGO_INCREMENTAL=0 cargo build \
    --manifest-path fuzz/Cargo.toml --target "$target" --target-dir target \
    --config "profile.dev.package.cullbench.opt-level=${FUZZ_LEVEL:-0}"

# One reader; all that is said of it only if it fails.
fuzz() {
    local reader=$1 found=target/fuzz/$1
    local own=fuzz/corpus/$reader log=$found/log
    mkdir -p "$found/corpus"
    # Words to put in whole, such as names of columns.
    grep -aohE '[A-Za-z_][A-Za-z_0-9-]{2,30}' -r "$own" | sort -u | sed 's/.*/"&"/' >"$found/words"
    local run=(env FUZZ_READER="$reader" "$program" -timeout=10 -rss_limit_mb=2048 -max_len=16384
        -dict="$found/words" -artifact_prefix="$found/")
    local mutate=("${run[@]}" -max_total_time="$seconds" "$found/corpus" "$own")
    [ "$seconds" -gt 0 ] || mutate=(true)
    if "${run[@]}" "$own"/* >"$log" 2>&1 && "${mutate[@]}" >>"$log" 2>&1; then
        echo "$reader: $(find "$own" -type f | wc -l) inputs; $(sed -n 's/^Done //p' "$log")"
    else
        cat "$log"
        return 1
    fi
}
export -f fuzz
export seconds program=target/$target/debug/fuzz
# In memory if there is such a place: runs are written and synchronised.
TMPDIR=$(mktemp -d -p /dev/shm 2>/dev/null || mktemp -d)
export TMPDIR
trap 'rm -rf "$TMPDIR"' EXIT
printf '%s\n' "${readers[@]}" | xargs -P "$(nproc)" -I{} bash -c 'fuzz {}'
