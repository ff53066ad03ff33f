#!/usr/bin/env bash
# Runs the portable path on small scenes (tests/contract/portable.rs) under Miri, which
# sees what a sanitizer cannot: memory that was never written, pointers that
# have no right to where they point. Miri is a component of nightly toolchains
# (`rustup toolchain install nightly --component miri`); under it the vectors
# are plain arrays and the crate has no unsafe code, so what it looks at is the
# crates below: the casts of bytemuck and the vectors of glam.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo "+${MIRI_TOOLCHAIN:-nightly}" miri test --no-default-features --test contract portable:: "$@"
