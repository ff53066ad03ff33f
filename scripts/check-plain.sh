#!/usr/bin/env bash
# Compiles the library with plain arrays for vectors, as other architectures and
# interpreters get it: without one line of unsafe code, which the compiler then
# forbids. Runs the tests of kernels, answers and pinned bits on it.
set -euo pipefail
cd "$(dirname "$0")/.."
export RUSTFLAGS="--cfg plain_vectors"
cargo test --no-default-features --target-dir target/plain "$@" \
    --lib --test portable --test conformance --test kernels --test ranges \
    --test stability --test threads
