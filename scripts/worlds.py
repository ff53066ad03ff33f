#!/usr/bin/env python3
"""Writes docs/WORLDS.md from results/worlds: the real scenes and what is fastest in them.

usage: scripts/worlds.py [CULLBENCH]

With an optimised CULLBENCH the suite `real` is measured first (a few minutes; run
scripts/fetch.py before) and stored in results/worlds.
"""

import csv
import gzip
import json
import math
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "results" / "worlds"
PAGE = ROOT / "docs" / "WORLDS.md"
FOLDER = "datasets/fetched/"


def cullbench(*arguments):
    done = subprocess.run([sys.argv[1], *arguments], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    if done.returncode:
        sys.exit(f"worlds.py: `{' '.join(arguments)}` failed; expected exit code 0")
    return done.stdout


def measure():
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        cullbench("run", "--suite", "real", "--no-bounds", "--out", str(out))
        RESULTS.mkdir(exist_ok=True)
        shutil.copy(out / "summary.csv", RESULTS)
        with open(out / "report.json", "rb") as report, \
                gzip.GzipFile(RESULTS / "report.json.gz", "wb", mtime=0) as packed:
            shutil.copyfileobj(report, packed)
    names = dict.fromkeys(row["scene"] for row in rows())
    keys = ["total_count", "region_count", "bounds_min", "bounds_max", "origin", "size_min",
            "size_max", "unit"]
    scenes = {}
    for name in names:
        info = json.loads(cullbench("scene", "info", name, "--format", "json"))
        scenes[name] = {key: info[key] for key in keys}
    (RESULTS / "scenes.json").write_text(json.dumps(scenes, indent=1) + "\n")


def rows():
    with open(RESULTS / "summary.csv", newline="") as table:
        return [row for row in csv.DictReader(table) if row["status"] == "ok"]


def number(value):
    if value >= 1e6:
        return f"{value / 1e6:.3g}M"
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def time(ns):
    return f"{ns:.0f} ns" if ns < 1000 else f"{ns / 1000:.3g} us"


def step(info):
    """Spacing of f32 at the scene's farthest coordinate."""
    reach = max(abs(v - o) for bound in ["bounds_min", "bounds_max"]
                for v, o in zip(info[bound], info["origin"]))
    return 2.0 ** (math.floor(math.log2(reach)) - 23) if reach else 0.0


def best(cells, metric):
    cells = [c for c in cells if c.get(metric)]
    return min(cells, key=lambda c: float(c[metric]), default=None)


def size_ratio(info):
    low, high = info["size_min"], info["size_max"]
    # Points become boxes of one step of f32.
    return "points" if high <= 4 * step(info) else f"1 : {number(high / low)}" if low else "from 0"


def table(scenes):
    cells = rows()
    lines = []
    for name, info in scenes.items():
        own = [c for c in cells if c["scene"] == name]
        paths = dict.fromkeys(c["path"] for c in own)
        for path in paths:
            here = [c for c in own if c["path"] == path and c["cache"] == "warm"]
            linear = next(c for c in here if c["structure"] == "linear")
            first = best(here, "query_ns")
            found = best(here, "locate_ns")
            extent = [b - a for a, b in zip(info["bounds_min"], info["bounds_max"])]
            is_first = path == next(iter(paths))
            shown = [name.replace(FOLDER, ""), f"{info['total_count']:,}",
                     " x ".join(number(e) for e in extent), size_ratio(info), f"{step(info):.1e}"]
            ratio = float(linear["query_ns"]) / float(first["query_ns"])
            regions = f"{info['region_count']:,}: {found['structure']} {time(float(found['locate_ns']))}" \
                if found else ""
            lines.append("| " + " | ".join([
                *(shown if is_first else [""] * len(shown)), path.split(":")[0],
                f"{100 * float(linear['cull_rate']):.0f} %", first["structure"],
                time(float(first["query_ns"])), f"{ratio:.2f} x", regions]) + " |")
    return "\n".join(lines)


HEAD = """# Real worlds

Written by `scripts/worlds.py` from [results/worlds](../results/worlds) (`run --suite real`, {cpu},
{date}, {processes} processes). Fetch the scenes with `scripts/fetch.py`; licences are in
[datasets](../datasets/README.md) and `scripts/fetch.py --list`.

*Sizes* compares the shortest longest edge of an item with the longest; *f32 step* is the spacing
of f32 at the farthest coordinate, in the scene's unit; *culled* is the share of items outside of
the view; *speed-up* is over the SIMD scan `linear`; *regions* are their number and the fastest
structure that finds the region of the eye.

| scene | items | extent | sizes | f32 step | path | culled | fastest | time per query | speed-up | regions |
|---|---|---|---|---|---|---|---|---|---|---|
"""


def main():
    if len(sys.argv) > 1:
        measure()
    scenes = json.loads((RESULTS / "scenes.json").read_text())
    with gzip.open(RESULTS / "report.json.gz") as packed:
        report = json.load(packed)
    head = HEAD.format(cpu=report["machine"]["cpu"], date=report["run"]["started_at"][:10],
                       processes=report["cells"][0]["times"]["processes"])
    notes = PAGE.read_text().partition("\n## ")[2] if PAGE.exists() else "What surprised\n"
    PAGE.write_text(head + table(scenes) + "\n\n## " + notes)


if __name__ == "__main__":
    main()
