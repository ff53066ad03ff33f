#!/usr/bin/env bash
# Runs the tests that touch `unsafe` (vectors, outputs, traversals of every
# instruction set on empty, tiny and unaligned sizes) under AddressSanitizer:
# any read or write outside of an allocation fails, also by the vector
# instructions that an interpreter cannot run. The runtime comes with the
# toolchain; the switch is unstable, hence RUSTC_BOOTSTRAP on a stable one.
set -euo pipefail
cd "$(dirname "$0")/.."
target=$(rustc -vV | sed -n 's/^host: //p')
export RUSTC_BOOTSTRAP=1
# Tests leak on purpose what has to live as long as they do.
export ASAN_OPTIONS=detect_leaks=0
export RUSTFLAGS="-Zsanitizer=address -Cforce-frame-pointers=yes"
# Build scripts and proc macros are for the host: a target of its own keeps
# the sanitizer out of them.
cargo test --target "$target" --target-dir target/sanitizer "$@" \
    --lib --test contract
