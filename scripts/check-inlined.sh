#!/usr/bin/env bash
# Every vector instruction of a built program is inlined: one that is left as a function stands in
# code that was compiled without the instruction set, such as a closure that is called twice (the
# sphere test of the trees was eight times slower). Those of bytes are of crates that search text.
# usage: scripts/check-inlined.sh CULLBENCH
set -euo pipefail
left=$(nm --demangle "$1" | grep 'core_arch::x86::' | grep -v '_xgetbv\|_epi8' | cut -c20- | sort -u || true)
[ -z "$left" ] || { echo "not inlined:" >&2; echo "$left" >&2; exit 1; }
echo "check-inlined: every vector instruction is inlined"
