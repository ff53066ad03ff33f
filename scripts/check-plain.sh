#!/usr/bin/env bash
# Compiles the library with plain arrays for vectors, as other architectures and
# interpreters get it: without one line of unsafe code, which the compiler then
# forbids. Runs the tests of kernels, answers and pinned bits on it.
# usage: scripts/check-plain.sh [what cargo test is to run, e.g. --lib]
set -euo pipefail
cd "$(dirname "$0")/.."
export CULLBENCH_PLAIN_VECTORS=1
[ $# -gt 0 ] || set -- --lib --test contract
cargo test --no-default-features "$@"
