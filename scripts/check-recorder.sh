#!/usr/bin/env bash
# Counts the instructions of region searches with a recorder that is off
# and of a copy without any recorder, in the test that compares their answers
# (src/index/tree/tests_recorder.rs). Fails if the former takes more than one
# per cent longer. Needs valgrind (Debian package `valgrind`).
set -euo pipefail
cd "$(dirname "$0")/.."
tests=$(cargo test --release --lib --no-run --message-format=json |
    sed -n 's/.*"executable":"\([^"]*\)".*/\1/p')
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
count() {
    valgrind --tool=callgrind --callgrind-out-file="$folder/$1" \
        --toggle-collect="*tests_recorder::$1*" \
        "$tests" tests_recorder --test-threads=1 >/dev/null 2>&1
    sed -n 's/^\(summary\|totals\): //p' "$folder/$1" | head -n 1
}
with=$(count by_library)
without=$(count by_hand)
echo "instructions: $with with a recorder that is off, $without without a recorder"
# Nothing counted is a name that valgrind does not find.
[ "$without" -gt 0 ] && [ "$with" -le $((without + without / 100)) ]
