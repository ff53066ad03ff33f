#!/usr/bin/env bash
# Counts the instructions of region searches with a recorder that is off
# and of a copy without any recorder. Fails if the former takes more than one
# per cent longer. Needs valgrind (Debian package `valgrind`).
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --quiet --example recorder_cost
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
count() {
    valgrind --tool=callgrind --callgrind-out-file="$folder/$1" \
        --toggle-collect="*recorder_cost::$1*" \
        target/release/examples/recorder_cost "$1" >"$folder/$1.ids" 2>/dev/null
    sed -n 's/^\(summary\|totals\): //p' "$folder/$1" | head -n 1
}
with=$(count with)
without=$(count without)
cmp "$folder/with.ids" "$folder/without.ids"
echo "instructions: $with with a recorder that is off, $without without a recorder"
# Nothing counted is a name that valgrind does not find.
[ "$without" -gt 0 ] && [ "$with" -le $((without + without / 100)) ]
