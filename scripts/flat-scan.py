#!/usr/bin/env python3
"""Draws docs/flat-scan.svg from results/flat-scan: where a tree begins to pay beside a flat scan.

usage: scripts/flat-scan.py [CULLBENCH]

With an optimised CULLBENCH both runs are measured first (two minutes of CPU time) and stored in
results/flat-scan. Standard library only.
"""

import csv
import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "results" / "flat-scan"
PICTURE = ROOT / "docs" / "flat-scan.svg"

SIZES = [64, 256, 1024, 4096, 16384, 65536, 262144, 1048576]
PATHS = {1: "flythrough:frames=64,visible=1%", 10: "flythrough:frames=64,visible=10%",
         50: "orbit:frames=64,visible=50%", 100: "outside:frames=64"}
MOTIONS = {"1 %": "drift:share=1%,frames=40", "all": "drift:share=1,frames=8"}
# Runs by name: their options.
RUNS = {
    "still": ["--structure", "linear,wide", "--threads", "1,2", "--cold"],
    "moving": ["--structure", "linear,wide,moving",
               *(word for motion in MOTIONS.values() for word in ("--motion", motion))],
}
COLUMNS = ["scene", "path", "motion", "cache", "structure", "status", "rank", "processes", "total_count",
           "visible_count", "query_ns", "query_ns_lower", "query_ns_upper", "query_wall_ns", "speedup",
           "speedup_lower", "speedup_upper", "frame_ns", "update_ns", "worst_frame_ns"]


def measure(program):
    RESULTS.mkdir(exist_ok=True)
    where = [word for n in SIZES for word in ("--scene", f"city:n={n}")]
    where += [word for path in PATHS.values() for word in ("--path", path)]
    for name, options in RUNS.items():
        load = os.getloadavg()[0]
        with tempfile.TemporaryDirectory() as folder:
            command = [program, "run", *where, *options, "--processes", "3", "--no-bounds", "--out",
                       f"{folder}/run"]
            if subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL).returncode:
                sys.exit(f"flat-scan.py: `run` failed for {name}; expected exit code 0")
            with open(f"{folder}/run/summary.csv", newline="") as table, \
                    open(RESULTS / f"{name}.csv", "w", newline="") as kept:
                out = csv.DictWriter(kept, COLUMNS, extrasaction="ignore", lineterminator="\n")
                out.writeheader()
                out.writerows(csv.DictReader(table))
            report = json.loads(Path(f"{folder}/run/report.json").read_text())
            about = {key: report["machine"][key] for key in ["cpu", "cores", "instruction_set", "caches"]}
            about["started_at"] = report["run"]["started_at"]
            about["load_average"] = [round(load, 1), round(os.getloadavg()[0], 1)]
            (RESULTS / f"{name}.json").write_text(json.dumps(about, indent=1) + "\n")


def rows(name):
    with open(RESULTS / f"{name}.csv", newline="") as table:
        return [row for row in csv.DictReader(table) if row["status"] == "ok"]


def cells(found, size, path, **wanted):
    """The rows of a scene and path by structure."""
    here = (row for row in found if row["scene"] == f"city:n={size}" and row["path"] == path)
    return {row["structure"]: row for row in here if all(row[k] == v for k, v in wanted.items())}


def still(cache):
    def ratio(size, path):
        tree = cells(FOUND["still"], size, path, cache=cache)["wide"]
        low, high = float(tree["speedup_lower"]), float(tree["speedup_upper"])
        return float(tree["speedup"]), low <= 1 <= high
    return ratio


def two_threads(size, path):
    here = cells(FOUND["still"], size, path, cache="warm")
    scan, tree = (float(here[name]["query_wall_ns"]) for name in ("linear:threads=2", "wide"))
    found = scan / tree
    return found, abs(found - 1) < 0.1


def moved(motion):
    def ratio(size, path):
        here = cells(FOUND["moving"], size, path, motion=motion)
        tree = min((here["wide"], here["moving"]), key=lambda row: float(row["frame_ns"]))
        low, high = float(tree["speedup_lower"]), float(tree["speedup_upper"])
        return float(tree["speedup"]), low <= 1 <= high
    return ratio


GROUPS = {
    "still": still("warm"),
    "still, cold caches": still("cold"),
    "still, scan on 2 threads": two_threads,
    "1 % moved per frame": moved(MOTIONS["1 %"]),
    "all moved per frame": moved(MOTIONS["all"]),
}
WIDTH, HEIGHT, LEFT, TOP, GAP = 62, 22, 232, 64, 10
SCAN, TIE, TREE = "#d9a441", "#e9e9e9", "#2f6fb0"


def colour(ratio, is_tie):
    """Fill and text: deeper the farther the ratio is from 1, up to a factor of 16."""
    if is_tie:
        return TIE, "#222"
    depth = 0.25 + 0.75 * min(abs(math.log2(ratio)) / 4, 1)
    full = TREE if ratio > 1 else SCAN
    parts = (int(full[i:i + 2], 16) for i in (1, 3, 5))
    mixed = "".join(f"{round(255 + (part - 255) * depth):02x}" for part in parts)
    return f"#{mixed}", "#fff" if ratio > 1 and depth > 0.7 else "#222"


def size_name(size):
    return f"{size >> 20}M" if size >> 20 else f"{size >> 10}k" if size >> 10 else str(size)


def draw():
    out, y = [], TOP

    def text(x, y, what, more=""):
        out.append(f'<text x="{x}" y="{y}"{more}>{what}</text>')

    text(10, 18, "Time of a frame by a flat scan / by a tree: above 1 the tree pays", ' font-weight="bold"')
    text(10, 36, "rows: share of the items in view; columns: items; grey: the 95 % interval contains 1")
    middle = ' text-anchor="middle"'
    for i, size in enumerate(SIZES):
        text(LEFT + (i + 0.5) * WIDTH, TOP - 8, size_name(size), middle)
    for group, ratio in GROUPS.items():
        text(10, y + 15, group, ' font-weight="bold"')
        for share, path in PATHS.items():
            text(LEFT - 8, y + 15, f"{share} %", ' text-anchor="end"')
            for i, size in enumerate(SIZES):
                found, is_tie = ratio(size, path)
                fill, ink = colour(found, is_tie)
                x = LEFT + i * WIDTH
                out.append(f'<rect x="{x}" y="{y}" width="{WIDTH - 1}" height="{HEIGHT - 1}" '
                           f'fill="{fill}"/>')
                shown = f"{found:.2f}" if found < 1.995 else f"{found:.1f}" if found < 9.95 else f"{found:.0f}"
                text(x + WIDTH / 2, y + 15, shown, f'{middle} fill="{ink}"')
            y += HEIGHT
        y += GAP
    size = f'width="{LEFT + len(SIZES) * WIDTH + 10}" height="{y}"'
    PICTURE.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" '
                       'font-size="12" fill="#222">\n<rect width="100%" height="100%" fill="#fff"/>\n'
                       + "\n".join(out) + "\n</svg>\n")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        measure(sys.argv[1])
    FOUND = {name: rows(name) for name in RUNS}
    draw()
