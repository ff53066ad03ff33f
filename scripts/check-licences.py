#!/usr/bin/env python3
"""Licences of all dependencies, every feature and target included: each must be
satisfiable by the list below, as `cargo deny check licenses` has it. Advisories
need a database from the network: `cargo deny check advisories` is for those.

usage: scripts/check-licences.py    (exit code 1: a licence that is not allowed)
"""

import json
import pathlib
import re
import subprocess
import sys

# What a program under MIT or Apache-2.0 may contain, with its notice.
ALLOWED = {
    "0BSD",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "ISC",
    "MIT",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
}

# Packages that bring a text only, as it was read.
READ = {"fuchsia-cprng 0.1.1": "BSD-3-Clause"}


def allowed(expression):
    """Whether an SPDX expression can be satisfied; `/` is the older `OR`."""
    spaced = expression.replace("/", " OR ").replace("(", " ( ").replace(")", " ) ")
    words = re.sub(r"\s+WITH\s+", "\0WITH\0", spaced).split()

    def either():
        found = both()
        while words and words[0] == "OR":
            words.pop(0)
            found = both() or found
        return found

    def both():
        found = one()
        while words and words[0] == "AND":
            words.pop(0)
            found = one() and found
        return found

    def one():
        word = words.pop(0)
        if word != "(":
            return word.replace("\0", " ") in ALLOWED
        found = either()
        words.pop(0)
        return found

    return either() and not words


def main():
    top = pathlib.Path(__file__).resolve().parent.parent
    command = ["cargo", "metadata", "--format-version=1", "--all-features", "--locked"]
    read = subprocess.run(command, cwd=top, check=True, stdout=subprocess.PIPE)
    packages = json.loads(read.stdout)["packages"]
    names = [f"{p['name']} {p['version']}" for p in packages]
    licences = [p["license"] or READ.get(name) for p, name in zip(packages, names)]
    refused = [
        f"{name}: {licence or 'no licence expression'}"
        for name, licence in zip(names, licences)
        if not (licence and allowed(licence))
    ]
    print("\n".join(refused) or f"{len(packages)} packages, all with a licence that is allowed")
    return 1 if refused else 0


# The reading of expressions itself.
assert allowed("MIT/GPL-3.0") and allowed("(GPL-3.0 OR MIT) AND Zlib")
assert not allowed("MIT AND GPL-3.0") and not allowed("GPL-3.0 OR (MIT AND LGPL-2.1)")
assert allowed("Apache-2.0 WITH LLVM-exception") and not allowed("GPL-2.0 WITH GCC-exception-2.0")

if __name__ == "__main__":
    sys.exit(main())
