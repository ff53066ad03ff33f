#!/usr/bin/env bash
# Spelling of text and code by typos (crate typos-cli), as typos.toml says. A
# program of that version on the path is taken; otherwise the binary wheel
# comes from PyPI, once, into target/tools: needs python3 with pip.
set -euo pipefail
cd "$(dirname "$0")/.."
export PIP_ROOT_USER_ACTION=ignore
version=1.52.0
tools=target/tools/typos-$version
is_right() { [ "$("$1" --version 2>/dev/null)" = "typos-cli $version" ]; }
typos=typos
if ! is_right "$typos"; then
    typos=$tools/bin/typos
    if ! is_right "$typos" && ! python3 -m pip install --quiet --disable-pip-version-check \
        --no-deps --upgrade --target "$tools" "typos==$version"; then
        echo "check-spelling: typos $version is not installed and pip cannot fetch it:" \
            "\`cargo install typos-cli --locked --version $version\` does as well" >&2
        exit 2
    fi
fi
"$typos" "$@"
