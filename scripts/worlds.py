#!/usr/bin/env python3
"""Writes docs/WORLDS.md from results/worlds: the real scenes and what is fastest in them.

usage: scripts/worlds.py [CULLBENCH [info]]

With an optimised CULLBENCH the suite `real` is measured first (a few minutes; run
scripts/fetch.py before) and stored in results/worlds; with `info` only what `scene info` says of
the scenes is.
"""

import csv
import gzip
import json
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


# Runs and their options; the second takes every triangle for an item.
PATHS = ["--path", "flythrough:frames=128", "--path", "outside:frames=64"]
RUNS = {"real": ["--suite", "real"],
        "triangles": ["--scene", f"{FOLDER}sponza.obj", "--scene", f"{FOLDER}kitchen.obj", *PATHS]}
TRIANGLES = ["--items", "triangles"]
KEYS = ["total_count", "region_count", "extent", "size_min", "size_max", "unit", "f32_loss"]
# Units of files that state none.
UNITS = {f"{FOLDER}cities.csv": "degrees", f"{FOLDER}stars.csv": "parsecs"}


def measure():
    RESULTS.mkdir(exist_ok=True)
    for run, arguments in RUNS.items():
        more = TRIANGLES if run == "triangles" else []
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "run"
            cullbench("run", *arguments, *more, "--no-bounds", "--out", str(out))
            shutil.copy(out / "summary.csv", RESULTS / f"{run}.csv")
            with open(out / "report.json", "rb") as report, \
                    gzip.GzipFile(RESULTS / f"{run}.json.gz", "wb", mtime=0) as packed:
                shutil.copyfileobj(report, packed)


def report_of(run):
    with gzip.open(RESULTS / f"{run}.json.gz") as packed:
        return json.load(packed)


def describe():
    """Stores what `scene info` says of the scenes that were measured, and of no others."""
    scenes = {}
    for run in RUNS:
        more = TRIANGLES if run == "triangles" else []
        digests = {cell["scene"]["name"]: cell["scene"]["digest"] for cell in report_of(run)["cells"]}
        for name in dict.fromkeys(row["scene"] for row in rows(run)):
            info = json.loads(cullbench("scene", "info", name, "--format", "json", *more))
            if info["digest"] != digests[name]:
                sys.exit(f"worlds.py: {name} is not the scene of {run}.json.gz; expected its digest")
            scenes.setdefault(run, {})[name] = {key: info[key] for key in KEYS}
    (RESULTS / "scenes.json").write_text(json.dumps(scenes, indent=1) + "\n")


def rows(run):
    with open(RESULTS / f"{run}.csv", newline="") as table:
        return [row for row in csv.DictReader(table) if row["status"] == "ok"]


def number(value):
    if value >= 1e6:
        return f"{value / 1e6:.3g}M"
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def time(ns):
    return f"{ns:.0f} ns" if ns < 1000 else f"{ns / 1000:.3g} us"


def loss(info):
    """Most that bounds move when they are rounded to f32."""
    most = max(info["f32_loss"])
    return f"{most:.1e}".replace("e-0", "e-") if most else "0"


def best(cells, metric):
    cells = [c for c in cells if c.get(metric)]
    return min(cells, key=lambda c: float(c[metric]), default=None)


def fastest(cells):
    """The cell of the first rank, `wide` if it shares it, and its label."""
    tied = sorted((c for c in cells if c["rank"] == "1"), key=lambda c: float(c["query_ns"]))
    first = next((c for c in tied if c["structure"] == "wide"), tied[0])
    return first, first["structure"] + (f" ({len(tied)} tied)" if len(tied) > 1 else "")


def size_ratio(info):
    low, high = info["size_min"], info["size_max"]
    return "points" if not high else f"1 : {number(high / low)}" if low else "from 0"


def along(path, cells):
    """A path, its share of culled items and the fastest structure."""
    here = [c for c in cells if c["path"] == path and c["cache"] == "warm"]
    linear = next(c for c in here if c["structure"] == "linear")
    first, label = fastest(here)
    ratio = float(linear["query_ns"]) / float(first["query_ns"])
    return (f"{path.split(':')[0]}, {100 * float(linear['cull_rate']):.0f} % culled: {label} "
            f"{time(float(first['query_ns']))}, {ratio:.3g} x")


def table(run, scenes):
    cells = rows(run)
    lines = []
    for name, info in scenes.items():
        own = [c for c in cells if c["scene"] == name]
        unit = info["unit"] or UNITS.get(name)
        extent = " x ".join(number(e) for e in info["extent"]) + (f" {unit}" if unit else "")
        shown = [name.replace(FOLDER, "") + (", triangles" if run == "triangles" else ""),
                 f"{info['total_count']:,}", extent, size_ratio(info), loss(info)]
        shown.append("; ".join(along(path, own) for path in dict.fromkeys(c["path"] for c in own)
                               if not path.startswith("outside")))
        inside = own[0]["path"]
        found = best([c for c in own if c["path"] == inside], "locate_ns")
        shown.append(f"{info['region_count']:,}: {found['structure']} "
                     f"{time(float(found['locate_ns']))}" if found else "")
        lines.append("| " + " | ".join(shown) + " |")
    return "\n".join(lines)


HEAD = """# Real worlds

Written by `scripts/worlds.py` from [results/worlds](../results/worlds) (`run --suite real`,
{cpu}, {date}, {processes} processes). Fetch the scenes with `scripts/fetch.py`; licences are
in [datasets](../datasets/README.md) and `scripts/fetch.py --list`.

*Sizes*: shortest to longest, of the items' longest edges. *f32 loss*: how far f32 moves a bound
outward at most, in the unit of the extent (the unit of an OBJ is not known). *Paths*: share of
items outside of the view (98 % where the far plane is set for 2 % visible), the fastest structure
(`wide` where it ties for it; *tied*: how many share the rank), its time per query, and its speed-up
over the SIMD scan `linear`. *Regions*: their number, and the structure that finds that of the eye
in the least time along the first path.

| scene | items | extent | sizes | f32 loss | paths | regions |
|---|---|---|---|---|---|---|
"""


def main():
    if len(sys.argv) > 1:
        if sys.argv[2:] != ["info"]:
            measure()
        describe()
    scenes = json.loads((RESULTS / "scenes.json").read_text())
    report = report_of("real")
    head = HEAD.format(cpu=report["machine"]["cpu"], date=report["run"]["started_at"][:10],
                       processes=report["cells"][0]["times"]["processes"])
    notes = PAGE.read_text().partition("\n## ")[2] if PAGE.exists() else "What surprised\n"
    tables = "\n".join(table(run, scenes[run]) for run in scenes)
    PAGE.write_text(head + tables + "\n\n## " + notes)


if __name__ == "__main__":
    main()
