#!/usr/bin/env bash
# Pins of every answer: runs the program's commands and compares a hash of each group of rows,
# times left out, with scripts/answers.pins. Exit 1 and a line per group that changed, left or
# joined.
#
#   scripts/check-answers.sh [PROGRAM]            check [default: target/release/cullbench, built]
#   scripts/check-answers.sh --record PROGRAM     write the pins of today's answers
set -euo pipefail
cd "$(dirname "$0")/.."
record=()
if [ "${1-}" = --record ]; then
    record=(--record)
    shift
fi
program=${1-target/release/cullbench}
[ $# -gt 0 ] || cargo build --release
exec python3 scripts/answers.py "${record[@]}" "$program" scripts/answers.pins
